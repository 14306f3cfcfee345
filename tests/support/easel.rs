//! The renderer without a session: what is drawn, and how much is made per frame, is in the test's hands.
#![allow(dead_code, reason = "each test binary uses its part")]

use std::sync::Arc;

use ash::vk;
use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::gpu::{
    Access, Buffer, BufferInfo, Direct, Frames, Gpu, GpuConfig, Image, ImageInfo, Location, Transition,
};
use fathomless::render::layout::SlotLayout;
use fathomless::render::{
    Air, Backdrop, BackdropConfig, Behind, EyeTarget, Shading, Sight, TargetFormat, TerrainPass, TileStore,
    View,
};
use fathomless::rig::{Eye, Pose, Rig};
use fathomless::terrain::morph::Detail;
use fathomless::terrain::patch::Patch;
use fathomless::terrain::pool::Slot;
use fathomless::terrain::select::{self, Counts, Drawn, Frustum, Selection, Tiles, slots_needed};
use fathomless::terrain::surface::Corner;
use fathomless::terrain::tile::Cells;
use fathomless::world::World;
use fathomless::xr::Fov;
use glam::{DVec3, Mat4, Quat, Vec2, Vec3};

/// Seen through a hole. No ground is this colour.
pub const MAGENTA: [f32; 4] = [1.0, 0.0, 1.0, 1.0];

const NEAR_M: f32 = 0.05;
const COMFORT_M: f64 = 2.0;
const HALF_IPD_M: f32 = 0.0315;
const UP: usize = 11;
const DOWN: usize = 3;
/// Levels from the root that are left to the backdrop, as in the viewer; here there is none, and they stay empty.
const LIVE_FROM: usize = 3;

/// Where to draw from.
#[derive(Clone, Copy, Debug)]
pub struct Shot {
    pub depth: f64,
    pub height: f64,
    pub offset: [f64; 2],
    pub pitch_deg: f64,
    pub yaw_deg: f64,
    pub roll_deg: f64,
    /// Half the angle of view, radians.
    pub fov: f32,
}

impl Default for Shot {
    fn default() -> Shot {
        Shot {
            depth: 0.0,
            height: 2.5,
            offset: [0.0; 2],
            pitch_deg: -90.0,
            yaw_deg: 0.0,
            roll_deg: 0.0,
            fov: 0.6,
        }
    }
}

impl Shot {
    pub fn pose(&self) -> FlightPose {
        FlightPose {
            depth: self.depth,
            yaw: self.yaw_deg.to_radians(),
            pitch: self.pitch_deg.to_radians(),
            roll: self.roll_deg.to_radians(),
            height: self.height,
            offset: self.offset,
            ..FlightPose::default()
        }
    }
}

/// A store that makes so many tiles in a frame and no more.
struct Rationed<'a> {
    store: &'a mut TileStore,
    left: usize,
}

impl Tiles for Rationed<'_> {
    fn ready(&mut self, tile: Corner) -> Option<Slot> {
        self.store.ready(tile)
    }

    fn make(&mut self, patch: &Patch, needed: bool) -> Option<Slot> {
        if !needed {
            self.left = self.left.checked_sub(1)?;
        }
        self.store.make(patch, needed)
    }
}

pub struct Easel {
    selection: Selection,
    terrain: TerrainPass,
    // Stays empty.
    _backdrop: Backdrop,
    store: TileStore,
    colour: Image,
    depth: Image,
    copy: Buffer,
    frames: Frames,
    course: Course,
    world: World,
    detail: Detail,
    pub gpu: Arc<Gpu>,
}

impl Easel {
    /// Flat shading on magenta; poses as deep as 64 octaves.
    pub fn new(world: &str, size: [u32; 2], multiview: bool) -> Easel {
        Easel::sampled(world, size, multiview, 1)
    }

    /// The same with so many samples a pixel.
    pub fn sampled(world: &str, [width, height]: [u32; 2], multiview: bool, samples: u32) -> Easel {
        let gpu =
            Gpu::new(&Direct, &GpuConfig { validate: true }).unwrap_or_else(|error| panic!("{error:#}"));
        let world = World::load(world).unwrap();
        let detail = Detail::new(2.6);
        let layout = SlotLayout { cells: Cells::new(64).unwrap(), mesh: 16 };
        let slots = slots_needed(&detail, UP + DOWN);
        let store = TileStore::new(&gpu, layout, slots, &world.surface, 2).unwrap();
        let format = TargetFormat {
            colour: vk::Format::R8G8B8A8_UNORM,
            depth: vk::Format::D32_SFLOAT,
            encode: false,
            multiview: multiview && gpu.info.multiview_offered,
            samples: vk::SampleCountFlags::TYPE_1,
            copies_colour: false,
            copies_depth: false,
        };
        let config = BackdropConfig { face: 16, lag: UP, bound: 3.0, layers: 1, detail };
        let backdrop = Backdrop::new(&gpu, &store, config, 2).unwrap();
        let target = (format.sampled(samples, gpu.info.resolves_to_layers), vk::Extent2D { width, height });
        let mut terrain = TerrainPass::new(&gpu, &store, &backdrop, slots as usize, target, 2).unwrap();
        terrain.shading = Shading::Holes(MAGENTA);
        let image = |name, format, usage| {
            let info = ImageInfo { name, width, height, layers: 2, format, usage, ..ImageInfo::default() };
            Image::new(&gpu, &info).unwrap()
        };
        let copied = vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST;
        let colour_use = vk::ImageUsageFlags::COLOR_ATTACHMENT | copied;
        let depth_use = vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT | copied;
        let copy = BufferInfo {
            name: "copy",
            size: u64::from(width * height) * 8,
            usage: vk::BufferUsageFlags::TRANSFER_DST,
            location: Location::Readback,
        };
        Easel {
            selection: Selection::default(),
            terrain,
            _backdrop: backdrop,
            store,
            colour: image("colour", format.colour, colour_use),
            depth: image("depth", format.depth, depth_use),
            copy: Buffer::new(&gpu, &copy).unwrap(),
            frames: Frames::new(&gpu, 2).unwrap(),
            course: Course::new(world.surface, 0, 64.0, |_| ()),
            world,
            detail,
            gpu,
        }
    }

    /// Covers triangles of each eye's picture: tangents, three corners each.
    pub fn cover(&mut self, triangles: &[Vec<Vec2>; 2]) {
        self.terrain.set_mask(&self.gpu, triangles, 2).unwrap();
    }

    /// Draws both eyes and waits; at most `ration` tiles are made, and `edit` may change what is drawn.
    pub fn draw(
        &mut self,
        shot: &Shot,
        ration: usize,
        edit: impl FnOnce(&mut Vec<Drawn>, &[Mat4; 2]),
    ) -> Counts {
        let standpoint = self.course.at(&shot.pose());
        let head = Pose { position: Vec3::ZERO, orientation: Quat::IDENTITY };
        let eyes = [-HALF_IPD_M, HALF_IPD_M].map(|x| Eye {
            pose: Pose { position: Vec3::new(x, 0.0, 0.0), orientation: Quat::IDENTITY },
            fov: [-shot.fov, shot.fov, shot.fov, -shot.fov],
        });
        let rig = Rig {
            seat: Vec3::ZERO,
            position: standpoint.position,
            orientation: standpoint.orientation,
            metres_per_tile: COMFORT_M / standpoint.height,
        };
        let (root, in_root) = standpoint.place.seen_from_above(standpoint.position, UP);
        let root_m = rig.metres_per_tile * f64::from(1 << UP);
        let frusta: [Frustum; 2] = eyes.map(|eye| rig.frustum(&head, &eye, 0.06, root_m));
        let view = select::View {
            root: &root.block,
            head: in_root,
            levels: UP + DOWN,
            live_from: LIVE_FROM,
            prefetch_from: LIVE_FROM,
            detail: self.detail,
            frusta: Some(frusta),
        };
        let fov = Fov { left: -shot.fov, right: shot.fov, up: shot.fov, down: -shot.fov };
        let sight = Sight {
            views: eyes.map(|eye| View {
                scene_from_view: rig.scene_from_view(&head, &eye),
                clip_from_view: fov.clip_from_view(NEAR_M),
            }),
            air: Air::new(&self.world.look, COMFORT_M as f32, 32.0),
            detail: self.detail,
            depth: standpoint.depth,
            cell_m: rig.metres_per_tile as f32,
            backdrop: None,
        };

        let mut frame = self.frames.begin().unwrap();
        let index = frame.index;
        self.store.begin_frame(index, None);
        let mut tiles = Rationed { store: &mut self.store, left: ration };
        self.selection.select(&self.world.surface, &view, &mut tiles);
        let clip_from_scene = sight.views.map(|view| view.clip_from_view * view.scene_from_view.inverse());
        // In metres from the head, as the vertices are.
        let of_root = clip_from_scene.map(|clip| clip * Mat4::from_scale(Vec3::splat(root_m as f32)));
        edit(&mut self.selection.drawn, &of_root);
        let mut counts = self.selection.counts;
        counts.drawn = self.selection.drawn.len();
        self.terrain.set_tiles(index, &self.selection.drawn, root_m, DVec3::ZERO);
        self.terrain.set_sight(index, &self.world.look, &sight);
        frame.pass(c"tiles", |commands| self.store.record(commands));
        let commands = frame.commands();
        let undefined = (Access::NONE, vk::ImageLayout::UNDEFINED);
        let (colour, depth) = (&self.colour, &self.depth);
        let drawn = (Access::COLOUR_WRITE, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
        let tested = (Access::DEPTH_WRITE, vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL);
        commands.transition(&[
            Transition { image: colour.raw, aspect: colour.aspect, from: undefined, to: drawn },
            Transition { image: depth.raw, aspect: depth.aspect, from: undefined, to: tested },
        ]);
        let target = EyeTarget {
            extent: colour.extent,
            colour_image: colour.raw,
            colour: colour.view,
            colour_of_eye: [colour.layer_views[0], colour.layer_views[1]],
            depth_image: depth.raw,
            depth: depth.view,
            depth_of_eye: [depth.layer_views[0], depth.layer_views[1]],
            depth_is_read: true,
        };
        frame.pass(c"terrain", |commands| self.terrain.record(commands, index, Behind::Sky(0), &target));
        let copied = (Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        let commands = frame.commands();
        commands.transition(&[Transition {
            image: colour.raw,
            aspect: colour.aspect,
            from: drawn,
            to: copied,
        }]);
        let layers = vk::ImageSubresourceLayers {
            aspect_mask: colour.aspect,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: 2,
        };
        let vk::Extent2D { width, height } = colour.extent;
        let region = vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D {
            width,
            height,
            depth: 1,
        });
        commands.copy_image_to_buffer((colour.raw, copied.1), &self.copy, &[region]);
        commands.barrier(Access::COPY_WRITE, Access::HOST_READ);
        self.frames.submit(frame, &[], &[]).unwrap();
        self.frames.wait_idle().unwrap();
        counts
    }

    /// An eye's pixels of the frame drawn last, rows from the top.
    pub fn picture(&self, eye: usize) -> Vec<[u8; 4]> {
        let pixels = (self.colour.extent.width * self.colour.extent.height) as usize;
        self.copy.slice::<[u8; 4]>()[eye * pixels..(eye + 1) * pixels].to_vec()
    }

    /// Pixels of both eyes that nothing was drawn to.
    pub fn holes(&self) -> usize {
        holes(self.copy.slice())
    }

    /// Everything goes; the validation layer may have said nothing.
    pub fn close(self) {
        let log = self.gpu.validation_log();
        drop(self);
        let report = log.report();
        assert_eq!(report.count, 0, "validation messages:\n{}", report.texts.join("\n"));
    }
}

/// Magenta pixels.
pub fn holes(pixels: &[[u8; 4]]) -> usize {
    pixels.iter().filter(|[red, green, blue, _]| *red > 200 && *green < 50 && *blue > 200).count()
}

/// True if a tile, with the heights that it may well have, lies inside both eyes' pictures: nothing of it is clipped.
/// `clip_from_root` takes tiles of the selection's root level from the head.
pub fn within_both(tile: &Drawn, clip_from_root: &[Mat4; 2]) -> bool {
    let size = 1.0 / (1u32 << tile.level) as f32;
    (0..8u32).all(|i| {
        let (u, v) = ((i & 1) as f32, (i >> 1 & 1) as f32);
        let height = tile.slope[0] * u + tile.slope[1] * v + if i & 4 == 0 { -1.0 } else { 1.0 };
        let corner = (Vec3::new(u, height, v) - tile.head.as_vec3()) * size;
        clip_from_root.iter().all(|clip| {
            let at = *clip * corner.extend(1.0);
            at.w > 0.0 && at.x.abs() < 0.95 * at.w && at.y.abs() < 0.95 * at.w && at.z < at.w
        })
    })
}
