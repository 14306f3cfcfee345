//! A steady frame costs no memory: nothing is allocated on the heap, and little is uploaded.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]
#![allow(unsafe_code, reason = "a counting allocator")]

#[path = "support/studio.rs"]
mod studio;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use fathomless::aids::{Aids, HandAid};
use fathomless::render::layout::{Request, SceneUniform, TileRecord};
use fathomless::rig::Pose;
use fathomless::settings::QualitySettings;
use fathomless::telemetry::Memory;
use fathomless::telemetry::logbook::{Logbook, Wanted};
use fathomless::viewer::{Step, ViewerConfig};
use studio::{Setup, Studio, pose};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// Counts what each thread takes from the heap. All of Rust is heard: the viewer, the bindings, gpu-allocator and the
/// built-in runtime. The Vulkan driver and its layers, being C, are not.
struct Counting;

fn count() {
    // A thread may allocate while its locals are already gone.
    let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: the system's allocator does the work.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: passed on as it came.
        unsafe { System.alloc(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: passed on as it came.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: passed on as it came.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What this thread allocates while `f` runs.
fn allocations<R>(f: impl FnOnce() -> R) -> (u64, R) {
    let before = ALLOCATIONS.get();
    let value = f();
    (ALLOCATIONS.get() - before, value)
}

const MOST_UPLOADED: usize = 64 * 1024;

#[test]
fn the_count_hears_an_allocation() {
    let (count, kept) = allocations(|| vec![1u8; 100]);
    assert_eq!((count, kept.len()), (1, 100));
    assert_eq!(allocations(|| ()).0, 0);
}

#[test]
fn a_steady_frame_allocates_nothing_and_uploads_little() {
    for (world, depth) in [("canyonlands", 0), ("hills", 2000)] {
        let setup = Setup { world, depth, size: [64, 64], read_back: false, ..Setup::default() };
        let mut studio = Studio::open(&setup);
        let still = pose(0.0, 2.2, -12.0, 0.0);
        let Studio { viewer, course, .. } = &mut studio;
        // Until every buffer has its size, both frames in flight have come round, and the session is in focus.
        for _ in 0..12 {
            viewer.frame(&course.at(&still), false).unwrap();
        }
        for frame in 0..50 {
            let (count, step) = allocations(|| viewer.frame(&course.at(&still), false).unwrap());
            assert_eq!(step, Step::Drew);
            assert_eq!(count, 0, "{world}: allocations in steady frame {frame}");
        }
        let counts = viewer.counts();
        assert_eq!((counts.made, counts.waiting), (0, 0), "a still flight asks for nothing new");
        let draw_arguments = 5 * size_of::<u32>();
        let uploaded = counts.drawn * size_of::<TileRecord>()
            + counts.made * size_of::<Request>()
            + size_of::<SceneUniform>()
            + draw_arguments;
        println!("{world}: {} tiles drawn, {uploaded} bytes uploaded", counts.drawn);
        assert!(counts.drawn > 50 && uploaded <= MOST_UPLOADED, "{uploaded} bytes in a steady frame");
        studio.close();
    }
}

/// Looking about asks for no new tiles (all directions are made), so it is as cheap as standing still.
#[test]
fn turning_allocates_nothing_either() {
    let mut studio = Studio::open(&Setup { size: [64, 64], read_back: false, ..Setup::default() });
    let Studio { viewer, course, .. } = &mut studio;
    let turned = |frame: u32| pose(0.0, 2.2, -20.0, f64::from(frame) * 12.0);
    for frame in 0..30 {
        viewer.frame(&course.at(&turned(frame)), false).unwrap();
    }
    for frame in 30..60 {
        let (count, step) = allocations(|| viewer.frame(&course.at(&turned(frame)), false).unwrap());
        assert_eq!((step, count), (Step::Drew, 0), "frame {frame}");
    }
    studio.close();
}

#[test]
fn several_samples_of_a_pixel_allocate_nothing_either() {
    let wish = QualitySettings { samples: Some(4), ..QualitySettings::default() };
    let viewer = ViewerConfig { validate: true, wish, ..ViewerConfig::default() };
    let mut studio = Studio::open(&Setup { size: [64, 64], read_back: false, viewer, ..Setup::default() });
    let Studio { viewer, course, .. } = &mut studio;
    assert_eq!(viewer.quality().samples, 4, "all devices can");
    let still = pose(0.0, 2.2, -12.0, 0.0);
    for _ in 0..12 {
        viewer.frame(&course.at(&still), false).unwrap();
    }
    for frame in 0..20 {
        let (count, step) = allocations(|| viewer.frame(&course.at(&still), false).unwrap());
        assert_eq!((step, count), (Step::Drew, 0), "frame {frame}");
    }
    studio.close();
}

/// Neither does what is kept of the frames, whether or not files are written.
#[test]
fn keeping_a_logbook_allocates_nothing_on_the_frame_thread() {
    let mut studio = Studio::open(&Setup { size: [64, 64], read_back: false, ..Setup::default() });
    let Studio { viewer, course, .. } = &mut studio;
    let still = pose(0.0, 2.2, -12.0, 0.0);
    for _ in 0..12 {
        viewer.frame(&course.at(&still), false).unwrap();
    }
    let stats = *viewer.stats();
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("steady");
    let (trace, lines) = (folder.join("trace.json"), folder.join("stats.csv"));
    for wanted in [Wanted::default(), Wanted { trace: Some(&trace), stats: Some(&lines) }] {
        let mut logbook = Logbook::open(&wanted);
        let (count, ()) = allocations(|| {
            for _ in 0..400 {
                logbook.frame(&stats, 1.0, Memory::default());
            }
        });
        assert_eq!(count, 0, "{wanted:?}");
        assert_eq!(logbook.histogram.count(), 400);
    }
    studio.close();
}

/// Nor does what is drawn over the land.
#[test]
fn hands_and_the_grid_allocate_nothing_either() {
    let mut studio = Studio::open(&Setup { size: [64, 64], read_back: false, ..Setup::default() });
    let Studio { viewer, course, .. } = &mut studio;
    let still = pose(0.0, 2.2, -12.0, 0.0);
    let aids = |frame: u32| {
        let hand = |x: f32| {
            let position = glam::Vec3::new(x, -0.3, -0.5 - 0.001 * frame as f32);
            let grip = Pose { position, orientation: glam::Quat::IDENTITY };
            Some(HandAid { grip, aim: Some(grip), ray_m: Some(3.0), holds: true })
        };
        let mut aids = Aids { hands: [-0.2, 0.2].map(hand), grid: 0.5, floor_m: 1.6, ..Aids::default() };
        (0..20).for_each(|i| aids.thread.push(glam::Vec3::new(0.0, 0.0, -(i as f32))));
        aids
    };
    for frame in 0..50 {
        let (count, step) = allocations(|| {
            viewer.set_aids(&aids(frame));
            viewer.frame(&course.at(&still), false).unwrap()
        });
        // The first frames make buffers and wait for the focus.
        assert!(frame < 12 || (step, count) == (Step::Drew, 0), "frame {frame}: {count} allocations");
    }
    studio.close();
}
