//! The headset moves to another GPU in mid-flight. Two physical devices are had on any machine: a process of its own is
//! told of its first Vulkan driver twice.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests stop at the first surprise")]
#![allow(unsafe_code, reason = "asks Vulkan for its devices")]

mod life;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use fathomless::mock::{Act, Cue, Mock, MockConfig, Script, SubmittedFrame, When};
use fathomless::supervisor::Absent;
use fathomless::viewer::{Viewer, ViewerConfig};
use life::{Flown, assert_clean, fly, headset, least, patience};
use openxr::sys;

/// Set where the driver is there twice.
const TWICE: &str = "FATHOMLESS_TEST_TWO_DEVICES";

/// The manifest of the software driver, as the loader would find it.
fn manifest() -> Option<PathBuf> {
    let named = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].into_iter().find_map(std::env::var_os);
    let folders = ["/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/usr/share/vulkan/icd.d"];
    let listed = folders.into_iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    let found: Vec<PathBuf> = match &named {
        Some(named) => std::env::split_paths(named).collect(),
        None => listed.map(|entry| entry.path()).collect(),
    };
    let is_software = |path: &PathBuf| path.to_string_lossy().contains("lvp_icd");
    found.into_iter().find(is_software)
}

/// A manifest that may lie anywhere: its library is no longer named relative to it.
fn moved(manifest: &Path) -> String {
    let mut json: serde_json::Value = serde_json::from_slice(&fs::read(manifest).unwrap()).unwrap();
    let library = &mut json["ICD"]["library_path"];
    let named = library.as_str().unwrap().to_owned();
    if named.contains('/') {
        *library = manifest.parent().unwrap().join(named).to_str().unwrap().into();
    }
    json.to_string()
}

/// True in the process that has two devices. Where it is not there yet, it runs the same test, and what it finds counts.
fn has_two_devices(test: &str) -> bool {
    if std::env::var_os(TWICE).is_some() {
        return true;
    }
    let Some(manifest) = manifest() else {
        println!("not tested: Mesa's software driver is not installed");
        return false;
    };
    let folder = tempfile::tempdir().unwrap();
    let copies = [1, 2].map(|i| folder.path().join(format!("{i}.json")));
    for copy in &copies {
        fs::write(copy, moved(&manifest)).unwrap();
    }
    let both = std::env::join_paths(&copies).unwrap();
    let output = Command::new(std::env::current_exe().unwrap())
        .args([test, "--exact", "--nocapture", "--test-threads", "1"])
        .env("VK_DRIVER_FILES", &both)
        .env("VK_ICD_FILENAMES", &both)
        .env(TWICE, "1")
        .output()
        .unwrap();
    let said =
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    assert!(output.status.success() && said.contains("1 passed"), "{said}");
    false
}

/// Where the viewer's device is among those that its Vulkan offers.
fn device_of(viewer: &Viewer) -> usize {
    let gpu = viewer.gpu();
    // SAFETY: the instance lives.
    let devices = unsafe { gpu.instance.enumerate_physical_devices() }.unwrap();
    assert_eq!(devices.len(), 2, "the driver is there twice");
    devices.iter().position(|it| *it == gpu.physical).unwrap()
}

/// Flies four frames, does something, flies as many again: the last pictures of both, and the devices that drew.
fn flight(mock: &Mock, mut acts: impl FnMut(&Mock)) -> (Flown, [SubmittedFrame; 2], BTreeSet<usize>) {
    let (mut before, mut devices) = (None, BTreeSet::new());
    let newest = |mock: &Mock| mock.take_frames().into_iter().rfind(|frame| !frame.views.is_empty());
    let config = ViewerConfig { validate: true, complete: true, ..least() };
    let flown = fly(mock, config, patience(Absent::Wait), |hand| {
        devices.insert(device_of(hand.viewer));
        if hand.drawn >= 4 && before.is_none() {
            before = newest(hand.mock);
            acts(hand.mock);
        }
        if hand.drawn >= 8 {
            hand.stop();
        }
    });
    assert_eq!(flown.remarks.validation, 0, "{:?}", flown.remarks.first);
    assert_clean(mock, "another device");
    let after = newest(mock);
    (flown, [before.unwrap(), after.unwrap()], devices)
}

fn read_back() -> MockConfig {
    MockConfig { read_back: true, keep_frames: 64, ..headset() }
}

fn assert_same([before, after]: [SubmittedFrame; 2]) {
    for (a, b) in before.views.iter().zip(&after.views) {
        assert!(!a.rgba.is_empty() && a.rgba == b.rgba, "the pictures differ");
    }
}

/// Sessions that the runtime did not take on their device.
fn refused(mock: &Mock) -> usize {
    let calls = mock.log();
    calls.iter().filter(|call| call.code == sys::Result::ERROR_GRAPHICS_DEVICE_INVALID).count()
}

#[test]
fn a_headset_on_another_gpu_is_drawn_for_there() {
    if !has_two_devices("a_headset_on_another_gpu_is_drawn_for_there") {
        return;
    }
    type Loss = (fn(&Mock), (u32, u32));
    let losses: [Loss; 3] = [
        (Mock::lose_session, (1, 1)),
        (Mock::kill_session, (1, 1)),
        (|mock| mock.lose_instance(Duration::ZERO), (2, 0)),
    ];
    for (lose, opened_and_renewed) in losses {
        let mock = Mock::new(read_back());
        let (flown, pictures, devices) = flight(&mock, |mock| {
            mock.perform(Act::GraphicsDevice(1));
            lose(mock);
        });
        flown.result.unwrap();
        assert_eq!((flown.chronicle.opened, flown.chronicle.renewed), opened_and_renewed);
        assert_eq!(devices, BTreeSet::from([0, 1]));
        assert_eq!(refused(&mock), 0, "the runtime was asked which device it is");
        assert_same(pictures);
    }
}

/// The runtime answers with the old device once more, and then takes no session on it.
#[test]
fn a_gpu_that_is_another_just_when_the_session_is_made_is_asked_for_again() {
    if !has_two_devices("a_gpu_that_is_another_just_when_the_session_is_made_is_asked_for_again") {
        return;
    }
    let function = "xrGetVulkanGraphicsDevice2KHR";
    let calm = Mock::new(read_back());
    let mut asked = 0;
    flight(&calm, |mock| asked = mock.calls(function));
    let cue = Cue { when: When::Call { function, nth: asked + 1 }, acts: vec![Act::GraphicsDevice(1)] };
    let mock = Mock::with_script(Script { config: read_back(), cues: vec![cue], ..Script::default() });
    let (flown, pictures, devices) = flight(&mock, Mock::lose_session);
    flown.result.unwrap();
    assert_eq!(refused(&mock), 1);
    assert_eq!((flown.chronicle.opened, flown.chronicle.renewed), (2, 1), "the attempt counts");
    assert_eq!(devices, BTreeSet::from([0, 1]));
    assert_same(pictures);
}
