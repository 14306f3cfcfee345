//! A flight goes on over everything in the life of sessions, runtimes and headsets, at the same place: the command's own
//! flight on a mock headset, with a script of what befalls it.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests stop at the first surprise")]

mod life;

use std::collections::BTreeSet;
use std::time::Duration;

use ash::vk;
use fathomless::mock::{
    Act, Calls, Cue, Mask, Mock, MockConfig, Pose, PoseTrack, Script, SubmittedFrame, Tracking, TrackingSpan,
    When,
};
use fathomless::supervisor::{Absent, Venue};
use fathomless::viewer::ViewerConfig;
use glam::{Quat, Vec3};
use life::{Flown, Hand, assert_clean, fly, headset, least, patience};
use openxr::sys;

/// Flies under the validation layers, and finds nothing to complain about.
fn flies(mock: &Mock, case: &str, script: impl FnMut(Hand<'_>)) -> Flown {
    let config = ViewerConfig { validate: true, ..least() };
    let flown = fly(mock, config, patience(Absent::Wait), script);
    flown.result.as_ref().unwrap_or_else(|error| panic!("{case}: {error:#}"));
    assert_eq!(flown.remarks.validation, 0, "{case}: {:?}", flown.remarks.first);
    assert_clean(mock, case);
    flown
}

/// Ends after so many frames.
fn until(frames: usize) -> impl FnMut(Hand<'_>) {
    move |hand| {
        if hand.drawn >= frames {
            hand.stop();
        }
    }
}

/// Does this once, before the frame after so many drawn ones, and ends as many frames later.
fn after(frames: usize, mut act: impl FnMut(&Mock)) -> impl FnMut(Hand<'_>) {
    let mut done = false;
    move |hand| {
        if hand.drawn >= frames && !std::mem::replace(&mut done, hand.drawn >= frames) {
            act(hand.mock);
        }
        if hand.drawn >= 2 * frames {
            hand.stop();
        }
    }
}

#[test]
fn no_headset_at_the_start_is_waited_for_or_stood_in_for_or_said() {
    let absent = MockConfig { unavailable_calls: 3, ..headset() };
    let mock = Mock::new(absent.clone());
    let waited = flies(&mock, "waiting", until(3));
    assert_eq!((waited.chronicle.waited, waited.chronicle.opened), (3, 4));

    let mock = Mock::new(absent.clone());
    let said = fly(&mock, least(), patience(Absent::Fail), until(3)).result.unwrap_err().to_string();
    assert!(said.contains("no headset"), "{said}");

    let mock = Mock::new(absent);
    let mut on_headset = 0;
    let stood_in = fly(&mock, least(), patience(Absent::StandIn), |hand| {
        on_headset += usize::from(hand.venue == Venue::Headset);
        if on_headset > 10 {
            hand.stop();
        }
    });
    stood_in.result.unwrap();
    assert_eq!(stood_in.venues, [Venue::Headset, Venue::StandIn, Venue::Headset]);
    assert_clean(&mock, "stood in for");
}

#[test]
fn a_headset_that_goes_is_stood_in_for_until_it_is_back() {
    let mock = Mock::new(headset());
    let (mut gone, mut last) = (false, Duration::ZERO);
    let mut on_headset_again = 0;
    let flown = fly(&mock, least(), patience(Absent::StandIn), |hand| {
        assert!(hand.flown >= last, "the flight goes on where it was");
        last = hand.flown;
        if hand.drawn == 4 && !std::mem::replace(&mut gone, true) {
            hand.mock.lose_instance(Duration::ZERO);
            hand.mock.disconnect_for(3);
        }
        on_headset_again += usize::from(gone && hand.venue == Venue::Headset && hand.drawn > 5);
        if on_headset_again > 3 {
            hand.stop();
        }
    });
    flown.result.unwrap();
    assert_eq!(flown.venues, [Venue::Headset, Venue::Headset, Venue::StandIn, Venue::Headset]);
    assert_clean(&mock, "gone and back");
}

#[test]
fn a_headset_may_sleep_and_wake() {
    let mock = Mock::new(MockConfig { asleep: true, ..headset() });
    let mut sleeps = BTreeSet::new();
    let flown = flies(&mock, "asleep", |hand| {
        match hand.turn {
            10 | 40 => hand.mock.gain_focus(),
            25 => hand.mock.stop_session(),
            _ => {}
        }
        if hand.mock.session_state() == Some(sys::SessionState::IDLE) {
            sleeps.insert(hand.turn);
        }
        if hand.turn > 60 {
            hand.stop();
        }
    });
    assert!(sleeps.contains(&5) && sleeps.contains(&35), "{sleeps:?}");
    assert_eq!((flown.chronicle.opened, flown.chronicle.renewed), (1, 0), "one session all the time");
}

#[test]
fn stopping_may_come_before_the_first_frame_and_ready_again_after() {
    let on = |function, act| Cue { when: When::Call { function, nth: 1 }, acts: vec![act] };
    let cues = vec![on("xrBeginSession", Act::Stop), on("xrEndSession", Act::GainFocus)];
    let mock = Mock::with_script(Script { config: headset(), cues, ..Script::default() });
    let flown = flies(&mock, "stopped at once", until(3));
    assert_eq!((flown.chronicle.opened, flown.chronicle.renewed), (1, 0));
    assert_eq!((mock.calls("xrBeginSession"), mock.calls("xrEndSession")), (2, 2));
    assert_eq!(mock.script_errors(), Vec::<String>::new());
}

#[test]
fn the_wearer_may_end_it() {
    let mock = Mock::new(headset());
    let flown = flies(&mock, "ended by the wearer", |hand| {
        if hand.drawn == 3 {
            hand.mock.exit_session();
        }
    });
    assert_eq!((flown.chronicle.opened, flown.chronicle.renewed), (1, 0));
}

/// The mean difference of two pictures, 0 to 255.
fn difference(a: &SubmittedFrame, b: &SubmittedFrame) -> f64 {
    let bytes = |frame: &SubmittedFrame| frame.views.iter().flat_map(|v| v.rgba.clone()).collect::<Vec<_>>();
    let (a, b) = (bytes(a), bytes(b));
    assert_eq!(a.len(), b.len());
    a.iter().zip(&b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
}

/// The last picture before something happens, and the last of as many frames as came before it.
fn before_and_after(config: MockConfig, case: &str, happens: impl Fn(&Mock)) -> ([SubmittedFrame; 2], Flown) {
    let mock = Mock::new(MockConfig { read_back: true, keep_frames: 64, ..config });
    let mut before = None;
    let mut last = Duration::ZERO;
    let mut script = after(5, |mock| {
        before = mock.take_frames().into_iter().rfind(|frame| !frame.views.is_empty());
        happens(mock);
    });
    let config = ViewerConfig { validate: true, complete: true, ..least() };
    let flown = fly(&mock, config, patience(Absent::Wait), |hand| {
        assert!(hand.flown >= last, "{case}: the flight goes on where it was");
        last = hand.flown;
        script(hand);
    });
    drop(script);
    flown.result.as_ref().unwrap_or_else(|error| panic!("{case}: {error:#}"));
    assert_eq!(flown.remarks.validation, 0, "{case}: {:?}", flown.remarks.first);
    assert_clean(&mock, case);
    let after = mock.take_frames().into_iter().rfind(|frame| !frame.views.is_empty());
    ([before.unwrap(), after.unwrap()], flown)
}

#[test]
fn whatever_is_lost_the_same_is_seen_afterwards() {
    type Loss = (&'static str, fn(&Mock), (u32, u32));
    let losses: [Loss; 6] = [
        ("session, announced", |mock| mock.lose_session(), (1, 1)),
        ("session, without a word", |mock| mock.kill_session(), (1, 1)),
        ("instance", |mock| mock.lose_instance(Duration::ZERO), (2, 0)),
        ("instance, announced", |mock| mock.lose_instance(Duration::from_millis(50)), (2, 0)),
        (
            "runtime, which takes its time to come back",
            |mock| {
                mock.lose_instance(Duration::ZERO);
                let made = mock.calls("xrCreateInstance");
                for nth in made + 1..=made + 4 {
                    let gone = sys::Result::ERROR_RUNTIME_UNAVAILABLE;
                    mock.on_call("xrCreateInstance", Calls::Nth(nth), gone).unwrap();
                }
            },
            (6, 0),
        ),
        (
            "headset, unplugged",
            |mock| {
                mock.kill_session();
                mock.disconnect_for(3);
            },
            // The session cannot be made anew where there is no headset: all is opened until there is one.
            (4, 1),
        ),
    ];
    for (case, lose, opened_and_renewed) in losses {
        let ([before, after], flown) = before_and_after(headset(), case, lose);
        assert_eq!((flown.chronicle.opened, flown.chronicle.renewed), opened_and_renewed, "{case}");
        assert_eq!(difference(&before, &after), 0.0, "{case}");
    }
}

#[test]
fn a_headset_that_is_another_afterwards_is_drawn_for() {
    let larger = |mock: &Mock| {
        mock.perform(Act::EyeSizes([[24, 20], [24, 20]]));
        mock.lose_session();
    };
    let ([before, after], flown) = before_and_after(headset(), "another headset", larger);
    assert_eq!((flown.chronicle.opened, flown.chronicle.renewed), (1, 1));
    assert_eq!([before.views[0].size, after.views[0].size], [[16, 16], [24, 20]]);
}

#[test]
fn recentring_seats_the_wearer_anew() {
    let aside = Pose::at(0.6, 0.0, -0.4);
    let ([before, after], _) = before_and_after(headset(), "recentred", |mock| mock.recentre(aside));
    let ([_, moved], _) = before_and_after(headset(), "moved", |mock| {
        mock.hold_head(Pose::at(-aside.position.x, 1.6, -aside.position.z));
    });
    assert!(before.views[0].pose.position.distance(after.views[0].pose.position) > 0.5, "the poses differ");
    let (seen, control) = (difference(&before, &after), difference(&before, &moved));
    println!("{seen:.3} after recentring, {control:.3} after a step aside");
    assert!(control > 1.0 && seen < 0.1 * control, "{seen} of {control}");
}

#[test]
fn nobody_moves_who_wears_no_headset() {
    let mock = Mock::new(headset());
    let mut standing = BTreeSet::new();
    let flown = flies(&mock, "taken off", |hand| {
        match hand.drawn {
            4 => hand.mock.perform(Act::UserPresent(false)),
            // The event has been read in the frame before.
            6..10 => assert!(standing.insert(hand.flown) || standing.len() == 1),
            10 => hand.mock.perform(Act::UserPresent(true)),
            14.. => hand.stop(),
            _ => {}
        }
    });
    assert_eq!(standing.len(), 1, "{standing:?}");
    assert!(standing.iter().all(|then| flown.flown > *then), "and on again");
}

#[test]
fn frames_that_nobody_sees_may_be_many() {
    let mock = Mock::new(MockConfig { skip_rendering: vec![4..200, 200..400], ..headset() });
    let flown = flies(&mock, "hidden for long", until(6));
    assert!(flown.chronicle.skipped >= 396);
    assert_eq!((flown.chronicle.opened, flown.chronicle.renewed), (1, 0));
}

#[test]
fn frames_refused_for_ever_end_in_words() {
    let mock = Mock::new(headset());
    let refused = sys::Result::ERROR_LAYER_INVALID;
    mock.on_call("xrEndFrame", Calls::All, refused).unwrap();
    let flown = fly(&mock, least(), patience(Absent::Wait), |_| ());
    let said = flown.result.unwrap_err().to_string();
    assert!(said.contains("xrEndFrame"), "{said}");
    assert_eq!(flown.chronicle.renewed, patience(Absent::Wait).attempts, "not without having tried");
}

#[test]
fn every_headset_and_every_poor_runtime_is_drawn_for() {
    let mut headsets = vec![
        ("API 1.0", MockConfig { max_api_version: (1, 0), ..headset() }),
        ("eyes of two sizes", MockConfig { right_eye_size: Some([20, 12]), ..headset() }),
        ("no stage", MockConfig { stage: false, ..headset() }),
        ("images in any order", MockConfig { shuffle_images: true, ..headset() }),
        ("images late", MockConfig { image_timeouts: 3, ..headset() }),
        ("more depth images", MockConfig { depth_image_count: Some(5), ..headset() }),
        ("no mask to speak of", MockConfig { mask: Mask::Empty, ..headset() }),
        ("no depth format", { MockConfig { formats: vec![vk::Format::R8G8B8A8_SRGB], ..headset() } }),
        ("UNORM only", {
            let formats = vec![vk::Format::B8G8R8A8_UNORM, vk::Format::D32_SFLOAT];
            MockConfig { formats, ..headset() }
        }),
    ];
    for count in 1..=5 {
        headsets.push(("a count of images", MockConfig { image_count: count, ..headset() }));
    }
    for extension in [
        "XR_EXT_local_floor",
        "XR_EXT_performance_settings",
        "XR_EXT_user_presence",
        "XR_FB_display_refresh_rate",
        "XR_KHR_composition_layer_cube",
        "XR_KHR_composition_layer_depth",
        "XR_KHR_visibility_mask",
    ] {
        let absent_extensions = vec![extension.to_owned()];
        headsets.push((extension, MockConfig { absent_extensions, max_api_version: (1, 0), ..headset() }));
    }
    for (case, headset) in headsets {
        let mock = Mock::new(MockConfig { read_back: true, ..headset });
        let config =
            ViewerConfig { validate: true, mask: true, refresh_hz: Some(72.0), complete: true, ..least() };
        let flown = fly(&mock, config, patience(Absent::Fail), until(3));
        flown.result.unwrap_or_else(|error| panic!("{case}: {error:#}"));
        assert_eq!(flown.remarks, Default::default(), "{case}");
        assert_clean(&mock, case);
        let shown = mock.take_frames().into_iter().rfind(|frame| !frame.views.is_empty());
        for view in shown.unwrap_or_else(|| panic!("{case}: nothing is shown")).views {
            let middle = view.pixel(view.size[0] / 2, view.size[1] / 2).unwrap();
            assert!(middle[..3].iter().any(|&c| c > 20), "{case}: black in the middle");
        }
    }
}

#[test]
fn a_runtime_that_tells_of_other_than_two_eyes_in_mid_flight_is_an_error_to_stop_on() {
    type Loss = (&'static str, fn(&Mock));
    let losses: [Loss; 3] = [
        ("in mid-flight", |_| ()),
        ("when the session is made anew", Mock::lose_session),
        ("when all is made anew", |mock| mock.lose_instance(Duration::ZERO)),
    ];
    for (case, lose) in losses {
        for eyes in [0, 1, 3, 4] {
            let mock = Mock::new(headset());
            let config = ViewerConfig { validate: true, ..least() };
            let flown = fly(&mock, config, patience(Absent::Wait), |hand| {
                if hand.drawn == 4 {
                    hand.mock.perform(Act::ViewCount(eyes));
                    lose(hand.mock);
                }
                assert!(hand.drawn <= 4, "{case}, {eyes} eyes: drawn");
            });
            let said = flown.result.unwrap_err().to_string();
            assert!(said.contains("two") && !said.contains('\n'), "{case}, {eyes} eyes: {said}");
            assert_eq!(flown.remarks.validation, 0, "{:?}", flown.remarks.first);
            assert_clean(&mock, case);
        }
    }
}

/// A head that never rests, in a headset whose eyes are turned, and whose first answer of a frame is off.
fn restless() -> MockConfig {
    let key = |i: u32| {
        let t = f64::from(i) * 0.05;
        let turn = Quat::from_rotation_y(t.sin() as f32) * Quat::from_rotation_x(0.3 * t.cos() as f32);
        (t, Pose::new(Vec3::new(0.1 * i as f32, 1.6, -0.03 * i as f32), turn))
    };
    MockConfig {
        head: PoseTrack::new((0..40).map(key)),
        eye_turn: [0.1, -0.1].map(Quat::from_rotation_y),
        early_error_m: Vec3::new(0.02, -0.01, 0.03),
        keep_frames: 256,
        ..headset()
    }
}

#[test]
fn every_frame_is_submitted_with_the_eyes_where_the_runtime_last_put_them() {
    let mock = Mock::new(restless());
    let flown = flies(&mock, "restless", |hand| match hand.drawn {
        20 => hand.mock.recentre(Pose::at(0.5, 0.0, -0.5)),
        40 => hand.mock.perform(Act::Ipd(0.07)),
        60.. => hand.stop(),
        _ => {}
    });
    assert_eq!(flown.chronicle.opened, 1);
    let frames = mock.take_frames();
    let drawn: Vec<_> = frames.iter().filter(|frame| !frame.views.is_empty()).collect();
    assert!(drawn.len() >= 60, "{} frames are drawn", drawn.len());
    for pair in drawn.windows(2) {
        assert_ne!(pair[0].views[0].pose, pair[1].views[0].pose, "the head moves");
    }
    for frame in &frames {
        assert_eq!(frame.display_time_ns, frame.predicted_display_time_ns, "frame {}", frame.index);
        assert_eq!(frame.as_located, (!frame.views.is_empty()).then_some(true), "frame {}", frame.index);
    }
}

#[test]
fn while_tracking_is_lost_the_last_good_eyes_are_submitted() {
    let lost = |tracking, frames| TrackingSpan { frames, tracking };
    let tracking = vec![lost(Tracking::LOST, 20..30), lost(Tracking::ORIENTATION_ONLY, 40..50)];
    let mock = Mock::new(MockConfig { tracking: tracking.clone(), ..restless() });
    flies(&mock, "tracking lost", until(60));
    let frames = mock.take_frames();
    let drawn = frames.iter().filter(|frame| !frame.views.is_empty());
    for frame in drawn {
        let tracked = tracking.iter().all(|span| !span.frames.contains(&frame.index));
        assert_eq!(frame.as_located, Some(tracked), "frame {}", frame.index);
    }
}

/// Share of a picture's pixels, in per cent, that are black with the nearest depth.
fn covered(frame: &SubmittedFrame, eye: usize) -> f64 {
    let view = &frame.views[eye];
    let depth = view.depth.as_ref().unwrap();
    let covered =
        view.rgba.chunks_exact(4).zip(&depth.values).filter(|(c, d)| c[..3] == [0; 3] && **d == 1.0);
    100.0 * covered.count() as f64 / depth.values.len() as f64
}

#[test]
fn what_the_lenses_hide_is_covered_until_they_hide_something_else() {
    for multiview in [true, false] {
        let mock = Mock::new(MockConfig {
            eye_size: [64, 64],
            mask: Mask::Octagon { cut: 0.25 },
            read_back: true,
            keep_frames: 64,
            ..headset()
        });
        let config = ViewerConfig { validate: true, complete: true, mask: true, multiview, ..least() };
        let mut pictures = Vec::new();
        let flown = fly(&mock, config, patience(Absent::Fail), |hand| {
            let newest = || hand.mock.take_frames().into_iter().rfind(|frame| !frame.views.is_empty());
            match hand.drawn {
                4 if pictures.is_empty() => {
                    pictures.extend(newest());
                    hand.mock.perform(Act::Mask(Mask::Octagon { cut: 0.4 }));
                }
                8 if pictures.len() == 1 => {
                    pictures.extend(newest());
                    hand.mock.perform(Act::Mask(Mask::Empty));
                }
                12.. => {
                    pictures.extend(newest());
                    hand.stop();
                }
                _ => {}
            }
        });
        flown.result.unwrap();
        assert_eq!(flown.remarks, Default::default());
        for eye in 0..2 {
            // Four right-angled triangles, each of whose legs is the cut's share of a side.
            for (picture, wanted) in pictures.iter().zip([12.5, 32.0, 0.0]) {
                let found = covered(picture, eye);
                assert!((found - wanted).abs() < 2.0, "eye {eye}: {found} % are covered, not {wanted}");
            }
            let [masked, whole] = [&pictures[0], &pictures[2]].map(|frame| frame.views[eye].pixel(32, 32));
            assert_eq!(masked, whole, "the middle is as ever");
            assert_eq!(pictures[0].views[eye].pixel(0, 0), Some([0, 0, 0, 255]));
            assert_eq!(pictures[0].views[eye].pixel(63, 63), Some([0, 0, 0, 255]));
        }
    }
}

#[test]
fn rates_are_asked_for() {
    let mock = Mock::new(MockConfig { refresh_rates_hz: vec![72.0, 120.0], ..headset() });
    let config = ViewerConfig { refresh_hz: Some(118.0), ..least() };
    let mut rate = None;
    let flown = fly(&mock, config, patience(Absent::Fail), |hand| {
        rate = Some(hand.mock.refresh_rate());
        if hand.drawn >= 3 {
            hand.stop();
        }
    });
    flown.result.unwrap();
    assert_eq!(rate, Some(120.0), "the nearest to 118");
    let sustained = Some(sys::PerfSettingsLevelEXT::SUSTAINED_HIGH);
    assert_eq!(mock.performance_levels(), [sustained; 2]);
    assert_clean(&mock, "rates");
}

#[test]
fn several_viewers_live_beside_each_other() {
    type Fate = (&'static str, fn(&Mock));
    let fates: [Fate; 4] = [
        ("nothing", |_| ()),
        ("a lost session", |mock| mock.lose_session()),
        ("a lost instance", |mock| mock.lose_instance(Duration::ZERO)),
        ("a nap", |mock| {
            mock.stop_session();
            mock.gain_focus();
        }),
    ];
    let pictures = std::thread::scope(|scope| {
        let lives = fates.map(|(case, fate)| scope.spawn(move || before_and_after(headset(), case, fate).0));
        lives.map(|life| life.join().unwrap())
    });
    for [before, after] in &pictures {
        assert_eq!(difference(before, after), 0.0);
        assert_eq!(difference(before, &pictures[0][0]), 0.0, "all see the same");
    }
}
