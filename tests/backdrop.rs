//! The backdrop: a function of the place alone, without a visible seam, and right to within its parallax bound.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::render::{BackdropConfig, Shading};
use fathomless::terrain::backdrop::{Ladder, ROOT_UP, bound_for, lag_for, parallax};
use fathomless::viewer::{Faces, Quality, Step, Viewer, ViewerConfig};
use fathomless::world::World;

const SIZE: u32 = 192;

fn pose(depth: f64) -> FlightPose {
    FlightPose {
        depth,
        yaw: 0.4,
        pitch: -0.25,
        roll: 0.0,
        height: 2.0,
        offset: [0.0; 2],
        ..FlightPose::default()
    }
}

fn config() -> ViewerConfig {
    ViewerConfig { validate: true, eye_size: Some([SIZE, SIZE]), ..ViewerConfig::default() }
}

fn open(config: &ViewerConfig) -> (Viewer, Course) {
    let world = World::load("canyonlands").unwrap();
    let mut viewer = Viewer::open(&world, config).unwrap();
    viewer.keep_pictures().unwrap();
    (viewer, Course::new(world.surface, 0, 64.0, |_| ()))
}

fn draw(viewer: &mut Viewer, course: &mut Course, pose: &FlightPose) -> Vec<u8> {
    while viewer.frame(&course.at(pose), false).unwrap() != Step::Drew {}
    viewer.picture(0).unwrap()
}

fn close(viewer: Viewer) {
    let remarks = viewer.close().unwrap();
    assert_eq!(remarks.validation + remarks.violations, 0, "{remarks:?}");
}

/// Mean and greatest difference of two pictures, in 1/255.
fn difference(a: &[u8], b: &[u8]) -> (f64, u8) {
    assert_eq!(a.len(), b.len());
    let all = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b));
    let sum: u64 = all.clone().map(u64::from).sum();
    (sum as f64 / a.len() as f64, all.max().unwrap())
}

#[test]
fn the_place_alone_decides() {
    // Straight there; by a dive, layer by layer over what was there; from below; and from the side.
    let (mut viewer, mut course) = open(&config());
    draw(&mut viewer, &mut course, &pose(30.2));
    let straight = viewer.read_backdrop().unwrap();
    let visible = viewer.backdrop().config().layers;
    let nearest = |viewer: &Viewer| {
        let layers = viewer.backdrop().layers();
        layers[layers.len() - visible..].to_vec()
    };
    let layers = nearest(&viewer);
    let histories: [&[FlightPose]; 3] = [
        &[pose(22.0), pose(23.5), pose(25.1), pose(26.0), pose(28.9), pose(29.5), pose(30.9), pose(30.2)],
        &[pose(36.0), pose(34.0), pose(31.5), pose(30.2)],
        &[FlightPose { offset: [37.0, -20.0], ..pose(30.2) }, pose(30.2)],
    ];
    for (i, history) in histories.into_iter().enumerate() {
        let (mut other, mut course) = open(&config());
        for pose in history {
            draw(&mut other, &mut course, pose);
        }
        assert_eq!(nearest(&other), layers, "history {i}");
        same_texels(&straight, &other.read_backdrop().unwrap(), (layers[visible - 1].level, visible), i);
        close(other);
    }
    close(viewer);
}

fn same_texels(a: &Faces, b: &Faces, (nearest, layers): (usize, usize), history: usize) {
    assert_eq!((a.side, a.colour.len()), (b.side, 6 * a.side * a.side));
    let (mut compared, mut covered) = (0, 0);
    for i in 0..a.colour.len() {
        // In tiles of the nearest layer.
        let distance = |faces: &Faces| {
            let distance = faces.log_distance[i] + (nearest as f32 - faces.reference as f32);
            (faces.colour[i][3] > 0).then_some(distance)
        };
        let (ours, theirs) = (distance(a), distance(b));
        // Cubemaps begin with other far layers: they are beyond the haze.
        let beyond = layers as f32 - 0.5;
        if ours.is_none_or(|d| d > beyond) && theirs.is_none_or(|d| d > beyond) {
            continue;
        }
        compared += 1;
        covered += usize::from(ours.is_some());
        let near = (ours.unwrap_or(0.0) - theirs.unwrap_or(0.0)).abs() < 1e-3;
        assert!(near && a.colour[i] == b.colour[i], "history {history}, texel {i}: {ours:?} {theirs:?}");
    }
    assert!(compared > a.colour.len() / 20 && covered > 0, "{compared} texels compared");
}

#[test]
fn nothing_is_seen_of_a_window_move() {
    let (mut viewer, mut course) = open(&config());
    for level in [17.0, 40.0] {
        let before = draw(&mut viewer, &mut course, &pose(level - 0.002));
        let live = viewer.backdrop().nearest().unwrap();
        let after = draw(&mut viewer, &mut course, &pose(level + 0.002));
        assert_eq!(viewer.backdrop().nearest().unwrap(), live + 1, "the window has moved");
        let (mean, _) = difference(&before, &after);
        // The same step without a move, for comparison.
        let still = draw(&mut viewer, &mut course, &pose(level + 0.006));
        let (usual, _) = difference(&after, &still);
        println!("level {level}: {mean:.3} over a move, {usual:.3} without");
        assert!(mean < 1.5 * usual + 0.3, "level {level}: {mean} over a move, {usual} without");
    }
    close(viewer);
}

#[test]
fn baked_and_live_tiles_show_the_same() {
    let (mut viewer, mut course) = open(&config());
    let quality = *viewer.quality();
    let at = pose(25.6);
    let baked = draw(&mut viewer, &mut course, &at);
    close(viewer);
    let with_lag = |lag: usize| {
        let total = quality.backdrop.lag + quality.backdrop.layers;
        let backdrop = BackdropConfig { lag, layers: total - lag, ..quality.backdrop };
        let (mut viewer, mut course) =
            open(&ViewerConfig { quality: Some(Quality { backdrop, ..quality }), ..config() });
        let picture = draw(&mut viewer, &mut course, &at);
        let tiles = viewer.counts().drawn;
        close(viewer);
        (picture, tiles)
    };
    // Four octaves more are live: what was baked is drawn from the very eye.
    let (live, more) = with_lag(quality.backdrop.lag + 4);
    let (near, fewer) = with_lag(quality.backdrop.lag - 4);
    assert!(more > fewer);
    let (mean, _) = difference(&baked, &live);
    let (worse, _) = difference(&near, &live);
    println!("{mean:.3} at the chosen lag, {worse:.3} at four octaves less");
    assert!(mean < 2.0, "baked and live differ by {mean}");
    assert!(mean < worse, "a bake too near should be seen: {mean} and {worse}");
}

#[test]
fn the_parallax_stays_in_its_bound() {
    let world = World::load("canyonlands").unwrap();
    let mut course = Course::new(world.surface, 0, 64.0, |_| ());
    let mut ladder = Ladder::default();
    for (split, pixels_per_tangent) in [(2.6, 96.0), (2.6, 512.0), (3.0, 1100.0)] {
        let lag = lag_for(3.0, split, pixels_per_tangent, 0.5);
        let bound = bound_for(lag, split, pixels_per_tangent, 0.5);
        assert!((3.0..6.0).contains(&bound), "{bound}");
        for height in [0.5, 2.0, 8.0, 300.0] {
            for i in 0..200 {
                let depth = 20.0 + 0.2 * f64::from(i);
                let standpoint = course.at(&FlightPose { height, ..pose(depth) });
                ladder.climb(standpoint.place, standpoint.position, 2 * lag);
                let id = ladder.id(standpoint.place.level() - lag, lag);
                let moved = ladder.moved(&id, lag);
                let shift = parallax(moved, split, lag) * pixels_per_tangent;
                assert!(shift <= 0.5, "depth {depth}: {shift} pixels, {moved} tiles away");
                let layer = ladder.layer(standpoint.place, id.level, lag);
                let (_, here) =
                    standpoint.place.lift(standpoint.position, standpoint.place.level(), id.level - ROOT_UP);
                let from_eye = (here - layer.eye).length() * f64::from(1u32 << (lag + ROOT_UP));
                assert!((from_eye - moved).abs() < 1e-3 * (1.0 + moved), "{from_eye} and {moved}");
            }
        }
    }
}

#[test]
fn no_sky_below_the_horizon() {
    let (mut viewer, mut course) = open(&config());
    viewer.set_shading(Shading::Holes([1.0, 0.0, 1.0, 1.0]));
    for i in 0..40 {
        let f = f64::from(i);
        // Forty-five degrees down and less: all of the picture is below the horizon.
        let down = FlightPose { yaw: 0.7 * f, pitch: -0.95 - 0.015 * f, depth: 12.0 + 0.31 * f, ..pose(0.0) };
        let picture = draw(&mut viewer, &mut course, &down);
        let holes = picture.chunks_exact(3).filter(|p| *p == [255, 0, 255]).count();
        assert_eq!(holes, 0, "frame {i}");
    }
    close(viewer);
}
