//! Whatever an OpenXR call answers, the viewer ends where the table of outcomes says: every call it makes, every code the
//! registry documents, in the first, middle and last call. No frame is left open, no rule broken, nothing leaked.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests stop at the first surprise")]

mod life;

use std::collections::BTreeSet;
use std::panic::catch_unwind;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use fathomless::bindings::{self, BUILT_IN, HANDS, ProfileBindings};
use fathomless::mock::{self, Calls, Mock, MockConfig};
use fathomless::supervisor::Absent;
use fathomless::viewer::ViewerConfig;
use fathomless::xr::{Outcome, outcome};
use life::{Flown, Hand, assert_clean, documented, fly, headset, least, patience};
use openxr::sys;

/// Of one controller, as all are alike to the calls.
static BINDINGS: LazyLock<Vec<ProfileBindings>> = LazyLock::new(|| {
    let mut all = bindings::parse("config/bindings.toml", BUILT_IN, false).unwrap();
    all.retain(|profile| profile.profile.ends_with("khr/simple_controller"));
    all
});

/// Frames that a flight draws before it is ended.
const FRAMES: usize = 5;

/// A runtime whose floor has to be measured: so that every call there is is made.
fn floorless() -> MockConfig {
    MockConfig { max_api_version: (1, 0), absent_extensions: vec!["XR_EXT_local_floor".into()], ..headset() }
}

/// The same, with controllers in both hands.
fn handed() -> Mock {
    let mock = Mock::new(floorless());
    let connect = |hand: &&str| mock.connect(hand, "/interaction_profiles/khr/simple_controller").unwrap();
    HANDS.iter().for_each(connect);
    mock
}

/// Everything asked for that can be asked for.
fn everything(validate: bool) -> ViewerConfig {
    let bindings: &'static [ProfileBindings] = &BINDINGS;
    ViewerConfig { mask: true, refresh_hz: Some(72.0), bindings: Some(bindings), validate, ..least() }
}

/// Functions that the viewer calls and whose answer it heeds, and how often in a flight. Destroying fails for nobody; and
/// the crate asks for the entry points.
fn used() -> Vec<(&'static str, u64)> {
    let clean = handed();
    let flown = fly(&clean, everything(true), patience(Absent::Fail), |hand| {
        if hand.drawn >= FRAMES {
            hand.stop();
        }
    });
    flown.result.unwrap();
    assert_eq!(flown.remarks.validation, 0, "{:?}", flown.remarks.first);
    assert_clean(&clean, "nothing befalls it");
    let is_heeded = |name: &&str| !name.starts_with("xrDestroy") && *name != "xrGetInstanceProcAddr";
    mock::function_names()
        .filter(is_heeded)
        .map(|name| (name, clean.calls(name)))
        .filter(|(_, calls)| *calls > 0)
        .collect()
}

struct Case {
    function: &'static str,
    nth: u64,
    of: u64,
    code: sys::Result,
}

impl Case {
    fn walk(&self, validate: bool) {
        let &Case { function, nth, of, code } = self;
        let case = format!("{function}, call {nth} of {of}, {code:?}");
        let mock = handed();
        mock.on_call(function, Calls::Nth(nth), code).unwrap();
        // Whether it has happened before the flight was to end.
        let mut on_the_way = false;
        let script = |hand: Hand<'_>| {
            if hand.drawn >= FRAMES {
                hand.stop();
            } else {
                on_the_way |= hand.mock.calls(function) >= nth;
            }
        };
        let Flown { result, chronicle, remarks, .. } =
            fly(&mock, everything(validate), patience(Absent::Wait), script);
        assert_eq!(remarks.validation, 0, "{case}: {:?}", remarks.first);
        assert_clean(&mock, &case);
        assert!(mock.calls(function) >= nth, "{case}: not reached");
        let (opened, renewed) = (chronicle.opened, chronicle.renewed);
        let happened = format!("{case}: {result:?}, {chronicle:?}");
        match outcome(function, code) {
            // 1.0 is refused too.
            Outcome::AskAgain if function == "xrCreateInstance" && nth == of => assert!(result.is_err()),
            Outcome::GiveUp => {
                let error = result.expect_err(&happened).to_string();
                assert!(!error.contains('\n') && error.len() > 30, "{case}: a sentence, not {error:?}");
            }
            _ if result.is_err() => panic!("{happened}"),
            // Asked to end, it ends.
            _ if chronicle.drawn >= FRAMES as u64 && !on_the_way => {
                assert_eq!(opened + renewed, 1, "{happened}")
            }
            Outcome::GoOn | Outcome::AskAgain => {
                assert_eq!((opened, renewed, chronicle.waited), (1, 0, 0), "{happened}");
            }
            Outcome::SkipFrame => {
                assert_eq!((opened, renewed), (1, 0), "{happened}");
                assert!(chronicle.skipped > 0, "{happened}");
            }
            // The mock never meant it. Either an event says that it runs, or none says that it does not.
            Outcome::Idle => assert!(opened == 1 && renewed <= 1, "{happened}"),
            Outcome::ReopenSession => {
                assert_eq!(opened + renewed, 2, "{happened}");
            }
            Outcome::ReopenInstance => assert_eq!((opened, renewed), (2, 0), "{happened}"),
            Outcome::Wait => assert_eq!((opened, renewed, chronicle.waited), (2, 0, 1), "{happened}"),
        }
    }
}

fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (function, of) in used() {
        for &code in documented(function) {
            for nth in BTreeSet::from([1, of.div_ceil(2), of]) {
                cases.push(Case { function, nth, of, code });
            }
        }
    }
    cases
}

#[test]
fn every_call_and_every_code_comes_to_what_the_table_says() {
    let start = std::time::Instant::now();
    let cases = cases();
    // Enough hands for what waits (the sessions in doubt) not to count.
    let (next, hands) = (AtomicUsize::new(0), 4);
    let failed = std::thread::scope(|scope| {
        let walk = || {
            let mut failed = 0;
            while let Some((i, case)) = cases.iter().enumerate().nth(next.fetch_add(1, Ordering::Relaxed)) {
                // Validation costs more than all the rest.
                let walked = catch_unwind(|| case.walk(i % 40 == 0));
                if walked.is_err() {
                    println!("failed: {}, call {} of {}, {:?}", case.function, case.nth, case.of, case.code);
                    failed += 1;
                }
            }
            failed
        };
        let hands: Vec<_> = (0..hands).map(|_| scope.spawn(walk)).collect();
        hands.into_iter().map(|hand| hand.join().unwrap()).sum::<usize>()
    });
    println!("{} cases in {:.1} s", cases.len(), start.elapsed().as_secs_f64());
    assert_eq!(failed, 0, "of {} cases", cases.len());
}
