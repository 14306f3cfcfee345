//! A session: made, polled through its states, ended. Its frames are in `frame.rs`.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ash::vk;
use openxr::{EnvironmentBlendMode, SessionState};

use super::actions::Actions;
use super::cube::Cube;
use super::error::{Error, Lost};
use super::frame::Step;
use super::outcome::Outcome;
use super::quad::Quad;
use super::raw::{Event, RawSession};
use super::runtime::{EyeSize, Runtime};
use super::space::{Origin, Spaces};
use super::swapchain::{DEPTH_FORMAT, DepthImages, Swapchain, Use, choose_color};
use super::view::{LastGood, Views};
use crate::bindings::{Bound, ProfileBindings};
use crate::gpu::Gpu;

/// Events handled per poll; a runtime that sends more than these at once gets the rest of them read next time.
const EVENTS_PER_POLL: usize = 64;

/// How long a runtime that was asked to exit may stay silent, after the session has ended, before it counts as exited.
const EXIT_PATIENCE: Duration = Duration::from_secs(1);

/// Height of the eyes above the floor until they are tracked, in metres.
const EYE_HEIGHT_M: f32 = 1.6;

/// What the caller wants of a session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SessionConfig {
    /// Pixels per eye, `[width, height]`; `None` takes what the runtime recommends. Brought into the runtime's limits.
    pub eye_size: Option<[u32; 2]>,
    /// Distance at which depth is 1, in metres; > 0.
    pub near_m: f32,
    /// Draw both eyes in one pass where the device can; otherwise, and when false, a pass per eye.
    pub multiview: bool,
    /// Ask which parts of the pictures nobody sees ([`Session::hidden_areas`]).
    pub mask: bool,
    /// Display rate to ask for, in Hz: the nearest that the headset has. `None` leaves it as it is.
    pub refresh_hz: Option<f32>,
}

impl Default for SessionConfig {
    /// What the runtime recommends, whole pictures, near plane at 5 cm, both eyes in one pass.
    fn default() -> Self {
        Self { eye_size: None, near_m: 0.05, multiview: true, mask: false, refresh_hz: None }
    }
}

/// Where the session is in its life, and so what to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// No frames are wanted (the headset sleeps): poll again in about 100 ms.
    Idle,
    /// Frames are wanted: `wait_frame`, `begin_frame`, `Frame::end`.
    Running(Shown),
    /// It is over, by request or by the wearer's wish: drop the session.
    Exited,
}

/// What the wearer has of a running session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// Nothing: frames keep the rhythm only.
    Hidden,
    /// Sees it, and the input goes elsewhere (a menu is open).
    Visible,
    /// Sees and steers it.
    Focused,
}

/// What the session settled on; plain data for reports and for the renderer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SessionInfo {
    /// Pixels of each eye; both have the same.
    pub extent: vk::Extent2D,
    /// Format of the colour images.
    pub color_format: vk::Format,
    /// The format does not encode sRGB by itself: the shader has to.
    pub encode_srgb: bool,
    /// Format of the depth images.
    pub depth_format: vk::Format,
    /// Depth goes to the runtime with every frame.
    pub depth_submitted: bool,
    /// Draw in one pass over both layers (`Surface::both`); else one pass per eye (`Surface::per_eye`).
    pub multiview: bool,
    /// Distance at which depth is 1, in metres.
    pub near_m: f32,
}

/// Oddities of the runtime seen so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Oddities {
    /// Frames that the runtime discarded because they were never ended.
    pub frames_discarded: u32,
    /// Frames without a picture because the runtime did not give an image back in time.
    pub images_late: u32,
    /// Events that the runtime dropped.
    pub events_lost: u32,
}

/// How long a session may stand still that the runtime says does not run without an event that says so, too.
const DOUBT_PATIENCE: Duration = Duration::from_millis(250);

/// A session with the headset. Dropping it ends the frame that is open, waits for the GPU and destroys everything.
pub struct Session {
    pub(super) step: Step,
    pub(super) last: LastGood,
    pub(super) oddities: Oddities,
    pub(super) blend: EnvironmentBlendMode,
    pub(super) info: SessionInfo,
    /// Pixels of each eye's image that are drawn and shown, from its corner.
    pub(super) drawn: vk::Extent2D,
    /// What is hidden has to be asked.
    pub(super) mask_due: bool,
    pub(super) asks_for_mask: bool,
    origin_moves: u32,
    life: Life,
    // Dropped in this order: images, spaces, then the session itself.
    pub(super) color: Swapchain,
    pub(super) depth: DepthImages,
    pub(super) cube: Option<Cube>,
    pub(super) quad: Option<Quad>,
    pub(super) actions: Option<Actions>,
    pub(super) spaces: Spaces,
    pub(super) raw: Arc<RawSession>,
}

/// The part of the session's life that events change.
#[derive(Debug, Clone, Copy)]
struct Life {
    state: SessionState,
    /// Between `xrBeginSession` and `xrEndSession`.
    begun: bool,
    /// The same, and no call has said otherwise: frames are wanted.
    running: bool,
    exit_requested: bool,
    /// When it last stopped running.
    ended: Option<Instant>,
    /// When a call said, and no event yet, that it does not run.
    doubted: Option<Instant>,
    /// Somebody wears the headset, as far as is known.
    worn: bool,
    /// Announced by an event; nothing else is said from then on.
    lost: Option<Lost>,
}

impl Session {
    /// A session on the headset of `runtime`, drawing with `gpu`, which must have been made through the same runtime.
    ///
    /// # Errors
    /// `Unsupported` when the runtime takes no colour format in use; losses and refusals as everywhere.
    pub fn new(runtime: &Runtime, gpu: &Arc<Gpu>, config: SessionConfig) -> Result<Self, Error> {
        let about = runtime.info();
        let raw = Arc::new(RawSession::new(runtime, Arc::clone(gpu))?);
        let spaces = Spaces::new(&raw)?;
        let formats = raw.swapchain_formats()?;
        let (color_format, encode_srgb) = choose_color(&formats)?;
        let depth_submitted = about.depth_layer && formats.contains(&DEPTH_FORMAT);
        let extent = choose_extent(&about.eyes, about.max_image, config.eye_size);
        let color = Swapchain::new(&raw, Use::Color, color_format, extent)?;
        let depth = DepthImages::new(&raw, depth_submitted, extent)?;
        let info = SessionInfo {
            extent,
            color_format,
            encode_srgb,
            depth_format: DEPTH_FORMAT,
            depth_submitted,
            multiview: config.multiview && gpu.info.multiview,
            near_m: config.near_m,
        };
        tracing::info!(?info, runtime = about.name, headset = about.headset, "OpenXR session made");
        let asks_for_mask = config.mask && about.visibility_mask;
        ask_for_speed(&raw, config.refresh_hz)?;
        let eye_height_m = if spaces.origin() == Origin::Floor { EYE_HEIGHT_M } else { 0.0 };
        Ok(Self {
            step: Step::Between,
            last: LastGood::new(eye_height_m),
            oddities: Oddities::default(),
            blend: runtime.blend,
            info,
            drawn: extent,
            mask_due: asks_for_mask,
            asks_for_mask,
            origin_moves: 0,
            life: Life {
                state: SessionState::UNKNOWN,
                begun: false,
                running: false,
                exit_requested: false,
                ended: None,
                doubted: None,
                worn: true,
                lost: None,
            },
            color,
            depth,
            cube: None,
            quad: None,
            actions: None,
            spaces,
            raw,
        })
    }

    /// Makes a cubemap of `side` texels per face for the runtime to show behind the eyes' pictures: [`Frame::acquire_cube`]
    /// draws into it, [`Frame::show_cube`] shows it. False where the runtime has no such layer or takes no cubemaps,
    /// which is no error: the session is as it was. `runtime` is the one that the session was made on.
    ///
    /// [`Frame::acquire_cube`]: super::Frame::acquire_cube
    /// [`Frame::show_cube`]: super::Frame::show_cube
    ///
    /// # Errors
    /// Losses, and refusals other than of the cubemap itself.
    pub fn open_cube(&mut self, runtime: &Runtime, side: u32) -> Result<bool, Error> {
        let about = runtime.info();
        if !about.cube_layer {
            tracing::info!("the OpenXR runtime has no cube layer (XR_KHR_composition_layer_cube)");
            return Ok(false);
        }
        let limit = about.max_image.into_iter().filter(|&l| l > 0).min().unwrap_or(u32::MAX);
        let side = side.clamp(1, limit);
        match Cube::new(&self.raw, self.info.color_format, side) {
            Ok(cube) => self.cube = Some(cube),
            Err(Error::Call { call: "xrCreateSwapchain", code }) => {
                tracing::info!(
                    "the OpenXR runtime offers the cube layer, and makes no cubemap for it ({code})"
                );
            }
            Err(error) => return Err(error),
        }
        Ok(self.cube.is_some())
    }

    /// Reads controllers and hands from now on, bound like this. Once in a session, and where the runtime refuses it, the
    /// hands do nothing. `runtime` is the one that the session was made on.
    ///
    /// # Errors
    /// Losses.
    pub fn open_hands(&mut self, runtime: &Runtime, bindings: &[ProfileBindings]) -> Result<(), Error> {
        let known = bindings.iter().filter(|profile| runtime.knows(profile));
        self.actions = Actions::new(&self.raw, known)?;
        Ok(())
    }

    /// The interaction profiles of what the hands hold, left and right, such as
    /// `/interaction_profiles/khr/simple_controller`.
    pub fn interaction_profiles(&self) -> [Option<&str>; 2] {
        self.actions.as_ref().map_or([None; 2], Actions::profiles)
    }

    /// What is bound to each action, in the runtime's words, and another number each time that may have changed.
    pub fn bound(&self) -> (&[Bound], u32) {
        self.actions.as_ref().map_or((&[], 0), Actions::bound)
    }

    /// Lets a hand (0: left, 1: right) feel a tick of an amplitude from 0 to 1.
    ///
    /// # Errors
    /// Losses.
    pub fn pulse(&self, hand: usize, amplitude: f32) -> Result<(), Error> {
        self.actions.as_ref().map_or(Ok(()), |actions| actions.pulse(hand, amplitude.clamp(0.0, 1.0)))
    }

    /// Texels per side of the faces of the cube layer, if there is one.
    pub fn cube_side(&self) -> Option<u32> {
        self.cube.as_ref().map(|cube| cube.side)
    }

    /// What the session settled on.
    pub fn info(&self) -> &SessionInfo {
        &self.info
    }

    /// Pixels of each eye's image that are drawn and shown, from its corner.
    pub fn drawn(&self) -> vk::Extent2D {
        self.drawn
    }

    /// From the next frame on only so many pixels of each eye's image are drawn and shown, from its corner: at least one,
    /// at most all.
    pub fn set_drawn(&mut self, extent: vk::Extent2D) {
        let all = self.info.extent;
        self.drawn = vk::Extent2D {
            width: extent.width.clamp(1, all.width),
            height: extent.height.clamp(1, all.height),
        };
    }

    /// Where the origin of all poses is. May change from `Eyes` to `FloorFromStage` in the first frames.
    pub fn origin(&self) -> Origin {
        self.spaces.origin()
    }

    /// How often that origin has moved in the room: poses from before a move and from after it have nothing to do with
    /// each other. It counts in [`Session::wait_frame`], with the first frame that the move applies to.
    pub fn origin_moves(&self) -> u32 {
        self.origin_moves
    }

    /// False while the runtime says that nobody wears the headset (`XR_EXT_user_presence`).
    pub fn is_worn(&self) -> bool {
        self.life.worn
    }

    /// Oddities of the runtime seen so far.
    pub fn oddities(&self) -> Oddities {
        self.oddities
    }

    /// Handles what the runtime has to say, beginning and ending the session as it asks. Call it once per frame, and
    /// every 100 ms or so while idle.
    ///
    /// # Errors
    /// `Lost` when the session or the instance is gone or about to go.
    pub fn poll(&mut self) -> Result<Phase, Error> {
        for _ in 0..EVENTS_PER_POLL {
            let Some(event) = self.raw.poll_event()? else {
                break;
            };
            self.handle(event)?;
        }
        if self.life.doubted.is_some_and(|since| since.elapsed() > DOUBT_PATIENCE) {
            tracing::warn!("the OpenXR runtime refuses frames and does not say why");
            self.lose(Lost::Session);
        }
        if self.raw.loss_pending() {
            self.lose(Lost::Session);
        }
        match self.life.lost {
            Some(lost) => Err(lost.into()),
            None => Ok(self.phase()),
        }
    }

    /// Where the session is in its life, as of the last poll.
    pub fn phase(&self) -> Phase {
        let life = &self.life;
        if life.state == SessionState::EXITING {
            return Phase::Exited;
        }
        if life.running {
            return Phase::Running(match life.state {
                SessionState::VISIBLE => Shown::Visible,
                SessionState::FOCUSED => Shown::Focused,
                _ => Shown::Hidden,
            });
        }
        // Nothing to end, or a runtime that forgets to say EXITING.
        let silent = life.ended.is_none_or(|ended| ended.elapsed() > EXIT_PATIENCE);
        if life.exit_requested && silent { Phase::Exited } else { Phase::Idle }
    }

    /// Asks the runtime to end the session. Go on polling and, while it runs, drawing frames until `Phase::Exited`.
    ///
    /// # Errors
    /// Losses and refusals.
    pub fn request_exit(&mut self) -> Result<(), Error> {
        let first = !std::mem::replace(&mut self.life.exit_requested, true);
        if !first || !self.life.running {
            return Ok(());
        }
        let asked = self.raw.request_exit();
        match self.heed(asked) {
            // It is being stopped already.
            Err(error) if error.outcome() == Outcome::Idle => Ok(()),
            result => result,
        }
    }

    /// Both eyes at a display time in nanoseconds, in the session's space. What the runtime does not know is the last
    /// good value, and said so in [`Views::tracking`].
    ///
    /// # Errors
    /// Losses and refusals.
    pub fn locate_views(&mut self, display_time_ns: i64) -> Result<Views, Error> {
        let (flags, located) = self.raw.locate_views(display_time_ns, self.spaces.base())?;
        Ok(self.last.update(flags, &located))
    }

    pub(super) fn is_running(&self) -> bool {
        self.life.running
    }

    fn stopped(&mut self) {
        self.life.running = false;
        self.life.ended = Some(Instant::now());
    }

    /// Passes a call's answer on. Where it says that the session does not run after all, frames end until an event says
    /// more, and where none does within [`DOUBT_PATIENCE`], the session counts as lost.
    pub(super) fn heed<T>(&mut self, answer: Result<T, Error>) -> Result<T, Error> {
        if let Err(error) = &answer
            && error.outcome() == Outcome::Idle
        {
            tracing::debug!("the session does not run: {error}");
            self.stopped();
            self.life.doubted = Some(Instant::now());
        }
        answer
    }

    /// Takes note of where the origin is at a frame's display time. Between frames only.
    pub(super) fn settle_origin(&mut self, display_time_ns: i64) -> Result<(), Error> {
        if self.spaces.recentred(display_time_ns) {
            self.origin_moves += 1;
        }
        if let Some(raised_m) = self.spaces.settle(display_time_ns)? {
            tracing::info!("the floor is {:.2} m from where it was taken to be", raised_m);
            self.last.origin_raised(raised_m);
            self.origin_moves += 1;
        }
        Ok(())
    }

    /// No more frames; the graver loss stands.
    fn lose(&mut self, lost: Lost) {
        self.life.running = false;
        if self.life.lost != Some(Lost::Instance) {
            self.life.lost = Some(lost);
        }
    }

    fn handle(&mut self, event: Event) -> Result<(), Error> {
        match event {
            Event::State(state) => self.enter(state)?,
            Event::InstanceLossPending => self.lose(Lost::Instance),
            Event::SpaceChange(kind, time_ns) => {
                tracing::info!("the OpenXR runtime moves the origin of {kind:?}");
                self.spaces.changes(kind, time_ns);
            }
            Event::EventsLost(count) => {
                tracing::warn!("the OpenXR runtime dropped {count} events");
                self.oddities.events_lost = self.oddities.events_lost.saturating_add(count);
            }
            Event::MaskChanged => self.mask_due = self.asks_for_mask,
            Event::Presence(worn) => {
                tracing::info!("the headset is {}", if worn { "on" } else { "off" });
                self.life.worn = worn;
            }
            Event::ProfilesChanged => {
                if let Some(actions) = &mut self.actions {
                    actions.note_profiles()?;
                }
            }
            Event::RefreshRate(hz) => tracing::info!("the headset's display runs at {hz} Hz now"),
            Event::Other(ty) => tracing::debug!("OpenXR event {ty} needs nothing"),
        }
        Ok(())
    }

    fn enter(&mut self, state: SessionState) -> Result<(), Error> {
        tracing::debug!("OpenXR session: {:?} -> {state:?}", self.life.state);
        let known = [
            SessionState::IDLE,
            SessionState::READY,
            SessionState::SYNCHRONIZED,
            SessionState::VISIBLE,
            SessionState::FOCUSED,
            SessionState::STOPPING,
            SessionState::EXITING,
        ];
        let doubted = self.life.doubted.take().is_some();
        match state {
            SessionState::READY if !self.life.exit_requested && !self.life.running => {
                let begun = self.raw.begin_session();
                match self.heed(begun) {
                    Ok(()) => (self.life.begun, self.life.running) = (true, true),
                    // It changed its mind meanwhile; the event that says so is on its way.
                    Err(error) if error.outcome() == Outcome::Idle => {}
                    Err(error) => return Err(error),
                }
            }
            SessionState::STOPPING if std::mem::take(&mut self.life.begun) => {
                self.close_frame();
                self.stopped();
                match self.raw.end_session() {
                    Err(error) if error.outcome() == Outcome::GoOn => {}
                    result => result?,
                }
            }
            SessionState::LOSS_PENDING => self.lose(Lost::Session),
            // It does run after all.
            SessionState::SYNCHRONIZED | SessionState::VISIBLE | SessionState::FOCUSED if doubted => {
                self.life.running = self.life.begun;
            }
            _ => {}
        }
        if known.contains(&state) {
            self.life.state = state;
        }
        Ok(())
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.close_frame();
        self.raw.wait_gpu_idle();
    }
}

/// Asks the runtime for a display rate and for clock rates that last, as far as it lets itself be asked.
fn ask_for_speed(raw: &RawSession, wanted_hz: Option<f32>) -> Result<(), Error> {
    let rate = |wanted: f32| {
        let rates = raw.refresh_rates()?;
        let off = |hz: &f32| (hz - wanted).abs();
        let Some(nearest) = rates.into_iter().min_by(|a, b| off(a).total_cmp(&off(b))) else {
            tracing::info!("the OpenXR runtime lets nobody choose the display's rate");
            return Ok(());
        };
        tracing::info!("asking for a display rate of {nearest} Hz ({wanted} wanted)");
        raw.request_refresh_rate(nearest)
    };
    for answer in [wanted_hz.map_or(Ok(()), rate), raw.request_sustained_performance()] {
        match answer {
            Err(error) if error.outcome() == Outcome::GoOn => {
                tracing::warn!("going on all the same: {error}")
            }
            answer => answer?,
        }
    }
    Ok(())
}

/// One size for both eyes, so that one multiview pass always serves: where the runtime wants different ones, the larger
/// width and height of both, as far as it takes them for either. The fields of view keep the pictures true; the smaller eye
/// merely gets a few pixels more than it needs.
fn choose_extent(eyes: &[EyeSize; 2], max_image: [u32; 2], wanted: Option<[u32; 2]>) -> vk::Extent2D {
    let side = |i: usize| {
        let recommended = eyes[0].recommended[i].max(eyes[1].recommended[i]);
        // A limit of zero is a runtime that forgot to say.
        let limits = [eyes[0].max[i], eyes[1].max[i], max_image[i]];
        let limit = limits.into_iter().filter(|&l| l > 0).min().unwrap_or(u32::MAX);
        wanted.map_or(recommended, |w| w[i]).clamp(1, limit)
    };
    vk::Extent2D { width: side(0), height: side(1) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEFT: EyeSize = EyeSize { recommended: [1000, 1200], max: [2000, 2000] };
    const RIGHT: EyeSize = EyeSize { recommended: [1100, 1000], max: [1500, 2400] };
    const LARGE: [u32; 2] = [8192, 8192];

    fn extent(width: u32, height: u32) -> vk::Extent2D {
        vk::Extent2D { width, height }
    }

    #[test]
    fn both_eyes_get_the_larger_size_within_both_limits() {
        assert_eq!(choose_extent(&[LEFT, LEFT], LARGE, None), extent(1000, 1200));
        assert_eq!(choose_extent(&[LEFT, RIGHT], LARGE, None), extent(1100, 1200));
        assert_eq!(choose_extent(&[LEFT, RIGHT], [1050, 900], None), extent(1050, 900));
    }

    #[test]
    fn a_wish_is_brought_into_the_limits() {
        assert_eq!(choose_extent(&[LEFT, RIGHT], LARGE, Some([512, 256])), extent(512, 256));
        assert_eq!(choose_extent(&[LEFT, RIGHT], LARGE, Some([9999, 0])), extent(1500, 1));
        let unsaid = EyeSize { recommended: [640, 480], max: [0, 0] };
        assert_eq!(choose_extent(&[unsaid, unsaid], [0, 0], None), extent(640, 480));
    }
}
