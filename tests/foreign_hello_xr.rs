//! Khronos' hello_xr, which knows nothing of us, runs on the mock through the OpenXR loader: hundreds of frames, with the
//! runtime's Vulkan and with its own, to a scripted exit and through scripted losses, under the validation layers of
//! both, without a word from any of them.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod foreign_support;

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use foreign_support::{
    CORE_VALIDATION, PATIENCE, Stage, check_clean, complaints, finish, number, run, start, states, validated,
};
use serde_json::Value;

/// Exits after some 220 frames at 90 Hz.
const EXIT: &str = "[headset]\neye_size = [256, 256]\n\n[[cue]]\nframe = 220\nsession = \"exit\"\n";

fn hello_xr(stage: &Stage, graphics: &str) -> Command {
    let mut command = stage.command("hello_xr");
    command.args(["-g", graphics]);
    command
}

/// Runs hello_xr to the scripted exit; what the runtime says of it.
fn fly(stage: &Stage, command: &mut Command) -> Value {
    let status = run(command, stage);
    let said = stage.said();
    assert!(status.success(), "{status:?}: {said}");
    assert_eq!(complaints(&said), [""; 0]);
    let lives = stage.lives();
    let [life] = lives.as_slice() else { panic!("{} lives: {said}", lives.len()) };
    check_clean(life);
    let frames = &life["frames"];
    assert!(number(&frames["submitted"]) >= 200, "{frames}");
    assert!(number(&frames["with_projection"]) >= 200, "{frames}");
    let rise = ["IDLE", "READY", "SYNCHRONIZED", "VISIBLE", "FOCUSED"];
    let fall = ["VISIBLE", "SYNCHRONIZED", "STOPPING", "IDLE", "EXITING"];
    assert_eq!(states(life), [rise, fall].concat());
    assert!(number(&life["calls"]["xrSyncActions"]["XR_SUCCESS"]) > 200);
    life.clone()
}

#[test]
fn it_draws_with_vulkan_made_by_the_runtime() {
    let stage = Stage::new(EXIT);
    let life = fly(&stage, validated(&mut hello_xr(&stage, "Vulkan2")));
    assert_eq!(number(&life["calls"]["xrCreateVulkanDeviceKHR"]["XR_SUCCESS"]), 1);
    assert!(stage.said().contains("Inserted device layer \"VK_LAYER_KHRONOS_validation\""), "no layer");
}

#[test]
fn it_draws_with_vulkan_of_its_own() {
    let stage = Stage::new(EXIT);
    let life = fly(&stage, validated(&mut hello_xr(&stage, "Vulkan")));
    assert_eq!(number(&life["calls"]["xrGetVulkanGraphicsDeviceKHR"]["XR_SUCCESS"]), 1);
    assert!(life["calls"]["xrCreateVulkanDeviceKHR"].is_null());
    assert!(stage.said().contains("Inserted device layer \"VK_LAYER_KHRONOS_validation\""), "no layer");
}

#[test]
fn openxr_core_validation_has_nothing_to_say() {
    for graphics in ["Vulkan2", "Vulkan"] {
        let stage = Stage::new(EXIT);
        fly(&stage, hello_xr(&stage, graphics).env("XR_ENABLE_API_LAYERS", CORE_VALIDATION));
        assert!(stage.said().contains("Core Validation output type: text"), "no layer: {}", stage.said());
    }
}

/// Loses whatever the cue says, in each life of the runtime, and ends with a key after three.
fn lose_again_and_again(cue: &str, end: Option<&str>) {
    let stage = Stage::new(&format!("[headset]\neye_size = [256, 256]\n\n[[cue]]\nframe = 40\n{cue}\n"));
    let mut command = hello_xr(&stage, "Vulkan2");
    let mut child = start(validated(&mut command));
    let deadline = Instant::now() + PATIENCE;
    while stage.lives().len() < 3 {
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself: {}", stage.said());
        assert!(Instant::now() < deadline, "it does not start again: {}", stage.said());
        std::thread::sleep(Duration::from_millis(20));
    }
    child.stdin.take().unwrap().write_all(b"\n").unwrap();
    let status = finish(&mut child, &stage);
    assert!(status.success(), "{status:?}: {}", stage.said());
    assert_eq!(complaints(&stage.said()), [""; 0]);
    let lives = stage.lives();
    for (i, life) in lives.iter().enumerate() {
        check_clean(life);
        // A later one may have been ended by the key.
        if i < 3 {
            assert_eq!(states(life).last().copied(), end, "{life}");
            let drawn = number(&life["frames"]["with_projection"]);
            assert!((30..=60).contains(&drawn), "{life}");
        }
    }
}

#[test]
fn it_makes_everything_anew_when_sessions_are_lost() {
    lose_again_and_again("session = \"loss_pending\"", Some("LOSS_PENDING"));
}

#[test]
fn it_makes_everything_anew_when_the_instance_will_be_lost() {
    lose_again_and_again("instance_loss_s = 30.0", Some("FOCUSED"));
}

/// The README's section for other applications, line by line; only the build is this test's own.
#[test]
fn the_readme_works_as_written() {
    let readme = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).unwrap();
    let section = readme.split("## Use the mock runtime").nth(1).unwrap();
    let block = section.split("```sh\n").nth(1).unwrap().split("```").next().unwrap();
    let script = block.strip_prefix("cargo build --release\n").unwrap();

    let stage = Stage::new("");
    let built = Path::new(env!("CARGO_BIN_EXE_fathomless")).parent().unwrap();
    fs::create_dir(stage.path("target")).unwrap();
    std::os::unix::fs::symlink(built, stage.path("target/release")).unwrap();
    let mut command = stage.command("sh");
    command.args(["-e", "-c", script]).current_dir(stage.path(""));
    for variable in ["XR_RUNTIME_JSON", "FATHOMLESS_MOCK_SCRIPT", "FATHOMLESS_MOCK_LOG"] {
        command.env_remove(variable);
    }
    let status = run(&mut command, &stage);
    let said = stage.said();
    assert!(status.success(), "{said}");
    assert_eq!(complaints(&said), [""; 0]);
    let life: Value = serde_json::from_str(said.lines().last().unwrap()).unwrap();
    check_clean(&life);
    assert!(number(&life["frames"]["submitted"]) >= 300, "{life}");
    for key in ["calls", "violations", "leaks", "states", "frames", "haptics", "instances_destroyed"] {
        assert!(life.get(key).is_some() && section.contains(&format!("| `{key}` |")), "{key}");
    }
}

/// What the tests above listen for is what is said when there is something to say.
#[test]
fn the_layers_would_speak() {
    let stage = Stage::new(&EXIT.replace("220", "20"));
    let mut command = hello_xr(&stage, "Vulkan2");
    validated(&mut command).env("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_BEST_PRACTICES_EXT");
    assert!(run(&mut command, &stage).success());
    assert!(complaints(&stage.said()).iter().any(|line| line.contains("BestPractices")), "{}", stage.said());

    let stage = Stage::new("");
    let program = foreign_support::compile("one_mistake.c", &stage.path(""));
    let status = run(stage.command(program).env("XR_ENABLE_API_LAYERS", CORE_VALIDATION), &stage);
    let said = stage.said();
    assert!(status.success(), "is {CORE_VALIDATION} there? `sh setup.sh` installs it: {said}");
    assert!(complaints(&said).iter().any(|line| line.contains("XrSystemGetInfo-type")), "{said}");

    // Without the layer it is the runtime that sees the mistake.
    let stage = Stage::new("");
    let program = foreign_support::compile("one_mistake.c", &stage.path(""));
    assert!(run(&mut stage.command(program), &stage).success());
    assert!(stage.said().contains("xrGetSystem -1"));
    let violation = &stage.lives()[0]["violations"][0];
    assert_eq!((&violation["function"], &violation["call"]), (&"xrGetSystem".into(), &1.into()));
    assert_eq!(violation["code"], "XR_ERROR_VALIDATION_FAILURE");
}

#[test]
fn a_script_that_makes_no_sense_is_told_and_no_runtime_answers() {
    let stage = Stage::new("[headset]\neye_sice = [1, 1]\n");
    let program = foreign_support::compile("one_mistake.c", &stage.path(""));
    assert!(!run(&mut stage.command(program), &stage).success());
    let said = stage.said();
    assert!(said.contains("fathomless mock runtime: FATHOMLESS_MOCK_SCRIPT: "), "{said}");
    assert!(said.contains("script.toml:2: ") && said.contains("eye_sice"), "{said}");
    assert!(stage.lives().is_empty());
}

/// The loader may unload the runtime when no instance comes of it; the script goes on counting.
#[test]
fn a_script_counts_calls_that_make_no_instance() {
    let stage = Stage::new(
        "[[fault]]\ncall = \"xrCreateInstance\"\nnth = 1\nreturns = \"XR_ERROR_RUNTIME_UNAVAILABLE\"\n",
    );
    let program = foreign_support::compile("one_mistake.c", &stage.path(""));
    assert!(run(&mut stage.command(program), &stage).success(), "{}", stage.said());
    assert!(stage.said().contains("xrCreateInstance again 0"), "{}", stage.said());
    let lives = stage.lives();
    assert_eq!(lives.len(), 1);
    let calls = &lives[0]["calls"]["xrCreateInstance"];
    assert_eq!((number(&calls["XR_ERROR_RUNTIME_UNAVAILABLE"]), number(&calls["XR_SUCCESS"])), (1, 1));
}

/// An instance that nobody destroys is in the log all the same, when the process ends.
#[test]
fn a_process_that_just_ends_leaves_its_log() {
    let stage = Stage::new(EXIT);
    let program = foreign_support::compile("one_mistake.c", &stage.path(""));
    assert!(run(stage.command(program).env("LEAVE", "1"), &stage).success());
    let lives = stage.lives();
    assert_eq!(lives.len(), 1);
    assert_eq!(lives[0]["instances_destroyed"], Value::Bool(false));
}
