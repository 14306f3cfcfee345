//! Spaces, and where they and the eyes are.

use glam::{Quat, Vec3};
use openxr::sys::{self, ReferenceSpaceType};

use super::{State, headset::floor_of, instance::check_stereo, limit_reached};
use crate::mock::{
    config::Tracking,
    fault::{Outcome, refusal, require},
    pose::{self, Fov, Pose},
};

/// Half the time over which velocities are measured, nanoseconds.
pub const VELOCITY_STEP_NS: i64 = 500_000;

pub struct Space {
    pub session: sys::Session,
    pub origin: Origin,
    pub offset: Pose,
}

/// What a space is fixed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    Reference(ReferenceSpaceType),
    /// The device of a pose action, at one user path or the one the action has settled on.
    Action {
        action: sys::Action,
        user_path: Option<&'static str>,
    },
}

/// Where a space is in another.
#[derive(Clone, Copy)]
pub struct Location {
    pub tracking: Tracking,
    pub pose: Pose,
    /// Metres per second and radians per second in the base space, when known.
    pub velocity: Option<(Vec3, Vec3)>,
}

impl Location {
    const UNKNOWN: Self = Self { tracking: Tracking::LOST, pose: Pose::IDENTITY, velocity: None };
}

/// Where an eye is and what it sees.
#[derive(Clone, Copy)]
pub struct EyeView {
    pub pose: Pose,
    pub fov: Fov,
}

pub fn check_pose(pose: sys::Posef, what: &str) -> Outcome<()> {
    require!(
        pose::is_valid(pose),
        ERROR_POSE_INVALID,
        "{} is no pose: {:?} (the quaternion must have length 1, all numbers must be finite)",
        what,
        pose
    );
    Ok(())
}

pub fn check_time(time: sys::Time) -> Outcome<()> {
    require!(time.as_nanos() > 0, ERROR_TIME_INVALID, "time {} is not positive", time.as_nanos());
    Ok(())
}

impl State {
    /// The reference spaces of a session, VIEW and LOCAL always among them.
    pub fn reference_spaces(&self, session: sys::Session) -> Outcome<Vec<ReferenceSpaceType>> {
        let instance = self.session(session)?.instance;
        let mut spaces = vec![ReferenceSpaceType::VIEW, ReferenceSpaceType::LOCAL];
        if self.instance(instance)?.has_local_floor() {
            spaces.push(ReferenceSpaceType::LOCAL_FLOOR);
        }
        if self.config.stage {
            spaces.push(ReferenceSpaceType::STAGE);
        }
        Ok(spaces)
    }

    fn check_reference(&self, session: sys::Session, kind: ReferenceSpaceType) -> Outcome<()> {
        if self.reference_spaces(session)?.contains(&kind) {
            return Ok(());
        }
        Err(refusal(
            sys::Result::ERROR_REFERENCE_SPACE_UNSUPPORTED,
            format!("reference space {kind:?} is not offered"),
        ))
    }

    pub fn create_reference_space(
        &mut self,
        session: sys::Session,
        kind: ReferenceSpaceType,
        offset: sys::Posef,
    ) -> Outcome<sys::Space> {
        self.check_reference(session, kind)?;
        check_pose(offset, "poseInReferenceSpace")?;
        self.add_space(session, Origin::Reference(kind), offset)
    }

    pub fn add_space(
        &mut self,
        session: sys::Session,
        origin: Origin,
        offset: sys::Posef,
    ) -> Outcome<sys::Space> {
        let space = Space { session, origin, offset: Pose::from_xr(offset) };
        self.spaces.insert(space).ok_or_else(limit_reached::<sys::Space>)
    }

    pub fn destroy_space(&mut self, handle: sys::Space) -> Outcome<()> {
        self.spaces.remove(handle).map(|_| ())
    }

    /// Width and depth of a space's bounds in metres; `None` when they are not known.
    pub fn bounds(&self, session: sys::Session, kind: ReferenceSpaceType) -> Outcome<Option<[f32; 2]>> {
        self.check_reference(session, kind)?;
        Ok(self.config.bounds_m.filter(|_| kind == ReferenceSpaceType::STAGE))
    }

    /// A space of this session, or XR_ERROR_HANDLE_INVALID, or XR_ERROR_VALIDATION_FAILURE for another session's.
    pub fn space_of(&self, session: sys::Session, handle: sys::Space) -> Outcome<&Space> {
        let space = self.spaces.get(handle)?;
        require!(space.session == session, ERROR_VALIDATION_FAILURE, "the space belongs to another session");
        Ok(space)
    }

    /// Seconds on the script's clock: since the first frame of the session.
    pub fn script_time_s(&self, session: sys::Session, time_ns: i64) -> f64 {
        let start = self.sessions.get(session).ok().and_then(|session| session.script_start_ns);
        start.map_or(0.0, |start| (time_ns - start) as f64 * 1e-9)
    }

    pub fn head(&self, session: sys::Session, time_ns: i64) -> Pose {
        self.config.head.sample(self.script_time_s(session, time_ns))
    }

    pub fn tracking(&self, session: sys::Session, time_ns: i64) -> Tracking {
        if let Some(tracking) = self.tracking {
            return tracking;
        }
        let period_ns = self.timeline.period_ns;
        let frame = self.sessions.get(session).map_or(0, |it| it.frames.index_at(time_ns, period_ns));
        self.config
            .tracking
            .iter()
            .find(|span| span.frames.contains(&frame))
            .map_or(Tracking::FULL, |span| span.tracking)
    }

    /// Where a space is in STAGE; `None` for the device of an action that is inactive.
    pub fn stage_from_space(&self, space: &Space, time_ns: i64) -> Option<Pose> {
        self.stage_from_space_with(space, time_ns, self.local_origin(time_ns))
    }

    /// The same with LOCAL somewhere else.
    fn stage_from_space_with(&self, space: &Space, time_ns: i64, local: Pose) -> Option<Pose> {
        let origin = match space.origin {
            Origin::Action { action, user_path } => {
                self.action_pose(space.session, action, user_path, time_ns)?
            }
            Origin::Reference(ReferenceSpaceType::VIEW) => self.head(space.session, time_ns),
            Origin::Reference(ReferenceSpaceType::LOCAL) => local,
            Origin::Reference(ReferenceSpaceType::LOCAL_FLOOR) => floor_of(local),
            Origin::Reference(_) => Pose::IDENTITY,
        };
        Some(origin.then(space.offset))
    }

    /// What the tracking system says of a space's device, if it is an action's.
    fn device_tracking(&self, space: &Space) -> Tracking {
        match space.origin {
            Origin::Action { action, user_path } => self.action_tracking(space.session, action, user_path),
            Origin::Reference(_) => Tracking::FULL,
        }
    }

    /// `origin_ns` is when LOCAL is looked up: a recentring moves it at once, which is no velocity.
    fn base_from_space(&self, base: &Space, space: &Space, time_ns: i64, origin_ns: i64) -> Option<Pose> {
        let local = self.local_origin(origin_ns);
        let stage_from_base = self.stage_from_space_with(base, time_ns, local)?;
        let stage_from_space = self.stage_from_space_with(space, time_ns, local)?;
        Some(stage_from_base.inverse().then(stage_from_space))
    }

    pub fn locate_space(
        &self,
        session: sys::Session,
        space: sys::Space,
        base: sys::Space,
        time: sys::Time,
    ) -> Outcome<Location> {
        self.session(session)?;
        let (space, base) = (self.space_of(session, space)?, self.space_of(session, base)?);
        check_time(time)?;
        let time_ns = time.as_nanos();
        let Some(pose) = self.base_from_space(base, space, time_ns, time_ns) else {
            return Ok(Location::UNKNOWN);
        };
        let is_view = |space: &Space| space.origin == Origin::Reference(ReferenceSpaceType::VIEW);
        // Two spaces on the same device keep their relation, whatever the tracking.
        let mut tracking =
            if is_view(space) == is_view(base) { Tracking::FULL } else { self.tracking(session, time_ns) };
        if space.origin != base.origin {
            tracking = tracking.and(self.device_tracking(space)).and(self.device_tracking(base));
        }
        let velocity = (tracking == Tracking::FULL)
            .then(|| {
                // Any time is a time, the last one too.
                let (earlier, later) =
                    (time_ns.saturating_sub(VELOCITY_STEP_NS), time_ns.saturating_add(VELOCITY_STEP_NS));
                let before = self.base_from_space(base, space, earlier, time_ns)?;
                let after = self.base_from_space(base, space, later, time_ns)?;
                Some(velocity(before, after))
            })
            .flatten();
        Ok(Location { tracking, pose, velocity })
    }

    /// The two eyes in a space.
    pub fn locate_views(
        &self,
        session: sys::Session,
        kind: sys::ViewConfigurationType,
        time: sys::Time,
        space: sys::Space,
    ) -> Outcome<(Tracking, [EyeView; 2])> {
        let running = self.session(session)?.running;
        let base = self.space_of(session, space)?;
        check_stereo(kind)?;
        check_time(time)?;
        require!(running, ERROR_VALIDATION_FAILURE, "views are located in a session that is not running");
        let head =
            Space { session, origin: Origin::Reference(ReferenceSpaceType::VIEW), offset: Pose::IDENTITY };
        let in_view = base.origin == head.origin;
        let Some(base_from_head) = self.base_from_space(base, &head, time.as_nanos(), time.as_nanos()) else {
            return Ok((Tracking::LOST, self.eyes(Pose::IDENTITY)));
        };
        let tracking = if in_view { Tracking::FULL } else { self.tracking(session, time.as_nanos()) };
        let early = self.journal.count("xrLocateViews") % 2 == 1;
        let error = if early { self.config.early_error_m } else { Vec3::ZERO };
        let head = Pose::new(base_from_head.position + error, base_from_head.orientation);
        Ok((tracking, self.eyes(head)))
    }

    fn eyes(&self, base_from_head: Pose) -> [EyeView; 2] {
        let half = 0.5 * self.config.ipd_m;
        let eye = |i: usize, x: f32| EyeView {
            pose: base_from_head.then(Pose::new(Vec3::new(x, 0.0, 0.0), self.config.eye_turn[i])),
            fov: self.config.fov[i],
        };
        [eye(0, -half), eye(1, half)]
    }
}

/// Linear and angular velocity between two poses that lie two velocity steps apart.
pub fn velocity(before: Pose, after: Pose) -> (Vec3, Vec3) {
    let per_second = 1e9 / (2 * VELOCITY_STEP_NS) as f32;
    let mut turn = after.orientation * before.orientation.conjugate();
    if turn.w < 0.0 {
        turn = Quat::from_xyzw(-turn.x, -turn.y, -turn.z, -turn.w);
    }
    ((after.position - before.position) * per_second, turn.to_scaled_axis() * per_second)
}
