#!/usr/bin/env python3
"""Writes documented_codes.rs: the result codes of each OpenXR function, from the registry.

    python3 generate_codes.py .../specification/registry/xr.xml > documented_codes.rs

xr.xml is in the source package openxr-sdk-source of Debian (specification/registry/xr.xml).
"""
import sys
import xml.etree.ElementTree as ElementTree

EXTENSIONS = {
    "XR_KHR_vulkan_enable2",
    "XR_KHR_visibility_mask",
    "XR_FB_display_refresh_rate",
    "XR_EXT_performance_settings",
}
# Of an extension whose other functions are not called.
ALSO = {"xrCreateDebugUtilsMessengerEXT"}

registry = ElementTree.parse(sys.argv[1]).getroot()
wanted = set(ALSO)
for part in [*registry.findall("feature"), *registry.iter("extension")]:
    if part.tag == "feature" or part.get("name") in EXTENSIONS:
        wanted.update(command.get("name") for command in part.iter("command"))

version = next(t.findtext("name") and "".join(t.itertext()) for t in registry.iter("type")
               if t.findtext("name") == "XR_CURRENT_API_VERSION")
version = version.split("(")[1].split(")")[0].replace(", ", ".")
print(f"//! Result codes of OpenXR functions as xr.xml {version} lists them; made by generate_codes.py.")
print()
print("use openxr::sys::Result as R;")
print()
print("/// Function, and what it may answer: the core and the extensions in use. SUCCESS is left out.")
print("#[rustfmt::skip]")
print("pub const DOCUMENTED_CODES: &[(&str, &[R])] = &[")
commands = {command.findtext("proto/name"): command for command in registry.iter("command")}
for command in registry.iter("command"):
    if command.get("alias"):
        commands[command.get("name")] = commands[command.get("alias")]
for name in sorted(wanted):
    command = commands[name]
    codes = f"{command.get('successcodes', '')},{command.get('errorcodes', '')}".split(",")
    codes = sorted({code for code in codes if code and code != "XR_SUCCESS"})
    print(f"    (\"{name}\", &[{', '.join('R::' + code.removeprefix('XR_') for code in codes)}]),")
print("];")
