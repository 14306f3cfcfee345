//! The wearer's panel, on a mock headset with scripted controllers: hidden it costs nothing; shown, it hangs where the hand
//! is, is seen as a layer or in the eyes, and each of its controls does what it says when a ray clicks it. Pictures of it
//! are left in `target/tmp/wrist/`.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests stop at the first surprise")]

mod life;
mod wearer;
mod wrist_support;

use std::path::PathBuf;
use std::sync::Mutex;

use egui::accesskit::Role;
use egui::pos2;
use fathomless::aids::{Aids, HandAid};
use fathomless::bindings::{Action, HANDS};
use fathomless::gpu::{ShaderText, Shelf};
use fathomless::mock::{Calls, MockConfig, Pose as MockPose, SubmittedFrame, SubmittedView, Tracking};
use fathomless::panels::controller_lines;
use fathomless::panels::wrist::{METRES_PER_POINT, SIZE};
use fathomless::supervisor::Stage;
use fathomless::viewer::{PanelWay, Step, ViewerConfig};
use fathomless::wrist::PanelPlace;
use glam::{Quat, Vec3};
use life::{headset, least};
use openxr::sys;
use toml::Value;
use wearer::{built_in, paths};
use wrist_support::{BARE, MAIN, TO_HEAD, TOUCH, WRIST, Wearer, composed, near, write};

#[test]
fn hidden_it_costs_nothing_and_shown_it_is_drawn_when_it_changes() {
    let mut wearer = Wearer::new(MockConfig { read_back: true, ..headset() });
    let acquired = |wearer: &mut Wearer| {
        let before = wearer.mock.calls("xrAcquireSwapchainImage");
        let frame = wearer.seen(1);
        (frame, wearer.mock.calls("xrAcquireSwapchainImage") - before)
    };
    let swapchains = wearer.mock.calls("xrCreateSwapchain");
    for _ in 0..20 {
        let (frame, images) = acquired(&mut wearer);
        assert_eq!((frame.layer_count, frame.quads.len(), images), (1, 0, 2), "colour and depth");
    }
    let picture = |wearer: &Wearer| wearer.flying.wrist.panel().picture().1;
    assert_eq!(picture(&wearer), 0, "laid out though nobody has seen it");
    assert_eq!(wearer.mock.calls("xrCreateSwapchain"), swapchains);

    wearer.open();
    assert_eq!(wearer.mock.calls("xrCreateSwapchain"), swapchains + 1);
    // The bookmarks are read beside the frames, and then nothing changes any more.
    wearer.until("a still picture", |wearer| {
        let before = picture(wearer);
        wearer.fly(60);
        picture(wearer) == before
    });
    let drawn = picture(&wearer);
    let seat = wearer.seat();
    for _ in 0..20 {
        let (frame, images) = acquired(&mut wearer);
        assert_eq!((frame.layer_count, frame.quads.len(), images), (2, 1, 2), "nothing new to draw");
        let quad = &frame.quads[0];
        assert_eq!((quad.layer, quad.eyes), (1, sys::EyeVisibility::BOTH));
        // The colours are multiplied by their alpha.
        assert_eq!(quad.flags, sys::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA);
        near(wearer.flying.wrist.aid().unwrap(), quad, seat);
        assert_eq!(quad.size_m, SIZE.map(|points| points * METRES_PER_POINT));
        assert_eq!(quad.pixels, SIZE.map(|points| points as u32));
    }
    assert_eq!(picture(&wearer), drawn);
    let frame = wearer.seen(1);
    let quad = &frame.quads[0];
    let texel = |x: usize, y: usize| &quad.rgba[4 * (y * quad.pixels[0] as usize + x)..][..4];
    assert_eq!(texel(0, 0), [0; 4], "nothing in the corner");
    assert_eq!(texel(300, 100)[3], 255, "all there in the middle");
    let bright = quad.rgba.chunks_exact(4).filter(|p| p[0] > 200 && p[2] > 200).count();
    assert!(bright > 2000, "{bright} bright pixels: are there letters?");
    // Pointed at it is drawn anew: the dot is where the hand points.
    wearer.point(pos2(360.0, 560.0));
    let frame = wearer.seen(1);
    let at = 4 * (560 * 720 + 360);
    assert_eq!(&frame.quads[0].rgba[at..at + 4], [255; 4]);
    assert!(picture(&wearer) > drawn);

    wearer.toggle();
    let drawn = picture(&wearer);
    for _ in 0..20 {
        let (frame, images) = acquired(&mut wearer);
        assert_eq!((frame.layer_count, frame.quads.len(), images), (1, 0, 2));
    }
    assert_eq!(picture(&wearer), drawn, "laid out while it is hidden");
    wearer.ends();
}

#[test]
fn it_hangs_over_the_wrist_and_follows_it_or_floats() {
    let mut wearer = Wearer::new(headset());
    wearer.open();
    let seat = wearer.seat();
    let at = |wearer: &Wearer| wearer.flying.wrist.aid().unwrap().pose.position + seat;
    let first = at(&wearer);
    assert!(first.y > WRIST.y + 0.1 && first.distance(WRIST) < 0.35, "{first}");
    let eyes = seat + wearer.viewer().eye(0).unwrap().pose.position;
    let front = wearer.flying.wrist.aid().unwrap().pose.orientation * Vec3::Z;
    assert!(front.dot((eyes - first).normalize()) > 0.97, "it does not face the head");
    wearer.place(HANDS[0], "grip", WRIST + Vec3::new(-0.1, 0.05, 0.0), Quat::IDENTITY);
    wearer.until("it follows the hand", |wearer| at(wearer).x < first.x - 0.09);
    wearer.toggle();
    wearer.flying.helm.controllers.settings.panel = PanelPlace::Floating;
    wearer.open();
    let there = at(&wearer);
    wearer.place(HANDS[0], "grip", WRIST, Quat::IDENTITY);
    wearer.fly(20);
    assert_eq!(at(&wearer), there);
    assert!((there - eyes).dot(Vec3::NEG_Z) > 0.5, "{there}");
    wearer.ends();
}

static SAVED: Mutex<Vec<(String, Value)>> = Mutex::new(Vec::new());

fn save(changes: &[(&str, Value)]) -> anyhow::Result<PathBuf> {
    let changes = changes.iter().map(|(name, value)| ((*name).to_owned(), value.clone()));
    SAVED.lock().unwrap().extend(changes);
    Ok(PathBuf::from("nowhere"))
}

#[test]
fn each_control_does_what_it_says_for_every_controller_and_bare_hands() {
    for profile in built_in(false) {
        let mut wearer = Wearer::with(headset(), least(), profile.profile);
        wearer.is_brief = profile.profile != TOUCH;
        wearer.flying.comfort.settings.fades = false;
        let has_button = !paths(&profile, Action::Panel).0.is_empty();
        assert_eq!(has_button, profile.profile != BARE);
        assert_eq!(wearer.viewer().has_panel_button(0), Some(has_button), "{}", profile.profile);
        wearer.open();
        wearer.clicks_each_control();
        wearer.ends();
    }
}

#[test]
fn what_is_chosen_is_kept_once_and_a_slider_follows_the_ray() {
    let mut wearer = Wearer::new(headset());
    wearer.is_brief = true;
    wearer.flying.wrist.shelf.saver = Some(save);
    wearer.open();
    wearer.chooses("Fly");
    let speed = |wearer: &Wearer| wearer.flying.choices().speed;
    // Dragged, it follows the ray, beyond its end, too; and a hand that is lost on the way leaves it there.
    let slider = wearer.at(Role::Slider, "Speed");
    wearer.point(slider);
    wearer.pull(1.0);
    wearer.point(slider + egui::vec2(190.0, 0.0));
    assert!((speed(&wearer) - 8.0).abs() < 1e-3);
    let unseen = Tracking { orientation_valid: false, position_valid: false, ..Tracking::LOST };
    wearer.mock.set_device_tracking(HANDS[1], unseen).unwrap();
    wearer.fly(4);
    wearer.mock.set_device_tracking(HANDS[1], Tracking::FULL).unwrap();
    wearer.pull(0.0);
    assert!((speed(&wearer) - 8.0).abs() < 1e-3, "{}", speed(&wearer));
    wearer.click_at(slider);
    wearer.page("Comfort");
    wearer.chooses("Comfort");

    // The controllers, in the runtime's words.
    wearer.page("?");
    let bound = wearer.viewer().bound().0.to_vec();
    let lines = wearer.flying.wrist.panel().known.controls.clone();
    assert_eq!(lines, controller_lines(&bound));
    let dives = lines.iter().find(|line| line.action == Action::Dive.title()).unwrap();
    assert!(dives.inputs.contains("Right Hand Trigger"), "{dives:?}");
    let last = speed(&wearer);
    wearer.ends();

    // Each choice was kept once, the slider's on its way not.
    let saved = SAVED.lock().unwrap();
    let of = |name: &str| {
        saved.iter().filter(|(it, _)| it == name).map(|(_, value)| value.clone()).collect::<Vec<_>>()
    };
    assert_eq!(of("comfort.vignette"), [Value::Boolean(false), Value::Boolean(true)]);
    assert_eq!(of("controllers.snap_turn").len(), 5);
    assert_eq!(of("controllers.fly_by_head").len(), 2);
    assert_eq!(of("controllers.panel").len(), 2);
    assert_eq!(of("controllers.standing").len(), 2);
    assert_eq!(of("motion.comfort_m").len(), 1);
    let speeds = of("motion.speed");
    assert_eq!(speeds.len(), 5, "{speeds:?}");
    assert!((speeds[4].as_float().unwrap() - last).abs() < 1e-3);
}

#[test]
fn a_ray_beyond_the_panel_dives_and_one_on_it_does_not() {
    let mut wearer = Wearer::new(headset());
    wearer.open();
    let depth = |wearer: &Wearer| wearer.flying.helm.standpoint().unwrap().depth;
    let start = depth(&wearer);
    wearer.point(pos2(360.0, 480.0));
    let ray_m = |wearer: &Wearer| {
        let pose = fathomless::rig::Pose { position: Vec3::ZERO, orientation: Quat::IDENTITY };
        let hand = HandAid { grip: pose, aim: Some(pose), ray_m: Some(100.0), holds: false };
        let mut aids = Aids { hands: [Some(hand); 2], ..Aids::default() };
        wearer.flying.wrist.cut(&mut aids);
        aids.hands.map(|hand| hand.unwrap().ray_m.unwrap())
    };
    let target = wearer.in_room(pos2(360.0, 480.0));
    let [off, main] = ray_m(&wearer);
    assert!((main - target.distance(MAIN)).abs() < 1e-4, "the ray ends at the panel");
    assert_eq!(off, 100.0);
    wearer.pull(1.0);
    wearer.fly(40);
    assert!((depth(&wearer) - start).abs() < 1e-9, "it dives through the panel");
    wearer.pull(0.0);
    // The stick scrolls, and lifts nobody.
    wearer.mock.set_input("/user/hand/right/input/thumbstick", [0.0, 1.0]).unwrap();
    wearer.fly(20);
    assert!((depth(&wearer) - start).abs() < 1e-9 && wearer.flying.wrist.scrolls());
    wearer.mock.set_input("/user/hand/right/input/thumbstick", [0.0, 0.0]).unwrap();
    wearer.fly(3);
    // Beside it the land is pointed at.
    wearer.place(HANDS[1], "aim", MAIN, Quat::from_rotation_x(-0.9));
    wearer.fly(4);
    assert!(!wearer.flying.wrist.occupied()[1] && ray_m(&wearer) == [100.0; 2]);
    wearer.pull(1.0);
    wearer.until("it dives", |wearer| depth(wearer) > start + 0.05);
    // Sweeping over the panel it goes on.
    wearer.point(pos2(360.0, 480.0));
    let swept = depth(&wearer);
    wearer.until("it goes on", |wearer| depth(wearer) > swept + 0.05);
    wearer.pull(0.0);
    wearer.ends();
}

/// A frame with the panel, with nothing else that changes.
fn frame_of(config: MockConfig, viewer: ViewerConfig) -> (Wearer, SubmittedFrame) {
    let mut wearer = Wearer::with(config, viewer, TOUCH);
    wearer.open();
    wearer.until("the worlds are read", |wearer| !wearer.flying.wrist.panel().known.worlds.is_empty());
    let frame = wearer.seen(4);
    (wearer, frame)
}

#[test]
fn without_layers_the_eyes_show_what_the_layer_would() {
    let config = MockConfig { eye_size: [256; 2], read_back: true, ..headset() };
    for (formats, multiview) in [(None, true), (Some(ash::vk::Format::B8G8R8A8_UNORM), false)] {
        let mut config = config.clone();
        if let Some(format) = formats {
            config.formats = vec![format, ash::vk::Format::D32_SFLOAT];
        }
        let viewer = ViewerConfig { multiview, ..least() };
        let (mut with, layered) = frame_of(config.clone(), viewer);
        assert_eq!((layered.layer_count, with.viewer().panel_way()), (2, Some(PanelWay::Layer)));
        let none = MockConfig { max_layers: 1, ..config };
        let (mut without, in_eyes) = frame_of(none, viewer);
        assert_eq!((in_eyes.layer_count, without.viewer().panel_way()), (1, Some(PanelWay::InEyes)));
        assert!(in_eyes.quads.is_empty());
        near(without.flying.wrist.aid().unwrap(), &layered.quads[0], with.seat());
        for (eye, (view, seen)) in layered.views.iter().zip(&in_eyes.views).enumerate() {
            write(&format!("in_eye_{eye}"), seen.size, &seen.rgba);
            let wanted = composed(view, &layered.quads[0]);
            let own = seen.rgba.chunks_exact(4);
            let pairs: Vec<_> = wanted.iter().zip(own).filter(|((_, on), _)| *on).collect();
            assert!(pairs.len() > 3000, "eye {eye}: {} pixels show the panel", pairs.len());
            let off: f32 = pairs
                .iter()
                .map(|((light, _), own)| {
                    (0..3).map(|i| (light[i] - f32::from(own[i])).abs()).sum::<f32>() / 3.0
                })
                .sum::<f32>()
                / pairs.len() as f32;
            println!("eye {eye}: {off:.3}/255 of {} pixels", pairs.len());
            assert!(off < 1.5, "eye {eye}: {off}");
        }
        with.ends();
        without.ends();
    }
}

#[test]
fn a_runtime_that_refuses_the_layer_gets_it_drawn() {
    let refused = [
        sys::Result::ERROR_LAYER_INVALID,
        sys::Result::ERROR_LAYER_LIMIT_EXCEEDED,
        sys::Result::ERROR_SWAPCHAIN_RECT_INVALID,
    ];
    for code in refused {
        let mut wearer = Wearer::new(headset());
        wearer.open();
        assert_eq!(wearer.seen(1).layer_count, 2);
        let calls = wearer.mock.calls("xrEndFrame");
        wearer.mock.on_call("xrEndFrame", Calls::Nth(calls + 1), code).unwrap();
        // The same frame goes without it, and the next ones have it in the eyes.
        assert_eq!(wearer.seen(1).layer_count, 1, "{code:?}");
        assert_eq!(wearer.seen(1).layer_count, 1);
        assert_eq!(wearer.viewer().panel_way(), Some(PanelWay::InEyes));
        wearer.click(Role::Button, "Faster");
        wearer.ends();
    }
    // One that makes no image for it, does not say which it has made, or does not hand it out.
    for (function, code) in [
        ("xrCreateSwapchain", sys::Result::ERROR_FEATURE_UNSUPPORTED),
        ("xrCreateSwapchain", sys::Result::ERROR_OUT_OF_MEMORY),
        ("xrEnumerateSwapchainImages", sys::Result::ERROR_OUT_OF_MEMORY),
        ("xrAcquireSwapchainImage", sys::Result::ERROR_VALIDATION_FAILURE),
    ] {
        let mut wearer = Wearer::new(headset());
        // Of the eyes' colour and depth, in each frame until the panel is there.
        let before = if function == "xrAcquireSwapchainImage" { 2 * 2 } else { 0 };
        let nth = wearer.mock.calls(function) + before + 1;
        wearer.mock.on_call(function, Calls::Nth(nth), code).unwrap();
        wearer.open();
        assert!(wearer.mock.calls(function) >= nth, "{function}");
        assert_eq!(wearer.viewer().panel_way(), Some(PanelWay::InEyes), "{function}");
        wearer.click(Role::Button, "Faster");
        wearer.ends();
    }
    // One that would not have taken the frame without it either: it is not to blame.
    for (code, ends) in [(sys::Result::ERROR_LAYER_INVALID, 2), (sys::Result::ERROR_TIME_INVALID, 1)] {
        let mut wearer = Wearer::new(headset());
        wearer.open();
        let calls = wearer.mock.calls("xrEndFrame");
        for nth in 1..=ends {
            wearer.mock.on_call("xrEndFrame", Calls::Nth(calls + nth), code).unwrap();
        }
        assert!(wearer.try_frame().is_err(), "{code:?}");
        assert_eq!(wearer.mock.calls("xrEndFrame"), calls + ends + 1, "{code:?}: and once without anything");
        assert_eq!(wearer.seen(1).layer_count, 2, "{code:?}");
        assert_eq!(wearer.viewer().panel_way(), Some(PanelWay::Layer));
        wearer.ends();
    }
    // One that keeps the image too long at first.
    let mut wearer = Wearer::new(headset());
    let waited = wearer.mock.calls("xrWaitSwapchainImage");
    let calls = Calls::Nth(waited + 4 * 2 + 3);
    wearer.mock.on_call("xrWaitSwapchainImage", calls, sys::Result::TIMEOUT_EXPIRED).unwrap();
    wearer.open();
    wearer.fly(4);
    assert_eq!(wearer.viewer().panel_way(), Some(PanelWay::Layer));
    wearer.ends();
}

#[test]
fn over_the_eyes_it_is_not_darkened_and_in_the_window_it_is_once() {
    let config = MockConfig { eye_size: [256; 2], read_back: true, ..headset() };
    let alone = MockConfig { max_layers: 1, ..config.clone() };
    let black = Aids { fade: 1.0, ..Aids::default() };
    let mut shown = [config, alone].map(|config| {
        let (mut wearer, _) = frame_of(config, least());
        wearer.viewer().keep_mirror().unwrap();
        // The next frame as the last one was, but in the dark.
        wearer.mock.take_frames();
        let Wearer { flying, viewer, .. } = &mut wearer;
        let viewer = viewer.as_mut().unwrap();
        viewer.set_aids(&black);
        let standpoint = flying.helm.standpoint().unwrap();
        assert_eq!(viewer.frame(&standpoint, true).unwrap(), Step::Drew);
        let mirror = [0, 1].map(|eye| viewer.read_mirror(eye).unwrap());
        let frame = wearer.mock.take_last_frame().unwrap();
        (wearer, frame, mirror)
    });
    let [(with, layered, mirror), (without, in_eyes, own)] = &mut shown;
    assert_eq!(with.viewer().panel_way(), Some(PanelWay::Layer));
    assert_eq!(without.viewer().panel_way(), Some(PanelWay::InEyes));
    for eye in 0..2 {
        assert!(mirror[eye] == own[eye], "the window shows eye {eye} otherwise");
        let bright = own[eye].iter().filter(|byte| **byte > 60).count();
        assert!(bright > 5000, "eye {eye}: the land is in the window, and the panel: {bright}");
        assert!(layered.views[eye].rgba.chunks_exact(4).all(|pixel| pixel == [0, 0, 0, 255]));
        let seen = &in_eyes.views[eye];
        write(&format!("in_the_dark_{eye}"), seen.size, &seen.rgba);
        let wanted = composed(&layered.views[eye], &layered.quads[0]);
        let off = |((light, _), own): (&(Vec3, bool), &[u8])| {
            (0..3).map(|i| (light[i] - f32::from(own[i])).abs()).sum::<f32>() / 3.0
        };
        let sum: f32 = wanted.iter().zip(seen.rgba.chunks_exact(4)).map(off).sum();
        let off = sum / wanted.iter().filter(|(_, on)| *on).count() as f32;
        assert!(off < 1.5, "eye {eye}: {off}");
    }
    shown.into_iter().for_each(|(wearer, ..)| wearer.ends());
}

#[test]
fn it_is_made_before_it_is_first_shown() {
    let shelf: &'static Shelf = Box::leak(Box::default());
    let mut wearer = Wearer::with(headset(), ViewerConfig { shaders: Some(shelf), ..least() }, TOUCH);
    // Nothing that draws it could be made from here on.
    let wrong =
        |name: &'static str| ShaderText { replaces: name, name: name.to_owned(), text: "no".to_owned() };
    shelf.put([wrong("shaders/panels.wgsl"), wrong("shaders/quad.wgsl")].into());
    wearer.open();
    assert_eq!(wearer.viewer().panel_way(), Some(PanelWay::Layer));
    wearer.click(Role::Button, "Faster");
    wearer.ends();
}

#[test]
fn the_way_to_a_place_leads_there_from_another_world_too() {
    let mut wearer = Wearer::new(headset());
    wearer.flying.comfort.settings.fades = false;
    wearer.open();
    let hills = wearer.flying.world.clone();
    let store = wearer.flying.wrist.shelf.store.clone().unwrap();
    wearer.click(Role::Button, "Mark this place");
    wearer.until("it is kept", |_| !store.list().unwrap().bookmarks.is_empty());
    let (marked, name) = (wearer.place_now(), store.list().unwrap().bookmarks.into_keys().next().unwrap());
    wearer.flying.wrist.shelf.enter("canyonlands".to_owned(), hills.clone());
    wearer.until("he is in another world", |wearer| wearer.flying.world.name == "canyonlands");
    // Asked for in the world that he has left meanwhile.
    wearer.flying.wrist.shelf.go(name, hills.clone());
    wearer.until("he is back", |wearer| wearer.flying.world == hills);
    let (level, position) = wearer.place_now();
    assert!(level == marked.0 && position.distance(marked.1) < 1e-6, "{level} {position}");
    wearer.ends();
}

#[test]
fn floating_it_opens_ahead_again_where_the_seat_is_another_one() {
    let mut wearer = Wearer::new(headset());
    wearer.flying.comfort.settings.fades = false;
    wearer.flying.helm.controllers.settings.panel = PanelPlace::Floating;
    let moves = |wearer: &mut Wearer, head: Vec3| {
        wearer.mock.hold_head(MockPose::new(head, Quat::IDENTITY));
        wearer.fly(4);
    };
    let ahead = |head: Vec3| head + Vec3::new(0.0, -0.12, -0.6);
    let shown = |wearer: &Wearer| Some(wearer.mock.take_last_frame()?.quads.first()?.pose.position);
    // In every frame it is where it was or ahead, until it is ahead.
    let until_ahead = |wearer: &mut Wearer, was: Vec3, head: Vec3| {
        assert!(was.distance(ahead(head)) > 0.05, "{was}");
        wearer.until("it is ahead", |wearer| {
            let Some(now) = shown(wearer) else { return false };
            let is_ahead = now.distance(ahead(head)) < 1e-4;
            assert!(is_ahead || now.distance(was) < 1e-4, "{now} is neither at {was} nor ahead of {head}");
            is_ahead
        });
    };
    // Opened beside the seat, it stays there when the head moves on.
    let (first, second, third) =
        (Vec3::new(0.2, 1.6, 0.1), Vec3::new(0.3, 1.5, 0.2), Vec3::new(0.1, 1.4, 0.0));
    moves(&mut wearer, first);
    wearer.open();
    moves(&mut wearer, second);
    let at = wearer.at(Role::Button, "Centre my seat");
    wearer.point(at);
    assert!(shown(&wearer).unwrap().distance(ahead(first)) < 1e-4);
    wearer.pull(1.0);
    wearer.set(1, Action::Dive, 0.0);
    until_ahead(&mut wearer, ahead(first), second);
    // The same where the runtime moves the origin.
    wearer.toggle();
    moves(&mut wearer, third);
    wearer.open();
    moves(&mut wearer, second);
    let beside = Vec3::new(0.5, 0.0, 0.0);
    wearer.mock.recentre(MockPose::new(beside, Quat::IDENTITY));
    until_ahead(&mut wearer, ahead(third), second - beside);
    wearer.ends();
}

static KEPT: Mutex<Vec<(String, Value)>> = Mutex::new(Vec::new());

fn keep(changes: &[(&str, Value)]) -> anyhow::Result<PathBuf> {
    let changes = changes.iter().map(|(name, value)| ((*name).to_owned(), value.clone()));
    KEPT.lock().unwrap().extend(changes);
    Ok(PathBuf::from("nowhere"))
}

#[test]
fn a_slider_on_its_way_stays_where_it_is_when_the_panel_goes() {
    let mut wearer = Wearer::new(headset());
    wearer.flying.wrist.shelf.saver = Some(keep);
    wearer.open();
    let slider = wearer.at(Role::Slider, "Speed");
    wearer.point(slider);
    wearer.pull(1.0);
    wearer.point(slider + egui::vec2(190.0, 0.0));
    let speed = wearer.flying.choices().speed;
    assert!((speed - 8.0).abs() < 1e-3, "{speed}");
    assert_eq!(KEPT.lock().unwrap().len(), 0, "kept on its way");
    wearer.toggle();
    assert!(!wearer.flying.wrist.is_shown());
    wearer.until("it is kept", |_| !KEPT.lock().unwrap().is_empty());
    // Shown again, nothing is held, whether the trigger was let go of meanwhile or is still pulled.
    for trigger in [1.0, 0.0] {
        wearer.set(1, Action::Dive, trigger);
        wearer.open();
        wearer.point(slider);
        wearer.pull(0.0);
        assert!((wearer.flying.choices().speed - speed).abs() < 1e-3, "{trigger}");
        wearer.toggle();
    }
    wearer.ends();
    assert_eq!(*KEPT.lock().unwrap(), [("motion.speed".to_owned(), Value::Float(8.0))]);
}

#[test]
fn it_stays_through_another_session() {
    let mut wearer = Wearer::new(MockConfig { read_back: true, ..headset() });
    wearer.open();
    wearer.page("Comfort");
    wearer.mock.lose_session();
    while wearer.try_frame().is_ok() {}
    let viewer = wearer.viewer.take().unwrap();
    wearer.viewer = Some(wearer.flying.renew(viewer).unwrap());
    wearer.until("it is seen again", |wearer| wearer.viewer().panel_way() == Some(PanelWay::Layer));
    let frame = wearer.seen(1);
    assert_eq!(frame.quads.len(), 1);
    let bright = frame.quads[0].rgba.chunks_exact(4).filter(|p| p[0] > 200 && p[2] > 200).count();
    assert!(bright > 1000, "{bright} bright pixels");
    // On the page that was open.
    wearer.click(Role::RadioButton, "gaze");
    assert!(wearer.flying.choices().fly_by_head);
    wearer.ends();
}

#[test]
fn bare_hands_turn_a_palm_to_see_it() {
    let mut wearer = Wearer::with(headset(), least(), BARE);
    wearer.turn_palm(Vec3::NEG_Z);
    wearer.fly(4);
    assert_eq!(wearer.viewer().has_panel_button(0), Some(false));
    assert!(!wearer.flying.wrist.is_shown());
    // The head is above the hand and behind it.
    wearer.turn_palm(TO_HEAD);
    wearer.until("the palm shows it", |wearer| wearer.flying.wrist.is_shown());
    // Closed it stays so, until the palm is turned to the head another time.
    wearer.click(Role::Button, "Close");
    wearer.fly(20);
    assert!(!wearer.flying.wrist.is_shown());
    wearer.turn_palm(Vec3::NEG_Z);
    wearer.fly(4);
    wearer.turn_palm(TO_HEAD);
    wearer.until("the palm shows it again", |wearer| wearer.flying.wrist.is_shown());
    wearer.turn_palm(Vec3::NEG_Z);
    wearer.until("it is gone", |wearer| !wearer.flying.wrist.is_shown());
    wearer.ends();
}

#[test]
fn bare_hands_that_are_known_by_their_joints_do_the_same() {
    let absent_extensions = vec!["XR_EXT_hand_interaction".to_owned()];
    let mut wearer = Wearer::with(MockConfig { absent_extensions, ..headset() }, least(), TOUCH);
    wearer.turn_palm(TO_HEAD);
    wearer.fly(4);
    assert!(!wearer.flying.wrist.is_shown(), "a controller has a button for it");
    for hand in HANDS {
        wearer.mock.disconnect(hand).unwrap();
        wearer.mock.show_hand(hand, true).unwrap();
    }
    wearer.until("the palm shows it", |wearer| wearer.flying.wrist.is_shown());
    wearer.turn_palm(-TO_HEAD);
    wearer.until("it is gone", |wearer| !wearer.flying.wrist.is_shown());
    wearer.turn_palm(TO_HEAD);
    wearer.until("the palm shows it again", |wearer| wearer.flying.wrist.is_shown());
    wearer.mock.show_hand(HANDS[0], false).unwrap();
    wearer.until("the hand is gone, and it", |wearer| !wearer.flying.wrist.is_shown());
    wearer.ends();
}

/// Pictures of every page, with as many pixels as for a usual headset, and how it looks in there.
#[test]
fn its_pictures_are_left_to_be_looked_at() {
    // The panel has the pixels that the headset recommends; the land may be small.
    let config = MockConfig { eye_size: [2064, 2208], read_back: true, ..headset() };
    let viewer = ViewerConfig { eye_size: Some([64, 64]), ..least() };
    let mut wearer = Wearer::with(config, viewer, TOUCH);
    wearer.open();
    let store = wearer.flying.wrist.shelf.store.clone().unwrap();
    for i in 1..=3 {
        wearer.click(Role::Button, "Mark this place");
        wearer.until("it is kept", |_| store.list().unwrap().bookmarks.len() == i);
    }
    for (page, name) in [
        ("Fly", "fly"),
        ("Places", "places"),
        ("Worlds", "worlds"),
        ("Comfort", "comfort"),
        ("?", "controls"),
    ] {
        wearer.page(page);
        wearer.point(pos2(470.0, 330.0));
        let frame = wearer.seen(30);
        let quad = &frame.quads[0];
        assert_eq!(quad.pixels, [1080, 900], "one and a half pixels of a point");
        write(&format!("page_{name}"), quad.pixels, &quad.rgba);
        if page == "Fly" {
            // Before a grey sky, with the display's own pixels.
            let size = [2064, 2208];
            let rgba = [118, 130, 150, 255].repeat(2064 * 2208);
            let view = SubmittedView { size, rgba, ..frame.views[0].clone() };
            let seen = composed(&view, quad).into_iter().flat_map(|(light, _)| {
                let [r, g, b] = light.to_array().map(|v| v.round() as u8);
                [r, g, b, 255]
            });
            write("in_headset", size, &seen.collect::<Vec<u8>>());
        }
    }
    wearer.ends();
}
