//! The nearest ground is never farther than said, nor nearer by more than the tolerance; a ray meets the ground where
//! it first comes to it: at any depth, on any slope.

#[path = "support/terrain.rs"]
mod support;

use fathomless::terrain::hash::mix;
use fathomless::terrain::nearest::{Probe, RAY_TOLERANCE};
use fathomless::terrain::place::{Dive, START_LEVEL, gentlest};
use fathomless::terrain::tile::{Cells, Tile};
use fathomless::terrain::{Place, Scheme, Spine, Surface, Terrace};
use glam::DVec3;
use proptest::prelude::*;
use support::{path, place, surface};

/// What most searches here are held to.
const TOLERANCE: f64 = 1.0 / 16.0;

/// What some are.
const FINE: f64 = 1.0 / 1024.0;

/// [`Place::ground`] follows the ground to 2⁻²⁰ of a tile; what is below counts for so much.
fn grain(place: &Place) -> f64 {
    let [gx, gz] = place.spine.bottom().block.plane.slope();
    4.0 / f64::from(1 << 20) * (4.0 + gx.abs() + gz.abs())
}

/// A viewer so high above the ground.
fn viewer(surface: Surface, path: &support::Path, [x, height, z]: [f64; 3]) -> Place {
    let mut place = place(surface, path, [x, 0.0, z]);
    place.position.y = place.ground(place.position.x, place.position.z) + height;
    place
}

fn height() -> impl Strategy<Value = f64> {
    prop_oneof![4 => 0.02f64..4.0, 1 => 0.0005f64..0.02, 1 => 4.0f64..200.0]
}

/// Points of the ground: over the nine tiles, and closer and closer around `around`.
fn ground_points(place: &Place, around: DVec3, count: u32) -> impl Iterator<Item = DVec3> {
    let one = |bits: u32| f64::from(mix(bits)) / f64::from(u32::MAX);
    (0..count).map(move |i| {
        let spread = (-f64::from(i % 24)).exp2();
        let near = |v: f64, k: u32| (v + 3.0 * spread * (one(2 * i + k) - 0.5)).clamp(-1.0, 2.0);
        let (x, z) = (near(around.x, 0), near(around.z, 1));
        DVec3::new(x, place.ground(x, z), z)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, ..ProptestConfig::default() })]

    #[test]
    fn nothing_is_nearer_and_something_is_as_near(
        surface in surface(), path in path(4), x in -0.2f64..1.2, height in height(), z in -0.2f64..1.2,
    ) {
        let place = viewer(surface, &path, [x, height, z]);
        let here = place.position;
        let nearest = Probe::default().nearest(&place, here, TOLERANCE);
        let grain = grain(&place);
        prop_assert!(nearest.least <= height + grain, "{} under {} tiles of air", nearest.least, height);
        for point in ground_points(&place, nearest.point, 600) {
            let distance = point.distance(here);
            prop_assert!(distance >= nearest.least - grain, "ground {} away, not {}", distance, nearest.least);
        }
        let way = nearest.point - here;
        prop_assert!((way.length() / nearest.most - 1.0).abs() < 1e-6, "{} is not {}", way.length(), nearest.most);
        // Near the root the ground beyond its nine tiles counts, as near as it could be.
        prop_assert!(place.level() < 12 || nearest.most * (1.0 - TOLERANCE) <= nearest.least * (1.0 + 1e-9), "{:?}", nearest);
        let covered = |v: f64| (-1.0..2.0).contains(&v);
        if covered(nearest.point.x) && covered(nearest.point.z) {
            // The way ends under the ground, or comes past it.
            let mut ground = nearest.point;
            ground.y = place.ground(ground.x, ground.z);
            let passed = nearest.point.y <= ground.y + grain || ground.distance(here) <= nearest.most + grain;
            prop_assert!(passed, "the way ends {} above ground", nearest.point.y - ground.y);
        }
    }

    #[test]
    fn a_ray_meets_the_ground_where_it_first_comes_to_it(
        surface in surface(), path in path(4), x in 0.0f64..1.0, height in 0.01f64..3.0, z in 0.0f64..1.0,
        heading in 0.0f64..6.3, pitch in -1.57f64..0.6,
    ) {
        let place = viewer(surface, &path, [x, height, z]);
        let here = place.position;
        let direction = DVec3::new(heading.sin() * pitch.cos(), pitch.sin(), heading.cos() * pitch.cos());
        let met = Probe::default().ray(&place, here, direction, 30.0);
        let covered = |p: DVec3| (-1.0..2.0).contains(&p.x) && (-1.0..2.0).contains(&p.z);
        let grain = grain(&place);
        let over = |t: f64| {
            let p = here + t * direction;
            covered(p).then(|| p.y - place.ground(p.x, p.z))
        };
        // Nothing before.
        let until = met.unwrap_or(30.0);
        for i in 0..1_000 {
            let t = until * (f64::from(i) / 1_000.0);
            let Some(over) = over(t) else { break };
            prop_assert!(over >= -grain, "{} below ground at {}, met at {:?}", -over, t, met);
        }
        // Something there.
        if let Some(over) = met.and_then(over) {
            let met = met.unwrap_or_default();
            prop_assert!(over.abs() <= RAY_TOLERANCE * met + grain, "{} above ground where it is met, at {}", over, met);
        }
    }

    #[test]
    fn every_vertex_near_by_is_as_far_as_said(
        surface in surface(), path in path(4), x in 0.0f64..1.0, height in 0.05f64..2.0, z in 0.0f64..1.0,
    ) {
        let place = viewer(surface, &path, [x, height, z]);
        let nearest = Probe::default().nearest(&place, place.position, TOLERANCE);
        let (down, up) = surface.bounds();
        let cells = Cells::N64;
        let mut least = f64::INFINITY;
        for (i, j) in (-1..=1).flat_map(|j| (-1..=1).map(move |i| (i, j))) {
            let (patch, rise) = place.spine.bottom().block.patch(i, j);
            let tile = Tile::of(&surface, &patch, cells);
            let corner = DVec3::new(f64::from(i), rise as f64 / 65_536.0, f64::from(j));
            for (v, u) in (0..=64).flat_map(|v| (0..=64).map(move |u| (v, u))) {
                let rise = patch.plane.rise(i64::from(u), i64::from(v)) + i64::from(tile.fine_at(u, v));
                let vertex = corner + DVec3::new(f64::from(u), rise as f64 / 65_536.0, f64::from(v)) / 64.0;
                // The levels to come move it up and down, and smooth it by no more than its neighbours differ.
                least = least.min(vertex.distance(place.position));
            }
        }
        // Vertices are no points of the limit, but the ground is as near to them as the rest of the levels reach.
        let [gx, gz] = place.spine.bottom().block.plane.slope();
        let slack = (down + up + 8.0 + gx.abs() + gz.abs()) / 64.0;
        prop_assert!(nearest.least <= least + slack, "{} and a vertex at {}", nearest.least, least);
        let inside = nearest.least < 0.75;
        prop_assert!(!inside || nearest.least >= least - 2.0 * slack, "{} and no vertex before {}", nearest.least, least);
    }
}

fn canyonlands() -> Surface {
    Surface {
        seed: 1,
        scheme: Scheme::Cubic,
        amplitude: 29_491,
        terrace: Terrace::new(4, 0.6, 0.2),
        only: None,
    }
}

#[test]
fn depth_does_not_matter() {
    let mut probe = Probe::default();
    // How many tiles hangs on the ground as well: the spots are not the same.
    for (tolerance, allowed, ratio) in [(1.0 / 16.0, 1_000.0, 2.0), (FINE, 20_000.0, 4.0)] {
        let mut costs = Vec::new();
        for depth in [100, 1_000, 100_000] {
            let dive = Dive::new(canyonlands(), START_LEVEL + depth, |_| ());
            let mut total = 0;
            for i in 0..40 {
                let place = dive.place(START_LEVEL + depth - i % 10);
                let height = 0.3 * 1.06f64.powi(i as i32);
                let nearest = probe.nearest(&place, place.position + DVec3::new(0.0, height, 0.0), tolerance);
                assert!(nearest.least > 0.05 * height && nearest.least <= height, "{nearest:?} of {height}");
                assert!(nearest.most * (1.0 - tolerance) <= nearest.least, "{nearest:?}");
                total += probe.looked_at();
            }
            costs.push(f64::from(total as u32) / 40.0);
        }
        let (least, most) = costs.iter().fold((f64::MAX, 0.0f64), |(l, m), &c| (l.min(c), m.max(c)));
        assert!(most < ratio * least && most < allowed, "tiles looked at: {costs:?}");
    }
}

#[test]
fn the_same_point_from_any_anchor() {
    let mut spine = Spine::new(canyonlands(), 3, 5);
    for _ in 0..500 {
        spine.push(gentlest(&spine));
    }
    let mut place = Place { spine, position: DVec3::new(0.4, 0.0, 0.6) };
    place.position.y = place.ground(0.4, 0.6) + 1.0;
    let mut probe = Probe::default();
    let mut last = probe.nearest(&place, place.position, FINE).least;
    for _ in 0..12 {
        place.shallower();
        let next = probe.nearest(&place, place.position, FINE).least;
        assert!((next * 2.0 / last - 1.0).abs() <= 2.0 * FINE, "{last} then {next}");
        last = next;
    }
}

#[test]
fn far_above_the_root_it_is_near_enough() {
    let mut place = Place::root(canyonlands(), 9, 9);
    let (down, up) = canyonlands().bounds();
    let mut probe = Probe::default();
    for height in [0.5, 3.0, 1e3, 1e9] {
        place.position.y = height;
        let distance = probe.nearest(&place, place.position, TOLERANCE).least;
        assert!(distance <= height + down, "{distance} of {height}");
        assert!(distance >= (height - up).max(0.0) * 0.999, "{distance} of {height}");
    }
    assert_eq!(probe.ray(&place, place.position, DVec3::Y, f64::INFINITY), None);
}
