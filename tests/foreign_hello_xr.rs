//! Khronos' hello_xr, which knows nothing of us, runs on the mock through the OpenXR loader: hundreds of frames, with the
//! runtime's Vulkan and with its own, to a scripted exit and through scripted losses, under the validation layers of
//! both, without a word from any of them.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod foreign_support;

use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

/// Longer than any run takes on the slowest machine.
const PATIENCE: Duration = Duration::from_secs(120);
/// Exits after some 220 frames at 90 Hz.
const EXIT: &str = "[headset]\neye_size = [256, 256]\n\n[[cue]]\nframe = 220\nsession = \"exit\"\n";
const CORE_VALIDATION: &str = "XR_APILAYER_LUNARG_core_validation";

/// A folder with the manifest, a script, a log, and what a program says.
struct Stage {
    folder: TempDir,
}

impl Stage {
    fn new(script: &str) -> Self {
        let stage = Self { folder: tempfile::tempdir().unwrap() };
        fs::write(stage.path("script.toml"), script).unwrap();
        let manifest = stage.path("mock.json");
        let program = env!("CARGO_BIN_EXE_fathomless");
        let output = Command::new(program).args(["runtime", "-q", "--out"]).arg(&manifest).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        let manifest: Value = serde_json::from_slice(&fs::read(&manifest).unwrap()).unwrap();
        let library = manifest["runtime"]["library_path"].as_str().unwrap();
        assert_eq!(
            fs::read(library).unwrap(),
            fs::read(foreign_support::library()).unwrap(),
            "{library} is old"
        );
        stage
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, program: impl AsRef<Path>) -> Command {
        let mut command = Command::new(program.as_ref());
        let said = File::create(self.path("said")).unwrap();
        command
            .env("XR_RUNTIME_JSON", self.path("mock.json"))
            .env("FATHOMLESS_MOCK_SCRIPT", self.path("script.toml"))
            .env("FATHOMLESS_MOCK_LOG", self.path("log"))
            .env_remove("XR_ENABLE_API_LAYERS")
            .env_remove("XR_API_LAYER_PATH")
            .env_remove("VK_INSTANCE_LAYERS")
            .env_remove("VK_LAYER_ENABLES")
            .stdin(Stdio::piped())
            .stdout(said.try_clone().unwrap())
            .stderr(said);
        command
    }

    fn hello_xr(&self, graphics: &str) -> Command {
        let mut command = self.command("hello_xr");
        command.args(["-g", graphics]);
        command
    }

    fn said(&self) -> String {
        String::from_utf8_lossy(&fs::read(self.path("said")).unwrap()).into_owned()
    }

    /// The lives of the runtime so far.
    fn lives(&self) -> Vec<Value> {
        let log = fs::read_to_string(self.path("log")).unwrap_or_default();
        // The last line may be in the making.
        let whole = log.rsplit_once('\n').map_or("", |(whole, _)| whole);
        whole.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }
}

/// With the Vulkan validation layer, synchronization included.
fn validated(command: &mut Command) -> &mut Command {
    command
        .env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")
        .env("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT")
}

fn start(command: &mut Command) -> Child {
    match command.spawn() {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            panic!("{command:?} is missing: run `sh setup.sh`, which installs it")
        }
        child => child.unwrap(),
    }
}

/// Waits for the end; stdin stays open, since hello_xr takes its end for a key pressed.
fn finish(child: &mut Child, stage: &Stage) -> ExitStatus {
    let deadline = Instant::now() + PATIENCE;
    while Instant::now() < deadline {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    panic!("no end after {PATIENCE:?}: {}", stage.said());
}

fn run(command: &mut Command, stage: &Stage) -> ExitStatus {
    let mut child = start(command);
    finish(&mut child, stage)
}

/// Lines in which a validation layer or hello_xr complains.
fn complaints(said: &str) -> Vec<&str> {
    let marks =
        ["[Validation]", "VUID-", "VALID_ERROR", "VALID_WARNING", "][Error", "fathomless mock runtime:"];
    said.lines().filter(|line| marks.iter().any(|mark| line.contains(mark))).collect()
}

fn number(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn states(life: &Value) -> Vec<&str> {
    life["states"].as_array().unwrap().iter().map(|state| state.as_str().unwrap()).collect()
}

/// No rule broken, nothing leaked, no call failed.
fn check_clean(life: &Value) {
    assert_eq!(life["violations"], Value::Array(Vec::new()));
    assert_eq!(life["leaks"], Value::Array(Vec::new()));
    assert_eq!(life["instances_destroyed"], Value::Bool(true));
    for (function, codes) in life["calls"].as_object().unwrap() {
        for (code, count) in codes.as_object().unwrap() {
            // The loader asks for every function that it has heard of.
            let asked = function == "xrGetInstanceProcAddr" && code == "XR_ERROR_FUNCTION_UNSUPPORTED";
            assert!(asked || !code.starts_with("XR_ERROR"), "{function}: {count} times {code}");
        }
    }
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
    let life = fly(&stage, validated(&mut stage.hello_xr("Vulkan2")));
    assert_eq!(number(&life["calls"]["xrCreateVulkanDeviceKHR"]["XR_SUCCESS"]), 1);
    assert!(stage.said().contains("Inserted device layer \"VK_LAYER_KHRONOS_validation\""), "no layer");
}

#[test]
fn it_draws_with_vulkan_of_its_own() {
    let stage = Stage::new(EXIT);
    let life = fly(&stage, validated(&mut stage.hello_xr("Vulkan")));
    assert_eq!(number(&life["calls"]["xrGetVulkanGraphicsDeviceKHR"]["XR_SUCCESS"]), 1);
    assert!(life["calls"]["xrCreateVulkanDeviceKHR"].is_null());
    assert!(stage.said().contains("Inserted device layer \"VK_LAYER_KHRONOS_validation\""), "no layer");
}

#[test]
fn openxr_core_validation_has_nothing_to_say() {
    for graphics in ["Vulkan2", "Vulkan"] {
        let stage = Stage::new(EXIT);
        fly(&stage, stage.hello_xr(graphics).env("XR_ENABLE_API_LAYERS", CORE_VALIDATION));
        assert!(stage.said().contains("Core Validation output type: text"), "no layer: {}", stage.said());
    }
}

/// Loses whatever the cue says, in each life of the runtime, and ends with a key after three.
fn lose_again_and_again(cue: &str, end: Option<&str>) {
    let stage = Stage::new(&format!("[headset]\neye_size = [256, 256]\n\n[[cue]]\nframe = 40\n{cue}\n"));
    let mut command = stage.hello_xr("Vulkan2");
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
    command.args(["-e", "-c", script]).current_dir(stage.folder.path());
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
    let mut command = stage.hello_xr("Vulkan2");
    validated(&mut command).env("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_BEST_PRACTICES_EXT");
    assert!(run(&mut command, &stage).success());
    assert!(complaints(&stage.said()).iter().any(|line| line.contains("BestPractices")), "{}", stage.said());

    let stage = Stage::new("");
    let program = foreign_support::compile("one_mistake.c", stage.folder.path());
    let status = run(stage.command(program).env("XR_ENABLE_API_LAYERS", CORE_VALIDATION), &stage);
    let said = stage.said();
    assert!(status.success(), "is {CORE_VALIDATION} there? `sh setup.sh` installs it: {said}");
    assert!(complaints(&said).iter().any(|line| line.contains("XrSystemGetInfo-type")), "{said}");

    // Without the layer it is the runtime that sees the mistake.
    let stage = Stage::new("");
    let program = foreign_support::compile("one_mistake.c", stage.folder.path());
    assert!(run(&mut stage.command(program), &stage).success());
    assert!(stage.said().contains("xrGetSystem -1"));
    let violation = &stage.lives()[0]["violations"][0];
    assert_eq!((&violation["function"], &violation["call"]), (&"xrGetSystem".into(), &1.into()));
    assert_eq!(violation["code"], "XR_ERROR_VALIDATION_FAILURE");
}

#[test]
fn a_script_that_makes_no_sense_is_told_and_no_runtime_answers() {
    let stage = Stage::new("[headset]\neye_sice = [1, 1]\n");
    let program = foreign_support::compile("one_mistake.c", stage.folder.path());
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
    let program = foreign_support::compile("one_mistake.c", stage.folder.path());
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
    let program = foreign_support::compile("one_mistake.c", stage.folder.path());
    assert!(run(stage.command(program).env("LEAVE", "1"), &stage).success());
    let lives = stage.lives();
    assert_eq!(lives.len(), 1);
    assert_eq!(lives[0]["instances_destroyed"], Value::Bool(false));
}
