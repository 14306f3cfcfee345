//! How much is drawn can change from frame to frame: fewer pixels in a part of the same images, other tiles, and nothing
//! is said against it; and a governor that is given too little time draws less.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

#[path = "support/studio.rs"]
mod studio;

use fathomless::governor::{Dials, GovernorSettings};
use fathomless::mock::SubmittedFrame;
use fathomless::terrain::morph::Detail;
use fathomless::viewer::{Quality, Step, ViewerConfig};
use fathomless::world::World;
use studio::{Setup, Studio, pose};

/// The sizes submitted, colour and depth of both eyes, which begin at the images' corner.
fn sizes(frame: &SubmittedFrame) -> Vec<[u32; 2]> {
    assert!(frame.views.iter().all(|view| view.offset == [0, 0]));
    let depths = frame.views.iter().map(|view| view.depth.as_ref().unwrap().size);
    frame.views.iter().map(|view| view.size).chain(depths).collect()
}

/// The mean colour of each cell of an 8 by 8 grid over a picture.
fn gist(rgba: &[u8], [width, height]: [u32; 2]) -> Vec<[f64; 3]> {
    let mut cells = vec![([0.0; 3], 0.0); 64];
    for (i, pixel) in rgba.chunks_exact(4).enumerate() {
        let (x, y) = (i as u32 % width, i as u32 / width);
        let (sum, count) = &mut cells[(y * 8 / height * 8 + x * 8 / width) as usize];
        *count += 1.0;
        (0..3).for_each(|c| sum[c] += f64::from(pixel[c]));
    }
    cells.into_iter().map(|(sum, count)| sum.map(|value| value / count)).collect()
}

fn apart(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let differences = a.iter().zip(b).flat_map(|(a, b)| (0..3).map(move |c| (a[c] - b[c]).abs()));
    differences.fold(0.0, f64::max)
}

#[test]
fn fewer_pixels_show_the_same_in_a_part_of_the_same_images() {
    let mut studio = Studio::open(&Setup { size: [160, 120], ..Setup::default() });
    let above = pose(0.0, 2.2, -12.0, 30.0);
    let whole = studio.shoot(&above);
    assert_eq!(sizes(&whole), [[160, 120]; 4]);
    let dials = studio.viewer.dials();
    assert_eq!(dials.scale, 1.0);
    studio.viewer.keep_mirror().unwrap();
    for (scale, size) in [(0.75, [120, 90]), (0.5, [80, 60]), (1.0, [160, 120])] {
        studio.viewer.set_dials(Dials { scale, ..dials });
        let frame = studio.shoot(&above);
        assert_eq!((sizes(&frame), studio.viewer.drawn()), (vec![size; 4], size), "{scale}");
        for (small, large) in frame.views.iter().zip(&whole.views) {
            assert_eq!((small.fov, small.pose), (large.fov, large.pose));
            let apart = apart(&gist(&small.rgba, size), &gist(&large.rgba, [160, 120]));
            assert!(apart < 12.0, "cells differ by {apart} at {scale}");
        }
        // The window has the same pixels.
        assert_eq!(studio.viewer.mirrored(), size);
        let mirrored = studio.viewer.read_mirror(0).unwrap();
        let submitted = frame.views[0].rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]);
        assert!(mirrored.iter().copied().eq(submitted), "{scale}");
    }
    studio.close();
}

#[test]
fn the_detail_changes_within_what_the_backdrop_and_the_slots_allow() {
    let probe = Studio::open(&Setup { size: [128, 128], ..Setup::default() });
    let mut quality: Quality = *probe.viewer.quality();
    probe.close();
    quality.detail = Detail::new(3.4);
    let viewer = ViewerConfig { validate: true, quality: Some(quality), ..ViewerConfig::default() };
    let mut studio = Studio::open(&Setup { size: [128, 128], viewer, ..Setup::default() });
    studio.viewer.set_shading(fathomless::render::Shading::Holes([1.0, 0.0, 1.0, 1.0]));
    let dials = studio.viewer.dials();
    let mut drawn = Vec::new();
    for split in [3.4, 9.0, 3.0, 2.6, 1.0] {
        studio.viewer.set_dials(Dials { split, ..dials });
        // Straight down, where nothing but ground is: what shows the background is a hole.
        let frame = studio.shoot(&pose(0.0, 2.2, -90.0, 0.0));
        let holes =
            frame.views.iter().flat_map(|view| view.rgba.chunks_exact(4)).filter(|p| p[..3] == [255, 0, 255]);
        assert_eq!(holes.count(), 0, "{split}");
        drawn.push((studio.viewer.dials().split, studio.viewer.counts().drawn));
    }
    let splits: Vec<f64> = drawn.iter().map(|(split, _)| *split).collect();
    assert_eq!(splits, [3.4, 3.4, 3.0, 2.6, 2.6]);
    let tiles: Vec<usize> = drawn.iter().map(|(_, tiles)| *tiles).collect();
    assert!(
        tiles[0] == tiles[1] && tiles[1] > tiles[2] && tiles[2] > tiles[3] && tiles[3] == tiles[4],
        "{tiles:?}"
    );
    studio.close();
}

#[test]
fn a_governor_draws_less_where_time_is_short_and_nobody_else_does() {
    let fly = |governor: Option<GovernorSettings>| {
        let viewer = ViewerConfig { validate: true, complete: false, governor, ..ViewerConfig::default() };
        let mut studio = Studio::open(&Setup { size: [96, 96], viewer, ..Setup::default() });
        let Studio { viewer, course, .. } = &mut studio;
        let above = pose(0.0, 2.2, -12.0, 30.0);
        let mut frames = 0;
        while frames < 90 {
            frames += usize::from(viewer.frame(&course.at(&above), false).unwrap() == Step::Drew);
        }
        let dials = studio.viewer.dials();
        // Another world is drawn as much of, and another quality begins anew.
        let (canyonlands, wanted) = (World::load("canyonlands").unwrap(), studio.viewer.wanted_quality());
        studio.viewer.redraw(&canyonlands, wanted).unwrap();
        assert_eq!(studio.viewer.dials(), dials);
        assert_eq!(studio.viewer.drawn(), [96, 96].map(|all| (f64::from(all) * dials.scale).round() as u32));
        let finer = Detail::new(wanted.detail.split + 0.2);
        studio.viewer.redraw(&canyonlands, Quality { detail: finer, ..wanted }).unwrap();
        let anew = Dials { split: finer.split, scale: 1.0, ..studio.viewer.dials() };
        assert_eq!(studio.viewer.dials(), anew);
        studio.close();
        dials
    };
    // A frame of a software driver takes longer than 4 ms, whatever is left out.
    let hasty = GovernorSettings { rate_hz: Some(240.0), ..GovernorSettings::default() };
    let still = fly(None);
    let governed = fly(Some(hasty));
    assert_eq!((still.scale, governed.split), (1.0, still.split), "{governed:?}");
    assert!(governed.scale < 0.95, "{governed:?}");
}
