//! The sky and the backdrop before it, air and all, as six faces of their own: for whoever shows them behind the eyes'
//! pictures, where the eyes then have nothing but tiles to draw ([`Behind::Open`](super::Behind::Open)).
//!
//! What the eyes would draw per pixel and frame is here drawn once, until the backdrop, the light or the air is another.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use super::backdrop::Backdrop;
use super::layout::{EyePush, SceneUniform};
use super::look::{Air, sky_uniform};
use super::{SCENE_SHADER, SKY_SHADER};
use crate::gpu::{
    Attachment, BindGroup, Buffer, BufferInfo, Commands, Gpu, GraphicsInfo, GraphicsPipeline, Load, Location,
    Program, Resource, Target,
};
use crate::world::Look;

/// Octaves by which the air may be off before the faces are drawn anew: less than 1/255 of the light, since haze
/// takes several octaves to close.
const AIR_STEP: f32 = 1.0 / 16.0;

/// What lies behind all tiles, in whatever direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Horizon {
    /// The air.
    pub air: Air,
    /// As [`Sight::backdrop`](super::Sight::backdrop).
    pub backdrop: Option<f32>,
}

/// What draws the faces, and what it drew last.
pub struct SkyCube {
    pipeline: GraphicsPipeline,
    frames: Vec<PerFrame>,
    encode: bool,
    drawn: Option<Drawn>,
}

struct PerFrame {
    scene: Buffer,
    /// One for each cubemap of the backdrop.
    groups: [BindGroup; 2],
}

/// What the faces show.
#[derive(Clone, Copy)]
struct Drawn {
    /// The backdrop's.
    stamp: u64,
    scene: SceneUniform,
}

impl SkyCube {
    /// Draws to images of `format`; `encode`: it does not encode sRGB by itself.
    ///
    /// # Errors
    /// Out of memory, or the device cannot draw to the format.
    pub fn new(
        gpu: &Arc<Gpu>,
        backdrop: &Backdrop,
        format: vk::Format,
        encode: bool,
        frames_in_flight: usize,
    ) -> Result<SkyCube> {
        let program = Program::new(gpu, "sky cube", &[SCENE_SHADER, SKY_SHADER], &[])?;
        let colours = [format];
        let pipeline =
            GraphicsPipeline::new(&GraphicsInfo::new(&program, "face_vertex", "face_fragment", &colours))?;
        let per_frame = || -> Result<PerFrame> {
            let scene = Buffer::new(
                gpu,
                &BufferInfo {
                    name: "sky cube scene",
                    size: size_of::<SceneUniform>() as u64,
                    usage: vk::BufferUsageFlags::UNIFORM_BUFFER,
                    location: Location::Upload,
                },
            )?;
            let group = |cube| {
                let [colour, distance, smooth, exact] = backdrop.resources(cube);
                let scene = ("scene", Resource::Buffer(&scene));
                program.bind_group(0, &[scene, colour, distance, smooth, exact])
            };
            let groups = [group(0)?, group(1)?];
            Ok(PerFrame { scene, groups })
        };
        Ok(SkyCube {
            pipeline,
            frames: (0..frames_in_flight).map(|_| per_frame()).collect::<Result<Vec<_>>>()?,
            encode,
            drawn: None,
        })
    }

    /// Whether what the faces show can be told from what they should show.
    pub fn is_stale(&self, look: &Look, horizon: &Horizon, backdrop: &Backdrop) -> bool {
        let Some(drawn) = &self.drawn else { return true };
        drawn.stamp != backdrop.stamp() || differ(&drawn.scene, &self.uniform(look, horizon))
    }

    /// Records drawing all faces (+x −x +y −y +z −z, each `side` texels, in COLOR_ATTACHMENT_OPTIMAL) anew.
    pub fn record(
        &mut self,
        commands: Commands<'_>,
        index: usize,
        (look, horizon, backdrop): (&Look, &Horizon, &Backdrop),
        (faces, side): (&[vk::ImageView; 6], u32),
    ) {
        let scene = self.uniform(look, horizon);
        let frame = &mut self.frames[index];
        frame.scene.slice_mut()[0] = scene;
        let extent = vk::Extent2D { width: side, height: side };
        for (view, face) in (0..).zip(faces) {
            let colour = [Attachment::new(*face, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL, Load::Discard)];
            let target = Target { extent, view_mask: 0, colour: &colour, depth: None };
            commands.render(&target, |pass| {
                pass.bind(&self.pipeline, &[&frame.groups[backdrop.front()]]);
                pass.push(&self.pipeline, &EyePush { view, first_tile: 0 });
                pass.draw(3, 1);
            });
        }
        self.drawn = Some(Drawn { stamp: backdrop.stamp(), scene });
    }

    fn uniform(&self, look: &Look, horizon: &Horizon) -> SceneUniform {
        sky_uniform(look, &horizon.air, horizon.backdrop, self.encode)
    }
}

/// Whether the light is another, or the air by more than [`AIR_STEP`].
fn differ(a: &SceneUniform, b: &SceneUniform) -> bool {
    // The octaves at which the logistic is half, and a twentieth, closed; at which all is closed; and the distances.
    let octaves = |scene: &SceneUniform| {
        let begin = scene.per_haze_begin.log2();
        let middle = scene.haze_middle;
        [middle, middle - 3.0 / scene.haze_steepness, scene.haze_close, scene.log_distance + begin]
    };
    let near = octaves(a).iter().zip(octaves(b)).all(|(a, b)| (a - b).abs() <= AIR_STEP);
    let same_air = SceneUniform {
        per_haze_begin: a.per_haze_begin,
        haze_middle: a.haze_middle,
        haze_steepness: a.haze_steepness,
        haze_close: a.haze_close,
        log_distance: a.log_distance,
        ..*b
    };
    !near || bytemuck::bytes_of(a) != bytemuck::bytes_of(&same_air)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(log_distance: f32, close_octaves: f32) -> SceneUniform {
        let air = Air { begin_m: 2.0, clear_octaves: 8.0, close_octaves };
        let mut scene = SceneUniform::default();
        super::super::look::set_air(&mut scene, &air, Some(log_distance));
        scene
    }

    #[test]
    fn a_small_step_of_the_air_is_not_seen_and_a_larger_one_is() {
        let here = scene(3.0, 30.0);
        assert!(!differ(&here, &here));
        assert!(!differ(&here, &scene(3.05, 30.0)) && !differ(&here, &scene(3.0, 29.95)));
        assert!(differ(&here, &scene(3.07, 30.0)) && differ(&here, &scene(2.93, 30.0)));
        assert!(differ(&here, &scene(3.0, 30.1)));
        assert!(differ(&here, &scene(f32::NAN, 30.0)), "what cannot be compared is drawn anew");
    }

    #[test]
    fn another_light_or_no_backdrop_is_seen() {
        let here = scene(3.0, 30.0);
        assert!(differ(&here, &SceneUniform { sky_zenith: [0.1, 0.2, 0.3], ..here }));
        assert!(differ(&here, &SceneUniform { backdrop: 0, ..here }));
        assert!(differ(&here, &SceneUniform { encode: 1, ..here }));
    }
}
