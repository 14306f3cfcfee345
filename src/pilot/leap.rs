//! A step through the air: thrown from the hand, along the arc of a ball, to ground on which one can stand.

use super::dive::ground_at;
use super::{Pilot, hold};
use crate::aids::{MOST_POINTS, Points};
use crate::input::Leap;
use crate::rig::COMFORT_M;
use glam::{DVec3, Vec3};

/// Metres per second, per second.
const GRAVITY: f64 = 9.81;

/// Parts of the arc: straight ones, each met by the ground exactly.
const PARTS: usize = MOST_POINTS - 1;

/// Seconds that the ball flies at most; it falls by 120 m in them.
const LONGEST_S: f64 = 5.0;

/// Metres to every side over which the slope is taken: half of what one stands on.
const FOOT_M: f64 = 0.2;

/// A throw that has not been let go of.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Throw {
    /// In metres from the seat.
    pub(super) points: Points,
    /// Where the viewer would be then, from where he is, in anchor tiles.
    lands: Option<DVec3>,
}

impl Pilot {
    /// The arc of the step that the last input asks for, in metres from the seat, and whether one can stand at its end.
    /// No points: none is asked for.
    pub fn arc(&self) -> (&Points, bool) {
        (&self.throw.points, self.throw.lands.is_some())
    }

    /// Throws, and goes there once the hand lets go.
    pub(super) fn leap(&mut self, leap: Option<&Leap>, worn: bool) {
        let throw = leap.map_or_else(Throw::default, |leap| self.throw(leap, worn));
        let goes = leap.is_some_and(|leap| leap.go);
        if let Some(tiles) = throw.lands.filter(|_| goes) {
            self.walk(tiles);
            self.stop();
            self.jumps = self.jumps.wrapping_add(1);
        }
        self.throw = if goes { Throw::default() } else { throw };
    }

    fn throw(&mut self, leap: &Leap, worn: bool) -> Throw {
        let mut throw = Throw::default();
        let Some(ahead) = leap.from.direction.as_dvec3().try_normalize() else { return throw };
        let speed = (f64::from(leap.reach_m) * GRAVITY).sqrt();
        let from = leap.from.origin_m.as_dvec3();
        let at = |part: usize| {
            let s = LONGEST_S * part as f64 / PARTS as f64;
            from + ahead * (speed * s) - DVec3::Y * (0.5 * GRAVITY * s * s)
        };
        let (play_space, tiles) = (self.play_space(worn), self.height() / COMFORT_M);
        throw.points.push(at(0).as_vec3());
        for part in 0..PARTS {
            let (begin, end) = (at(part), at(part + 1));
            let way = end - begin;
            let (length, along) = (way.length(), way.normalize());
            let origin = self.place.position + play_space * begin * tiles;
            let Some(met) = self.probe.ray(&self.place, origin, play_space * along, length * tiles) else {
                throw.points.push(end.as_vec3());
                continue;
            };
            let end = begin + along * (met / tiles);
            throw.points.push(end.as_vec3());
            let ground = self.place.position + play_space * end * tiles;
            throw.lands = self.landing(ground, leap, play_space * leap.head_m.as_dvec3(), tiles);
            break;
        }
        throw
    }

    /// How far the viewer goes whose head comes to be over a point of the ground, as high over it as over what is
    /// nearest now; None: it is too steep to stand there. All in anchor tiles but the way to the head, in metres along the
    /// terrain's axes.
    fn landing(&self, ground: DVec3, leap: &Leap, head_m: DVec3, tiles: f64) -> Option<DVec3> {
        let foot = FOOT_M * tiles;
        let height = |x: f64, z: f64| ground_at(&self.place, [x, z]);
        let rise = |dx: f64, dz: f64| {
            (height(ground.x + dx, ground.z + dz) - height(ground.x - dx, ground.z - dz)) / (2.0 * foot)
        };
        let normal = DVec3::new(-rise(foot, 0.0), 1.0, -rise(0.0, foot)).normalize();
        let slope = normal.angle_between(self.facing.upright * DVec3::Y);
        if slope > f64::from(leap.steepest) {
            return None;
        }
        let [x, z] = [ground.x - head_m.x * tiles, ground.z - head_m.z * tiles];
        let lowest = height(x, z) + hold::NEAREST_M * tiles;
        let y = (height(ground.x, ground.z) + self.ground.most).max(lowest);
        Some(DVec3::new(x, y, z) - self.place.position)
    }

    /// The way that the viewer came, in metres from the seat: from the last crumb on outwards.
    pub fn breadcrumbs(&self, worn: bool) -> impl Iterator<Item = Vec3> {
        let turn = self.play_space(worn).inverse();
        let metres = COMFORT_M / self.height();
        self.trail.ways().map(move |way| (turn * way * metres).as_vec3())
    }
}
