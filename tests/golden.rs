//! What the worlds look like: small pictures that were looked at, compared with tolerance for other drivers.
//!
//! `UPDATE_GOLDEN=1 cargo test --release --test golden` rewrites them; a failure leaves `*_actual.png` beside them.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::picture::{self, Pixels};
use fathomless::settings::QualitySettings;
use fathomless::viewer::{Step, Viewer, ViewerConfig};
use fathomless::world::World;

const SIZE: u32 = 384;

/// Mean difference that another driver's rounding may make, in 1/255.
const MEAN: f64 = 2.5;
/// Share of channel values that may differ by more than [`FAR`].
const SHARE: f64 = 0.01;
const FAR: u8 = 40;

fn check(name: &str, world: &str, depth: usize, pose: FlightPose) {
    let world = World::load(world).unwrap();
    let wish = QualitySettings { samples: Some(1), ..QualitySettings::default() };
    let eye_size = Some([SIZE, SIZE]);
    let config = ViewerConfig { validate: true, eye_size, wish, ..ViewerConfig::default() };
    let mut viewer = Viewer::open(&world, &config).unwrap();
    viewer.keep_pictures().unwrap();
    let mut course = Course::new(world.surface, depth, pose.depth, |_| ());
    while viewer.frame(&course.at(&pose), false).unwrap() != Step::Drew {}
    let actual = viewer.picture(0).unwrap();
    let remarks = viewer.close().unwrap();
    assert_eq!(remarks.validation + remarks.violations, 0, "{remarks:?}");

    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let golden = folder.join(format!("{name}.png"));
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        picture::write(&golden, [SIZE, SIZE], Pixels::Rgb8(&actual), &[]).unwrap();
        return;
    }
    let expected = read_png(&golden);
    assert_eq!(actual.len(), expected.len(), "{name}: another size");
    let differences = || actual.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b));
    let mean = differences().map(f64::from).sum::<f64>() / actual.len() as f64;
    let far = differences().filter(|&d| d > FAR).count() as f64 / actual.len() as f64;
    if mean > MEAN || far > SHARE {
        let left: PathBuf = folder.join(format!("{name}_actual.png"));
        picture::write(&left, [SIZE, SIZE], Pixels::Rgb8(&actual), &[]).unwrap();
        panic!("{name}: mean difference {mean:.2}, {:.2} % far off; see {}", far * 100.0, left.display());
    }
}

fn read_png(path: &Path) -> Vec<u8> {
    let file =
        File::open(path).unwrap_or_else(|e| panic!("{}: {e}; UPDATE_GOLDEN=1 makes it", path.display()));
    let mut reader = png::Decoder::new(BufReader::new(file)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    pixels
}

fn pose(depth: f64, pitch: f64, height: f64) -> FlightPose {
    FlightPose { depth, yaw: 0.3, pitch, roll: 0.0, height, offset: [0.0; 2], ..FlightPose::default() }
}

#[test]
fn canyonlands() {
    check("canyonlands", "canyonlands", 0, pose(0.0, -0.22, 2.4));
}

#[test]
fn canyonlands_a_thousand_octaves_down() {
    check("canyonlands_deep", "canyonlands", 1_000, pose(0.5, -0.3, 2.0));
}

#[test]
fn tunkovic() {
    check("tunkovic", "tunkovic", 0, pose(0.0, -0.2, 2.4));
}

#[test]
fn hills() {
    check("hills", "hills", 20, pose(0.0, -0.2, 2.4));
}
