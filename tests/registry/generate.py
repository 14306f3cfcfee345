#!/usr/bin/env python3
"""Makes src/mock/registry/table.rs from the OpenXR registry.

    python3 tests/registry/generate.py xr.xml > src/mock/registry/table.rs

The registry is `specification/registry/xr.xml` in the source package openxr-sdk-source of Debian:

    apt-get source --download-only openxr-sdk-source
    tar xf openxr-sdk-source_*.orig.tar.xz --wildcards --strip-components=3 '*/specification/registry/xr.xml'

Needs nothing but Python's own library. The same registry gives the same bytes.
"""

import re
import sys
import xml.etree.ElementTree as ElementTree

KINDS = {
    "XR_ACTION_TYPE_BOOLEAN_INPUT": "Boolean",
    "XR_ACTION_TYPE_FLOAT_INPUT": "Float",
    "XR_ACTION_TYPE_VECTOR2F_INPUT": "Vector",
    "XR_ACTION_TYPE_POSE_INPUT": "Pose",
    "XR_ACTION_TYPE_VIBRATION_OUTPUT": "Haptic",
}

# An extension whose requirements are all of these gives an application paths and nothing else.
PATH_TAGS = {"enum", "interaction_profile", "extend"}


def text(value):
    """A Rust string literal."""
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'


def alternatives(depends):
    """`A+B,C` as a list of lists of names: any of these, each all of these."""
    if not depends:
        return [[]]
    if "(" in depends:
        sys.exit(f"no way to read the dependency {depends}")
    return [alternative.split("+") for alternative in depends.split(",")]


class Offers:
    """Versions and extensions of which something needs one combination; equal lists share a constant."""

    def __init__(self):
        self.names = {}

    def add(self, combinations):
        unique = []
        for combination in combinations:
            # A version that every instance has needs no mention beside something else.
            needs = tuple(need for need in dict.fromkeys(combination) if need != "XR_VERSION_1_0") or ("XR_VERSION_1_0",)
            if needs not in unique:
                unique.append(needs)
        # A combination that contains another one adds nothing.
        minimal = [one for one in unique if not any(other != one and set(other) < set(one) for other in unique)]
        if ("XR_VERSION_1_0",) in minimal:
            minimal = [("XR_VERSION_1_0",)]
        key = tuple(minimal)
        if key not in self.names:
            self.names[key] = "CORE" if key == (("XR_VERSION_1_0",),) else f"N{len(self.names)}"
        return self.names[key]

    def write(self, out):
        for key, name in self.names.items():
            lists = ", ".join("&[" + ", ".join(text(need) for need in needs) + "]" for needs in key)
            visible = "pub(super) " if name == "CORE" else ""
            out.append(f"{visible}const {name}: Needs = &[{lists}];")


def providers(root):
    """Every feature and extension of OpenXR with its blocks: name, requirements of the block, block."""
    for feature in root.findall("feature"):
        if feature.get("name").startswith("XR_VERSION_"):
            for block in feature.findall("require"):
                yield feature.get("name"), alternatives(block.get("depends")), block
    for extension in root.find("extensions"):
        if extension.get("supported") == "openxr":
            for block in extension.findall("require"):
                yield extension.get("name"), alternatives(block.get("depends")), block


def version(root):
    for define in root.iter("type"):
        if define.findtext("name") == "XR_CURRENT_API_VERSION":
            return re.search(r"\((\d+), (\d+), (\d+)\)", "".join(define.itertext())).groups()
    sys.exit("the registry has no XR_CURRENT_API_VERSION")


def copyright_line(root):
    """Whose the registry is, and under which licences."""
    notice = root.findtext("comment")
    owner = re.search(r"Copyright .*?(?=\.?\n)", notice).group()
    return f"{owner}; {re.search('SPDX-License-Identifier: (.*)', notice).group(1)}"


def enumerants(root, name):
    """Number and name of every enumerant of an enumeration, aliases left out."""
    found = {}
    for enums in root.findall("enums"):
        if enums.get("name") == name:
            for enum in enums.findall("enum"):
                if enum.get("alias") is None:
                    found[int(enum.get("value"), 0)] = enum.get("name")
    containers = [(None, feature) for feature in root.findall("feature")]
    containers += [(extension.get("number"), extension) for extension in root.find("extensions")]
    for number, container in containers:
        for enum in container.iter("enum"):
            if enum.get("extends") != name or enum.get("alias") is not None:
                continue
            if enum.get("value") is not None:
                value = int(enum.get("value"), 0)
            else:
                extension = int(enum.get("extnumber") or number)
                value = 1_000_000_000 + (extension - 1) * 1000 + int(enum.get("offset"))
                if enum.get("dir") == "-":
                    value = -value
            if found.setdefault(value, enum.get("name")) != enum.get("name"):
                sys.exit(f"{found[value]} and {enum.get('name')} share the number {value}")
    return sorted(found.items())


def aliases(root, name):
    """The second names of an enumeration's enumerants."""
    return {
        enum.get("name"): enum.get("alias")
        for enum in root.iter("enum")
        if enum.get("extends") == name and enum.get("alias") is not None
    }


def codes(root):
    """For every command the numbers of the codes that it may return: successes, then errors."""
    numbers = {name: number for number, name in enumerants(root, "XrResult")}
    second = aliases(root, "XrResult")
    found = {}
    for command in root.findall("commands/command"):
        if command.get("alias") is None:
            names = [command.get(kind, "").split(",") for kind in ("successcodes", "errorcodes")]
            found[command.findtext("proto/name")] = [
                sorted(numbers[second.get(name, name)] for name in kind if name) for kind in names
            ]
    for command in root.findall("commands/command"):
        if command.get("alias") is not None:
            found[command.get("name")] = found[command.get("alias")]
    return found


def commands(root):
    """Every command with the combinations that offer it."""
    found = {}
    for name, depends, block in providers(root):
        for command in block.findall("command"):
            needs = [[name, *one] for one in depends]
            found.setdefault(command.get("name"), []).extend(needs)
    return found


def extensions(root):
    """Every extension: name, version of its specification, what else must be enabled, whether it gives paths only."""
    for extension in root.find("extensions"):
        if extension.get("supported") != "openxr":
            continue
        name = extension.get("name")
        revision = [
            enum.get("value") for enum in extension.iter("enum") if enum.get("name") == f"{name}_SPEC_VERSION"
        ]
        blocks = [item for block in extension.findall("require") for item in block]
        paths = any(item.tag in ("interaction_profile", "extend") for item in blocks)
        only = all(
            item.tag in PATH_TAGS
            and (item.tag != "enum" or item.get("name").startswith(name) or item.get("value", "").startswith('"'))
            and (item.tag != "extend" or item.get("interaction_profile_path"))
            for item in blocks
        )
        yield name, int(revision[0]), alternatives(extension.get("depends")), paths and only


def profiles(root):
    """Every interaction profile with its user paths, the combinations that offer it, and its components."""
    found = {}
    for profile in root.find("interaction_profiles"):
        components = [
            (item.get("user_path"), item.get("subpath"), item.get("type"), item.get("system") == "true", [[]])
            for item in profile.findall("component")
        ]
        found[profile.get("name")] = {
            "title": profile.get("title"),
            "users": [item.get("path") for item in profile.findall("user_path")],
            "needs": [],
            "components": components,
        }
    for name, depends, block in providers(root):
        needs = [[name, *one] for one in depends]
        for profile in block.findall("interaction_profile"):
            found[profile.get("name")]["needs"] += needs
        for extend in block.findall("extend"):
            path = extend.get("interaction_profile_path")
            if path is None:
                # The other kinds extend a command, or all profiles that fulfil a condition.
                continue
            if extend.findall("user_path"):
                sys.exit(f"{name} adds a user path to {path}: not handled")
            for item in extend.findall("component"):
                key = (item.get("user_path"), item.get("subpath"))
                components = found[path]["components"]
                for known in components:
                    if known[:2] == key:
                        if known[2] != item.get("type"):
                            sys.exit(f"{path}{key[1]} has two types")
                        if known[4] != [[]]:
                            known[4].extend(needs)
                        break
                else:
                    system = item.get("system") == "true"
                    components.append((*key, item.get("type"), system, list(needs)))
    return found


def main():
    root = ElementTree.parse(sys.argv[1]).getroot()
    release = version(root)
    offers = Offers()
    offers.add([["XR_VERSION_1_0"]])
    body = []

    body.append("\n/// Every interaction profile.\npub static PROFILES: &[Profile] = &[")
    for path, profile in profiles(root).items():
        if not profile["needs"]:
            print(f"{path} is offered by nothing: left out", file=sys.stderr)
            continue
        users = ", ".join(text(user) for user in profile["users"])
        body.append(f"    Profile {{ path: {text(path)}, title: {text(profile['title'])}, needs: {offers.add(profile['needs'])},")
        body.append(f"        user_paths: &[{users}],")
        body.append("        components: &[")
        for user, subpath, kind, system, needs in profile["components"]:
            place = f"Some({text(user)})" if user else "None"
            body.append(
                f"            Component {{ user_path: {place}, subpath: {text(subpath)}, kind: Kind::{KINDS[kind]},"
                f" system: {str(system).lower()}, needs: {offers.add(needs)} }},"
            )
        body.append("        ] },")
    body.append("];")

    for constant, name in (
        ("RESULTS", "XrResult"),
        ("STRUCTURE_TYPES", "XrStructureType"),
        ("OBJECT_TYPES", "XrObjectType"),
    ):
        body.append(f"\n/// Every `{name}`, by number.\npub static {constant}: &[(i32, &str)] = &[")
        body += [f"    ({value}, {text(enum)})," for value, enum in enumerants(root, name)]
        body.append("];")

    body.append("\n/// Every function.\npub static COMMANDS: &[Command] = &[")
    results = codes(root)
    for name, needs in commands(root).items():
        successes, errors = (", ".join(map(str, kind)) for kind in results[name])
        body.append(f"    Command {{ name: {text(name)}, needs: {offers.add(needs)},")
        body.append(f"        successes: &[{successes}], errors: &[{errors}] }},")
    body.append("];")

    body.append("\n/// Every extension.\npub static EXTENSIONS: &[Extension] = &[")
    for name, revision, needs, only in extensions(root):
        body.append(
            f"    Extension {{ name: {text(name)}, version: {revision}, needs: {offers.add(needs)},"
            f" only_paths: {str(only).lower()} }},"
        )
    body.append("];")

    out = [
        f"//! What the OpenXR registry {'.'.join(release)} says. Made by `tests/registry/generate.py`, which says how; not for",
        f"//! editing. The registry: {copyright_line(root)}.",
        "",
        "use super::{Command, Component, Extension, Kind, Needs, Profile};",
        "",
        "/// The version of OpenXR that the registry describes.",
        f"pub const VERSION: (u16, u16, u32) = ({', '.join(release)});",
        "",
    ]
    offers.write(out)
    print("\n".join(out + body))


main()
