//! The eyes are located again as late as can be: what is drawn is seen from where the frame says it was.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

#[path = "support/studio.rs"]
mod studio;

use fathomless::mock::SubmittedFrame;
use glam::Vec3;
use studio::{Setup, Studio, pose};

fn shoot(early_error_m: Vec3) -> SubmittedFrame {
    let mut studio = Studio::open(&Setup { early_error_m, ..Setup::default() });
    // The first frame takes the seat from the early answer, so that the error is in the second one's views only.
    let at = pose(0.4, 2.0, -35.0, 20.0);
    studio.shoot(&at);
    let frame = studio.shoot(&at);
    studio.close();
    frame
}

fn difference(a: &SubmittedFrame, b: &SubmittedFrame) -> f64 {
    let bytes =
        |frame: &SubmittedFrame| frame.views.iter().flat_map(|view| view.rgba.clone()).collect::<Vec<_>>();
    let (a, b) = (bytes(a), bytes(b));
    assert_eq!(a.len(), b.len());
    a.iter().zip(&b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
}

#[test]
fn the_late_views_are_what_is_drawn() {
    // The seat is where the head was first taken to be; the late answer puts the head beside it.
    let error = Vec3::new(0.25, 0.1, -0.15);
    let late = shoot(error);
    let steady = shoot(Vec3::ZERO);
    // The same place in the terrain, reached without an error: the head is moved from its seat by as much.
    let mut studio = Studio::open(&Setup::default());
    let at = pose(0.4, 2.0, -35.0, 20.0);
    studio.shoot(&at);
    studio.mock.hold_head(fathomless::mock::Pose::at(-error.x, 1.6 - error.y, -error.z));
    let moved = studio.shoot(&at);
    studio.close();
    let (right, wrong) = (difference(&late, &moved), difference(&steady, &moved));
    println!("{right:.2} from where it was meant to be seen, {wrong:.2} from the seat");
    assert!(right < 0.25 * wrong, "{right} of {wrong}: the late answer was not drawn");
}
