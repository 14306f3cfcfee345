#!/bin/sh
# Prepares this machine to build, run and test Fathomless.
#
#   sh setup.sh           looks for what is needed, installs what is missing, says what it did
#   sh setup.sh --check   looks and says, installs nothing; exit status 1 where something needed is missing
#
# Debian, Ubuntu, Fedora and Arch (and what descends from them) are known. Elsewhere, and offline, it says what
# to install by hand, and succeeds when everything needed is already there.
#
# What is looked for is the thing itself (a library, a driver's manifest, a command), not a package's name, so
# a hand-made installation counts. FATHOMLESS_ROOT names a folder to look under instead of / (the tests use it).
set -eu
cd "$(dirname "$0")"

root=${FATHOMLESS_ROOT:-}
check_only=no

say() { printf 'setup: %s\n' "$*"; }
fail() { printf 'setup: %s\n' "$*" >&2; }

case "${1:-}" in
'') ;;
--check) check_only=yes ;;
-h | --help)
    sed -n '2,/^set -eu/{/^set -eu/d;s/^# \{0,1\}//;p;}' setup.sh
    exit 0
    ;;
*)
    fail "unknown argument '$1'; use 'sh setup.sh' or 'sh setup.sh --check'"
    exit 2
    ;;
esac
if [ $# -gt 1 ]; then
    fail "one argument at most; use 'sh setup.sh' or 'sh setup.sh --check'"
    exit 2
fi

# --- what is needed -------------------------------------------------------------------------------------------

# Everything looked for. The first group is needed to build and run; the second is for a headset, for a window, and
# for the tests with other programs.
needed='compiler pkg-config udev-headers alsa-headers vulkan-loader software-vulkan validation-layers'
wanted='openxr-loader xvfb xdotool hello-xr openxr-validation openxr-headers vulkan-headers'

describe() {
    case $1 in
    compiler) echo 'C compiler and linker (cargo links with it)' ;;
    pkg-config) echo 'pkg-config (finds libudev and ALSA)' ;;
    udev-headers) echo 'libudev headers (for gamepads; cargo build --no-default-features does without)' ;;
    alsa-headers) echo 'ALSA headers (for sound; cargo build --no-default-features does without)' ;;
    vulkan-loader) echo 'Vulkan loader' ;;
    software-vulkan) echo 'software Vulkan driver (lavapipe)' ;;
    validation-layers) echo 'Vulkan validation layers' ;;
    openxr-loader) echo 'OpenXR loader (for a headset)' ;;
    xvfb) echo 'Xvfb (a display for tests)' ;;
    xdotool) echo 'xdotool (keys for tests)' ;;
    hello-xr) echo 'hello_xr (an OpenXR application for tests)' ;;
    openxr-validation) echo 'OpenXR core validation layer (for tests)' ;;
    openxr-headers) echo 'OpenXR headers (for tests)' ;;
    vulkan-headers) echo 'Vulkan headers (for tests)' ;;
    esac
}

# has_file FOLDER PATTERN...: does any of these folders (under the root) hold a file of that pattern?
has_file() {
    pattern=$1
    shift
    for folder in "$@"; do
        for file in "$root$folder"/$pattern; do
            [ -e "$file" ] && return 0
        done
    done
    return 1
}

has_library() {
    if [ -z "$root" ]; then
        for ldconfig in ldconfig /sbin/ldconfig /usr/sbin/ldconfig; do
            # -p lists the cache: what dlopen would find.
            "$ldconfig" -p 2>/dev/null | grep -q "^[[:space:]]*$1 " && return 0
        done
    fi
    has_file "$1" /lib /lib64 /usr/lib /usr/lib64 /usr/local/lib /usr/local/lib64 "/usr/lib/$(uname -m)-linux-gnu"
}

present() {
    case $1 in
    compiler) command -v cc >/dev/null 2>&1 && { [ -n "$root" ] || has_c_library; } ;;
    pkg-config) command -v pkg-config >/dev/null 2>&1 ;;
    udev-headers) has_file libudev.h /usr/include /usr/local/include ;;
    alsa-headers) has_file asoundlib.h /usr/include/alsa /usr/local/include/alsa ;;
    vulkan-loader) has_library libvulkan.so.1 ;;
    software-vulkan) has_file 'lvp_icd*.json' /usr/share/vulkan/icd.d /usr/local/share/vulkan/icd.d /etc/vulkan/icd.d ;;
    validation-layers)
        has_file 'VkLayer_khronos_validation.json' /usr/share/vulkan/explicit_layer.d \
            /usr/local/share/vulkan/explicit_layer.d /etc/vulkan/explicit_layer.d
        ;;
    openxr-loader) has_library libopenxr_loader.so.1 ;;
    xvfb) command -v Xvfb >/dev/null 2>&1 ;;
    xdotool) command -v xdotool >/dev/null 2>&1 ;;
    hello-xr) command -v hello_xr >/dev/null 2>&1 ;;
    openxr-validation)
        has_file 'XrApiLayer_core_validation*.json' /usr/share/openxr/1/api_layers/explicit.d \
            /usr/local/share/openxr/1/api_layers/explicit.d /etc/openxr/1/api_layers/explicit.d
        ;;
    openxr-headers) has_file openxr.h /usr/include/openxr /usr/local/include/openxr ;;
    vulkan-headers) has_file vulkan.h /usr/include/vulkan /usr/local/include/vulkan ;;
    esac
}

# A compiler without the C library's start files cannot link, which is what cargo asks of it.
has_c_library() {
    object=$(cc -print-file-name=crt1.o 2>/dev/null) || return 1
    [ -f "$object" ]
}

# --- who installs it ------------------------------------------------------------------------------------------

# The family of the distribution: debian, fedora, arch or unknown.
family() {
    release=$root/etc/os-release
    [ -r "$release" ] || release=$root/usr/lib/os-release
    [ -r "$release" ] || { echo unknown && return; }
    for id in $(sed -n 's/^ID=//p; s/^ID_LIKE=//p' "$release" | tr -d "\"'"); do
        case $id in
        debian | ubuntu) echo debian && return ;;
        fedora | rhel) echo fedora && return ;;
        arch) echo arch && return ;;
        esac
    done
    echo unknown
}

# The packages of one thing, per family.
packages() {
    case $family:$1 in
    debian:compiler) echo 'gcc libc6-dev' ;;
    debian:pkg-config) echo pkg-config ;;
    debian:udev-headers) echo libudev-dev ;;
    debian:alsa-headers) echo libasound2-dev ;;
    debian:vulkan-loader) echo libvulkan1 ;;
    debian:software-vulkan) echo mesa-vulkan-drivers ;;
    debian:validation-layers) echo vulkan-validationlayers ;;
    debian:openxr-loader) echo libopenxr-loader1 ;;
    debian:xvfb) echo xvfb ;;
    debian:hello-xr) echo libopenxr-utils ;;
    debian:openxr-validation) echo openxr-layer-corevalidation ;;
    debian:openxr-headers) echo libopenxr-dev ;;
    debian:vulkan-headers) echo libvulkan-dev ;;
    fedora:compiler) echo 'gcc glibc-devel' ;;
    fedora:pkg-config) echo pkgconf-pkg-config ;;
    fedora:udev-headers) echo systemd-devel ;;
    fedora:alsa-headers) echo alsa-lib-devel ;;
    fedora:vulkan-loader) echo vulkan-loader ;;
    fedora:software-vulkan) echo mesa-vulkan-drivers ;;
    fedora:validation-layers) echo vulkan-validation-layers ;;
    fedora:openxr-loader) echo openxr-libs ;;
    fedora:xvfb) echo xorg-x11-server-Xvfb ;;
    fedora:hello-xr) echo openxr ;;
    fedora:openxr-validation) echo 'openxr openxr-devel' ;;
    fedora:openxr-headers) echo openxr-devel ;;
    fedora:vulkan-headers) echo 'vulkan-headers vulkan-loader-devel' ;;
    arch:compiler) echo gcc ;;
    arch:pkg-config) echo pkgconf ;;
    arch:udev-headers) echo systemd-libs ;;
    arch:alsa-headers) echo alsa-lib ;;
    arch:vulkan-loader) echo vulkan-icd-loader ;;
    arch:software-vulkan) echo vulkan-swrast ;;
    arch:validation-layers) echo vulkan-validation-layers ;;
    arch:openxr-loader) echo openxr ;;
    arch:xvfb) echo xorg-server-xvfb ;;
    arch:hello-xr | arch:openxr-validation | arch:openxr-headers) echo openxr ;;
    arch:vulkan-headers) echo vulkan-headers ;;
    *:xdotool) echo xdotool ;;
    esac
}

install_command() {
    case $family in
    debian) echo "apt-get install -y --no-install-recommends" ;;
    fedora) echo "dnf install -y" ;;
    arch) echo "pacman -S --needed --noconfirm" ;;
    esac
}

# Runs a command as root: as it is when we are root, else through sudo.
as_root() {
    if [ "$(id -u)" = 0 ]; then
        "$@"
    else
        sudo "$@"
    fi
}

# The package lists, where there are none yet or they may be stale. Failing here (offline) is not the end:
# the packages may be in the cache.
refresh() {
    case $family in
    debian) as_root apt-get update || fail "could not refresh the package lists (offline?); trying with what is there" ;;
    arch)
        # Only where there is no list at all: refreshing alone invites a partial upgrade, which Arch does not support.
        has_file '*.db' /var/lib/pacman/sync || as_root pacman -Sy --noconfirm ||
            fail "could not refresh the package lists (offline?); trying with what is there"
        ;;
    esac
}

# Installs the packages together; where that fails, one by one, so that one missing name costs only itself.
install_packages() {
    # The command and the packages are lists of words.
    # shellcheck disable=SC2046,SC2086
    as_root env DEBIAN_FRONTEND=noninteractive $(install_command) $1 && return
    fail "installing them together failed; trying one by one"
    for package in $1; do
        # shellcheck disable=SC2046
        as_root env DEBIAN_FRONTEND=noninteractive $(install_command) "$package" || fail "could not install $package"
    done
}

# --- Rust -----------------------------------------------------------------------------------------------------

# at_least HAVE WANT: compares versions such as 1.88 and 1.95.0, number by number.
at_least() {
    printf '%s\n' "$1 $2" | awk '{
        n = split($2, want, "."); split($1, have, ".")
        for (i = 1; i <= n; i++) if (have[i] + 0 != want[i] + 0) exit (have[i] + 0 < want[i] + 0)
    }'
}

check_rust() {
    want=$(sed -n 's/^rust-version *= *"\([0-9.]*\)".*/\1/p' Cargo.toml)
    if ! command -v cargo >/dev/null 2>&1; then
        if [ -x "${HOME:-}/.cargo/bin/cargo" ]; then
            fail "Rust is installed in ~/.cargo/bin, which is not on the PATH; run: . \"\$HOME/.cargo/env\""
        else
            fail "cargo not found; install Rust $want or newer from https://rustup.rs, then run this again"
        fi
        return 1
    fi
    have=$(rustc --version 2>/dev/null | sed -n 's/^rustc \([0-9.]*\).*/\1/p') || have=
    if [ -z "$have" ]; then
        fail "cargo is there, but rustc does not answer; run 'rustup default stable', then run this again"
        return 1
    fi
    if ! at_least "$have" "$want"; then
        fail "Rust $have is too old: Fathomless needs $want or newer; run 'rustup update stable', then run this again"
        return 1
    fi
    say "Rust $have: already there"
}

# --- do it ----------------------------------------------------------------------------------------------------

# Sets `missing` to the things of $1 that are not there.
find_missing() {
    missing=
    for thing in $1; do
        present "$thing" || missing="$missing $thing"
    done
}

describe_all() {
    for thing in $1; do
        printf '%s%s' "${separator:-}" "$(describe "$thing")"
        separator=', '
    done
    separator=
}

family=$(family)
status=0
check_rust || status=1

for thing in $needed $wanted; do
    if present "$thing"; then say "$(describe "$thing"): already there"; else say "$(describe "$thing"): missing"; fi
done
find_missing "$needed $wanted"

if [ -n "$missing" ]; then
    list=
    for thing in $missing; do
        for package in $(packages "$thing"); do
            case " $list " in
            *" $package "*) ;;
            *) list="${list:+$list }$package" ;;
            esac
        done
    done

    if [ "$family" = unknown ]; then
        fail "this distribution is not known here; install by hand: $(describe_all "$missing")"
    elif [ "$check_only" = yes ]; then
        say "'sh setup.sh' would run: $(install_command) $list"
    elif [ "$(id -u)" != 0 ] && ! command -v sudo >/dev/null 2>&1; then
        fail "not root, and there is no sudo; as root run: $(install_command) $list"
    else
        say "installing: $list"
        refresh
        install_packages "$list"
    fi
    find_missing "$wanted"
    [ -z "$missing" ] || say "going on without: $(describe_all "$missing")"
    find_missing "$needed"
    if [ -n "$missing" ]; then
        fail "still missing: $(describe_all "$missing"); install it by hand and run this again"
        status=1
    fi
fi

[ "$status" != 0 ] || say "everything needed is there"
exit "$status"
