//! The viewer: a session, the GPU and the renderer, owned in the order in which they must go; one readable frame.

mod config;
mod dials;
mod open;
mod panel;
mod pictures;
mod wearer;
mod witness;

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::Quat;

pub use self::config::{DeskConfig, ViewerConfig};
use self::open::pixels_per_tangent;
pub use self::open::{stand_in, stand_in_mock};
use self::panel::Panel;
pub use self::panel::{Hung, PanelWay};
pub use self::pictures::Faces;
use self::wearer::{Sight, Wearer};
pub use self::witness::{Remarks, Witness, survive};
use crate::aids::Aids;
use crate::bindings::Bound;
use crate::controllers::Hands;
use crate::course::Standpoint;
use crate::governor::Governor;
use crate::gpu::{Frame, Gpu};
use crate::inspect::Inspect;
use crate::mock::Mock;
use crate::painter::Painter;
pub use crate::quality::Quality;
use crate::render::{Backdrop, Behind, EyeTarget, Placed, Shading, View};
use crate::rig::{COMFORT_M, Eye, Pose, Rig};
use crate::telemetry::{FrameStats, GpuPass, GpuTimes, Passes, Span, Stopwatch, Work};
use crate::terrain::select::Counts;
use crate::xr;

/// Frames that the CPU may be ahead of the GPU.
const IN_FLIGHT: usize = 2;

/// Distance of the near plane in the user's metres.
const NEAR_M: f32 = 0.05;

/// What came of a call of [`Viewer::frame`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A frame was drawn.
    Drew,
    /// The runtime wanted a frame without a picture.
    Skipped,
    /// No frame is wanted now: try again in about 100 ms.
    Idle,
    /// The session is over.
    Exited,
}

/// Whence one frame is seen.
struct Viewing<'a> {
    standpoint: &'a Standpoint<'a>,
    rig: Rig,
    head: Pose,
    seat: Pose,
    hands: Hands,
    images: xr::EyeImages,
}

/// Everything that draws into one session. Fields are dropped in order.
pub struct Viewer {
    painter: Painter,
    panel: Panel,
    session: xr::Session,
    runtime: xr::Runtime,
    gpu: Arc<Gpu>,
    mock: Option<Mock>,
    config: ViewerConfig,
    /// The head of the first frame since the origin moved last: the seat of the rig.
    seat: Option<Pose>,
    wearer: Wearer,
    /// The eyes of the last frame drawn.
    eyes: Option<[Eye; 2]>,
    /// What the hands did at the last frame, in the session's space.
    hands: Hands,
    /// How often it was left.
    seats_left: u32,
    /// How often the origin had moved when the seat was taken.
    origin_moves: u32,
    stats: FrameStats,
    governor: Option<Governor>,
    /// Share of the images' width and height that is drawn.
    scale: f64,
    /// The next frame is drawn in full, whatever the scale.
    in_full: bool,
    /// When the frame before was done; None: there was none just before.
    done_ns: Option<u64>,
}

impl Viewer {
    /// Light from this direction, a unit vector as [`Look::sun_direction`](crate::world::Look::sun_direction). Where it is
    /// `settled`, the backdrop is baked anew in it.
    pub fn set_sun(&mut self, direction: [f32; 3], settled: bool) {
        self.painter.set_sun(direction, settled);
    }

    /// Pixels per unit of tangent in the middle of an eye's picture, about.
    pub fn pixels_per_tangent(&self) -> f64 {
        pixels_per_tangent(&self.session)
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// The runtime.
    pub fn runtime(&self) -> &xr::Runtime {
        &self.runtime
    }

    /// What the session settled on.
    pub fn session_info(&self) -> &xr::SessionInfo {
        self.session.info()
    }

    /// What the last selection came to.
    pub fn counts(&self) -> Counts {
        self.painter.selection.counts
    }

    /// How much is drawn.
    pub fn quality(&self) -> &Quality {
        &self.painter.quality
    }

    /// The backdrop.
    pub fn backdrop(&self) -> &Backdrop {
        &self.painter.backdrop
    }

    /// What the last frame drawn cost.
    pub fn stats(&self) -> &FrameStats {
        &self.stats
    }

    /// Texels per side of the layer that sky and backdrop are shown as; None: they are in the eyes' pictures.
    pub fn backdrop_layer(&self) -> Option<u32> {
        self.session.cube_side()
    }

    /// From now on this is shown otherwise than usual. What rare options need is made when they are first asked for, and
    /// another octave makes every tile anew; else it costs nothing.
    ///
    /// # Errors
    /// Out of memory, then nothing has changed; or the device is lost.
    pub fn set_inspect(&mut self, inspect: &Inspect) -> Result<()> {
        self.painter.set_inspect(&self.gpu, inspect)?;
        self.config.inspect = *inspect;
        Ok(())
    }

    /// What is shown otherwise than usual.
    pub fn inspect(&self) -> &Inspect {
        &self.config.inspect
    }

    /// From the next frame on this is drawn over the land.
    pub fn set_aids(&mut self, aids: &Aids) {
        self.painter.aids.clone_from(aids);
    }

    /// Light and sky, or what shows holes.
    pub fn set_shading(&mut self, shading: Shading) {
        self.painter.terrain.shading = shading;
    }

    /// Only this eye's picture is seen: the other need not be drawn. None: both are.
    pub fn set_only_eye(&mut self, eye: Option<usize>) {
        self.painter.terrain.only_eye = eye.map(|eye| eye as u32);
    }

    /// Asks the session to end; go on calling [`Viewer::frame`] until it says [`Step::Exited`].
    ///
    /// # Errors
    /// The session is lost.
    pub fn request_exit(&mut self) -> Result<(), xr::Error> {
        self.session.request_exit()
    }

    /// One frame of the session, drawn from `standpoint`. A head that is worn has its own pitch and roll: then `worn`
    /// keeps the standpoint's heading only.
    ///
    /// # Errors
    /// [`xr::Error`] or [`crate::gpu::Lost`] when session, instance or device are lost.
    pub fn frame(&mut self, standpoint: &Standpoint<'_>, worn: bool) -> Result<Step> {
        let mut watch = Stopwatch::start();
        // Hands that are not read let go.
        self.hands = Hands::default();
        self.wearer.begin();
        match self.session.poll()? {
            xr::Phase::Idle => {
                self.wearer.forget();
                self.done_ns = None;
                return Ok(Step::Idle);
            }
            xr::Phase::Exited => return Ok(Step::Exited),
            xr::Phase::Running(_) => {}
        }
        let Some(tick) = self.session.wait_frame()? else { return Ok(Step::Idle) };
        let (at_ns, period_ms) = (tick.display_time_ns, tick.period_ns as f64 * 1e-6);
        watch.lap(Span::Wait);
        // Poses count from elsewhere: where the wearer is now is his seat.
        let origin_moves = self.session.origin_moves();
        if std::mem::replace(&mut self.origin_moves, origin_moves) != origin_moves {
            self.recentre();
        }
        let hidden = self.session.hidden_areas()?;
        let mut xr_frame = self.session.begin_frame(tick)?;
        if let Some(hidden) = hidden {
            self.painter.frames.wait_idle()?;
            self.painter.terrain.set_mask(&self.gpu, &hidden, IN_FLIGHT)?;
        }
        self.hands = xr_frame.read_hands()?;
        let Some(images) = xr_frame.acquire()? else {
            xr_frame.end(None)?;
            // The next interval is not one of drawing.
            self.done_ns = None;
            return Ok(Step::Skipped);
        };
        let views = xr_frame.locate_views()?;
        watch.lap(Span::Xr);
        let (head, eyes) = plain(&views);
        let seat = self.seat.unwrap_or(head);
        // Until the head is tracked, the seat is wherever the head is taken to be.
        self.seat = self.seat.or((views.tracking == xr::Tracking::Full).then_some(head));
        self.wearer.meet(Sight { head, tracking: views.tracking, origin_moves, at_ns });
        let rig = rig(standpoint, &seat, worn);
        let hands = from_seat(self.hands, self.seat);
        let painter = &mut self.painter;
        painter.blinks = painter.aids.blinks && self.wearer.has_jolted();
        let draws_before = self.gpu.draws();
        let mut frame = painter.begin(standpoint, &rig, (&head, &eyes), &mut watch)?;
        let viewing = Viewing { standpoint, rig, head, seat, hands, images };
        let parts = (&mut *painter, &mut self.panel, &self.gpu);
        let painted = paint(parts, &mut frame, &mut xr_frame, &viewing, &mut watch);
        // Tiles and layers count as made since they were recorded: that is submitted whatever came then.
        let serial = painter.frames.submit(frame, &[], &[])?;
        let views = painted?;
        self.eyes = Some(plain(&views).1);
        watch.lap(Span::Submit);
        xr_frame.end(Some(&views))?;
        self.wearer.show();
        watch.lap(Span::Xr);
        let (clock, begun_ns) = painter.frames.timed_from();
        self.stats = FrameStats {
            serial,
            spans: watch.spans(),
            laps: watch.laps(),
            work: Work { draws: self.gpu.draws() - draws_before, ..painter.work() },
            headroom: painter.headroom,
            parallax: painter.backdrop.schedule().used().unwrap_or(0.0),
            timed_serial: painter.frames.timed_serial(),
            passes: Passes::default(),
            gpu: GpuTimes::new(clock),
        };
        for pass in painter.frames.times() {
            self.stats.passes.add(pass.name, pass.ms);
            let at = |ms: f64| begun_ns + (ms * 1e6) as u64;
            let (begin_ns, end_ns) = (at(pass.start_ms), at(pass.start_ms + pass.ms));
            self.stats.gpu.push(GpuPass { name: pass.name, begin_ns, end_ns });
        }
        if std::mem::take(&mut self.in_full) {
            self.set_dials(self.dials());
        }
        self.heed_governor(period_ms);
        Ok(Step::Drew)
    }

    /// Turns the axes of the head, as of the last frame drawn, to the play space's. Identity before there was one.
    pub fn gaze(&self) -> Quat {
        self.eye(0).map(|eye| eye.pose.orientation).unwrap_or_default()
    }

    /// What the hands did at the last frame, with their positions in metres from the seat.
    pub fn hands(&self) -> Hands {
        from_seat(self.hands, self.seat)
    }

    /// The interaction profiles of what the hands hold, left and right.
    pub fn interaction_profiles(&self) -> [Option<&str>; 2] {
        self.session.interaction_profiles()
    }

    /// What is bound to what the hands do, in the runtime's words, and another number each time that may have changed.
    pub fn bound(&self) -> (&[Bound], u32) {
        self.session.bound()
    }

    /// Lets the hands, left and right, feel a tick of an amplitude up to 1 each; 0: none.
    ///
    /// # Errors
    /// The session is lost.
    pub fn pulse(&self, amplitudes: [f32; 2]) -> Result<(), xr::Error> {
        let mut felt = amplitudes.into_iter().enumerate().filter(|(_, amplitude)| *amplitude > 0.0);
        felt.try_for_each(|(hand, amplitude)| self.pulse_hand(hand, amplitude))
    }

    /// The same of one hand; 0 is the left one.
    ///
    /// # Errors
    /// The session is lost.
    pub fn pulse_hand(&self, hand: usize, amplitude: f32) -> Result<(), xr::Error> {
        self.session.pulse(hand, amplitude)
    }

    /// An eye of the last frame drawn, with its position in metres from the seat. None before there was one.
    pub fn eye(&self, eye: usize) -> Option<Eye> {
        let (eye, seat) = (self.eyes?[eye], self.seat?);
        let pose = Pose { position: eye.pose.position - seat.position, ..eye.pose };
        Some(Eye { pose, ..eye })
    }
}

impl Drop for Painter {
    /// Whatever ends a viewer, what the GPU still uses stays until it is done.
    fn drop(&mut self) {
        if let Err(error) = self.frames.wait_idle() {
            tracing::warn!("{error}");
        }
    }
}

/// The runtime's poses without the runtime's types.
fn plain(views: &xr::Views) -> (Pose, [Eye; 2]) {
    let pose = |pose: xr::Pose| Pose { position: pose.position, orientation: pose.orientation };
    let eyes = views.eyes.map(|eye| Eye {
        pose: pose(eye.pose),
        fov: [eye.fov.left, eye.fov.right, eye.fov.up, eye.fov.down],
    });
    (pose(views.head), eyes)
}

/// Records everything that the eyes see, and what the window shows of it. The views that it is to be shown by, asked for
/// at the end.
fn paint(
    (painter, panel, gpu): (&mut Painter, &mut Panel, &Arc<Gpu>),
    frame: &mut Frame,
    xr_frame: &mut xr::Frame<'_>,
    viewing: &Viewing<'_>,
    watch: &mut Stopwatch,
) -> Result<xr::Views> {
    let Viewing { standpoint, rig, head, seat, hands, images } = viewing;
    let placed = Placed { scene_from_play: rig.scene_from_play(head), extent: images.extent };
    painter.place_aids(gpu, frame.index, hands, &placed)?;
    let target = EyeTarget {
        extent: images.extent,
        colour_image: images.color.image,
        colour: images.color.both,
        colour_of_eye: images.color.per_eye,
        depth_image: images.depth.image,
        depth: images.depth.both,
        depth_of_eye: images.depth.per_eye,
        depth_is_read: images.depth.layout != vk::ImageLayout::UNDEFINED,
    };
    let behind = painter.draw_sky(frame, xr_frame, standpoint, rig)?;
    if behind == Behind::Open {
        // Scene axes to the play space's: the backdrop is along the terrain's axes, and the rig turns the play space.
        xr_frame.show_cube(rig.orientation.conjugate());
    }
    painter.record(frame, images, &target, behind);
    painter.keep(frame, images, &target);
    panel.draw(frame, xr_frame, &target, seat)?;
    panel.draw_in_mirror(frame, painter.mirror.as_ref(), painter.mirrored);

    // The eyes are asked for again, as late as can be: nearer to the display, the prediction is better.
    watch.lap(Span::Record);
    let views = xr_frame.locate_views()?;
    watch.lap(Span::Xr);
    // The tiles are placed around the head as it was: the eyes have moved from there.
    let (_, eyes) = plain(&views);
    let views_of_scene = [0, 1].map(|i| View {
        scene_from_view: rig.scene_from_view(head, &eyes[i]),
        clip_from_view: views.eyes[i].fov.clip_from_view(NEAR_M),
    });
    painter.set_sight(frame.index, standpoint, rig, views_of_scene);
    panel.set_views(frame.index, &views.eyes, seat);
    watch.lap(Span::Record);
    Ok(views)
}

/// The same with positions in metres from the seat.
fn from_seat(mut hands: Hands, seat: Option<Pose>) -> Hands {
    let from_seat = |pose: Option<Pose>| {
        pose.zip(seat).map(|(pose, seat)| Pose { position: pose.position - seat.position, ..pose })
    };
    for hand in &mut hands.hands {
        (hand.aim, hand.grip) = (from_seat(hand.aim), from_seat(hand.grip));
    }
    hands
}

fn rig(standpoint: &Standpoint<'_>, seat: &Pose, worn: bool) -> Rig {
    Rig {
        seat: seat.position,
        position: standpoint.position,
        orientation: if worn { standpoint.heading } else { standpoint.orientation },
        metres_per_tile: COMFORT_M / standpoint.height,
    }
}
