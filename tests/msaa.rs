//! Several samples of a pixel: silhouettes have shades between ground and sky, all else is as with one sample; the depth
//! handed to the runtime is a depth of the surface; and everything that can be asked of a picture can be asked of these.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

#[path = "support/easel.rs"]
mod easel;
#[path = "support/studio.rs"]
mod studio;

use std::str::FromStr;

use ash::vk;
use easel::{Easel, Shot};
use fathomless::aids::{Aids, HandAid, Vignette};
use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::governor::Dials;
use fathomless::inspect::{BackdropView, Inspect};
use fathomless::mock::{Clock, Mask, Mock, MockConfig, SubmittedFrame, SubmittedView};
use fathomless::quality::{Fineness, SAMPLES, samples_at_most};
use fathomless::rig::Pose;
use fathomless::settings::QualitySettings;
use fathomless::viewer::{Viewer, ViewerConfig};
use fathomless::world::{World, linear_from_srgb};
use glam::{Quat, Vec3};
use studio::{Setup, Studio, depth_at, pose};

fn sampled(samples: u32) -> ViewerConfig {
    let wish = QualitySettings { samples: Some(samples), ..QualitySettings::default() };
    ViewerConfig { validate: true, wish, ..ViewerConfig::default() }
}

/// Live tiles before nothing but the sky: the backdrop has edges of its own, which were filtered when it was baked.
fn ridges(samples: u32) -> Setup {
    let inspect = Inspect { backdrop: BackdropView::Off, ..Inspect::default() };
    let viewer = ViewerConfig { inspect, ..sampled(samples) };
    Setup { world: "canyonlands", size: [192, 144], viewer, deepest: 1.0, ..Setup::default() }
}

/// Along the ground, with the horizon in the picture.
fn at_the_horizon() -> FlightPose {
    pose(0.4, 1.6, -4.0, 35.0)
}

fn shoot(setup: &Setup, pose: &FlightPose) -> SubmittedFrame {
    let mut studio = Studio::open(setup);
    let frame = studio.shoot(pose);
    studio.close();
    frame
}

fn light(view: &SubmittedView, x: u32, y: u32) -> f32 {
    let [r, g, b, _] = view.pixel(x, y).unwrap();
    [r, g, b].map(linear_from_srgb).iter().sum::<f32>() / 3.0
}

/// The sky is blue, and this land is red.
fn blueness(view: &SubmittedView, x: u32, y: u32) -> f32 {
    let [r, _, b, _] = view.pixel(x, y).unwrap();
    linear_from_srgb(b) - linear_from_srgb(r)
}

/// The eight pixels round one, and itself.
fn around(x: u32, y: u32) -> impl Iterator<Item = (u32, u32)> {
    (y - 1..=y + 1).flat_map(move |y| (x - 1..=x + 1).map(move |x| (x, y)))
}

fn inner(view: &SubmittedView) -> impl Iterator<Item = (u32, u32)> {
    let [width, height] = view.size;
    (1..height - 1).flat_map(move |y| (1..width - 1).map(move |x| (x, y)))
}

/// The least and the greatest depth of the pixels round one.
fn depths(view: &SubmittedView, x: u32, y: u32) -> (f32, f32) {
    let all = around(x, y).map(|(x, y)| depth_at(view, x, y));
    all.fold((f32::INFINITY, 0.0), |(least, most), depth| (least.min(depth), most.max(depth)))
}

/// Of the places where the sky is right above the ground in `edges`: how many there are, and at how many of them one of the
/// two pixels has a colour of its own, clearly between those farther up and down.
fn shaded_silhouettes(view: &SubmittedView, edges: &SubmittedView) -> (usize, usize) {
    let (mut silhouettes, mut shaded) = (0, 0);
    for x in 0..view.size[0] {
        for y in 3..view.size[1] - 4 {
            if depth_at(edges, x, y) > 0.0 || depth_at(edges, x, y + 1) == 0.0 {
                continue;
            }
            let (sky, ground) = (blueness(view, x, y - 2), blueness(view, x, y + 3));
            if sky - ground < 0.1 {
                continue;
            }
            silhouettes += 1;
            let between = |y| (0.15..0.85).contains(&((blueness(view, x, y) - ground) / (sky - ground)));
            shaded += usize::from(between(y) || between(y + 1));
        }
    }
    (silhouettes, shaded)
}

#[test]
fn silhouettes_are_shaded_and_what_is_smooth_stays() {
    let (one, four) = (shoot(&ridges(1), &at_the_horizon()), shoot(&ridges(4), &at_the_horizon()));
    for (eye, (one, four)) in one.views.iter().zip(&four.views).enumerate() {
        let (silhouettes, hard) = shaded_silhouettes(one, one);
        let (_, soft) = shaded_silhouettes(four, one);
        println!("eye {eye}: of {silhouettes} silhouettes {hard} are shaded with 1 sample, {soft} with 4");
        assert!(silhouettes > 100, "{silhouettes} silhouettes");
        assert!(soft * 2 > silhouettes && soft > 2 * hard, "{hard} {soft} of {silhouettes}");

        let smooth = |x, y| {
            let (least, most) = depths(one, x, y);
            least > 0.0 && most < 1.03 * least
        };
        let differences: Vec<f32> = inner(one)
            .filter(|&(x, y)| smooth(x, y))
            .map(|(x, y)| {
                let (a, b) = (one.pixel(x, y).unwrap(), four.pixel(x, y).unwrap());
                (0..3).map(|i| f32::from(b[i]) - f32::from(a[i])).sum::<f32>() / 3.0
            })
            .collect();
        let mean =
            |of: fn(f32) -> f32| differences.iter().copied().map(of).sum::<f32>() / differences.len() as f32;
        let (brighter, differ) = (mean(|d| d), mean(f32::abs));
        println!(
            "eye {eye}: {} smooth pixels differ by {differ:.2}/255, brighter by {brighter:.2}",
            differences.len()
        );
        // Where triangles meet, each shades a part.
        assert!(differences.len() > 2000 && differ < 6.0 && brighter.abs() < 1.0, "{differ} {brighter}");
    }
}

#[test]
fn the_depth_that_is_submitted_is_a_depth_of_the_surface() {
    // Looking down too, where there is no sky.
    for pose in [at_the_horizon(), pose(0.7, 2.0, -55.0, 60.0)] {
        let (one, four) = (shoot(&ridges(1), &pose), shoot(&ridges(4), &pose));
        for (one, four) in one.views.iter().zip(&four.views) {
            let depth = four.depth.as_ref().unwrap();
            assert_eq!((depth.size, depth.near_z), (four.size, f32::INFINITY));
            assert!(depth.values.iter().all(|depth| (0.0..1.0).contains(depth)));
            let (mut astray, mut all) = (0, 0);
            for (x, y) in inner(four) {
                let (depth, (least, most)) = (depth_at(four, x, y), depths(one, x, y));
                // A sample lies between the pixels' middles, up to what no middle hit.
                astray += usize::from(depth < 0.98 * least || depth > 1.02 * most);
                all += 1;
            }
            assert!(astray * 200 < all, "{astray} of {all} depths are off the surface");
            let sky =
                |view: &SubmittedView| inner(view).filter(|&(x, y)| depth_at(view, x, y) == 0.0).count();
            let (one, four) = (sky(one), sky(four));
            assert!(four.abs_diff(one) * 20 <= one.max(20), "{one} and {four} pixels of sky");
        }
    }
}

#[test]
fn light_is_averaged_whether_or_not_the_format_knows_that_it_holds_srgb() {
    let frame = |formats: Vec<vk::Format>| {
        let mock = MockConfig {
            clock: Clock::Stepped { hz: 90.0 },
            eye_size: [96, 80],
            read_back: true,
            formats,
            ..MockConfig::default()
        };
        let (world, mock) = (World::load("canyonlands").unwrap(), Mock::new(mock));
        let viewer = Viewer::on_mock(&world, &ridges(4).viewer, mock.clone()).unwrap();
        let course = Course::new(world.surface, 0, 1.0, |_| ());
        let mut studio = Studio { viewer, mock, course };
        studio.viewer.keep_pictures().unwrap();
        let frame = studio.shoot(&at_the_horizon());
        let read = [0, 1].map(|eye| studio.viewer.picture(eye).unwrap());
        studio.close();
        (frame, read)
    };
    let (srgb, read) = frame(vec![vk::Format::R8G8B8A8_SRGB, vk::Format::D32_SFLOAT]);
    for plain in [vk::Format::R8G8B8A8_UNORM, vk::Format::B8G8R8A8_UNORM] {
        let (frame, read_plain) = frame(vec![plain, vk::Format::D32_SFLOAT]);
        for (view, (expected, read)) in frame.views.iter().zip(srgb.views.iter().zip(&read_plain)) {
            assert!(view.rgba == expected.rgba, "{plain:?}");
            let own = view.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]);
            assert!(own.eq(read.iter().copied()), "{plain:?}");
        }
        assert_eq!(read_plain, read);
    }
}

#[test]
fn a_part_of_the_image_and_what_lenses_hide_are_drawn_as_with_one_sample() {
    let config = |samples| ViewerConfig { mask: true, ..ridges(samples).viewer };
    let frame = |samples| {
        let mock = MockConfig {
            clock: Clock::Stepped { hz: 90.0 },
            eye_size: [160, 128],
            read_back: true,
            mask: Mask::Octagon { cut: 0.3 },
            ..MockConfig::default()
        };
        let (world, mock) = (World::load("canyonlands").unwrap(), Mock::new(mock));
        let viewer = Viewer::on_mock(&world, &config(samples), mock.clone()).unwrap();
        let course = Course::new(world.surface, 0, 1.0, |_| ());
        let mut studio = Studio { viewer, mock, course };
        studio.viewer.keep_mirror().unwrap();
        studio.shoot(&at_the_horizon());
        let dials = Dials { scale: 0.75, ..studio.viewer.dials() };
        studio.viewer.set_dials(dials);
        let frame = studio.shoot(&at_the_horizon());
        assert_eq!(studio.viewer.mirrored(), [120, 96]);
        let mirror = studio.viewer.read_mirror(1).unwrap();
        studio.close();
        (frame, mirror)
    };
    let ((one, _), (four, mirror)) = (frame(1), frame(4));
    for (one, four) in one.views.iter().zip(&four.views) {
        assert_eq!((one.size, four.size), ([120, 96], [120, 96]));
        let hidden = |view: &SubmittedView| {
            let black = |(x, y): &(u32, u32)| view.pixel(*x, *y).unwrap()[..3] == [0; 3];
            inner(view).filter(black).count()
        };
        let (hidden, total) = ([hidden(one), hidden(four)], inner(one).count());
        println!("{hidden:?} of {total} pixels are hidden");
        assert!(hidden[0] > total / 100 && hidden[0].abs_diff(hidden[1]) < total / 100, "{hidden:?}");
        let sum: f32 = inner(one).map(|(x, y)| (light(one, x, y) - light(four, x, y)).abs()).sum();
        assert!(sum / total as f32 <= 0.02, "{sum}");
    }
    let own = four.views[1].rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]);
    assert!(own.eq(mirror.iter().copied()), "the mirror shows what was submitted");
}

#[test]
fn every_way_of_showing_it_is_drawn_with_samples_too() {
    let mut studio = Studio::open(&Setup { size: [96, 80], ..ridges(4) });
    let at = at_the_horizon();
    let mut seen = vec![studio.shoot(&at).views[0].rgba.clone()];
    for words in [
        "wireframe",
        "boxes,patches",
        "frozen,frusta",
        "normals",
        "depth",
        "tinted-backdrop",
        "backdrop-faces",
    ] {
        studio.viewer.set_inspect(&Inspect::from_str(words).unwrap()).unwrap();
        let rgba = studio.shoot(&at).views[0].rgba.clone();
        assert!(!seen.contains(&rgba), "{words} shows nothing");
        seen.push(rgba);
    }
    studio.viewer.set_inspect(&ridges(4).viewer.inspect).unwrap();
    assert!(studio.shoot(&at).views[0].rgba == seen[0], "as it began");
    let grip = Pose { position: Vec3::new(-0.1, -0.1, -0.5), orientation: Quat::IDENTITY };
    let hand = HandAid { grip, aim: Some(grip), ray_m: Some(2.0), holds: false };
    let vignette = Some(Vignette { inner: 0.3, outer: 0.5, strength: 0.9 });
    for (what, aids) in [
        ("a hand", Aids { hands: [Some(hand), None], ..Aids::default() }),
        ("a vignette", Aids { vignette, ..Aids::default() }),
        ("a fade", Aids { fade: 0.5, ..Aids::default() }),
    ] {
        studio.viewer.set_aids(&aids);
        let rgba = studio.shoot(&at).views[0].rgba.clone();
        assert!(!seen.contains(&rgba), "{what} is not seen");
        seen.push(rgba);
    }
    studio.close();
}

#[test]
fn a_pass_for_both_eyes_draws_what_a_pass_each_draws() {
    let shot = Shot { pitch_deg: -6.0, height: 1.6, fov: 0.7, ..Shot::default() };
    let draw = |multiview, samples| {
        let mut easel = Easel::sampled("canyonlands", [96, 80], multiview, samples);
        easel.draw(&shot, usize::MAX, |_, _| ());
        let pictures = [0, 1].map(|eye| easel.picture(eye));
        let trusted = easel.gpu.info.multiview && easel.gpu.info.resolves_to_layers;
        easel.close();
        (pictures, trusted)
    };
    let ((each, _), (both, trusted), (one, _)) = (draw(false, 4), draw(true, 4), draw(false, 1));
    // Software drivers are not trusted with the second layer, and never asked for it.
    for eye in 0..if trusted { 2 } else { 1 } {
        let differ = each[eye].iter().zip(&both[eye]).filter(|(a, b)| a != b).count();
        assert!(differ * 100 <= each[eye].len(), "eye {eye}: {differ} pixels differ");
        // Shades of the background's magenta between it and the ground are what one sample cannot have.
        let soft = |pixels: &[[u8; 4]]| {
            pixels.iter().filter(|[r, g, b, _]| r.abs_diff(*b) < 3 && r.abs_diff(*g) > 20 && *r < 250).count()
        };
        let (soft, hard) = (soft(&each[eye]), soft(&one[eye]));
        println!("eye {eye}: {hard} and {soft} mixed pixels, {differ} differ");
        assert!(hard == 0 && soft > 20, "{hard} {soft}");
    }
    assert_ne!(each[0], each[1]);
}

#[test]
fn samples_come_and_go_while_it_is_drawn_and_none_is_taken_that_the_device_cannot() {
    // What the lenses hide is left out with any number of them.
    let viewer = ViewerConfig { mask: true, ..ridges(8).viewer };
    let mut studio = Studio::open(&Setup { size: [96, 80], viewer, ..ridges(8) });
    let offered = studio.viewer.gpu().info.sample_counts;
    assert_eq!(studio.viewer.quality().samples, samples_at_most(offered, 8));
    let world = World::load("canyonlands").unwrap();
    let tangent = studio.viewer.pixels_per_tangent();
    let mut pictures = Vec::new();
    for samples in SAMPLES.into_iter().chain([1, 4]) {
        let wanted = studio.viewer.wanted_quality();
        let quality = wanted.tuned(&Fineness { samples, ..wanted.fineness() }, tangent);
        studio.viewer.redraw(&world, quality).unwrap();
        assert_eq!(studio.viewer.quality().samples, samples_at_most(offered, samples));
        pictures
            .push((studio.viewer.quality().samples, studio.shoot(&at_the_horizon()).views[1].rgba.clone()));
    }
    for (samples, picture) in &pictures {
        for (others, other) in &pictures {
            assert_eq!(samples == others, picture == other, "{samples} and {others} samples");
        }
    }
    studio.close();
}

#[test]
fn tiles_of_any_size_show_the_same_ground() {
    // From above: everything that is seen is of live tiles.
    let at = pose(0.5, 2.2, -50.0, 20.0);
    let mut studio = Studio::open(&Setup { size: [128, 112], deepest: 1.0, ..ridges(1) });
    let world = World::load("canyonlands").unwrap();
    let tangent = studio.viewer.pixels_per_tangent();
    let mut frames = Vec::new();
    for (cells, mesh) in [(32, 16), (16, 16), (64, 8), (64, 32)] {
        let wanted = studio.viewer.wanted_quality();
        let quality = wanted.tuned(&Fineness { cells, mesh, ..wanted.fineness() }, tangent);
        studio.viewer.redraw(&world, quality).unwrap();
        let Fineness { cells: data, mesh: drawn, .. } = studio.viewer.quality().fineness();
        assert_eq!((data, drawn), (cells, mesh));
        frames.push(((cells, mesh), studio.shoot(&at)));
        assert_eq!(studio.viewer.counts().waiting, 0, "every tile is there");
    }
    let mean = |view: &SubmittedView| {
        let [width, height] = view.size;
        // Squares of 8 pixels: what is finer than a cell is shaded otherwise by coarser data.
        let square =
            |x: u32, y: u32| (0..64).map(|i| light(view, 8 * x + i % 8, 8 * y + i / 8)).sum::<f32>() / 64.0;
        let all = (0..height / 8).flat_map(|y| (0..width / 8).map(move |x| (x, y)));
        all.map(|(x, y)| square(x, y)).collect::<Vec<f32>>()
    };
    let (first, rest) = frames.split_first().unwrap();
    for (size, frame) in rest {
        for (view, reference) in frame.views.iter().zip(&first.1.views) {
            let far: Vec<f32> = inner(view)
                .map(|(x, y)| (depth_at(view, x, y) / depth_at(reference, x, y)).log2().abs())
                .collect();
            let off = far.iter().filter(|&&octaves| octaves > 0.1).count();
            let (ours, theirs) = (mean(view), mean(reference));
            let light = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).sum::<f32>() / ours.len() as f32;
            println!(
                "{size:?}: light differs by {light:.4}, {off} of {} depths by a tenth of an octave",
                far.len()
            );
            assert!(off * 12 < far.len(), "{size:?}: {off} of {} depths", far.len());
            assert!(light < 0.025, "{size:?}: {light}");
        }
    }
    // Aside, the ground is another.
    let aside = studio.shoot(&pose(0.5, 2.2, -50.0, 60.0));
    let (ours, theirs) = (mean(&aside.views[0]), mean(&rest[2].1.views[0]));
    let light = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).sum::<f32>() / ours.len() as f32;
    println!("aside: light differs by {light:.4}");
    assert!(light > 0.035, "{light}");
    // Where there is no room for the largest, all stays as it was.
    let wanted = studio.viewer.wanted_quality();
    let largest = wanted.tuned(&Fineness { split: 4.0, cells: 128, ..wanted.fineness() }, tangent);
    if let Err(error) = studio.viewer.redraw(&world, largest) {
        assert!(format!("{error:#}").contains("quality.cells"), "{error:#}");
        assert_eq!(studio.viewer.wanted_quality(), wanted);
        assert_eq!(studio.shoot(&at).views[0].rgba, frames.last().unwrap().1.views[0].rgba);
    }
    studio.close();
}
