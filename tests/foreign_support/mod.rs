//! What tests with other programs need: the shared library, a compiler, a place to run them, and what to look for.
#![allow(dead_code, reason = "each test uses its part")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

/// Longer than any run takes on the slowest machine.
pub const PATIENCE: Duration = Duration::from_secs(120);
/// Checks what applications ask of OpenXR.
pub const CORE_VALIDATION: &str = "XR_APILAYER_LUNARG_core_validation";

/// The mock runtime's shared library as cargo has just built it for this test.
pub fn library() -> PathBuf {
    let program = Path::new(env!("CARGO_BIN_EXE_fathomless"));
    let path = program.with_file_name("deps").join("libfathomless.so");
    assert!(path.is_file(), "{} is not there: Cargo.toml makes a cdylib", path.display());
    path
}

/// Compiles a C program of `tests/foreign/` into a folder.
pub fn compile(source: &str, folder: &Path) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign").join(source);
    let program = folder.join(source.file_stem().unwrap());
    let mut cc = Command::new("cc");
    cc.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wno-missing-field-initializers", "-g", "-O1"]);
    let output =
        cc.arg(&source).arg("-o").arg(&program).args(["-ldl", "-lvulkan", "-lopenxr_loader"]).output();
    let output = output.expect("no C compiler: run `sh setup.sh`, which installs one");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "{said}\nIf a header or a library is missing: `sh setup.sh` installs it."
    );
    program
}

/// A folder with the manifest, a script, a log, and what a program says.
pub struct Stage {
    folder: TempDir,
}

impl Stage {
    pub fn new(script: &str) -> Self {
        let stage = Self { folder: tempfile::tempdir().unwrap() };
        fs::write(stage.path("script.toml"), script).unwrap();
        let manifest = stage.path("mock.json");
        let program = env!("CARGO_BIN_EXE_fathomless");
        let output = Command::new(program).args(["runtime", "-q", "--out"]).arg(&manifest).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        let manifest: Value = serde_json::from_slice(&fs::read(&manifest).unwrap()).unwrap();
        let named = manifest["runtime"]["library_path"].as_str().unwrap();
        assert_eq!(fs::read(named).unwrap(), fs::read(library()).unwrap(), "{named} is old");
        stage
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn command(&self, program: impl AsRef<Path>) -> Command {
        let mut command = Command::new(program.as_ref());
        let said = File::create(self.path("said")).unwrap();
        command
            .env("XR_RUNTIME_JSON", self.path("mock.json"))
            .env("FATHOMLESS_MOCK_SCRIPT", self.path("script.toml"))
            .env("FATHOMLESS_MOCK_LOG", self.path("log"))
            .env_remove("DISPLAY")
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("XR_ENABLE_API_LAYERS")
            .env_remove("XR_API_LAYER_PATH")
            .env_remove("VK_INSTANCE_LAYERS")
            .env_remove("VK_LAYER_ENABLES")
            .stdin(Stdio::piped())
            .stdout(said.try_clone().unwrap())
            .stderr(said);
        command
    }

    pub fn said(&self) -> String {
        String::from_utf8_lossy(&fs::read(self.path("said")).unwrap()).into_owned()
    }

    /// The lives of the runtime so far.
    pub fn lives(&self) -> Vec<Value> {
        let log = fs::read_to_string(self.path("log")).unwrap_or_default();
        // The last line may be in the making.
        let whole = log.rsplit_once('\n').map_or("", |(whole, _)| whole);
        whole.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }
}

/// With the Vulkan validation layer, synchronization included.
pub fn validated(command: &mut Command) -> &mut Command {
    command
        .env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")
        .env("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT")
}

pub fn start(command: &mut Command) -> Child {
    match command.spawn() {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            panic!("{command:?} is missing: run `sh setup.sh`, which installs it")
        }
        child => child.unwrap(),
    }
}

/// Waits for the end; stdin stays open, since hello_xr takes its end for a key pressed.
pub fn finish(child: &mut Child, stage: &Stage) -> ExitStatus {
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

pub fn run(command: &mut Command, stage: &Stage) -> ExitStatus {
    let mut child = start(command);
    finish(&mut child, stage)
}

/// Lines in which a validation layer or hello_xr complains.
pub fn complaints(said: &str) -> Vec<&str> {
    let marks =
        ["[Validation]", "VUID-", "VALID_ERROR", "VALID_WARNING", "][Error", "fathomless mock runtime:"];
    said.lines().filter(|line| marks.iter().any(|mark| line.contains(mark))).collect()
}

pub fn number(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is no number"))
}

pub fn states(life: &Value) -> Vec<&str> {
    life["states"].as_array().unwrap().iter().map(|state| state.as_str().unwrap()).collect()
}

/// No rule broken, nothing leaked, no call failed.
pub fn check_clean(life: &Value) {
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
