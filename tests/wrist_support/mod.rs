//! A wearer with a panel, on a mock headset with scripted controllers or bare hands; and what a compositor makes of its layer.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests stop at the first surprise")]

mod controls;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use egui::accesskit::{Node, Role};
use egui::{Pos2, pos2};
use fathomless::aids::PanelAid;
use fathomless::bindings::{Action, HANDS, ProfileBindings};
use fathomless::bookmarks::Store;
use fathomless::controllers::Controllers;
use fathomless::course::Course;
use fathomless::flight::Flight;
use fathomless::flying::{Flying, Headset};
use fathomless::helm::Helm;
use fathomless::mock::{
    Mock, MockConfig, Pose as MockPose, PoseTrack, SubmittedFrame, SubmittedQuad, SubmittedView,
};
use fathomless::panels::wrist::SIZE;
use fathomless::picture::{self, Pixels};
use fathomless::pilot::MotionSettings;
use fathomless::supervisor::{Stage, Venue};
use fathomless::viewer::{Step, ViewerConfig};
use fathomless::world::{World, linear_from_srgb};
use fathomless::{at, viewer};
use glam::{Quat, Vec2, Vec3};

use crate::life::{assert_clean, least};
use crate::wearer::{built_in, input_of, paths};

pub const TOUCH: &str = "/interaction_profiles/oculus/touch_controller";
pub const BARE: &str = "/interaction_profiles/ext/hand_interaction_ext";

/// Frames until the mock's session has the focus, with room to spare.
const SETTLED: usize = 12;

/// Within this, everything happens that is waited for; it is only ever waited for by a test that fails.
const SOON: Duration = Duration::from_secs(60);

/// The hand that points, in the room.
pub const MAIN: Vec3 = Vec3::new(0.25, 1.25, -0.1);

/// The wrist: ahead, and a little to the left.
pub const WRIST: Vec3 = Vec3::new(-0.12, 1.32, -0.36);

/// From there to the head.
pub const TO_HEAD: Vec3 = Vec3::new(0.12, 0.28, 0.36);

fn folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("wrist");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// A flight whose wearer has controllers, and a panel.
pub struct Wearer {
    pub mock: Mock,
    pub flying: Flying<'static>,
    pub viewer: Option<viewer::Viewer>,
    /// Frames in which the hand only goes somewhere are not drawn.
    pub is_brief: bool,
    flown: Duration,
    profile: &'static ProfileBindings,
    /// Labels of what was clicked.
    clicked: BTreeSet<String>,
    _bookmarks: tempfile::TempDir,
}

impl Wearer {
    pub fn new(config: MockConfig) -> Wearer {
        Wearer::with(config, least(), TOUCH)
    }

    pub fn with(config: MockConfig, viewer: ViewerConfig, profile: &str) -> Wearer {
        let world = World::load("hills").unwrap();
        let flight: &'static Flight = Box::leak(Box::new(Flight::load("still").unwrap()));
        let bindings: &'static [ProfileBindings] = built_in(false).leak();
        let held = bindings.iter().find(|it| it.profile == profile).unwrap();
        let mock = Mock::new(config);
        let viewer = ViewerConfig { bindings: Some(bindings), validate: true, ..viewer };
        let course = Course::new(world.surface, 3, 1.0, |_| ());
        let mut flying = Flying::new(&world, flight, course, viewer, Headset::Mock(mock.clone()));
        let start = at::stand(&world, 3, None);
        let motion = MotionSettings { inertia_s: 0.0, ..MotionSettings::default() };
        flying.helm = Helm::new(start.clone(), &motion, Controllers::default());
        flying.helm.take(&start);
        let bookmarks = tempfile::tempdir().unwrap();
        flying.wrist.shelf.store = Some(Store::at(bookmarks.path()));
        flying.wrist.panel().context().enable_accesskit();
        let opened = flying.open(Venue::Headset).unwrap();
        let mut wearer = Wearer {
            mock,
            flying,
            viewer: Some(opened),
            is_brief: false,
            flown: Duration::ZERO,
            profile: held,
            clicked: BTreeSet::new(),
            _bookmarks: bookmarks,
        };
        for hand in HANDS {
            wearer.mock.connect(hand, profile).unwrap();
        }
        wearer.place(HANDS[0], "grip", WRIST, Quat::IDENTITY);
        wearer.place(HANDS[0], "aim", WRIST, Quat::IDENTITY);
        wearer.place(HANDS[1], "grip", MAIN, Quat::IDENTITY);
        // At nothing: ahead and down.
        wearer.place(HANDS[1], "aim", MAIN, Quat::from_rotation_x(-0.8));
        wearer.fly(SETTLED);
        wearer
    }

    pub fn place(&self, hand: &str, what: &str, position: Vec3, orientation: Quat) {
        let pose = PoseTrack::fixed(MockPose::new(position, orientation));
        self.mock.set_pose_track(&format!("{hand}/input/{what}/pose"), pose).unwrap();
    }

    pub fn viewer(&mut self) -> &mut viewer::Viewer {
        self.viewer.as_mut().unwrap()
    }

    pub fn try_frame(&mut self) -> anyhow::Result<Step> {
        self.flown += Duration::from_millis(11);
        self.flying.frame(self.viewer.as_mut().unwrap(), self.flown)
    }

    pub fn fly(&mut self, frames: usize) {
        for _ in 0..frames {
            assert_ne!(self.try_frame().unwrap(), Step::Exited);
        }
    }

    /// Flies on until it is so.
    pub fn until(&mut self, what: &str, mut is: impl FnMut(&mut Wearer) -> bool) {
        let begun = Instant::now();
        while !is(self) {
            assert!(begun.elapsed() < SOON, "never: {what}");
            self.fly(1);
        }
    }

    /// The last of these frames, with what the runtime got.
    pub fn seen(&mut self, frames: usize) -> SubmittedFrame {
        self.fly(frames);
        self.mock.take_last_frame().unwrap()
    }

    /// Moves the inputs by so much with which a hand does something: 0 is the left one. False: its controller has none.
    pub fn set(&self, hand: usize, action: Action, value: f32) -> bool {
        let (paths, kind) = paths(self.profile, action);
        let own: Vec<&str> = paths.into_iter().filter(|path| path.starts_with(HANDS[hand])).collect();
        own.iter().for_each(|path| self.mock.set_input(path, input_of(kind, value)).unwrap());
        !own.is_empty()
    }

    /// Presses the panel's button for some frames, and lets it go.
    pub fn toggle(&mut self) {
        assert!(self.set(0, Action::Panel, 1.0), "{} has no button for it", self.profile.profile);
        self.fly(3);
        self.set(0, Action::Panel, 0.0);
        self.fly(3);
    }

    /// Turns the palm of the left hand this way.
    pub fn turn_palm(&self, to: Vec3) {
        self.place(HANDS[0], "grip", WRIST, Quat::from_rotation_arc(Vec3::X, to.normalize()));
    }

    /// Shows the panel: with the button for it, or with the palm.
    pub fn open(&mut self) {
        if paths(self.profile, Action::Panel).0.is_empty() {
            self.turn_palm(TO_HEAD);
            self.until("the palm shows it", |wearer| wearer.flying.wrist.is_shown());
        } else {
            self.toggle();
        }
        assert!(self.flying.wrist.is_shown());
        self.rest();
    }

    /// Does what `hand` says in frames that are not drawn, where that is to be [brief](Wearer::is_brief).
    fn briefly(&mut self, hand: impl FnOnce(&mut Wearer)) {
        self.mock.set_should_render(self.is_brief.then_some(false));
        hand(self);
        self.mock.set_should_render(None);
    }

    /// Flies on until the panel has come to rest: it glides after the hand.
    pub fn rest(&mut self) {
        let mut before = None;
        self.briefly(|wearer| {
            wearer.until("the panel has come to rest", |wearer| {
                let now = wearer.flying.wrist.aid().copied();
                let rests = before == now;
                before = now;
                rests
            });
        });
    }

    pub fn pull(&mut self, trigger: f32) {
        self.set(1, Action::Dive, trigger);
        self.fly(4);
    }

    /// A point of the panel in the room, by its points.
    pub fn in_room(&mut self, at: Pos2) -> Vec3 {
        let seat = self.seat();
        let aid = *self.flying.wrist.aid().unwrap();
        let share = Vec2::new(at.x / SIZE[0] - 0.5, 0.5 - at.y / SIZE[1]);
        seat + aid.pose.position + aid.pose.orientation * (share * Vec2::from(aid.size_m)).extend(0.0)
    }

    /// Where the runtime's space has the seat: what the eyes are shown from, less where they are from the seat.
    pub fn seat(&mut self) -> Vec3 {
        self.mock.take_frames();
        self.fly(1);
        let frame = self.mock.take_last_frame().unwrap();
        frame.views[0].pose.position - self.viewer().eye(0).unwrap().pose.position
    }

    pub fn aim_at(&mut self, target: Vec3) {
        let direction = (target - MAIN).normalize();
        self.place(HANDS[1], "aim", MAIN, Quat::from_rotation_arc(Vec3::NEG_Z, direction));
        self.fly(4);
    }

    pub fn point(&mut self, at: Pos2) {
        self.rest();
        let target = self.in_room(at);
        self.aim_at(target);
    }

    /// Where something lies that can be clicked.
    pub fn find(&self, role: Role, label: &str) -> Option<Pos2> {
        let output = self.flying.wrist.panel().output();
        let nodes = output.accesskit_update.iter().flat_map(|update| &update.nodes);
        let is = |node: &&Node| node.label() == Some(label) && node.role() == role;
        let bounds = nodes.map(|(_, node)| node).filter(is).filter_map(Node::bounds).next()?;
        Some(pos2((0.5 * (bounds.x0 + bounds.x1)) as f32, (0.5 * (bounds.y0 + bounds.y1)) as f32))
    }

    /// Labels of what can be clicked now.
    pub fn controls(&self) -> Vec<String> {
        let output = self.flying.wrist.panel().output();
        let nodes = output.accesskit_update.iter().flat_map(|update| &update.nodes).map(|(_, node)| node);
        let is = |node: &&Node| matches!(node.role(), Role::Button | Role::RadioButton | Role::Slider);
        nodes.filter(is).map(|node| node.label().unwrap().to_owned()).collect()
    }

    pub fn at(&mut self, role: Role, label: &str) -> Pos2 {
        self.until(label, |wearer| wearer.find(role, label).is_some());
        self.find(role, label).unwrap()
    }

    /// Points at it, pulls the trigger and lets it go.
    pub fn click_at(&mut self, at: Pos2) {
        self.rest();
        let target = self.in_room(at);
        self.briefly(|wearer| {
            wearer.aim_at(target);
            assert!(wearer.flying.wrist.occupied()[1], "{at:?} is not pointed at");
            wearer.pull(1.0);
            wearer.pull(0.0);
        });
    }

    pub fn click(&mut self, role: Role, label: &str) {
        let at = self.at(role, label);
        self.click_at(at);
        self.clicked.insert(label.to_owned());
    }

    pub fn page(&mut self, name: &str) {
        self.click(Role::RadioButton, name);
        self.fly(2);
    }

    pub fn place_now(&self) -> (usize, glam::DVec3) {
        let standpoint = self.flying.helm.standpoint().unwrap();
        (standpoint.place.level(), standpoint.position)
    }

    pub fn ends(mut self) {
        let mut viewer = self.viewer.take().unwrap();
        self.flying.request_exit(&mut viewer).unwrap();
        while self.flying.frame(&mut viewer, self.flown).unwrap() != Step::Exited {}
        drop(viewer);
        let remarks = self.flying.remarks();
        assert_eq!(remarks.validation, 0, "{:?}", remarks.first);
        assert_clean(&self.mock, "at the end");
    }
}

pub fn write(name: &str, size: [u32; 2], rgba: &[u8]) {
    let rgb: Vec<u8> = rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    picture::write(&folder().join(format!("{name}.png")), size, Pixels::Rgb8(&rgb), &[]).unwrap();
}

fn linear(rgba: &[u8]) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|i| linear_from_srgb(rgba[i])))
}

fn srgb(linear: f32) -> f32 {
    let x = linear.clamp(0.0, 1.0);
    255.0 * if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// What a compositor makes of a view with the quad before it: sRGB, and where the quad is.
pub fn composed(view: &SubmittedView, quad: &SubmittedQuad) -> Vec<(Vec3, bool)> {
    let [left, right, up, down] = [view.fov.left, view.fov.right, view.fov.up, view.fov.down].map(f32::tan);
    let [width, height] = view.size;
    let turn = quad.pose.orientation.conjugate();
    let eye = turn * (view.pose.position - quad.pose.position);
    let mut seen = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let across = left + (right - left) * (x as f32 + 0.5) / width as f32;
            let upwards = up + (down - up) * (y as f32 + 0.5) / height as f32;
            let ray = turn * (view.pose.orientation * Vec3::new(across, upwards, -1.0));
            let behind = linear(&view.pixel(x, y).unwrap());
            let at = (eye + ray * (-eye.z / ray.z)).truncate() / Vec2::from(quad.size_m);
            let on = ray.z < 0.0 && eye.z > 0.0 && at.abs().max_element() < 0.5;
            let light = if on {
                let texel = sample(quad, Vec2::new(0.5 + at.x, 0.5 - at.y));
                texel.0 + behind * (1.0 - texel.1)
            } else {
                behind
            };
            seen.push((Vec3::from_array(light.to_array().map(srgb)), on));
        }
    }
    seen
}

/// A bilinear sample of a quad's linear light, multiplied by its alpha, and that.
fn sample(quad: &SubmittedQuad, share: Vec2) -> (Vec3, f32) {
    let [width, height] = quad.pixels;
    let at = share * Vec2::new(width as f32, height as f32) - 0.5;
    let low = at.floor();
    let f = at - low;
    let texel = |dx: f32, dy: f32| {
        let clamp = |v: f32, most: u32| v.clamp(0.0, most as f32 - 1.0) as usize;
        let i = 4 * (clamp(low.y + dy, height) * width as usize + clamp(low.x + dx, width));
        (linear(&quad.rgba[i..]), f32::from(quad.rgba[i + 3]) / 255.0)
    };
    let mix = |a: (Vec3, f32), b: (Vec3, f32), f: f32| (a.0.lerp(b.0, f), a.1 + (b.1 - a.1) * f);
    let row = |dy| mix(texel(0.0, dy), texel(1.0, dy), f.x);
    mix(row(0.0), row(1.0), f.y)
}

pub fn near(a: &PanelAid, quad: &SubmittedQuad, seat: Vec3) {
    let off = (seat + a.pose.position).distance(quad.pose.position);
    assert!(off < 1e-5, "{off} m from where it is pointed at");
    assert!(a.pose.orientation.angle_between(quad.pose.orientation) < 1e-3);
    assert_eq!(a.size_m, quad.size_m);
}
