// Calls every function of an OpenXR runtime wrongly on purpose: each argument in turn is made wrong in every way that
// its kind can be wrong, and the result code compared with what the specification (or, where it leaves the matter
// open, this runtime's strictness) wants. The library is loaded directly, without a loader, which would keep null
// pointers from it.
//
//   misuse LIBRARY [FUNCTION]      all functions, or the argument sweep of one
//
// Prints "called NAME" for every function called, a line per wrong answer, and ends in status 1 if there was one.
#define _GNU_SOURCE
#define XR_USE_GRAPHICS_API_VULKAN
#define XR_USE_TIMESPEC
#include <dlfcn.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <vulkan/vulkan.h>
#include <openxr/openxr.h>
#include <openxr/openxr_platform.h>

// --- what older headers lack ---------------------------------------------------------------------------------------

#ifndef XR_VERSION_1_1
#define XR_TYPE_SPACES_LOCATE_INFO ((XrStructureType)1000471000)
#define XR_TYPE_SPACE_LOCATIONS ((XrStructureType)1000471001)
typedef struct {
    XrStructureType type;
    const void *next;
    XrSpace baseSpace;
    XrTime time;
    uint32_t spaceCount;
    const XrSpace *spaces;
} XrSpacesLocateInfo;
typedef struct {
    XrSpaceLocationFlags locationFlags;
    XrPosef pose;
} XrSpaceLocationData;
typedef struct {
    XrStructureType type;
    void *next;
    uint32_t locationCount;
    XrSpaceLocationData *locations;
} XrSpaceLocations;
#endif

// The negotiation's structures; openxr_loader_negotiation.h is not installed everywhere.
typedef struct {
    int32_t structType;
    uint32_t structVersion;
    size_t structSize;
    uint32_t minInterfaceVersion, maxInterfaceVersion;
    XrVersion minApiVersion, maxApiVersion;
} LoaderInfo;
typedef struct {
    int32_t structType;
    uint32_t structVersion;
    size_t structSize;
    uint32_t runtimeInterfaceVersion;
    XrVersion runtimeApiVersion;
    PFN_xrGetInstanceProcAddr getInstanceProcAddr;
} RuntimeRequest;
typedef XrResult (*Negotiate)(const LoaderInfo *, RuntimeRequest *);

// --- bookkeeping ---------------------------------------------------------------------------------------------------

static int faults, calls;

static void wrong(const char *format, ...) {
    va_list list;
    va_start(list, format);
    printf("WRONG ");
    vprintf(format, list);
    printf("\n");
    va_end(list);
    faults++;
}

static void called(const char *name) {
    static const char *seen[256];
    calls++;
    for (int i = 0; i < 256; i++) {
        if (seen[i] && strcmp(seen[i], name) == 0) return;
        if (!seen[i]) {
            seen[i] = name;
            printf("called %s\n", name);
            return;
        }
    }
}

// --- the world the calls are made in -------------------------------------------------------------------------------

static PFN_xrGetInstanceProcAddr gipa;
static XrInstance instance, dead_instance;
static XrSystemId system_id;
static XrSession session, dead_session;
static XrSwapchain swapchain, dead_swapchain;
static XrSpace space, dead_space;
static XrActionSet action_set, dead_action_set, other_set;
static XrAction flag, number, stick, pose, rumble, dead_action;
static XrHandTrackerEXT tracker, dead_tracker;
static XrPath left_hand, simple_profile, select_click, grip;
static int64_t colour_format;
static VkInstance vk_instance;
static VkPhysicalDevice vk_physical;
static VkDevice vk_device;

// Any function: integers and pointers travel in registers of one kind, a float or two in one of the other kind, and
// structures by value as further words. Not C's own rules, but those of the machines this runs on (x86-64, AArch64).
typedef XrResult (*Any)(uint64_t, uint64_t, uint64_t, uint64_t, uint64_t, uint64_t, uint64_t, uint64_t, uint64_t,
                        uint64_t, double);

static Any find(XrInstance of, const char *name) {
    PFN_xrVoidFunction function = NULL;
    XrResult code = gipa(of, name, &function);
    called("xrGetInstanceProcAddr");
    if (XR_FAILED(code) != (function == NULL)) wrong("xrGetInstanceProcAddr(%s): %d, %p", name, code, (void *)function);
    return (Any)function;
}

// Calls by name, with a prototype of its own.
#define CALL(name, ...) (called(#name), ((PFN_##name)(void *)find(instance, #name))(__VA_ARGS__))

static void expect(XrResult want, XrResult got, const char *what) {
    if (want != got) wrong("%s: %d instead of %d", what, got, want);
}
#define EXPECT(want, name, ...) expect(want, CALL(name, __VA_ARGS__), #name "(" #__VA_ARGS__ ")")
#define MUST(name, ...)                                                                      \
    do {                                                                                     \
        XrResult code_ = CALL(name, __VA_ARGS__);                                            \
        if (XR_FAILED(code_)) {                                                              \
            printf("WRONG cannot go on: %s(%s) = %d\n", #name, #__VA_ARGS__, code_);         \
            exit(1);                                                                         \
        }                                                                                    \
    } while (0)

static XrPath path(const char *text) {
    XrPath path = XR_NULL_PATH;
    MUST(xrStringToPath, instance, text, &path);
    return path;
}

// --- contents of structures ----------------------------------------------------------------------------------------

#define FILL(name, type) static void name(void *memory) { type *it = memory;
#define END }

static const char *names_on[64];
static uint32_t names_on_count;

FILL(fill_instance, XrInstanceCreateInfo)
    strcpy(it->applicationInfo.applicationName, "misuse");
    it->applicationInfo.apiVersion = XR_MAKE_VERSION(1, 1, 0);
    it->enabledExtensionNames = names_on;
    it->enabledExtensionCount = names_on_count;
END
FILL(fill_system, XrSystemGetInfo) it->formFactor = XR_FORM_FACTOR_HEAD_MOUNTED_DISPLAY; END
FILL(fill_begin, XrSessionBeginInfo) it->primaryViewConfigurationType = XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO; END
FILL(fill_session, XrSessionCreateInfo)
    static XrGraphicsBindingVulkanKHR binding;
    binding = (XrGraphicsBindingVulkanKHR){.type = XR_TYPE_GRAPHICS_BINDING_VULKAN_KHR, .instance = vk_instance,
        .physicalDevice = vk_physical, .device = vk_device};
    it->next = &binding;
    it->systemId = system_id;
END
FILL(fill_space, XrReferenceSpaceCreateInfo)
    it->referenceSpaceType = XR_REFERENCE_SPACE_TYPE_LOCAL;
    it->poseInReferenceSpace.orientation.w = 1;
END
FILL(fill_action_space, XrActionSpaceCreateInfo)
    it->action = pose;
    it->poseInActionSpace.orientation.w = 1;
END
FILL(fill_locate_views, XrViewLocateInfo)
    it->viewConfigurationType = XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO;
    it->displayTime = 1000000000;
    it->space = space;
END
FILL(fill_locate_spaces, XrSpacesLocateInfo)
    it->baseSpace = space;
    it->time = 1000000000;
    it->spaceCount = 1;
    it->spaces = &space;
END
FILL(fill_locations, XrSpaceLocations)
    static XrSpaceLocationData data;
    it->locationCount = 1;
    it->locations = &data;
END
FILL(fill_swapchain, XrSwapchainCreateInfo)
    it->usageFlags = XR_SWAPCHAIN_USAGE_COLOR_ATTACHMENT_BIT;
    it->format = colour_format;
    it->sampleCount = it->faceCount = it->arraySize = it->mipCount = 1;
    it->width = it->height = 64;
END
FILL(fill_wait, XrSwapchainImageWaitInfo) it->timeout = XR_INFINITE_DURATION; END
FILL(fill_frame_end, XrFrameEndInfo)
    it->displayTime = 1000000000;
    it->environmentBlendMode = XR_ENVIRONMENT_BLEND_MODE_OPAQUE;
END
FILL(fill_set, XrActionSetCreateInfo)
    static int n;
    sprintf(it->actionSetName, "set_%d", n);
    sprintf(it->localizedActionSetName, "Set %d", n++);
END
FILL(fill_action, XrActionCreateInfo)
    static int n;
    sprintf(it->actionName, "action_%d", n);
    sprintf(it->localizedActionName, "Action %d", n++);
    it->actionType = XR_ACTION_TYPE_BOOLEAN_INPUT;
END
FILL(fill_suggest, XrInteractionProfileSuggestedBinding)
    static XrActionSuggestedBinding binding;
    binding = (XrActionSuggestedBinding){flag, select_click};
    it->interactionProfile = simple_profile;
    it->countSuggestedBindings = 1;
    it->suggestedBindings = &binding;
END
FILL(fill_attach, XrSessionActionSetsAttachInfo)
    it->countActionSets = 1;
    it->actionSets = &action_set;
END
FILL(fill_sync, XrActionsSyncInfo)
    static XrActiveActionSet active;
    active = (XrActiveActionSet){action_set, XR_NULL_PATH};
    it->countActiveActionSets = 1;
    it->activeActionSets = &active;
END
FILL(fill_get_flag, XrActionStateGetInfo) it->action = flag; END
FILL(fill_get_number, XrActionStateGetInfo) it->action = number; END
FILL(fill_get_stick, XrActionStateGetInfo) it->action = stick; END
FILL(fill_get_pose, XrActionStateGetInfo) it->action = pose; END
FILL(fill_sources, XrBoundSourcesForActionEnumerateInfo) it->action = flag; END
FILL(fill_source_name, XrInputSourceLocalizedNameGetInfo)
    it->sourcePath = select_click;
    it->whichComponents = XR_INPUT_SOURCE_LOCALIZED_NAME_USER_PATH_BIT;
END
FILL(fill_haptic, XrHapticActionInfo) it->action = rumble; END
FILL(fill_vibration, XrHapticVibration)
    it->duration = XR_MIN_HAPTIC_DURATION;
    it->amplitude = 0.5f;
END

static const VkInstanceCreateInfo vk_instance_info = {.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
FILL(fill_vk_instance, XrVulkanInstanceCreateInfoKHR)
    it->systemId = system_id;
    it->pfnGetInstanceProcAddr = vkGetInstanceProcAddr;
    it->vulkanCreateInfo = &vk_instance_info;
END
FILL(fill_vk_get_device, XrVulkanGraphicsDeviceGetInfoKHR)
    it->systemId = system_id;
    it->vulkanInstance = vk_instance;
END
FILL(fill_vk_device, XrVulkanDeviceCreateInfoKHR)
    it->systemId = system_id;
    it->pfnGetInstanceProcAddr = vkGetInstanceProcAddr;
    it->vulkanPhysicalDevice = vk_physical;
    static const VkDeviceCreateInfo info = {.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO};
    it->vulkanCreateInfo = &info;
END
FILL(fill_messenger, XrDebugUtilsMessengerCreateInfoEXT)
    it->messageSeverities = XR_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
    it->messageTypes = XR_DEBUG_UTILS_MESSAGE_TYPE_GENERAL_BIT_EXT;
    it->userCallback = (PFN_xrDebugUtilsMessengerCallbackEXT)(void *)abort;
END
FILL(fill_object_name, XrDebugUtilsObjectNameInfoEXT)
    it->objectType = XR_OBJECT_TYPE_SESSION;
    it->objectHandle = (uint64_t)(uintptr_t)session;
    it->objectName = "session";
END
FILL(fill_label, XrDebugUtilsLabelEXT) it->labelName = "label"; END
FILL(fill_message, XrDebugUtilsMessengerCallbackDataEXT)
    it->messageId = it->functionName = it->message = "misuse";
END
FILL(fill_hand, XrHandTrackerCreateInfoEXT)
    it->hand = XR_HAND_LEFT_EXT;
    it->handJointSet = XR_HAND_JOINT_SET_DEFAULT_EXT;
END
FILL(fill_locate_hand, XrHandJointsLocateInfoEXT)
    it->baseSpace = space;
    it->time = 1000000000;
END
FILL(fill_joints, XrHandJointLocationsEXT)
    static XrHandJointLocationEXT joints[XR_HAND_JOINT_COUNT_EXT];
    it->jointCount = XR_HAND_JOINT_COUNT_EXT;
    it->jointLocations = joints;
END

// --- the functions and their arguments -----------------------------------------------------------------------------

typedef enum {
    NONE,
    HANDLE,     // value: where the handle is; size: its kind
    IN,         // a structure with a type
    IN_OPTIONAL,
    PLAIN,      // something without a type, written or read
    TEXT,       // a terminated string
    CAPACITY,   // value: enough; size: too few, 0 if nothing is
    ITEMS,      // an array without types
    MAYBE,      // an array that may be empty, so that NULL is right
    TYPED,      // an array of structures with types; value: how many
    VALUE,      // value: right; size: wrong; code: what the wrong one gets
    VALUE_AT,   // the same, value: where the right one is
} Kind;

typedef struct {
    Kind kind;
    XrStructureType type;
    size_t size;
    uint64_t value;
    XrResult code;
    void (*fill)(void *);
} Arg;

enum { K_INSTANCE = 1, K_SESSION, K_SWAPCHAIN, K_SPACE, K_SET, K_ACTION, K_TRACKER, K_ANY };

#define INSTANCE {.kind = HANDLE, .value = (uint64_t)(uintptr_t)&instance, .size = K_INSTANCE}
#define SESSION {.kind = HANDLE, .value = (uint64_t)(uintptr_t)&session, .size = K_SESSION}
#define SWAPCHAIN {.kind = HANDLE, .value = (uint64_t)(uintptr_t)&swapchain, .size = K_SWAPCHAIN}
#define SPACE {.kind = HANDLE, .value = (uint64_t)(uintptr_t)&space, .size = K_SPACE}
#define SET {.kind = HANDLE, .value = (uint64_t)(uintptr_t)&action_set, .size = K_SET}
#define ACTION {.kind = HANDLE, .value = (uint64_t)(uintptr_t)&flag, .size = K_ACTION}
#define TRACKER {.kind = HANDLE, .value = (uint64_t)(uintptr_t)&tracker, .size = K_TRACKER}
// A handle that this program makes none of: every value is wrong.
#define NO_SUCH {.kind = HANDLE, .value = 0, .size = K_ANY}
#define IN(tag, struct_, filler) {.kind = IN, .type = tag, .size = sizeof(struct_), .fill = filler}
#define OPT(tag, struct_) {.kind = IN_OPTIONAL, .type = tag, .size = sizeof(struct_)}
#define OUT(tag, struct_) {.kind = IN, .type = tag, .size = sizeof(struct_)}
#define PLAIN(type_) {.kind = PLAIN, .size = sizeof(type_)}
#define TEXT(text) {.kind = TEXT, .value = (uint64_t)(uintptr_t)(text)}
#define ROOM(enough, too_few) {.kind = CAPACITY, .value = enough, .size = too_few}
#define COUNT {.kind = PLAIN, .size = sizeof(uint32_t)}
#define ITEMS(type_, n) {.kind = ITEMS, .size = sizeof(type_) * (n)}
#define MAYBE(type_, n) {.kind = MAYBE, .size = sizeof(type_) * (n)}
#define TYPED(tag, struct_, n) {.kind = TYPED, .type = tag, .size = sizeof(struct_), .value = n}
#define VALUE(right, wrong_, code_) {.kind = VALUE, .value = right, .size = (size_t)(wrong_), .code = code_}
#define VALUE_AT(right, wrong_, code_) {.kind = VALUE_AT, .value = (uint64_t)(uintptr_t)&right, .size = (size_t)(wrong_), .code = code_}
#define PATH(right) VALUE_AT(right, 0xABCDEF0123, XR_ERROR_PATH_INVALID)
#define ANY(right) {.kind = VALUE, .value = right, .code = XR_SUCCESS}
#define SYSTEM VALUE(0x5EED0001, 12345, XR_ERROR_SYSTEM_INVALID)
#define TIME VALUE(1000000000, 0, XR_ERROR_TIME_INVALID)
#define STEREO VALUE(XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO, 4711, XR_ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED)

// When all arguments are right: any success, or the call is not made (it would end what later calls need).
#define OK 0
#define SKIP 1

typedef struct {
    const char *name;
    int right;
    Arg args[7];
} Function;

static const Function functions[] = {
    {"xrEnumerateApiLayerProperties", OK, {ROOM(4, 0), COUNT, MAYBE(XrApiLayerProperties, 4)}},
    {"xrEnumerateInstanceExtensionProperties", OK,
     {{.kind = NONE}, ROOM(64, 1), COUNT, TYPED(XR_TYPE_EXTENSION_PROPERTIES, XrExtensionProperties, 64)}},
    {"xrCreateInstance", SKIP, {IN(XR_TYPE_INSTANCE_CREATE_INFO, XrInstanceCreateInfo, fill_instance), PLAIN(XrInstance)}},
    {"xrDestroyInstance", SKIP, {INSTANCE}},
    {"xrGetInstanceProperties", OK, {INSTANCE, OUT(XR_TYPE_INSTANCE_PROPERTIES, XrInstanceProperties)}},
    {"xrPollEvent", OK, {INSTANCE, OUT(XR_TYPE_EVENT_DATA_BUFFER, XrEventDataBuffer)}},
    {"xrGetSystem", OK, {INSTANCE, IN(XR_TYPE_SYSTEM_GET_INFO, XrSystemGetInfo, fill_system), PLAIN(XrSystemId)}},
    {"xrGetSystemProperties", OK, {INSTANCE, SYSTEM, OUT(XR_TYPE_SYSTEM_PROPERTIES, XrSystemProperties)}},
    {"xrEnumerateViewConfigurations", OK, {INSTANCE, SYSTEM, ROOM(4, 0), COUNT, ITEMS(XrViewConfigurationType, 4)}},
    {"xrEnumerateEnvironmentBlendModes", OK,
     {INSTANCE, SYSTEM, STEREO, ROOM(4, 0), COUNT, ITEMS(XrEnvironmentBlendMode, 4)}},
    {"xrGetViewConfigurationProperties", OK,
     {INSTANCE, SYSTEM, STEREO, OUT(XR_TYPE_VIEW_CONFIGURATION_PROPERTIES, XrViewConfigurationProperties)}},
    {"xrEnumerateViewConfigurationViews", OK,
     {INSTANCE, SYSTEM, STEREO, ROOM(2, 1), COUNT, TYPED(XR_TYPE_VIEW_CONFIGURATION_VIEW, XrViewConfigurationView, 2)}},
    {"xrResultToString", OK, {INSTANCE, ANY(0), ITEMS(char, XR_MAX_RESULT_STRING_SIZE)}},
    {"xrStructureTypeToString", OK, {INSTANCE, ANY(0), ITEMS(char, XR_MAX_STRUCTURE_NAME_SIZE)}},
    {"xrStringToPath", OK, {INSTANCE, TEXT("/user/hand/right"), PLAIN(XrPath)}},
    {"xrPathToString", OK,
     {INSTANCE, PATH(left_hand), ROOM(XR_MAX_PATH_LENGTH, 2), COUNT,
      ITEMS(char, XR_MAX_PATH_LENGTH)}},
    {"xrCreateSession", SKIP, {INSTANCE, IN(XR_TYPE_SESSION_CREATE_INFO, XrSessionCreateInfo, fill_session), PLAIN(XrSession)}},
    {"xrDestroySession", SKIP, {SESSION}},
    {"xrBeginSession", SKIP, {SESSION, IN(XR_TYPE_SESSION_BEGIN_INFO, XrSessionBeginInfo, fill_begin)}},
    {"xrEndSession", SKIP, {SESSION}},
    {"xrRequestExitSession", SKIP, {SESSION}},
    {"xrEnumerateReferenceSpaces", OK, {SESSION, ROOM(16, 1), COUNT, ITEMS(XrReferenceSpaceType, 16)}},
    {"xrCreateReferenceSpace", OK,
     {SESSION, IN(XR_TYPE_REFERENCE_SPACE_CREATE_INFO, XrReferenceSpaceCreateInfo, fill_space), PLAIN(XrSpace)}},
    {"xrGetReferenceSpaceBoundsRect", OK,
     {SESSION, VALUE(XR_REFERENCE_SPACE_TYPE_STAGE, 4711, XR_ERROR_REFERENCE_SPACE_UNSUPPORTED), PLAIN(XrExtent2Df)}},
    {"xrCreateActionSpace", OK,
     {SESSION, IN(XR_TYPE_ACTION_SPACE_CREATE_INFO, XrActionSpaceCreateInfo, fill_action_space), PLAIN(XrSpace)}},
    {"xrLocateSpace", OK, {SPACE, SPACE, TIME, OUT(XR_TYPE_SPACE_LOCATION, XrSpaceLocation)}},
    {"xrDestroySpace", SKIP, {SPACE}},
    {"xrLocateSpaces", OK,
     {SESSION, IN(XR_TYPE_SPACES_LOCATE_INFO, XrSpacesLocateInfo, fill_locate_spaces),
      IN(XR_TYPE_SPACE_LOCATIONS, XrSpaceLocations, fill_locations)}},
    {"xrLocateSpacesKHR", OK,
     {SESSION, IN(XR_TYPE_SPACES_LOCATE_INFO, XrSpacesLocateInfo, fill_locate_spaces),
      IN(XR_TYPE_SPACE_LOCATIONS, XrSpaceLocations, fill_locations)}},
    {"xrLocateViews", OK,
     {SESSION, IN(XR_TYPE_VIEW_LOCATE_INFO, XrViewLocateInfo, fill_locate_views), OUT(XR_TYPE_VIEW_STATE, XrViewState),
      ROOM(2, 1), COUNT, TYPED(XR_TYPE_VIEW, XrView, 2)}},
    {"xrEnumerateSwapchainFormats", OK, {SESSION, ROOM(64, 1), COUNT, ITEMS(int64_t, 64)}},
    {"xrCreateSwapchain", SKIP,
     {SESSION, IN(XR_TYPE_SWAPCHAIN_CREATE_INFO, XrSwapchainCreateInfo, fill_swapchain), PLAIN(XrSwapchain)}},
    {"xrDestroySwapchain", SKIP, {SWAPCHAIN}},
    {"xrEnumerateSwapchainImages", OK,
     {SWAPCHAIN, ROOM(16, 1), COUNT, TYPED(XR_TYPE_SWAPCHAIN_IMAGE_VULKAN_KHR, XrSwapchainImageVulkanKHR, 16)}},
    {"xrAcquireSwapchainImage", SKIP,
     {SWAPCHAIN, OPT(XR_TYPE_SWAPCHAIN_IMAGE_ACQUIRE_INFO, XrSwapchainImageAcquireInfo), PLAIN(uint32_t)}},
    {"xrWaitSwapchainImage", SKIP, {SWAPCHAIN, IN(XR_TYPE_SWAPCHAIN_IMAGE_WAIT_INFO, XrSwapchainImageWaitInfo, fill_wait)}},
    {"xrReleaseSwapchainImage", SKIP, {SWAPCHAIN, OPT(XR_TYPE_SWAPCHAIN_IMAGE_RELEASE_INFO, XrSwapchainImageReleaseInfo)}},
    {"xrWaitFrame", SKIP, {SESSION, OPT(XR_TYPE_FRAME_WAIT_INFO, XrFrameWaitInfo), OUT(XR_TYPE_FRAME_STATE, XrFrameState)}},
    {"xrBeginFrame", SKIP, {SESSION, OPT(XR_TYPE_FRAME_BEGIN_INFO, XrFrameBeginInfo)}},
    {"xrEndFrame", SKIP, {SESSION, IN(XR_TYPE_FRAME_END_INFO, XrFrameEndInfo, fill_frame_end)}},
    {"xrCreateActionSet", OK,
     {INSTANCE, IN(XR_TYPE_ACTION_SET_CREATE_INFO, XrActionSetCreateInfo, fill_set), PLAIN(XrActionSet)}},
    {"xrDestroyActionSet", SKIP, {SET}},
    {"xrCreateAction", SKIP, {SET, IN(XR_TYPE_ACTION_CREATE_INFO, XrActionCreateInfo, fill_action), PLAIN(XrAction)}},
    {"xrDestroyAction", SKIP, {ACTION}},
    {"xrSuggestInteractionProfileBindings", SKIP,
     {INSTANCE, IN(XR_TYPE_INTERACTION_PROFILE_SUGGESTED_BINDING, XrInteractionProfileSuggestedBinding, fill_suggest)}},
    {"xrAttachSessionActionSets", SKIP,
     {SESSION, IN(XR_TYPE_SESSION_ACTION_SETS_ATTACH_INFO, XrSessionActionSetsAttachInfo, fill_attach)}},
    {"xrGetCurrentInteractionProfile", OK,
     {SESSION, PATH(left_hand), OUT(XR_TYPE_INTERACTION_PROFILE_STATE, XrInteractionProfileState)}},
    {"xrGetActionStateBoolean", OK,
     {SESSION, IN(XR_TYPE_ACTION_STATE_GET_INFO, XrActionStateGetInfo, fill_get_flag),
      OUT(XR_TYPE_ACTION_STATE_BOOLEAN, XrActionStateBoolean)}},
    {"xrGetActionStateFloat", OK,
     {SESSION, IN(XR_TYPE_ACTION_STATE_GET_INFO, XrActionStateGetInfo, fill_get_number),
      OUT(XR_TYPE_ACTION_STATE_FLOAT, XrActionStateFloat)}},
    {"xrGetActionStateVector2f", OK,
     {SESSION, IN(XR_TYPE_ACTION_STATE_GET_INFO, XrActionStateGetInfo, fill_get_stick),
      OUT(XR_TYPE_ACTION_STATE_VECTOR2F, XrActionStateVector2f)}},
    {"xrGetActionStatePose", OK,
     {SESSION, IN(XR_TYPE_ACTION_STATE_GET_INFO, XrActionStateGetInfo, fill_get_pose),
      OUT(XR_TYPE_ACTION_STATE_POSE, XrActionStatePose)}},
    {"xrSyncActions", OK, {SESSION, IN(XR_TYPE_ACTIONS_SYNC_INFO, XrActionsSyncInfo, fill_sync)}},
    {"xrEnumerateBoundSourcesForAction", OK,
     {SESSION, IN(XR_TYPE_BOUND_SOURCES_FOR_ACTION_ENUMERATE_INFO, XrBoundSourcesForActionEnumerateInfo, fill_sources),
      ROOM(16, 0), COUNT, MAYBE(XrPath, 16)}},
    {"xrGetInputSourceLocalizedName", OK,
     {SESSION, IN(XR_TYPE_INPUT_SOURCE_LOCALIZED_NAME_GET_INFO, XrInputSourceLocalizedNameGetInfo, fill_source_name),
      ROOM(512, 1), COUNT, ITEMS(char, 512)}},
    {"xrApplyHapticFeedback", OK,
     {SESSION, IN(XR_TYPE_HAPTIC_ACTION_INFO, XrHapticActionInfo, fill_haptic),
      IN(XR_TYPE_HAPTIC_VIBRATION, XrHapticVibration, fill_vibration)}},
    {"xrStopHapticFeedback", OK, {SESSION, IN(XR_TYPE_HAPTIC_ACTION_INFO, XrHapticActionInfo, fill_haptic)}},

    {"xrGetVulkanInstanceExtensionsKHR", OK, {INSTANCE, SYSTEM, ROOM(256, 0), COUNT, ITEMS(char, 256)}},
    {"xrGetVulkanDeviceExtensionsKHR", OK, {INSTANCE, SYSTEM, ROOM(256, 0), COUNT, ITEMS(char, 256)}},
    {"xrGetVulkanGraphicsDeviceKHR", OK,
     {INSTANCE, SYSTEM, VALUE_AT(vk_instance, 0, XR_ERROR_VALIDATION_FAILURE), PLAIN(VkPhysicalDevice)}},
    {"xrGetVulkanGraphicsRequirementsKHR", OK,
     {INSTANCE, SYSTEM, OUT(XR_TYPE_GRAPHICS_REQUIREMENTS_VULKAN_KHR, XrGraphicsRequirementsVulkanKHR)}},
    {"xrGetVulkanGraphicsRequirements2KHR", OK,
     {INSTANCE, SYSTEM, OUT(XR_TYPE_GRAPHICS_REQUIREMENTS_VULKAN2_KHR, XrGraphicsRequirementsVulkan2KHR)}},
    {"xrCreateVulkanInstanceKHR", SKIP,
     {INSTANCE, IN(XR_TYPE_VULKAN_INSTANCE_CREATE_INFO_KHR, XrVulkanInstanceCreateInfoKHR, fill_vk_instance),
      PLAIN(VkInstance), PLAIN(VkResult)}},
    {"xrGetVulkanGraphicsDevice2KHR", SKIP,
     {INSTANCE, IN(XR_TYPE_VULKAN_GRAPHICS_DEVICE_GET_INFO_KHR, XrVulkanGraphicsDeviceGetInfoKHR, fill_vk_get_device),
      PLAIN(VkPhysicalDevice)}},
    {"xrCreateVulkanDeviceKHR", SKIP,
     {INSTANCE, IN(XR_TYPE_VULKAN_DEVICE_CREATE_INFO_KHR, XrVulkanDeviceCreateInfoKHR, fill_vk_device), PLAIN(VkDevice),
      PLAIN(VkResult)}},

    {"xrGetVisibilityMaskKHR", OK,
     {SESSION, STEREO, VALUE(1, 2, XR_ERROR_VALIDATION_FAILURE),
      VALUE(XR_VISIBILITY_MASK_TYPE_HIDDEN_TRIANGLE_MESH_KHR, 4711, XR_ERROR_VALIDATION_FAILURE),
      OUT(XR_TYPE_VISIBILITY_MASK_KHR, XrVisibilityMaskKHR)}},
    {"xrConvertTimespecTimeToTimeKHR", SKIP, {INSTANCE, PLAIN(struct timespec), PLAIN(XrTime)}},
    {"xrConvertTimeToTimespecTimeKHR", OK, {INSTANCE, TIME, PLAIN(struct timespec)}},
    {"xrEnumerateDisplayRefreshRatesFB", OK, {SESSION, ROOM(16, 0), COUNT, ITEMS(float, 16)}},
    {"xrGetDisplayRefreshRateFB", OK, {SESSION, PLAIN(float)}},
    {"xrRequestDisplayRefreshRateFB", SKIP, {SESSION}},
    {"xrPerfSettingsSetPerformanceLevelEXT", OK,
     {SESSION, VALUE(XR_PERF_SETTINGS_DOMAIN_CPU_EXT, 4711, XR_ERROR_VALIDATION_FAILURE),
      VALUE(XR_PERF_SETTINGS_LEVEL_BOOST_EXT, 4711, XR_ERROR_VALIDATION_FAILURE)}},
    {"xrSetDebugUtilsObjectNameEXT", OK,
     {INSTANCE, IN(XR_TYPE_DEBUG_UTILS_OBJECT_NAME_INFO_EXT, XrDebugUtilsObjectNameInfoEXT, fill_object_name)}},
    {"xrCreateDebugUtilsMessengerEXT", SKIP,
     {INSTANCE, IN(XR_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT, XrDebugUtilsMessengerCreateInfoEXT, fill_messenger),
      PLAIN(XrDebugUtilsMessengerEXT)}},
    {"xrDestroyDebugUtilsMessengerEXT", SKIP, {NO_SUCH}},
    {"xrSubmitDebugUtilsMessageEXT", OK,
     {INSTANCE, ANY(XR_DEBUG_UTILS_MESSAGE_SEVERITY_VERBOSE_BIT_EXT), ANY(XR_DEBUG_UTILS_MESSAGE_TYPE_GENERAL_BIT_EXT),
      IN(XR_TYPE_DEBUG_UTILS_MESSENGER_CALLBACK_DATA_EXT, XrDebugUtilsMessengerCallbackDataEXT, fill_message)}},
    {"xrSessionBeginDebugUtilsLabelRegionEXT", OK, {SESSION, IN(XR_TYPE_DEBUG_UTILS_LABEL_EXT, XrDebugUtilsLabelEXT, fill_label)}},
    {"xrSessionEndDebugUtilsLabelRegionEXT", OK, {SESSION}},
    {"xrSessionInsertDebugUtilsLabelEXT", OK, {SESSION, IN(XR_TYPE_DEBUG_UTILS_LABEL_EXT, XrDebugUtilsLabelEXT, fill_label)}},
    {"xrCreateHandTrackerEXT", SKIP,
     {SESSION, IN(XR_TYPE_HAND_TRACKER_CREATE_INFO_EXT, XrHandTrackerCreateInfoEXT, fill_hand), PLAIN(XrHandTrackerEXT)}},
    {"xrDestroyHandTrackerEXT", SKIP, {TRACKER}},
    {"xrLocateHandJointsEXT", OK,
     {TRACKER, IN(XR_TYPE_HAND_JOINTS_LOCATE_INFO_EXT, XrHandJointsLocateInfoEXT, fill_locate_hand),
      IN(XR_TYPE_HAND_JOINT_LOCATIONS_EXT, XrHandJointLocationsEXT, fill_joints)}},
    {"xrSetInputDeviceActiveEXT", OK, {SESSION, PATH(simple_profile), PATH(left_hand), ANY(1)}},
    {"xrSetInputDeviceStateBoolEXT", OK, {SESSION, PATH(left_hand), PATH(select_click), ANY(1)}},
    {"xrSetInputDeviceStateFloatEXT", SKIP, {SESSION, PATH(left_hand), PATH(select_click)}},
    {"xrSetInputDeviceStateVector2fEXT", SKIP, {SESSION, PATH(left_hand), PATH(select_click)}},
    {"xrSetInputDeviceLocationEXT", SKIP, {SESSION, PATH(left_hand), PATH(grip), SPACE}},
};
#define FUNCTIONS (sizeof functions / sizeof *functions)

// --- the sweep -----------------------------------------------------------------------------------------------------

#define CANARY 64
#define ROOMY 65536

// One argument's memory, with a canary behind it that no call may touch. malloc'ed so that a sanitizer watches it too.
typedef struct {
    uint8_t *memory;
    size_t size;
} Block;

static Block blocks[8];
static int blocks_used;

static void *block(size_t size) {
    Block *it = &blocks[blocks_used++];
    it->size = size;
    it->memory = malloc(size + CANARY);
    memset(it->memory, 0, size);
    memset(it->memory + size, 0xA5, CANARY);
    return it->memory;
}

static void free_blocks(const char *what) {
    for (int i = 0; i < blocks_used; i++) {
        for (int k = 0; k < CANARY; k++) {
            if (blocks[i].memory[blocks[i].size + k] != 0xA5) {
                wrong("%s: memory behind an argument was written", what);
                break;
            }
        }
        free(blocks[i].memory);
    }
    blocks_used = 0;
}

static uint64_t handle_at(uint64_t where) {
    if (!where) return 0;
    uint64_t handle;
    memcpy(&handle, (const void *)(uintptr_t)where, sizeof handle);
    return handle;
}

static uint64_t right(const Arg *arg) {
    switch (arg->kind) {
    case HANDLE: return handle_at(arg->value);
    case IN:
    case IN_OPTIONAL: {
        XrBaseOutStructure *it = block(arg->size);
        if (arg->fill) arg->fill(it);
        it->type = arg->type;
        return (uint64_t)(uintptr_t)it;
    }
    case PLAIN:
    case ITEMS:
    case MAYBE: return (uint64_t)(uintptr_t)block(arg->size);
    case TYPED: {
        uint8_t *all = block(arg->size * arg->value);
        for (uint64_t i = 0; i < arg->value; i++) ((XrBaseOutStructure *)(void *)(all + i * arg->size))->type = arg->type;
        return (uint64_t)(uintptr_t)all;
    }
    case TEXT:
    case CAPACITY:
    case VALUE: return arg->value;
    case VALUE_AT: return handle_at(arg->value);
    case NONE: return 0;
    }
    return 0;
}

static Any now_called;
static const Function *now;

// Calls the function with all arguments right but one; `code` is XR_SUCCESS for any success.
static void call_with(int which, uint64_t value, XrResult code, const char *how) {
    uint64_t a[10] = {0};
    for (int i = 0; i < 7; i++) a[i] = right(&now->args[i]);
    if (which >= 0) a[which] = value;
    char what[256];
    snprintf(what, sizeof what, "%s, argument %d %s", now->name, which, how);
    called(now->name);
    XrResult got = now_called(a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9], 0.0);
    if (code == XR_SUCCESS ? XR_FAILED(got) : got != code) wrong("%s: %d instead of %d", what, got, code);
    free_blocks(what);
}

// A structure that is right but for what `spoil` does to it.
static void *spoilt(const Arg *arg, XrStructureType type, void *next) {
    static uint8_t memory[ROOMY];
    memset(memory, 0, sizeof memory);
    if (arg->fill) arg->fill(memory);
    XrBaseOutStructure *it = (void *)memory;
    it->type = type;
    if (next) it->next = next;
    return it;
}

#define UNKNOWN ((XrStructureType)1999999000)

static XrBaseOutStructure *ring(void) {
    static XrBaseOutStructure links[3];
    for (int i = 0; i < 3; i++) links[i] = (XrBaseOutStructure){UNKNOWN, &links[(i + 1) % 3]};
    return links;
}

static XrBaseOutStructure *endless(void) {
    static XrBaseOutStructure links[100000];
    for (int i = 0; i + 1 < 100000; i++) links[i] = (XrBaseOutStructure){UNKNOWN, &links[i + 1]};
    return links;
}

static void sweep_handle(int i, const Arg *arg) {
    const uint64_t all[] = {
        (uint64_t)(uintptr_t)instance, (uint64_t)(uintptr_t)session, (uint64_t)(uintptr_t)swapchain,
        (uint64_t)(uintptr_t)space, (uint64_t)(uintptr_t)action_set, (uint64_t)(uintptr_t)flag,
        (uint64_t)(uintptr_t)tracker,
    };
    const uint64_t dead[] = {
        (uint64_t)(uintptr_t)dead_instance, (uint64_t)(uintptr_t)dead_session, (uint64_t)(uintptr_t)dead_swapchain,
        (uint64_t)(uintptr_t)dead_space, (uint64_t)(uintptr_t)dead_action_set, (uint64_t)(uintptr_t)dead_action,
        (uint64_t)(uintptr_t)dead_tracker,
    };
    for (size_t kind = 1; kind <= K_TRACKER; kind++) {
        if (kind != arg->size) call_with(i, all[kind - 1], XR_ERROR_HANDLE_INVALID, "a handle of another kind");
        call_with(i, dead[kind - 1], XR_ERROR_HANDLE_INVALID, "a handle of something destroyed");
    }
    call_with(i, 0, XR_ERROR_HANDLE_INVALID, "XR_NULL_HANDLE");
    call_with(i, UINT64_MAX, XR_ERROR_HANDLE_INVALID, "a handle of all ones");
    call_with(i, (uint64_t)(uintptr_t)blocks, XR_ERROR_HANDLE_INVALID, "an address for a handle");
    uint64_t random = 0x9E3779B97F4A7C15;
    for (int n = 0; n < 100; n++) {
        random ^= random << 13, random ^= random >> 7, random ^= random << 17;
        call_with(i, random, XR_ERROR_HANDLE_INVALID, "an invented handle");
    }
    const uint64_t own = handle_at(arg->value);
    for (int bit = 0; own && bit < 64; bit++) {
        call_with(i, own ^ (1ull << bit), XR_ERROR_HANDLE_INVALID, "a handle with a bit flipped");
    }
}

static void sweep_structure(int i, const Arg *arg, bool may_succeed) {
    const XrResult invalid = XR_ERROR_VALIDATION_FAILURE;
    if (arg->kind == IN) call_with(i, 0, invalid, "NULL");
    call_with(i, (uint64_t)(uintptr_t)spoilt(arg, arg->type, NULL) + 1, invalid, "misaligned");
    call_with(i, (uint64_t)(uintptr_t)spoilt(arg, XR_TYPE_UNKNOWN, NULL), invalid, "without a type");
    call_with(i, (uint64_t)(uintptr_t)spoilt(arg, UNKNOWN, NULL), invalid, "of an unknown type");
    call_with(i, (uint64_t)(uintptr_t)spoilt(arg, (XrStructureType)-1, NULL), invalid, "of a negative type");
    call_with(i, (uint64_t)(uintptr_t)spoilt(arg, arg->type, ring()), invalid, "with a chain that goes round");
    call_with(i, (uint64_t)(uintptr_t)spoilt(arg, arg->type, endless()), invalid, "with 100000 structures chained");
    call_with(i, (uint64_t)(uintptr_t)spoilt(arg, arg->type, (uint8_t *)ring() + 1), invalid, "with a misaligned chain");
    XrBaseOutStructure stranger = {UNKNOWN, NULL};
    if (may_succeed) {
        call_with(i, (uint64_t)(uintptr_t)spoilt(arg, arg->type, &stranger), XR_SUCCESS, "with an unknown structure chained");
        if (arg->kind == IN_OPTIONAL) call_with(i, 0, XR_SUCCESS, "NULL, which it may be");
    }
}

static void sweep(const Function *function) {
    now = function;
    now_called = find(instance, function->name);
    if (!now_called) return; // Another version of the runtime has it; the test compares the lists.
    const XrResult invalid = XR_ERROR_VALIDATION_FAILURE;
    const bool may_succeed = function->right == OK;
    if (may_succeed) call_with(-1, 0, XR_SUCCESS, "with everything right");
    for (int i = 0; i < 7; i++) {
        const Arg *arg = &function->args[i];
        switch (arg->kind) {
        case HANDLE: sweep_handle(i, arg); break;
        case IN:
        case IN_OPTIONAL: sweep_structure(i, arg, may_succeed); break;
        case TYPED: {
            if (!may_succeed) break;
            uint8_t *all = calloc(arg->value + 1, arg->size);
            for (uint64_t n = 0; n < arg->value; n++) ((XrBaseOutStructure *)(void *)(all + n * arg->size))->type = arg->type;
            call_with(i, 0, invalid, "NULL with room");
            call_with(i, (uint64_t)(uintptr_t)all + 1, invalid, "misaligned");
            ((XrBaseOutStructure *)(void *)(all + arg->size))->type = UNKNOWN;
            call_with(i, (uint64_t)(uintptr_t)all, invalid, "with an element of another type");
            free(all);
            break;
        }
        case ITEMS:
            call_with(i, 0, invalid, "NULL with room");
            break;
        case PLAIN:
            call_with(i, 0, invalid, "NULL");
            if (arg->size > 1) {
                static uint8_t memory[ROOMY];
                call_with(i, (uint64_t)(uintptr_t)memory + 1, invalid, "misaligned");
            }
            break;
        case TEXT:
            call_with(i, 0, invalid, "NULL");
            call_with(i, (uint64_t)(uintptr_t) "/user/\xff\xfe", invalid, "not UTF-8");
            break;
        case CAPACITY:
            call_with(i, 0, XR_SUCCESS, "0");
            if (arg->size) call_with(i, arg->size, XR_ERROR_SIZE_INSUFFICIENT, "too small");
            if (may_succeed) call_with(i, UINT32_MAX, XR_SUCCESS, "as large as can be");
            break;
        case VALUE:
        case VALUE_AT:
            if (arg->code != XR_SUCCESS) call_with(i, arg->size, arg->code, "a wrong value");
            break;
        case MAYBE:
        case NONE: break;
        }
    }
}

// --- negotiation, and asking for functions -------------------------------------------------------------------------

static LoaderInfo loader_info(void) {
    return (LoaderInfo){1, 1, sizeof(LoaderInfo), 1, 1, XR_MAKE_VERSION(1, 0, 0), XR_MAKE_VERSION(1, 0x3ff, 0xfff)};
}

static RuntimeRequest runtime_request(void) { return (RuntimeRequest){.structType = 3, .structVersion = 1, .structSize = sizeof(RuntimeRequest)}; }

static void refused(Negotiate negotiate, const LoaderInfo *info, RuntimeRequest *request, const char *what) {
    XrResult code = negotiate(info, request);
    if (code != XR_ERROR_INITIALIZATION_FAILED) wrong("negotiation with %s: %d", what, code);
    if (request && !((uintptr_t)request & 1) && request->getInstanceProcAddr) wrong("negotiation with %s answers", what);
}

static void negotiation(Negotiate negotiate) {
    LoaderInfo info = loader_info();
    RuntimeRequest request = runtime_request();
    refused(negotiate, NULL, &request, "no loader info");
    refused(negotiate, &info, NULL, "no request");
    refused(negotiate, NULL, NULL, "nothing");
    refused(negotiate, (void *)((char *)&info + 1), &request, "a misaligned loader info");
#define WITH(field, value)                                     \
    info = loader_info(), info.field = value;                  \
    refused(negotiate, &info, &request, #field " = " #value);
    WITH(structType, 0) WITH(structType, 3) WITH(structVersion, 0) WITH(structVersion, 2)
    WITH(structSize, 0) WITH(structSize, sizeof info - 8) WITH(structSize, SIZE_MAX)
    WITH(minInterfaceVersion, 2) WITH(maxInterfaceVersion, 0)
    WITH(minApiVersion, XR_MAKE_VERSION(2, 0, 0)) WITH(minApiVersion, XR_MAKE_VERSION(1, 2, 0))
    WITH(maxApiVersion, XR_MAKE_VERSION(0, 90, 0))
#undef WITH
    info = loader_info();
#define WITH(field, value)                                     \
    request = runtime_request(), request.field = value;        \
    refused(negotiate, &info, &request, #field " = " #value);
    WITH(structType, 0) WITH(structType, 1) WITH(structVersion, 0) WITH(structVersion, 7)
    WITH(structSize, 0) WITH(structSize, sizeof request + 8)
#undef WITH
    request = runtime_request();
    if (negotiate(&info, &request) != XR_SUCCESS || !request.getInstanceProcAddr || request.runtimeInterfaceVersion != 1
        || XR_VERSION_MAJOR(request.runtimeApiVersion) != 1) {
        printf("WRONG cannot go on: negotiation failed\n");
        exit(1);
    }
    gipa = request.getInstanceProcAddr;
}

static void asking_for_functions(void) {
    PFN_xrVoidFunction function = (PFN_xrVoidFunction)(void *)abort;
#define ASK(want, of, name)                                                                       \
    function = (PFN_xrVoidFunction)(void *)abort;                                                 \
    expect(want, gipa(of, name, &function), "xrGetInstanceProcAddr(" #of ", " #name ")");         \
    if ((want) != XR_SUCCESS && function) wrong("xrGetInstanceProcAddr(" #of ", " #name ") gives a function");
    ASK(XR_ERROR_HANDLE_INVALID, XR_NULL_HANDLE, "xrGetInstanceProcAddr")
    ASK(XR_ERROR_HANDLE_INVALID, XR_NULL_HANDLE, "xrDestroyInstance")
    ASK(XR_ERROR_HANDLE_INVALID, XR_NULL_HANDLE, "xrNonsense")
    ASK(XR_ERROR_HANDLE_INVALID, XR_NULL_HANDLE, "")
    ASK(XR_ERROR_HANDLE_INVALID, (XrInstance)(uintptr_t)0xDEADBEEF, "xrCreateInstance")
    ASK(XR_ERROR_VALIDATION_FAILURE, XR_NULL_HANDLE, NULL)
    ASK(XR_SUCCESS, XR_NULL_HANDLE, "xrCreateInstance")
    expect(XR_ERROR_VALIDATION_FAILURE, gipa(XR_NULL_HANDLE, "xrCreateInstance", NULL), "xrGetInstanceProcAddr to nowhere");
    if (instance) {
        ASK(XR_ERROR_FUNCTION_UNSUPPORTED, instance, "xrNonsense")
        ASK(XR_ERROR_HANDLE_INVALID, dead_instance, "xrDestroyInstance")
        ASK(XR_ERROR_HANDLE_INVALID, (XrInstance)(uintptr_t)session, "xrDestroyInstance")
        ASK(XR_SUCCESS, instance, "xrGetInstanceProcAddr")
    }
#undef ASK
}

// --- making the world ----------------------------------------------------------------------------------------------

static void enable_extensions(void) {
    static XrExtensionProperties all[64];
    for (int i = 0; i < 64; i++) all[i].type = XR_TYPE_EXTENSION_PROPERTIES;
    uint32_t count = 0;
    MUST(xrEnumerateInstanceExtensionProperties, NULL, 64, &count, all);
    for (uint32_t i = 0; i < count; i++) names_on[i] = all[i].extensionName;
    names_on_count = count;
}

static XrInstance make_instance(void) {
    XrInstanceCreateInfo info = {.type = XR_TYPE_INSTANCE_CREATE_INFO};
    fill_instance(&info);
    XrInstance made = XR_NULL_HANDLE;
    MUST(xrCreateInstance, &info, &made);
    return made;
}

static void instances(void) {
    XrInstance made = XR_NULL_HANDLE;
    XrInstanceCreateInfo info;
#define WITH(change, want)                                            \
    info = (XrInstanceCreateInfo){.type = XR_TYPE_INSTANCE_CREATE_INFO}; \
    fill_instance(&info);                                             \
    change;                                                           \
    EXPECT(want, xrCreateInstance, &info, &made);
    const char *nonsense[] = {"XR_NON_sense"}, *null[] = {NULL};
    WITH(info.applicationInfo.applicationName[0] = 0, XR_ERROR_NAME_INVALID)
    WITH(memset(info.applicationInfo.applicationName, 'x', XR_MAX_APPLICATION_NAME_SIZE), XR_ERROR_NAME_INVALID)
    WITH(memset(info.applicationInfo.engineName, 'x', XR_MAX_ENGINE_NAME_SIZE), XR_ERROR_NAME_INVALID)
    WITH(info.applicationInfo.apiVersion = 0, XR_ERROR_API_VERSION_UNSUPPORTED)
    WITH(info.applicationInfo.apiVersion = XR_MAKE_VERSION(2, 0, 0), XR_ERROR_API_VERSION_UNSUPPORTED)
    WITH(info.createFlags = 1, XR_ERROR_VALIDATION_FAILURE)
    WITH((info.enabledExtensionNames = nonsense, info.enabledExtensionCount = 1), XR_ERROR_EXTENSION_NOT_PRESENT)
    WITH((info.enabledExtensionNames = null, info.enabledExtensionCount = 1), XR_ERROR_VALIDATION_FAILURE)
    WITH((info.enabledExtensionNames = NULL, info.enabledExtensionCount = 7), XR_ERROR_VALIDATION_FAILURE)
    WITH((info.enabledApiLayerNames = nonsense, info.enabledApiLayerCount = 1), XR_ERROR_API_LAYER_NOT_PRESENT)
#undef WITH
    EXPECT(XR_ERROR_API_LAYER_NOT_PRESENT, xrEnumerateInstanceExtensionProperties, "XR_APILAYER_none", 0, &(uint32_t){0}, NULL);
    // A function of an extension that is off is not there.
    names_on_count = 0;
    instance = make_instance();
    if (find(instance, "xrGetVulkanGraphicsRequirementsKHR")) wrong("an extension that is off has its functions");
    MUST(xrDestroyInstance, instance);
    dead_instance = instance;
    instance = XR_NULL_HANDLE;
}

static void vulkan(void) {
    VkApplicationInfo application = {.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_0};
    VkInstanceCreateInfo info = {.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO, .pApplicationInfo = &application};
    if (vkCreateInstance(&info, NULL, &vk_instance) != VK_SUCCESS) {
        printf("WRONG cannot go on: no Vulkan\n");
        exit(1);
    }
    MUST(xrGetVulkanGraphicsDeviceKHR, instance, system_id, vk_instance, &vk_physical);
    float priority = 1;
    VkDeviceQueueCreateInfo queue = {.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, .queueCount = 1, .pQueuePriorities = &priority};
    VkDeviceCreateInfo device = {.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, .queueCreateInfoCount = 1, .pQueueCreateInfos = &queue};
    if (vkCreateDevice(vk_physical, &device, NULL, &vk_device) != VK_SUCCESS) {
        printf("WRONG cannot go on: no Vulkan device\n");
        exit(1);
    }
}

static XrSession make_session(XrResult want) {
    XrSessionCreateInfo info = {.type = XR_TYPE_SESSION_CREATE_INFO};
    fill_session(&info);
    XrSession made = XR_NULL_HANDLE;
    EXPECT(want, xrCreateSession, instance, &info, &made);
    return made;
}

static XrAction make_action(const char *name, XrActionType type) {
    XrActionCreateInfo info = {.type = XR_TYPE_ACTION_CREATE_INFO, .actionType = type};
    strcpy(info.actionName, name);
    strcpy(info.localizedActionName, name);
    XrAction made = XR_NULL_HANDLE;
    MUST(xrCreateAction, action_set, &info, &made);
    return made;
}

static XrSwapchain make_swapchain(void) {
    XrSwapchainCreateInfo info = {.type = XR_TYPE_SWAPCHAIN_CREATE_INFO};
    fill_swapchain(&info);
    XrSwapchain made = XR_NULL_HANDLE;
    MUST(xrCreateSwapchain, session, &info, &made);
    return made;
}

static void swapchains(void) {
    XrSwapchainCreateInfo info;
    XrSwapchain made = XR_NULL_HANDLE;
#define WITH(field, value, want)                                            \
    info = (XrSwapchainCreateInfo){.type = XR_TYPE_SWAPCHAIN_CREATE_INFO};  \
    fill_swapchain(&info);                                                  \
    info.field = value;                                                     \
    EXPECT(want, xrCreateSwapchain, session, &info, &made);
    WITH(format, 0, XR_ERROR_SWAPCHAIN_FORMAT_UNSUPPORTED) WITH(format, INT64_MAX, XR_ERROR_SWAPCHAIN_FORMAT_UNSUPPORTED)
    WITH(width, 0, XR_ERROR_VALIDATION_FAILURE) WITH(height, UINT32_MAX, XR_ERROR_VALIDATION_FAILURE)
    WITH(arraySize, 0, XR_ERROR_VALIDATION_FAILURE) WITH(arraySize, UINT32_MAX, XR_ERROR_FEATURE_UNSUPPORTED)
    WITH(faceCount, 0, XR_ERROR_VALIDATION_FAILURE) WITH(faceCount, 5, XR_ERROR_VALIDATION_FAILURE)
    WITH(mipCount, 0, XR_ERROR_VALIDATION_FAILURE) WITH(mipCount, 40, XR_ERROR_FEATURE_UNSUPPORTED)
    WITH(sampleCount, 0, XR_ERROR_VALIDATION_FAILURE) WITH(sampleCount, 77, XR_ERROR_FEATURE_UNSUPPORTED)
    WITH(createFlags, 1, XR_ERROR_FEATURE_UNSUPPORTED) WITH(createFlags, 1ull << 40, XR_ERROR_FEATURE_UNSUPPORTED)
    WITH(usageFlags, 1ull << 40, XR_ERROR_FEATURE_UNSUPPORTED)
#undef WITH
    // Images in the wrong order.
    XrSwapchainImageWaitInfo wait = {.type = XR_TYPE_SWAPCHAIN_IMAGE_WAIT_INFO, .timeout = XR_INFINITE_DURATION};
    uint32_t index, count = 0;
    EXPECT(XR_ERROR_CALL_ORDER_INVALID, xrWaitSwapchainImage, swapchain, &wait);
    EXPECT(XR_ERROR_CALL_ORDER_INVALID, xrReleaseSwapchainImage, swapchain, NULL);
    MUST(xrEnumerateSwapchainImages, swapchain, 0, &count, NULL);
    for (uint32_t i = 0; i < count; i++) MUST(xrAcquireSwapchainImage, swapchain, NULL, &index);
    EXPECT(XR_ERROR_CALL_ORDER_INVALID, xrAcquireSwapchainImage, swapchain, NULL, &index);
    EXPECT(XR_ERROR_CALL_ORDER_INVALID, xrReleaseSwapchainImage, swapchain, NULL);
    MUST(xrWaitSwapchainImage, swapchain, &wait);
    EXPECT(XR_ERROR_CALL_ORDER_INVALID, xrWaitSwapchainImage, swapchain, &wait);
    MUST(xrReleaseSwapchainImage, swapchain, NULL);
    EXPECT(XR_ERROR_CALL_ORDER_INVALID, xrReleaseSwapchainImage, swapchain, NULL);
}

static XrSessionState state;

static void poll_events(void) {
    for (;;) {
        XrEventDataBuffer event = {.type = XR_TYPE_EVENT_DATA_BUFFER};
        XrResult code = CALL(xrPollEvent, instance, &event);
        if (code != XR_SUCCESS) return;
        if (event.type == XR_TYPE_EVENT_DATA_SESSION_STATE_CHANGED)
            state = ((XrEventDataSessionStateChanged *)(void *)&event)->state;
    }
}

static XrTime frame_time;

static void begin_frame(void) {
    XrFrameState frame = {.type = XR_TYPE_FRAME_STATE};
    MUST(xrWaitFrame, session, NULL, &frame);
    MUST(xrBeginFrame, session, NULL);
    frame_time = frame.predictedDisplayTime;
}

static XrResult end_frame(uint32_t count, const XrCompositionLayerBaseHeader *const *layers, XrTime time, int blend) {
    XrFrameEndInfo end = {.type = XR_TYPE_FRAME_END_INFO, .displayTime = time, .environmentBlendMode = (XrEnvironmentBlendMode)blend,
                          .layerCount = count, .layers = layers};
    return CALL(xrEndFrame, session, &end);
}

static void before_running(void) {
    XrFrameState frame = {.type = XR_TYPE_FRAME_STATE};
    XrSessionBeginInfo begin = {.type = XR_TYPE_SESSION_BEGIN_INFO, .primaryViewConfigurationType = XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO};
    EXPECT(XR_ERROR_SESSION_NOT_RUNNING, xrWaitFrame, session, NULL, &frame);
    EXPECT(XR_ERROR_SESSION_NOT_RUNNING, xrBeginFrame, session, NULL);
    expect(XR_ERROR_SESSION_NOT_RUNNING, end_frame(0, NULL, 1, 1), "xrEndFrame before xrBeginSession");
    EXPECT(XR_ERROR_SESSION_NOT_RUNNING, xrEndSession, session);
    EXPECT(XR_ERROR_SESSION_NOT_RUNNING, xrRequestExitSession, session);
    EXPECT(XR_ERROR_SESSION_NOT_READY, xrBeginSession, session, &begin);
    poll_events();
    begin.primaryViewConfigurationType = XR_VIEW_CONFIGURATION_TYPE_PRIMARY_MONO;
    EXPECT(XR_ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED, xrBeginSession, session, &begin);
    begin.primaryViewConfigurationType = XR_VIEW_CONFIGURATION_TYPE_PRIMARY_STEREO;
    MUST(xrBeginSession, session, &begin);
    EXPECT(XR_ERROR_SESSION_RUNNING, xrBeginSession, session, &begin);
    EXPECT(XR_ERROR_SESSION_NOT_STOPPING, xrEndSession, session);
}

static void frames(void) {
    EXPECT(XR_ERROR_CALL_ORDER_INVALID, xrBeginFrame, session, NULL);
    expect(XR_ERROR_CALL_ORDER_INVALID, end_frame(0, NULL, 1, 1), "xrEndFrame without xrBeginFrame");
    begin_frame();
    EXPECT(XR_ERROR_CALL_ORDER_INVALID, xrBeginFrame, session, NULL);

    XrCompositionLayerProjectionView views[2];
    XrCompositionLayerProjection layer;
    const XrCompositionLayerBaseHeader *layers[1] = {(const void *)&layer}, *none[17] = {NULL};
    XrCompositionLayerBaseHeader strange = {.type = (XrStructureType)4711};
    const XrCompositionLayerBaseHeader *strangers[1] = {&strange};
    expect(XR_ERROR_TIME_INVALID, end_frame(0, NULL, 0, 1), "xrEndFrame at time 0");
    expect(XR_ERROR_TIME_INVALID, end_frame(0, NULL, -5, 1), "xrEndFrame at time -5");
    expect(XR_ERROR_ENVIRONMENT_BLEND_MODE_UNSUPPORTED, end_frame(0, NULL, frame_time, 2), "xrEndFrame, additive");
    expect(XR_ERROR_LAYER_INVALID, end_frame(1, none, frame_time, 1), "xrEndFrame with a layer NULL");
    expect(XR_ERROR_LAYER_LIMIT_EXCEEDED, end_frame(17, none, frame_time, 1), "xrEndFrame with 17 layers");
    expect(XR_ERROR_LAYER_INVALID, end_frame(1, strangers, frame_time, 1), "xrEndFrame with a strange layer");
    expect(XR_ERROR_VALIDATION_FAILURE, end_frame(1, NULL, frame_time, 1), "xrEndFrame with layers NULL");
#define RIGHT                                                                                                        \
    for (int i = 0; i < 2; i++)                                                                                      \
        views[i] = (XrCompositionLayerProjectionView){.type = XR_TYPE_COMPOSITION_LAYER_PROJECTION_VIEW,             \
            .pose.orientation.w = 1, .fov = {-0.5f, 0.5f, 0.5f, -0.5f},                                              \
            .subImage = {.swapchain = swapchain, .imageRect.extent = {64, 64}}};                                     \
    layer = (XrCompositionLayerProjection){.type = XR_TYPE_COMPOSITION_LAYER_PROJECTION, .space = space, .viewCount = 2, \
        .views = views};
#define WITH(change, want) \
    RIGHT change;          \
    expect(want, end_frame(1, layers, frame_time, 1), "xrEndFrame with " #change);
    WITH(layer.space = XR_NULL_HANDLE, XR_ERROR_HANDLE_INVALID)
    WITH(layer.space = dead_space, XR_ERROR_HANDLE_INVALID)
    WITH(layer.views = NULL, XR_ERROR_VALIDATION_FAILURE)
    WITH(layer.viewCount = 0, XR_ERROR_VALIDATION_FAILURE)
    WITH(layer.viewCount = 1, XR_ERROR_VALIDATION_FAILURE)
    WITH(views[1].type = XR_TYPE_UNKNOWN, XR_ERROR_VALIDATION_FAILURE)
    WITH(views[1].pose.orientation.w = 0, XR_ERROR_POSE_INVALID)
    WITH(views[0].pose.position.x = 0.0f / 0.0f, XR_ERROR_POSE_INVALID)
    WITH(views[0].subImage.swapchain = XR_NULL_HANDLE, XR_ERROR_HANDLE_INVALID)
    WITH(views[0].subImage.swapchain = dead_swapchain, XR_ERROR_HANDLE_INVALID)
    WITH(views[0].subImage.imageRect.extent.width = 65, XR_ERROR_SWAPCHAIN_RECT_INVALID)
    WITH(views[0].subImage.imageRect.extent.height = -1, XR_ERROR_SWAPCHAIN_RECT_INVALID)
    WITH(views[0].subImage.imageRect.offset.x = -1, XR_ERROR_SWAPCHAIN_RECT_INVALID)
    WITH(views[0].subImage.imageRect.offset.y = INT32_MAX, XR_ERROR_SWAPCHAIN_RECT_INVALID)
    WITH(views[0].subImage.imageArrayIndex = 1, XR_ERROR_VALIDATION_FAILURE)
    WITH(, XR_SUCCESS)
#undef WITH
#undef RIGHT
}

static void spaces_and_paths(void) {
    XrSpace made = XR_NULL_HANDLE;
    XrReferenceSpaceCreateInfo info = {.type = XR_TYPE_REFERENCE_SPACE_CREATE_INFO};
    fill_space(&info);
    info.poseInReferenceSpace.orientation.w = 0;
    EXPECT(XR_ERROR_POSE_INVALID, xrCreateReferenceSpace, session, &info, &made);
    fill_space(&info);
    info.referenceSpaceType = (XrReferenceSpaceType)4711;
    EXPECT(XR_ERROR_REFERENCE_SPACE_UNSUPPORTED, xrCreateReferenceSpace, session, &info, &made);
    XrViewLocateInfo locate = {.type = XR_TYPE_VIEW_LOCATE_INFO};
    XrViewState view_state = {.type = XR_TYPE_VIEW_STATE};
    uint32_t count;
    fill_locate_views(&locate), locate.displayTime = 0;
    EXPECT(XR_ERROR_TIME_INVALID, xrLocateViews, session, &locate, &view_state, 0, &count, NULL);
    fill_locate_views(&locate), locate.space = dead_space;
    EXPECT(XR_ERROR_HANDLE_INVALID, xrLocateViews, session, &locate, &view_state, 0, &count, NULL);
    fill_locate_views(&locate), locate.viewConfigurationType = XR_VIEW_CONFIGURATION_TYPE_PRIMARY_MONO;
    EXPECT(XR_ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED, xrLocateViews, session, &locate, &view_state, 0, &count, NULL);
    XrPath got;
    const char *bad[] = {"", "user", "/", "//", "/User", "/user/", "/user//hand", "/user/..", "/user/ hand", "/user/hand?"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) EXPECT(XR_ERROR_PATH_FORMAT_INVALID, xrStringToPath, instance, bad[i], &got);
    char *huge = malloc(100000);
    memset(huge, 'a', 99999), huge[0] = '/', huge[99999] = 0;
    EXPECT(XR_ERROR_PATH_FORMAT_INVALID, xrStringToPath, instance, huge, &got);
    free(huge);
    EXPECT(XR_ERROR_PATH_INVALID, xrPathToString, instance, XR_NULL_PATH, 0, &count, NULL);
    XrSystemGetInfo system = {.type = XR_TYPE_SYSTEM_GET_INFO, .formFactor = XR_FORM_FACTOR_HANDHELD_DISPLAY};
    XrSystemId id;
    EXPECT(XR_ERROR_FORM_FACTOR_UNSUPPORTED, xrGetSystem, instance, &system, &id);
    system.formFactor = (XrFormFactor)4711;
    EXPECT(XR_ERROR_FORM_FACTOR_UNSUPPORTED, xrGetSystem, instance, &system, &id);
}

static void actions(void) {
    XrActionSetCreateInfo set = {.type = XR_TYPE_ACTION_SET_CREATE_INFO};
    XrActionSet made_set = XR_NULL_HANDLE;
#define WITH(name, localized, want)              \
    strcpy(set.actionSetName, name);             \
    strcpy(set.localizedActionSetName, localized); \
    EXPECT(want, xrCreateActionSet, instance, &set, &made_set);
    WITH("", "x", XR_ERROR_NAME_INVALID)
    WITH("x", "", XR_ERROR_LOCALIZED_NAME_INVALID)
    WITH("A B", "x", XR_ERROR_PATH_FORMAT_INVALID)
    WITH("main", "x", XR_ERROR_NAME_DUPLICATED)
    WITH("x", "main", XR_ERROR_LOCALIZED_NAME_DUPLICATED)
#undef WITH
    XrActionCreateInfo info = {.type = XR_TYPE_ACTION_CREATE_INFO, .actionType = XR_ACTION_TYPE_FLOAT_INPUT};
    XrAction made = XR_NULL_HANDLE;
    strcpy(info.actionName, "late"), strcpy(info.localizedActionName, "late");
    EXPECT(XR_ERROR_ACTIONSETS_ALREADY_ATTACHED, xrCreateAction, action_set, &info, &made);
    info.actionType = (XrActionType)4711;
    EXPECT(XR_ERROR_VALIDATION_FAILURE, xrCreateAction, other_set, &info, &made);
    XrSessionActionSetsAttachInfo attach = {.type = XR_TYPE_SESSION_ACTION_SETS_ATTACH_INFO};
    fill_attach(&attach);
    EXPECT(XR_ERROR_ACTIONSETS_ALREADY_ATTACHED, xrAttachSessionActionSets, session, &attach);
    XrInteractionProfileSuggestedBinding suggest = {.type = XR_TYPE_INTERACTION_PROFILE_SUGGESTED_BINDING};
    fill_suggest(&suggest);
    EXPECT(XR_ERROR_ACTIONSETS_ALREADY_ATTACHED, xrSuggestInteractionProfileBindings, instance, &suggest);
    XrActionStateGetInfo get = {.type = XR_TYPE_ACTION_STATE_GET_INFO, .action = number};
    XrActionStateBoolean boolean = {.type = XR_TYPE_ACTION_STATE_BOOLEAN};
    EXPECT(XR_ERROR_ACTION_TYPE_MISMATCH, xrGetActionStateBoolean, session, &get, &boolean);
    get.action = dead_action;
    EXPECT(XR_ERROR_HANDLE_INVALID, xrGetActionStateBoolean, session, &get, &boolean);
    get.action = flag, get.subactionPath = left_hand;
    EXPECT(XR_ERROR_PATH_UNSUPPORTED, xrGetActionStateBoolean, session, &get, &boolean);
    XrActiveActionSet active = {other_set, XR_NULL_PATH};
    XrActionsSyncInfo sync = {.type = XR_TYPE_ACTIONS_SYNC_INFO, .countActiveActionSets = 1, .activeActionSets = &active};
    EXPECT(XR_ERROR_ACTIONSET_NOT_ATTACHED, xrSyncActions, session, &sync);
    sync.activeActionSets = NULL;
    EXPECT(XR_ERROR_VALIDATION_FAILURE, xrSyncActions, session, &sync);
}

// Everything as it should be, so that one thing at a time can be wrong. What is destroyed again on the way leaves
// handles that were valid once.
static void make_world(void) {
    instance = make_instance();
    XrSystemGetInfo get = {.type = XR_TYPE_SYSTEM_GET_INFO};
    fill_system(&get);
    MUST(xrGetSystem, instance, &get, &system_id);
    vulkan();
    make_session(XR_ERROR_GRAPHICS_REQUIREMENTS_CALL_MISSING);
    // What was asked through the other extension does not count.
    XrGraphicsRequirementsVulkan2KHR other = {.type = XR_TYPE_GRAPHICS_REQUIREMENTS_VULKAN2_KHR};
    MUST(xrGetVulkanGraphicsRequirements2KHR, instance, system_id, &other);
    make_session(XR_ERROR_GRAPHICS_REQUIREMENTS_CALL_MISSING);
    XrGraphicsRequirementsVulkanKHR needs = {.type = XR_TYPE_GRAPHICS_REQUIREMENTS_VULKAN_KHR};
    MUST(xrGetVulkanGraphicsRequirementsKHR, instance, system_id, &needs);
    if (needs.minApiVersionSupported > XR_MAKE_VERSION(1, 0, 0)) wrong("Vulkan 1.0 is refused");
    XrSessionCreateInfo info = {.type = XR_TYPE_SESSION_CREATE_INFO};
    XrGraphicsBindingVulkanKHR *binding;
#define WITH(field, value)                                                      \
    fill_session(&info);                                                        \
    binding = (XrGraphicsBindingVulkanKHR *)(uintptr_t)info.next;               \
    binding->field = value;                                                     \
    EXPECT(XR_ERROR_GRAPHICS_DEVICE_INVALID, xrCreateSession, instance, &info, &session);
    WITH(instance, VK_NULL_HANDLE) WITH(device, VK_NULL_HANDLE) WITH(physicalDevice, VK_NULL_HANDLE)
    WITH(physicalDevice, (VkPhysicalDevice)(void *)&info) WITH(queueFamilyIndex, 1000) WITH(queueFamilyIndex, UINT32_MAX)
    WITH(queueIndex, 1000)
#undef WITH
    dead_session = make_session(XR_SUCCESS);
    MUST(xrDestroySession, dead_session);
    session = make_session(XR_SUCCESS);

    int64_t formats[64];
    uint32_t count = 0;
    MUST(xrEnumerateSwapchainFormats, session, 64, &count, formats);
    colour_format = formats[0];
    dead_swapchain = make_swapchain();
    MUST(xrDestroySwapchain, dead_swapchain);
    swapchain = make_swapchain();
    XrReferenceSpaceCreateInfo local = {.type = XR_TYPE_REFERENCE_SPACE_CREATE_INFO};
    fill_space(&local);
    MUST(xrCreateReferenceSpace, session, &local, &dead_space);
    MUST(xrDestroySpace, dead_space);
    MUST(xrCreateReferenceSpace, session, &local, &space);

    left_hand = path("/user/hand/left");
    simple_profile = path("/interaction_profiles/khr/simple_controller");
    select_click = path("/user/hand/left/input/select/click");
    grip = path("/user/hand/left/input/grip/pose");
    if (find(instance, "xrCreateHandTrackerEXT")) {
        XrHandTrackerCreateInfoEXT hand = {.type = XR_TYPE_HAND_TRACKER_CREATE_INFO_EXT};
        fill_hand(&hand);
        MUST(xrCreateHandTrackerEXT, session, &hand, &dead_tracker);
        MUST(xrDestroyHandTrackerEXT, dead_tracker);
        MUST(xrCreateHandTrackerEXT, session, &hand, &tracker);
    }
    XrActionSetCreateInfo set = {.type = XR_TYPE_ACTION_SET_CREATE_INFO};
    fill_set(&set);
    MUST(xrCreateActionSet, instance, &set, &dead_action_set);
    MUST(xrDestroyActionSet, dead_action_set);
    fill_set(&set);
    MUST(xrCreateActionSet, instance, &set, &other_set);
    strcpy(set.actionSetName, "main"), strcpy(set.localizedActionSetName, "main");
    MUST(xrCreateActionSet, instance, &set, &action_set);
    dead_action = make_action("dead", XR_ACTION_TYPE_BOOLEAN_INPUT);
    MUST(xrDestroyAction, dead_action);
    flag = make_action("flag", XR_ACTION_TYPE_BOOLEAN_INPUT);
    number = make_action("number", XR_ACTION_TYPE_FLOAT_INPUT);
    stick = make_action("stick", XR_ACTION_TYPE_VECTOR2F_INPUT);
    pose = make_action("pose", XR_ACTION_TYPE_POSE_INPUT);
    rumble = make_action("rumble", XR_ACTION_TYPE_VIBRATION_OUTPUT);
    XrActionStateGetInfo early = {.type = XR_TYPE_ACTION_STATE_GET_INFO, .action = flag};
    XrActionStateBoolean boolean = {.type = XR_TYPE_ACTION_STATE_BOOLEAN};
    EXPECT(XR_ERROR_ACTIONSET_NOT_ATTACHED, xrGetActionStateBoolean, session, &early, &boolean);
    XrInteractionProfileSuggestedBinding suggest = {.type = XR_TYPE_INTERACTION_PROFILE_SUGGESTED_BINDING};
    fill_suggest(&suggest);
    suggest.interactionProfile = left_hand;
    EXPECT(XR_ERROR_PATH_UNSUPPORTED, xrSuggestInteractionProfileBindings, instance, &suggest);
    fill_suggest(&suggest);
    MUST(xrSuggestInteractionProfileBindings, instance, &suggest);
    XrSessionActionSetsAttachInfo attach = {.type = XR_TYPE_SESSION_ACTION_SETS_ATTACH_INFO};
    fill_attach(&attach);
    MUST(xrAttachSessionActionSets, session, &attach);
}

// Floats travel apart from the rest, so these have their right calls here.
static void floats(void) {
    if (find(instance, "xrRequestDisplayRefreshRateFB")) {
        EXPECT(XR_ERROR_DISPLAY_REFRESH_RATE_UNSUPPORTED_FB, xrRequestDisplayRefreshRateFB, session, 12345.0f);
        EXPECT(XR_ERROR_DISPLAY_REFRESH_RATE_UNSUPPORTED_FB, xrRequestDisplayRefreshRateFB, session, 0.0f / 0.0f);
    }
    if (find(instance, "xrSetInputDeviceLocationEXT")) {
        const XrPosef nowhere = {{0, 0, 0, 0}, {0, 0, 0}};
        EXPECT(XR_ERROR_POSE_INVALID, xrSetInputDeviceLocationEXT, session, left_hand, grip, space, nowhere);
    }
}

// Leaves without a word: no session is ended, nothing but the session and the instance is destroyed.
static void end_of_the_world(void) {
    MUST(xrRequestExitSession, session);
    for (int i = 0; i < 100 && state != XR_SESSION_STATE_STOPPING; i++) {
        begin_frame();
        end_frame(0, NULL, frame_time, 1);
        poll_events();
    }
    EXPECT(XR_SUCCESS, xrEndSession, session);
    EXPECT(XR_ERROR_SESSION_NOT_RUNNING, xrEndSession, session);
    PFN_xrDestroyInstance destroy = (PFN_xrDestroyInstance)(void *)find(instance, "xrDestroyInstance");
    PFN_xrDestroySession destroy_session = (PFN_xrDestroySession)(void *)find(instance, "xrDestroySession");
    PFN_xrPollEvent poll = (PFN_xrPollEvent)(void *)find(instance, "xrPollEvent");
    expect(XR_SUCCESS, destroy_session(session), "xrDestroySession");
    expect(XR_ERROR_HANDLE_INVALID, destroy_session(session), "xrDestroySession twice");
    expect(XR_SUCCESS, destroy(instance), "xrDestroyInstance");
    vkDestroyDevice(vk_device, NULL);
    vkDestroyInstance(vk_instance, NULL);
    // The functions of a mock that is gone.
    XrEventDataBuffer event = {.type = XR_TYPE_EVENT_DATA_BUFFER};
    expect(XR_ERROR_HANDLE_INVALID, destroy(instance), "xrDestroyInstance twice");
    expect(XR_ERROR_HANDLE_INVALID, poll(instance, &event), "xrPollEvent after xrDestroyInstance");
    expect(XR_ERROR_HANDLE_INVALID, poll(XR_NULL_HANDLE, NULL), "xrPollEvent of nothing");
}

int main(int argc, char **argv) {
    setvbuf(stdout, NULL, _IOLBF, 0);
    void *library = argc > 1 ? dlopen(argv[1], RTLD_NOW | RTLD_LOCAL) : NULL;
    Negotiate negotiate = library ? (Negotiate)dlsym(library, "xrNegotiateLoaderRuntimeInterface") : NULL;
    if (!negotiate) {
        printf("WRONG %s\n", argc > 1 ? dlerror() : "no library named");
        return 1;
    }
    negotiation(negotiate);
    asking_for_functions();
    enable_extensions();
    instances();
    enable_extensions();
    make_world();
    asking_for_functions();
    before_running();
    for (size_t i = 0; i < FUNCTIONS; i++) {
        if (argc < 3 || strcmp(argv[2], functions[i].name) == 0) sweep(&functions[i]);
    }
    swapchains();
    frames();
    spaces_and_paths();
    actions();
    floats();
    end_of_the_world();
    printf("%d calls, %d wrong answers\n", calls, faults);
    return faults != 0;
}
