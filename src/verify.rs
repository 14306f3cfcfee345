//! Compares tiles made on the GPU with the CPU reference, word for word, and their shared edges with each other.

use crate::gpu::{Frames, Gpu};
use crate::render::layout::SlotLayout;
use crate::render::{Budget, TileStore};
use crate::terrain::hash::mix;
use crate::terrain::place::{Dive, START_LEVEL};
use crate::terrain::select::Tiles;
use crate::terrain::{Block, Patch, Surface, Tile};
use anyhow::{Context, Result};
use std::sync::Arc;

/// Tiles made and read back at a time.
const BATCH: usize = 256;

/// What was compared and what came of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Tiles compared.
    pub tiles: usize,
    /// Heights compared, fine and coarse.
    pub heights: usize,
    /// Heights that differ.
    pub heights_differ: usize,
    /// Gradients compared.
    pub gradients: usize,
    /// Gradients that differ.
    pub gradients_differ: usize,
    /// Samples on edges that two tiles share, compared between the GPU's own tiles.
    pub shared: usize,
    /// Shared samples that differ: cracks.
    pub shared_differ: usize,
    /// The deepest level compared, in octaves below the start.
    pub deepest: usize,
}

impl Report {
    /// True if nothing differs.
    pub fn clean(&self) -> bool {
        self.heights_differ + self.gradients_differ + self.shared_differ == 0
    }
}

/// Compares `tiles` tiles at depths from 0 to `depth` octaves below the start, on the way of the world's own dive
/// and on wild ones beside it. `progress` hears how many tiles are done.
///
/// # Errors
/// Out of memory, or the device is lost.
pub fn verify(
    gpu: &Arc<Gpu>,
    surface: &Surface,
    layout: SlotLayout,
    tiles: usize,
    depth: usize,
    mut progress: impl FnMut(usize),
) -> Result<Report> {
    let dive = Dive::new(*surface, START_LEVEL + depth, |_| ());
    let mut store = TileStore::new(gpu, layout, BATCH as u32, surface, 2)?;
    let mut frames = Frames::new(gpu, 2)?;
    let mut report = Report::default();
    let stops = tiles.div_ceil(BATCH);
    for stop in 0..stops {
        // From the bottom up, so that the last is the start; a single stop is at the bottom.
        let level = START_LEVEL + depth - depth * stop / (stops - 1).max(1);
        let count = BATCH.min(tiles - report.tiles);
        let patches = patches_at(surface, &dive.step(level).block, count, stop as u32);
        let words = make(&mut store, &mut frames, surface, &patches)?;
        compare(surface, layout, &patches, &words, &mut report);
        report.deepest = report.deepest.max(level - START_LEVEL);
        progress(report.tiles);
    }
    Ok(report)
}

/// The nine tiles of a block, then descendants of them, each reached by digits of chance.
fn patches_at(surface: &Surface, block: &Block, count: usize, salt: u32) -> Vec<Patch> {
    let mut patches = Vec::with_capacity(count);
    for j in -1..=1 {
        for i in -1..=1 {
            patches.push(block.patch(i, j).0);
        }
    }
    let mut parent = 0;
    while patches.len() < count {
        let pick = mix(salt ^ mix(patches.len() as u32));
        patches.extend(patches[parent].children(surface).map(|(child, _)| child));
        parent += 1 + pick as usize % 3;
    }
    patches.truncate(count);
    patches
}

fn make(
    store: &mut TileStore,
    frames: &mut Frames,
    surface: &Surface,
    patches: &[Patch],
) -> Result<Vec<i32>> {
    let mut frame = frames.begin()?;
    store.set_surface(surface);
    store.set_budget(Budget::Unlimited);
    store.begin_frame(frame.index, None);
    let mut slots = Vec::with_capacity(patches.len());
    for patch in patches {
        slots.push(store.make(patch, true).context("the pool is too small for a batch")? as usize);
    }
    frame.pass(c"tiles", |commands| store.record(commands));
    frames.submit(frame, &[], &[])?;
    frames.wait_idle()?;
    let words = store.layout.words();
    let all: Vec<i32> = store.slots.read(BATCH * words)?;
    // In the order of the patches.
    Ok(slots.into_iter().flat_map(|slot| &all[slot * words..(slot + 1) * words]).copied().collect())
}

fn compare(surface: &Surface, layout: SlotLayout, patches: &[Patch], words: &[i32], report: &mut Report) {
    let mut tile = Tile::new(layout.cells);
    let mut expected = vec![0; layout.words()];
    let gradients = layout.fine_gradient();
    for (patch, got) in patches.iter().zip(words.chunks_exact(layout.words())) {
        tile.make(surface, patch);
        layout.fill(&tile, &mut expected);
        let differ = |a: &[i32], b: &[i32]| a.iter().zip(b).filter(|(a, b)| a != b).count();
        report.tiles += 1;
        report.heights += gradients;
        report.heights_differ += differ(&expected[..gradients], &got[..gradients]);
        report.gradients += layout.words() - gradients;
        report.gradients_differ += differ(&expected[gradients..], &got[gradients..]);
    }
    for (patch, got) in patches.iter().zip(words.chunks_exact(layout.words())) {
        for (dx, dz) in [(1, 0), (0, 1)] {
            let beside = patch.corner.moved(dx, dz);
            let Some(other) = patches.iter().position(|p| p.corner == beside) else { continue };
            let theirs = &words[other * layout.words()..(other + 1) * layout.words()];
            let n = layout.cells.n() as i32;
            for k in 0..=n {
                let (x, z) = if dx == 1 { (n, k) } else { (k, n) };
                let here = height(layout, patch, got, x, z);
                let there = height(layout, &patches[other], theirs, x - n * dx, z - n * dz);
                report.shared += 1;
                report.shared_differ += usize::from(here != there);
            }
        }
    }
}

/// Total height (mod 2³²) of a fine point.
fn height(layout: SlotLayout, patch: &Patch, words: &[i32], x: i32, z: i32) -> u32 {
    let side = layout.cells.fine_side();
    let residual = words[SlotLayout::FINE + (z + 1) as usize * side + (x + 1) as usize];
    let rise = patch.plane.rise(i64::from(x), i64::from(z)) as u32;
    patch.plane.c.wrapping_mul(layout.cells.n() as u32).wrapping_add(rise).wrapping_add(residual as u32)
}
