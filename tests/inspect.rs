//! Options for seeing how it works: each visibly does what its name says, and leaves no trace when it is off again.
//!
//! The pictures are kept in `inspect/` of the target's folder for temporary files, to be looked at.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

#[path = "support/studio.rs"]
mod studio;

use std::path::Path;

use fathomless::flight::FlightPose;
use fathomless::inspect::{Inspect, LEVEL_COLOURS};
use fathomless::mock::SubmittedFrame;
use fathomless::picture::{self, Pixels};
use fathomless::render::Shading;
use fathomless::viewer::{Faces, Step, ViewerConfig};
use glam::{Quat, Vec3};
use studio::{Camera, NEAR_M, Setup, Studio, pose};

const SIZE: [u32; 2] = [240, 180];

/// Grey of the plain ground, and of an unfolded face where nothing is baked.
const PLAIN: [u8; 3] = [33; 3];
const EMPTY: [[u8; 3]; 2] = [[51; 3], [66; 3]];

type Rgb = [u8; 3];

/// The left eye's picture with its depths.
#[derive(Clone, PartialEq)]
struct Shot {
    pixels: Vec<Rgb>,
    depth: Vec<f32>,
}

impl Shot {
    fn of(frame: &SubmittedFrame) -> Shot {
        let view = &frame.views[0];
        let pixels = view.rgba.chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect();
        Shot { pixels, depth: view.depth.as_ref().unwrap().values.clone() }
    }

    fn keep(&self, name: &str, size: [u32; 2]) {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("inspect");
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join(format!("{}.png", name.replace([',', '='], "_")));
        picture::write(&path, size, Pixels::Rgb8(&self.pixels.concat()), &[]).unwrap();
    }

    /// Pixels that tiles were drawn to.
    fn ground(&self) -> impl Iterator<Item = usize> {
        (0..self.depth.len()).filter(|&i| self.depth[i] > 0.0)
    }

    fn count(&self, colour: Rgb) -> usize {
        self.pixels.iter().filter(|&&p| p == colour).count()
    }

    /// Share of the pixels that differ.
    fn changed(&self, other: &Shot) -> f64 {
        let changed = self.pixels.iter().zip(&other.pixels).filter(|(a, b)| a != b).count();
        changed as f64 / self.pixels.len() as f64
    }
}

/// A studio that takes lists of options.
struct Gallery {
    studio: Studio,
    size: [u32; 2],
    prefix: &'static str,
}

impl Gallery {
    fn open(prefix: &'static str) -> Gallery {
        Gallery::sized(prefix, SIZE)
    }

    fn sized(prefix: &'static str, size: [u32; 2]) -> Gallery {
        let setup = Setup { size, deepest: 8.0, ..Setup::default() };
        Gallery { studio: Studio::open(&setup), size, prefix }
    }

    /// The usual picture for an empty list.
    fn frame(&mut self, list: &str, pose: &FlightPose) -> SubmittedFrame {
        let inspect = if list.is_empty() { Inspect::default() } else { list.parse().unwrap() };
        self.studio.viewer.set_inspect(&inspect).unwrap();
        self.studio.shoot(pose)
    }

    fn show(&mut self, list: &str, pose: &FlightPose) -> Shot {
        let shot = Shot::of(&self.frame(list, pose));
        let name = if list.is_empty() { "usual" } else { list };
        shot.keep(&format!("{}_{name}", self.prefix), self.size);
        shot
    }
}

fn ahead() -> FlightPose {
    pose(2.6, 2.2, -14.0, 20.0)
}

fn down() -> FlightPose {
    pose(2.6, 2.2, -75.0, 20.0)
}

fn far(a: Rgb, b: Rgb) -> u8 {
    (0..3).map(|i| a[i].abs_diff(b[i])).max().unwrap()
}

/// The level, mod 8, whose colour in some light a pixel has; None if it is too far from all of them.
fn level_of(pixel: Rgb) -> Option<usize> {
    let direction = |p: Rgb| Vec3::from(p.map(f32::from)).normalize();
    let likeness = |colour: &Rgb| direction(pixel).dot(direction(*colour));
    let best = (0..8).max_by(|a, b| likeness(&LEVEL_COLOURS[*a]).total_cmp(&likeness(&LEVEL_COLOURS[*b])))?;
    (likeness(&LEVEL_COLOURS[best]) > 0.999).then_some(best)
}

#[test]
fn every_option_leaves_no_trace() {
    let mut gallery = Gallery::open("all");
    let usual = gallery.show("", &ahead());
    for word in Inspect::words() {
        let shown = gallery.show(&word.replace('N', "4"), &ahead());
        let changed = usual.changed(&shown);
        println!("{word}: {changed:.4} of the pixels change");
        match word {
            // What is usual, and what shows only from elsewhere.
            "lit" | "backdrop" | "frozen" => assert!(shown == usual, "{word}"),
            // Where nothing is amiss there is hardly anything to see.
            "no-skirts" => assert!(changed < 0.01, "{word}: {changed}"),
            "frusta" => assert!(changed > 0.001, "{word}: {changed}"),
            _ => assert!(changed > 0.03, "{word}: {changed}"),
        }
        let after = gallery.show("", &ahead());
        assert!(after == usual, "{word} is off again: {:.4} of the pixels differ", usual.changed(&after));
    }
    gallery.studio.close();
}

#[test]
fn a_wireframe_is_lines_with_nothing_between_them() {
    let size = [480, 360];
    let mut gallery = Gallery::sized("wireframe", size);
    // Low over the finest tiles, whose triangles are large.
    let low = pose(2.6, 0.15, -50.0, 20.0);
    let filled = gallery.show("live-only", &low);
    let wires = gallery.show("wireframe,live-only", &low);
    let bare = gallery.show("wireframe,live-only,no-skirts", &low);
    let covered = |shot: &Shot| shot.ground().count() as f64 / filled.ground().count() as f64;
    assert!(filled.ground().count() > 100_000);
    assert!(covered(&wires) < 0.6 && covered(&wires) > 0.1, "{} is covered", covered(&wires));
    assert!(covered(&bare) < covered(&wires), "skirts have lines too");
    for (pixel, depth) in wires.pixels.iter().zip(&wires.depth) {
        assert_eq!(*depth == 0.0, far(*pixel, PLAIN) <= 1, "what is not a line is plain ground: {pixel:?}");
    }
    // Lines that the ground would hide are seen; none is before it.
    let inside = |i: &usize| (480..filled.depth.len() - 480).contains(i);
    let off = wires.ground().filter(inside).filter(|&i| {
        let around = [i, i - 1, i + 1, i - size[0] as usize, i + size[0] as usize].map(|i| filled.depth[i]);
        wires.depth[i] > 1.03 * around.into_iter().fold(0.0, f32::max)
    });
    assert!(off.count() < filled.depth.len() / 200);
    gallery.studio.close();
}

#[test]
fn levels_have_a_few_colours_that_follow_each_other() {
    let mut gallery = Gallery::open("levels");
    let usual = gallery.show("", &ahead());
    let shot = gallery.show("levels", &ahead());
    assert!(shot.depth == usual.depth);
    let mut rows = vec![Vec::new(); 8];
    let mut strange = 0;
    for i in shot.ground() {
        match level_of(shot.pixels[i]) {
            Some(level) => rows[level].push(i / SIZE[0] as usize),
            None => strange += 1,
        }
    }
    assert!(strange < shot.ground().count() / 100, "{strange} pixels have no level's colour");
    // The nearest level is at the bottom of the picture, and larger tiles are farther up.
    let middle = |rows: &[usize]| rows.iter().sum::<usize>() as f64 / rows.len() as f64;
    let bottom = (0..8).filter(|&l| rows[l].len() > 100).max_by_key(|&l| middle(&rows[l]) as usize).unwrap();
    let mut seen = Vec::new();
    for up in 0..8 {
        let rows = &rows[(bottom + 8 - up) % 8];
        if rows.len() > 200 {
            seen.push(middle(rows));
        }
    }
    assert!(seen.len() >= 4, "{seen:?}");
    assert!(seen.is_sorted_by(|a, b| a > b), "levels by their height in the picture: {seen:?}");
    gallery.studio.close();
}

#[test]
fn normals_and_slopes_are_what_the_colours_say() {
    let mut gallery = Gallery::open("surface");
    let normals = gallery.show("normals", &ahead());
    let slopes = gallery.show("slopes", &ahead());
    let mut steep = [0, 0];
    for i in normals.ground() {
        let normal = Vec3::from(normals.pixels[i].map(|c| f32::from(c) / 127.5 - 1.0));
        assert!((normal.length() - 1.0).abs() < 0.02 && normal.y > 0.0, "{normal} of pixel {i}");
        let slope = normal.x.hypot(normal.z) / normal.y;
        let [r, g, b] = slopes.pixels[i];
        if slope < 0.2 {
            assert!(b > g && g > r, "almost level is blue: {:?}", slopes.pixels[i]);
            steep[0] += 1;
        } else if slope > 1.5 && slope < 5.0 {
            assert!(r > 150 && b < 60, "steep is red: {:?}", slopes.pixels[i]);
            steep[1] += 1;
        }
    }
    assert!(steep[0] > 500 && steep[1] > 100, "{steep:?}");

    // On a plain, every normal is up and nothing is steep; a hill's sunny side is where the light comes from.
    let plain = gallery.show("normals,octave=60", &ahead());
    assert!(plain.ground().all(|i| far(plain.pixels[i], [128, 255, 128]) <= 1));
    let plain = gallery.show("slopes,octave=60", &ahead());
    assert!(plain.ground().all(|i| far(plain.pixels[i], [33, 64, 191]) <= 1));

    // The colours are the normals of the ground that is drawn: by the depths of neighbouring pixels.
    let near = pose(2.6, 2.2, -60.0, 20.0);
    let frame = gallery.frame("normals,no-skirts", &near);
    let shot = Shot::of(&frame);
    let camera = &Camera::both(&frame, gallery.studio.course.at(&near).orientation)[0];
    let width = SIZE[0] as usize;
    let point = |x: usize, y: usize| {
        camera.ray(x as f32 + 0.5, y as f32 + 0.5) * (NEAR_M / shot.depth[y * width + x])
    };
    let mut angles = Vec::new();
    for y in (10..SIZE[1] as usize - 10).step_by(3) {
        for x in (10..width - 10).step_by(3) {
            let across = point(x + 2, y) - point(x - 2, y);
            let along = point(x, y + 2) - point(x, y - 2);
            let measured = along.cross(across).normalize();
            let shown =
                Vec3::from(shot.pixels[y * width + x].map(|c| f32::from(c) / 127.5 - 1.0)).normalize();
            angles.push(f64::from(measured.angle_between(shown)).to_degrees());
        }
    }
    let median = studio::quantile(&mut angles, 0.5);
    assert!(median < 12.0, "half of the normals are more than {median} degrees off");
    gallery.studio.close();
}

#[test]
fn the_depth_buffer_is_shown_as_it_is() {
    let mut gallery = Gallery::open("depth");
    let shot = gallery.show("depth", &ahead());
    let usual = gallery.show("", &ahead());
    assert!(shot.depth == usual.depth);
    let mut values: Vec<(f32, u8)> = Vec::new();
    for (&[r, g, b], &depth) in shot.pixels.iter().zip(&shot.depth) {
        assert!(r == g && g == b);
        let wanted = if depth > 0.0 { 255.0 * (1.0 + depth.log2() / 24.0).clamp(0.0, 1.0) } else { 0.0 };
        assert!((f32::from(r) - wanted).abs() <= 1.5, "depth {depth} is shown as {r}, not {wanted}");
        values.push((depth, r));
    }
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert!(values.windows(2).all(|w| w[0].1 <= w[1].1 + 1), "nearer is never darker");
    assert!(values.first().unwrap().1 == 0 && values.last().unwrap().1 > 150);
    gallery.studio.close();
}

#[test]
fn a_frozen_selection_stays_while_the_viewer_flies_on() {
    let mut gallery = Gallery::open("frozen");
    let here = ahead();
    // Aside, up, one octave in, and looking elsewhere.
    let aside = FlightPose { offset: [0.5, 0.4], ..pose(2.9, 4.0, -30.0, 30.0) };
    let inside = pose(3.8, 2.0, -20.0, 20.0);
    let round = pose(2.6, 2.2, -14.0, 200.0);
    let usual = gallery.show("live-only", &here);
    let frozen = gallery.show("live-only,frozen", &here);
    assert!(frozen == usual, "nothing changes until he moves");
    let drawn = gallery.studio.viewer.counts().drawn;
    for (name, there) in [("aside", &aside), ("inside", &inside), ("round", &round)] {
        let kept = Shot::of(&gallery.frame("live-only,frozen", there));
        kept.keep(&format!("frozen_{name}"), SIZE);
        let counts = gallery.studio.viewer.counts();
        assert_eq!((counts.drawn, counts.made), (drawn, 0), "{name}: the same tiles, and none are made");
    }
    assert!(gallery.show("live-only,frozen", &here) == usual, "back again everything is in its place");

    // From elsewhere the tiles kept are where the ground is.
    let kept = gallery.show("live-only,frozen", &aside);
    let anew = gallery.show("live-only", &aside);
    let both: Vec<usize> = kept.ground().filter(|&i| anew.depth[i] > 0.0).collect();
    assert!(both.len() > kept.depth.len() / 4 && kept.ground().count() < anew.ground().count());
    let mut off: Vec<f64> =
        both.iter().map(|&i| f64::from((kept.depth[i] / anew.depth[i]).log2().abs())).collect();
    let (median, most) = (studio::quantile(&mut off, 0.5), studio::quantile(&mut off, 0.95));
    assert!(median < 0.02 && most < 0.2, "octaves of distance off: {median}, {most}");

    // Behind his back nothing was selected.
    let behind = Shot::of(&gallery.frame("live-only", &here)).ground().count();
    gallery.frame("live-only,frozen", &here);
    let kept = gallery.show("live-only,frozen", &round);
    assert!(kept.ground().count() < behind / 2, "{} of {behind}", kept.ground().count());

    // The eyes' frusta, from aside: the edges of both come together where the eyes were.
    gallery.frame("live-only,frozen,frusta", &here);
    let lines = gallery.show("live-only,frozen,frusta", &aside);
    let eyes = [[255, 70, 70], [40, 230, 230]].map(|colour| lines.count(colour));
    assert!(eyes[0] > 50 && eyes[1] > 50, "{eyes:?}");
    let away = gallery
        .show("live-only,frozen,frusta", &FlightPose { offset: [0.0, 0.8], ..pose(2.6, 2.2, -5.0, 20.0) });
    let without =
        gallery.show("live-only,frozen", &FlightPose { offset: [0.0, 0.8], ..pose(2.6, 2.2, -5.0, 20.0) });
    assert!(away.changed(&without) > 0.01);
    gallery.studio.close();
}

#[test]
fn boxes_and_patches_lie_about_the_tiles() {
    let mut gallery = Gallery::open("lines");
    let usual = gallery.show("", &ahead());
    let boxes = gallery.show("boxes", &ahead());
    assert!(boxes.depth == usual.depth, "lines leave the depth as it is");
    let colours: Vec<usize> = LEVEL_COLOURS.iter().map(|&colour| boxes.count(colour)).collect();
    assert!(
        colours.iter().filter(|&&n| n > 30).count() >= 3,
        "boxes have their levels' colours: {colours:?}"
    );
    assert!(colours.iter().all(|&n| n * 2 < boxes.pixels.len()), "{colours:?}");
    let patches = gallery.show("patches", &ahead());
    let [cells, rings] = [[90, 160, 255], [20, 50, 150]].map(|colour| patches.count(colour));
    assert!(cells > 200 && rings > 20, "{cells} pixels of cells, {rings} of rings");
    let bluer = (0..usual.pixels.len()).filter(|&i| patches.pixels[i] != usual.pixels[i]);
    let (bluer, all) = bluer.fold((0, 0), |(bluer, all), i| {
        let blue = |p: Rgb| i32::from(p[2]) - i32::from(p[0]);
        (bluer + u32::from(blue(patches.pixels[i]) > blue(usual.pixels[i])), all + 1)
    });
    assert!(bluer * 10 > all * 8, "{bluer} of {all} pixels are bluer");
    gallery.studio.close();
}

#[test]
fn morph_and_skirts_keep_the_ground_closed() {
    let mut gallery = Gallery::sized("cracks", [360, 360]);
    let below = FlightPose { pitch: -1.35, ..down() };
    let levels = gallery.show("levels", &below);
    assert!(levels.depth.iter().all(|&depth| depth > 0.0), "the whole picture is ground");
    gallery.studio.viewer.set_shading(Shading::Holes([1.0, 0.0, 1.0, 1.0]));
    let mut holes = |list: &str| -> Vec<usize> {
        let shot = gallery.show(list, &below);
        (0..shot.pixels.len()).filter(|&i| shot.depth[i] == 0.0).collect()
    };
    let [usual, no_morph, no_skirts, neither] =
        ["", "no-morph", "no-skirts", "no-morph,no-skirts"].map(&mut holes);
    println!(
        "holes: {} usual, {} no-morph, {} no-skirts, {} neither",
        usual.len(),
        no_morph.len(),
        no_skirts.len(),
        neither.len()
    );
    assert!(usual.is_empty());
    assert!(neither.len() > 50 && neither.len() > 3 * no_morph.len(), "skirts cover most of the cracks");
    assert!(no_skirts.len() * 10 < neither.len(), "where tiles meet there is next to nothing to cover");
    // Without morph they do not meet where levels differ, and nowhere else.
    let width = 360;
    let elsewhere = neither.iter().filter(|&&hole| {
        let (x, y) = (hole % width, hole / width);
        let around = (y.saturating_sub(4)..(y + 5).min(width))
            .flat_map(|y| (x.saturating_sub(4)..(x + 5).min(width)).map(move |x| y * width + x));
        let mut seen: Vec<_> = around.filter_map(|i| level_of(levels.pixels[i])).collect();
        seen.sort_unstable();
        seen.dedup();
        seen.len() < 2
    });
    let elsewhere = elsewhere.count();
    assert!(elsewhere * 20 <= neither.len(), "{elsewhere} of {} holes are within a level", neither.len());
    gallery.studio.close();
}

#[test]
fn live_tiles_stand_alone_on_a_plain_ground() {
    let mut gallery = Gallery::open("live");
    let usual = gallery.show("", &ahead());
    let live = gallery.show("live-only", &ahead());
    assert!(live.depth == usual.depth);
    let mut clearer = [0u64; 2];
    for i in 0..live.pixels.len() {
        assert_eq!(live.depth[i] == 0.0, far(live.pixels[i], PLAIN) <= 1, "{:?}", live.pixels[i]);
        // Haze is blue: far ground has less of it.
        if live.depth[i] > 0.0 && live.depth[i] < NEAR_M / 100.0 {
            clearer[0] += u64::from(live.pixels[i][2]);
            clearer[1] += u64::from(usual.pixels[i][2]);
        }
    }
    assert!(clearer[0] * 20 < clearer[1] * 19, "far ground is without haze: {clearer:?}");

    let off = gallery.show("no-backdrop", &ahead());
    let tinted = gallery.show("tinted-backdrop", &ahead());
    let mut changed = [0, 0];
    for i in 0..usual.pixels.len() {
        if usual.depth[i] > 0.0 {
            assert!(off.pixels[i] == usual.pixels[i], "live ground stays");
            assert!(far(tinted.pixels[i], usual.pixels[i]) == 0, "live ground stays");
            continue;
        }
        changed[0] += usize::from(far(off.pixels[i], usual.pixels[i]) > 2);
        if far(tinted.pixels[i], usual.pixels[i]) > 2 {
            changed[1] += 1;
            let magenta = |[r, g, b]: Rgb| i32::from(r) + i32::from(b) - 2 * i32::from(g);
            assert!(magenta(tinted.pixels[i]) > magenta(usual.pixels[i]), "{:?}", tinted.pixels[i]);
        }
    }
    assert!(changed[0] > 500 && changed[1] > 500, "{changed:?}");
    // What was backdrop is what is tinted: the sky alone is left in both.
    assert!(changed[0].abs_diff(changed[1]) * 10 < changed[0], "{changed:?}");
    gallery.studio.close();
}

/// Whether anything is baked in a direction, as Vulkan lays out cubes (Vulkan specification, cube map face selection).
fn is_baked(faces: &Faces, d: Vec3) -> bool {
    let a = d.abs();
    let (face, s, t, m) = if a.z >= a.x && a.z >= a.y {
        if d.z > 0.0 { (4, d.x, -d.y, a.z) } else { (5, -d.x, -d.y, a.z) }
    } else if a.y >= a.x {
        if d.y > 0.0 { (2, d.x, d.z, a.y) } else { (3, d.x, -d.z, a.y) }
    } else if d.x > 0.0 {
        (0, -d.z, -d.y, a.x)
    } else {
        (1, d.z, -d.y, a.x)
    };
    let texel = |v: f32| (((v / m + 1.0) * 0.5 * faces.side as f32) as usize).min(faces.side - 1);
    faces.colour[face * faces.side * faces.side + texel(t) * faces.side + texel(s)][3] > 127
}

#[test]
fn the_backdrops_faces_are_unfolded_the_right_way() {
    let mut gallery = Gallery::sized("faces", [400, 320]);
    let usual = gallery.show("", &ahead());
    let frame = gallery.frame("backdrop-faces", &ahead());
    let shot = Shot::of(&frame);
    shot.keep("faces_cross", [400, 320]);
    assert!(shot.depth == usual.depth);
    // A head that looks along the picture: the cross is straight before it.
    let camera = &Camera::both(&frame, Quat::IDENTITY)[0];
    let (width, height) = (400usize, 320usize);
    let tangents = |x: usize, y: usize| {
        let ray = camera.turn.conjugate() * camera.ray(x as f32 + 0.5, y as f32 + 0.5);
        [ray.x, ray.y]
    };
    let white: Vec<[f32; 2]> = (0..width * height)
        .filter(|&i| shot.pixels[i] == [255; 3])
        .map(|i| tangents(i % width, i / width))
        .collect();
    let span = |axis: usize| {
        let of = |p: &[f32; 2]| p[axis];
        white.iter().map(of).fold((f32::MAX, f32::MIN), |(a, b), v| (a.min(v), b.max(v)))
    };
    let ((left, right), (bottom, top)) = (span(0), span(1));
    let side = (right - left) / 4.0;
    assert!(((top - bottom) / 3.0 - side).abs() < 0.02 * side, "four faces wide, three high");
    assert!((left + right).abs() < 0.03 && (bottom + top).abs() < 0.03, "straight ahead");

    let faces = gallery.studio.viewer.read_backdrop().unwrap();
    let (mut wrong, mut known, mut empty) = (0, 0, 0);
    for y in 0..height {
        for x in 0..width {
            let [across, up] = tangents(x, y);
            let (px, py) = ((across - left) / side, (top - up) / side);
            let (column, row) = (px.floor(), py.floor());
            let (a, b) = (2.0 * (px - column) - 1.0, 1.0 - 2.0 * (py - row));
            let direction = match (column as i32, row as i32) {
                (0, 1) => Vec3::new(-1.0, b, -a),
                (1, 1) => Vec3::new(a, b, -1.0),
                (2, 1) => Vec3::new(1.0, b, a),
                (3, 1) => Vec3::new(-a, b, 1.0),
                (1, 0) => Vec3::new(a, 1.0, b),
                (1, 2) => Vec3::new(a, -1.0, -b),
                _ => {
                    if !(-0.03..4.03).contains(&px) || !(-0.03..3.03).contains(&py) {
                        assert!(
                            shot.pixels[y * width + x] == usual.pixels[y * width + x],
                            "around it all is as usual"
                        );
                    }
                    continue;
                }
            };
            if a.abs().max(b.abs()) > 0.93 {
                continue;
            }
            let checked = EMPTY.iter().any(|&grey| far(shot.pixels[y * width + x], grey) <= 1);
            known += 1;
            empty += usize::from(checked);
            wrong += usize::from(checked == is_baked(&faces, direction));
        }
    }
    assert!(known > 10_000 && empty > 2_000 && empty < known - 1_000, "{empty} of {known}");
    assert!(wrong * 20 < known, "{wrong} of {known} pixels show another direction");
    gallery.studio.close();
}

#[test]
fn an_octave_alone_lies_on_a_plain() {
    let mut gallery = Gallery::open("octave");
    let pose = pose(2.0, 2.2, -50.0, 20.0);
    let mut heights = |octave: i32| {
        let frame = gallery.frame(&format!("octave={octave}"), &pose);
        let shot = Shot::of(&frame);
        shot.keep(&format!("octave_{octave}"), SIZE);
        let camera = &Camera::both(&frame, gallery.studio.course.at(&pose).orientation)[0];
        let heights = shot.ground().map(|i| {
            let (x, y) = (i % SIZE[0] as usize, i / SIZE[0] as usize);
            let ray = camera.ray(x as f32 + 0.5, y as f32 + 0.5);
            f64::from((camera.eye + ray * (NEAR_M / shot.depth[i])).y)
        });
        let mut heights: Vec<f64> = heights.collect();
        assert_eq!(heights.len(), shot.depth.len(), "all of the picture is ground");
        [0.0, 0.5, 1.0].map(|share| studio::quantile(&mut heights, share))
    };
    // A cell of depth 2 is 2 m over its height for the user; an octave's hills are up to 0.45 of its cells high.
    let cell_m = studio::COMFORT_M / 2.2;
    let [least, middle, most] = heights(40);
    assert!((most - least) < 0.02 && (middle + 2.0).abs() < 0.01, "a plain 2 m below: {least} to {most}");
    for (octave, cells) in [(1, 2.0), (2, 1.0), (4, 0.25)] {
        let [least, middle, most] = heights(octave);
        let bound = 0.45 * cells * cell_m;
        println!("octave {octave}: {least:.3} {middle:.3} {most:.3} m, bound {bound:.3} m");
        let plain = -2.0 - bound;
        assert!(least > plain - bound - 0.02 && most < plain + bound + 0.02, "{least} to {most}");
        assert!(most - least > 0.5 * bound, "octave {octave} is seen: {least} to {most}");
    }
    gallery.studio.close();
}

/// Options come and go while frames are in flight, tiles and bakes wait, and the backdrop is a layer of the runtime's.
#[test]
fn options_may_change_at_any_frame() {
    for backdrop_layer in [false, true] {
        let viewer =
            ViewerConfig { validate: true, complete: false, backdrop_layer, ..ViewerConfig::default() };
        let setup = Setup { size: [64, 64], viewer, read_back: false, deepest: 8.0, ..Setup::default() };
        let Studio { mut viewer, mock, mut course } = Studio::open(&setup);
        let mut words: Vec<String> = Inspect::words().map(|word| word.replace('N', "3")).collect();
        words.push("wireframe,boxes,patches,frozen,frusta,octave=5,normals,levels,backdrop-faces".to_owned());
        let mut frame = 0;
        for word in &words {
            for list in [word, "lit"] {
                viewer.set_inspect(&list.parse().unwrap()).unwrap();
                for _ in 0..2 {
                    frame += 1;
                    let pose = pose(f64::from(frame) / 40.0, 2.2, -14.0, f64::from(frame));
                    viewer.frame(&course.at(&pose), false).unwrap();
                }
            }
        }
        assert_eq!(*viewer.inspect(), Inspect::default());
        let usual = pose(1.0, 2.2, -14.0, 0.0);
        assert_eq!(viewer.frame(&course.at(&usual), false).unwrap(), Step::Drew);
        Studio { viewer, mock, course }.close();
    }
}
