//! Examples, and the names that help lists.

use crate::flight::Flight;
use crate::inspect;
use crate::settings::Settings;
use crate::world::World;

pub(super) const EXAMPLES: &str = "\
Examples:
  fathomless                                    see the default world
  fathomless view --world hills --depth 1000    another world, a thousand octaves down
  fathomless capture --out dive                 draw the default dive, a picture per eye and frame
  fathomless bench --html bench.html            what does a dive cost, at every depth?
  fathomless view --at dive/frame_000090_left.png    back to where a picture was drawn
  fathomless bookmarks                          the places you have marked
  fathomless export --cells 256 --out here.csv  heights as exact numbers, for other programs
  fathomless verify --tiles 2000                do the GPU and the CPU agree on every height?
  fathomless runtime --out mock.json            the mock runtime, for your own OpenXR application
  fathomless settings                           what can be set, as it is: speed, keys, quality, ...
  fathomless shaders --out mine                 the shaders, to change them while the window is open
  fathomless doctor                             what is missing on this machine?

Exit codes: 0 fine, 1 failed, 2 the command line makes no sense.
RUST_LOG, where set, decides what is logged instead of -v and -q.";

const VIEW_EXAMPLES: &str = "\
Examples:
  fathomless view                               the default world, on the headset if there is one, and in a window
  fathomless view --world tunkovic --seed 7     another world with a seed of your own
  fathomless view --at dive/frame_000090_left.png    where a picture was drawn
  fathomless view --at @mesa --flight dive      falling on from a bookmark
  fathomless view --runtime mock                on the built-in runtime, headset or not
  fathomless view --wait-for-headset --refresh-rate 90
  fathomless view --set motion.speed=2 --set keys.dive=Enter

Without a headset and a display it draws a three-second dive to captures/ and says where.

In the window (keys, and buttons of a gamepad; `fathomless settings` says how to change them):
";

/// The same, with the keys as they are.
pub(super) fn view_examples(settings: &Settings) -> String {
    let mouse = "\
The wheel sets the speed; the mouse looks around once it is taken; a double-click dives to the
point under the cursor until a key is pressed or the dive has arrived. On a gamepad the sticks fly
and turn.";
    format!("{VIEW_EXAMPLES}{}\n{mouse}", settings.bindings_text())
}

const CAPTURE_EXAMPLES: &str = "\
Examples:
  fathomless capture                            the default dive, to captures/
  fathomless capture --frames 0..2 --size 512x512 --validate
  fathomless capture --flight over --world hills --eyes left --out over
  fathomless capture --flight my-flight.toml --depth 100000 --frames 120..180
  fathomless capture --frames 0..1 --show wireframe,levels
  fathomless capture --flight dive-and-return --octaves 200 --shard 3/8

Frames do not depend on each other: several runs, on several machines, may each draw a part. --shard I/N splits the
frames into N parts (neighbours stay together) and draws the one numbered I, from 0 to N-1; the parts are disjoint,
together they are the whole, and their pictures are the same.
Every picture carries the address of its place, for --at. With --at and no --flight the one frame of that place is
drawn again; with --flight, the flight begins there: its depth 0 is the place's depth, its target the ground below.";

/// The examples of `capture`, and what its `--show` takes.
pub(super) fn capture_help() -> String {
    let mut text = format!("{CAPTURE_EXAMPLES}\n\nWhat --show takes, one or several with commas between:\n");
    for (word, about) in inspect::explained() {
        let mut line = format!("  {word:16}");
        for part in about.split(' ') {
            if line.len() + part.len() > 99 {
                text.push_str(&line);
                line = format!("\n{:18}", "");
            }
            line.push(' ');
            line.push_str(part);
        }
        text.push_str(&line);
        text.push('\n');
    }
    text
}

pub(super) const BENCH_EXAMPLES: &str = "\
Examples:
  fathomless bench                              a dive and the way back, on the built-in runtime
  fathomless bench --flight dive --octaves 200 --json dive.json --html dive.html
  fathomless bench --flight still --depths 10,1000,100000
  fathomless bench --flight skim --frames 0..600 --size 1024x1024 --validate

Frames are flown one after the other as fast as they are done, and counted by decades of depth (0-9, 10-99, ...), or
by the depths asked for. CPU times are this program's own; where it waits, none passes.";

pub(super) const EXPORT_EXAMPLES: &str = "\
Examples:
  fathomless export --out start.csv             257 x 257 heights around the world's start
  fathomless export --at dive/frame_000090_left.png --format png16 --out there.png
  fathomless export --at @mesa --cells 512 --format obj --out mesa.obj
  fathomless export --cells 2 --world hills     a few to stdout, with the address of the place

csv: whole numbers, in 1/65536 of the spacing. png16: 16-bit grey, 0 the lowest point and 65535 the highest; what that
means in spacings is in its text chunk. obj: a mesh in spacings. Heights count from the point 0,0 under the place.";

pub(super) const BOOKMARKS_EXAMPLES: &str = "\
Examples:
  fathomless bookmarks                          all of them, with their addresses
  fathomless bookmarks add mesa --at dive/frame_000090_left.png
  fathomless bookmarks remove mesa
  fathomless view --at @mesa                    go there

They are in bookmarks.toml in your data folder; FATHOMLESS_DATA_DIR, where set, names another.";

pub(super) const VERIFY_EXAMPLES: &str = "\
Examples:
  fathomless verify                             a quick look
  fathomless verify --tiles 2000 --depth 100000
  fathomless verify --world my-world.toml --validate";

pub(super) const DOCTOR_EXAMPLES: &str = "\
Examples:
  fathomless doctor                             Vulkan, OpenXR and the display, and what to install
  fathomless doctor -v                          with every device and extension";

pub(super) const RUNTIME_EXAMPLES: &str = "\
Examples:
  fathomless runtime --out mock.json            write the manifest
  fathomless runtime                            print it

Then, for any OpenXR application that draws with Vulkan:
  XR_RUNTIME_JSON=$PWD/mock.json your-application

The mock runtime is a headset made of nothing: real time, real images, no window, and every rule
of the specification checked. Inside the application it reads two more variables:
  FATHOMLESS_MOCK_LOG=FILE     a line of JSON for each life of the runtime goes there: calls with
                               results, rules broken, handles leaked, states, frames, vibrations
  FATHOMLESS_MOCK_SCRIPT=FILE  a TOML script: what the headset is like, and what happens to it";

pub(super) const SHADERS_EXAMPLES: &str = "\
Examples:
  fathomless shaders                            each shader's file and a line about it
  fathomless shaders --out mine                 all of them, to begin from
  fathomless view --shaders mine                see yours; what you save is taken up within a second
  fathomless capture --shaders mine --frames 0..1

They are WGSL. What is wrong is said with file, line and column, and the old ones stay in use. Where tile.wgsl makes
other heights than the processor knows of, tiles are chosen and placed as if it did not.";

pub(super) const SETTINGS_EXAMPLES: &str = "\
Examples:
  fathomless settings                           all of them as they are, and where each comes from
  fathomless settings --manual                  every setting with what it does and its built-in value
  fathomless settings --set motion.speed=2      as they would be

Later ones win: the built-in ones, fathomless.toml in your settings folder, --config FILE, --set SECTION.KEY=VALUE, the
environment (FATHOMLESS_MOTION_SPEED=2 is motion.speed), and view's own options. They are for `view`. What is printed
is such a file itself. While the window is open, changes of the files are taken up as they are saved.";

pub(super) const WORLDS_EXAMPLES: &str = "\
Examples:
  fathomless worlds                             each world's name and a line about it
  fathomless view --world hills                 see one of them
  fathomless view --world ./my-world.toml       or your own; the shipped files in config/worlds/ show how";

pub(super) fn default_world() -> &'static str {
    World::names().next().unwrap_or_default()
}

pub(super) fn default_flight() -> &'static str {
    Flight::names().next().unwrap_or_default()
}

pub(super) fn world_help() -> String {
    let names = World::names().collect::<Vec<_>>().join(", ");
    format!("The world: {names}, or a TOML file [default: {}, or the world of --at]", default_world())
}

pub(super) fn flight_help() -> String {
    let names = Flight::names().collect::<Vec<_>>().join(", ");
    format!("The flight: {names}, or a TOML file [default: {}]", default_flight())
}
