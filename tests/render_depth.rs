//! Depth is reversed and infinite: near / distance along the view where there is ground, 0 where there is sky.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

#[path = "support/studio.rs"]
mod studio;

use fathomless::flight::FlightPose;
use fathomless::mock::SubmittedFrame;
use fathomless::terrain::Place;
use glam::DVec3;
use studio::{COMFORT_M, Camera, NEAR_M, Setup, Studio, depth_at, pose, quantile};

/// Levels above the anchor from which the reference looks at the ground, so that it knows all of it that is seen.
const WIDER: usize = 5;

/// The ground, and the viewer over it, seen from a few levels above the anchor.
struct Reference {
    wide: Place,
    /// Metres per tile of that level.
    metres: f64,
}

impl Reference {
    fn of(studio: &mut Studio, pose: &FlightPose) -> (Reference, glam::Quat) {
        let standpoint = studio.course.at(pose);
        let mut wide = standpoint.place.clone();
        wide.position = standpoint.position;
        for _ in 0..WIDER {
            wide.shallower();
        }
        let metres = COMFORT_M / standpoint.height * f64::from(1 << WIDER);
        (Reference { wide, metres }, standpoint.orientation)
    }

    /// Metres from the ground up to a point given in metres from the head; None beyond the tiles known.
    fn above(&self, from_head: DVec3) -> Option<f64> {
        let p = self.wide.position + from_head / self.metres;
        let known = |v: f64| (-1.0..2.0).contains(&v);
        (known(p.x) && known(p.z)).then(|| (p.y - self.wide.ground(p.x, p.z)) * self.metres)
    }

    /// How far along `ray` from `eye` the ground is, looked for near a distance where it should be.
    fn distance(&self, eye: DVec3, ray: DVec3, near: f64) -> Option<f64> {
        let at = |distance: f64| self.above(eye + ray * distance);
        let steps = (0..=400).map(|i| near * (0.8 + 0.001 * f64::from(i)));
        let mut crossings = Vec::new();
        let mut before: Option<(f64, f64)> = None;
        for distance in steps {
            let above = at(distance)?;
            if let Some((last, was)) = before
                && (was > 0.0) != (above > 0.0)
            {
                crossings.push(last + (distance - last) * was / (was - above));
            }
            before = Some((distance, above));
        }
        crossings.into_iter().min_by(|a, b| (a - near).abs().total_cmp(&(b - near).abs()))
    }
}

/// Compares the depth of many pixels of both eyes with the distance to the ground of the exact heights.
fn compare(studio: &mut Studio, pose: &FlightPose, bias: f64) {
    // After a jump the slots of the frames before are still taken for a while.
    let mut frame = studio.shoot(pose);
    for _ in 0..5 {
        if studio.viewer.counts().waiting > 0 {
            frame = studio.shoot(pose);
        }
    }
    assert_eq!(studio.viewer.counts().waiting, 0, "every tile is there");
    let (reference, orientation) = Reference::of(studio, pose);
    let cameras = Camera::both(&frame, orientation);
    let (mut ratios, mut astray) = (Vec::new(), 0);
    for (view, camera) in frame.views.iter().zip(&cameras) {
        for y in (3..view.size[1]).step_by(9) {
            for x in (3..view.size[0]).step_by(9) {
                let depth = depth_at(view, x, y);
                assert!((0.0..1.0).contains(&depth), "{depth} is a depth");
                assert!(depth > 0.0, "the ground fills the picture");
                let distance = f64::from(NEAR_M / depth);
                let ray = camera.ray(x as f32 + 0.5, y as f32 + 0.5).as_dvec3();
                match reference.distance(camera.eye.as_dvec3(), ray, distance) {
                    Some(expected) => ratios.push(distance / expected),
                    None => astray += 1,
                }
            }
        }
    }
    let mut errors: Vec<f64> = ratios.iter().map(|ratio| (ratio - 1.0).abs()).collect();
    let (count, middle) = (ratios.len(), quantile(&mut ratios, 0.5));
    let (half, most) = (quantile(&mut errors, 0.5), quantile(&mut errors, 0.95));
    println!("{pose:?}: {count} pixels, {astray} astray, ratio {middle:.5}, error {half:.5}, 95% {most:.5}");
    assert!(count > 300 && astray * 50 <= count, "{astray} of {count} pixels are nowhere near the ground");
    // The mesh is a part of a cell off, and a cell is about a hundredth of the distance.
    assert!((middle - 1.0).abs() < bias, "the middle of measured / true distance is {middle}");
    assert!(half < bias + 0.003 && most < bias + 0.02, "distances are off by {half} (half), {most} (95%)");
}

#[test]
fn depth_is_near_over_the_distance_to_the_exact_ground() {
    // Terraces only ever take ground away, at every level, so the mesh lies a little above what it stands for.
    for (world, depth, bias) in [("hills", 0, 0.001), ("tunkovic", 1000, 0.001), ("canyonlands", 40, 0.012)] {
        let mut studio = Studio::open(&Setup { world, depth, deepest: 3.0, ..Setup::default() });
        for pose in [pose(0.0, 3.0, -90.0, 0.0), pose(0.6, 2.0, -60.0, 50.0), pose(3.0, 2.5, -75.0, -20.0)] {
            compare(&mut studio, &pose, bias);
        }
        studio.close();
    }
}

/// The rows of a view's depth image, top row first.
fn rows(frame: &SubmittedFrame) -> impl Iterator<Item = &[f32]> {
    frame.views.iter().flat_map(|view| {
        let depth = view.depth.as_ref().unwrap();
        depth.values.chunks(depth.size[0] as usize)
    })
}

#[test]
fn the_sky_is_infinitely_far_and_the_layer_says_how_depth_is_meant() {
    let mut studio = Studio::open(&Setup::default());
    let frame = studio.shoot(&pose(0.0, 2.2, 88.0, 0.0));
    let [width, height] = frame.views[0].size.map(|n| n as usize);
    let zenith =
        rows(&frame).skip(height / 4).take(height / 2).flat_map(|row| &row[width / 4..3 * width / 4]);
    assert!(zenith.copied().all(|depth| depth == 0.0), "straight up there is only sky");

    let frame = studio.shoot(&pose(0.0, 2.2, 12.0, 0.0));
    for view in &frame.views {
        let depth = view.depth.as_ref().unwrap();
        assert_eq!(depth.size, view.size);
        assert_eq!((depth.min_depth, depth.max_depth), (0.0, 1.0));
        assert_eq!((depth.near_z, depth.far_z), (f32::INFINITY, NEAR_M), "reversed: 0 is infinitely far");
        let sky = depth.values.iter().filter(|&&depth| depth == 0.0).count();
        assert!((depth.values.len() / 10..depth.values.len() * 9 / 10).contains(&sky), "{sky} pixels of sky");
        assert!(depth.values.iter().all(|depth| (0.0..1.0).contains(depth)));
    }
    // Nearer is greater: the ground comes closer from the horizon down.
    let mean = |row: &[f32]| row.iter().sum::<f32>() / row.len() as f32;
    let of_eye: Vec<f32> = rows(&frame).take(frame.views[0].size[1] as usize).map(mean).collect();
    let [upper, middle, lower] = [0.3, 0.8, 0.98].map(|y| of_eye[(y * of_eye.len() as f64) as usize]);
    assert!(upper < middle && middle < lower, "{upper} {middle} {lower}");
    studio.close();
}
