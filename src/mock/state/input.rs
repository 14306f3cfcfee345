//! What a session's actions are bound to and measure: fixed when they are attached, renewed by `xrSyncActions` only.

use std::collections::{BTreeMap, HashMap};

use openxr::sys::{self, ActionType};

use super::{
    State,
    action::Suggested,
    binding::{SIMPLE, Source},
    device::Devices,
    event::Event,
    instance::Instance,
};
use crate::mock::{
    config::Tracking,
    fault::Outcome,
    hand::Side,
    pose::Pose,
    registry::{self, Component, Kind, Profile},
};

/// An action set that the application syncs, and the one user path that it syncs it for, if not for all.
pub type Wanted = (sys::ActionSet, Option<&'static str>);

/// A user path, the profile of the device there, and the profile that the application sees it as.
type Seen = (&'static str, (&'static Profile, &'static Profile));

/// What an action measured at the last sync. A button is 0 or 1; what is no vector has y = 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActionState {
    pub value: [f32; 2],
    pub is_active: bool,
    pub changed: bool,
    pub last_change_ns: i64,
}

/// An action of a session. It outlives its handle, which takes away only the application's access.
pub struct AttachedAction {
    handle: sys::Action,
    set: sys::ActionSet,
    priority: u32,
    kind: ActionType,
    user_paths: Vec<&'static str>,
    sources: Vec<Source>,
    /// For all sub-action paths together, then for each.
    states: Vec<ActionState>,
    /// Of a pose action asked for without a sub-action path: the device it has settled on.
    settled: Option<&'static str>,
}

/// The action sets of a session, attached once, and what became of them.
pub struct Attached {
    sets: Vec<sys::ActionSet>,
    actions: Vec<AttachedAction>,
    suggested: Suggested,
    /// The device's own profile, and the one that the application thinks it is of.
    profiles: BTreeMap<&'static str, (&'static Profile, &'static Profile)>,
    /// The highest priority with which an input is wanted, renewed by each sync.
    claims: HashMap<(&'static str, &'static str), u32>,
}

impl AttachedAction {
    pub fn new(
        handle: sys::Action,
        set: sys::ActionSet,
        priority: u32,
        kind: ActionType,
        user_paths: Vec<&'static str>,
    ) -> Self {
        let states = vec![ActionState::default(); 1 + user_paths.len()];
        Self { handle, set, priority, kind, user_paths, sources: Vec::new(), states, settled: None }
    }

    /// Whether it was made for devices at a user path; without sub-action paths it is for all.
    fn is_for(&self, user_path: &str) -> bool {
        self.user_paths.is_empty() || self.user_paths.contains(&user_path)
    }

    /// Whether the application wants input from a user path for it.
    fn is_wanted(&self, user_path: &str, wanted: &[Wanted]) -> bool {
        wanted.iter().any(|(set, only)| *set == self.set && only.is_none_or(|only| only == user_path))
    }

    fn slot(&self, user_path: Option<&str>) -> Option<usize> {
        match user_path {
            None => Some(0),
            Some(wanted) => self.user_paths.iter().position(|known| *known == wanted).map(|i| i + 1),
        }
    }

    /// The source of a pose, for a sub-action path or for all.
    fn pose_source(&self, user_path: Option<&str>) -> Option<&Source> {
        let user_path = user_path.or(self.settled)?;
        self.sources.iter().find(|source| source.live && source.user_path == user_path)
    }

    fn deactivate(&mut self) {
        self.states.fill(ActionState::default());
        self.sources.iter_mut().for_each(|source| source.live = false);
    }

    /// Settles, once and for all, on the device of a pose: in the order of the sub-action paths, then of suggestions.
    fn settle(&mut self) {
        if self.settled.is_some() || self.kind != ActionType::POSE_INPUT {
            return;
        }
        let live = || self.sources.iter().filter(|source| source.live).map(|source| source.user_path);
        let preferred = self.user_paths.iter().find(|user_path| live().any(|it| it == **user_path));
        self.settled = preferred.copied().or_else(|| live().next());
    }

    fn update(&mut self, devices: &Devices) {
        self.settle();
        for source in &mut self.sources {
            source.update(self.kind, devices);
        }
        for (slot, state) in self.states.iter_mut().enumerate() {
            let mut only = slot.checked_sub(1).map(|i| self.user_paths[i]);
            if self.kind == ActionType::POSE_INPUT {
                only = only.or(self.settled);
            }
            let of_slot = self.sources.iter().filter(|it| only.is_none_or(|only| only == it.user_path));
            *state = state.next(of_slot.filter_map(|source| source.reading));
        }
    }
}

impl ActionState {
    /// The state after this one, from what the sources measure and since when. The longest wins: of buttons one that is
    /// pressed, of numbers the one farthest from 0.
    fn next(self, readings: impl Iterator<Item = ([f32; 2], i64)>) -> Self {
        let length = |value: [f32; 2]| value[0].hypot(value[1]);
        let mut best: Option<[f32; 2]> = None;
        let mut newest_ns = 0;
        for (value, changed_ns) in readings {
            newest_ns = newest_ns.max(changed_ns);
            if best.is_none_or(|best| length(value) > length(best)) {
                best = Some(value);
            }
        }
        let Some(value) = best else {
            return Self::default();
        };
        let changed = self.is_active && value != self.value;
        let last_change_ns = if changed || !self.is_active { newest_ns } else { self.last_change_ns };
        Self { value, is_active: true, changed, last_change_ns }
    }
}

impl Attached {
    pub fn new(sets: Vec<sys::ActionSet>, actions: Vec<AttachedAction>, suggested: Suggested) -> Self {
        Self { sets, actions, suggested, profiles: BTreeMap::new(), claims: HashMap::new() }
    }

    pub fn has(&self, set: sys::ActionSet) -> bool {
        self.sets.contains(&set)
    }

    /// The profile that the application's bindings for a user path are of.
    pub fn profile(&self, user_path: &str) -> Option<&'static Profile> {
        self.profiles.get(user_path).map(|(_, seen_as)| *seen_as)
    }

    /// A sub-action path that some action of a set was made for.
    pub fn declared(&self, set: sys::ActionSet, text: &str) -> Option<&'static str> {
        let mut of_set = self.actions.iter().filter(|action| action.set == set);
        of_set.find_map(|action| action.user_paths.iter().find(|known| **known == text).copied())
    }

    fn action(&self, handle: sys::Action) -> Option<&AttachedAction> {
        self.actions.iter().find(|action| action.handle == handle)
    }

    pub fn state(&self, handle: sys::Action, user_path: Option<&str>) -> Option<ActionState> {
        let action = self.action(handle)?;
        action.states.get(action.slot(user_path)?).copied()
    }

    /// The paths that an action is bound to, each once.
    pub fn sources(&self, handle: sys::Action) -> Vec<String> {
        let mut paths = Vec::new();
        for source in self.action(handle).map_or(&[][..], |action| &action.sources) {
            let path = source.path();
            if !paths.contains(&path) {
                paths.push(path);
            }
        }
        paths
    }

    /// The outputs that a vibration reaches, each once.
    pub fn outputs(&self, handle: sys::Action, only: Option<&str>, devices: &Devices) -> Vec<String> {
        let Some(action) = self.action(handle) else {
            return Vec::new();
        };
        let mut paths = Vec::new();
        for source in &action.sources {
            let reached = source.live
                && only.is_none_or(|only| only == source.user_path)
                && devices.profile(source.user_path).is_some();
            if reached && !paths.contains(&source.path()) {
                paths.push(source.path());
            }
        }
        paths
    }

    /// The profile that the application sees a device as: its own if bindings are suggested for it; else a hand's device
    /// stands in for the simple controller.
    fn seen_as(&self, user_path: &str, own: &'static Profile) -> Option<&'static Profile> {
        if self.suggested.contains_key(own.path) {
            return Some(own);
        }
        Side::of(user_path)?;
        registry::profile(SIMPLE).filter(|simple| self.suggested.contains_key(simple.path))
    }

    /// Looks which devices are there; whether a profile that the application sees has changed.
    fn choose_profiles(&mut self, devices: &Devices, instance: &Instance) -> bool {
        let chosen = || {
            let seen = |(user_path, own)| Some((user_path, (own, self.seen_as(user_path, own)?)));
            devices.connected().filter_map(seen)
        };
        let known = || self.profiles.iter().map(|(user_path, profiles)| (*user_path, *profiles));
        let all = |(user_path, (own, seen_as)): Seen| (user_path, own.path, seen_as.path);
        if chosen().map(all).eq(known().map(all)) {
            return false;
        }
        let outside = |(user_path, (_, seen_as)): Seen| (user_path, seen_as.path);
        let changed = !chosen().map(outside).eq(known().map(outside));
        self.profiles = chosen().collect();
        self.bind(instance);
        changed
    }

    /// Binds all actions to the devices there are, in the order of the suggestions.
    fn bind(&mut self, instance: &Instance) {
        for action in &mut self.actions {
            action.sources.clear();
        }
        for (profile, suggestions) in &self.suggested {
            for suggestion in suggestions {
                let device = self.profiles.get(suggestion.user_path);
                let Some((own, seen_as)) = device.filter(|(_, seen_as)| seen_as.path == *profile) else {
                    continue;
                };
                let mut actions = self.actions.iter_mut();
                let Some(action) =
                    actions.find(|it| it.handle == suggestion.action && it.is_for(suggestion.user_path))
                else {
                    continue;
                };
                let is_offered = |component: &Component| instance.offers(component.needs);
                action.sources.extend(Source::resolve(suggestion, action.kind, seen_as, own, is_offered));
            }
        }
    }

    /// Lets the inputs through that the application wants, each to the action sets of the highest priority only.
    fn let_through(&mut self, wanted: &[Wanted]) {
        self.claims.clear();
        for action in &self.actions {
            for source in action.sources.iter().filter(|it| action.is_wanted(it.user_path, wanted)) {
                let claim = self.claims.entry(source.input()).or_default();
                *claim = action.priority.max(*claim);
            }
        }
        for action in &mut self.actions {
            let mut sources = std::mem::take(&mut action.sources);
            for source in &mut sources {
                source.live = action.is_wanted(source.user_path, wanted)
                    && self.claims.get(&source.input()) == Some(&action.priority);
            }
            action.sources = sources;
        }
    }
}

impl State {
    /// Renews the input of a session: profiles, bindings, states.
    pub fn update_input(&mut self, handle: sys::Session, wanted: &[Wanted]) -> Outcome<sys::Result> {
        self.session(handle)?;
        let session = self.sessions.get_mut(handle)?;
        let instance = self.instances.get_mut(session.instance)?;
        let focused = session.state == sys::SessionState::FOCUSED;
        if let Some(attached) = &mut session.attached {
            if !focused {
                attached.actions.iter_mut().for_each(AttachedAction::deactivate);
            } else if attached.choose_profiles(&self.devices, instance) {
                instance.events.push(Event::InteractionProfile { session: handle });
            }
            if focused {
                attached.let_through(wanted);
                attached.actions.iter_mut().for_each(|action| action.update(&self.devices));
            }
        }
        Ok(if focused { self.success(handle) } else { sys::Result::SESSION_NOT_FOCUSED })
    }

    /// The device and pose that a pose action follows, while it is active and the device is there.
    fn pose_source(
        &self,
        session: sys::Session,
        action: sys::Action,
        user_path: Option<&'static str>,
    ) -> Option<&Source> {
        let session = self.sessions.get(session).ok()?;
        let focused = session.state == sys::SessionState::FOCUSED;
        let attached = session.attached.as_ref().filter(|_| focused)?;
        let source = attached.action(action)?.pose_source(user_path)?;
        self.devices.profile(source.user_path).map(|_| source)
    }

    /// Where the device of a pose action is in STAGE space; `None` while the action is inactive.
    pub fn action_pose(
        &self,
        session: sys::Session,
        action: sys::Action,
        user_path: Option<&'static str>,
        time_ns: i64,
    ) -> Option<Pose> {
        let source = self.pose_source(session, action, user_path)?;
        debug_assert_eq!(source.component.kind, Kind::Pose);
        let time_s = self.script_time_s(session, time_ns);
        Some(self.devices.pose(source.user_path, source.read_from.subpath, time_s))
    }

    /// What the tracking system says of the device of a pose action.
    pub fn action_tracking(
        &self,
        session: sys::Session,
        action: sys::Action,
        user_path: Option<&'static str>,
    ) -> Tracking {
        let source = self.pose_source(session, action, user_path);
        source.map_or(Tracking::LOST, |source| self.devices.tracking(source.user_path))
    }
}
