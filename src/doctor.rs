//! Says what Vulkan, OpenXR and the display offer here, and what to install.

use std::ffi::OsString;
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, bail};

use crate::cli::{RuntimeChoice, Verbosity};
use crate::course::Course;
use crate::flight::Flight;
use crate::gpu::{self, DeviceSurvey};
use crate::mock::{Mock, MockConfig};
use crate::quality::samples_offered;
use crate::viewer::{Remarks, Step, Viewer, ViewerConfig};
use crate::world::World;
use crate::xr::{self, RuntimeSurvey};

/// The extensions of OpenXR that are used: name, whether nothing works without it, and what it is for.
const EXTENSIONS: [(&str, bool, &str); 3] = [
    ("XR_KHR_vulkan_enable2", true, "pictures by Vulkan"),
    ("XR_KHR_composition_layer_depth", false, "depth for steadier pictures"),
    ("XR_EXT_local_floor", false, "the floor's height (part of OpenXR 1.1)"),
];

/// Pixels per side of the picture that shows that the built-in runtime works.
const TRIAL_SIZE: [u32; 2] = [64, 64];

/// Frames within which the built-in runtime wants a picture.
const TRIAL_FRAMES: u32 = 100;

/// How a finding is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mark {
    Ok,
    Missing,
    Note,
}

/// Findings in the making, and what they mean for the user.
#[derive(Debug, Default)]
struct Report {
    text: String,
    install: Vec<Package>,
}

/// What to install, in each distribution's words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Package {
    what: &'static str,
    debian: &'static str,
    fedora: &'static str,
    arch: &'static str,
}

const VULKAN_LOADER: Package = Package {
    what: "the Vulkan loader",
    debian: "libvulkan1",
    fedora: "vulkan-loader",
    arch: "vulkan-icd-loader",
};
const VULKAN_DRIVER: Package = Package {
    what: "Vulkan drivers, the software one too",
    debian: "mesa-vulkan-drivers",
    fedora: "mesa-vulkan-drivers",
    arch: "vulkan-swrast (or vulkan-radeon, vulkan-intel, nvidia-utils)",
};
const VALIDATION: Package = Package {
    what: "the validation layer, for --validate",
    debian: "vulkan-validationlayers",
    fedora: "vulkan-validation-layers",
    arch: "vulkan-validation-layers",
};
const OPENXR_LOADER: Package = Package {
    what: "the OpenXR loader, for a headset",
    debian: "libopenxr-loader1",
    fedora: "openxr-libs",
    arch: "openxr",
};
const OPENXR_RUNTIME: Package = Package {
    what: "an OpenXR runtime, for a headset",
    debian: "monado-service (or SteamVR, WiVRn)",
    fedora: "monado (or SteamVR, WiVRn)",
    arch: "monado from the AUR (or SteamVR, WiVRn)",
};

impl Report {
    fn section(&mut self, title: &str) {
        let gap = if self.text.is_empty() { "" } else { "\n" };
        self.text += &format!("{gap}{title}\n");
    }

    fn line(&mut self, mark: Mark, what: &str, finding: impl Display) {
        let mark = match mark {
            Mark::Ok => "ok",
            Mark::Missing => "missing",
            Mark::Note => "-",
        };
        // A finding is one line, whatever a driver put into its name.
        let finding = finding.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
        self.text += &format!("  {mark:<8} {what:<12} {finding}\n");
    }

    /// Names of extensions and layers, indented below a finding.
    fn list(&mut self, names: &[String]) {
        for name in names {
            self.text += &format!("{:24}{name}\n", "");
        }
    }

    fn needs(&mut self, package: Package) {
        if !self.install.contains(&package) {
            self.install.push(package);
        }
    }
}

/// Writes the report to stdout; `-v` lists every layer and extension.
///
/// # Errors
/// Nothing can be drawn on this machine: a sentence that says what to do. Whatever else is missing is no error.
pub fn run(verbosity: Verbosity) -> Result<()> {
    let all = verbosity >= Verbosity::Info;
    let mut report = Report::default();
    let drawing = vulkan(&mut report, all);
    let headset = openxr(&mut report, all);
    let trial = built_in(&mut report, drawing.is_ok(), all);
    display(&mut report, |name| std::env::var_os(name));
    conclude(&mut report, &drawing, headset.as_deref(), trial);
    std::io::stdout().lock().write_all(report.text.as_bytes())?;
    if let Err(error) = drawing {
        bail!("nothing can be drawn on this machine: {error:#}");
    }
    if !trial && headset.is_none() {
        bail!(
            "nothing can be drawn on this machine: the built-in runtime does not work, as said above; update the driver"
        );
    }
    Ok(())
}

/// The device that draws without a headset, or why there is none.
fn vulkan(report: &mut Report, all: bool) -> Result<DeviceSurvey> {
    report.section("Vulkan");
    let survey = match gpu::survey() {
        Ok(survey) => survey,
        Err(error) => {
            report.line(Mark::Missing, "loader", format!("{error:#}"));
            report.needs(VULKAN_LOADER);
            report.needs(VULKAN_DRIVER);
            return Err(error);
        }
    };
    report.line(Mark::Ok, "loader", format!("Vulkan {}", survey.loader));
    if all {
        report.list(&survey.extensions);
    }
    let devices = survey.devices.inspect_err(|error| {
        report.line(Mark::Missing, "device", format!("{error:#}"));
        report.needs(VULKAN_DRIVER);
    });
    let mut chosen = Err(anyhow::anyhow!("no device can do what is needed: update the graphics driver"));
    let mut failed = None;
    match devices {
        Ok(devices) => {
            for device in devices {
                describe(report, &device, all);
                if device.chosen {
                    chosen = Ok(device);
                }
            }
        }
        Err(error) => failed = Some(error),
    }
    match survey.validation {
        true => report.line(Mark::Ok, "validation", "the Khronos validation layer, for --validate"),
        false => {
            report.line(Mark::Missing, "validation", "no validation layer; only --validate needs it");
            report.needs(VALIDATION);
        }
    }
    if all {
        report.list(&survey.layers);
    }
    match failed {
        Some(error) => Err(error),
        None => chosen.inspect_err(|_| report.needs(VULKAN_DRIVER)),
    }
}

fn describe(report: &mut Report, device: &DeviceSurvey, all: bool) {
    let info = &device.info;
    let kind = if info.software { "software: slow" } else { "hardware" };
    let mark = if device.lacks.is_empty() { Mark::Ok } else { Mark::Missing };
    let chosen = if device.chosen { ", in use without a headset" } else { "" };
    report.line(mark, "device", format!("{} ({kind}){chosen}", info.name));
    report.line(
        Mark::Note,
        "  driver",
        format!("{} {}, Vulkan {}", info.driver, info.driver_version, info.api_version),
    );
    match device.lacks.is_empty() {
        true => report.line(Mark::Ok, "  features", "all that is needed"),
        false => report.line(
            Mark::Missing,
            "  features",
            format!("{}: update the driver", device.lacks.join(", ")),
        ),
    }
    let eyes = match (info.multiview, info.multiview_offered) {
        (true, _) => "both in one pass (multiview)",
        (false, true) => "one pass each (multiview is offered, but not trusted on software drivers)",
        (false, false) => "one pass each (no multiview)",
    };
    report.line(Mark::Note, "  eyes", eyes);
    let samples: Vec<String> = samples_offered(info.sample_counts).map(|n| n.to_string()).collect();
    report.line(Mark::Note, "  samples", format!("{} of a pixel", samples.join(", ")));
    if all {
        report.list(&device.extensions);
    }
}

/// The name of the headset that answers.
fn openxr(report: &mut Report, all: bool) -> Option<String> {
    report.section("OpenXR");
    let survey = xr::survey();
    match &survey.loader {
        Ok(()) => report.line(Mark::Ok, "loader", "installed"),
        Err(error) => {
            report.line(Mark::Missing, "loader", error);
            report.needs(OPENXR_LOADER);
        }
    }
    match &survey.manifest {
        Ok(path) => report.line(Mark::Ok, "manifest", path.display()),
        Err(error) => {
            report.line(Mark::Missing, "manifest", error);
            report.needs(OPENXR_RUNTIME);
        }
    }
    let runtime = match survey.runtime {
        Some(Ok(runtime)) => runtime,
        Some(Err(error)) => {
            report.line(Mark::Missing, "runtime", error);
            return None;
        }
        None => {
            report.line(Mark::Note, "headset", "not asked for: there is no runtime to ask");
            return None;
        }
    };
    report.line(Mark::Ok, "runtime", format!("{} {}", runtime.name, runtime.version));
    extensions(report, &runtime, all);
    match runtime.headset {
        Ok(info) => {
            let [width, height] = info.eyes[0].recommended;
            let answer = format!("{}, {width}x{height} per eye, OpenXR {}", info.headset, info.api_version);
            report.line(Mark::Ok, "headset", answer);
            Some(info.headset)
        }
        Err(error) => {
            report.line(Mark::Missing, "headset", error);
            None
        }
    }
}

fn extensions(report: &mut Report, runtime: &RuntimeSurvey, all: bool) {
    for (name, required, purpose) in EXTENSIONS {
        let offered = runtime.extensions.iter().any(|extension| extension == name);
        let mark = match (offered, required) {
            (true, _) => Mark::Ok,
            (false, true) => Mark::Missing,
            (false, false) => Mark::Note,
        };
        let lack = if offered { "" } else { " (not offered)" };
        report.line(mark, "  extension", format!("{name}: {purpose}{lack}"));
    }
    if all {
        report.list(&runtime.extensions);
    }
}

/// True if the built-in runtime draws: it is tried.
fn built_in(report: &mut Report, device: bool, all: bool) -> bool {
    report.section("Built-in runtime");
    let runtime = Mock::new(MockConfig::default());
    match runtime.entry().context("no entry").and_then(|entry| Ok(RuntimeSurvey::of(entry)?)) {
        Ok(runtime) => {
            report.line(Mark::Ok, "runtime", format!("{} {}", runtime.name, runtime.version));
            extensions(report, &runtime, all);
        }
        Err(error) => report.line(Mark::Missing, "runtime", format!("{error:#}")),
    }
    if !device {
        report.line(Mark::Note, "trial", "none: there is no device to draw with");
        return false;
    }
    let start = Instant::now();
    match trial() {
        Ok(remarks) if remarks.violations == 0 => {
            let time = start.elapsed().as_secs_f64();
            report.line(Mark::Ok, "trial", format!("a session was opened and a frame drawn, in {time:.1} s"));
            true
        }
        Ok(remarks) => {
            let first = remarks.first.unwrap_or_default();
            report.line(Mark::Missing, "trial", format!("a frame was drawn against the rules: {first}"));
            true
        }
        Err(error) => {
            report.line(Mark::Missing, "trial", format!("{error:#}"));
            false
        }
    }
}

/// Opens a session on the built-in runtime and draws a frame in it.
fn trial() -> Result<Remarks> {
    let [world, flight] = [World::names().next(), Flight::names().next()];
    let world = World::load(world.context("no world is built in")?)?;
    let pose = Flight::load(flight.context("no flight is built in")?)?.pose(0);
    let mut course = Course::new(world.surface, 0, pose.depth, |_| ());
    let config =
        ViewerConfig { runtime: RuntimeChoice::Mock, eye_size: Some(TRIAL_SIZE), ..ViewerConfig::default() };
    let mut viewer = Viewer::open(&world, &config)?;
    for _ in 0..TRIAL_FRAMES {
        if viewer.frame(&course.at(&pose), false)? == Step::Drew {
            return viewer.close();
        }
    }
    bail!("the built-in runtime wants no pictures")
}

/// Where windows could open; `variable` reads the environment.
fn display(report: &mut Report, variable: impl Fn(&str) -> Option<OsString>) {
    report.section("Display");
    let set = |name: &str| variable(name).filter(|value| !value.is_empty());
    match set("DISPLAY") {
        None => report.line(Mark::Missing, "X11", "DISPLAY is not set"),
        Some(display) => {
            let display = display.to_string_lossy();
            match x11_socket(&display).filter(|socket| !socket.exists()) {
                None => report.line(Mark::Ok, "X11", format!("DISPLAY={display}")),
                Some(socket) => report.line(
                    Mark::Missing,
                    "X11",
                    format!("DISPLAY={display}, but no server listens at {}", socket.display()),
                ),
            }
        }
    }
    match set("WAYLAND_DISPLAY") {
        None => report.line(Mark::Missing, "Wayland", "WAYLAND_DISPLAY is not set"),
        Some(display) => {
            let folder = set("XDG_RUNTIME_DIR").unwrap_or_default();
            let socket = Path::new(&folder).join(&display);
            let display = display.to_string_lossy();
            match socket.exists() {
                true => report.line(Mark::Ok, "Wayland", format!("WAYLAND_DISPLAY={display}")),
                false => report.line(
                    Mark::Missing,
                    "Wayland",
                    format!("WAYLAND_DISPLAY={display}, but no compositor listens at {}", socket.display()),
                ),
            }
        }
    }
}

/// The socket of a local X server, from `:0` or `:0.0`; None for one reached over the network.
fn x11_socket(display: &str) -> Option<PathBuf> {
    let number = display.strip_prefix(':')?.split('.').next()?;
    Some(PathBuf::from(format!("/tmp/.X11-unix/X{number}")))
}

/// What all this means, and what to install.
fn conclude(report: &mut Report, drawing: &Result<DeviceSurvey>, headset: Option<&str>, trial: bool) {
    report.section("So");
    let says = match (headset, drawing) {
        (Some(headset), _) => format!("`fathomless` shows the world on {headset}."),
        (None, Ok(device)) if trial && device.info.software => {
            "`fathomless` draws a short dive to captures/ (no headset answers), slowly: the processor does it.".into()
        }
        (None, Ok(_)) if trial => "`fathomless` draws a short dive to captures/ (no headset answers).".into(),
        (None, Ok(_)) => "`fathomless` cannot draw: the built-in runtime does not work with this device.".into(),
        (None, Err(_)) => "`fathomless` cannot draw anything here yet.".into(),
    };
    report.text += &format!("  {says}\n");
    if headset.is_none() {
        report.text += "  `fathomless capture` and `fathomless verify` need no headset and no display.\n";
    }
    if report.install.is_empty() {
        return;
    }
    report.section("To install (setup.sh does it, but for the runtime of a headset)");
    for package in std::mem::take(&mut report.install) {
        report.text += &format!("  {}\n", package.what);
        for (system, name) in [("Debian", package.debian), ("Fedora", package.fedora), ("Arch", package.arch)]
        {
            report.text += &format!("    {system:<8} {name}\n");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_is_one_line_under_its_mark() {
        let mut report = Report::default();
        report.section("Vulkan");
        report.line(Mark::Missing, "device", "two\nlines");
        assert_eq!(report.text, "Vulkan\n  missing  device       two lines\n");
    }

    #[test]
    fn the_socket_of_a_local_display_is_known() {
        assert_eq!(x11_socket(":1.0"), Some(PathBuf::from("/tmp/.X11-unix/X1")));
        assert_eq!(x11_socket("far:0"), None);
    }

    #[test]
    fn a_display_that_nobody_serves_is_missing() {
        let set = |name: &str| (name == "DISPLAY").then(|| OsString::from(":4711"));
        let mut report = Report::default();
        display(&mut report, set);
        assert!(
            report.text.contains("missing  X11          DISPLAY=:4711, but no server"),
            "{}",
            report.text
        );
        assert!(report.text.contains("missing  Wayland      WAYLAND_DISPLAY is not set"), "{}", report.text);
    }
}
