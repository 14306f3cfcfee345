//! The GPU's tiles are the CPU's, bit for bit: integers, so without any tolerance.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

mod support;

use fathomless::render::layout::SlotLayout;
use fathomless::terrain::tile::Cells;
use fathomless::terrain::{Scheme, Surface, Terrace};
use fathomless::verify::verify;

fn surface(scheme: Scheme, terrace: Option<Terrace>, amplitude: u16) -> Surface {
    Surface { seed: 0x1234_5678_9abc_def0, scheme, amplitude, terrace, only: None }
}

#[test]
fn a_million_heights_at_many_depths() {
    let gpu = support::gpu();
    let terrace = Terrace::new(4, 0.6, 0.2);
    let mut heights = 0;
    for (surface, cells, depth) in [
        (surface(Scheme::Cubic, terrace, 29_491), 64, 100_000),
        (surface(Scheme::Cubic, None, 36_045), 64, 1_000),
        (surface(Scheme::Bilinear, None, 26_214), 32, 10),
        (surface(Scheme::Bilinear, Terrace::new(16, 0.0, 0.9), 65_535), 16, 40_000),
        (surface(Scheme::Cubic, Terrace::new(1, 0.3, 0.5), 0), 4, 0),
        // Shallow, so that the octave is above some tiles, below some, and within others.
        (surface(Scheme::Cubic, terrace, 29_491).alone(5), 64, 8),
    ] {
        let layout = SlotLayout { cells: Cells::new(cells).unwrap(), mesh: 2 };
        let report = verify(&gpu, &surface, layout, 600, depth, |_| ()).unwrap();
        assert_eq!((report.tiles, report.deepest), (600, depth));
        assert!(report.clean(), "{surface:?}: {report:?}");
        assert!(report.shared > 1_000, "{report:?}");
        heights += report.heights;
    }
    assert!(heights > 1_000_000, "{heights}");
    support::assert_clean(gpu);
}
