//! Moving is exact: in and out again, and round a loop across any border, ends on the bits it began with.

#[path = "support/terrain.rs"]
mod support;

use fathomless::telemetry::{Span, Stopwatch};
use fathomless::terrain::place::{Dive, Place};
use fathomless::terrain::{Block, Scheme, Spine, Surface, Terrace};
use glam::DVec3;
use proptest::prelude::*;
use support::{path, place, surface};

/// Everything that can be asked of a place, in a form without redundancy.
#[derive(Debug, PartialEq)]
struct State {
    path: ([u32; 2], Vec<[u8; 2]>),
    position_bits: [u64; 3],
    block: Block,
}

fn state(place: &Place) -> State {
    // The anchor may have stayed behind by up to a quarter tile: count the whole tiles into the path.
    let mut place = place.clone();
    let whole = |v: f64| v.floor() as i32;
    let (dx, dz) = (whole(place.position.x), whole(place.position.z));
    let before = place.spine.bottom().block;
    place.spine.walk(dx, dz);
    let rise = before.rise_to(&place.spine.bottom().block, [dx, dz]);
    place.position -= DVec3::new(f64::from(dx), rise as f64 / 65_536.0, f64::from(dz));
    State {
        path: place.spine.canonical(),
        position_bits: place.position.to_array().map(f64::to_bits),
        block: place.spine.bottom().block,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn in_and_out_again(
        surface in surface(), path in path(4), levels in prop_oneof![9 => 0usize..60, 1 => 0usize..600],
        x in 0.0f64..1.0, y in -2.0f64..4.0, z in 0.0f64..1.0,
    ) {
        let mut here = place(surface, &path, [x, y, z]);
        let before = (here.position, *here.spine.bottom(), here.level());
        for _ in 0..levels {
            here.deeper();
            // Stay near the ground, as a dive does: a height that doubles 600 times is no position any more.
            here.position.y = y;
        }
        for _ in 0..levels {
            prop_assert!(here.shallower());
        }
        prop_assert_eq!((here.position.x, here.position.z), (before.0.x, before.0.z));
        prop_assert_eq!((*here.spine.bottom(), here.level()), (before.1, before.2));
    }

    #[test]
    fn in_and_out_with_height(
        surface in surface(), path in path(4), levels in 0usize..12, x in 0.0f64..1.0, y in -2.0f64..4.0, z in 0.0f64..1.0,
    ) {
        let mut here = place(surface, &path, [x, y, z]);
        let before = state(&here);
        for _ in 0..levels {
            here.deeper();
        }
        for _ in 0..levels {
            here.shallower();
        }
        prop_assert_eq!(state(&here), before);
    }

    #[test]
    fn round_a_loop(
        surface in surface(), path in path(4),
        steps in prop::collection::vec((-1.5f64..1.5, -0.5f64..0.5, -1.5f64..1.5), 1..12),
        x in 0.0f64..1.0, z in 0.0f64..1.0,
    ) {
        let mut here = place(surface, &path, [x, 1.0, z]);
        let before = state(&here);
        let mut moved = Vec::new();
        for (dx, dy, dz) in steps {
            let grain = (1u64 << 40) as f64;
            let delta = (DVec3::new(dx, dy, dz) * grain).round() / grain;
            here.walk(delta);
            moved.push(delta);
        }
        for delta in moved.into_iter().rev() {
            here.walk(-delta);
        }
        prop_assert_eq!(state(&here), before);
    }

    #[test]
    fn a_loop_over_borders_of_every_level(surface in surface(), path in path(4), side in 0usize..4) {
        // Walk to the border that the digits put nearest and over it: carries run up, to the root if need be.
        let mut spine = path.spine(surface);
        let before = (spine.canonical(), spine.bottom().block);
        let [dx, dz] = [[1, 0], [-1, 0], [0, 1], [0, -1]][side];
        for _ in 0..9 {
            spine.walk(dx, dz);
        }
        for _ in 0..9 {
            spine.walk(-dx, -dz);
        }
        prop_assert_eq!((spine.canonical(), spine.bottom().block), before);
    }

    #[test]
    fn a_jump_is_as_good_as_a_walk(surface in surface(), path in path(4), x in -70i64..70, z in -70i64..70, far in 1i64..1_000_000) {
        let start = path.spine(surface);
        let (mut walked, mut rise) = (start.clone(), 0);
        for (steps, axis) in [(x, 0), (z, 1)] {
            for _ in 0..steps.abs() {
                let mut step = [0, 0];
                step[axis] = steps.signum() as i32;
                let before = walked.bottom().block;
                walked.walk(step[0], step[1]);
                rise += before.rise_to(&walked.bottom().block, step);
            }
        }
        let mut jumped = start.clone();
        prop_assert_eq!(jumped.jump([x, z]), rise);
        prop_assert_eq!((jumped.canonical(), jumped.bottom().block), (walked.canonical(), walked.bottom().block));
        // However far, and back again, in one jump or in two.
        let there = jumped.jump([far, -far]);
        let (half, back) = (jumped.jump([-far - x, 3 * far]), jumped.jump([0, -2 * far - z]));
        prop_assert_eq!(rise + there + half + back, 0);
        prop_assert_eq!((jumped.canonical(), jumped.bottom().block), (start.canonical(), start.bottom().block));
    }

    #[test]
    fn a_block_is_the_same_whichever_way_one_came(surface in surface(), path in path(6), dx in -1i32..=1, dz in -1i32..=1) {
        let mut walked = path.spine(surface);
        walked.walk(dx, dz);
        // The canonical path to the same tile, from scratch.
        let (root, quadrants) = walked.canonical();
        let mut direct = Spine::new(surface, root[0], root[1]);
        for [qx, qz] in quadrants {
            direct.push([qx as i8, qz as i8]);
        }
        prop_assert_eq!(walked.bottom().block, direct.bottom().block);
    }

    #[test]
    fn any_level_can_be_recomputed(surface in surface(), path in path(6), up in 0usize..2_000) {
        let spine = path.spine(surface);
        let level = spine.level().saturating_sub(up);
        let step = spine.step_at(level);
        let mut popped = spine.clone();
        while popped.level() > level {
            popped.pop();
        }
        prop_assert_eq!(&step, popped.bottom());
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

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    /// Wherever two viewers are, the way from the one to the other is the sum of the moves between them.
    #[test]
    fn the_way_between_two_places(
        surface in surface(), path in path(4), levels in 0usize..12,
        aside in [-40.0f64..40.0, -3.0..3.0, -40.0..40.0], then in [-900.0f64..900.0, -3.0..3.0, -900.0..900.0],
    ) {
        let there = place(surface, &path, [0.3, 1.0, 0.6]);
        let mut here = there.clone();
        let (aside, then) = (DVec3::from_array(aside), DVec3::from_array(then));
        here.walk(aside);
        for _ in 0..levels {
            here.deeper();
        }
        here.walk(then);
        // In tiles of the anchor there.
        let moved = aside + then / (levels as f64).exp2();
        for (a, b, sign) in [(&here, &there, 1.0), (&there, &here, -1.0)] {
            let Some((way, level)) = a.way_from(a.position, (b, b.position)) else {
                // Nothing but a root that both have left behind is above them.
                prop_assert!(there.level() < 12, "level {}", there.level());
                continue;
            };
            let way = sign * way * 2f64.powi(there.level() as i32 - level as i32);
            prop_assert!((way - moved).length() < 1e-6, "{way} instead of {moved} at level {level}");
        }
    }
}

/// On the plain of one octave, ground is level above it, no higher than its noise within it, and smooth below it.
#[test]
fn an_octave_alone_is_on_a_plain() {
    let dive = Dive::new(canyonlands(), 200, |_| ());
    let place = dive.place(150);
    assert_eq!(place.alone(140, 139), Block::plain(place.spine.step_at(139).block.corner));
    let bound = i64::from(canyonlands().amplitude);
    let surface = canyonlands().alone(140);
    for level in 140..150 {
        let block = place.alone(140, level);
        assert_eq!(block.corner, place.spine.step_at(level).block.corner);
        // Nothing is added below the octave: what is there is subdivided.
        let digit = place.spine.digit(level);
        assert_eq!(block.child(&surface, digit).0, place.alone(140, level + 1));
        let rises = (-2..=3).flat_map(|z| (-2..=3).map(move |x| (x, z))).map(|(x, z)| block.rise(x, z));
        let (least, most) = rises.fold((0, 0), |(least, most), rise| (rise.min(least), rise.max(most)));
        assert!(
            most > least && most - least <= (2 * bound) << (level - 140),
            "level {level}: {least} to {most}"
        );
    }
}

#[test]
fn the_roots_middle_line_is_no_border() {
    // A path along the very border: all digits 1 on one side, all 0 on the other.
    let mut spine = Spine::new(canyonlands(), 7, 7);
    for _ in 0..100_000 {
        spine.push([1, 1]);
    }
    let before = (spine.canonical(), spine.bottom().block);
    let mut watch = Stopwatch::start();
    for _ in 0..1_000 {
        spine.walk(1, 0);
        spine.walk(-1, 0);
    }
    assert_eq!((spine.canonical(), spine.bottom().block), before);
    watch.lap(Span::Place);
    // Carrying through 100 000 levels at each step would take half a minute and more of a processor's time.
    let cpu_ms = watch.spans().of(Span::Place).cpu_ms;
    assert!(cpu_ms < 10_000.0, "hovering on a border flips the whole path: {cpu_ms} ms");
}

#[test]
fn a_dive_is_a_function_of_its_seed_and_gentle() {
    let dive = Dive::new(canyonlands(), 5_000, |_| ());
    let again = Dive::new(canyonlands(), 6_000, |_| ());
    for level in [5_000, 4_999, 4_500, 4_096, 100, 0] {
        let (a, b) = (dive.place(level), again.place(level));
        assert_eq!(a.spine.bottom(), b.spine.bottom(), "level {level}");
        assert!((a.position - b.position).length() < 1e-12);
        assert!((-0.01..=1.01).contains(&a.position.x), "{}", a.position);
        let [sx, sz] = a.spine.bottom().block.plane.slope();
        assert!(sx.hypot(sz) < 1.0, "slope {sx} {sz} at level {level}");
    }
}

#[test]
fn a_path_takes_few_bytes_per_level() {
    let mut spine = Spine::new(canyonlands(), 0, 0);
    for i in 0..100_000 {
        spine.push([(i % 2) as i8, (i / 3 % 2) as i8]);
    }
    assert!(spine.path_bytes() <= 4 * 100_000, "{} bytes", spine.path_bytes());
}
