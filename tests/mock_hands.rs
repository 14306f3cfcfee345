//! Hands have joints: where the hand's track leads them, bent by what the hand presses, known while it is seen.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "wrong uses need the raw functions")]

mod mock_support;

use std::ptr;

use fathomless::mock::{Mock, Pose, PoseTrack, Tracking};
use glam::{Quat, Vec3};
use mock_support::{App, Desk, assert_documented, extensions, stepped};
use openxr as xr;
use xr::{
    HandJoint as J,
    sys::{self, Handle as _, Result as R},
};

const LEFT: &str = "/user/hand/left";
const RIGHT: &str = "/user/hand/right";
const TOUCH: &str = "/interaction_profiles/oculus/touch_controller";

impl Desk {
    fn tracked(add: impl FnOnce(&mut xr::ExtensionSet)) -> Self {
        let mut more = extensions();
        more.ext_hand_tracking = true;
        add(&mut more);
        Self::new(&more)
    }

    fn reference(&self, kind: xr::ReferenceSpaceType) -> xr::Space {
        self.session.create_reference_space(kind, xr::Posef::IDENTITY).unwrap()
    }
}

fn at(joint: &xr::HandJointLocation) -> Vec3 {
    let p = joint.pose.position;
    Vec3::new(p.x, p.y, p.z)
}

fn turn(joint: &xr::HandJointLocation) -> Quat {
    let q = joint.pose.orientation;
    Quat::from_xyzw(q.x, q.y, q.z, q.w)
}

/// The joints from the wrist to each finger's tip.
const FINGERS: [&[J]; 5] = [
    &[J::WRIST, J::THUMB_METACARPAL, J::THUMB_PROXIMAL, J::THUMB_DISTAL, J::THUMB_TIP],
    &[J::WRIST, J::INDEX_METACARPAL, J::INDEX_PROXIMAL, J::INDEX_INTERMEDIATE, J::INDEX_DISTAL, J::INDEX_TIP],
    &[
        J::WRIST,
        J::MIDDLE_METACARPAL,
        J::MIDDLE_PROXIMAL,
        J::MIDDLE_INTERMEDIATE,
        J::MIDDLE_DISTAL,
        J::MIDDLE_TIP,
    ],
    &[J::WRIST, J::RING_METACARPAL, J::RING_PROXIMAL, J::RING_INTERMEDIATE, J::RING_DISTAL, J::RING_TIP],
    &[
        J::WRIST,
        J::LITTLE_METACARPAL,
        J::LITTLE_PROXIMAL,
        J::LITTLE_INTERMEDIATE,
        J::LITTLE_DISTAL,
        J::LITTLE_TIP,
    ],
];

/// Bones are of human length, and each points from its joint to the next one along -z.
fn assert_anatomy(joints: &xr::HandJointLocations) {
    for joint in joints {
        assert!((0.005..0.03).contains(&joint.radius));
        assert!((turn(joint).length() - 1.0).abs() < 1e-4);
    }
    for finger in FINGERS {
        for pair in finger.windows(2) {
            let (from, to) = (&joints[pair[0].into_raw() as usize], &joints[pair[1].into_raw() as usize]);
            let bone = at(to) - at(from);
            assert!((0.015..0.08).contains(&bone.length()), "{:?} {}", pair[0], bone.length());
            if pair[0] != J::WRIST {
                assert!((turn(from) * Vec3::NEG_Z).dot(bone.normalize()) > 0.999, "{:?}", pair[0]);
            }
        }
    }
    let palm = at(&joints[J::PALM.into_raw() as usize]);
    let middle = [J::MIDDLE_METACARPAL, J::MIDDLE_PROXIMAL].map(|j| at(&joints[j.into_raw() as usize]));
    assert!(palm.distance(middle[0].midpoint(middle[1])) < 1e-4);
}

#[test]
fn hands_are_hands() {
    let mut desk = Desk::tracked(|_| ());
    let trackers =
        [xr::Hand::LEFT, xr::Hand::RIGHT].map(|hand| desk.session.create_hand_tracker(hand).unwrap());
    let stage = desk.reference(xr::ReferenceSpaceType::STAGE);
    let time = desk.frame();
    let locate = |i: usize| stage.locate_hand_joints(&trackers[i], time).unwrap();
    assert!(locate(0).is_none() && locate(1).is_none(), "no hand is seen");
    // Both hands before the body, thumbs up, palms facing each other, fingers forward.
    let upright = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    let mock = desk.app.mock.clone();
    for (hand, x) in [(LEFT, -0.2), (RIGHT, 0.2)] {
        let pose = Pose::new(Vec3::new(x, 1.2, -0.4), upright);
        mock.set_pose_track(&format!("{hand}/input/grip/pose"), PoseTrack::fixed(pose)).unwrap();
    }
    mock.show_hand(LEFT, true).unwrap();
    mock.connect(RIGHT, TOUCH).unwrap();
    let (left, right) = (locate(0).unwrap(), locate(1).unwrap());
    for (joints, side) in [(&left, -1.0), (&right, 1.0)] {
        assert_anatomy(joints);
        assert!(joints.iter().all(|joint| joint.location_flags.into_raw() == 15));
        let joint = |joint: J| at(&joints[joint.into_raw() as usize]);
        let knuckles = joint(J::MIDDLE_PROXIMAL) - joint(J::WRIST);
        assert!(knuckles.normalize().dot(Vec3::NEG_Z) > 0.99, "fingers forward");
        assert!(joint(J::INDEX_PROXIMAL).y > joint(J::LITTLE_PROXIMAL).y + 0.03, "thumb up");
        let back = turn(&joints[J::PALM.into_raw() as usize]) * Vec3::Y;
        assert!(back.dot(Vec3::X * side) > 0.99, "the back of the hand outwards");
        assert!((joint(J::PALM).x - side * 0.2) * side > 0.0, "the palm beside what it holds");
    }
    for (l, r) in left.iter().zip(&right) {
        assert!((at(l) * Vec3::new(-1.0, 1.0, 1.0)).distance(at(r)) < 1e-5, "mirrored");
    }

    // What is pressed bends the fingers.
    let reach = |joints: &xr::HandJointLocations, tip: J| {
        at(&joints[tip.into_raw() as usize]).distance(at(&joints[J::WRIST.into_raw() as usize]))
    };
    mock.set_input("/user/hand/right/input/trigger/value", 1.0).unwrap();
    let pointing = locate(1).unwrap();
    assert!(reach(&pointing, J::INDEX_TIP) < 0.8 * reach(&right, J::INDEX_TIP));
    assert_eq!(reach(&pointing, J::RING_TIP), reach(&right, J::RING_TIP));
    mock.set_input("/user/hand/right/input/squeeze/value", 1.0).unwrap();
    let fist = locate(1).unwrap();
    assert_anatomy(&fist);
    assert!(reach(&fist, J::RING_TIP) < 0.8 * reach(&right, J::RING_TIP));

    // Seen no more.
    mock.set_device_tracking(RIGHT, Tracking::ORIENTATION_ONLY).unwrap();
    assert!(locate(1).is_none());
    mock.set_device_tracking(RIGHT, Tracking::GUESSED).unwrap();
    assert!(locate(1).unwrap().iter().all(|joint| joint.location_flags.into_raw() == 3));
    mock.show_hand(LEFT, false).unwrap();
    mock.disconnect(RIGHT).unwrap();
    assert!(locate(0).is_none() && locate(1).is_none());
    mock.show_hand(LEFT, true).unwrap();
    assert!(locate(0).is_some());
    mock.lose_focus();
    assert!(locate(0).is_none(), "without the focus");
    assert_eq!(mock.violations(), []);
}

#[test]
fn joints_have_velocities() {
    let mut desk = Desk::tracked(|_| ());
    let tracker = desk.session.create_hand_tracker(xr::Hand::LEFT).unwrap();
    let track = PoseTrack::new((0..=20).map(|i| {
        let t = f64::from(i) * 0.05;
        (t, Pose::new(Vec3::new(0.0, t as f32, 0.0), Quat::from_rotation_z(2.0 * t as f32)))
    }));
    desk.app.mock.set_pose_track("/user/hand/left/input/grip/pose", track).unwrap();
    desk.app.mock.show_hand(LEFT, true).unwrap();
    let stage = desk.reference(xr::ReferenceSpaceType::STAGE);
    for _ in 0..10 {
        desk.frame();
    }
    let time = desk.frame();
    let (joints, velocities) = stage.relate_hand_joints(&tracker, time).unwrap().unwrap();
    // The grip's origin, about which the hand turns.
    let centre = Vec3::new(0.0, 0.13, 0.0);
    for (joint, velocity) in joints.iter().zip(&velocities) {
        assert_eq!(velocity.velocity_flags.into_raw(), 3);
        let linear = velocity.linear_velocity;
        let expected = Vec3::Y + Vec3::new(0.0, 0.0, 2.0).cross(at(joint) - centre);
        assert!(Vec3::new(linear.x, linear.y, linear.z).distance(expected) < 0.03, "{linear:?} {expected}");
        assert!((velocity.angular_velocity.z - 2.0).abs() < 0.02);
    }
    // Seen from the head, which stands still, the same; without an answer there is no velocity either.
    let view = desk.reference(xr::ReferenceSpaceType::VIEW);
    let (_, seen) = view.relate_hand_joints(&tracker, time).unwrap().unwrap();
    assert!((seen[0].linear_velocity.y - velocities[0].linear_velocity.y).abs() < 0.01);
}

/// Pinching and poking happen at the finger tips that hand tracking tells.
#[test]
fn the_hands_profile_agrees_with_the_joints() {
    const HAND: &str = "/interaction_profiles/ext/hand_interaction_ext";
    let mut desk = Desk::tracked(|more| more.ext_hand_interaction = true);
    let instance = &*desk.app.instance;
    let path = |text: &str| instance.string_to_path(text).unwrap();
    let set = instance.create_action_set("play", "Play", 0).unwrap();
    let poke = set.create_action::<xr::Posef>("poke", "Poke", &[]).unwrap();
    let pinch = set.create_action::<xr::Posef>("pinch", "Pinch", &[]).unwrap();
    let squeeze = set.create_action::<f32>("squeeze", "Squeeze", &[]).unwrap();
    let ready = set.create_action::<bool>("ready", "Ready", &[]).unwrap();
    let at_right = |rest: &str| path(&format!("{RIGHT}/input/{rest}"));
    let bindings = [
        xr::Binding::new(&poke, at_right("poke_ext/pose")),
        xr::Binding::new(&pinch, at_right("pinch_ext/pose")),
        xr::Binding::new(&squeeze, at_right("pinch_ext/value")),
        xr::Binding::new(&ready, at_right("pinch_ext/ready_ext")),
    ];
    instance.suggest_interaction_profile_bindings(path(HAND), &bindings).unwrap();
    desk.session.attach_action_sets(&[&set]).unwrap();
    let tracker = desk.session.create_hand_tracker(xr::Hand::RIGHT).unwrap();
    let spaces = [&poke, &pinch]
        .map(|action| action.create_space(&desk.session, xr::Path::NULL, xr::Posef::IDENTITY).unwrap());
    let stage = desk.reference(xr::ReferenceSpaceType::STAGE);
    let mock = desk.app.mock.clone();
    mock.connect(RIGHT, HAND).unwrap();
    let time = desk.frame();
    for value in [0.0, 0.5, 1.0] {
        mock.set_input("/user/hand/right/input/pinch_ext/value", value).unwrap();
        mock.set_input("/user/hand/right/input/pinch_ext/ready_ext", value > 0.2).unwrap();
        desk.session.sync_actions(&[xr::ActiveActionSet::new(&set)]).unwrap();
        assert_eq!(squeeze.state(&desk.session, xr::Path::NULL).unwrap().current_state, value);
        assert_eq!(ready.state(&desk.session, xr::Path::NULL).unwrap().current_state, value > 0.2);
        let joints = stage.locate_hand_joints(&tracker, time).unwrap().unwrap();
        let [poked, pinched] = spaces.each_ref().map(|space| {
            let p = space.locate(&stage, time).unwrap().pose.position;
            Vec3::new(p.x, p.y, p.z)
        });
        let tip = |joint: J| at(&joints[joint.into_raw() as usize]);
        assert!(poked.distance(tip(J::INDEX_TIP)) < 1e-5);
        assert!(pinched.distance(tip(J::INDEX_TIP).midpoint(tip(J::THUMB_TIP))) < 1e-5);
    }
    assert_eq!(mock.violations(), []);
    assert_documented(&mock);
}

#[test]
fn wrong_uses() {
    let mut desk = Desk::tracked(|_| ());
    let time = desk.frame();
    let fp = *desk.app.instance.exts().ext_hand_tracking.as_ref().unwrap();
    let session = desk.session.as_raw();
    let stage = desk.reference(xr::ReferenceSpaceType::STAGE);
    let info = sys::HandTrackerCreateInfoEXT {
        ty: sys::HandTrackerCreateInfoEXT::TYPE,
        next: ptr::null(),
        hand: sys::HandEXT::RIGHT,
        hand_joint_set: sys::HandJointSetEXT::DEFAULT,
    };
    let no_hand = sys::HandTrackerCreateInfoEXT { hand: sys::HandEXT::from_raw(7), ..info };
    let no_set = sys::HandTrackerCreateInfoEXT { hand_joint_set: sys::HandJointSetEXT::from_raw(7), ..info };
    let mut tracker = sys::HandTrackerEXT::NULL;
    let where_to = sys::HandJointsLocateInfoEXT {
        ty: sys::HandJointsLocateInfoEXT::TYPE,
        next: ptr::null(),
        base_space: stage.as_raw(),
        time,
    };
    let never = sys::HandJointsLocateInfoEXT { time: sys::Time::from_nanos(0), ..where_to };
    let nowhere = sys::HandJointsLocateInfoEXT { base_space: sys::Space::NULL, ..where_to };
    let mut places = [sys::HandJointLocationEXT::default(); 26];
    let mut speeds = [sys::HandJointVelocityEXT::default(); 26];
    let mut velocities = sys::HandJointVelocitiesEXT {
        ty: sys::HandJointVelocitiesEXT::TYPE,
        next: ptr::null_mut(),
        joint_count: 26,
        joint_velocities: speeds.as_mut_ptr(),
    };
    let mut out = sys::HandJointLocationsEXT {
        ty: sys::HandJointLocationsEXT::TYPE,
        next: (&raw mut velocities).cast(),
        is_active: sys::TRUE,
        joint_count: 26,
        joint_locations: places.as_mut_ptr(),
    };
    let mut few = sys::HandJointLocationsEXT { joint_count: 25, ..out };
    let mut no_room = sys::HandJointLocationsEXT { joint_locations: ptr::null_mut(), ..out };
    let mut few_speeds = sys::HandJointVelocitiesEXT { joint_count: 27, ..velocities };
    let mut odd = sys::HandJointLocationsEXT { next: (&raw mut few_speeds).cast(), ..out };
    macro_rules! check {
        ($($call:expr => $code:ident;)*) => {
            $(
                // SAFETY: the runtime verifies what it is given.
                let got = unsafe { $call };
                assert_eq!(got, R::$code, "{}", stringify!($call));
            )*
        };
    }
    check! {
        (fp.create_hand_tracker)(session, &no_hand, &mut tracker) => ERROR_VALIDATION_FAILURE;
        (fp.create_hand_tracker)(session, &no_set, &mut tracker) => ERROR_VALIDATION_FAILURE;
        (fp.create_hand_tracker)(session, ptr::null(), &mut tracker) => ERROR_VALIDATION_FAILURE;
        (fp.create_hand_tracker)(session, &info, ptr::null_mut()) => ERROR_VALIDATION_FAILURE;
        (fp.create_hand_tracker)(sys::Session::NULL, &info, &mut tracker) => ERROR_HANDLE_INVALID;
        (fp.create_hand_tracker)(session, &info, &mut tracker) => SUCCESS;
        (fp.locate_hand_joints)(sys::HandTrackerEXT::NULL, &where_to, &mut out) => ERROR_HANDLE_INVALID;
        (fp.locate_hand_joints)(tracker, &never, &mut out) => ERROR_TIME_INVALID;
        (fp.locate_hand_joints)(tracker, &nowhere, &mut out) => ERROR_HANDLE_INVALID;
        (fp.locate_hand_joints)(tracker, &where_to, &mut few) => ERROR_VALIDATION_FAILURE;
        (fp.locate_hand_joints)(tracker, &where_to, &mut odd) => ERROR_VALIDATION_FAILURE;
        (fp.locate_hand_joints)(tracker, &where_to, &mut no_room) => ERROR_VALIDATION_FAILURE;
        (fp.locate_hand_joints)(tracker, ptr::null(), &mut out) => ERROR_VALIDATION_FAILURE;
        (fp.locate_hand_joints)(tracker, &where_to, &mut out) => SUCCESS;
    }
    assert!(out.is_active == sys::FALSE && places.iter().all(|place| place.location_flags.is_empty()));
    assert!(speeds.iter().all(|speed| speed.velocity_flags.is_empty()));
    check! {
        (fp.destroy_hand_tracker)(tracker) => SUCCESS;
        (fp.destroy_hand_tracker)(tracker) => ERROR_HANDLE_INVALID;
        (fp.locate_hand_joints)(tracker, &where_to, &mut out) => ERROR_HANDLE_INVALID;
        // A session takes its trackers along.
        (fp.create_hand_tracker)(session, &info, &mut tracker) => SUCCESS;
        (desk.app.instance.fp().destroy_session)(session) => SUCCESS;
        (fp.destroy_hand_tracker)(tracker) => ERROR_HANDLE_INVALID;
    }
    assert_documented(&desk.app.mock);
}

#[test]
fn the_system_says_that_it_sees_hands() {
    let mut more = extensions();
    more.ext_hand_tracking = true;
    let app = App::with_extensions(Mock::new(stepped()), &more);
    let mut hands = sys::SystemHandTrackingPropertiesEXT {
        ty: sys::SystemHandTrackingPropertiesEXT::TYPE,
        next: ptr::null_mut(),
        supports_hand_tracking: sys::FALSE,
    };
    let mut out = sys::SystemProperties::out((&raw mut hands).cast());
    let (fp, raw) = (app.instance.fp(), app.instance.as_raw());
    // SAFETY: whole structures of a living instance.
    let got = unsafe { (fp.get_system_properties)(raw, app.system, out.as_mut_ptr()) };
    assert_eq!(got, R::SUCCESS);
    assert!(bool::from(hands.supports_hand_tracking));
}

/// A tracker of the left hand that takes joints from some sources; what it said last.
struct Choosy {
    tracker: sys::HandTrackerEXT,
    fp: xr::raw::HandTrackingEXT,
}

impl Choosy {
    fn create(desk: &Desk, sources: Option<&[sys::HandTrackingDataSourceEXT]>) -> Result<Self, R> {
        let fp = *desk.app.instance.exts().ext_hand_tracking.as_ref().unwrap();
        let asked = sources.map(|sources| sys::HandTrackingDataSourceInfoEXT {
            ty: sys::HandTrackingDataSourceInfoEXT::TYPE,
            next: ptr::null(),
            requested_data_source_count: sources.len() as u32,
            requested_data_sources: sources.as_ptr().cast_mut(),
        });
        let info = sys::HandTrackerCreateInfoEXT {
            ty: sys::HandTrackerCreateInfoEXT::TYPE,
            next: asked.as_ref().map_or(ptr::null(), |asked| ptr::from_ref(asked).cast()),
            hand: sys::HandEXT::LEFT,
            hand_joint_set: sys::HandJointSetEXT::DEFAULT,
        };
        let mut tracker = sys::HandTrackerEXT::NULL;
        // SAFETY: whole structures of a living session.
        match unsafe { (fp.create_hand_tracker)(desk.session.as_raw(), &info, &mut tracker) } {
            R::SUCCESS => Ok(Self { tracker, fp }),
            code => Err(code),
        }
    }

    /// Whether the hand is known, and what the runtime says that it is known from.
    fn locate(&self, base: &xr::Space, time: xr::Time) -> Result<(bool, Option<i32>), R> {
        let mut places = [sys::HandJointLocationEXT::default(); 26];
        let mut told = sys::HandTrackingDataSourceStateEXT {
            ty: sys::HandTrackingDataSourceStateEXT::TYPE,
            next: ptr::null_mut(),
            is_active: sys::FALSE,
            data_source: sys::HandTrackingDataSourceEXT::from_raw(0),
        };
        let info = sys::HandJointsLocateInfoEXT {
            ty: sys::HandJointsLocateInfoEXT::TYPE,
            next: ptr::null(),
            base_space: base.as_raw(),
            time,
        };
        let mut out = sys::HandJointLocationsEXT {
            ty: sys::HandJointLocationsEXT::TYPE,
            next: (&raw mut told).cast(),
            is_active: sys::FALSE,
            joint_count: 26,
            joint_locations: places.as_mut_ptr(),
        };
        // SAFETY: whole structures of a living tracker.
        match unsafe { (self.fp.locate_hand_joints)(self.tracker, &info, &mut out) } {
            R::SUCCESS => {
                let known = places.iter().all(|place| !place.location_flags.is_empty());
                assert_eq!(bool::from(out.is_active), known);
                let source = bool::from(told.is_active).then(|| told.data_source.into_raw());
                Ok((known, source))
            }
            code => Err(code),
        }
    }
}

#[test]
fn joints_come_from_the_sources_that_are_wanted() {
    let [seen, held] =
        [sys::HandTrackingDataSourceEXT::UNOBSTRUCTED, sys::HandTrackingDataSourceEXT::CONTROLLER];
    let mut desk = Desk::tracked(|it| it.ext_hand_tracking_data_source = true);
    let stage = desk.reference(xr::ReferenceSpaceType::STAGE);
    let time = desk.frame();
    let wanting = |sources: &[_]| Choosy::create(&desk, Some(sources));
    let unknown = sys::HandTrackingDataSourceEXT::from_raw(3);
    for wrong in [&[seen, seen][..], &[held, seen, held], &[unknown]] {
        assert_eq!(wanting(wrong).err(), Some(R::ERROR_VALIDATION_FAILURE), "{wrong:?}");
    }
    let trackers = [&[seen][..], &[held], &[held, seen], &[]].map(|sources| wanting(sources).unwrap());
    let answers = || trackers.each_ref().map(|tracker| tracker.locate(&stage, time).unwrap());
    let (none, from) =
        ((false, None), |source: sys::HandTrackingDataSourceEXT| (true, Some(source.into_raw())));
    assert_eq!(answers(), [none; 4]);
    desk.app.mock.show_hand(LEFT, true).unwrap();
    assert_eq!(answers(), [from(seen), none, from(seen), none]);
    desk.app.mock.connect(LEFT, TOUCH).unwrap();
    assert_eq!(answers(), [from(seen), from(held), from(held), none]);
    desk.app.mock.show_hand(LEFT, false).unwrap();
    assert_eq!(answers(), [none, from(held), from(held), none]);
    // Who has not said what to take joints from may not ask what they came from.
    let any = Choosy::create(&desk, None).unwrap();
    assert_eq!(any.locate(&stage, time), Err(R::ERROR_VALIDATION_FAILURE));
    assert_documented(&desk.app.mock);

    // Without the extension nothing of it is looked at.
    let mut desk = Desk::tracked(|_| ());
    let stage = desk.reference(xr::ReferenceSpaceType::STAGE);
    let time = desk.frame();
    desk.app.mock.show_hand(LEFT, true).unwrap();
    let tracker = Choosy::create(&desk, Some(&[unknown])).unwrap();
    assert_eq!(tracker.locate(&stage, time), Ok((true, None)));
    assert_eq!(desk.app.mock.violations(), []);
}
