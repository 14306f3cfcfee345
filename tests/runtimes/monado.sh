#!/usr/bin/env bash
# A real runtime behind the viewer: Monado, from Debian 13's packages in a folder of its own.
#
#   tests/runtimes/monado.sh [BINARY]     BINARY: target/release/fathomless where not given
#
# Five flights: on Monado's null compositor; on its real one in a window of Xvfb (with a picture of that window); with
# controllers that it simulates; with some that the mouse moves in a window of its own, by which somebody dives; and
# one during which the service is killed and started again. Each must reach FOCUSED without one message of the OpenXR and
# Vulkan validation layers, and the last must go on at the same place. How long that takes is said: nothing here depends on
# how fast the machine is.
#
# Exit status: 0 all is well; 77 it cannot be tried here (the last line says why); anything else: it failed.
# The folder is kept (target/monado; MONADO_CACHE names another), about 1 GB. Needs root, debootstrap and a network the
# first time. DEBIAN_MIRROR names another mirror. MONADO_FRAMES (a multiple of 100)
# and MONADO_SIZE: other numbers of frames, other pictures.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

cache=${MONADO_CACHE:-$PWD/target/monado}
root=$cache/root
binary=${1:-target/release/fathomless}
mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}
packages=monado-service,libopenxr1-monado,libopenxr-loader1,openxr-layer-corevalidation,mesa-vulkan-drivers
packages+=,vulkan-validationlayers,libgcc-s1,xvfb,imagemagick,xdotool,libgl1-mesa-dri
# So many frames on each compositor.
frames=${MONADO_FRAMES:-600}
# Seconds, longer than anything takes on a busy machine without a GPU; so many frames take longer.
patience=120
frames_patience=900

say() { printf 'monado: %s\n' "$*"; }
cannot() { say "not tried: $*"; exit 77; }
fail() {
    say "FAILED: $*"
    for log in "$root"/run/*.log; do
        [ -e "$log" ] || continue
        printf -- '--- %s\n' "$log"
        tail -n 25 "$log"
    done
    exit 1
}

# --- outside: the folder, and a world of its own for what runs in it ---------------------------------------------

if [ -z "${MONADO_INSIDE:-}" ]; then
    [ -x "$binary" ] || cannot "there is no $binary (cargo build --release)"
    [ "$(id -u)" = 0 ] || cannot 'a folder with a system in it needs root'
    if [ ! -e "$cache/packages" ] || [ "$(cat "$cache/packages")" != "$packages" ]; then
        if ! command -v debootstrap > /dev/null; then
            apt-get install -y --no-install-recommends debootstrap > /dev/null 2>&1 ||
                cannot 'debootstrap is missing and cannot be installed'
        fi
        say "fetching Monado and what it needs from $mirror"
        rm -rf "$root" "$cache/packages"
        mkdir -p "$cache"
        debootstrap --variant=minbase "--include=$packages" trixie "$root" "$mirror" > "$cache/debootstrap.log" 2>&1 ||
            cannot "the packages cannot be fetched: $(tail -n 1 "$cache/debootstrap.log")"
        printf '%s' "$packages" > "$cache/packages"
    fi
    unshare --mount --pid --fork --kill-child true 2> /dev/null || cannot 'namespaces are not allowed here'
    install -m 755 "$binary" "$root/usr/local/bin/fathomless"
    status=0
    MONADO_INSIDE=1 unshare --mount --pid --fork --kill-child --mount-proc="$root/proc" \
        "${BASH_SOURCE[0]}" "$binary" &
    inner=$!
    # It heeds no gentler signal; all that runs inside goes with it.
    trap 'kill -KILL "$inner"' TERM INT HUP
    wait "$inner" || status=$?
    exit "$status"
fi

# --- inside ------------------------------------------------------------------------------------------------------

mount --rbind /dev "$root/dev"
mount -t tmpfs tmpfs "$root/run"
mount -t tmpfs tmpfs "$root/tmp"
mkdir -m 700 "$root/run/xr"
mkdir -m 1777 "$root/tmp/.X11-unix"
# The service reads commands from its standard input, and ends with it: this one never does.
mkfifo "$root/run/commands"
exec 9<> "$root/run/commands"
export XDG_RUNTIME_DIR=/run/xr HOME=/run LC_ALL=C NO_COLOR=1
# A head that stays where it is.
export QWERTY_ENABLE=1

inside() { chroot "$root" "$@"; }

# wait_until SECONDS COMMAND...: until the command succeeds.
wait_until() {
    local deadline=$((SECONDS + $1))
    shift
    until "$@"; do
        [ "$SECONDS" -lt "$deadline" ] || return 1
        sleep 0.05
    done
}

# count FILE PATTERN: its lines that match.
count() { grep -cE -e "$2" "$1" 2> /dev/null || [ $? = 1 ] || echo 0; }

# has TIMES FILE PATTERN: so many lines of the file match.
has() { [ "$(count "$2" "$3")" -ge "$1" ]; }

# wait_for FILE PATTERN: until a line of the file matches.
wait_for() { wait_until "$patience" has 1 "$1" "$2"; }

# since TIME: seconds since $EPOCHREALTIME was that.
since() { awk "BEGIN { printf \"%.1f\", $EPOCHREALTIME - $1 }"; }

# start_service NAME VARIABLE=VALUE...
start_service() {
    local log=$root/run/$1.log
    shift
    env "$@" chroot "$root" monado-service < "$root/run/commands" > "$log" 2>&1 &
    service=$!
    wait_until "$patience" [ -S "$root/run/xr/monado_comp_ipc" ] || fail 'the service does not start'
}

stop_service() {
    kill "-${1:-TERM}" "$service" 2> /dev/null || true
    wait "$service" 2> /dev/null || true
    rm -f "$root/run/xr/monado_comp_ipc"
}

# start_viewer NAME OPTION...: its log is in NAME.log.
start_viewer() {
    local name=$1
    shift
    viewer_log=$root/run/$name.log
    export XR_RUNTIME_JSON=/usr/share/openxr/1/openxr_monado.json
    export XR_ENABLE_API_LAYERS=XR_APILAYER_LUNARG_core_validation
    export XR_CORE_VALIDATION_EXPORT_TYPE=text XR_CORE_VALIDATION_FILE_NAME=/run/xr/validation.txt
    export RUST_LOG=warn,fathomless=debug
    chroot "$root" fathomless view --validate --flight "${flight:-over}" --size ${MONADO_SIZE:-96x96} "$@" > "$viewer_log" 2>&1 &
    viewer=$!
}

# Ends the viewer as Ctrl-C does, and waits for it. Nothing may have been said by either layer.
finish_viewer() {
    kill -TERM "$viewer"
    local status=0
    wait "$viewer" || status=$?
    [ "$status" = 0 ] || fail "the viewer ended with $status: $(tail -n 1 "$viewer_log")"
    local said=$root/run/xr/validation.txt
    grep -q 'Core Validation Layer is initialized' "$said" || fail 'the OpenXR validation layer was not on'
    if grep -qvE 'VALID_(DEBUG|INFO)' "$said"; then
        fail "OpenXR validation: $(grep -vE 'VALID_(DEBUG|INFO)' "$said" | head -n 3)"
    fi
    rm "$said"
    say "  $(grep 'frames drawn and' "$viewer_log")"
}

# Flies the viewer as $1 on the service until it has drawn enough.
fly() {
    start_viewer "$1" --runtime system
    wait_for "$viewer_log" '-> FOCUSED' || fail 'FOCUSED is not reached'
    wait_until "$frames_patience" has 1 "$viewer_log" "(^| )$frames frames drawn" || fail "$frames frames take too long"
}

say "$(inside dpkg-query -W -f '${Package} ${Version}' monado-service), on the null compositor"
start_service null XRT_COMPOSITOR_NULL=1
fly viewer-null
finish_viewer
stop_service

say 'on the real compositor, in a window'
inside Xvfb :77 -screen 0 1280x720x24 -nolisten tcp > "$root/run/xvfb.log" 2>&1 &
wait_for "$root/proc/net/unix" 'X11-unix/X77' || fail 'Xvfb does not start'
start_service window DISPLAY=:77 XRT_COMPOSITOR_FORCE_XCB=1 XRT_COMPOSITOR_DEFAULT_FRAMERATE=60
fly viewer-window
inside env DISPLAY=:77 import -window root png:/run/window.png
cp "$root/run/window.png" "$cache/window.png"
finish_viewer
# Monado's window is 640x360: an eye's picture each, blue sky over reddish ground, and no two pixels of it alike.
mean() { inside convert png:/run/window.png -crop "$1" -resize '1x1!' -format '%[fx:u.b-u.r]' info:; }
for x in 0 320; do
    sky=$(mean "200x60+$((x + 60))+20")
    ground=$(mean "200x100+$((x + 60))+220")
    rough=$(inside convert png:/run/window.png -crop "200x100+$((x + 60))+220" -format '%[fx:standard_deviation]' info:)
    awk "BEGIN { exit !($sky > 0.1 && $ground < -0.1 && $rough > 0.03) }" ||
        fail "the picture is not right at $x: sky $sky, ground $ground, roughness $rough ($cache/window.png)"
done
say "  the window shows sky over ground to both eyes: $cache/window.png"
stop_service

say 'with simulated controllers, a different one in each hand'
start_service simulated XRT_COMPOSITOR_NULL=1 QWERTY_ENABLE=0 SIMULATED_ENABLE=1 SIMULATED_LEFT=simple SIMULATED_RIGHT=wmr
start_viewer viewer-simulated --runtime system
wait_for "$viewer_log" 'left hand: /interaction_profiles/khr/simple_controller' || fail 'no simple controller'
wait_for "$viewer_log" 'right hand: /interaction_profiles/microsoft/motion_controller' || fail 'no motion controller'
# Monado has words for what is bound.
wait_for "$viewer_log" 'bound: Dive to where the hand points: .*[Ll]eft.*[Rr]ight' || fail 'nothing is bound to dives'
wait_for "$viewer_log" '100 frames drawn' || fail 'no frames'
finish_viewer
grep -oE 'bound: .*' "$viewer_log" | sed 's/^/monado:   /'
stop_service

# The simulated controllers move, and nobody can press their buttons. Those of the driver for keys and mouse can be
# pressed: in the service's own window, with the left mouse button for the trigger of the right hand, and the mouse turns
# the head, which takes the hands along, while its right button is held.
say 'with controllers that the mouse moves: a dive'
start_service qwerty DISPLAY=:77 XRT_COMPOSITOR_NULL=1 XRT_DEBUG_GUI=1 LIBGL_ALWAYS_SOFTWARE=1
flight=still start_viewer viewer-qwerty --runtime system --stats /run/qwerty.csv
wait_for "$viewer_log" 'right hand: /interaction_profiles/microsoft/motion_controller' || fail 'no motion controller'
press() { inside env DISPLAY=:77 xdotool "$@"; }
find_window() { window=$(press search --name 'Monado' 2> /dev/null | tail -n 1) && [ -n "$window" ]; }
wait_until "$patience" find_window || fail 'the service shows no window'
# A small window takes less time.
press windowsize "$window" 320 180 windowmove "$window" 0 0 mousemove 300 170
wait_for "$viewer_log" '100 frames drawn' || fail 'no frames'

# Columns 1 and 2: frame and depth. The flight stays where it is until somebody dives. The last line may be half there.
fallen() {
    awk -F, 'NR == 2 { first = $2 } NR > 2 { most = last > most ? last : most; last = $2 - first }
        END { print most + 0 }' "$root/run/qwerty.csv"
}
fell() { awk "BEGIN { exit !($(fallen) > $1) }"; }
shown() { wc -l < "$root/run/qwerty.csv"; }
has_shown() { [ "$(shown)" -ge "$1" ]; }
# Time enough for the window to hear of the mouse, and for frames to be drawn and written after that.
heed() {
    local more=$(($(shown) + 20))
    sleep 1
    wait_until "$patience" has_shown "$more" || fail 'no more frames'
}
# A trigger that is pulled while the hand points at the sky does nothing until it is pulled anew: it looks down a little,
# pulls, and again, until there is ground.
for _ in $(seq 20); do
    press mousemove 300 20 mousedown 3
    for _ in $(seq 12); do press mousemove_relative 0 6; done
    press mouseup 3 mousemove 300 170 mousedown 1
    heed
    fell 0.01 && break
    press mouseup 1
    heed
done
fell 0.01 || fail 'the trigger leads nowhere'
# Each octave of the dive is felt in the hands.
wait_until "$patience" fell 2 || fail "the dive goes $(fallen) octaves down"
wait_until "$patience" has 2 "$root/run/qwerty.log" 'Haptic output' || fail 'the octaves are not felt'
press mouseup 1
finish_viewer
# It ends by itself only when its window is closed.
stop_service KILL
say "  somebody pulled the trigger and fell $(fallen) octaves"

say 'killed in mid-flight'
start_service killed XRT_COMPOSITOR_NULL=1
start_viewer viewer-killed --runtime auto
wait_for "$viewer_log" '100 frames drawn' || fail 'no frames'
first='frames drawn, 1 of them in this session'
# flown PATTERN [NUMBER]: how far into the flight it was at that line of those that match, the first if not said.
flown() { grep -E -e "$1" "$viewer_log" | sed -nE "${2:-1}s/.*, ([0-9.]+ s) into the flight.*/\1/p"; }
# goes_on_as PATTERN NUMBER: the session of that number goes on where the flight was at that line.
goes_on_as() {
    wait_until "$patience" has "$2" "$viewer_log" "$first" || fail "no frame after '$1'"
    [ -n "$(flown "$1")" ] && [ "$(flown "$1")" = "$(flown "$first" "$2")" ] ||
        fail "'$1' at $(flown "$1"), and it goes on at $(flown "$first" "$2")"
}
stop_service KILL
killed=$EPOCHREALTIME
wait_for "$viewer_log" 'going on without a headset' || fail 'the loss is not reported'
said=$(since "$killed")
goes_on_as 'going on without a headset' 2
say "  the loss is reported within $said s, and the flight goes on within $(since "$killed") s"
start_service restarted XRT_COMPOSITOR_NULL=1
restarted=$EPOCHREALTIME
wait_for "$viewer_log" 'a headset answers: going on there' || fail 'the service that is back is not noticed'
goes_on_as 'a headset answers: going on there' 3
say "  it is back in the headset within $(since "$restarted") s of the service"
drawn=$(count "$viewer_log" '00 frames drawn')
wait_until "$patience" has $((drawn + 1)) "$viewer_log" '00 frames drawn' || fail 'no more frames'
finish_viewer
grep -oE '(opening the runtime|going on|1 of them in this session).*into the flight' "$viewer_log" | sed 's/^/monado:   /'
stop_service
say 'all is well'
