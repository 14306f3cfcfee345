//! Exported heights are those of the tiles, bit for bit, whatever grid they are in; files say what they mean and are
//! whole or not there.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

#[path = "support/terrain.rs"]
mod support;

use std::collections::HashMap;
use std::path::Path;
use std::process::{Command, Output};

use fathomless::address::Address;
use fathomless::at;
use fathomless::course::Stand;
use fathomless::export::{Grid, MAX_CELLS};
use fathomless::picture;
use fathomless::terrain::tile::{Cells, Tile};
use fathomless::terrain::{Patch, Place, Surface};
use fathomless::world::World;
use glam::{DVec3, Quat};
use proptest::prelude::*;
use support::{path, surface};

fn stand(place: Place, height: f64) -> Stand {
    Stand { place, height, depth: 0.0, orientation: Quat::IDENTITY }
}

/// The total height (mod 2³²) of every point of a tile, by its lattice coordinates.
fn heights(surface: &Surface, patch: &Patch, cells: Cells) -> HashMap<(u32, u32), u32> {
    let tile = Tile::of(surface, patch, cells);
    let n = cells.n() as i32;
    let (x0, z0) = (patch.corner.x.wrapping_mul(n as u32), patch.corner.z.wrapping_mul(n as u32));
    let c = patch.plane.c.wrapping_mul(n as u32);
    (-1..=n + 1)
        .flat_map(|z| (-1..=n + 1).map(move |x| (x, z)))
        .map(|(x, z)| {
            let rise = patch.plane.rise(x.into(), z.into()) as u32;
            let total = c.wrapping_add(rise).wrapping_add(tile.fine_at(x, z) as u32);
            ((x0.wrapping_add(x as u32), z0.wrapping_add(z as u32)), total)
        })
        .collect()
}

/// The total height (mod 2³²) of every point of a grid, by its lattice coordinates.
fn totals(grid: &Grid) -> HashMap<(u32, u32), u32> {
    let at = |x: i32, z: i32| (grid.corner.x.wrapping_add(x as u32), grid.corner.z.wrapping_add(z as u32));
    grid.iter().map(|(x, z, height)| (at(x, z), grid.ground.wrapping_add(height as u32))).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, ..ProptestConfig::default() })]

    /// Every height is the one of the tile it lies in, made from the anchor's own block.
    #[test]
    fn heights_are_those_of_the_tiles(
        surface in surface(), path in path(9), at in [-0.25f64..1.25, -0.25f64..1.25],
        (steps, cells) in prop_oneof![(2u32..=7, 1u32..60)],
    ) {
        let place = Place { spine: path.spine(surface), position: DVec3::new(at[0], 3.0, at[1]) };
        let level = place.level();
        let stand = stand(place, 1.0);
        // The level of tiles of 2^steps cells in the anchor's block.
        let free = Grid::around(&stand, cells, 0, |_| ());
        let offset = (level + steps as usize) as i32 - free.level as i32;
        let grid = Grid::around(&stand, cells, offset, |_| ());
        prop_assume!(grid.level == level + steps as usize);
        prop_assert_eq!(grid.heights.len(), (cells as usize + 1).pow(2));
        prop_assert_eq!(grid.iter().find(|(x, z, _)| (*x, *z) == (0, 0)).map(|(_, _, height)| height), Some(0));

        let grid = totals(&grid);
        let block = stand.place.spine.bottom().block;
        let mut compared = 0;
        for (i, j) in (-1..=1).flat_map(|j| (-1..=1).map(move |i| (i, j))) {
            let (patch, _) = block.patch(i, j);
            let tile = heights(&surface, &patch, Cells::new(1 << steps).unwrap());
            for (at, height) in &grid {
                if let Some(expected) = tile.get(at) {
                    prop_assert_eq!(height, expected, "at {:?}", at);
                    compared += 1;
                }
            }
        }
        // The place is in or beside the anchor tile, so some of the grid always is.
        prop_assert!(compared > 0);
    }

    /// Grids of other sizes around places nearby agree wherever they overlap, and differ by one number in what they
    /// count heights from.
    #[test]
    fn neighbouring_grids_overlap_exactly(
        surface in surface(), path in path(9), at in [0.0f64..1.0, 0.0f64..1.0], walk in [-1.0f64..1.0, -1.0f64..1.0],
        (cells, other) in (1u32..90, 1u32..90), offset in -9i32..9,
    ) {
        let place = Place { spine: path.spine(surface), position: DVec3::new(at[0], 3.0, at[1]) };
        let here = Grid::around(&stand(place.clone(), 2.0), cells, offset, |_| ());
        let mut place = place;
        place.walk(DVec3::new(walk[0], 0.0, walk[1]));
        let there = Grid::around(&stand(place.clone(), 2.0), other, 0, |_| ());
        let offset = here.level as i32 - there.level as i32;
        let there = Grid::around(&stand(place, 2.0), other, offset, |_| ());
        prop_assume!(here.level == there.level);
        prop_assert_eq!(here.corner.level, there.corner.level);
        let (dx, dz) = (there.corner.x.wrapping_sub(here.corner.x) as i32, there.corner.z.wrapping_sub(here.corner.z) as i32);
        let exact: HashMap<(i32, i32), i64> = here.iter().map(|(x, z, height)| ((x, z), height)).collect();
        let mut apart: Vec<i64> =
            there.iter().filter_map(|(x, z, height)| Some(exact.get(&(x + dx, z + dz))? - height)).collect();
        apart.dedup();
        prop_assert!(apart.len() <= 1, "{:?}", apart);
        let mod32 = totals(&here);
        for (at, height) in totals(&there) {
            prop_assert!(mod32.get(&at).is_none_or(|expected| *expected == height));
        }
    }
}

#[test]
fn a_large_grid_is_many_tiles_without_a_seam() {
    let world = World::load("canyonlands").unwrap();
    let stand = at::stand(&world, 1_000, None);
    let mut told = Vec::new();
    let large = Grid::around(&stand, 1_000, 0, |done| told.push(done));
    assert!(told.windows(2).all(|pair| pair[0] < pair[1]) && told.last() >= Some(&Grid::points(1_000)));
    let offset = Grid::around(&stand, 40, 0, |_| ()).level as i32;
    let small = Grid::around(&stand, 40, large.level as i32 - offset, |_| ());
    assert_eq!((small.level, small.corner, small.ground), (large.level, large.corner, large.ground));
    let all: HashMap<(i32, i32), i64> = large.iter().map(|(x, z, height)| ((x, z), height)).collect();
    assert!(small.iter().all(|(x, z, height)| all[&(x, z)] == height));
    // No jump anywhere that would be a seam: neighbours differ by a slope that the world has.
    let steepest = large.heights.windows(2).enumerate().filter(|(i, _)| (i + 1) % large.side() != 0);
    let steepest = steepest.map(|(_, pair)| (pair[1] - pair[0]).abs()).max().unwrap();
    assert!(steepest < 8 << 16, "{steepest}");
}

#[test]
fn the_width_is_what_the_viewer_has_before_him() {
    let world = World::load("canyonlands").unwrap();
    for height in [0.01, 1.0, 3.0, 77.0] {
        let stand = Stand { height, ..at::stand(&world, 0, None) };
        for cells in [1, 2, 3, 64, 100, 1_000] {
            let grid = Grid::around(&stand, cells, 0, |_| ());
            let tile = 2f64.powi(grid.level as i32 - stand.place.level() as i32);
            let width = f64::from(cells) / tile / height;
            assert!((8.0..16.0).contains(&width), "{width} heights wide");
        }
    }
}

/// Above the world's beginning there is nothing: the grid is as coarse as can be.
#[test]
fn the_coarsest_grid_is_the_root() {
    let world = World::load("canyonlands").unwrap();
    let stand = at::stand(&world, 0, None);
    for (cells, level) in [(1, 2), (8, 2), (9, 3), (256, 7)] {
        let grid = Grid::around(&stand, cells, -1_000_000, |_| ());
        assert_eq!(grid.level, level);
    }
    let fine = Grid::around(&stand, 4, 1_000, |_| ());
    assert!(fine.level > 5_000);
}

fn fathomless(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fathomless")).args(args).output().unwrap()
}

fn run(args: &[&str]) -> String {
    let output = fathomless(args);
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_files_hold_the_grid() {
    let folder = tempfile::tempdir().unwrap();
    let world = World::load("hills").unwrap();
    let stand = at::stand(&world, 5, None);
    let grid = Grid::around(&stand, 10, 1, |_| ());
    let address = Address::of(&world, &stand.standpoint()).to_string();
    let asked = ["export", "--at", &address, "--cells", "10", "--level-offset", "1", "--format"];
    let file = |name: &str, format: &str| {
        let path = folder.path().join(name);
        run(&[&asked[..], &[format, "--out", path.to_str().unwrap()]].concat());
        path
    };

    let csv = std::fs::read_to_string(file("h.csv", "csv")).unwrap();
    assert_eq!(csv, run(&[&asked[..], &["csv"]].concat()), "stdout holds what the file does");
    let (comments, lines): (Vec<&str>, Vec<&str>) = csv.lines().partition(|line| line.starts_with('#'));
    let comments = comments.join("\n");
    for words in [&format!("address: {address}"), &format!("level: {}", grid.level), "in 1/65536 spacing"] {
        assert!(comments.contains(words), "{words}: {comments}");
    }
    assert_eq!(lines[0], "x,z,height");
    let expected: Vec<String> = grid.iter().map(|(x, z, height)| format!("{x},{z},{height}")).collect();
    assert_eq!(lines[1..], expected);

    let obj = std::fs::read_to_string(file("h.obj", "obj")).unwrap();
    let numbers = |line: &str| line.split(' ').skip(1).map(|v| v.parse::<f64>().unwrap()).collect::<Vec<_>>();
    let vertices: Vec<Vec<f64>> = obj.lines().filter(|l| l.starts_with("v ")).map(numbers).collect();
    for ((x, z, height), v) in grid.iter().zip(&vertices) {
        assert_eq!((v[0], v[1] * 65_536.0, v[2]), (f64::from(x), height as f64, f64::from(z)));
    }
    let faces: Vec<Vec<f64>> = obj.lines().filter(|l| l.starts_with("f ")).map(numbers).collect();
    assert_eq!((vertices.len(), faces.len()), (121, 200));
    let mut area = 0.0;
    for face in faces {
        let [a, b, c] = [0, 1, 2].map(|i| DVec3::from_slice(&vertices[face[i] as usize - 1]));
        let normal = (b - a).cross(c - a);
        assert!(normal.y > 0.0, "faces look up");
        area += normal.y / 2.0;
    }
    assert_eq!(area, 100.0, "each cell is covered once");

    let path = file("h.png", "png16");
    let mut reader =
        png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&path).unwrap())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!(
        (info.width, info.height, info.bit_depth, info.color_type),
        (11, 11, png::BitDepth::Sixteen, png::ColorType::Grayscale)
    );
    let (least, greatest) = grid.range();
    let unit = (greatest - least) as f64 / 65_535.0;
    for (grey, height) in bytes.as_chunks().0.iter().zip(&grid.heights) {
        let back = least as f64 + f64::from(u16::from_be_bytes(*grey)) * unit;
        assert!((back - *height as f64).abs() <= unit / 2.0 + 1e-6);
    }
    assert_eq!(picture::address(&path).unwrap(), address);
    let map = picture::text(&mut std::fs::File::open(&path).unwrap(), "Fathomless-Heights").unwrap();
    for words in
        [format!("= {least} + value / 65535 * {}", greatest - least), format!("level: {}", grid.level)]
    {
        assert!(map.contains(&words), "{words}: {map}");
    }
    // A picture of heights leads to its place as any other.
    assert_eq!(at::find(path.as_os_str()).unwrap().to_string(), address);
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 3, "nothing half-written is left");
}

#[test]
fn what_cannot_be_written_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "here first").unwrap();
    for out in [file.join("below"), folder.path().to_owned(), Path::new("/proc/heights.csv").to_owned()] {
        for format in ["csv", "obj", "png16"] {
            let output =
                fathomless(&["export", "--cells", "2", "--format", format, "--out", out.to_str().unwrap()]);
            let sentence = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(1));
            assert!(sentence.contains("choose another file with --out"), "{sentence}");
            assert_eq!(sentence.matches('\n').count(), 1, "{sentence}");
        }
    }
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "here first");
}

#[test]
fn the_most_cells_fit() {
    let world = World::load("hills").unwrap();
    let grid = Grid::around(&at::stand(&world, 0, None), MAX_CELLS, 0, |_| ());
    assert_eq!(grid.heights.len(), 4097 * 4097);
    assert_eq!((grid.first, grid.iter().last().map(|(x, z, _)| (x, z))), (-2048, Some((2048, 2048))));
}
