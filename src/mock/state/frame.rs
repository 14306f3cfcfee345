//! The frame loop: wait, begin, end; pacing; and what the runtime keeps of each frame.

use std::{
    collections::VecDeque,
    sync::PoisonError,
    thread,
    time::{Duration, Instant},
};

use glam::Quat;
use openxr::sys;

use super::{
    Shared, State,
    layer::{Layer, LayerCube, LayerCylinder, LayerQuad, LayerView},
    player::Moment,
    space::{EyeView, check_time},
};
use crate::mock::{
    config::Timing,
    fault::{Outcome, misuse, require},
    graphics::{ImageSpec, Region},
    pose::{Fov, Pose},
    record::{
        SubmittedCube, SubmittedCylinder, SubmittedDepth, SubmittedFrame, SubmittedQuad, SubmittedView,
        depth_from_texels, rgba_from_texels,
    },
    timeline::Slot,
};

/// A second xrWaitFrame waits this long for the first one's xrBeginFrame before the mock gives up on it.
const PATIENCE: Duration = Duration::from_secs(10);

/// Display times kept, so that a time can be told to belong to a frame.
const REMEMBERED: usize = 64;

/// One frame, from xrWaitFrame on.
#[derive(Clone, Copy)]
struct Ticket {
    index: u64,
    /// As predicted to the application.
    display_ns: i64,
    should_render: bool,
}

pub struct FrameLoop {
    /// How often the session has begun.
    run: u64,
    /// A thread sleeps in xrWaitFrame.
    waiting: bool,
    /// Waited for, not begun.
    waited: Option<Ticket>,
    begun: Option<Ticket>,
    last_display_ns: i64,
    last_predicted_ns: i64,
    /// Frames waited for since the session was created.
    count: u64,
    /// Display times and indices of the last frames, oldest first.
    recent: VecDeque<(i64, u64)>,
    /// What the last calls of xrLocateViews answered, oldest first.
    located: VecDeque<Located>,
}

/// What an xrLocateViews answered.
struct Located {
    time_ns: i64,
    space: sys::Space,
    eyes: [EyeView; 2],
}

impl FrameLoop {
    pub fn new() -> Self {
        Self {
            run: 0,
            waiting: false,
            waited: None,
            begun: None,
            last_display_ns: 0,
            last_predicted_ns: 0,
            count: 0,
            recent: VecDeque::with_capacity(REMEMBERED),
            located: VecDeque::with_capacity(REMEMBERED),
        }
    }

    /// xrBeginSession starts the order of calls anew.
    pub fn restart(&mut self) {
        self.run += 1;
        self.waiting = false;
        self.waited = None;
        self.begun = None;
    }

    /// Remembers what an xrLocateViews answered.
    pub fn located(&mut self, time: sys::Time, space: sys::Space, eyes: [EyeView; 2]) {
        if self.located.len() == REMEMBERED {
            self.located.pop_front();
        }
        self.located.push_back(Located { time_ns: time.as_nanos(), space, eyes });
    }

    /// Whether views are those that the last xrLocateViews for this time and space answered, to the last bit.
    fn are_as_located(&self, time: sys::Time, space: sys::Space, views: &[LayerView; 2]) -> bool {
        let mut answers = self.located.iter().rev();
        let answer = answers.find(|it| it.time_ns == time.as_nanos() && it.space == space);
        let same = |view: &LayerView, eye: &EyeView| {
            pose_bits(view.pose) == pose_bits(eye.pose.to_xr())
                && fov_bits(view.fov) == fov_bits(eye.fov.to_xr())
        };
        answer.is_some_and(|it| views.iter().zip(&it.eyes).all(|(view, eye)| same(view, eye)))
    }

    /// The frame that is on the display at a time, with frames of `period_ns` before and after those remembered.
    pub fn index_at(&self, time_ns: i64, period_ns: i64) -> u64 {
        let before = self.recent.iter().rev().find(|(display_ns, _)| *display_ns <= time_ns);
        let Some((display_ns, index)) = before.or(self.recent.front()) else { return 0 };
        let more = ((time_ns - display_ns) as f64 / period_ns as f64).round() as i64;
        index.saturating_add_signed(more)
    }
}

fn pose_bits(pose: sys::Posef) -> [u32; 7] {
    let sys::Posef { orientation: q, position: p } = pose;
    [q.x, q.y, q.z, q.w, p.x, p.y, p.z].map(f32::to_bits)
}

fn fov_bits(fov: sys::Fovf) -> [u32; 4] {
    [fov.angle_left, fov.angle_right, fov.angle_up, fov.angle_down].map(f32::to_bits)
}

/// The frame an xrWaitFrame waits for.
struct Reserved {
    slot: Slot,
    predicted_ns: i64,
    period_ns: i64,
}

/// What xrWaitFrame answers.
pub struct Prediction {
    pub display_ns: i64,
    pub period_ns: i64,
    pub should_render: bool,
}

/// Blocks until the previous frame has begun and the next one is due. The lock is not held while it sleeps.
pub fn wait_frame(shared: &Shared, session: sys::Session) -> Outcome<Prediction> {
    let deadline = Instant::now() + PATIENCE;
    let mut state = shared.lock();
    let (reserved, run) = loop {
        let frames = &state.running(session)?.frames;
        if !frames.waiting && frames.waited.is_none() {
            break (state.reserve_frame(session)?, state.run_of(session)?);
        }
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(misuse(
                sys::Result::ERROR_RUNTIME_FAILURE,
                "xrWaitFrame was called again, and nobody has begun the frame it was called for before",
            ));
        }
        state = shared.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
    };
    drop(state);
    if let Some(wake) = reserved.slot.wake {
        thread::sleep(wake.saturating_duration_since(Instant::now()));
    }
    let mut state = shared.lock();
    let prediction = state.finish_wait(session, &reserved, run);
    drop(state);
    shared.changed.notify_all();
    prediction
}

impl State {
    fn run_of(&mut self, session: sys::Session) -> Outcome<u64> {
        Ok(self.running(session)?.frames.run)
    }

    fn reserve_frame(&mut self, handle: sys::Session) -> Outcome<Reserved> {
        let count = self.frames_waited;
        self.frames_waited += 1;
        if !self.player.is_done() {
            self.play_due(Moment::Frame { count });
        }
        let timing = self.timing_of_next(handle)?;
        let periods = match timing {
            Some(Timing::Late { periods } | Timing::Every { periods }) => periods,
            _ => 1,
        };
        let last_display_ns = self.sessions.get(handle)?.frames.last_display_ns;
        let slot = self.timeline.next_slot(last_display_ns, periods);
        let period_ns = match timing {
            Some(Timing::Every { periods }) => self.timeline.period_ns * i64::from(periods.max(1)),
            _ => self.timeline.period_ns,
        };
        let predicted_ns = self.predict(handle, timing, slot.display_ns)?;
        let session = self.sessions.get_mut(handle)?;
        let frames = &mut session.frames;
        frames.waiting = true;
        frames.last_display_ns = slot.display_ns;
        frames.last_predicted_ns = predicted_ns;
        if frames.recent.len() == REMEMBERED {
            frames.recent.pop_front();
        }
        frames.recent.push_back((slot.display_ns, frames.count));
        session.script_start_ns.get_or_insert(slot.display_ns);
        if !self.player.is_done() {
            self.play_due(Moment::Display { display_ns: slot.display_ns });
        }
        Ok(Reserved { slot, predicted_ns, period_ns })
    }

    /// The timing of a session's next frame: told from outside, or configured.
    fn timing_of_next(&self, handle: sys::Session) -> Outcome<Option<Timing>> {
        let count = self.sessions.get(handle)?.frames.count;
        let configured = || self.config.timing.iter().find(|span| span.frames.contains(&count));
        Ok(self.timing.or_else(|| configured().map(|span| span.timing)))
    }

    /// What the application is told of when a frame is displayed.
    fn predict(&mut self, handle: sys::Session, timing: Option<Timing>, display_ns: i64) -> Outcome<i64> {
        let whim = self.next_whim();
        let last_ns = self.sessions.get(handle)?.frames.last_predicted_ns;
        Ok(match timing {
            Some(Timing::Jitter { most_ns }) => {
                // Less than half a period: so neighbours cannot change places.
                let most = i64::from(most_ns).min(self.timeline.period_ns / 2 - 1);
                display_ns - most + (whim % (2 * most.unsigned_abs() + 1)) as i64
            }
            Some(Timing::Ahead { ns }) => display_ns.saturating_add(ns),
            Some(Timing::Frozen) if last_ns > 0 => last_ns,
            _ => display_ns,
        })
    }

    fn finish_wait(&mut self, handle: sys::Session, reserved: &Reserved, run: u64) -> Outcome<Prediction> {
        let rendering = self.rendering;
        // However the wait ends, it has ended; unless a new run of the session has begun to wait meanwhile.
        if let Ok(session) = self.sessions.get_mut(handle)
            && session.frames.run == run
        {
            session.frames.waiting = false;
        }
        let session = self.running(handle)?;
        require!(
            session.frames.run == run,
            ERROR_SESSION_NOT_RUNNING,
            "the session ended while xrWaitFrame waited"
        );
        let (index, visible) = (session.frames.count, session.is_visible() && session.graphics.is_some());
        let skipped = |config: &crate::mock::config::MockConfig| {
            config.skip_rendering.iter().any(|run| run.contains(&index))
        };
        let should_render = visible && rendering.unwrap_or(!skipped(&self.config));
        let (display_ns, period_ns) = (reserved.predicted_ns, reserved.period_ns);
        let frames = &mut self.sessions.get_mut(handle)?.frames;
        frames.count += 1;
        frames.waited = Some(Ticket { index, display_ns, should_render });
        Ok(Prediction { display_ns, period_ns, should_render })
    }

    pub fn begin_frame(&mut self, handle: sys::Session) -> Outcome<sys::Result> {
        let frames = &mut self.running(handle)?.frames;
        let Some(ticket) = frames.waited.take() else {
            return Err(misuse(
                sys::Result::ERROR_CALL_ORDER_INVALID,
                "xrBeginFrame without an xrWaitFrame before it",
            ));
        };
        if frames.begun.replace(ticket).is_some() {
            return Ok(sys::Result::FRAME_DISCARDED);
        }
        Ok(self.success(handle))
    }

    /// What xrEndFrame needs before its layers are looked at.
    pub fn check_frame_begun(&mut self, handle: sys::Session) -> Outcome<()> {
        require!(
            self.running(handle)?.frames.begun.is_some(),
            ERROR_CALL_ORDER_INVALID,
            "xrEndFrame without an xrBeginFrame before it"
        );
        Ok(())
    }

    pub fn end_frame(
        &mut self,
        handle: sys::Session,
        time: sys::Time,
        blend: sys::EnvironmentBlendMode,
        layers: &[Layer],
    ) -> Outcome<sys::Result> {
        check_time(time)?;
        require!(
            blend == sys::EnvironmentBlendMode::OPAQUE,
            ERROR_ENVIRONMENT_BLEND_MODE_UNSUPPORTED,
            "blend mode {:?} is not supported, only OPAQUE",
            blend
        );
        for layer in layers {
            self.check_layer(handle, layer)?;
        }
        self.keep_frame(handle, time, layers)?;
        self.sessions.get_mut(handle)?.frames.begun = None;
        self.rise(handle)?;
        Ok(self.success(handle))
    }

    /// Records the frame, with its pixels if they are wanted. The oldest record's memory is used again.
    fn keep_frame(&mut self, handle: sys::Session, time: sys::Time, layers: &[Layer]) -> Outcome<()> {
        let Some(ticket) = self.sessions.get(handle)?.frames.begun else {
            return Ok(());
        };
        let mut frame = SubmittedFrame::default();
        while self.frames.len() >= self.config.keep_frames.max(1) {
            frame = self.frames.pop_front().unwrap_or_default();
        }
        let mut views = frame.views;
        views.clear();
        let first = layers.iter().find_map(|layer| match layer {
            Layer::Projection { space, flags, views } => Some((*space, *flags, views)),
            _ => None,
        });
        let (flags, projection) = first.map(|(_, flags, views)| (flags, views)).unzip();
        let frames = &self.sessions.get(handle)?.frames;
        let as_located = first.map(|(space, _, views)| frames.are_as_located(time, space, views));
        for view in projection.into_iter().flatten() {
            views.push(SubmittedView {
                pose: Pose::from_xr(view.pose),
                fov: Fov::from_xr(view.fov),
                offset: [view.image.image_rect.offset.x, view.image.image_rect.offset.y],
                size: size_of(&view.image),
                array_index: view.image.image_array_index,
                rgba: Vec::new(),
                depth: view.depth.map(|depth| SubmittedDepth {
                    size: size_of(&depth.image),
                    min_depth: depth.min_depth,
                    max_depth: depth.max_depth,
                    near_z: depth.near_z,
                    far_z: depth.far_z,
                    values: Vec::new(),
                }),
            });
        }
        if let Some(projection) = projection
            && self.config.read_back
        {
            self.read_back(handle, projection, &mut views)?;
        }
        let cube = self.keep_cube(handle, layers)?;
        self.journal.frames_submitted += 1;
        self.journal.frames_with_projection += u64::from(projection.is_some());
        self.journal.frames_as_located += u64::from(as_located == Some(true));
        let (mut quads, mut cylinders) = (frame.quads, frame.cylinders);
        quads.clear();
        cylinders.clear();
        for (i, layer) in layers.iter().enumerate() {
            match layer {
                Layer::Quad { flags, quad, .. } => {
                    quads.push(self.keep_quad(handle, i as u32, *flags, quad)?);
                }
                Layer::Cylinder { flags, cylinder, .. } => {
                    cylinders.push(self.keep_cylinder(handle, i as u32, *flags, cylinder)?);
                }
                _ => {}
            }
        }
        self.frames.push_back(SubmittedFrame {
            index: ticket.index,
            display_time_ns: time.as_nanos(),
            predicted_display_time_ns: ticket.display_ns,
            script_time_s: self.script_time_s(handle, ticket.display_ns),
            should_render: ticket.should_render,
            layer_count: layers.len() as u32,
            projection_flags: flags.unwrap_or_default(),
            as_located,
            views,
            cube,
            quads,
            cylinders,
        });
        Ok(())
    }

    fn keep_quad(
        &mut self,
        handle: sys::Session,
        layer: u32,
        flags: sys::CompositionLayerFlags,
        quad: &LayerQuad,
    ) -> Outcome<SubmittedQuad> {
        Ok(SubmittedQuad {
            layer,
            flags,
            eyes: quad.eyes,
            pose: Pose::from_xr(quad.pose),
            size_m: [quad.size.width, quad.size.height],
            pixels: size_of(&quad.image),
            rgba: self.read_one(handle, &quad.image)?,
        })
    }

    fn keep_cylinder(
        &mut self,
        handle: sys::Session,
        layer: u32,
        flags: sys::CompositionLayerFlags,
        cylinder: &LayerCylinder,
    ) -> Outcome<SubmittedCylinder> {
        Ok(SubmittedCylinder {
            layer,
            flags,
            eyes: cylinder.eyes,
            pose: Pose::from_xr(cylinder.pose),
            radius_m: cylinder.radius,
            central_angle: cylinder.central_angle,
            aspect_ratio: cylinder.aspect_ratio,
            pixels: size_of(&cylinder.image),
            rgba: self.read_one(handle, &cylinder.image)?,
        })
    }

    /// The pixels of one sub-image, if they are wanted.
    fn read_one(&mut self, handle: sys::Session, image: &sys::SwapchainSubImage) -> Outcome<Vec<u8>> {
        if !self.config.read_back {
            return Ok(Vec::new());
        }
        let region = self.region(image)?;
        let texels = self.sessions.get_mut(handle)?.graphics_mut()?.read(&[region])?;
        Ok(texels.into_iter().flat_map(|texels| rgba_from_texels(region.spec.format, texels)).collect())
    }

    /// The first cube layer, with the pixels of its faces if they are wanted.
    fn keep_cube(&mut self, handle: sys::Session, layers: &[Layer]) -> Outcome<Option<SubmittedCube>> {
        let found = layers.iter().enumerate().find_map(|(layer, it)| match it {
            Layer::Cube { flags, cube, .. } => Some((layer as u32, *flags, cube)),
            _ => None,
        });
        let Some((layer, flags, cube)) = found else { return Ok(None) };
        let q = cube.orientation;
        Ok(Some(SubmittedCube {
            layer,
            flags,
            eyes: cube.eyes,
            orientation: Quat::from_xyzw(q.x, q.y, q.z, q.w),
            face: self.swapchains.get(cube.swapchain)?.spec.size[0],
            rgba: if self.config.read_back { self.read_faces(handle, cube)? } else { Vec::new() },
        }))
    }

    /// The six faces of the last released image, one after the other.
    fn read_faces(&mut self, handle: sys::Session, cube: &LayerCube) -> Outcome<Vec<u8>> {
        let swapchain = self.swapchains.get(cube.swapchain)?;
        let spec = swapchain.spec;
        let image = swapchain.images[swapchain.released.unwrap_or(0) as usize].handle;
        let first = 6 * cube.image_array_index;
        let face = |layer| Region { image, spec, layer, offset: [0; 2], size: spec.size };
        let regions: Vec<Region> = (first..first + 6).map(face).collect();
        let texels = self.sessions.get_mut(handle)?.graphics_mut()?.read(&regions)?;
        Ok(texels.into_iter().flat_map(|texels| rgba_from_texels(spec.format, texels)).collect())
    }

    fn read_back(
        &mut self,
        handle: sys::Session,
        projection: &[LayerView],
        views: &mut [SubmittedView],
    ) -> Outcome<()> {
        let mut regions = Vec::new();
        for view in projection {
            regions.push(self.region(&view.image)?);
            if let Some(depth) = &view.depth {
                regions.push(self.region(&depth.image)?);
            }
        }
        let specs: Vec<ImageSpec> = regions.iter().map(|region| region.spec).collect();
        let texels = self.sessions.get_mut(handle)?.graphics_mut()?.read(&regions)?;
        let mut images = specs.into_iter().zip(texels);
        for view in views {
            if let Some((spec, texels)) = images.next() {
                view.rgba = rgba_from_texels(spec.format, texels);
            }
            if let Some(depth) = &mut view.depth
                && let Some((spec, texels)) = images.next()
            {
                depth.values = depth_from_texels(spec.format, &texels);
            }
        }
        Ok(())
    }

    /// The part of the last released image that a verified sub-image names.
    fn region(&self, image: &sys::SwapchainSubImage) -> Outcome<Region> {
        let swapchain = self.swapchains.get(image.swapchain)?;
        let index = swapchain.released.unwrap_or(0) as usize;
        Ok(Region {
            image: swapchain.images[index].handle,
            spec: swapchain.spec,
            layer: image.image_array_index,
            offset: [image.image_rect.offset.x, image.image_rect.offset.y],
            size: size_of(image),
        })
    }
}

/// The size of a verified sub-image, pixels.
fn size_of(image: &sys::SwapchainSubImage) -> [u32; 2] {
    let extent = image.image_rect.extent;
    [extent.width.unsigned_abs(), extent.height.unsigned_abs()]
}
