//! The viewer itself as an application like any other: through the system's OpenXR loader it flies on the shared library,
//! under the validation layers of both APIs, to the wearer's exit.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod foreign_support;

use foreign_support::{CORE_VALIDATION, Stage, check_clean, complaints, number, run, states};

#[test]
fn the_viewer_flies_on_the_library_through_the_loader() {
    // The validation layer of Debian 12 takes LOCAL_FLOOR, which is younger, for nonsense.
    let stage = Stage::new(
        "[headset]\neye_size = [96, 96]\nabsent_extensions = [\"XR_EXT_local_floor\"]\n\n\
         [[cue]]\nframe = 30\nsession = \"exit\"\n",
    );
    let mut command = stage.command(env!("CARGO_BIN_EXE_fathomless"));
    command.args(["view", "--runtime", "system", "--validate"]).env("XR_ENABLE_API_LAYERS", CORE_VALIDATION);
    let status = run(command.current_dir(stage.path("")), &stage);
    let said = stage.said();
    assert!(status.success(), "{said}");
    assert_eq!(complaints(&said), [""; 0]);
    assert!(said.contains("Core Validation output type: text"), "no layer: {said}");

    // The first lives only find out whether there is a headset.
    let lives = stage.lives();
    lives.iter().for_each(check_clean);
    let flight = lives.last().unwrap();
    assert!(number(&flight["frames"]["with_projection"]) >= 25, "{flight}");
    let rise = ["IDLE", "READY", "SYNCHRONIZED", "VISIBLE", "FOCUSED"];
    let fall = ["VISIBLE", "SYNCHRONIZED", "STOPPING", "IDLE", "EXITING"];
    assert_eq!(states(flight), [rise, fall].concat());
}
