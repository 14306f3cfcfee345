//! What the wearer does with controllers or bare hands: one action set, bound as a file says.

use std::sync::Arc;

use openxr::sys;

use super::error::Error;
use super::joints::HandJoints;
use super::outcome::Outcome;
use super::raw::RawSession;
use super::sources;
use super::space::Space;
use crate::bindings::{Action, Bound, HANDS, ProfileBindings};
use crate::controllers::{Hands, pinch};
use crate::rig::Pose;

/// The actions of a session, attached to it. Fails softly: where the runtime refuses something, the rest works.
pub(super) struct Actions {
    raw: Arc<RawSession>,
    set: Set,
    actions: [sys::Action; Action::ALL.len()],
    hands: [sys::Path; 2],
    aim: [Space; 2],
    grip: [Space; 2],
    /// Bare hands that are no controllers.
    joints: Option<HandJoints>,
    /// The interaction profiles in use were asked for last.
    profiles: [Option<String>; 2],
    /// What is bound to them, in the runtime's words, and how often that was asked for.
    bound: (Vec<Bound>, u32),
}

impl Actions {
    /// Makes and attaches the actions. `None` where the runtime takes none of them: then the wearer looks on.
    ///
    /// # Errors
    /// Losses.
    pub(super) fn new<'b>(
        raw: &Arc<RawSession>,
        bindings: impl Iterator<Item = &'b ProfileBindings>,
    ) -> Result<Option<Actions>, Error> {
        match Actions::make(raw, bindings) {
            Ok(actions) => Ok(Some(actions)),
            Err(error) if error.outcome() == Outcome::GoOn => {
                tracing::warn!("the controllers do nothing: {error}");
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    fn make<'b>(
        raw: &Arc<RawSession>,
        bindings: impl Iterator<Item = &'b ProfileBindings>,
    ) -> Result<Actions, Error> {
        let hands = [raw.path(HANDS[0])?, raw.path(HANDS[1])?];
        let set = Set { raw: Arc::clone(raw), handle: raw.create_action_set("fly", "Flying")? };
        let mut actions = [sys::Action::default(); Action::ALL.len()];
        for (action, handle) in Action::ALL.into_iter().zip(&mut actions) {
            let of: &[sys::Path] = if action.is_of_each_hand() { &hands } else { &[] };
            *handle = raw.create_action(set.handle, action, of)?;
        }
        for profile in bindings {
            suggest(raw, &actions, profile)?;
        }
        raw.attach(set.handle)?;
        let spaces = |action: Action| {
            let action = actions[action as usize];
            Ok::<_, Error>([
                Space::of_action(raw, action, hands[0])?,
                Space::of_action(raw, action, hands[1])?,
            ])
        };
        let (aim, grip) = (spaces(Action::Aim)?, spaces(Action::Grip)?);
        let joints = HandJoints::new(raw)?;
        let (raw, bound) = (Arc::clone(raw), (Vec::new(), 0));
        Ok(Actions { raw, set, actions, hands, aim, grip, joints, profiles: [None, None], bound })
    }

    /// What the wearer does now, with poses at a display time in nanoseconds, in the space `base`. Nothing while the
    /// session is not focused.
    ///
    /// # Errors
    /// Losses.
    pub(super) fn read(&mut self, base: &Space, time_ns: i64) -> Result<Hands, Error> {
        match self.sync_and_read(base, time_ns) {
            Err(error) if error.outcome() == Outcome::GoOn => {
                tracing::debug!("the controllers are not read: {error}");
                Ok(Hands::default())
            }
            read => read,
        }
    }

    fn sync_and_read(&self, base: &Space, time_ns: i64) -> Result<Hands, Error> {
        if !self.raw.sync(self.set.handle)? {
            return Ok(Hands::default());
        }
        let anywhere = sys::Path::NULL;
        let mut read = Hands::default();
        for (i, hand) in read.hands.iter_mut().enumerate() {
            hand.dive = self.raw.float_state(self.action(Action::Dive), self.hands[i])?.unwrap_or(0.0);
            let grab = self.raw.float_state(self.action(Action::Grab), self.hands[i])?;
            (hand.grab, hand.has_grab) = (grab.unwrap_or(0.0), grab.is_some());
            let at = |action: Action, space: &Space| {
                if !self.raw.is_pose_active(self.action(action), self.hands[i])? {
                    return Ok(None);
                }
                let pose = space.locate(base, time_ns)?;
                Ok::<_, Error>(pose.map(|it| Pose { position: it.position, orientation: it.orientation }))
            };
            hand.aim = at(Action::Aim, &self.aim[i])?;
            hand.grip = at(Action::Grip, &self.grip[i])?;
        }
        read.travel = self.raw.vector_state(self.action(Action::Travel), anywhere)?;
        read.turn = self.raw.vector_state(self.action(Action::Turn), anywhere)?;
        read.rise = self.raw.float_state(self.action(Action::Rise), anywhere)?.unwrap_or(0.0);
        read.teleport = self.raw.boolean_state(self.action(Action::Teleport), anywhere)?;
        read.level = self.raw.boolean_state(self.action(Action::Level), anywhere)?;
        read.restart = self.raw.boolean_state(self.action(Action::Restart), anywhere)?;
        read.panel = self.raw.boolean_state(self.action(Action::Panel), anywhere)?;
        self.read_bare(&mut read, base, time_ns)?;
        Ok(read)
    }

    /// Hands that hold no controller, from their joints.
    fn read_bare(&self, read: &mut Hands, base: &Space, time_ns: i64) -> Result<(), Error> {
        let Some(joints) = &self.joints else { return Ok(()) };
        for i in [0, 1] {
            let holds_something = self.profiles[i].is_some();
            let located = if holds_something { None } else { joints.locate(i, base, time_ns)? };
            if let Some(joints) = located {
                let (hand, fist) = pinch::hand(&joints, i);
                read.hands[i] = hand;
                read.rise = read.rise.max(fist);
            }
        }
        Ok(())
    }

    /// Lets a hand feel a short tick.
    ///
    /// # Errors
    /// Losses.
    pub(super) fn pulse(&self, hand: usize, amplitude: f32) -> Result<(), Error> {
        match self.raw.pulse(self.action(Action::Pulse), self.hands[hand], amplitude) {
            Err(error) if error.outcome() == Outcome::GoOn => Ok(()),
            answer => answer,
        }
    }

    /// Takes note of which controllers are in the hands.
    ///
    /// # Errors
    /// Losses.
    pub(super) fn note_profiles(&mut self) -> Result<(), Error> {
        for (hand, name) in ["left", "right"].into_iter().enumerate() {
            let profile = match self.raw.interaction_profile(self.hands[hand]) {
                Err(error) if error.outcome() == Outcome::GoOn => continue,
                profile => profile?,
            };
            if self.profiles[hand] != profile {
                tracing::info!("{name} hand: {}", profile.as_deref().unwrap_or("nothing"));
                self.profiles[hand] = profile;
            }
        }
        self.bound = (sources::bound(&self.raw, &self.actions)?, self.bound.1 + 1);
        Ok(())
    }

    /// What is bound to the actions, in the runtime's words, and another number each time that may have changed.
    pub(super) fn bound(&self) -> (&[Bound], u32) {
        (&self.bound.0, self.bound.1)
    }

    /// The interaction profiles in use, left and right.
    pub(super) fn profiles(&self) -> [Option<&str>; 2] {
        self.profiles.each_ref().map(Option::as_deref)
    }

    fn action(&self, action: Action) -> sys::Action {
        self.actions[action as usize]
    }
}

/// Suggests what a profile's inputs do. A profile that the runtime does not know is left out.
fn suggest(raw: &RawSession, actions: &[sys::Action], bindings: &ProfileBindings) -> Result<(), Error> {
    let suggested = bindings
        .paths
        .iter()
        .map(|(action, path)| {
            Ok(sys::ActionSuggestedBinding { action: actions[*action as usize], binding: raw.path(path)? })
        })
        .collect::<Result<Vec<_>, Error>>()?;
    match raw.suggest(raw.path(bindings.profile)?, &suggested) {
        Err(error) if error.outcome() == Outcome::GoOn => {
            tracing::debug!("{} is not known to the runtime: {error}", bindings.profile);
            Ok(())
        }
        answer => answer,
    }
}

/// An action set, destroyed with it; its actions go with it.
struct Set {
    raw: Arc<RawSession>,
    handle: sys::ActionSet,
}

impl Drop for Set {
    fn drop(&mut self) {
        self.raw.destroy_action_set(self.handle);
    }
}
