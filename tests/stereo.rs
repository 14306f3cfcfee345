//! The two eyes see one world: what differs between their pictures is the disparity that the geometry predicts.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

#[path = "support/easel.rs"]
mod easel;
#[path = "support/studio.rs"]
mod studio;

use easel::{Easel, Shot, within_both};
use fathomless::mock::{Fov, SubmittedFrame, SubmittedView};
use fathomless::viewer::ViewerConfig;
use glam::Vec2;
use studio::{Camera, NEAR_M, Setup, Studio, depth_at, pose, quantile};

const SIZE: [u32; 2] = [192, 192];

/// Red, green and blue between the four pixels round a place.
fn sample(view: &SubmittedView, x: f32, y: f32) -> Option<[f64; 3]> {
    let (x, y) = (x - 0.5, y - 0.5);
    if x < 0.0 || y < 0.0 || x + 1.0 >= view.size[0] as f32 || y + 1.0 >= view.size[1] as f32 {
        return None;
    }
    let (column, row) = (x as u32, y as u32);
    let (u, v) = (f64::from(x.fract()), f64::from(y.fract()));
    let at = |dx, dy| view.pixel(column + dx, row + dy).map(|rgba| [0, 1, 2].map(|i| f64::from(rgba[i])));
    let [a, b, c, d] = [at(0, 0)?, at(1, 0)?, at(0, 1)?, at(1, 1)?];
    Some([0, 1, 2].map(|i| (a[i] * (1.0 - u) + b[i] * u) * (1.0 - v) + (c[i] * (1.0 - u) + d[i] * u) * v))
}

/// Greatest difference of a channel, in 1/255.
fn differ(a: [f64; 3], b: [f64; 3]) -> f64 {
    [0, 1, 2].map(|i| (a[i] - b[i]).abs()).into_iter().fold(0.0, f64::max)
}

#[test]
fn what_one_eye_sees_is_where_the_depth_says_in_the_other() {
    let setup = Setup { size: SIZE, ..Setup::default() };
    let mut studio = Studio::open(&setup);
    let pose = pose(0.0, 2.2, -40.0, 20.0);
    let frame = studio.shoot(&pose);
    let orientation = studio.course.at(&pose).orientation;
    let cameras = Camera::both(&frame, orientation);
    assert!((cameras[1].eye.distance(cameras[0].eye) - setup.ipd_m).abs() < 1e-5);

    let [left, right] = [&frame.views[0], &frame.views[1]];
    let (mut colours, mut unmoved, mut depths, mut disparities) = (vec![], vec![], vec![], vec![]);
    let mut hidden = 0;
    for y in (0..SIZE[1]).step_by(3) {
        for x in (0..SIZE[0]).step_by(3) {
            let depth = depth_at(left, x, y);
            if depth == 0.0 {
                continue;
            }
            let (at_x, at_y) = (x as f32 + 0.5, y as f32 + 0.5);
            let point = cameras[0].eye + cameras[0].ray(at_x, at_y) * (NEAR_M / depth);
            let Some((to_x, to_y, deep)) = cameras[1].project(point) else { continue };
            let Some(there) = sample(right, to_x, to_y) else { continue };
            let seen = NEAR_M / depth_at(right, to_x as u32, to_y as u32);
            if seen < deep * 0.97 {
                hidden += 1;
                continue;
            }
            let here = sample(left, at_x, at_y).unwrap_or_else(|| {
                let rgba = left.pixel(x, y).unwrap();
                [0, 1, 2].map(|i| f64::from(rgba[i]))
            });
            depths.push(f64::from((seen / deep - 1.0).abs()));
            colours.push(differ(here, there));
            // Where the point would be without parallax: infinitely far in the same direction.
            let (far_x, far_y, _) = cameras[1].project(cameras[1].eye + (point - cameras[0].eye)).unwrap();
            if let Some(elsewhere) = sample(right, far_x, far_y) {
                unmoved.push(differ(here, elsewhere));
                disparities.push(f64::from((to_x - far_x).abs()));
            }
            // The eyes are level: a point is on one row in both pictures.
            assert!((to_y - at_y).abs() < 0.01, "{to_y} is not {at_y}");
        }
    }
    let [colour, still, depth, disparity] =
        [&mut colours, &mut unmoved, &mut depths, &mut disparities].map(|list| quantile(list, 0.5));
    println!(
        "{} pixels, {hidden} hidden: colours off by {colour:.2}, {still:.2} without parallax; depths {depth:.5}; {disparity:.2} pixels of disparity",
        colours.len()
    );
    assert!(colours.len() > 2000 && hidden * 20 < colours.len());
    assert!(disparity > 1.5, "the scene is near enough to show parallax: {disparity} pixels");
    assert!(depth < 0.003, "the right eye's depth is off by {depth}");
    assert!(colour < 4.0, "colours are off by {colour}/255");
    assert!(still > 2.0 * colour, "without parallax they would be off by {still}/255 only");
    studio.close();
}

/// The pixels and depths of both eyes.
fn pixels(frame: &SubmittedFrame) -> [(&[u8], &[f32]); 2] {
    [0, 1].map(|i| (&frame.views[i].rgba[..], &frame.views[i].depth.as_ref().unwrap().values[..]))
}

#[test]
fn eyes_in_one_place_see_the_same() {
    let fov = Fov { left: -0.7, right: 0.8, up: 0.6, down: -0.75 };
    let mut studio = Studio::open(&Setup { size: SIZE, fov: [fov; 2], ipd_m: 0.0, ..Setup::default() });
    for pose in [pose(0.0, 2.2, -15.0, 0.0), pose(0.0, 2.2, -80.0, 77.0)] {
        let frame = studio.shoot(&pose);
        let [left, right] = pixels(&frame);
        assert!(left.0 == right.0, "the pictures are the same bytes");
        assert!(left.1 == right.1, "the depths are the same bits");
        assert!(left.0.chunks(4).any(|rgba| rgba != &left.0[..4]), "and show something");
    }
    studio.close();
}

#[test]
fn a_pass_for_both_eyes_draws_what_a_pass_for_each_does() {
    let poses = [pose(0.0, 2.2, -15.0, 0.0), pose(0.4, 1.7, -70.0, 130.0)];
    let [together, apart] = [true, false].map(|multiview| {
        let viewer = ViewerConfig { multiview, validate: true, ..ViewerConfig::default() };
        let mut studio = Studio::open(&Setup { size: SIZE, viewer, ..Setup::default() });
        let info = &studio.viewer.gpu().info;
        assert_eq!(studio.viewer.session_info().multiview, multiview && info.multiview);
        let frames = poses.map(|pose| studio.shoot(&pose));
        studio.close();
        frames
    });
    for (a, b) in together.iter().zip(&apart) {
        for (a, b) in pixels(a).iter().zip(pixels(b)) {
            assert!(most_different(a.0, b.0) <= 1, "off by more than 1/255");
            assert!(a.1.iter().zip(b.1).all(|(a, b)| (a - b).abs() <= 1e-6 * a), "depths differ");
        }
    }
}

fn most_different(a: &[u8], b: &[u8]) -> u8 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap()
}

/// Software drivers offer multiview but the viewer never uses it there (Mesa's llvmpipe puts some triangles into the
/// wrong layer, those that it clips above all). What needs no clipping comes out right even so, but for a stray pixel.
#[test]
fn multiview_is_right_where_nothing_is_clipped() {
    let [together, apart] = [true, false].map(|multiview| {
        let mut easel = Easel::new("hills", SIZE, multiview);
        assert!(
            easel.gpu.info.multiview_offered,
            "this device has no multiview: run the tests on one that has"
        );
        let shot = Shot { height: 3.0, pitch_deg: -90.0, fov: 0.9, ..Shot::default() };
        let sight = easel.draw(&shot, usize::MAX, |drawn, eyes| drawn.retain(|tile| within_both(tile, eyes)));
        let pictures = [0, 1].map(|eye| easel.picture(eye));
        assert!(sight.drawn > 10, "{} tiles are wholly in view", sight.drawn);
        easel.close();
        pictures
    });
    for (eye, (a, b)) in together.iter().zip(&apart).enumerate() {
        let pixels = a.iter().zip(b);
        let stray = pixels.filter(|(a, b)| most_different(*a, *b) > 1).count();
        assert!(stray * 1000 <= a.len(), "eye {eye}: {stray} pixels differ");
        assert!(easel::holes(a) < a.len() * 9 / 10, "eye {eye} sees something");
    }
    assert!(together[0] != together[1], "each eye has its own picture");
}

/// Triangles of an eye's picture whose half is `tangent` wide, and their share of it: for the left eye the lower left
/// corner, for the right eye the upper right one and a strip along the right edge.
fn hidden(eye: usize, tangent: f32) -> (Vec<Vec2>, f64) {
    let (corners, share): (&[[f32; 2]], f64) = match eye {
        0 => (&[[-1.0, -1.0], [0.0, -1.0], [-1.0, 0.0]], 0.125),
        _ => (&[[1.0, 1.0], [-0.5, 1.0], [1.0, 0.2], [1.0, 0.2], [1.0, -0.6], [0.7, 0.4]], 0.18),
    };
    (corners.iter().map(|it| tangent * Vec2::from_array(*it)).collect(), share)
}

/// On software drivers too, as long as nothing is clipped: so one eye at a time is covered. (Triangles of the one eye lie
/// outside the other's picture; once llvmpipe has clipped those away, it puts the next ones into the wrong layer.)
#[test]
fn a_pass_for_both_eyes_covers_what_a_pass_for_each_does() {
    let shot = Shot { height: 3.0, pitch_deg: -90.0, fov: 0.9, ..Shot::default() };
    let masks = [0, 1].map(|eye| hidden(eye, shot.fov.tan()));
    let [together, apart] = [true, false].map(|multiview| {
        let mut easel = Easel::new("hills", SIZE, multiview);
        assert!(easel.gpu.info.multiview_offered, "this device has no multiview");
        let mut draw = |triangles: &[Vec<Vec2>; 2]| {
            easel.cover(triangles);
            easel.draw(&shot, usize::MAX, |drawn, eyes| drawn.retain(|tile| within_both(tile, eyes)));
            [0, 1].map(|eye| easel.picture(eye))
        };
        let bare = draw(&[vec![], vec![]]);
        let left = draw(&[masks[0].0.clone(), vec![]]);
        let right = draw(&[vec![], masks[1].0.clone()]);
        easel.close();
        [bare, left, right]
    });
    let is_black = |pixel: &[u8; 4]| pixel[..3] == [0; 3];
    let (pixels, [bare, covered @ ..]) = ((SIZE[0] * SIZE[1]) as usize, &together);
    for (of, pictures) in covered.iter().enumerate() {
        for eye in 0..2 {
            let picture = &pictures[eye];
            let pairs = picture.iter().zip(&apart[1 + of][eye]);
            let stray = pairs.filter(|(a, b)| most_different(*a, *b) > 1).count();
            assert!(stray * 1000 <= pixels, "mask {of}, eye {eye}: {stray} pixels differ");
            let black = picture.iter().filter(|pixel| is_black(pixel)).count() as f64 / pixels as f64;
            let wanted = if eye == of { masks[of].1 } else { 0.0 };
            assert!((black - wanted).abs() < 0.005, "mask {of}, eye {eye}: {black} is black, not {wanted}");
            // What is not covered is as it was.
            let pairs = picture.iter().zip(&bare[eye]);
            let changed = pairs.filter(|(a, b)| !is_black(a) && most_different(*a, *b) > 1).count();
            assert!(changed * 1000 <= pixels, "mask {of}, eye {eye}: {changed} pixels are another colour");
        }
    }
}
