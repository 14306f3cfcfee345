//! Which part of which eye's picture is seen where in the window.

use glam::{DMat3, DQuat, DVec3};

/// Whose pictures the window shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Side {
    /// The left eye's.
    #[default]
    Left,
    /// The right eye's.
    Right,
    /// Both, side by side.
    Both,
    /// A spectator's, who sees from the left eye and holds his head still.
    Spectator,
}

impl Side {
    /// The one after it, round and round.
    pub fn next(self) -> Side {
        match self {
            Side::Left => Side::Right,
            Side::Right => Side::Both,
            Side::Both => Side::Spectator,
            Side::Spectator => Side::Left,
        }
    }

    /// The only eye that is seen, where it is one.
    pub fn only_eye(self) -> Option<usize> {
        (self != Side::Both).then(|| self.eye())
    }

    /// The eye whose picture is taken when one is: 0 is the left one.
    pub fn eye(self) -> usize {
        usize::from(self == Side::Right)
    }
}

/// A rectangle of the window that shows a part of an eye's picture, undistorted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pane {
    /// The eye: 0 is the left one.
    pub eye: usize,
    /// Corners in the window: left, top, right, bottom, pixels.
    pub window: [i32; 4],
    /// Tangents of the angles at its sides: left, top, right, bottom; up is above 0. As seen by a camera in the eye.
    pub tangents: [f64; 4],
    /// Turns the camera's axes to the eye's.
    pub eye_from_camera: DQuat,
    /// From (right, down, 1) in the pane, 0 to 1 from its corner, to (right, down, 1) in the picture, times any number.
    pub picture_from_pane: DMat3,
}

impl Pane {
    /// The largest part of an eye's picture that has the shape of a rectangle of the window, as near to straight ahead as
    /// the picture allows. `fov`: left, right, up, down in radians. None without an area.
    pub fn new(eye: usize, window: [i32; 4], fov: [f32; 4]) -> Option<Pane> {
        let [x, y, right, bottom] = window;
        if right <= x || bottom <= y {
            return None;
        }
        let [l, r, u, d] = fov.map(|angle| f64::from(angle).tan());
        let (width, height) = (r - l, u - d);
        if !(width > 0.0 && height > 0.0 && width.is_finite() && height.is_finite()) {
            return None;
        }
        let shape = f64::from(right - x) / f64::from(bottom - y);
        let (across, along) = (width.min(height * shape), height.min(width / shape));
        let left = (-across / 2.0).min(r - across).max(l);
        let top = (along / 2.0).max(d + along).min(u);
        let tangents = [left, top, left + across, top - along];
        Some(Pane::of(eye, window, fov, tangents, DQuat::IDENTITY))
    }

    /// The same as seen by a camera that is turned in the eye, and sees `share` of it each way.
    pub fn turned(self, fov: [f32; 4], share: f64, eye_from_camera: DQuat) -> Pane {
        let [left, top, right, bottom] = self.tangents;
        let shrink = |from: f64, to: f64| {
            let (middle, half) = ((from + to) / 2.0, (to - from) / 2.0 * share);
            [middle - half, middle + half]
        };
        let ([left, right], [top, bottom]) = (shrink(left, right), shrink(top, bottom));
        Pane::of(self.eye, self.window, fov, [left, top, right, bottom], eye_from_camera)
    }

    fn of(eye: usize, window: [i32; 4], fov: [f32; 4], tangents: [f64; 4], eye_from_camera: DQuat) -> Pane {
        let [l, r, u, d] = fov.map(|angle| f64::from(angle).tan());
        let [left, top, right, bottom] = tangents;
        // Directions are (right, up, backwards).
        let camera_from_pane = DMat3::from_cols(
            DVec3::new(right - left, 0.0, 0.0),
            DVec3::new(0.0, bottom - top, 0.0),
            DVec3::new(left, top, -1.0),
        );
        let (width, height) = (r - l, u - d);
        let picture_from_eye = DMat3::from_cols(
            DVec3::new(1.0 / width, 0.0, 0.0),
            DVec3::new(0.0, -1.0 / height, 0.0),
            DVec3::new(l / width, -u / height, -1.0),
        );
        let picture_from_pane = picture_from_eye * DMat3::from_quat(eye_from_camera) * camera_from_pane;
        Pane { eye, window, tangents, eye_from_camera, picture_from_pane }
    }

    /// The point of the eye's picture, 0 to 1 from its corner, that is shown at a point of the pane, likewise; None where
    /// that is behind the eye.
    pub fn picture_at(&self, [right, down]: [f64; 2]) -> Option<[f64; 2]> {
        let point = self.picture_from_pane * DVec3::new(right, down, 1.0);
        (point.z > 0.0).then(|| [point.x / point.z, point.y / point.z])
    }

    /// Whether every point of the pane shows a point of the picture.
    pub fn is_filled(&self) -> bool {
        let inside = |point: [f64; 2]| point.iter().all(|share| (-EDGE..=1.0 + EDGE).contains(share));
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        corners.into_iter().all(|corner| self.picture_at(corner).is_some_and(inside))
    }

    /// The direction in the eye's axes (right, up, backwards) of what is seen at a point of the window; None outside this
    /// pane.
    pub fn seen_at(&self, [x, y]: [f64; 2]) -> Option<DVec3> {
        let [x0, y0, x1, y1] = self.window.map(f64::from);
        let [left, top, right, bottom] = self.tangents;
        let inside = (x0..=x1).contains(&x) && (y0..=y1).contains(&y);
        let share = [(x - x0) / (x1 - x0), (y - y0) / (y1 - y0)];
        let tangents = [left + (right - left) * share[0], top + (bottom - top) * share[1]];
        inside.then(|| self.eye_from_camera * DVec3::new(tangents[0], tangents[1], -1.0))
    }
}

/// Rounding, as a share of the picture.
const EDGE: f64 = 1e-9;

/// Share of the left eye's pane that a spectator sees, each way: the rest is where the eye may turn meanwhile.
pub const SPECTATOR_SHARE: f64 = 0.8;

/// What the window shows of the eyes' pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sights {
    /// Whose.
    pub side: Side,
    /// Of each eye: left, right, up, down, radians.
    pub fov: [[f32; 4]; 2],
    /// Turns a spectator's axes to the left eye's; None: nobody wears the headset, and the eye is as still as a spectator.
    pub eye_from_spectator: Option<DQuat>,
}

impl Sights {
    /// The panes of a window of so many pixels.
    pub fn panes(self, window: [u32; 2]) -> impl Iterator<Item = Pane> + Clone {
        let [width, height] = window.map(|pixels| i32::try_from(pixels).unwrap_or(i32::MAX));
        let middle = width / 2;
        let windows = match self.side {
            Side::Left | Side::Spectator => [Some([0, 0, width, height]), None],
            Side::Right => [None, Some([0, 0, width, height])],
            Side::Both => [Some([0, 0, middle, height]), Some([middle, 0, width, height])],
        };
        let turn = self.eye_from_spectator.filter(|_| self.side == Side::Spectator);
        (0..2).filter_map(move |eye| {
            let pane = Pane::new(eye, windows[eye]?, self.fov[eye])?;
            Some(turn.map_or(pane, |turn| pane.turned(self.fov[eye], SPECTATOR_SHARE, turn)))
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

    use super::*;
    use proptest::prelude::*;

    const SQUARE: [f32; 4] = [-0.8, 0.8, 0.8, -0.8];

    proptest! {
        #[test]
        fn a_pane_is_undistorted_inside_the_picture_and_as_large_as_can_be(
            left in 0.3f32..1.2, right in 0.3f32..1.2, up in 0.3f32..1.2, down in 0.3f32..1.2,
            window in [400i32..4000, 400i32..4000],
        ) {
            let pane = Pane::new(0, [0, 0, window[0], window[1]], [-left, right, up, -down]).unwrap();
            prop_assert!(pane.is_filled());
            // A pixel of the window is as wide as it is high, in tangents.
            let [l, t, r, b] = pane.tangents;
            let (wide, high) = ((r - l) / f64::from(window[0]), (t - b) / f64::from(window[1]));
            prop_assert!((wide / high - 1.0).abs() < 1e-9);
            // It reaches both sides one way, and what the picture shows there is what it says.
            let (whole_x, whole_y) = (left.tan() + right.tan(), up.tan() + down.tan());
            let (share_x, share_y) = ((r - l) / f64::from(whole_x), (t - b) / f64::from(whole_y));
            prop_assert!((share_x.max(share_y) - 1.0).abs() < 1e-6);
            let ([x0, y0], [x1, y1]) = (pane.picture_at([0.0; 2]).unwrap(), pane.picture_at([1.0; 2]).unwrap());
            prop_assert!((x1 - x0 - share_x).abs() < 1e-6 && (y1 - y0 - share_y).abs() < 1e-6);
        }

        #[test]
        fn what_a_turned_camera_sees_is_where_the_eye_sees_it(
            axis in [-1.0f64..1.0, -1.0f64..1.0, -1.0f64..1.0], angle in -0.2f64..0.2,
            point in [0.0f64..1.0, 0.0f64..1.0],
        ) {
            let axis = DVec3::from(axis).normalize_or(DVec3::Y);
            let turn = DQuat::from_axis_angle(axis, angle);
            let fov = [-0.9, 0.7, 0.8, -0.75];
            let pane = Pane::new(0, [0, 0, 1000, 700], fov).unwrap().turned(fov, 0.7, turn);
            let seen = pane.seen_at([point[0] * 1000.0, point[1] * 700.0]).unwrap();
            let [l, r, u, d] = fov.map(|angle| f64::from(angle).tan());
            let expected = [(seen.x / -seen.z - l) / (r - l), (u - seen.y / -seen.z) / (u - d)];
            let shown = pane.picture_at(point).unwrap();
            prop_assert!((shown[0] - expected[0]).abs() < 1e-9 && (shown[1] - expected[1]).abs() < 1e-9);
        }
    }

    #[test]
    fn straight_ahead_is_in_the_middle_where_the_picture_allows_it() {
        let fov = [-0.9f32, 0.7, 0.8, -0.8];
        let narrow = Pane::new(0, [0, 0, 500, 1000], fov).unwrap();
        let seen = narrow.seen_at([250.0, 500.0]).unwrap();
        assert!(seen.x.abs() < 1e-9 && seen.y.abs() < 1e-9 && seen.z == -1.0, "{seen}");
        let wide = Pane::new(0, [0, 0, 2000, 500], fov).unwrap();
        let across = [wide.picture_at([0.0, 0.5]).unwrap()[0], wide.picture_at([1.0, 0.5]).unwrap()[0]];
        assert!(across[0].abs() < 1e-9 && (across[1] - 1.0).abs() < 1e-9, "{across:?}");
        assert!(wide.seen_at([2001.0, 0.0]).is_none());
    }

    #[test]
    fn the_panes_cover_every_window_whatever_its_size() {
        let all = [Side::Left, Side::Right, Side::Both, Side::Spectator];
        let still = Some(DQuat::IDENTITY);
        for window in [[1, 1], [2, 1], [3, 700], [1001, 601]] {
            for (side, eye_from_spectator) in all.into_iter().flat_map(|side| [(side, None), (side, still)]) {
                let sights = Sights { side, fov: [SQUARE; 2], eye_from_spectator };
                let area: i64 = sights
                    .panes(window)
                    .map(|pane| {
                        let [x0, y0, x1, y1] = pane.window.map(i64::from);
                        (x1 - x0) * (y1 - y0)
                    })
                    .sum();
                assert_eq!(area, i64::from(window[0]) * i64::from(window[1]), "{window:?} {side:?}");
            }
        }
        let both = Sights { side: Side::Both, fov: [SQUARE; 2], eye_from_spectator: None };
        assert_eq!(both.panes([0, 0]).count(), 0);
    }

    #[test]
    fn without_a_headset_a_spectator_sees_what_the_left_eye_sees() {
        let of = |side| Sights { side, fov: [SQUARE; 2], eye_from_spectator: None };
        assert!(of(Side::Spectator).panes([800, 500]).eq(of(Side::Left).panes([800, 500])));
    }
}
