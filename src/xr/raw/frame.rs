//! What a frame is made of: when it is wanted, where the eyes are then, and the layers it shows.

#![allow(unsafe_code, reason = "calls the C interface of the OpenXR runtime")]

use std::ptr;

use openxr::sys;

use super::{RawSession, STEREO};
use crate::xr::arrays::ATTEMPTS;
use crate::xr::error::Error;

/// One eye of a projection layer.
pub(in crate::xr) struct LayerEye {
    pub(in crate::xr) pose: sys::Posef,
    pub(in crate::xr) fov: sys::Fovf,
    pub(in crate::xr) color: sys::SwapchainSubImage,
    pub(in crate::xr) depth: Option<sys::SwapchainSubImage>,
}

/// A cube layer, behind everything.
pub(in crate::xr) struct CubeLayer {
    pub(in crate::xr) swapchain: sys::Swapchain,
    /// Turns the cube's axes to those of the frame's space.
    pub(in crate::xr) orientation: sys::Quaternionf,
}

/// A flat rectangle in front of everything, its colours multiplied by their alpha.
pub(in crate::xr) struct QuadLayer {
    pub(in crate::xr) image: sys::SwapchainSubImage,
    /// Its middle in the frame's space; it faces +z.
    pub(in crate::xr) pose: sys::Posef,
    /// Width and height in metres.
    pub(in crate::xr) size: sys::Extent2Df,
}

/// The projection layer of a frame.
pub(in crate::xr) struct Layer {
    pub(in crate::xr) space: sys::Space,
    pub(in crate::xr) eyes: [LayerEye; 2],
    /// Where depth is 1, in metres; it falls to 0 at infinity.
    pub(in crate::xr) near_m: f32,
    /// What shows where the eyes' pictures are transparent (their colour multiplied by alpha); without it they are
    /// opaque.
    pub(in crate::xr) behind: Option<CubeLayer>,
    /// What is seen before them.
    pub(in crate::xr) front: Option<QuadLayer>,
}

/// Triangles that nobody sees.
pub(in crate::xr) struct HiddenMesh {
    /// On the plane 1 in front of the eye, to the right and upwards.
    pub(in crate::xr) corners: Vec<sys::Vector2f>,
    /// Three of each triangle.
    pub(in crate::xr) indices: Vec<u32>,
}

impl RawSession {
    /// Blocks until the runtime wants the next frame; the queue is free meanwhile.
    pub(in crate::xr) fn wait_frame(&self) -> Result<sys::FrameState, Error> {
        let mut state = sys::FrameState {
            ty: sys::FrameState::TYPE,
            next: ptr::null_mut(),
            predicted_display_time: sys::Time::from_nanos(0),
            predicted_display_period: sys::Duration::NONE,
            should_render: sys::FALSE,
        };
        // SAFETY: a live session and a properly typed structure to fill.
        let code = unsafe { (self.instance.fp().wait_frame)(self.handle, ptr::null(), &mut state) };
        self.check("xrWaitFrame", code).map(|_| state)
    }

    /// The code is `FRAME_DISCARDED` where the frame begun before was never ended.
    pub(in crate::xr) fn begin_frame(&self) -> Result<sys::Result, Error> {
        // SAFETY: a live session; the info may be null.
        self.with_queue("xrBeginFrame", || unsafe {
            (self.instance.fp().begin_frame)(self.handle, ptr::null())
        })
    }

    /// Ends the frame with its layers, the cube behind the projection and the quad before it; without a layer nothing of
    /// it is shown.
    pub(in crate::xr) fn end_frame(
        &self,
        display_time_ns: i64,
        blend: sys::EnvironmentBlendMode,
        layer: Option<&Layer>,
    ) -> Result<(), Error> {
        let depths = layer.map(|layer| {
            layer.eyes.each_ref().map(|eye| {
                eye.depth.map(|sub_image| sys::CompositionLayerDepthInfoKHR {
                    ty: sys::CompositionLayerDepthInfoKHR::TYPE,
                    next: ptr::null(),
                    sub_image,
                    // Reversed and infinite: depth 0 (the smallest) lies at infinity, depth 1 at the near plane.
                    min_depth: 0.0,
                    max_depth: 1.0,
                    near_z: f32::INFINITY,
                    far_z: layer.near_m,
                })
            })
        });
        let views = layer.zip(depths.as_ref()).map(|(layer, depths)| {
            [0, 1].map(|i| sys::CompositionLayerProjectionView {
                ty: sys::CompositionLayerProjectionView::TYPE,
                next: depths[i].as_ref().map_or(ptr::null(), |d| ptr::from_ref(d).cast()),
                pose: layer.eyes[i].pose,
                fov: layer.eyes[i].fov,
                sub_image: layer.eyes[i].color,
            })
        });
        let projection = layer.zip(views.as_ref()).map(|(layer, views)| sys::CompositionLayerProjection {
            ty: sys::CompositionLayerProjection::TYPE,
            next: ptr::null(),
            layer_flags: match layer.behind {
                // Without UNPREMULTIPLIED_ALPHA: the colours are multiplied already.
                Some(_) => sys::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA,
                None => sys::CompositionLayerFlags::EMPTY,
            },
            space: layer.space,
            view_count: views.len() as u32,
            views: views.as_ptr(),
        });
        let cube = layer.and_then(|layer| {
            layer.behind.as_ref().map(|cube| sys::CompositionLayerCubeKHR {
                ty: sys::CompositionLayerCubeKHR::TYPE,
                next: ptr::null(),
                layer_flags: sys::CompositionLayerFlags::EMPTY,
                space: layer.space,
                eye_visibility: sys::EyeVisibility::BOTH,
                swapchain: cube.swapchain,
                image_array_index: 0,
                orientation: cube.orientation,
            })
        });
        let quad = layer.and_then(|layer| {
            layer.front.as_ref().map(|quad| sys::CompositionLayerQuad {
                ty: sys::CompositionLayerQuad::TYPE,
                next: ptr::null(),
                // As above.
                layer_flags: sys::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA,
                space: layer.space,
                eye_visibility: sys::EyeVisibility::BOTH,
                sub_image: quad.image,
                pose: quad.pose,
                size: quad.size,
            })
        });
        // The first is the farthest.
        let mut layers = [ptr::null::<sys::CompositionLayerBaseHeader>(); 3];
        let mut count = 0;
        let cube = cube.as_ref().map(|c| ptr::from_ref(c).cast());
        let projection = projection.as_ref().map(|p| ptr::from_ref(p).cast());
        let quad = quad.as_ref().map(|q| ptr::from_ref(q).cast());
        for layer in [cube, projection, quad].into_iter().flatten() {
            layers[count] = layer;
            count += 1;
        }
        let info = sys::FrameEndInfo {
            ty: sys::FrameEndInfo::TYPE,
            next: ptr::null(),
            display_time: sys::Time::from_nanos(display_time_ns),
            environment_blend_mode: blend,
            layer_count: count as u32,
            layers: if count > 0 { layers.as_ptr() } else { ptr::null() },
        };
        // SAFETY: the structures and what they point to live on this stack until after the call; the swapchains and the
        // space belong to this session and are alive.
        self.with_queue("xrEndFrame", || unsafe { (self.instance.fp().end_frame)(self.handle, &info) })
            .map(drop)
    }

    /// Both eyes in `space`; `Unsupported` when they are not two.
    pub(in crate::xr) fn locate_views(
        &self,
        display_time_ns: i64,
        space: sys::Space,
    ) -> Result<(sys::ViewStateFlags, [sys::View; 2]), Error> {
        let info = sys::ViewLocateInfo {
            ty: sys::ViewLocateInfo::TYPE,
            next: ptr::null(),
            view_configuration_type: STEREO,
            display_time: sys::Time::from_nanos(display_time_ns),
            space,
        };
        let mut state = sys::ViewState {
            ty: sys::ViewState::TYPE,
            next: ptr::null_mut(),
            view_state_flags: sys::ViewStateFlags::EMPTY,
        };
        let mut views = [sys::View {
            ty: sys::View::TYPE,
            next: ptr::null_mut(),
            pose: sys::Posef::default(),
            fov: sys::Fovf::default(),
        }; 2];
        let mut count = 0;
        // SAFETY: a live session and space, room for two properly typed views.
        let code = unsafe {
            (self.instance.fp().locate_views)(
                self.handle,
                &info,
                &mut state,
                views.len() as u32,
                &mut count,
                views.as_mut_ptr(),
            )
        };
        if code == sys::Result::ERROR_SIZE_INSUFFICIENT || (code.into_raw() >= 0 && count != 2) {
            return Err(Error::Unsupported(format!(
                "the OpenXR runtime locates {count} eyes where it announced two: update the headset's software"
            )));
        }
        self.check("xrLocateViews", code)?;
        Ok((state.view_state_flags, views))
    }

    /// The part of an eye's picture that nobody sees. `None` where the runtime has no such extension.
    pub(in crate::xr) fn hidden_area(&self, eye: u32) -> Result<Option<HiddenMesh>, Error> {
        let Some(functions) = self.instance.exts().khr_visibility_mask else { return Ok(None) };
        let (mut vertices, mut indices) = (Vec::new(), Vec::new());
        for _ in 0..ATTEMPTS {
            let mut mask = sys::VisibilityMaskKHR {
                ty: sys::VisibilityMaskKHR::TYPE,
                next: ptr::null_mut(),
                vertex_capacity_input: vertices.len() as u32,
                vertex_count_output: 0,
                vertices: vertices.as_mut_ptr(),
                index_capacity_input: indices.len() as u32,
                index_count_output: 0,
                indices: indices.as_mut_ptr(),
            };
            let kind = sys::VisibilityMaskTypeKHR::HIDDEN_TRIANGLE_MESH;
            // SAFETY: a live session, a properly typed structure, and arrays of the lengths it says.
            let code = unsafe { (functions.get_visibility_mask)(self.handle, STEREO, eye, kind, &mut mask) };
            if code != sys::Result::ERROR_SIZE_INSUFFICIENT {
                self.check("xrGetVisibilityMaskKHR", code)?;
            }
            let (n_vertices, n_indices) =
                (mask.vertex_count_output as usize, mask.index_count_output as usize);
            if n_vertices <= vertices.len() && n_indices <= indices.len() {
                vertices.truncate(n_vertices);
                indices.truncate(n_indices);
                return Ok(Some(HiddenMesh { corners: vertices, indices }));
            }
            vertices.resize(n_vertices, sys::Vector2f { x: 0.0, y: 0.0 });
            indices.resize(n_indices, 0);
        }
        Err(Error::from_code("xrGetVisibilityMaskKHR", sys::Result::ERROR_SIZE_INSUFFICIENT))
    }
}
