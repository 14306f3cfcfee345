// Makes one mistake through the OpenXR loader: a structure of the wrong type. What a validation layer says of it shows
// that the layer is there and how it speaks. A runtime that is unavailable is asked once more.
// With LEAVE in the environment it ends without destroying its instance.
#include <stdio.h>
#include <stdlib.h>
#include <openxr/openxr.h>

int main(void) {
    XrInstanceCreateInfo info = {.type = XR_TYPE_INSTANCE_CREATE_INFO,
        .applicationInfo = {.applicationName = "one mistake", .apiVersion = XR_MAKE_VERSION(1, 0, 0)}};
    XrInstance instance = XR_NULL_HANDLE;
    XrResult code = xrCreateInstance(&info, &instance);
    printf("xrCreateInstance %d\n", code);
    if (code == XR_ERROR_RUNTIME_UNAVAILABLE) {
        code = xrCreateInstance(&info, &instance);
        printf("xrCreateInstance again %d\n", code);
    }
    if (XR_FAILED(code)) return 1;
    XrSystemGetInfo get = {.type = XR_TYPE_UNKNOWN, .formFactor = XR_FORM_FACTOR_HEAD_MOUNTED_DISPLAY};
    XrSystemId system = XR_NULL_SYSTEM_ID;
    printf("xrGetSystem %d\n", xrGetSystem(instance, &get, &system));
    if (getenv("LEAVE")) return 0;
    code = xrDestroyInstance(instance);
    printf("xrDestroyInstance %d\n", code);
    return XR_FAILED(code);
}
