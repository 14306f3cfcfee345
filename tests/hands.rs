//! Scripted sessions, one for every controller in the bindings and for bare hands: the land is taken hold of, pulled in by
//! fifty levels and out again, stepped over, dived into; hands go, the focus goes, controllers are exchanged.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests stop at the first surprise")]

mod life;
mod wearer;

use fathomless::aids::Aids;
use fathomless::bindings::{Action, HANDS, ProfileBindings};
use fathomless::controllers::{ControllerSettings, Controllers, Hand, Hands, pinch};
use fathomless::course::Stand;
use fathomless::helm::Helm;
use fathomless::mock::registry::Kind;
use fathomless::mock::{MockConfig, Tracking};
use fathomless::pilot::MotionSettings;
use fathomless::rig::{COMFORT_M, Pose};
use fathomless::terrain::nearest::Probe;
use fathomless::viewer::{Remarks, Step, Viewer};
use glam::{DVec3, Quat, Vec3};
use life::{assert_clean, headset};
use wearer::{FRAME, SETTLED, Wearer, built_in, paths};

const TOUCH: &str = "/interaction_profiles/oculus/touch_controller";
const INDEX: &str = "/interaction_profiles/valve/index_controller";

/// What a profile's hands hold the land by: the paths of both, and their kind.
fn grips(profile: &ProfileBindings) -> (Vec<&str>, Kind) {
    let (grab, kind) = paths(profile, Action::Grab);
    if grab.is_empty() { paths(profile, Action::Dive) } else { (grab, kind) }
}

/// Where both hands are from the seat, in metres.
type Both = [Vec3; 2];

impl Wearer {
    fn hands_at(&mut self, hands: Both) {
        hands.into_iter().enumerate().for_each(|(i, at)| self.hand_at(i, at));
    }

    /// How far the ground is below a point before the wearer, in metres.
    fn above_m(&self) -> f64 {
        let here = self.pilot.standpoint();
        let at = self.pilot.tiles_at(AHEAD.as_dvec3(), true);
        (at.y - here.place.ground(at.x, at.z)) * COMFORT_M / here.height
    }

    /// Where the viewer is.
    fn spot(&self) -> Stand {
        self.pilot.standpoint().stand()
    }

    /// The viewer is where he was, to the bit.
    fn assert_at(&self, there: &Stand, why: &str) {
        let here = self.pilot.standpoint();
        let (way, _) = here.place.way_from(here.position, (&there.place, there.place.position)).unwrap();
        assert_eq!((way, here.depth), (DVec3::ZERO, there.depth), "{why}");
        assert_eq!(here.orientation, there.orientation, "{why}");
    }

    /// A first hold puts the scale on its grain. Nobody needs to see it.
    fn settle(&mut self, grips: &(Vec<&str>, Kind)) {
        self.mock.set_should_render(Some(false));
        self.gesture(grips, &[[Vec3::new(-0.2, -0.5, -0.3), Vec3::new(0.2, -0.5, -0.3)]]);
        self.mock.set_should_render(None);
        self.fly(2);
    }

    /// Vibrations that something has felt.
    fn felt(&self) -> usize {
        self.mock.haptics().iter().filter(|haptic| !haptic.outputs.is_empty()).count()
    }

    /// Takes hold, follows with the hands, lets go.
    fn gesture(&mut self, (paths, kind): &(Vec<&str>, Kind), way: &[Both]) {
        self.hands_at(way[0]);
        self.set(paths, *kind, 1.0);
        self.fly(2);
        assert_eq!(self.pilot.holds(), [true; 2]);
        for hands in &way[1..] {
            self.hands_at(*hands);
            self.fly(1);
        }
        // The hands of a frame are known in the next one.
        self.fly(1);
        self.set(paths, *kind, 0.0);
        self.fly(2);
        assert_eq!(self.pilot.holds(), [false; 2]);
    }
}

/// Between the hands, as high as the head.
const AHEAD: Vec3 = Vec3::new(0.05, 0.0, -0.3);

/// Where hands have pulled to, in metres over the head: two and a half metres over the ground.
const HIGH: f32 = -0.5;

/// Hands that pull the land up from half a metre over it, and four times as far apart.
fn pull(above_m: f64) -> Vec<Both> {
    let low = 0.5 - above_m as f32;
    let frames = 12;
    (0..=frames)
        .map(|frame| {
            let s = frame as f32 / frames as f32;
            let (middle, half) = (AHEAD + Vec3::Y * (low + (HIGH - low) * s), 0.1 * (s * 4f32.ln()).exp());
            [middle - Vec3::X * half, middle + Vec3::X * half]
        })
        .collect()
}

#[test]
fn every_controller_pulls_the_land_in_by_fifty_levels_and_out_again() {
    for profile in built_in(false) {
        let name = profile.profile;
        let grips = grips(&profile);
        let mut wearer = Wearer::new(headset(), false);
        wearer.takes(name);
        wearer.fly(SETTLED);
        wearer.settle(&grips);
        let (before, felt) = (wearer.spot(), wearer.felt());
        let (start, mut pulls) = (before.depth, Vec::new());
        wearer.mock.set_should_render(Some(false));
        while wearer.pilot.standpoint().depth - start < 50.0 {
            assert!(pulls.len() < 32, "{name}: only {} octaves", wearer.pilot.standpoint().depth - start);
            pulls.push(pull(wearer.above_m()));
            wearer.gesture(&grips, &pulls[pulls.len() - 1]);
            let m = wearer.pilot.distance() * COMFORT_M / wearer.pilot.standpoint().height;
            assert!((1.01..3.95).contains(&m), "{name}, pull {}: the ground is {m} m away", pulls.len());
        }
        for way in pulls.iter().rev() {
            let back: Vec<Both> = way.iter().rev().copied().collect();
            wearer.gesture(&grips, &back);
        }
        wearer.assert_at(&before, name);
        wearer.mock.set_should_render(None);
        wearer.fly(3);
        let (pulse, _) = paths(&profile, Action::Pulse);
        // Both hands, each time.
        let most = wearer.felt() - felt;
        assert_eq!(
            most >= 8 * pulls.len(),
            !pulse.is_empty(),
            "{name}: felt {most} of {} pulls",
            pulls.len()
        );
        wearer.ends();
    }
}

#[test]
fn one_hand_drags_and_what_it_holds_it_feels() {
    let mut wearer = Wearer::new(headset(), false);
    wearer.takes(TOUCH);
    wearer.fly(SETTLED);
    let squeeze = ["/user/hand/left/input/squeeze/value"];
    wearer.hand_at(0, Vec3::new(-0.2, -0.4, -0.3));
    wearer.fly(2);
    let felt = wearer.mock.haptics().len();
    wearer.set(&squeeze, Kind::Float, 1.0);
    wearer.fly(2);
    assert_eq!(wearer.pilot.holds(), [true, false]);
    let of_left = |wearer: &Wearer| {
        let haptics = wearer.mock.haptics();
        assert!(haptics[felt..].iter().all(|it| it.outputs.iter().all(|path| path.starts_with(HANDS[0]))));
        haptics.len() - felt
    };
    assert_eq!(of_left(&wearer), 1);
    let here = wearer.pilot.standpoint();
    let (place, position, scale) = (here.place.clone(), here.position, here.height / COMFORT_M);
    wearer.hand_at(0, Vec3::new(0.1, -0.2, -0.4));
    wearer.fly(3);
    let here = wearer.pilot.standpoint();
    let (way, level) = here.place.way_from(here.position, (&place, position)).unwrap();
    assert_eq!(level, place.level());
    let turned = (here.heading.inverse() * (way / scale).as_vec3()) + Vec3::new(0.3, 0.2, -0.1);
    assert!(turned.length() < 1e-4, "the land did not follow: {turned} m off");
    // A trigger meanwhile dives nowhere, and no more afterwards until it is pulled anew.
    let trigger = ["/user/hand/right/input/trigger/value"];
    wearer.set(&trigger, Kind::Float, 1.0);
    assert!(wearer.fly(3).dive.is_none());
    wearer.set(&squeeze, Kind::Float, 0.0);
    assert!(wearer.fly(3).dive.is_none());
    assert_eq!(of_left(&wearer), 2, "it lets go");
    wearer.set(&trigger, Kind::Float, 0.0);
    wearer.fly(2);
    wearer.set(&trigger, Kind::Float, 1.0);
    assert!(wearer.fly(3).dive.is_some());
    wearer.ends();
}

#[test]
fn hands_that_go_while_they_hold_let_go_and_the_land_stays() {
    for bindings in built_in(false) {
        let profile = bindings.profile;
        let (grips, kind) = grips(&bindings);
        let mut wearer = Wearer::new(headset(), false);
        wearer.takes(profile);
        wearer.fly(SETTLED);
        wearer.settle(&(grips.clone(), kind));
        wearer.hands_at([Vec3::new(-0.2, -0.4, -0.3), Vec3::new(0.2, -0.4, -0.3)]);
        wearer.set(&grips, kind, 1.0);
        wearer.fly(3);
        assert_eq!(wearer.pilot.holds(), [true; 2], "{profile}");
        let apart = [Vec3::new(-0.9, 0.5, -0.8), Vec3::new(0.9, 0.5, -0.8)];
        // Another program has the input: whatever the hands do there, the land stays.
        wearer.mock.lose_focus();
        wearer.fly(3);
        let before = wearer.spot();
        assert_eq!(wearer.pilot.holds(), [false; 2], "{profile}");
        wearer.hands_at(apart);
        wearer.fly(3);
        wearer.mock.gain_focus();
        wearer.fly(4);
        assert_eq!(wearer.pilot.holds(), [true; 2], "{profile}: still closed");
        wearer.assert_at(&before, profile);
        // One is not seen for a while, and comes back elsewhere.
        wearer.mock.set_device_tracking(HANDS[1], Tracking::LOST).unwrap();
        wearer.fly(3);
        // Where holding is a second use of what dives, one hand alone does not hold.
        let one = !paths(&bindings, Action::Grab).0.is_empty();
        assert_eq!(wearer.pilot.holds(), [one, false], "{profile}");
        wearer.hand_at(1, Vec3::new(0.1, -0.8, -0.2));
        wearer.fly(2);
        wearer.mock.set_device_tracking(HANDS[1], Tracking::FULL).unwrap();
        wearer.fly(3);
        assert_eq!(wearer.pilot.holds(), [true; 2], "{profile}");
        wearer.assert_at(&before, profile);
        // A controller is put away.
        wearer.mock.disconnect(HANDS[0]).unwrap();
        wearer.fly(3);
        assert_eq!(wearer.pilot.holds(), [false, one], "{profile}");
        // Both are exchanged for others, on which nothing is pressed.
        let (other, squeeze) = match profile {
            INDEX => (TOUCH, "/user/hand/left/input/squeeze/value"),
            _ => (INDEX, "/user/hand/left/input/squeeze/force"),
        };
        wearer.takes(other);
        wearer.fly(3);
        assert_eq!(wearer.viewer.interaction_profiles(), [Some(other); 2], "{profile}");
        assert_eq!(wearer.pilot.holds(), [false; 2], "{profile}");
        wearer.assert_at(&before, profile);
        wearer.set(&[squeeze], Kind::Float, 1.0);
        wearer.fly(2);
        assert_eq!(wearer.pilot.holds(), [true, false], "{profile}");
        wearer.ends();
    }
}

#[test]
fn bare_hands_are_read_from_their_joints() {
    let absent_extensions = vec!["XR_EXT_hand_interaction".to_owned()];
    let mut wearer = Wearer::new(MockConfig { absent_extensions, ..headset() }, false);
    wearer.hands_at([Vec3::new(-0.2, -0.4, -0.3), Vec3::new(0.2, -0.4, -0.3)]);
    wearer.fly(SETTLED);
    assert_eq!(wearer.viewer.hands(), Hands::default(), "nobody's");
    HANDS.iter().for_each(|hand| wearer.mock.show_hand(hand, true).unwrap());
    wearer.fly(2);
    for (i, hand) in wearer.viewer.hands().hands.into_iter().enumerate() {
        let (aim, grip) = (hand.aim.unwrap(), hand.grip.unwrap());
        let side = if i == 0 { -0.2 } else { 0.2 };
        assert!(grip.position.distance(Vec3::new(side, -0.4, -0.3)) < 0.05, "{grip:?}");
        // As the mock's hands are held: grip and palm by the extension's rules.
        let held = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_4);
        assert!(grip.orientation.angle_between(held) < 1e-3, "{grip:?}");
        let fingers = held * Vec3::NEG_Y;
        assert!(
            (aim.orientation * Vec3::NEG_Z).dot(fingers) > 0.9,
            "points {:?}",
            aim.orientation * Vec3::NEG_Z
        );
        assert!(hand.dive < 0.2 && !hand.has_grab, "{hand:?}");
    }
    // One pinch dives, and both hold.
    wearer.mock.bend_hand(HANDS[1], 1.0, 0.0).unwrap();
    assert!(wearer.fly(3).dive.is_some());
    wearer.mock.bend_hand(HANDS[0], 1.0, 0.0).unwrap();
    assert!(wearer.fly(3).dive.is_none());
    assert_eq!(wearer.pilot.holds(), [true; 2]);
    let depth = wearer.pilot.standpoint().depth;
    for step in 1..=10 {
        let half = 0.2 + 0.02 * step as f32;
        wearer.hands_at([-half, half].map(|x| Vec3::new(x, -0.4, -0.3)));
        wearer.fly(1);
    }
    wearer.fly(2);
    // The hands' middles are nearer to each other than where their grips are, by the palms.
    assert!(wearer.pilot.standpoint().depth > depth + 0.8, "pulled apart to twice the distance");
    // A fist backs out.
    HANDS.iter().for_each(|hand| wearer.mock.bend_hand(hand, 0.0, 1.0).unwrap());
    let input = wearer.fly(3);
    assert!(input.rise > 0.9 && input.dive.is_none(), "{input:?}");
    assert_eq!(wearer.pilot.holds(), [false; 2]);
    // A controller that is taken up is what counts.
    HANDS.iter().for_each(|hand| wearer.mock.bend_hand(hand, 1.0, 0.0).unwrap());
    wearer.takes(TOUCH);
    wearer.fly(3);
    assert!(wearer.viewer.hands().hands.iter().all(|hand| hand.has_grab && hand.dive == 0.0));
    wearer.ends();
}

#[test]
fn a_pinch_is_told_from_an_open_hand_and_from_a_fist() {
    let palm = Pose { position: Vec3::ZERO, orientation: Quat::IDENTITY };
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let open = pinch::Joints {
        palm,
        wrist: at(0.0, 0.0, 0.06),
        index_proximal: at(-0.02, 0.0, -0.03),
        middle_proximal: at(0.0, 0.0, -0.03),
        thumb_tip: at(-0.06, -0.02, -0.06),
        index_tip: at(-0.025, -0.02, -0.11),
        other_tips: [at(0.0, -0.02, -0.12), at(0.02, -0.02, -0.11), at(0.04, -0.02, -0.09)],
    };
    let (hand, fist) = pinch::hand(&open, 1);
    assert!(hand.dive < 0.4 && fist == 0.0, "{hand:?}, fist {fist}");
    let pinched = pinch::Joints { thumb_tip: open.index_tip + at(0.01, 0.0, 0.005), ..open };
    assert!(pinch::hand(&pinched, 1).0.dive > 0.95);
    assert_eq!(pinch::hand(&pinched, 1).0.aim, hand.aim, "a pinch does not move the aim");
    let closed = [at(0.0, -0.03, 0.0), at(0.01, -0.03, 0.0), at(0.03, -0.03, 0.0)];
    let (hand, fist) = pinch::hand(&pinch::Joints { other_tips: closed, ..pinched }, 0);
    assert!(fist > 0.95 && hand.dive < 0.1, "{hand:?}, fist {fist}");
    // The grips of both hands have their thumbs on −z.
    for (i, thumb) in [(0, Vec3::X), (1, Vec3::NEG_X)] {
        let grip = pinch::hand(&open, i).0.grip.unwrap();
        assert!((grip.orientation * Vec3::NEG_Z).distance(thumb) < 1e-5);
        assert!((grip.orientation * Vec3::NEG_Y).distance(Vec3::NEG_Z) < 1e-5, "the open fingers");
    }
    let nowhere = pinch::Joints { wrist: Vec3::splat(f32::NAN), thumb_tip: Vec3::NAN, ..open };
    let (hand, fist) = pinch::hand(&nowhere, 0);
    assert!(hand.aim.is_none() && hand.dive == 0.0 && (0.0..=1.0).contains(&fist));
}

fn hand(x: f32) -> Hand {
    let pose = Some(Pose { position: Vec3::new(x, -0.3, -0.2), orientation: Quat::IDENTITY });
    Hand { aim: pose, grip: pose, ..Hand::default() }
}

#[test]
fn a_trigger_that_is_for_the_panel_neither_dives_nor_holds() {
    let head = Pose { position: Vec3::ZERO, orientation: Quat::IDENTITY };
    let mut controllers = Controllers::default();
    let mut input = |occupied: [bool; 2], pulled: [f32; 2]| {
        let mut hands = Hands { hands: [hand(-0.2), hand(0.2)], ..Hands::default() };
        (0..2).for_each(|i| hands.hands[i].dive = pulled[i]);
        controllers.occupied = occupied;
        let input = controllers.input(&hands, &head, FRAME);
        (input.dive.is_some(), input.grab.map(|hand| hand.is_some()))
    };
    let nothing = (false, [false; 2]);
    assert_eq!(input([false, true], [0.0, 1.0]), nothing);
    // Off the panel it is still what it was pulled for.
    assert_eq!(input([false; 2], [0.0, 1.0]), nothing);
    assert_eq!(input([false; 2], [1.0, 1.0]), (true, [false; 2]), "the other hand dives");
    assert_eq!(input([false; 2], [1.0, 0.0]), (true, [false; 2]));
    assert_eq!(input([false; 2], [1.0, 1.0]), (false, [true; 2]), "two hold");
    assert_eq!(input([false; 2], [1.0, 0.0]), nothing, "and one of them dives no more");
    assert_eq!(input([false; 2], [0.0, 0.0]), nothing);
    // A dive goes on over the panel.
    assert_eq!(input([false; 2], [0.0, 1.0]), (true, [false; 2]));
    assert_eq!(input([false, true], [0.0, 1.0]), (true, [false; 2]));
}

#[test]
fn the_helm_says_what_is_drawn_of_hands_and_steps_recentres_and_stands() {
    let mut wearer = Wearer::new(headset(), false);
    wearer.takes(TOUCH);
    wearer.hands_at([Vec3::new(-0.2, -0.4, -0.3), Vec3::new(0.2, -0.4, -0.3)]);
    wearer.fly(SETTLED);
    let Wearer { mock, mut viewer, pilot, .. } = wearer;
    let settings = ControllerSettings { standing: true, ..ControllerSettings::default() };
    let start = pilot.standpoint().stand();
    let mut helm = Helm::new(start.clone(), &MotionSettings::default(), Controllers::new(settings));
    helm.take(&start);
    let mut aids = Aids { fade: 0.5, ..Aids::default() };
    let mut fly = |helm: &mut Helm, viewer: &mut Viewer, frames: usize| {
        let mut jumps = 0;
        for _ in 0..frames {
            let input = helm.hands(viewer, FRAME);
            helm.advance(&input, FRAME, 1.0);
            jumps += usize::from(helm.jumped());
            assert_eq!(viewer.frame(&helm.standpoint().unwrap(), true).unwrap(), Step::Drew);
            helm.feel(viewer, helm.standpoint().unwrap().depth).unwrap();
        }
        helm.aids(viewer, &mut aids);
        (aids.clone(), jumps)
    };
    let nearest_m =
        |helm: &Helm| helm.pilot().unwrap().distance() * COMFORT_M / helm.standpoint().unwrap().height;
    let (aids, jumps) = fly(&mut helm, &mut viewer, 200);
    assert_eq!((jumps, aids.fade), (0, 0.5));
    assert!((aids.floor_m - 1.6).abs() < 1e-4, "{}", aids.floor_m);
    let stands_at = nearest_m(&helm);
    assert!((stands_at - 1.6).abs() < 0.02, "the ground is {stands_at} m under a head 1.6 m over the floor");
    let hands = aids.hands.map(Option::unwrap);
    assert!(hands.iter().all(|hand| !hand.holds && hand.aim.is_some()));
    // The ray ends on the ground.
    let (from, along) = hands[1].ray().unwrap();
    let end = from + along * hands[1].ray_m.unwrap();
    let here = helm.standpoint().unwrap();
    let at = helm.pilot().unwrap().tiles_at(end.as_dvec3(), true);
    let off = Probe::default().nearest(here.place, at, 0.01).least * COMFORT_M / here.height;
    assert!(off < 0.01, "{off} m off the ground");
    assert!(aids.arc.as_slice().is_empty() && !aids.arc_lands);
    // A step through the air.
    mock.set_input("/user/hand/right/input/b/click", true).unwrap();
    let (aids, jumps) = fly(&mut helm, &mut viewer, 3);
    assert!(aids.arc.as_slice().len() > 1 && aids.arc_lands && jumps == 0, "{aids:?}");
    mock.set_input("/user/hand/right/input/b/click", false).unwrap();
    let (aids, jumps) = fly(&mut helm, &mut viewer, 3);
    assert_eq!((jumps, aids.arc.as_slice().len()), (1, 0));
    // Two hands hold, and have no rays.
    for hand in HANDS {
        mock.set_input(&format!("{hand}/input/squeeze/value"), 1.0).unwrap();
    }
    let (aids, _) = fly(&mut helm, &mut viewer, 3);
    assert!(aids.hands.iter().flatten().all(|hand| hand.holds && hand.ray_m.is_none()));
    for hand in HANDS {
        mock.set_input(&format!("{hand}/input/squeeze/value"), 0.0).unwrap();
    }
    fly(&mut helm, &mut viewer, 3);
    // The wearer looks aside, steps aside, and has that be ahead.
    let ahead = helm.standpoint().unwrap().heading * Vec3::NEG_Z;
    let orientation = Quat::from_rotation_y(1.2);
    mock.hold_head(fathomless::mock::Pose { position: Vec3::new(0.4, 1.5, 0.3), orientation });
    fly(&mut helm, &mut viewer, 3);
    assert!(viewer.head().position.length() > 0.4);
    helm.recentre(&mut viewer);
    let (_, jumps) = fly(&mut helm, &mut viewer, 2);
    assert_eq!(jumps, 1);
    assert!(viewer.head().position.length() < 1e-4, "{:?}", viewer.head());
    let now = helm.standpoint().unwrap().heading * viewer.gaze() * Vec3::NEG_Z;
    assert!(now.distance(ahead) < 1e-3, "{now} was {ahead}");
    // Down, and the thread leads back.
    mock.set_input("/user/hand/right/input/trigger/value", 1.0).unwrap();
    let (aids, _) = fly(&mut helm, &mut viewer, 120);
    assert!(aids.thread.as_slice().len() > 1, "{:?}", aids.thread);
    assert!(aids.thread.as_slice().iter().all(|point| point.is_finite()));
    viewer.request_exit().unwrap();
    while viewer.frame(&helm.standpoint().unwrap(), true).unwrap() != Step::Exited {}
    assert_eq!(viewer.close().unwrap(), Remarks::default());
    assert_clean(&mock, "at the end");
}
