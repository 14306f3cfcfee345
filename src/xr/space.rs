//! The space everything is placed in: the floor under the wearer, however the runtime can tell it.

use std::sync::Arc;

use glam::Vec3;
use openxr::{ReferenceSpaceType, sys};

use super::error::Error;
use super::outcome::Outcome;
use super::raw::RawSession;
use super::view::{Pose, pose_from_sys, pose_to_sys};

/// Where the origin of the session's space is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// On the floor below the wearer, by the runtime's own `LOCAL_FLOOR`.
    Floor,
    /// On the floor below the wearer: `LOCAL`, lowered to the height of `STAGE`.
    FloorFromStage,
    /// At the wearer's eyes when the space was last centred; the floor is unknown (or not known yet).
    Eyes,
}

/// Below this a floor counts as unmoved, in metres.
const SAME_FLOOR_M: f32 = 0.001;

/// A space, destroyed with it.
pub(super) struct Space {
    raw: Arc<RawSession>,
    handle: sys::Space,
}

impl Space {
    fn new(raw: &Arc<RawSession>, kind: ReferenceSpaceType, pose: &Pose) -> Result<Self, Error> {
        let handle = raw.create_space(kind, pose_to_sys(pose))?;
        Ok(Self { raw: Arc::clone(raw), handle })
    }

    /// Where a pose action is at one hand.
    pub(super) fn of_action(
        raw: &Arc<RawSession>,
        action: sys::Action,
        hand: sys::Path,
    ) -> Result<Self, Error> {
        Ok(Self { raw: Arc::clone(raw), handle: raw.create_action_space(action, hand)? })
    }

    pub(super) fn handle(&self) -> sys::Space {
        self.handle
    }

    /// Its pose in `base` at a time in nanoseconds; `None` where that is not known.
    pub(super) fn locate(&self, base: &Space, time_ns: i64) -> Result<Option<Pose>, Error> {
        let pose = self.raw.locate_space(self.handle, base.handle, time_ns)?;
        Ok(pose.and_then(pose_from_sys))
    }
}

impl Drop for Space {
    fn drop(&mut self) {
        self.raw.destroy_space(self.handle);
    }
}

/// `LOCAL` and `STAGE`, for runtimes without `LOCAL_FLOOR`: the height of the floor is measured between them.
struct Floor {
    local: Space,
    stage: Space,
    height_m: f32,
    /// Measure from this display time on, in nanoseconds; `None` when the height is up to date.
    due_ns: Option<i64>,
}

/// The reference spaces of a session.
pub(super) struct Spaces {
    base: Space,
    floor: Option<Floor>,
    origin: Origin,
    /// What kind `base` is of.
    kind: ReferenceSpaceType,
    /// The wearer has centred the view anew, and from this time on, in nanoseconds, poses count from elsewhere.
    recentred_ns: Option<i64>,
}

impl Spaces {
    pub(super) fn new(raw: &Arc<RawSession>) -> Result<Self, Error> {
        let offered = raw.reference_spaces()?;
        let has = |kind| offered.contains(&kind);
        let space = |kind| Space::new(raw, kind, &Pose::IDENTITY);
        if has(ReferenceSpaceType::LOCAL_FLOOR) {
            let base = space(ReferenceSpaceType::LOCAL_FLOOR)?;
            return Ok(Self {
                base,
                floor: None,
                origin: Origin::Floor,
                kind: ReferenceSpaceType::LOCAL_FLOOR,
                recentred_ns: None,
            });
        }
        let floor = if has(ReferenceSpaceType::STAGE) {
            Some(Floor {
                local: space(ReferenceSpaceType::LOCAL)?,
                stage: space(ReferenceSpaceType::STAGE)?,
                height_m: 0.0,
                due_ns: Some(0),
            })
        } else {
            None
        };
        let base = space(ReferenceSpaceType::LOCAL)?;
        Ok(Self { base, floor, origin: Origin::Eyes, kind: ReferenceSpaceType::LOCAL, recentred_ns: None })
    }

    pub(super) fn base(&self) -> sys::Space {
        self.base.handle
    }

    pub(super) fn base_space(&self) -> &Space {
        &self.base
    }

    pub(super) fn origin(&self) -> Origin {
        self.origin
    }

    /// The runtime moves a space's origin at `time_ns`: poses count from elsewhere then, and the floor has to be measured
    /// again.
    pub(super) fn changes(&mut self, kind: ReferenceSpaceType, time_ns: i64) {
        if kind == self.kind {
            self.recentred_ns = Some(time_ns);
        }
        let ours = [ReferenceSpaceType::LOCAL, ReferenceSpaceType::STAGE];
        if let Some(floor) = self.floor.as_mut().filter(|_| ours.contains(&kind)) {
            floor.due_ns = Some(time_ns);
        }
    }

    /// Whether poses at `time_ns` are the first to count from another origin than those before.
    pub(super) fn recentred(&mut self, time_ns: i64) -> bool {
        self.recentred_ns.take_if(|from| time_ns >= *from).is_some()
    }

    /// Measures the floor if that is due and the runtime can tell; between frames only, since the base space is replaced.
    /// Returns how far the origin went up, in metres, when it moves from the eyes to the floor.
    pub(super) fn settle(&mut self, time_ns: i64) -> Result<Option<f32>, Error> {
        let Some(floor) = self.floor.as_mut() else {
            return Ok(None);
        };
        if floor.due_ns.is_none_or(|due| time_ns < due) {
            return Ok(None);
        }
        let stage = match floor.stage.locate(&floor.local, time_ns) {
            Ok(Some(stage)) => stage,
            Ok(None) => return Ok(None),
            Err(error) if error.outcome() == Outcome::GoOn => return Ok(None),
            Err(error) => return Err(error),
        };
        floor.due_ns = None;
        let height_m = stage.position.y;
        let first = self.origin != Origin::FloorFromStage;
        if !first && (height_m - floor.height_m).abs() < SAME_FLOOR_M {
            return Ok(None);
        }
        let pose = Pose { position: Vec3::new(0.0, height_m, 0.0), ..Pose::IDENTITY };
        self.base = Space::new(&self.base.raw, ReferenceSpaceType::LOCAL, &pose)?;
        floor.height_m = height_m;
        self.origin = Origin::FloorFromStage;
        Ok(first.then_some(height_m))
    }
}
