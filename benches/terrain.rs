//! What the CPU side of the terrain costs: a tile, a patch step, a selection, the nearest ground and a frame of flying
//! at several depths; and the same heights as a tile's by a general noise library, in the same run.
#![allow(clippy::expect_used, missing_docs, reason = "a benchmark")]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use fastnoise_lite::{FastNoiseLite, FractalType, NoiseType};
use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::input::Input;
use fathomless::pilot::{MotionSettings, Pilot};
use fathomless::terrain::morph::Detail;
use fathomless::terrain::place::{Dive, START_LEVEL};
use fathomless::terrain::pool::Slot;
use fathomless::terrain::select::{Selection, Tiles, View};
use fathomless::terrain::surface::Corner;
use fathomless::terrain::tile::{Cells, Tile};
use fathomless::terrain::{Patch, Probe, Surface};
use fathomless::world::World;
use glam::{Vec2, Vec3};

/// Every tile is there.
struct All;

impl Tiles for All {
    fn ready(&mut self, _: Corner) -> Option<Slot> {
        Some(0)
    }

    fn make(&mut self, _: &Patch, _: bool) -> Option<Slot> {
        Some(0)
    }
}

fn surface() -> Surface {
    World::load("canyonlands").expect("it is built in").surface
}

fn tile(c: &mut Criterion) {
    let surface = surface();
    let dive = Dive::new(surface, START_LEVEL, |_| ());
    let (patch, _) = dive.step(START_LEVEL).block.patch(0, 0);
    let cells = Cells::new(128).expect("a power of two");
    let mut tile = Tile::new(cells);
    let mut group = c.benchmark_group("129² heights");
    group.throughput(Throughput::Elements(129 * 129));
    group.bench_function("a tile of canyonlands", |b| b.iter(|| tile.make(&surface, black_box(&patch))));
    let mut noise = FastNoiseLite::with_seed(1);
    noise.set_noise_type(Some(NoiseType::OpenSimplex2));
    noise.set_fractal_type(Some(FractalType::FBm));
    noise.set_fractal_octaves(Some(8));
    let mut heights = vec![0.0f32; 129 * 129];
    group.bench_function("fastnoise-lite, 8 octaves", |b| {
        b.iter(|| {
            for (i, height) in heights.iter_mut().enumerate() {
                *height = noise.get_noise_2d(black_box((i % 129) as f32), (i / 129) as f32);
            }
        });
    });
    group.finish();
}

fn patch_step(c: &mut Criterion) {
    let surface = surface();
    let dive = Dive::new(surface, START_LEVEL, |_| ());
    let (patch, _) = dive.step(START_LEVEL).block.patch(0, 0);
    c.bench_function("a patch's four children", |b| b.iter(|| black_box(&patch).children(&surface)));
    let block = dive.step(START_LEVEL).block;
    c.bench_function("a block's child (a level of the path)", |b| {
        b.iter(|| black_box(&block).child(&surface, [1, 0]));
    });
}

fn selection(c: &mut Criterion) {
    let surface = surface();
    let mut group = c.benchmark_group("selection");
    for depth in [10, 1_000, 100_000] {
        let dive = Dive::new(surface, START_LEVEL + depth, |_| ());
        let place = dive.place(START_LEVEL + depth);
        let head = place.position + glam::DVec3::new(0.0, 2.0, 0.0);
        let (root, head) = place.seen_from_above(head, 4);
        let detail = Detail::new(2.6);
        let view =
            View { root: &root.block, head, levels: 6, live_from: 0, prefetch_from: 0, detail, frusta: None };
        let mut selection = Selection::default();
        selection.select(&surface, &view, &mut All);
        let tiles = selection.counts.covering;
        group.throughput(Throughput::Elements(tiles as u64));
        group.bench_function(BenchmarkId::from_parameter(format!("depth {depth}, {tiles} tiles")), |b| {
            b.iter(|| selection.select(&surface, black_box(&view), &mut All));
        });
    }
    group.finish();
}

fn nearest(c: &mut Criterion) {
    let mut group = c.benchmark_group("nearest ground and ray");
    let mut probe = Probe::default();
    for depth in [10, 1_000, 100_000] {
        let dive = Dive::new(surface(), START_LEVEL + depth, |_| ());
        let place = dive.place(START_LEVEL + depth);
        let here = place.position + glam::DVec3::new(0.0, 2.0, 0.0);
        for (name, tolerance) in [("1 in 8", 1.0 / 8.0), ("1 in 1024", 1.0 / 1024.0)] {
            probe.nearest(&place, here, tolerance);
            let id = BenchmarkId::new(name, format!("depth {depth}, {} tiles", probe.looked_at()));
            group.bench_function(id, |b| b.iter(|| probe.nearest(&place, black_box(here), tolerance)));
        }
        let ahead = glam::DVec3::new(0.6, -0.3, 0.7).normalize();
        probe.ray(&place, here, ahead, 1e6);
        let id = BenchmarkId::new("ray", format!("depth {depth}, {} tiles", probe.looked_at()));
        group.bench_function(id, |b| b.iter(|| probe.ray(&place, black_box(here), ahead, 1e6)));
    }
    group.finish();
}

fn pilot(c: &mut Criterion) {
    let mut group = c.benchmark_group("a frame of the pilot");
    let pose = FlightPose { height: 2.0, ..FlightPose::default() };
    for depth in [10, 1_000, 100_000] {
        let stand = Course::new(surface(), depth, 0.0, |_| ()).at(&pose).stand();
        let mut pilot = Pilot::at(&stand, &MotionSettings::default());
        group.bench_function(BenchmarkId::from_parameter(format!("depth {depth}")), |b| {
            b.iter(|| {
                // Round and round, so that it stays at its depth.
                let input = Input { travel: Vec3::NEG_Z, look: Vec2::new(0.02, 0.0), ..Input::default() };
                pilot.advance(1.0 / 90.0, &input, 1.0).height
            });
        });
    }
    group.finish();
}

criterion_group!(benches, tile, patch_step, selection, nearest, pilot);
criterion_main!(benches);
