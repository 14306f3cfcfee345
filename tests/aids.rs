//! What is drawn over the land is where its geometry says, for both eyes, before hills and behind them; where there is
//! nothing, nothing is drawn.
//!
//! `AIDS_PICTURES=folder cargo test --release --test aids` keeps large pictures of it all.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

#[path = "support/studio.rs"]
mod studio;

use std::path::PathBuf;

use ash::vk;
use fathomless::aids::{Aids, HandAid};
use fathomless::bindings::{self, BUILT_IN, HANDS};
use fathomless::course::Course;
use fathomless::governor::Dials;
use fathomless::mock::{
    Clock, Fov, Mock, MockConfig, Pose as MockPose, PoseTrack, SubmittedFrame, SubmittedView,
};
use fathomless::picture::{self, Pixels};
use fathomless::rig::Pose;
use fathomless::viewer::{Viewer, ViewerConfig};
use fathomless::world::World;
use glam::{Quat, Vec3};
use studio::{Camera, NEAR_M, Setup, Studio, pose};

const FOV: Fov = Fov { left: -0.75, right: 0.75, up: 0.75, down: -0.75 };

/// A change of a channel that an eye sees.
const SEEN: u8 = 16;

fn headset(size: u32) -> MockConfig {
    MockConfig {
        clock: Clock::Stepped { hz: 90.0 },
        eye_size: [size; 2],
        fov: [FOV; 2],
        read_back: true,
        ..MockConfig::default()
    }
}

fn open(headset: MockConfig, config: &ViewerConfig) -> Studio {
    let mock = Mock::new(headset);
    let world = World::load("hills").unwrap();
    let course = Course::new(world.surface, 20, 0.0, |_| ());
    let config = ViewerConfig { validate: true, ..*config };
    let viewer = Viewer::on_mock(&world, &config, mock.clone()).unwrap_or_else(|e| panic!("{e:#}"));
    Studio { viewer, mock, course }
}

/// Over the hills, looking down a little.
fn at() -> fathomless::flight::FlightPose {
    pose(0.0, 2.4, -12.0, 20.0)
}

impl Studio {
    fn with(&mut self, aids: &Aids) -> SubmittedFrame {
        self.viewer.set_aids(aids);
        self.shoot(&at())
    }

    fn cameras(&mut self, frame: &SubmittedFrame) -> [Camera; 2] {
        Camera::both(frame, self.course.at(&at()).orientation)
    }

    /// A point of the play space over the scene: the seat is where the head is.
    fn scene(&mut self, play: Vec3) -> Vec3 {
        self.course.at(&at()).orientation * play
    }
}

/// A hand that points ahead and down, a little inwards.
fn hand(side: usize, ray_m: Option<f32>, holds: bool) -> HandAid {
    let x = [-0.18, 0.18][side];
    let inwards = Quat::from_rotation_y([-0.06, 0.1][side]);
    let orientation = inwards * Quat::from_rotation_x(0.6);
    let grip = Pose { position: Vec3::new(x, -0.22, -0.42), orientation };
    let position = grip.position + grip.orientation * Vec3::new(0.0, 0.01, -0.06);
    let aim = Some(Pose { position, orientation: inwards * Quat::from_rotation_x(-0.3) });
    HandAid { grip, aim, ray_m, holds }
}

fn arc(lands: bool) -> Aids {
    let mut aids = Aids { arc_lands: lands, ..Aids::default() };
    let from = hand(1, None, false).aim.unwrap().position;
    for i in 0..20 {
        let t = i as f32 / 19.0;
        aids.arc.push(from + t * Vec3::new(-0.6, 0.9, -4.0) + t * t * Vec3::new(0.0, -2.2, 0.0));
    }
    aids
}

fn thread(way: impl Iterator<Item = Vec3>) -> Aids {
    let mut aids = Aids::default();
    way.for_each(|point| aids.thread.push(point));
    aids
}

fn grid(strength: f32) -> Aids {
    Aids { grid: strength, floor_m: 1.0, ..Aids::default() }
}

/// How much a pixel differs, in its most different channel.
fn change(bare: &SubmittedView, view: &SubmittedView, x: u32, y: u32) -> u8 {
    let at = 4 * (y * view.size[0] + x) as usize;
    (0..3).map(|c| bare.rgba[at + c].abs_diff(view.rgba[at + c])).max().unwrap()
}

fn depth(view: &SubmittedView, x: u32, y: u32) -> f32 {
    studio::depth_at(view, x, y)
}

/// A point that is expected to be seen, and how far around it something may be drawn, in metres.
type Expected = (Vec3, f32);

/// What became of the expected points: seen before the land, and hidden by it; the mean change of each.
#[derive(Debug, Default)]
struct Tally {
    seen: usize,
    hidden: usize,
    seen_change: f64,
    hidden_change: f64,
}

/// Every expected point before the land is seen, in each eye where that eye has it, and nothing is drawn elsewhere.
fn assert_drawn_there(
    studio: &mut Studio,
    what: &str,
    [bare, frame]: [&SubmittedFrame; 2],
    expected: &[Expected],
) -> Tally {
    let cameras = studio.cameras(frame);
    let points: Vec<Expected> =
        expected.iter().map(|(point, radius)| (studio.scene(*point), *radius)).collect();
    let mut tally = Tally::default();
    for (eye, camera) in cameras.iter().enumerate() {
        let (bare, view) = (&bare.views[eye], &frame.views[eye]);
        let [width, height] = view.size;
        let per_tangent = width as f32 / (2.0 * FOV.right.tan());
        let projected: Vec<_> = points
            .iter()
            .filter_map(|(p, radius)| {
                camera.project(*p).map(|(x, y, deep)| (x, y, deep, radius / deep * per_tangent))
            })
            .collect();
        let inside =
            |x: f32, y: f32| x >= 2.0 && y >= 2.0 && x < width as f32 - 2.0 && y < height as f32 - 2.0;
        for &(x, y, deep, _) in projected.iter().filter(|(x, y, ..)| inside(*x, *y)) {
            let (px, py) = (x as u32, y as u32);
            let around = (0..9).map(|i| (px + i % 3 - 1, py + i / 3 - 1));
            let most = around.clone().map(|(x, y)| change(bare, view, x, y)).max().unwrap();
            // Reversed depth; nearly as far as the land is neither before it nor behind it.
            let before = around.clone().map(|(x, y)| depth(bare, x, y)).fold(0.0, f32::max);
            let behind = around.map(|(x, y)| depth(bare, x, y)).fold(1.0, f32::min);
            let own = NEAR_M / deep;
            if own > 1.05 * before {
                assert!(
                    most >= SEEN,
                    "{what}, eye {eye}: nothing is seen at {x:.1} {y:.1}, {deep:.2} m deep"
                );
                (tally.seen, tally.seen_change) = (tally.seen + 1, tally.seen_change + f64::from(most));
            } else if own < 0.95 * behind {
                (tally.hidden, tally.hidden_change) =
                    (tally.hidden + 1, tally.hidden_change + f64::from(most));
            }
        }
        for y in 0..height {
            for x in 0..width {
                let near = |p: &(f32, f32, f32, f32)| {
                    (p.0 - x as f32 - 0.5).hypot(p.1 - y as f32 - 0.5) <= p.3 + 4.0
                };
                let drawn = change(bare, view, x, y) > 2;
                assert!(
                    !drawn || projected.iter().any(near),
                    "{what}, eye {eye}: something is drawn at {x} {y}"
                );
            }
        }
    }
    tally.seen_change /= tally.seen.max(1) as f64;
    tally.hidden_change /= tally.hidden.max(1) as f64;
    tally
}

/// Points along a way, close together.
fn along(way: &[Vec3], radius: f32) -> Vec<Expected> {
    let part = |pair: &[Vec3]| {
        let [a, b] = [pair[0], pair[1]];
        (0..24).map(move |i| (a.lerp(b, i as f32 / 24.0), radius)).collect::<Vec<_>>()
    };
    way.windows(2).flat_map(part).collect()
}

#[test]
fn each_thing_is_where_its_geometry_says_in_both_eyes() {
    for multiview in [true, false] {
        let mut studio = open(headset(256), &ViewerConfig { multiview, ..ViewerConfig::default() });
        let bare = studio.with(&Aids::default());

        let shown = hand(0, None, false);
        let hands = studio.with(&Aids { hands: [Some(shown), None], ..Aids::default() });
        let handle = [0.0, 0.02].map(|z| shown.grip.position + shown.grip.orientation * (z * Vec3::Z));
        let expected: Vec<_> = handle.iter().map(|p| (*p, 0.14)).collect();
        let tally = assert_drawn_there(&mut studio, "a hand", [&bare, &hands], &expected);
        assert_eq!(tally.seen, 4, "{tally:?}");
        // It has its own depth: the handle's surface is before its middle.
        let (grip, cameras) = (studio.scene(shown.grip.position), studio.cameras(&hands));
        for (camera, view) in cameras.iter().zip(&hands.views) {
            let (x, y, deep) = camera.project(grip).unwrap();
            let surface = NEAR_M / depth(view, x as u32, y as u32);
            assert!((deep - surface - 0.015).abs() < 0.008, "{surface} m and not {deep} m");
        }

        let ray_only =
            Aids { hands: [None, Some(hand(1, Some(2.5), false))], no_models: true, ..Aids::default() };
        let ray = studio.with(&ray_only);
        let (from, direction) = hand(1, None, false).ray().unwrap();
        let mut expected = along(&[from, from + 2.5 * direction], 0.012);
        expected.push((from + 2.5 * direction, 0.03));
        let tally = assert_drawn_there(&mut studio, "a ray", [&bare, &ray], &expected);
        assert!(tally.seen > 30, "{tally:?}");

        let holding = [0, 1].map(|side| HandAid {
            grip: Pose { position: Vec3::new([-0.2, 0.2][side], -0.15, -0.6), ..hand(side, None, true).grip },
            ..hand(side, None, true)
        });
        let both = Aids { hands: holding.map(Some), no_models: true, ..Aids::default() };
        let held = studio.with(&both);
        let ends = holding.map(|hand| hand.grip.position);
        let middle = (ends[0] + ends[1]) / 2.0;
        let mut expected = along(&ends, 0.01);
        expected.push((middle, 0.03));
        assert_drawn_there(&mut studio, "what is held", [&bare, &held], &expected);
        // The same to both sides of its middle, which is where each eye has it.
        let (middle, cameras) = (studio.scene(middle), studio.cameras(&held));
        for (eye, camera) in cameras.iter().enumerate() {
            let (x, y, _) = camera.project(middle).unwrap();
            let [mut sum, mut count] = [0.0, 0.0];
            for (px, py) in (0..256).flat_map(|py| (0..256).map(move |px| (px, py))) {
                let drawn = change(&bare.views[eye], &held.views[eye], px, py) >= SEEN;
                let beside = (px as f32 + 0.5 - x).abs() < 12.0 && (py as f32 + 0.5 - y).abs() < 12.0;
                if drawn && beside {
                    (sum, count) = (sum + px as f32 + 0.5, count + 1.0);
                }
            }
            assert!((sum / count - x).abs() < 0.75, "eye {eye}: the mark is at {} and not {x}", sum / count);
        }

        for lands in [true, false] {
            let aids = arc(lands);
            let shown = studio.with(&aids);
            let way = aids.arc.as_slice();
            let mut allowed: Vec<Expected> = Vec::new();
            // What cannot be stood on is a broken line: its gaps are not for us to know.
            if lands {
                allowed.extend(along(way, 0.03));
                let end = *way.last().unwrap() + 0.03 * Vec3::Y;
                let ring = (0..48).map(|i| {
                    let (sin, cos) = (i as f32 / 48.0 * std::f32::consts::TAU).sin_cos();
                    (end + 0.3 * Vec3::new(sin, 0.0, cos), 0.35)
                });
                allowed.extend(ring);
                let tally = assert_drawn_there(&mut studio, "the arc", [&bare, &shown], &allowed);
                assert!(tally.seen > 200, "{tally:?}");
            } else {
                let cyan = |view: &SubmittedView| {
                    let changed =
                        view.rgba.chunks(4).zip(bare.views[0].rgba.chunks(4)).filter(|(a, b)| a != b);
                    changed.filter(|(a, _)| a[0] < 100 && a[1] > 150).count()
                };
                assert_eq!(cyan(&shown.views[0]), 0, "it says that one can stand there");
            }
        }

        let aids = thread((0..20).map(|i| {
            let far = 1.5 * 1.25f32.powi(i);
            Vec3::new(0.3 * far, 0.25 * far - 0.4, -far)
        }));
        let shown = studio.with(&aids);
        let way: Vec<Expected> = along(aids.thread.as_slice(), 0.03);
        let tally = assert_drawn_there(&mut studio, "the thread", [&bare, &shown], &way);
        assert!(tally.seen > 100, "{tally:?}");

        let shown = studio.with(&grid(1.0));
        let floor = (-2..=2).flat_map(|x| (1..=2).map(move |z| Vec3::new(x as f32, -1.0, -(z as f32))));
        let cameras = studio.cameras(&shown);
        for point in floor.chain([Vec3::new(0.0, 0.1, -4.0), Vec3::new(0.0, -0.1, -4.0)]) {
            let point = studio.scene(point);
            for (eye, camera) in cameras.iter().enumerate() {
                let Some((x, y, deep)) = camera.project(point) else { continue };
                if !(2.0..254.0).contains(&x) || !(2.0..254.0).contains(&y) {
                    continue;
                }
                let (px, py) = (x as u32, y as u32);
                let around = || (0..9).map(|i| (px + i % 3 - 1, py + i / 3 - 1));
                let most =
                    around().map(|(x, y)| change(&bare.views[eye], &shown.views[eye], x, y)).max().unwrap();
                let land = around().map(|(x, y)| depth(&bare.views[eye], x, y)).fold(0.0, f32::max);
                assert!(NEAR_M / deep < land || most >= SEEN, "no line of the grid at {x} {y}: {most}");
            }
        }
        studio.close();
    }
}

#[test]
fn what_is_behind_the_land_is_hidden_and_ways_shine_through_a_little() {
    let mut studio = open(headset(192), &ViewerConfig::default());
    let bare = studio.with(&Aids::default());
    // Under the ground.
    let grip = Pose { position: Vec3::new(0.0, -6.0, -9.0), orientation: Quat::IDENTITY };
    let buried = HandAid { grip, aim: None, ray_m: None, holds: true };
    let hidden = studio.with(&Aids { hands: [Some(buried), None], ..Aids::default() });
    assert_eq!(hidden.views[0].rgba, bare.views[0].rgba);
    assert_eq!(hidden.views[1].rgba, bare.views[1].rgba);

    // Into the ground, and on beneath it.
    let aids = thread((0..12).map(|i| Vec3::new(0.2, -0.4 - 0.35 * i as f32, -1.5 - 0.4 * i as f32)));
    let shown = studio.with(&aids);
    let way = along(aids.thread.as_slice(), 0.03);
    let tally = assert_drawn_there(&mut studio, "the thread", [&bare, &shown], &way);
    assert!(tally.seen > 20 && tally.hidden > 20, "{tally:?}");
    assert!(tally.hidden_change > 2.0 && tally.hidden_change < 0.6 * tally.seen_change, "{tally:?}");
    studio.close();
}

#[test]
fn nothing_costs_nothing() {
    for multiview in [true, false] {
        let mut studio = open(headset(64), &ViewerConfig { multiview, ..ViewerConfig::default() });
        studio.shoot(&at());
        let never = studio.shoot(&at());
        let usual = studio.viewer.stats().work.draws;
        let none = studio.with(&Aids::default());
        assert_eq!(studio.viewer.stats().work.draws, usual);
        assert_eq!(none.views[0].rgba, never.views[0].rgba);
        studio.with(&grid(0.5));
        let passes = if studio.viewer.session_info().multiview { 1 } else { 2 };
        assert_eq!(studio.viewer.stats().work.draws, usual + 3 * passes, "lines are drawn in three draws");
        let hands = [0, 1].map(|side| Some(hand(side, Some(2.0), false)));
        studio.with(&Aids { hands, ..Aids::default() });
        assert_eq!(studio.viewer.stats().work.draws, usual + 4 * passes, "solids in one");
        // What was there once costs nothing once it is gone.
        studio.with(&Aids { no_models: true, ..Aids::default() });
        assert_eq!(studio.viewer.stats().work.draws, usual);
        studio.close();
    }
}

/// All of it at once.
fn everything() -> Aids {
    let hands = [0, 1].map(|side| Some(hand(side, Some(3.0), true)));
    let thread = thread((0..20).map(|i| Vec3::new(-0.5, 0.1 * i as f32, -1.5 - i as f32))).thread;
    Aids { hands, thread, grid: 0.7, floor_m: 1.0, ..arc(true) }
}

#[test]
fn every_kind_of_target_takes_it() {
    let aids = everything();
    let mut srgb = open(headset(128), &ViewerConfig::default());
    srgb.shoot(&at());
    let expected = srgb.with(&aids);
    srgb.close();

    // A target that does not encode sRGB by itself. Edges are blended otherwise there, as everywhere.
    let unorm =
        MockConfig { formats: vec![vk::Format::R8G8B8A8_UNORM, vk::Format::D32_SFLOAT], ..headset(128) };
    let mut studio = open(unorm, &ViewerConfig::default());
    assert!(studio.viewer.session_info().encode_srgb);
    studio.shoot(&at());
    let shown = studio.with(&aids);
    let differences =
        shown.views[0].rgba.iter().zip(&expected.views[0].rgba).map(|(a, b)| f64::from(a.abs_diff(*b)));
    let mean = differences.sum::<f64>() / shown.views[0].rgba.len() as f64;
    assert!(mean < 2.0, "{mean} apart");
    studio.close();

    // A part of the picture: lines are no thinner than its pixels.
    let mut studio = open(headset(128), &ViewerConfig::default());
    let dials = studio.viewer.dials();
    studio.viewer.set_dials(Dials { scale: 0.5, ..dials });
    studio.shoot(&at());
    let bare = studio.with(&Aids::default());
    let shown = studio.with(&grid(1.0));
    assert_eq!(shown.views[0].size, [64, 64]);
    let changed = |y: u32| (0..64).filter(|x| change(&bare.views[0], &shown.views[0], *x, y) >= SEEN).count();
    assert!((0..64).any(|y| changed(y) > 56), "the horizon has gaps");
    studio.close();

    // Without what is behind the land, in this picture, and without what lenses hide.
    let config = ViewerConfig { backdrop_layer: true, mask: true, ..ViewerConfig::default() };
    let mut studio = open(headset(128), &config);
    assert!(studio.viewer.backdrop_layer().is_some());
    studio.shoot(&at());
    let up = Aids { hands: [0, 1].map(|side| Some(hand(side, None, false))), ..grid(1.0) };
    let sky = pose(0.0, 2.4, 80.0, 20.0);
    studio.viewer.set_aids(&Aids::default());
    let bare = studio.shoot(&sky);
    studio.viewer.set_aids(&up);
    let shown = studio.shoot(&sky);
    let texels =
        |frame: &SubmittedFrame| frame.views[0].rgba.chunks(4).map(<[u8]>::to_vec).collect::<Vec<_>>();
    let open_before = texels(&bare).iter().zip(texels(&shown)).filter(|(a, b)| a[3] == 0 && b[3] > 0).count();
    let opaque = texels(&bare).iter().zip(texels(&shown)).filter(|(a, b)| a[3] == 0 && b[3] >= 200).count();
    assert!(
        open_before > 40 && opaque > 100,
        "{open_before} texels over the open sky, {opaque} of them solid"
    );
    // The colour is multiplied by it: no channel is above it in linear light, and so neither as stored.
    assert!(texels(&shown).iter().all(|t| {
        t[..3].iter().all(|c| fathomless::world::linear_from_srgb(*c) <= f32::from(t[3]) / 255.0 + 0.02)
    }));
    studio.close();
}

#[test]
fn hands_are_drawn_where_they_are_in_this_frame() {
    let bindings = bindings::parse("config/bindings.toml", BUILT_IN, false).unwrap().leak();
    let mut studio =
        open(headset(128), &ViewerConfig { bindings: Some(bindings), ..ViewerConfig::default() });
    for hand in HANDS {
        studio.mock.connect(hand, "/interaction_profiles/oculus/touch_controller").unwrap();
    }
    // From the seat, which is where the head is: 1.6 m above the floor.
    let place = |studio: &Studio, x: f32| {
        for kind in ["grip", "aim"] {
            let pose = MockPose { position: Vec3::new(x, 1.6 - 0.1, -0.6), orientation: Quat::IDENTITY };
            let path = format!("{}/input/{kind}/pose", HANDS[1]);
            studio.mock.set_pose_track(&path, PoseTrack::fixed(pose)).unwrap();
        }
    };
    place(&studio, -0.2);
    (0..12).for_each(|_| drop(studio.shoot(&at())));
    let bare = studio.shoot(&at());
    let hands = studio.viewer.hands().hands;
    let seen = hands.map(|hand| Some(HandAid { grip: hand.grip?, aim: hand.aim, ray_m: None, holds: false }));
    let aids = Aids { hands: seen, ..Aids::default() };
    let before = aids.hands[1].expect("the hand is seen");
    assert!((before.grip.position - Vec3::new(-0.2, -0.1, -0.6)).length() < 1e-3, "{before:?}");
    // It moves, after what is drawn was said.
    place(&studio, 0.2);
    let shown = studio.with(&aids);
    let expected = [(Vec3::new(0.2, -0.1, -0.6), 0.14)];
    let mut allowed = expected.to_vec();
    // The other hand, which is where the mock has it.
    allowed.extend(aids.hands[0].map(|hand| (hand.grip.position, 0.2)));
    let tally = assert_drawn_there(&mut studio, "the hand", [&bare, &shown], &allowed);
    assert!(tally.seen >= 2, "{tally:?}");
    studio.close();
}

/// Both eyes beside each other, where pictures are wanted.
fn keep(frame: &SubmittedFrame, name: &str) {
    let Some(folder) = std::env::var_os("AIDS_PICTURES").map(PathBuf::from) else { return };
    std::fs::create_dir_all(&folder).unwrap();
    let [width, height] = frame.views[0].size;
    let mut pixels = Vec::new();
    for y in 0..height {
        for view in &frame.views {
            let row = &view.rgba[(y * width * 4) as usize..((y + 1) * width * 4) as usize];
            pixels.extend(row.chunks(4).flat_map(|texel| [texel[0], texel[1], texel[2]]));
        }
    }
    let path = folder.join(format!("{name}.png"));
    picture::write(&path, [2 * width, height], Pixels::Rgb8(&pixels), &[]).unwrap();
}

#[test]
fn all_of_it_is_seen_in_every_world() {
    let size = if std::env::var_os("AIDS_PICTURES").is_some() { [640; 2] } else { [96; 2] };
    for world in ["hills", "canyonlands"] {
        let mut studio = Studio::open(&Setup { world, size, fov: [FOV; 2], depth: 20, ..Setup::default() });
        let bare = studio.shoot(&at());
        let mut shoot = |name: &str, aids: &Aids| {
            let frame = studio.with(aids);
            keep(&frame, &format!("{world}_{name}"));
            for eye in 0..2 {
                let changed = (0..size[0] * size[1]).filter(|i| {
                    change(&bare.views[eye], &frame.views[eye], i % size[0], i / size[0]) >= SEEN
                });
                assert!(changed.count() > 20, "{name} in {world}: eye {eye} does not see it");
            }
        };
        let hands =
            |ray, holds| Aids { hands: [0, 1].map(|side| Some(hand(side, ray, holds))), ..Aids::default() };
        shoot("hands", &hands(Some(4.0), false));
        shoot("grab", &hands(None, true));
        for lands in [true, false] {
            let hands = [None, Some(hand(1, None, false))];
            shoot(if lands { "arc" } else { "arc_falls" }, &Aids { hands, ..arc(lands) });
        }
        shoot(
            "thread",
            &thread((0..24).map(|i| {
                let far = 1.5f32.powi(i) * 0.5;
                Vec3::new((i as f32 * 0.5).sin() * 0.2 * far, -0.5 + 0.12 * far, -far)
            })),
        );
        shoot("grid", &Aids { floor_m: 1.6, ..grid(1.0) });
        shoot("everything", &everything());
        studio.close();
    }
}
