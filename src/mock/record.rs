//! What the application submitted: one record per ended frame, with pixels when they are read back.

use ash::vk;
use glam::Quat;
use openxr::sys;

use super::pose::{Fov, Pose};

/// A frame as given to `xrEndFrame`.
#[derive(Clone, Debug, Default)]
pub struct SubmittedFrame {
    /// Counted from the session's first `xrWaitFrame`, which is 0.
    pub index: u64,
    /// The display time the application gave, nanoseconds.
    pub display_time_ns: i64,
    /// The display time `xrWaitFrame` had predicted for this frame, nanoseconds.
    pub predicted_display_time_ns: i64,
    /// The predicted display time on the script's clock: seconds since the session's first frame.
    pub script_time_s: f64,
    /// Whether the runtime had asked for pictures.
    pub should_render: bool,
    /// Layers of all types.
    pub layer_count: u32,
    /// The flags of the first projection layer: whether it is blended, and how.
    pub projection_flags: sys::CompositionLayerFlags,
    /// Whether the views of the first projection layer are, to the last bit, what the last `xrLocateViews` for the frame's
    /// display time and the layer's space answered; `None` without one.
    pub as_located: Option<bool>,
    /// The views of the first projection layer; empty without one.
    pub views: Vec<SubmittedView>,
    /// The first cube layer.
    pub cube: Option<SubmittedCube>,
    /// All quad layers, in the order of the layers.
    pub quads: Vec<SubmittedQuad>,
    /// All cylinder layers, in the order of the layers.
    pub cylinders: Vec<SubmittedCylinder>,
}

/// A flat rectangle in space.
#[derive(Clone, Debug)]
pub struct SubmittedQuad {
    /// Where it is among the frame's layers; those after it are in front.
    pub layer: u32,
    /// As submitted.
    pub flags: sys::CompositionLayerFlags,
    /// Which eyes see it.
    pub eyes: sys::EyeVisibility,
    /// Its middle in the layer's space; it faces +z.
    pub pose: Pose,
    /// Width and height, metres.
    pub size_m: [f32; 2],
    /// The sub-image's size, pixels.
    pub pixels: [u32; 2],
    /// As [`SubmittedView::rgba`]. Empty unless read back.
    pub rgba: Vec<u8>,
}

/// A layer of `XR_KHR_composition_layer_cylinder`: a part of a cylinder's inside.
#[derive(Clone, Debug)]
pub struct SubmittedCylinder {
    /// Where it is among the frame's layers; those after it are in front.
    pub layer: u32,
    /// As submitted.
    pub flags: sys::CompositionLayerFlags,
    /// Which eyes see it.
    pub eyes: sys::EyeVisibility,
    /// The cylinder's middle in the layer's space; its axis is y.
    pub pose: Pose,
    /// Metres; 0 and infinity are infinitely far.
    pub radius_m: f32,
    /// Radians.
    pub central_angle: f32,
    /// Visible width over visible height.
    pub aspect_ratio: f32,
    /// The sub-image's size, pixels.
    pub pixels: [u32; 2],
    /// As [`SubmittedView::rgba`]. Empty unless read back.
    pub rgba: Vec<u8>,
}

/// A layer of `XR_KHR_composition_layer_cube`.
///
/// The specification makes its pixels those of "direct sampling from cubemaps" with the direction of the gaze in the
/// layer's own axes, and says nothing of handedness: so the faces are those of Vulkan ("Cube Map Face Selection"),
/// looked up with the direction as it is, without a mirror.
#[derive(Clone, Debug)]
pub struct SubmittedCube {
    /// Where it is among the frame's layers; those after it are in front.
    pub layer: u32,
    /// As submitted.
    pub flags: sys::CompositionLayerFlags,
    /// Which eyes see it.
    pub eyes: sys::EyeVisibility,
    /// Turns the cube's axes to those of the layer's space.
    pub orientation: Quat,
    /// Pixels per side of a face.
    pub face: u32,
    /// The faces +x −x +y −y +z −z, each as [`SubmittedView::rgba`]. Empty unless read back.
    pub rgba: Vec<u8>,
}

/// One view of a projection layer.
#[derive(Clone, Debug)]
pub struct SubmittedView {
    /// In the layer's space.
    pub pose: Pose,
    /// As submitted.
    pub fov: Fov,
    /// Where the sub-image begins in its image, pixels.
    pub offset: [i32; 2],
    /// The sub-image's size, pixels.
    pub size: [u32; 2],
    /// The sub-image's layer in its image.
    pub array_index: u32,
    /// Rows from the top, 4 bytes per pixel, RGBA as stored (so sRGB-encoded in an sRGB format; float images are
    /// clamped to [0, 1] and sRGB-encoded). Empty unless read back.
    pub rgba: Vec<u8>,
    /// The depth submitted with the view.
    pub depth: Option<SubmittedDepth>,
}

/// Depth submitted through `XR_KHR_composition_layer_depth`.
#[derive(Clone, Debug)]
pub struct SubmittedDepth {
    /// The sub-image's size, pixels.
    pub size: [u32; 2],
    /// Least value in the image.
    pub min_depth: f32,
    /// Greatest value in the image.
    pub max_depth: f32,
    /// Distance at `min_depth`, metres.
    pub near_z: f32,
    /// Distance at `max_depth`, metres.
    pub far_z: f32,
    /// Rows from the top, [0, 1]. Empty unless read back.
    pub values: Vec<f32>,
}

impl SubmittedView {
    /// The pixel at column x and row y, when read back.
    pub fn pixel(&self, x: u32, y: u32) -> Option<[u8; 4]> {
        if x >= self.size[0] || y >= self.size[1] {
            return None;
        }
        let start = 4 * (y as usize * self.size[0] as usize + x as usize);
        self.rgba.get(start..start + 4)?.try_into().ok()
    }
}

/// RGBA bytes from the raw texels of a colour format the runtime offers.
pub fn rgba_from_texels(format: vk::Format, texels: Vec<u8>) -> Vec<u8> {
    match format {
        vk::Format::B8G8R8A8_SRGB | vk::Format::B8G8R8A8_UNORM => {
            let mut bytes = texels;
            bytes.chunks_exact_mut(4).for_each(|pixel| pixel.swap(0, 2));
            bytes
        }
        vk::Format::R16G16B16A16_SFLOAT => texels
            .chunks_exact(8)
            .flat_map(|texel| {
                let channel = |i: usize| f32_from_half([texel[2 * i], texel[2 * i + 1]]);
                [srgb_byte(channel(0)), srgb_byte(channel(1)), srgb_byte(channel(2)), unit_byte(channel(3))]
            })
            .collect(),
        _ => texels,
    }
}

/// Depth values from the raw texels of the depth aspect.
pub fn depth_from_texels(format: vk::Format, texels: &[u8]) -> Vec<f32> {
    match format {
        vk::Format::D16_UNORM => texels
            .chunks_exact(2)
            .map(|t| f32::from(u16::from_le_bytes([t[0], t[1]])) / f32::from(u16::MAX))
            .collect(),
        vk::Format::D24_UNORM_S8_UINT => texels
            .chunks_exact(4)
            .map(|t| u32::from_le_bytes([t[0], t[1], t[2], 0]) as f32 / 0xFF_FFFF as f32)
            .collect(),
        _ => texels.chunks_exact(4).map(|t| f32::from_le_bytes([t[0], t[1], t[2], t[3]])).collect(),
    }
}

fn unit_byte(x: f32) -> u8 {
    (x.clamp(0.0, 1.0) * 255.0).round() as u8
}

fn srgb_byte(linear: f32) -> u8 {
    let x = linear.clamp(0.0, 1.0);
    unit_byte(if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 })
}

/// IEEE binary16, little-endian. NaN counts as 0.
fn f32_from_half(bytes: [u8; 2]) -> f32 {
    let bits = u16::from_le_bytes(bytes);
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1F), f32::from(bits & 0x3FF));
    sign * match exponent {
        0 => fraction * 2f32.powi(-24),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => 0.0,
        _ => (1.0 + fraction / 1024.0) * 2f32.powi(exponent - 15),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_become_pixels() {
        let bgra = rgba_from_texels(vk::Format::B8G8R8A8_SRGB, vec![1, 2, 3, 4]);
        assert_eq!(bgra, [3, 2, 1, 4]);
        // 1.0, 0.5, 0.0 and 2.0 as half floats.
        let half = vec![0x00, 0x3C, 0x00, 0x38, 0x00, 0x00, 0x00, 0x40];
        let rgba = rgba_from_texels(vk::Format::R16G16B16A16_SFLOAT, half);
        assert_eq!(rgba, [255, 188, 0, 255]);
    }

    #[test]
    fn texels_become_depths() {
        assert_eq!(depth_from_texels(vk::Format::D16_UNORM, &[0xFF, 0xFF]), [1.0]);
        let d24 = depth_from_texels(vk::Format::D24_UNORM_S8_UINT, &[0, 0, 0, 77]);
        assert_eq!(d24, [0.0]);
        let d32 = depth_from_texels(vk::Format::D32_SFLOAT, &0.25f32.to_le_bytes());
        assert_eq!(d32, [0.25]);
    }
}
