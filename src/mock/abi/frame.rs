//! The frame loop, and composition layers read from memory.
#![allow(unsafe_code, reason = "follows the pointers inside verified structures")]

use std::sync::Arc;

use openxr::sys;

use super::pointer::{In, Out, array, chained, nested, typed_array};
use crate::mock::{
    fault::{Outcome, misuse, require},
    state::{
        Shared, State, frame,
        layer::{Layer, LayerCube, LayerCylinder, LayerDepth, LayerQuad, LayerView},
    },
};

pub fn wait_frame(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::FrameWaitInfo>,
    out: Out<sys::FrameState>,
) -> Outcome<sys::Result> {
    shared.lock().running(session)?;
    info.check_optional()?;
    out.check_typed()?;
    let prediction = frame::wait_frame(shared, session)?;
    out.write(sys::FrameState {
        ty: sys::FrameState::TYPE,
        next: out.next(),
        predicted_display_time: sys::Time::from_nanos(prediction.display_ns),
        predicted_display_period: sys::Duration::from_nanos(prediction.period_ns),
        should_render: prediction.should_render.into(),
    });
    Ok(shared.lock().success(session))
}

pub fn begin_frame(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::FrameBeginInfo>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    info.check_optional()?;
    let begun = state.begin_frame(session);
    drop(state);
    shared.changed.notify_all();
    begun
}

pub fn end_frame(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::FrameEndInfo>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.running(session)?;
    let info = info.get()?;
    state.check_frame_begun(session)?;
    let mut layers = std::mem::take(&mut state.scratch);
    layers.clear();
    let ended = read_layers(&state, session, info, &mut layers)
        .and_then(|()| state.end_frame(session, info.display_time, info.environment_blend_mode, &layers));
    state.scratch = layers;
    ended
}

fn read_layers(
    state: &State,
    session: sys::Session,
    info: &sys::FrameEndInfo,
    layers: &mut Vec<Layer>,
) -> Outcome<()> {
    let limit = state.config.max_layers.max(1);
    require!(
        info.layer_count <= limit,
        ERROR_LAYER_LIMIT_EXCEEDED,
        "{} layers are more than {}",
        info.layer_count,
        limit
    );
    let instance = state.instance(state.session(session)?.instance)?;
    let depth = instance.has("XR_KHR_composition_layer_depth");
    let cube = instance.has("XR_KHR_composition_layer_cube");
    let cylinder = instance.has("XR_KHR_composition_layer_cylinder");
    // SAFETY: the structure is verified; its array is the caller's promise.
    let pointers = unsafe { array(info.layers, info.layer_count) }?;
    for pointer in pointers {
        let pointer = (*pointer).cast::<sys::BaseInStructure>();
        require!(!pointer.is_null() && pointer.is_aligned(), ERROR_LAYER_INVALID, "a layer is NULL");
        // SAFETY: not null, aligned; the caller promises a layer, which begins with type and next.
        let layer = unsafe {
            match (*pointer).ty {
                sys::CompositionLayerProjection::TYPE => read_projection(nested(pointer.cast())?, depth)?,
                sys::CompositionLayerQuad::TYPE => read_quad(nested(pointer.cast())?),
                sys::CompositionLayerCylinderKHR::TYPE if cylinder => read_cylinder(nested(pointer.cast())?),
                sys::CompositionLayerCubeKHR::TYPE if cube => read_cube(nested(pointer.cast())?),
                other => {
                    return Err(misuse(
                        sys::Result::ERROR_LAYER_INVALID,
                        format!("{other:?} is no layer this instance can show"),
                    ));
                }
            }
        };
        layers.push(layer);
    }
    Ok(())
}

fn read_quad(layer: &sys::CompositionLayerQuad) -> Layer {
    Layer::Quad {
        space: layer.space,
        flags: layer.layer_flags,
        quad: LayerQuad {
            eyes: layer.eye_visibility,
            image: layer.sub_image,
            pose: layer.pose,
            size: layer.size,
        },
    }
}

fn read_cylinder(layer: &sys::CompositionLayerCylinderKHR) -> Layer {
    Layer::Cylinder {
        space: layer.space,
        flags: layer.layer_flags,
        cylinder: LayerCylinder {
            eyes: layer.eye_visibility,
            image: layer.sub_image,
            pose: layer.pose,
            radius: layer.radius,
            central_angle: layer.central_angle,
            aspect_ratio: layer.aspect_ratio,
        },
    }
}

fn read_cube(layer: &sys::CompositionLayerCubeKHR) -> Layer {
    Layer::Cube {
        space: layer.space,
        flags: layer.layer_flags,
        cube: LayerCube {
            eyes: layer.eye_visibility,
            swapchain: layer.swapchain,
            image_array_index: layer.image_array_index,
            orientation: layer.orientation,
        },
    }
}

fn read_projection(layer: &sys::CompositionLayerProjection, depth: bool) -> Outcome<Layer> {
    // SAFETY: the structure is verified; its array is the caller's promise.
    let views = unsafe { typed_array(layer.views, layer.view_count) }?;
    let [left, right] = views else {
        return Err(misuse(
            sys::Result::ERROR_VALIDATION_FAILURE,
            format!("a projection layer has {} views, not 2", views.len()),
        ));
    };
    Ok(Layer::Projection {
        space: layer.space,
        flags: layer.layer_flags,
        views: [read_view(left, depth)?, read_view(right, depth)?],
    })
}

fn read_view(view: &sys::CompositionLayerProjectionView, depth: bool) -> Outcome<LayerView> {
    // SAFETY: the structure is verified; its chain is the caller's promise.
    let info = unsafe { chained::<sys::CompositionLayerDepthInfoKHR>(view.next) }?;
    Ok(LayerView {
        pose: view.pose,
        fov: view.fov,
        image: view.sub_image,
        depth: info.filter(|_| depth).map(|info| LayerDepth {
            image: info.sub_image,
            min_depth: info.min_depth,
            max_depth: info.max_depth,
            near_z: info.near_z,
            far_z: info.far_z,
        }),
    })
}
