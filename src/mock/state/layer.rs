//! Composition layers as the application submits them, and the rules they must keep.

use openxr::sys;

use super::{State, space::check_pose, swapchain::Swapchain};
use crate::mock::{
    fault::{Outcome, require},
    pose::Fov,
};

/// All bits of XrCompositionLayerFlags but those of extensions that are not offered.
const LAYER_FLAGS: u64 = 0x7;

/// A layer, converted at the boundary.
pub enum Layer {
    Projection { space: sys::Space, flags: sys::CompositionLayerFlags, views: [LayerView; 2] },
    Quad { space: sys::Space, flags: sys::CompositionLayerFlags, quad: LayerQuad },
    Cylinder { space: sys::Space, flags: sys::CompositionLayerFlags, cylinder: LayerCylinder },
    Cube { space: sys::Space, flags: sys::CompositionLayerFlags, cube: LayerCube },
}

/// A flat rectangle.
#[derive(Clone, Copy)]
pub struct LayerQuad {
    pub eyes: sys::EyeVisibility,
    pub image: sys::SwapchainSubImage,
    pub pose: sys::Posef,
    pub size: sys::Extent2Df,
}

/// A part of a cylinder's inside.
#[derive(Clone, Copy)]
pub struct LayerCylinder {
    pub eyes: sys::EyeVisibility,
    pub image: sys::SwapchainSubImage,
    pub pose: sys::Posef,
    pub radius: f32,
    pub central_angle: f32,
    pub aspect_ratio: f32,
}

/// A cubemap around the viewer, infinitely far.
#[derive(Clone, Copy)]
pub struct LayerCube {
    pub eyes: sys::EyeVisibility,
    pub swapchain: sys::Swapchain,
    pub image_array_index: u32,
    pub orientation: sys::Quaternionf,
}

#[derive(Clone, Copy)]
pub struct LayerView {
    pub pose: sys::Posef,
    pub fov: sys::Fovf,
    pub image: sys::SwapchainSubImage,
    pub depth: Option<LayerDepth>,
}

#[derive(Clone, Copy)]
pub struct LayerDepth {
    pub image: sys::SwapchainSubImage,
    pub min_depth: f32,
    pub max_depth: f32,
    pub near_z: f32,
    pub far_z: f32,
}

impl State {
    pub fn check_layer(&self, session: sys::Session, layer: &Layer) -> Outcome<()> {
        let (Layer::Projection { space, flags, .. }
        | Layer::Quad { space, flags, .. }
        | Layer::Cylinder { space, flags, .. }
        | Layer::Cube { space, flags, .. }) = layer;
        self.space_of(session, *space)?;
        require!(
            flags.into_raw() & !LAYER_FLAGS == 0,
            ERROR_VALIDATION_FAILURE,
            "layerFlags {:#x} contain unknown bits",
            flags.into_raw()
        );
        match layer {
            Layer::Projection { views, .. } => self.check_projection(session, views),
            Layer::Quad { quad, .. } => self.check_quad(session, quad),
            Layer::Cylinder { cylinder, .. } => self.check_cylinder(session, cylinder),
            Layer::Cube { cube, .. } => self.check_cube(session, cube),
        }
    }

    fn check_quad(&self, session: sys::Session, quad: &LayerQuad) -> Outcome<()> {
        check_eyes(quad.eyes)?;
        check_pose(quad.pose, "the quad's pose")?;
        let size = quad.size;
        require!(
            size.width >= 0.0 && size.height >= 0.0 && size.width.is_finite() && size.height.is_finite(),
            ERROR_VALIDATION_FAILURE,
            "the quad's size {} x {} is negative or no number",
            size.width,
            size.height
        );
        self.check_image(session, &quad.image, false)
    }

    fn check_cylinder(&self, session: sys::Session, cylinder: &LayerCylinder) -> Outcome<()> {
        check_eyes(cylinder.eyes)?;
        check_pose(cylinder.pose, "the cylinder's pose")?;
        require!(
            (0.0..=f32::INFINITY).contains(&cylinder.radius),
            ERROR_VALIDATION_FAILURE,
            "the cylinder's radius {} is negative",
            cylinder.radius
        );
        require!(
            (0.0..std::f32::consts::TAU).contains(&cylinder.central_angle),
            ERROR_VALIDATION_FAILURE,
            "the cylinder's central angle {} is not from 0 to less than a whole turn",
            cylinder.central_angle
        );
        require!(
            cylinder.aspect_ratio > 0.0 && cylinder.aspect_ratio.is_finite(),
            ERROR_VALIDATION_FAILURE,
            "the cylinder's aspect ratio {} is not positive",
            cylinder.aspect_ratio
        );
        self.check_image(session, &cylinder.image, false)
    }

    fn check_cube(&self, session: sys::Session, cube: &LayerCube) -> Outcome<()> {
        check_eyes(cube.eyes)?;
        let position = sys::Vector3f::default();
        check_pose(sys::Posef { orientation: cube.orientation, position }, "the cube's orientation")?;
        let swapchain = self.check_swapchain(session, cube.swapchain, false)?;
        require!(
            swapchain.is_cube(),
            ERROR_VALIDATION_FAILURE,
            "the cube's swapchain was not created with faceCount 6"
        );
        require!(
            cube.image_array_index < swapchain.array_size,
            ERROR_VALIDATION_FAILURE,
            "imageArrayIndex {} is outside a cube swapchain of arraySize {}",
            cube.image_array_index,
            swapchain.array_size
        );
        Ok(())
    }

    fn check_projection(&self, session: sys::Session, views: &[LayerView; 2]) -> Outcome<()> {
        for view in views {
            check_pose(view.pose, "the projection view's pose")?;
            require!(
                Fov::from_xr(view.fov).is_valid(),
                ERROR_VALIDATION_FAILURE,
                "the field of view {:?} is not within a quarter turn",
                view.fov
            );
            self.check_image(session, &view.image, false)?;
            if let Some(depth) = &view.depth {
                self.check_depth(session, depth)?;
            }
        }
        let with_depth = views.iter().filter(|view| view.depth.is_some()).count();
        require!(
            with_depth == 0 || with_depth == views.len(),
            ERROR_VALIDATION_FAILURE,
            "{} of {} views have depth; all must or none",
            with_depth,
            views.len()
        );
        Ok(())
    }

    fn check_depth(&self, session: sys::Session, depth: &LayerDepth) -> Outcome<()> {
        let (min, max) = (depth.min_depth, depth.max_depth);
        require!(
            0.0 <= min && min < max && max <= 1.0,
            ERROR_VALIDATION_FAILURE,
            "minDepth {} and maxDepth {} are not an interval within [0, 1]",
            min,
            max
        );
        require!(
            depth.near_z > 0.0 && depth.far_z > 0.0 && depth.near_z != depth.far_z,
            ERROR_VALIDATION_FAILURE,
            "nearZ {} and farZ {} must be positive and differ",
            depth.near_z,
            depth.far_z
        );
        self.check_image(session, &depth.image, true)
    }

    /// A living swapchain of this session, of depth or of colour, an image of which was released.
    fn check_swapchain(
        &self,
        session: sys::Session,
        handle: sys::Swapchain,
        depth: bool,
    ) -> Outcome<&Swapchain> {
        let swapchain = self.swapchains.get(handle)?;
        require!(
            swapchain.session == session,
            ERROR_VALIDATION_FAILURE,
            "the swapchain belongs to another session"
        );
        require!(
            swapchain.released.is_some(),
            ERROR_LAYER_INVALID,
            "no image of the swapchain has ever been released"
        );
        require!(
            swapchain.spec.is_depth() == depth,
            ERROR_VALIDATION_FAILURE,
            "a swapchain of format {:?} is given where {} is wanted",
            swapchain.spec.format,
            if depth { "depth" } else { "colour" }
        );
        Ok(swapchain)
    }

    /// A sub-image: its swapchain, array index and rectangle inside.
    fn check_image(&self, session: sys::Session, image: &sys::SwapchainSubImage, depth: bool) -> Outcome<()> {
        let swapchain = self.check_swapchain(session, image.swapchain, depth)?;
        require!(
            image.image_array_index < swapchain.array_size && !swapchain.is_cube(),
            ERROR_VALIDATION_FAILURE,
            "imageArrayIndex {} is outside a flat swapchain of arraySize {}",
            image.image_array_index,
            swapchain.array_size
        );
        let (offset, extent) = (image.image_rect.offset, image.image_rect.extent);
        let fits = |offset: i32, extent: i32, limit: u32| {
            offset >= 0 && extent > 0 && i64::from(offset) + i64::from(extent) <= i64::from(limit)
        };
        let [width, height] = swapchain.spec.size;
        require!(
            fits(offset.x, extent.width, width) && fits(offset.y, extent.height, height),
            ERROR_SWAPCHAIN_RECT_INVALID,
            "the rectangle {:?} does not lie in {} x {} pixels",
            image.image_rect,
            width,
            height
        );
        Ok(())
    }
}

fn check_eyes(eyes: sys::EyeVisibility) -> Outcome<()> {
    require!(
        (0..=2).contains(&eyes.into_raw()),
        ERROR_VALIDATION_FAILURE,
        "eyeVisibility {:?} is unknown",
        eyes
    );
    Ok(())
}
