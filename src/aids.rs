//! PURE: what is drawn over the land for a person in a headset: hands and their rays, the way back, a grid that stands
//! still, and what spares the stomach.
//!
//! Positions are in metres of the play space from the seat, axes as the play space's, unless something else is said.
//! What is not drawn costs nothing.

use glam::{Quat, Vec3};

use crate::controllers::ControllerSettings;
use crate::rig::Pose;

/// Most points of [`Aids::thread`] and of [`Aids::arc`].
pub const MOST_POINTS: usize = 64;

/// What is drawn over the land in a frame. [`Aids::default`] is nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Aids {
    /// Left, right; None: no hand is seen there.
    pub hands: [Option<HandAid>; 2],
    /// Hands are not drawn themselves: their rays and what they hold are.
    pub no_models: bool,
    /// The arc of a step through the air, from the hand on; no points, no arc.
    pub arc: Points,
    /// Whether [`Aids::arc`] ends where one can stand.
    pub arc_lands: bool,
    /// The way one came, from here outwards; no points, no thread.
    pub thread: Points,
    /// How clearly the grid is seen that stands still in the play space, on the floor and at the horizon, 0 to 1.
    pub grid: f32,
    /// How far below the seat the grid's floor is, in metres; up is the play space's.
    pub floor_m: f32,
    /// The field of view, narrowed; None: it is as wide as the headset's.
    pub vignette: Option<Vignette>,
    /// How far the picture is faded to black, 0 (not at all) to 1.
    pub fade: f32,
    /// Whatever [`Aids::fade`] says, a picture is black that shows the wearer elsewhere of a sudden by nobody's wish: the
    /// first one that he sees, and the first after the origin has moved or he is tracked again.
    pub blinks: bool,
}

/// A hand, or what it holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandAid {
    /// Where it is, as OpenXR's grip poses.
    pub grip: Pose,
    /// Where it points, along −z; None: nowhere.
    pub aim: Option<Pose>,
    /// Length of its ray in metres, up to what it meets; None: no ray.
    pub ray_m: Option<f32>,
    /// It holds the land: between its hands, or dragging it.
    pub holds: bool,
}

/// Up to [`MOST_POINTS`] points of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Points {
    all: [Vec3; MOST_POINTS],
    count: usize,
}

/// The picture is darkened from an angle around the middle of the view on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vignette {
    /// Radians from the middle of the view from which on it darkens.
    pub inner: f32,
    /// Radians at which it is black; beyond [`Vignette::inner`].
    pub outer: f32,
    /// How dark it gets, 0 to 1.
    pub strength: f32,
}

/// Where the panel hangs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PanelAid {
    /// Its middle; it faces +z of its own axes.
    pub pose: Pose,
    /// Width and height in metres.
    pub size_m: [f32; 2],
}

impl Aids {
    /// Leaves out what a person does not want to see of the hands.
    pub fn heed(&mut self, settings: &ControllerSettings) {
        self.no_models = !settings.models;
        for hand in self.hands.iter_mut().flatten().filter(|_| !settings.rays) {
            hand.ray_m = None;
        }
    }

    /// Whether anything is drawn over the land but the panel: hands, ways, the grid.
    pub fn has_shapes(&self) -> bool {
        self.hands.iter().any(Option::is_some) || self.arc.count + self.thread.count > 0 || self.grid > 0.0
    }
}

impl Default for Points {
    fn default() -> Points {
        Points { all: [Vec3::ZERO; MOST_POINTS], count: 0 }
    }
}

impl Points {
    /// Adds a point, if there is room.
    pub fn push(&mut self, point: Vec3) {
        if let Some(place) = self.all.get_mut(self.count) {
            *place = point;
            self.count += 1;
        }
    }

    /// All of them.
    pub fn as_slice(&self) -> &[Vec3] {
        &self.all[..self.count]
    }
}

impl HandAid {
    /// A unit vector along which it points, with its beginning.
    pub fn ray(&self) -> Option<(Vec3, Vec3)> {
        self.aim.map(|aim| (aim.position, aim.orientation * Vec3::NEG_Z))
    }
}

/// The pose of a panel at `position` that faces `eye`, upright along `up`.
pub fn facing(position: Vec3, eye: Vec3, up: Vec3) -> Pose {
    let back = (eye - position).try_normalize().unwrap_or(Vec3::Z);
    let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
    let orientation = Quat::from_mat3(&glam::Mat3::from_cols(right, back.cross(right), back));
    Pose { position, orientation: orientation.normalize() }
}
