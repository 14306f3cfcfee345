//! Tiles on the GPU: a pool of slots in one storage buffer, filled by a compute shader within a budget per frame.

use super::HASH_SHADER;
use super::layout::{Request, SlotLayout, SurfaceUniform};
use crate::gpu::{
    Access, BindGroup, Buffer, BufferInfo, Commands, ComputePipeline, Gpu, Location, Program, Resource,
    Source,
};
use crate::terrain::pace::Pace;
use crate::terrain::pool::{Pool, Slot};
use crate::terrain::select::{Drawn, Tiles};
use crate::terrain::surface::Corner;
use crate::terrain::{Patch, Scheme, Surface};
use anyhow::{Result, ensure};
use ash::vk;
use std::sync::Arc;

/// `shaders/tile.wgsl`.
pub const SHADER: Source<'static> =
    Source { name: "shaders/tile.wgsl", text: include_str!("../../shaders/tile.wgsl") };

/// How many tiles a frame may make.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// All that are wanted: every frame is complete (captures, tests).
    Unlimited,
    /// As many as take so many milliseconds of GPU time, a few at least, and no more than a part of those that
    /// wait: a burst is spread over a few frames, and so is the work of a steady dive.
    Milliseconds(f64),
}

/// Tiles that a frame may make whatever they take: ground that is much too coarse is worse than a late frame.
const LEAST: f64 = 8.0;

/// The slots, and what fills them.
pub struct TileStore {
    /// Where the parts of a slot lie.
    pub layout: SlotLayout,
    /// The slots.
    pub slots: Buffer,
    pool: Pool,
    pipeline: ComputePipeline,
    surface: Buffer,
    frames: Vec<PerFrame>,
    /// Frame in flight that is being prepared.
    current: usize,
    /// Requests in the current frame's buffer.
    pending: usize,
    pace: Pace,
    budget: Budget,
    /// Running estimate of the GPU time of one tile.
    ms_per_tile: f64,
}

struct PerFrame {
    requests: Buffer,
    group: BindGroup,
    /// Tiles that its last submission made.
    made: usize,
}

impl TileStore {
    /// Room for `slots` tiles of `surface`.
    ///
    /// # Errors
    /// More than the device can address, or out of memory.
    pub fn new(
        gpu: &Arc<Gpu>,
        layout: SlotLayout,
        slots: u32,
        surface: &Surface,
        frames_in_flight: usize,
    ) -> Result<TileStore> {
        let bytes = u64::from(slots) * layout.words() as u64 * 4;
        let most = u64::from(gpu.info.limits.max_storage_buffer_range);
        ensure!(
            bytes <= most,
            "{slots} tiles of {}² cells take {bytes} bytes, and {} can address {most}: use fewer levels or smaller tiles",
            layout.cells.n(),
            gpu.info.name
        );
        let program = Program::new(gpu, "tile", &[HASH_SHADER, SHADER], &layout.constants())?;
        let pipeline = ComputePipeline::new(&program, "make_tiles")?;
        let slots_buffer = Buffer::new(
            gpu,
            &BufferInfo {
                name: "tile slots",
                size: bytes,
                usage: vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::TRANSFER_SRC
                    | vk::BufferUsageFlags::TRANSFER_DST,
                location: Location::Device,
            },
        )?;
        let mut surface_buffer = Buffer::new(
            gpu,
            &BufferInfo {
                name: "surface",
                size: size_of::<SurfaceUniform>() as u64,
                usage: vk::BufferUsageFlags::UNIFORM_BUFFER,
                location: Location::Upload,
            },
        )?;
        surface_buffer.slice_mut()[0] = surface_uniform(surface);
        let per_frame = || -> Result<PerFrame> {
            let requests = Buffer::new(
                gpu,
                &BufferInfo {
                    name: "tile requests",
                    size: u64::from(slots) * size_of::<Request>() as u64,
                    usage: vk::BufferUsageFlags::STORAGE_BUFFER,
                    location: Location::Upload,
                },
            )?;
            let group = program.bind_group(
                0,
                &[
                    ("requests", Resource::Buffer(&requests)),
                    ("slots", Resource::Buffer(&slots_buffer)),
                    ("surface", Resource::Buffer(&surface_buffer)),
                ],
            )?;
            Ok(PerFrame { requests, group, made: 0 })
        };
        let frames = (0..frames_in_flight).map(|_| per_frame()).collect::<Result<Vec<_>>>()?;
        Ok(TileStore {
            layout,
            slots: slots_buffer,
            pool: Pool::new(slots),
            pipeline,
            surface: surface_buffer,
            frames,
            current: 0,
            pending: 0,
            pace: Pace::default(),
            budget: Budget::Unlimited,
            ms_per_tile: 0.2,
        })
    }

    /// Another world: every tile is forgotten. The GPU must be idle.
    pub fn set_surface(&mut self, surface: &Surface) {
        self.surface.slice_mut()[0] = surface_uniform(surface);
        self.pool.clear();
    }

    /// How many tiles a frame may make from now on.
    pub fn set_budget(&mut self, budget: Budget) {
        self.budget = budget;
    }

    /// For how many frames ahead of need tiles are asked for; 0: none are.
    pub fn set_foreseen(&mut self, frames: f64) {
        self.pace.set_foreseen(frames);
    }

    /// Begins the frame in flight `index`, whose buffers the GPU has finished with; `ms` is what the tiles of its
    /// last submission took on the GPU, if that was measured.
    pub fn begin_frame(&mut self, index: usize, ms: Option<f64>) {
        self.current = index;
        self.pending = 0;
        self.pool.begin_frame();
        let made = self.frames[index].made;
        if let Some(ms) = ms
            && made > 0
        {
            self.ms_per_tile += 0.2 * (ms / made as f64 - self.ms_per_tile);
        }
        self.pace.begin_frame(match self.budget {
            Budget::Unlimited => None,
            Budget::Milliseconds(budget) => Some((budget / self.ms_per_tile.max(1e-4)).max(LEAST)),
        });
    }

    /// Records the making of what was asked for, and the barrier before it may be drawn.
    pub fn record(&mut self, commands: Commands<'_>) {
        let frame = &mut self.frames[self.current];
        frame.made = self.pending;
        if self.pending == 0 {
            return;
        }
        // A slot may have been drawn by the frame before.
        commands.barrier(Access::VERTEX_READ | Access::FRAGMENT_READ, Access::COMPUTE_WRITE);
        commands.bind(&self.pipeline, &[&frame.group]);
        commands.dispatch([self.pending as u32, 1, 1]);
        commands.barrier(Access::COMPUTE_WRITE, Access::VERTEX_READ | Access::FRAGMENT_READ);
    }

    /// Keeps these tiles in their slots through the frame, as if a selection had wanted them.
    pub fn keep(&mut self, drawn: &[Drawn]) {
        for tile in drawn {
            self.pool.want(tile.corner);
        }
    }

    /// Tiles in the pool.
    pub fn resident(&self) -> usize {
        self.pool.resident()
    }
}

impl TileStore {
    /// Tiles that this frame makes, so far.
    pub fn requested(&self) -> usize {
        self.pending
    }

    /// The slot of a tile to be baked, made in this frame if it is missing, whatever the budget says. None: the pool is
    /// full.
    pub fn make_to_bake(&mut self, patch: &Patch) -> Option<Slot> {
        self.pool.want(patch.corner).or_else(|| {
            self.pace.bake();
            self.request(patch)
        })
    }

    fn request(&mut self, patch: &Patch) -> Option<Slot> {
        let requests: &mut [Request] = self.frames[self.current].requests.slice_mut();
        let room = requests.get_mut(self.pending)?;
        let slot = self.pool.assign(patch.corner)?;
        *room = Request {
            residuals: patch.r,
            level: patch.corner.level,
            x: patch.corner.x,
            z: patch.corner.z,
            c: patch.plane.c,
            gx: patch.plane.gx as u32,
            gz: patch.plane.gz as u32,
            slot,
            unused: 0,
        };
        self.pending += 1;
        // It is made before this frame's tiles are drawn.
        self.pool.mark_ready(slot);
        Some(slot)
    }
}

impl Tiles for TileStore {
    fn ready(&mut self, tile: Corner) -> Option<Slot> {
        self.pool.want(tile)
    }

    fn make(&mut self, patch: &Patch, needed: bool) -> Option<Slot> {
        if self.pace.ask(needed) { self.request(patch) } else { None }
    }

    fn foresee(&mut self, tile: Corner) -> bool {
        self.pool.want(tile).is_none() && self.pace.ask_ahead()
    }

    fn make_ahead(&mut self, patch: &Patch) {
        // A full pool has room for what is wanted now, and no more.
        let _ = self.request(patch);
    }
}

fn surface_uniform(surface: &Surface) -> SurfaceUniform {
    let terrace = surface.terrace;
    SurfaceUniform {
        seed_low: surface.seed as u32,
        seed_high: (surface.seed >> 32) as u32,
        scheme: match surface.scheme {
            Scheme::Bilinear => 0,
            Scheme::Cubic => 1,
        },
        amplitude: i32::from(surface.amplitude),
        period: terrace.map_or(0, |t| t.period),
        tread_fall: terrace.map_or(0, |t| t.tread_fall),
        riser_fall: terrace.map_or(0, |t| t.riser_fall),
        only: surface.only.unwrap_or(0),
    }
}
