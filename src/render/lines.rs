//! Lines over the ground: the boxes and the patches of tiles, and the eyes' frusta. What is behind the ground shows through it.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::{DVec3, Mat4, Vec3};

use super::layout::{EyePush, LinePoint};
use super::target::TargetFormat;
use super::{LINES_SHADER, SCENE_SHADER, SHOWN_SHADER, SRGB_SHADER};
use crate::gpu::{
    BindGroup, Blend, Buffer, BufferInfo, Commands, Gpu, GraphicsInfo, GraphicsPipeline, Location, Program,
    Resource,
};
use crate::inspect::{Inspect, LEVEL_COLOURS};
use crate::terrain::Patch;
use crate::terrain::select::Selection;

/// Ends of lines: those of a box, ...
const BOX_POINTS: usize = 24;
/// ... of a patch, ...
const PATCH_POINTS: usize = 48;
/// ... and of the frusta of both eyes.
const FRUSTA_POINTS: usize = 96;

/// The thesis's blue for the cell of a patch, and a darker one for the ring around it.
const CELL_COLOUR: [u8; 3] = [90, 160, 255];
const RING_COLOUR: [u8; 3] = [20, 50, 150];

/// Of the left and the right eye.
const EYE_COLOURS: [[u8; 3]; 2] = [[255, 70, 70], [40, 230, 230]];

/// How far the frusta are drawn, in metres; a rectangle is drawn at each.
const FRUSTUM_REACH_M: [f32; 3] = [1.0, 8.0, 64.0];

/// Where the tiles of a selection are now, and whose eyes it was for.
#[derive(Clone, Copy, Debug)]
pub struct Selected {
    /// Metres of a tile of the selection's root level.
    pub root_m: f64,
    /// How far the viewer has moved since the selection, in those tiles.
    pub moved: DVec3,
    /// The eyes that it was for: axes in metres from the middle of the head as it was, and the angles of the view's sides in
    /// radians, left, right, up, down.
    pub eyes: [(Mat4, [f32; 4]); 2],
    /// What was a metre then, in metres of now.
    pub metre: f64,
}

/// Pipelines and points.
pub(super) struct LinesPass {
    seen: GraphicsPipeline,
    hidden: GraphicsPipeline,
    frames: Vec<PerFrame>,
    /// Ends of the lines, on their way to a frame's buffer.
    points: Vec<LinePoint>,
    most_points: usize,
}

struct PerFrame {
    points: Buffer,
    group: BindGroup,
    count: u32,
}

impl LinesPass {
    /// Lines for at most `most_tiles` tiles; `scenes` are the frames' uniforms.
    pub(super) fn new<'a>(
        gpu: &Arc<Gpu>,
        most_tiles: usize,
        format: TargetFormat,
        scenes: impl Iterator<Item = &'a Buffer>,
    ) -> Result<LinesPass> {
        let program =
            Program::new(gpu, "lines", &[SCENE_SHADER, SRGB_SHADER, SHOWN_SHADER, LINES_SHADER], &[])?;
        let pipeline = |fragment, compare| {
            GraphicsPipeline::new(&GraphicsInfo {
                blend: Blend::Alpha,
                topology: vk::PrimitiveTopology::LINE_LIST,
                ..format.pipeline(&program, ["line_vertex", "line_vertex_of_eye"], fragment, (compare, false))
            })
        };
        let most_points = most_tiles * (BOX_POINTS + PATCH_POINTS) + FRUSTA_POINTS;
        let per_frame = |scene| -> Result<PerFrame> {
            let points = Buffer::new(
                gpu,
                &BufferInfo {
                    name: "ends of lines",
                    size: (most_points * size_of::<LinePoint>()) as u64,
                    usage: vk::BufferUsageFlags::STORAGE_BUFFER,
                    location: Location::Upload,
                },
            )?;
            let resources = [("scene", Resource::Buffer(scene)), ("points", Resource::Buffer(&points))];
            let group = program.bind_group(0, &resources)?;
            Ok(PerFrame { points, group, count: 0 })
        };
        Ok(LinesPass {
            seen: pipeline("line_fragment", vk::CompareOp::GREATER_OR_EQUAL)?,
            hidden: pipeline("hidden_line_fragment", vk::CompareOp::LESS)?,
            frames: scenes.map(per_frame).collect::<Result<Vec<_>>>()?,
            points: Vec::new(),
            most_points,
        })
    }

    /// Writes the lines of the frame in flight `index`.
    pub(super) fn set(
        &mut self,
        index: usize,
        inspect: &Inspect,
        selection: &Selection,
        selected: &Selected,
    ) {
        let points = &mut self.points;
        points.clear();
        let tiles = || {
            selection.drawn.iter().map(|tile| {
                let size = selected.root_m / (1u64 << tile.level) as f64;
                let corner = (-tile.head * size - selected.moved * selected.root_m).as_vec3();
                (tile, move |p: Vec3| corner + size as f32 * p)
            })
        };
        if inspect.boxes {
            for (tile, at) in tiles() {
                let colour = LEVEL_COLOURS[tile.corner.level as usize % LEVEL_COLOURS.len()];
                add_box(points, colour, selection.heights(tile), at);
            }
        }
        if inspect.patches {
            // The cells last, over the rings of their neighbours.
            tiles().for_each(|(tile, at)| add_patch(points, RING_COLOUR, selection.patch(tile), false, at));
            tiles().for_each(|(tile, at)| add_patch(points, CELL_COLOUR, selection.patch(tile), true, at));
        }
        if inspect.frusta {
            let moved = (selected.moved * selected.root_m).as_vec3();
            for ((scene_from_view, fov), colour) in selected.eyes.into_iter().zip(EYE_COLOURS) {
                let at = |p: Vec3| selected.metre as f32 * scene_from_view.transform_point3(p) - moved;
                add_frustum(points, colour, fov, at);
            }
        }
        let count = points.len().min(self.most_points);
        let frame = &mut self.frames[index];
        frame.points.slice_mut()[..count].copy_from_slice(&points[..count]);
        frame.count = count as u32;
    }

    /// Draws, in a pass whose ground is drawn; an eye is named where the pass is for one.
    pub(super) fn draw(&self, pass: &Commands<'_>, index: usize, eye: Option<u32>) {
        let frame = &self.frames[index];
        for pipeline in [&self.hidden, &self.seen].into_iter().filter(|_| frame.count > 0) {
            pass.bind(pipeline, &[&frame.group]);
            pass.push(pipeline, &EyePush { view: eye.unwrap_or(0), first_tile: 0 });
            pass.draw(frame.count, 1);
        }
    }
}

fn add(points: &mut Vec<LinePoint>, [r, g, b]: [u8; 3], ends: [Vec3; 2]) {
    let colour = u32::from_le_bytes([r, g, b, 255]);
    points.extend(ends.map(|end| LinePoint { at: end.to_array(), colour }));
}

/// The edges of a tile's box: the sides of the unit square between two heights.
fn add_box(points: &mut Vec<LinePoint>, colour: [u8; 3], [low, high]: [f32; 2], at: impl Fn(Vec3) -> Vec3) {
    let corner = |i: usize, y: f32| at(Vec3::new((i & 1) as f32, y, (i >> 1) as f32));
    for (a, b) in [(0, 1), (1, 3), (3, 2), (2, 0)] {
        add(points, colour, [corner(a, low), corner(b, low)]);
        add(points, colour, [corner(a, high), corner(b, high)]);
        add(points, colour, [corner(a, low), corner(a, high)]);
    }
}

/// The lattice of a patch: the square of the cell, or all around it.
fn add_patch(
    points: &mut Vec<LinePoint>,
    colour: [u8; 3],
    patch: &Patch,
    cell: bool,
    at: impl Fn(Vec3) -> Vec3,
) {
    let point =
        |x: i32, z: i32| at(Vec3::new(x as f32, (patch.rise(x, z) as f64 / 65_536.0) as f32, z as f32));
    for along in -1..=1 {
        for across in -1..=2 {
            if cell == (along == 0 && (0..=1).contains(&across)) {
                add(points, colour, [point(along, across), point(along + 1, across)]);
                add(points, colour, [point(across, along), point(across, along + 1)]);
            }
        }
    }
}

/// An eye's frustum: its edges, and a rectangle at every distance of [`FRUSTUM_REACH_M`].
fn add_frustum(points: &mut Vec<LinePoint>, colour: [u8; 3], fov: [f32; 4], at: impl Fn(Vec3) -> Vec3) {
    let [left, right, up, down] = fov.map(f32::tan);
    let corners = [(left, up), (right, up), (right, down), (left, down)];
    let corner = |i: usize, ahead: f32| at(Vec3::new(corners[i % 4].0, corners[i % 4].1, -1.0) * ahead);
    let mut from = 0.0;
    for ahead in FRUSTUM_REACH_M {
        for i in 0..4 {
            add(points, colour, [corner(i, from), corner(i, ahead)]);
            add(points, colour, [corner(i, ahead), corner(i + 1, ahead)]);
        }
        from = ahead;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terrain::{Place, Scheme, Surface};

    #[test]
    fn every_kind_of_line_has_the_ends_that_there_is_room_for() {
        let mut points = Vec::new();
        add_box(&mut points, [0; 3], [-1.0, 2.0], |p| p);
        assert_eq!(points.len(), BOX_POINTS);
        let height = |p: &LinePoint| p.at[1];
        assert!(points.iter().all(|p| [-1.0, 2.0].contains(&height(p))));
        points.clear();
        let surface =
            Surface { seed: 1, scheme: Scheme::Cubic, amplitude: 29_491, terrace: None, only: None };
        let mut place = Place::root(surface, 0, 0);
        (0..8).for_each(|_| place.deeper());
        let (patch, _) = place.spine.bottom().block.patch(0, 0);
        add_patch(&mut points, CELL_COLOUR, &patch, true, |p| p);
        assert_eq!(points.len(), 8);
        assert!(points.iter().all(|p| [0.0, 1.0].contains(&p.at[0]) && [0.0, 1.0].contains(&p.at[2])));
        add_patch(&mut points, RING_COLOUR, &patch, false, |p| p);
        assert_eq!(points.len(), PATCH_POINTS);
        points.clear();
        (0..2).for_each(|_| add_frustum(&mut points, [0; 3], [-0.8, 0.7, 0.6, -0.5], |p| p));
        assert_eq!(points.len(), FRUSTA_POINTS);
        for point in points.iter().filter(|p| p.at[2] < 0.0) {
            let tangent = point.at[0] / -point.at[2];
            assert!([-0.8f32, 0.7].iter().any(|side| (side.tan() - tangent).abs() < 1e-5));
        }
    }
}
