//! The mirror: which part of which eye's picture is shown where in the window, and showing it.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use winit::window::Window;

use crate::gpu::{Gpu, Image, Lost, Presenter, Shown};
use crate::settings::Side;

/// A rectangle of the window that shows a part of an eye's picture, undistorted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pane {
    /// The eye: 0 is the left one.
    pub eye: usize,
    /// Corners in the window: left, top, right, bottom, pixels.
    pub window: [i32; 4],
    /// Corners in the eye's picture, pixels.
    pub picture: [i32; 4],
    /// Tangents of the angles at its sides: left, top, right, bottom; up is above 0.
    pub tangents: [f64; 4],
}

impl Pane {
    /// The largest part of an eye's picture that has the shape of a rectangle of the window, as near to straight ahead as
    /// the picture allows. `fov`: left, right, up, down in radians; `size`: pixels of the picture. None without an area.
    pub fn new(eye: usize, window: [i32; 4], fov: [f32; 4], size: [u32; 2]) -> Option<Pane> {
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
        let [columns, rows] = size.map(f64::from);
        // At least a pixel, inside the picture.
        let span = |from: f64, length: f64, whole: f64| {
            let from = (from * whole).round().clamp(0.0, whole - 1.0);
            [from as i32, (from + (length * whole).round()).clamp(from + 1.0, whole) as i32]
        };
        let [x0, x1] = span((left - l) / width, across / width, columns);
        let [y0, y1] = span((u - top) / height, along / height, rows);
        let tangents = [left, top, left + across, top - along];
        Some(Pane { eye, window, picture: [x0, y0, x1, y1], tangents })
    }

    /// Tangents to the right and up of what is seen at a point of the window; None outside this pane.
    pub fn seen_at(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let [x0, y0, x1, y1] = self.window.map(f64::from);
        let [left, top, right, bottom] = self.tangents;
        let inside = (x0..=x1).contains(&x) && (y0..=y1).contains(&y);
        let share = [(x - x0) / (x1 - x0), (y - y0) / (y1 - y0)];
        inside.then(|| [left + (right - left) * share[0], top + (bottom - top) * share[1]])
    }

    fn blit(&self) -> vk::ImageBlit {
        let corners = |[x0, y0, x1, y1]: [i32; 4]| {
            [vk::Offset3D { x: x0, y: y0, z: 0 }, vk::Offset3D { x: x1, y: y1, z: 1 }]
        };
        let layer = |base_array_layer| vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: 0,
            base_array_layer,
            layer_count: 1,
        };
        vk::ImageBlit::default()
            .src_subresource(layer(self.eye as u32))
            .src_offsets(corners(self.picture))
            .dst_subresource(layer(0))
            .dst_offsets(corners(self.window))
    }
}

/// The panes of a window of so many pixels.
pub fn panes(
    side: Side,
    window: [u32; 2],
    fov: [[f32; 4]; 2],
    size: [u32; 2],
) -> impl Iterator<Item = Pane> + Clone {
    let [width, height] = window.map(|pixels| i32::try_from(pixels).unwrap_or(i32::MAX));
    let middle = width / 2;
    let windows = match side {
        Side::Left => [Some([0, 0, width, height]), None],
        Side::Right => [None, Some([0, 0, width, height])],
        Side::Both => [Some([0, 0, middle, height]), Some([middle, 0, width, height])],
    };
    (0..2).filter_map(move |eye| Pane::new(eye, windows[eye]?, fov[eye], size))
}

/// Shows eyes' pictures in the window, and never waits for it.
pub struct Mirror {
    presenter: Presenter,
}

impl Mirror {
    /// For a window that has no other mirror.
    ///
    /// # Errors
    /// A sentence that says why nothing can be shown there.
    pub fn new(gpu: &Arc<Gpu>, window: &Arc<Window>) -> Result<Mirror> {
        Ok(Mirror { presenter: Presenter::new(gpu, window)? })
    }

    /// Shows parts of `image`, whose layers are the eyes' pictures, in a window of so many pixels.
    ///
    /// # Errors
    /// The device is lost.
    pub fn show(
        &mut self,
        image: &Image,
        side: Side,
        window: [u32; 2],
        fov: [[f32; 4]; 2],
    ) -> Result<Shown, Lost> {
        let size = vk::Extent2D { width: window[0], height: window[1] };
        self.presenter.show(size, |commands, target| {
            let to = (target.raw, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
            let from = (image.raw, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
            // The window's pictures may be of another size than it has by now.
            let window = [target.extent.width, target.extent.height];
            for pane in panes(side, window, fov, [image.extent.width, image.extent.height]) {
                commands.blit(from, to, &[pane.blit()]);
            }
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_pane_is_undistorted_inside_the_picture_and_as_large_as_can_be(
            left in 0.3f32..1.2, right in 0.3f32..1.2, up in 0.3f32..1.2, down in 0.3f32..1.2,
            window in [400i32..4000, 400i32..4000],
            size in [1000u32..4000, 1000u32..4000],
        ) {
            let pane = Pane::new(0, [0, 0, window[0], window[1]], [-left, right, up, -down], size).unwrap();
            let [x0, y0, x1, y1] = pane.picture;
            prop_assert!(x0 >= 0 && y0 >= 0 && x1 <= size[0] as i32 && y1 <= size[1] as i32);
            // A pixel of the window is as wide as it is high, in tangents.
            let [l, t, r, b] = pane.tangents;
            let (wide, high) = ((r - l) / f64::from(window[0]), (t - b) / f64::from(window[1]));
            prop_assert!((wide / high - 1.0).abs() < 1e-9);
            // It reaches both sides one way, and what the picture shows there is what it says.
            let (whole_x, whole_y) = (left.tan() + right.tan(), up.tan() + down.tan());
            let (share_x, share_y) = ((r - l) / f64::from(whole_x), (t - b) / f64::from(whole_y));
            prop_assert!((share_x.max(share_y) - 1.0).abs() < 1e-6);
            prop_assert!((f64::from(x1 - x0) - share_x * f64::from(size[0])).abs() <= 2.0);
            prop_assert!((f64::from(y1 - y0) - share_y * f64::from(size[1])).abs() <= 2.0);
        }
    }

    #[test]
    fn straight_ahead_is_in_the_middle_where_the_picture_allows_it() {
        let fov = [-0.9f32, 0.7, 0.8, -0.8];
        let narrow = Pane::new(0, [0, 0, 500, 1000], fov, [1000, 1000]).unwrap();
        let [x, y] = narrow.seen_at([250.0, 500.0]).unwrap();
        assert!(x.abs() < 1e-9 && y.abs() < 1e-9, "{x} {y}");
        let wide = Pane::new(0, [0, 0, 2000, 500], fov, [1000, 1000]).unwrap();
        assert_eq!([wide.picture[0], wide.picture[2]], [0, 1000]);
        assert!(wide.seen_at([2001.0, 0.0]).is_none());
    }

    #[test]
    fn the_panes_cover_every_window_whatever_its_size() {
        for window in [[1, 1], [2, 1], [3, 700], [1001, 601]] {
            for side in [Side::Left, Side::Right, Side::Both] {
                let panes = panes(side, window, [[-0.8, 0.8, 0.8, -0.8]; 2], [64, 64]);
                let area: i64 = panes
                    .map(|pane| {
                        let [x0, y0, x1, y1] = pane.window.map(i64::from);
                        (x1 - x0) * (y1 - y0)
                    })
                    .sum();
                assert_eq!(area, i64::from(window[0]) * i64::from(window[1]), "{window:?} {side:?}");
            }
        }
        assert_eq!(panes(Side::Both, [0, 0], [[-0.8, 0.8, 0.8, -0.8]; 2], [64, 64]).count(), 0);
    }
}
