//! Actions: sets, suggested bindings, attaching, and what an application asks of them.

use std::collections::BTreeMap;

use openxr::sys::{self, ActionType, Handle as _};

use super::{
    State,
    binding::Suggestion,
    input::{ActionState, Attached, AttachedAction, Wanted},
    limit_reached,
    path::{is_component, title},
    space::{Origin, check_pose},
};
use crate::mock::{
    fault::{Outcome, misuse, require},
    registry::{self, Profile},
};

/// Vibrations kept, the newest.
const MOST_HAPTICS: usize = 1024;

/// What an application suggested, by path of the interaction profile.
pub type Suggested = BTreeMap<&'static str, Vec<Suggestion>>;

pub struct ActionSet {
    pub instance: sys::Instance,
    name: String,
    localized: String,
    /// Larger numbers take an input from smaller ones.
    priority: u32,
    /// Attached to a session: nothing may be added any more.
    frozen: bool,
}

pub struct Action {
    pub set: sys::ActionSet,
    name: String,
    localized: String,
    pub kind: ActionType,
    /// The sub-action paths, each also as text.
    subactions: Vec<(sys::Path, &'static str)>,
}

/// A vibration the application asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Haptic {
    /// The action's name.
    pub action: String,
    /// The sub-action path, when one was given.
    pub subaction: Option<String>,
    /// Nanoseconds; -1 is the shortest the device can do. `None`: the vibration was stopped.
    pub duration_ns: Option<i64>,
    /// Hertz; 0 is up to the runtime.
    pub frequency_hz: f32,
    /// [0, 1].
    pub amplitude: f32,
    /// The outputs it reached, such as `/user/hand/left/output/haptic`; none without a device that the action is bound to.
    pub outputs: Vec<String>,
}

/// Name and localized name, as the boundary read them; `None` if not a terminated UTF-8 string.
pub struct Names<'a> {
    pub name: Option<&'a str>,
    pub localized: Option<&'a str>,
}

impl Names<'_> {
    fn check(&self) -> Outcome<(String, String)> {
        let (Some(name), Some(localized)) = (self.name, self.localized) else {
            return Err(misuse(
                sys::Result::ERROR_VALIDATION_FAILURE,
                "a name is not a terminated UTF-8 string",
            ));
        };
        require!(!name.is_empty(), ERROR_NAME_INVALID, "the name is empty");
        require!(
            is_component(name),
            ERROR_PATH_FORMAT_INVALID,
            "the name {:?} must be of a-z, 0-9, '-', '_' and '.'",
            name
        );
        require!(!localized.is_empty(), ERROR_LOCALIZED_NAME_INVALID, "the localized name is empty");
        Ok((name.to_owned(), localized.to_owned()))
    }
}

impl State {
    pub fn create_action_set(
        &mut self,
        instance: sys::Instance,
        names: &Names<'_>,
        priority: u32,
    ) -> Outcome<sys::ActionSet> {
        self.instance(instance)?;
        let (name, localized) = names.check()?;
        for (_, other) in self.action_sets.iter() {
            if other.instance == instance {
                check_distinct((&name, &localized), (&other.name, &other.localized))?;
            }
        }
        let set = ActionSet { instance, name, localized, priority, frozen: false };
        self.action_sets.insert(set).ok_or_else(limit_reached::<sys::ActionSet>)
    }

    pub fn destroy_action_set(&mut self, handle: sys::ActionSet) -> Outcome<()> {
        self.action_sets.get(handle)?;
        for action in self.actions.handles_where(|action| action.set == handle) {
            self.actions.remove(action)?;
        }
        self.action_sets.remove(handle).map(|_| ())
    }

    pub fn create_action(
        &mut self,
        set: sys::ActionSet,
        names: &Names<'_>,
        kind: ActionType,
        subactions: &[sys::Path],
    ) -> Outcome<sys::Action> {
        let owner = self.action_sets.get(set)?;
        let instance = self.instance(owner.instance)?;
        require!(
            !owner.frozen,
            ERROR_ACTIONSETS_ALREADY_ATTACHED,
            "action set {} is attached to a session",
            owner.name
        );
        let (name, localized) = names.check()?;
        require!(
            matches!(kind.into_raw(), 1..=4 | 100),
            ERROR_VALIDATION_FAILURE,
            "{:?} is no XrActionType",
            kind
        );
        let mut known = Vec::with_capacity(subactions.len());
        for (i, path) in subactions.iter().enumerate() {
            let text = instance.user_path(*path)?;
            require!(
                !subactions[..i].contains(path),
                ERROR_PATH_UNSUPPORTED,
                "sub-action path {} is given twice",
                text
            );
            known.push((*path, text));
        }
        for (_, other) in self.actions.iter() {
            if other.set == set {
                check_distinct((&name, &localized), (&other.name, &other.localized))?;
            }
        }
        let action = Action { set, name, localized, kind, subactions: known };
        self.actions.insert(action).ok_or_else(limit_reached::<sys::Action>)
    }

    pub fn destroy_action(&mut self, handle: sys::Action) -> Outcome<()> {
        self.actions.remove(handle).map(|_| ())
    }

    pub fn suggest_bindings(
        &mut self,
        handle: sys::Instance,
        profile: sys::Path,
        bindings: &[sys::ActionSuggestedBinding],
    ) -> Outcome<()> {
        let instance = self.instance(handle)?;
        let profile = instance.profile(profile)?;
        require!(!bindings.is_empty(), ERROR_VALIDATION_FAILURE, "no bindings are suggested");
        let mut suggestions = Vec::with_capacity(bindings.len());
        for binding in bindings {
            let action = self.actions.get(binding.action)?;
            let set = self.action_sets.get(action.set)?;
            require!(
                set.instance == handle,
                ERROR_VALIDATION_FAILURE,
                "action {} belongs to another instance",
                action.name
            );
            require!(
                !set.frozen,
                ERROR_ACTIONSETS_ALREADY_ATTACHED,
                "action set {} is attached to a session",
                set.name
            );
            let path = instance.paths.text(binding.binding)?;
            let Some((user_path, subpath)) = instance.bindable(profile, path) else {
                return Err(misuse(
                    sys::Result::ERROR_PATH_UNSUPPORTED,
                    format!("{path} is no input or output of {} for this instance", profile.path),
                ));
            };
            suggestions.push(Suggestion { action: binding.action, user_path, subpath: subpath.to_owned() });
        }
        self.instance_mut(handle)?.suggested.insert(profile.path, suggestions);
        Ok(())
    }

    pub fn attach(&mut self, session: sys::Session, sets: &[sys::ActionSet]) -> Outcome<sys::Result> {
        let (instance, attached) = {
            let session = self.session(session)?;
            (session.instance, session.attached.is_some())
        };
        require!(!sets.is_empty(), ERROR_VALIDATION_FAILURE, "no action sets are given");
        for set in sets {
            require!(
                self.action_sets.get(*set)?.instance == instance,
                ERROR_VALIDATION_FAILURE,
                "an action set belongs to another instance"
            );
        }
        require!(!attached, ERROR_ACTIONSETS_ALREADY_ATTACHED, "the session has its action sets already");
        let mut actions = Vec::new();
        for (i, set) in sets.iter().enumerate() {
            if sets[..i].contains(set) {
                continue;
            }
            self.action_sets.get_mut(*set)?.frozen = true;
            let priority = self.action_sets.get(*set)?.priority;
            actions.extend(self.actions.iter().filter(|(_, action)| action.set == *set).map(
                |(handle, action)| {
                    let user_paths = action.subactions.iter().map(|(_, text)| *text).collect();
                    AttachedAction::new(handle, *set, priority, action.kind, user_paths)
                },
            ));
        }
        let suggested = self.instance(instance)?.suggested.clone();
        self.session_mut(session)?.attached = Some(Attached::new(sets.to_vec(), actions, suggested));
        Ok(self.success(session))
    }

    /// The profile that a user path's bindings are for since the last sync; XR_NULL_PATH for none.
    pub fn current_profile(&mut self, handle: sys::Session, top: sys::Path) -> Outcome<sys::Path> {
        let session = self.session(handle)?;
        let instance = session.instance;
        let user_path = self.instance(instance)?.user_path_or_reserved(top)?;
        let Some(attached) = &session.attached else {
            return Err(misuse(
                sys::Result::ERROR_ACTIONSET_NOT_ATTACHED,
                "no action sets are attached to the session",
            ));
        };
        match attached.profile(user_path) {
            Some(profile) => Ok(self.instance_mut(instance)?.paths.intern(profile.path)),
            None => Ok(sys::Path::NULL),
        }
    }

    pub fn sync_actions(
        &mut self,
        handle: sys::Session,
        active: &[sys::ActiveActionSet],
    ) -> Outcome<sys::Result> {
        let mut wanted = std::mem::take(&mut self.wanted);
        wanted.clear();
        self.check_wanted(handle, active, &mut wanted)?;
        let synced = self.update_input(handle, &wanted);
        self.wanted = wanted;
        synced
    }

    /// Verifies what an application wants to sync.
    fn check_wanted(
        &self,
        handle: sys::Session,
        active: &[sys::ActiveActionSet],
        wanted: &mut Vec<Wanted>,
    ) -> Outcome<()> {
        let session = self.session(handle)?;
        let instance = self.instance(session.instance)?;
        for set in active {
            self.action_sets.get(set.action_set)?;
            self.check_attached(handle, set.action_set)?;
            if set.subaction_path == sys::Path::NULL {
                wanted.push((set.action_set, None));
                continue;
            }
            let text = instance.paths.text(set.subaction_path)?;
            let attached = session.attached.as_ref();
            let used = attached.and_then(|attached| attached.declared(set.action_set, text));
            require!(used.is_some(), ERROR_PATH_UNSUPPORTED, "no action of the set was made for {}", text);
            wanted.push((set.action_set, used));
        }
        Ok(())
    }

    fn check_attached(&self, session: sys::Session, set: sys::ActionSet) -> Outcome<()> {
        let attached = &self.session(session)?.attached;
        require!(
            attached.as_ref().is_some_and(|it| it.has(set)),
            ERROR_ACTIONSET_NOT_ATTACHED,
            "action set {:#x} is not attached to the session",
            set.into_raw()
        );
        Ok(())
    }

    /// Verifies an action of a wanted type in an attached set, and the sub-action path.
    pub fn check_action(
        &self,
        session: sys::Session,
        handle: sys::Action,
        subaction: sys::Path,
        kind: Option<ActionType>,
    ) -> Outcome<&Action> {
        self.session(session)?;
        let action = self.actions.get(handle)?;
        self.check_attached(session, action.set)?;
        self.check_subaction(action, subaction)?;
        require!(
            kind.is_none_or(|kind| kind == action.kind),
            ERROR_ACTION_TYPE_MISMATCH,
            "action {} is {:?}",
            action.name,
            action.kind
        );
        Ok(action)
    }

    fn check_subaction(&self, action: &Action, path: sys::Path) -> Outcome<()> {
        if path == sys::Path::NULL {
            return Ok(());
        }
        let set = self.action_sets.get(action.set)?;
        let text = self.instance(set.instance)?.paths.text(path)?;
        require!(
            action.subactions.iter().any(|(known, _)| *known == path),
            ERROR_PATH_UNSUPPORTED,
            "action {} was not made for {}",
            action.name,
            text
        );
        Ok(())
    }

    /// What an input action's state was at the last sync, for a sub-action path or (XR_NULL_PATH) all of them.
    pub fn action_state(
        &self,
        session: sys::Session,
        handle: sys::Action,
        subaction: sys::Path,
        kind: ActionType,
    ) -> Outcome<ActionState> {
        let action = self.check_action(session, handle, subaction, Some(kind))?;
        let user_path = action.user_path(subaction);
        let session = self.session(session)?;
        let attached = session.attached.as_ref().filter(|_| session.running);
        Ok(attached.and_then(|attached| attached.state(handle, user_path)).unwrap_or_default())
    }

    pub fn create_action_space(
        &mut self,
        session: sys::Session,
        handle: sys::Action,
        subaction: sys::Path,
        offset: sys::Posef,
    ) -> Outcome<sys::Space> {
        let instance = self.session(session)?.instance;
        let action = self.actions.get(handle)?;
        require!(
            self.action_sets.get(action.set)?.instance == instance,
            ERROR_VALIDATION_FAILURE,
            "action {} belongs to another instance",
            action.name
        );
        require!(
            action.kind == ActionType::POSE_INPUT,
            ERROR_ACTION_TYPE_MISMATCH,
            "action {} is {:?}, not POSE_INPUT",
            action.name,
            action.kind
        );
        self.check_subaction(action, subaction)?;
        check_pose(offset, "poseInActionSpace")?;
        let user_path = action.user_path(subaction);
        self.add_space(session, Origin::Action { action: handle, user_path }, offset)
    }

    /// Records a vibration (`duration_ns: None` stops it) if the session has the input focus.
    pub fn vibrate(
        &mut self,
        session: sys::Session,
        handle: sys::Action,
        subaction: sys::Path,
        vibration: Option<(i64, f32, f32)>,
    ) -> Outcome<sys::Result> {
        let kind = Some(ActionType::VIBRATION_OUTPUT);
        let action = self.check_action(session, handle, subaction, kind)?;
        let user_path = action.user_path(subaction);
        let attached = self.session(session)?.attached.as_ref();
        let outputs = attached.map(|attached| attached.outputs(handle, user_path, &self.devices));
        let (duration_ns, frequency_hz, amplitude) = match vibration {
            Some((duration, frequency, amplitude)) => (Some(duration), frequency, amplitude),
            None => (None, 0.0, 0.0),
        };
        let haptic = Haptic {
            action: action.name.clone(),
            subaction: user_path.map(str::to_owned),
            duration_ns,
            frequency_hz,
            amplitude,
            outputs: outputs.unwrap_or_default(),
        };
        if self.session(session)?.state != sys::SessionState::FOCUSED {
            return Ok(sys::Result::SESSION_NOT_FOCUSED);
        }
        if self.haptics.len() == MOST_HAPTICS {
            self.haptics.remove(0);
        }
        self.haptics.push(haptic);
        Ok(self.success(session))
    }

    /// The inputs or outputs that an action is bound to since the last sync.
    pub fn bound_sources(&mut self, session: sys::Session, handle: sys::Action) -> Outcome<Vec<sys::Path>> {
        self.check_action(session, handle, sys::Path::NULL, None)?;
        let instance = self.session(session)?.instance;
        let sources = self.session(session)?.attached.as_ref().map(|it| it.sources(handle));
        let paths = &mut self.instance_mut(instance)?.paths;
        Ok(sources.unwrap_or_default().iter().map(|source| paths.intern(source)).collect())
    }

    /// A source's name in words; `which` holds the bits of XrInputSourceLocalizedNameFlags.
    pub fn source_name(
        &self,
        session: sys::Session,
        source: sys::Path,
        which: sys::InputSourceLocalizedNameFlags,
    ) -> Outcome<String> {
        let session = self.session(session)?;
        let instance = self.instance(session.instance)?;
        let text = instance.paths.text(source)?;
        require!(
            matches!(which.into_raw(), 1..=7),
            ERROR_VALIDATION_FAILURE,
            "whichComponents {:#x} must be some of the three known bits",
            which.into_raw()
        );
        let Some(attached) = &session.attached else {
            return Err(misuse(
                sys::Result::ERROR_ACTIONSET_NOT_ATTACHED,
                "no action sets are attached to the session",
            ));
        };
        // The profile in use, if it has the input; else the first that does.
        let in_use = registry::PROFILES.iter().find_map(|profile| {
            let (user_path, _) = profile.split(text)?;
            attached.profile(user_path)
        });
        let offered = registry::PROFILES.iter().filter(|profile| instance.offers(profile.needs));
        let found = in_use
            .into_iter()
            .chain(offered)
            .find_map(|profile| Some((profile, instance.bindable(profile, text)?)));
        let Some((profile, (user_path, subpath))) = found else {
            return Err(misuse(sys::Result::ERROR_PATH_UNSUPPORTED, format!("{text} is no input source")));
        };
        Ok(localized(profile, user_path, subpath, which.into_raw()))
    }
}

impl Action {
    /// One of its sub-action paths as text; `None` for XR_NULL_PATH.
    fn user_path(&self, subaction: sys::Path) -> Option<&'static str> {
        self.subactions.iter().find(|(path, _)| *path == subaction).map(|(_, text)| *text)
    }
}

/// Two siblings must differ in both names.
fn check_distinct(new: (&str, &str), old: (&str, &str)) -> Outcome<()> {
    require!(new.0 != old.0, ERROR_NAME_DUPLICATED, "the name {:?} is taken", new.0);
    require!(new.1 != old.1, ERROR_LOCALIZED_NAME_DUPLICATED, "the localized name {:?} is taken", new.1);
    Ok(())
}

/// An input or output in words, for people: where, of what, which, as the bits of `which` say.
fn localized(profile: &Profile, user_path: &str, subpath: &str, which: u64) -> String {
    // "left hand", not "hand left".
    let place: Vec<_> = user_path.split('/').skip(2).collect();
    let place: Vec<_> = place.into_iter().rev().collect();
    let identifier = registry::identifier(subpath);
    let siblings =
        profile.components.iter().filter(|it| it.identifier() == identifier && it.is_at(user_path));
    let mut component = title(identifier.rsplit('/').next().unwrap_or_default());
    if siblings.count() > 1 && subpath != identifier {
        component = format!("{component} {}", title(&subpath[identifier.len() + 1..]));
    }
    let parts = [(1, title(&place.join("_"))), (2, profile.title.to_owned()), (4, component)];
    let chosen: Vec<_> =
        parts.into_iter().filter(|(bit, _)| which & bit != 0).map(|(_, part)| part).collect();
    chosen.join(" ")
}
