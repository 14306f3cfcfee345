//! What each control of the wearer's panel says that it does, tried out by clicking it.

use egui::accesskit::Role;
use fathomless::bindings::Action;
use fathomless::course::{Stand, Standpoint};
use fathomless::mock::Pose as MockPose;
use fathomless::panels::controller_lines;
use fathomless::panels::wrist::{Choices, METRES_PER_POINT, SIZE};
use fathomless::viewer::PanelWay;
use fathomless::wrist::PanelPlace;
use glam::{Quat, Vec3};

use super::{WRIST, Wearer, near};
use crate::wearer::paths;

/// A control that chooses something: its page, its role, its label, and what it makes of what was chosen.
type Chooser = (&'static str, Role, &'static str, fn(&mut Choices));

/// In this order each of them changes something.
const CHOOSERS: [Chooser; 17] = [
    ("Fly", Role::Button, "Faster", |it| it.speed *= 0.25f64.exp2()),
    ("Fly", Role::Button, "Slower", |it| it.speed *= (-0.25f64).exp2()),
    // The middle of 1/16 to 8, by octaves.
    ("Fly", Role::Slider, "Speed", |it| it.speed = 0.5f64.sqrt()),
    ("Comfort", Role::RadioButton, "off", |it| it.vignette = false),
    ("Comfort", Role::RadioButton, "on", |it| it.vignette = true),
    ("Comfort", Role::RadioButton, "smooth", |it| it.snap_turn = 0.0),
    ("Comfort", Role::RadioButton, "15°", |it| it.snap_turn = 15.0),
    ("Comfort", Role::RadioButton, "45°", |it| it.snap_turn = 45.0),
    ("Comfort", Role::RadioButton, "90°", |it| it.snap_turn = 90.0),
    ("Comfort", Role::RadioButton, "30°", |it| it.snap_turn = 30.0),
    // The middle of 0.25 to 50, by octaves.
    ("Comfort", Role::Slider, "Ground at", |it| it.comfort_m = 12.5f64.sqrt()),
    ("Comfort", Role::RadioButton, "standing", |it| it.standing = true),
    ("Comfort", Role::RadioButton, "seated", |it| it.standing = false),
    ("Comfort", Role::RadioButton, "gaze", |it| it.fly_by_head = true),
    ("Comfort", Role::RadioButton, "hand", |it| it.fly_by_head = false),
    ("Comfort", Role::RadioButton, "in the air", |it| it.panel = PanelPlace::Floating),
    ("Comfort", Role::RadioButton, "on the wrist", |it| it.panel = PanelPlace::Wrist),
];

/// How far the sliders' values may be off, in octaves: some points of the panel.
const SLID: f64 = 0.08;

fn alike(a: &Choices, b: &Choices) -> bool {
    let close = |a: f64, b: f64| (a / b).log2().abs() < SLID;
    let slid = close(a.speed, b.speed) && close(a.comfort_m, b.comfort_m);
    slid && Choices { speed: b.speed, comfort_m: b.comfort_m, ..*a } == *b
}

impl Wearer {
    /// Clicks every control of the panel, each page's in turn, and sees that it does what it says.
    pub fn clicks_each_control(&mut self) {
        let mut there = Vec::new();
        self.chooses("Fly");
        self.moves_himself();
        there.extend(self.controls());
        self.marks_and_finds();
        there.extend(self.controls());
        self.enters_worlds();
        there.extend(self.controls());
        self.tries(Role::RadioButton, "Comfort");
        self.chooses("Comfort");
        there.extend(self.controls());
        self.tries(Role::RadioButton, "?");
        let lines = controller_lines(self.viewer().bound().0);
        assert!(lines.iter().any(|line| line.action == Action::Dive.title() && !line.inputs.is_empty()));
        assert_eq!(self.flying.wrist.panel().known.controls, lines);
        there.extend(self.controls());
        self.tries(Role::RadioButton, "Fly");
        self.at(Role::Slider, "Speed");
        self.tries(Role::Button, "Close");
        assert!(!self.flying.wrist.is_shown());
        assert!(self.seen(1).quads.is_empty());
        // Nothing can be clicked that was not.
        assert!(there.len() > 40, "{there:?}");
        there.retain(|label| !self.clicked.contains(label));
        assert!(there.is_empty(), "not clicked: {there:?}");
    }

    /// Clicks what chooses something on a page that is open.
    pub fn chooses(&mut self, page: &str) {
        for (_, role, label, makes) in CHOOSERS.iter().filter(|it| it.0 == page) {
            let before = self.flying.choices();
            let mut wanted = before;
            makes(&mut wanted);
            assert!(!alike(&before, &wanted), "{label} changes nothing");
            self.tries(*role, label);
            let now = self.flying.choices();
            assert!(alike(&now, &wanted), "{label}: {now:?}, and not {wanted:?}");
        }
    }

    /// Clicks what takes the wearer somewhere from where he is.
    fn moves_himself(&mut self) {
        let start = self.place_now();
        self.backs_out();
        self.tries(Role::Button, "Back to the start");
        self.until("he is at the start", |wearer| wearer.place_now() == start);

        self.mock.hold_head(MockPose::new(Vec3::new(0.3, 1.6, 0.2), Quat::IDENTITY));
        self.fly(4);
        let from_seat =
            |wearer: &mut Wearer| wearer.viewer().eye(0).unwrap().pose.position.truncate().length();
        assert!(from_seat(self) > 0.2);
        self.tries(Role::Button, "Centre my seat");
        assert!(from_seat(self) < 0.05, "the seat is where the head is");

        // Tilted towards a shoulder, and back.
        let before = self.flying.helm.standpoint().unwrap().stand();
        let orientation = before.orientation * Quat::from_rotation_z(0.8);
        self.flying.helm.take(&Stand { orientation, ..before });
        let tilt = |wearer: &Wearer| {
            let Standpoint { orientation, heading, .. } = wearer.flying.helm.standpoint().unwrap();
            (orientation * Vec3::X).angle_between(heading * Vec3::X)
        };
        self.fly(4);
        assert!(tilt(self) > 0.3, "{}", tilt(self));
        self.tries(Role::Button, "Upright");
        self.until("he is upright", |wearer| tilt(wearer) < 0.02);
    }

    /// Marks the place on both pages where that can be done, and goes to each of the marks.
    fn marks_and_finds(&mut self) {
        let store = self.flying.wrist.shelf.store.clone().unwrap();
        let marked = self.place_now();
        for n in 1..=2 {
            self.tries(Role::Button, "Mark this place");
            self.until("it is kept", |_| store.list().unwrap().bookmarks.len() == n);
            if n == 1 {
                self.tries(Role::RadioButton, "Places");
            }
        }
        for name in store.list().unwrap().bookmarks.into_keys() {
            self.backs_out();
            self.tries(Role::Button, &name);
            self.until("he is at the bookmark", |wearer| {
                let (level, position) = wearer.place_now();
                level == marked.0 && position.distance(marked.1) < 1e-6
            });
        }
    }

    /// Goes through all worlds, and comes back to the one that he is in.
    fn enters_worlds(&mut self) {
        self.tries(Role::RadioButton, "Worlds");
        self.until("the worlds are read", |wearer| !wearer.flying.wrist.panel().known.worlds.is_empty());
        let names = self.flying.wrist.panel().known.worlds.iter().map(|[name, _]| name.clone());
        let (here, mut names): (Vec<_>, Vec<_>) = names.partition(|name| *name == self.flying.world.name);
        names.extend(here);
        assert!(names.len() >= 3, "{names:?}");
        for name in names {
            self.tries(Role::Button, &name);
            self.until("he is in another world", |wearer| wearer.flying.world.name == name);
        }
    }

    /// Backs out until he is elsewhere.
    fn backs_out(&mut self) {
        let before = self.place_now();
        assert!(self.set(1, Action::Rise, 1.0));
        self.until("he backs out", |wearer| wearer.place_now() != before);
        self.set(1, Action::Rise, 0.0);
        self.fly(3);
        assert_ne!(self.place_now(), before);
    }

    /// Clicks something on the panel, which hangs where it should, and feels it.
    fn tries(&mut self, role: Role, label: &str) {
        self.rest();
        self.hangs();
        let felt = self.felt();
        self.click(role, label);
        let has_pulse = !paths(self.profile, Action::Pulse).0.is_empty();
        assert_eq!(self.felt() > felt, has_pulse, "{label} is felt");
        self.fly(2);
    }

    /// The runtime has the panel as one layer over the eyes': it is where it is pointed at, above the wrist or ahead of the
    /// head, and faces the head.
    fn hangs(&mut self) {
        let frame = self.seen(1);
        assert_eq!((frame.layer_count, self.viewer().panel_way()), (2, Some(PanelWay::Layer)));
        let [quad] = &frame.quads[..] else { panic!("{} layers are quads", frame.quads.len()) };
        let [left, right] = [0, 1].map(|eye| frame.views[eye].pose.position);
        let seat = left - self.viewer().eye(0).unwrap().pose.position;
        near(self.flying.wrist.aid().unwrap(), quad, seat);
        let (pose, head) = (quad.pose, left.midpoint(right));
        let own = SIZE.map(|points| points * METRES_PER_POINT);
        match self.flying.choices().panel {
            PanelPlace::Wrist => {
                assert_eq!(quad.size_m, own);
                let lower = pose.position - pose.orientation * Vec3::Y * (0.5 * own[1]);
                assert!((lower.distance(WRIST) - 0.05).abs() < 1e-3, "{lower}");
            }
            PanelPlace::Floating => {
                assert_eq!(quad.size_m, own.map(|side| 1.5 * side));
                let ahead = head + Vec3::new(0.0, -0.12, -0.6);
                assert!(pose.position.distance(ahead) < 1e-3, "{}", pose.position);
            }
        }
        let front = (pose.orientation * Vec3::Z).dot((head - pose.position).normalize());
        assert!(front > 0.97, "it does not face the head: {front}");
    }

    /// Vibrations that something has felt.
    fn felt(&self) -> usize {
        self.mock.haptics().iter().filter(|haptic| !haptic.outputs.is_empty()).count()
    }
}
