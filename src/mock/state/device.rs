//! The devices in the user's hands and elsewhere: which are there, what is pressed, where they are.

use std::{collections::BTreeMap, f32::consts::FRAC_PI_4};

use glam::{Quat, Vec3};

use crate::mock::{
    config::Tracking,
    hand::{self, Side, Source},
    input::{InputError, InputValue},
    pose::{Pose, PoseTrack},
    registry::{self, Component, Kind, Profile},
};

/// What a component measures, and since when.
#[derive(Clone, Copy)]
pub struct Reading {
    pub value: InputValue,
    pub changed_ns: i64,
}

/// A device at a user path, or what was scripted for one that is not there.
#[derive(Default)]
struct Device {
    /// `None`: not connected.
    profile: Option<&'static Profile>,
    connected_ns: i64,
    /// What was set since it was connected, by subpath; the rest is at rest.
    readings: BTreeMap<&'static str, Reading>,
    /// Where its poses are in STAGE space, by subpath.
    tracks: BTreeMap<String, PoseTrack>,
    tracking: Option<Tracking>,
    /// The bare hand is seen, even without a device.
    bare: bool,
    /// How the hand is bent, besides what the device asks of it.
    bent: hand::Curl,
}

/// All devices, by user path.
#[derive(Default)]
pub struct Devices(BTreeMap<&'static str, Device>);

/// A user path of the registry, as the registry's own string.
fn known_user_path(user_path: &str) -> Result<&'static str, InputError> {
    registry::PROFILES
        .iter()
        .flat_map(|profile| profile.user_paths)
        .find(|known| **known == user_path)
        .copied()
        .ok_or_else(|| InputError::UnknownUserPath(user_path.to_owned()))
}

/// A full path as user path and subpath, both known to some profile.
pub fn split(path: &str) -> Result<(&'static str, &'static Component), InputError> {
    registry::PROFILES
        .iter()
        .find_map(|profile| {
            let (user_path, subpath) = profile.split(path)?;
            Some((user_path, profile.component(user_path, subpath)?))
        })
        .ok_or_else(|| InputError::UnknownComponent(path.to_owned()))
}

impl Devices {
    /// Connects a device, or exchanges it for one of another profile. Nothing is pressed on it.
    pub fn connect(&mut self, user_path: &str, profile: &str, now_ns: i64) -> Result<(), InputError> {
        let user_path = known_user_path(user_path)?;
        let profile =
            registry::profile(profile).ok_or_else(|| InputError::UnknownProfile(profile.to_owned()))?;
        if !profile.user_paths.contains(&user_path) {
            return Err(InputError::NotThere { profile: profile.path, user_path });
        }
        let device = self.0.entry(user_path).or_default();
        if device.profile.is_none_or(|known| known.path != profile.path) {
            device.profile = Some(profile);
            device.connected_ns = now_ns;
            device.readings.clear();
        }
        Ok(())
    }

    pub fn disconnect(&mut self, user_path: &str) -> Result<(), InputError> {
        if let Some(device) = self.0.get_mut(known_user_path(user_path)?) {
            device.profile = None;
        }
        Ok(())
    }

    /// Sets what a component of a connected device measures.
    pub fn set(&mut self, path: &str, value: InputValue, now_ns: i64) -> Result<(), InputError> {
        let (user_path, _) = split(path)?;
        let device = self
            .0
            .get_mut(user_path)
            .and_then(|device| Some((device.profile?, &mut device.readings)))
            .ok_or(InputError::NotConnected(user_path));
        let (profile, readings) = device?;
        let component = profile
            .split(path)
            .and_then(|(user_path, subpath)| profile.component(user_path, subpath))
            .ok_or_else(|| InputError::NoSuchComponent { profile: profile.path, path: path.to_owned() })?;
        value.check(component.kind, path)?;
        let mut put = |subpath: &'static str, value: InputValue| {
            let old = readings.get(subpath).map(|reading| reading.value);
            if old.unwrap_or(InputValue::rest(value.kind())) != value {
                readings.insert(subpath, Reading { value, changed_ns: now_ns });
            }
        };
        // A stick's vector is its two axes.
        match (value, axes(profile, user_path, component)) {
            (InputValue::Vector([x, y]), Some([x_axis, y_axis])) => {
                put(x_axis.subpath, InputValue::Float(x));
                put(y_axis.subpath, InputValue::Float(y));
            }
            _ => put(component.subpath, value),
        }
        Ok(())
    }

    /// What a component of the connected device measures.
    pub fn read(&self, user_path: &str, subpath: &str) -> Option<Reading> {
        let device = self.0.get(user_path)?;
        let profile = device.profile?;
        let component = profile.component(user_path, subpath)?;
        let one = |component: &Component| {
            let rest = Reading { value: InputValue::rest(component.kind), changed_ns: device.connected_ns };
            device.readings.get(component.subpath).copied().unwrap_or(rest)
        };
        let Some([x, y]) = axes(profile, user_path, component).map(|axes| axes.map(one)) else {
            return Some(one(component));
        };
        let value = InputValue::Vector([x.value.as_vector()[0], y.value.as_vector()[0]]);
        Some(Reading { value, changed_ns: x.changed_ns.max(y.changed_ns) })
    }

    /// The profile of the device that is connected there.
    pub fn profile(&self, user_path: &str) -> Option<&'static Profile> {
        self.0.get(user_path)?.profile
    }

    /// The user paths where devices are connected.
    pub fn connected(&self) -> impl Iterator<Item = (&'static str, &'static Profile)> {
        self.0.iter().filter_map(|(user_path, device)| Some((*user_path, device.profile?)))
    }

    /// A new track in STAGE space for a pose such as `/user/hand/left/input/grip/pose`.
    pub fn set_track(&mut self, path: &str, track: PoseTrack) -> Result<(), InputError> {
        let (user_path, component) = split(path)?;
        if component.kind != Kind::Pose {
            return Err(InputError::WrongKind { path: path.to_owned(), wanted: component.kind });
        }
        self.0.entry(user_path).or_default().tracks.insert(component.subpath.to_owned(), track);
        Ok(())
    }

    pub fn set_tracking(&mut self, user_path: &str, tracking: Tracking) -> Result<(), InputError> {
        self.0.entry(known_user_path(user_path)?).or_default().tracking = Some(tracking);
        Ok(())
    }

    /// What the tracking system says of a device.
    pub fn tracking(&self, user_path: &str) -> Tracking {
        self.0.get(user_path).and_then(|device| device.tracking).unwrap_or(Tracking::FULL)
    }

    /// Whether the bare hand at a user path is seen.
    pub fn set_bare(&mut self, user_path: &str, seen: bool) -> Result<(), InputError> {
        let user_path = known_user_path(user_path)?;
        if Side::of(user_path).is_none() {
            return Err(InputError::UnknownUserPath(user_path.to_owned()));
        }
        self.0.entry(user_path).or_default().bare = seen;
        Ok(())
    }

    /// How the hand at a user path is bent.
    pub fn bend(&mut self, user_path: &str, bent: hand::Curl) -> Result<(), InputError> {
        let user_path = known_user_path(user_path)?;
        if Side::of(user_path).is_none() {
            return Err(InputError::UnknownUserPath(user_path.to_owned()));
        }
        self.0.entry(user_path).or_default().bent = bent;
        Ok(())
    }

    /// What the joints of a hand are known from, the best first: the device it holds, the hand that is seen.
    pub fn hand_sources(&self, side: Side) -> impl Iterator<Item = Source> {
        let device = self.0.get(side.user_path());
        let held = device.filter(|it| it.profile.is_some()).map(|_| Source::Controller);
        let seen = device.filter(|it| it.bare).map(|_| Source::Unobstructed);
        held.into_iter().chain(seen)
    }

    /// Where a pose of a device is in STAGE space. What has no track of its own is fixed to the grip.
    pub fn pose(&self, user_path: &str, subpath: &str, time_s: f64) -> Pose {
        let tracks = self.0.get(user_path).map(|device| &device.tracks);
        let track = |subpath: &str| tracks.and_then(|all| all.get(subpath)).map(|it| it.sample(time_s));
        if let Some(pose) = track(subpath) {
            return pose;
        }
        let grip = track(GRIP)
            .or_else(|| track(AIM).map(|aim| aim.then(GRIP_FROM_AIM.inverse())))
            .unwrap_or_else(|| rest_pose(user_path));
        grip.then(self.pose_in_grip(user_path, subpath))
    }

    /// A pose of a device in the space of its grip.
    fn pose_in_grip(&self, user_path: &str, subpath: &str) -> Pose {
        let joints = || Side::of(user_path).map(|side| hand::joints_in_grip(side, self.curl(side)));
        match subpath {
            AIM => GRIP_FROM_AIM,
            "/input/poke_ext/pose" => joints().map_or(Pose::IDENTITY, |joints| joints[hand::INDEX_TIP].pose),
            "/input/pinch_ext/pose" => joints().map_or(Pose::IDENTITY, |joints| {
                let tips = [hand::THUMB_TIP, hand::INDEX_TIP].map(|tip| joints[tip].pose.position);
                Pose { position: tips[0].midpoint(tips[1]), ..GRIP_FROM_AIM }
            }),
            _ => Pose::IDENTITY,
        }
    }

    /// How far the index finger and the other fingers are bent, [0, 1] each, from what is pressed.
    pub fn curl(&self, side: Side) -> hand::Curl {
        let user_path = side.user_path();
        let most = |identifiers: &[&str]| {
            let components = self.profile(user_path).map_or(&[][..], |profile| profile.components);
            components
                .iter()
                .filter(|it| identifiers.contains(&it.identifier()) && it.is_at(user_path))
                .filter(|it| matches!(it.kind, Kind::Boolean | Kind::Float))
                .filter(|it| !it.subpath.ends_with("/touch") && !it.subpath.ends_with("/ready_ext"))
                .filter_map(|it| self.read(user_path, it.subpath))
                .map(|reading| reading.value.as_vector()[0])
                .fold(0.0, f32::max)
        };
        let bent = self.0.get(user_path).map(|device| device.bent).unwrap_or_default();
        hand::Curl {
            index: bent.index.max(most(&["/input/trigger", "/input/select", "/input/pinch_ext"])),
            others: bent.others.max(most(&["/input/squeeze", "/input/grasp_ext"])),
            pinch: bent.pinch,
        }
    }
}

pub const GRIP: &str = "/input/grip/pose";
const AIM: &str = "/input/aim/pose";

/// A device is held so that its handle leans forward by an eighth of a turn when it points ahead.
const GRIP_FROM_AIM: Pose = Pose {
    position: Vec3::new(0.0, 0.0, -0.05),
    // A rotation about x by -45 degrees.
    orientation: Quat::from_xyzw(-0.382_683_43, 0.0, 0.0, 0.923_879_5),
};

/// Where the grip of a device without a track is in STAGE space: hands below and before the eyes of a standing person.
fn rest_pose(user_path: &str) -> Pose {
    let x = match Side::of(user_path) {
        Some(Side::Left) => -0.2,
        Some(Side::Right) => 0.2,
        None => 0.0,
    };
    Pose::new(Vec3::new(x, 1.2, -0.35), Quat::from_rotation_x(FRAC_PI_4))
}

/// The components that a vector component is made of, where the profile has them.
fn axes(profile: &Profile, user_path: &str, component: &Component) -> Option<[&'static Component; 2]> {
    if component.kind != Kind::Vector {
        return None;
    }
    let axis = |name: &str| {
        let of_this =
            |it: &&Component| it.is_at(user_path) && it.subpath.strip_prefix(component.subpath) == Some(name);
        profile.components.iter().find(of_this)
    };
    Some([axis("/x")?, axis("/y")?])
}
