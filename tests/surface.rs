//! The surface is one exact function: tiles, patches and blocks agree on it bit for bit, whatever way they came.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

#[path = "support/terrain.rs"]
mod support;

use fathomless::terrain::hash;
use fathomless::terrain::patch::Patch;
use fathomless::terrain::surface::Corner;
use fathomless::terrain::tile::{Cells, Tile, fine_corner};
use fathomless::terrain::{Block, Plane, Scheme, Surface, Terrace};
use proptest::prelude::*;
use support::{path, surface};

fn cells(n: u32) -> Cells {
    Cells::new(n).expect("a power of two")
}

/// Total height (mod 2³²) of point (x, z) of a tile's fine grid.
fn height(patch: &Patch, tile: &Tile, x: i32, z: i32) -> u32 {
    let scale = tile.cells.n() as u32;
    let rise = patch.plane.rise(i64::from(x), i64::from(z)) as u32;
    patch.plane.c.wrapping_mul(scale).wrapping_add(rise).wrapping_add(tile.fine_at(x, z) as u32)
}

/// The definition, point by point, with no grid and no plane: the height of a lattice point from nine
/// (or four, or one) heights of the level above.
fn by_definition(surface: &Surface, at: Corner, above: &dyn Fn(i64, i64) -> i64) -> i64 {
    let (x, z) = (i64::from(at.x as i32), i64::from(at.z as i32));
    let mask = |v: i64| -> Vec<(i64, i64)> {
        let k = v >> 1;
        match (surface.scheme, v & 1) {
            (Scheme::Bilinear, 0) => vec![(k, 2)],
            (Scheme::Bilinear, _) => vec![(k, 1), (k + 1, 1)],
            (Scheme::Cubic, 0) => vec![(k - 1, 1), (k, 6), (k + 1, 1)],
            (Scheme::Cubic, _) => vec![(k, 4), (k + 1, 4)],
        }
    };
    let mut sum = 0;
    for (kz, wz) in mask(z) {
        for (kx, wx) in mask(x) {
            sum += wx * wz * above(kx, kz);
        }
    }
    let h = sum >> if surface.scheme == Scheme::Bilinear { 1 } else { 5 };
    let noise = i64::from(hash::noise(surface.seed, at.level, at.x, at.z));
    let fall = surface.terrace.map_or(0, |t| i64::from(t.fall(h as u32)));
    h + ((noise * i64::from(surface.amplitude)) >> 15) - fall
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn a_patch_follows_the_definition(
        surface in surface(), r in prop::array::uniform16(-400_000i32..400_000), level in any::<u32>(),
        x in -1_000_000i32..1_000_000, z in -1_000_000i32..1_000_000, gx in -1_000_000i64..1_000_000, gz in -1_000_000i64..1_000_000,
    ) {
        let corner = Corner { level, x: x as u32, z: z as u32 };
        let patch = Patch { corner, plane: Plane { c: 77, gx, gz }, r };
        let above = |px: i64, pz: i64| {
            let (lx, lz) = (px - i64::from(x), pz - i64::from(z));
            77 + gx * lx + gz * lz + i64::from(patch.residual(lx as i32, lz as i32))
        };
        for (child, _) in patch.children(&surface) {
            for dz in -1..=2 {
                for dx in -1..=2 {
                    let expected = by_definition(&surface, child.corner.moved(dx, dz), &above);
                    prop_assert_eq!(child.height(dx, dz), expected as u32);
                }
            }
        }
    }

    #[test]
    fn a_tile_is_its_parent_subdivided_plus_one_octave(surface in surface(), path in path(8), bits in 2u32..=6) {
        let parent = path.patch(surface);
        let n = 1i32 << bits;
        let big = Tile::of(&surface, &parent, cells(n as u32));
        // Heights mod 2³² suffice for the definition where no sum wraps: count them from one in the middle.
        let base = height(&parent, &big, n / 2, n / 2);
        let near = |x: i64, z: i64| {
            i64::from(height(&parent, &big, x as i32, z as i32).wrapping_sub(base) as i32)
        };
        for (q, (child, _)) in parent.children(&surface).into_iter().enumerate() {
            let tile = Tile::of(&surface, &child, cells(n as u32));
            let fine = fine_corner(&child, cells(n as u32));
            let (qx, qz) = (q as i32 & 1, q as i32 >> 1);
            for j in (-1..=n + 1).step_by(5) {
                for i in -1..=n + 1 {
                    // The point on the child's lattice, counted from the parent's corner, whose own is even.
                    let (x, z) = (i64::from(n * qx + i), i64::from(n * qz + j));
                    let mut sum = subdivided(surface.scheme, x, z, &near);
                    sum = sum.wrapping_add(i64::from(base) * 2);
                    let at = fine.moved(i, j);
                    let noise = i64::from(hash::noise(surface.seed, at.level, at.x, at.z));
                    let fall = surface.terrace.map_or(0, |t| i64::from(t.fall(sum as u32)));
                    let expected = sum + ((noise * i64::from(surface.amplitude)) >> 15) - fall;
                    prop_assert_eq!(height(&child, &tile, i, j), expected as u32);
                }
            }
        }
    }

    #[test]
    fn the_surface_does_not_depend_on_the_planes(
        surface in surface(), path in path(8), c in any::<i16>(), gx in -60_000i64..60_000, gz in -60_000i64..60_000,
    ) {
        let patch = path.patch(surface);
        let mut other = patch;
        other.plane.c = other.plane.c.wrapping_add(i32::from(c) as u32);
        other.plane.gx += gx;
        other.plane.gz += gz;
        for z in -1..=2i32 {
            for x in -1..=2i32 {
                let plane = i32::from(c) + gx as i32 * x + gz as i32 * z;
                other.r[((z + 1) * 4 + x + 1) as usize] -= plane;
            }
        }
        for ((a, _), (b, _)) in patch.children(&surface).into_iter().zip(other.children(&surface)) {
            prop_assert_eq!(a, b, "children absorb the same plane");
        }
        let (a, b) = (Tile::of(&surface, &patch, cells(8)), Tile::of(&surface, &other, cells(8)));
        for z in -1..=9 {
            for x in -1..=9 {
                prop_assert_eq!(height(&patch, &a, x, z), height(&other, &b, x, z));
            }
        }
    }

    #[test]
    fn neighbours_share_samples(surface in surface(), path in path(8)) {
        let block = path.block(surface);
        let here = block.patch(0, 0).0;
        let tile = Tile::of(&surface, &here, cells(8));
        for (dx, dz) in [(1, 0), (0, 1), (1, 1), (-1, 0), (0, -1), (-1, 1)] {
            let beside = block.patch(dx, dz).0;
            let other = Tile::of(&surface, &beside, cells(8));
            for z in -1..=9 {
                for x in -1..=9 {
                    let (ox, oz) = (x - 8 * dx, z - 8 * dz);
                    if (-1..=9).contains(&ox) && (-1..=9).contains(&oz) {
                        prop_assert_eq!(height(&here, &tile, x, z), height(&beside, &other, ox, oz));
                    }
                }
            }
        }
    }

    #[test]
    fn descendants_stay_in_the_box(
        surface in surface(), path in path(4), quadrants in prop::collection::vec(0usize..4, 10),
    ) {
        let patch = path.patch(surface);
        let range = patch.range(surface.bounds());
        // Follow one line of descendants and check the corner points' heights over the box's corner, in its units.
        let (mut node, mut height, mut unit) = (patch, 0.0f64, 1.0f64);
        for q in quadrants {
            let (child, rise) = node.children(&surface)[q];
            let (qx, qz) = ((q & 1) as i64, (q >> 1) as i64);
            unit *= 0.5;
            height += (node.plane.rise(qx, qz) + rise) as f64 / 65_536.0 * unit;
            node = child;
            for z in 0..=1 {
                for x in 0..=1 {
                    let rise = node.plane.rise(i64::from(x), i64::from(z)) + i64::from(node.residual(x, z));
                    let h = height + rise as f64 / 65_536.0 * unit;
                    prop_assert!(range.low <= h && h <= range.high, "{} not in {range:?}", h);
                }
            }
        }
    }

    #[test]
    fn blocks_and_patches_agree(surface in surface(), path in path(12), digit in [-1i8..=2, -1i8..=2]) {
        let block = path.block(surface);
        let (child, _) = block.child(&surface, digit);
        // The same tile by way of the patch of one of the nine tiles.
        let [dx, dz] = digit.map(i32::from);
        let (parent, _) = block.patch(dx >> 1, dz >> 1);
        let (patch, _) = parent.children(&surface)[((dz & 1) * 2 + (dx & 1)) as usize];
        let (of_block, _) = child.patch(0, 0);
        prop_assert_eq!(of_block, patch);
    }
}

fn subdivided(scheme: Scheme, x: i64, z: i64, above: &dyn Fn(i64, i64) -> i64) -> i64 {
    let weights = |v: i64| -> &'static [(i64, i64)] {
        match (scheme, v & 1) {
            (Scheme::Bilinear, 0) => &[(0, 2)],
            (Scheme::Bilinear, _) => &[(0, 1), (1, 1)],
            (Scheme::Cubic, 0) => &[(-1, 1), (0, 6), (1, 1)],
            (Scheme::Cubic, _) => &[(0, 4), (1, 4)],
        }
    };
    let mut sum = 0;
    for &(dz, wz) in weights(z) {
        for &(dx, wx) in weights(x) {
            sum += wx * wz * above((x >> 1) + dx, (z >> 1) + dz);
        }
    }
    sum >> if scheme == Scheme::Bilinear { 1 } else { 5 }
}

#[test]
fn named_samples_keep_their_integers() {
    // A change here changes every world: raise the generator's version with it.
    let surface = Surface {
        seed: 1,
        scheme: Scheme::Cubic,
        amplitude: 29_491,
        terrace: Terrace::new(4, 0.6, 0.2),
        only: None,
    };
    let mut block = Block::root(0, 0);
    for _ in 0..100 {
        block = block.child(&surface, [1, 0]).0;
    }
    let (patch, _) = block.patch(0, 0);
    let tile = Tile::of(&surface, &patch, cells(16));
    let samples = [tile.fine_at(-1, -1), tile.fine_at(0, 0), tile.fine_at(7, 9), tile.fine_at(17, 17)];
    assert_eq!((samples, tile.coarse_at(3, 4)), EXPECTED);
}

const EXPECTED: ([i32; 4], i32) = ([-370_021, -432_236, -703_443, -900_862], -303_400);

#[test]
fn the_noise_is_uniform_and_uncorrelated() {
    let n = 1 << 20;
    let (mut sum, mut square, mut bins) = (0i64, 0i64, [0u32; 64]);
    let mut neighbours = [0i64; 4];
    for i in 0..n {
        let (x, z) = (i & 1023, i >> 10);
        let v = i64::from(hash::noise(9, 5_000, x, z));
        sum += v;
        square += v * v;
        bins[((v + 32_768) >> 10) as usize] += 1;
        let others = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0)];
        for (k, (dx, dz, dl)) in others.into_iter().enumerate() {
            neighbours[k] += v * i64::from(hash::noise(9, 5_000 + dl, x + dx, z + dz));
        }
    }
    let variance = square as f64 / f64::from(n);
    assert!((sum as f64 / f64::from(n)).abs() < 100.0, "mean {sum}");
    assert!((variance / (65_536.0f64.powi(2) / 12.0) - 1.0).abs() < 0.01, "variance {variance}");
    let expected = f64::from(n) / 64.0;
    let chi2: f64 = bins.iter().map(|&b| (f64::from(b) - expected).powi(2) / expected).sum();
    assert!(chi2 < 120.0, "64 bins, chi² {chi2}");
    for product in neighbours {
        let correlation = product as f64 / f64::from(n) / variance;
        assert!(correlation.abs() < 0.005, "correlation {correlation}");
    }
    // Flipping any input bit flips each used output bit about half the time.
    for bit in 0..32 {
        let flips: u32 = (0..4096u32)
            .map(|i| {
                let (x, z) = (i.wrapping_mul(2_654_435_761), i.wrapping_mul(40_503));
                let a = hash::noise(3, 77, x, z) ^ hash::noise(3, 77, x ^ (1 << bit), z);
                let b = hash::noise(3, 77, x, z) ^ hash::noise(3, 77, x, z ^ (1 << bit));
                (a as u16).count_ones() + (b as u16).count_ones()
            })
            .sum();
        let share = f64::from(flips) / (4096.0 * 32.0);
        assert!((0.46..0.54).contains(&share), "bit {bit}: {share}");
    }
}
