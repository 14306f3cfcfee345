//! Actions: sets, bindings, attaching, syncing and states. No device is connected, so every input is inactive.

use openxr::sys::{self, ActionType, Handle as _};

use super::{
    State, limit_reached,
    path::{is_binding, is_component, is_profile, localized},
    space::{Origin, check_pose},
};
use crate::mock::fault::{Outcome, misuse, require};

/// Vibrations kept, the newest.
const MOST_HAPTICS: usize = 1024;

pub struct ActionSet {
    pub instance: sys::Instance,
    name: String,
    localized: String,
    /// Attached to a session: nothing may be added any more.
    frozen: bool,
}

pub struct Action {
    pub set: sys::ActionSet,
    name: String,
    localized: String,
    kind: ActionType,
    subactions: Vec<sys::Path>,
}

/// The action sets of a session, attached once.
pub struct Attached {
    sets: Vec<sys::ActionSet>,
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
    ) -> Outcome<sys::ActionSet> {
        self.instance(instance)?;
        let (name, localized) = names.check()?;
        for (_, other) in self.action_sets.iter() {
            if other.instance == instance {
                check_distinct((&name, &localized), (&other.name, &other.localized))?;
            }
        }
        let set = ActionSet { instance, name, localized, frozen: false };
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
        for (i, path) in subactions.iter().enumerate() {
            let text = instance.paths.top_level(*path)?;
            require!(
                !subactions[..i].contains(path),
                ERROR_PATH_UNSUPPORTED,
                "sub-action path {} is given twice",
                text
            );
        }
        for (_, other) in self.actions.iter() {
            if other.set == set {
                check_distinct((&name, &localized), (&other.name, &other.localized))?;
            }
        }
        let action = Action { set, name, localized, kind, subactions: subactions.to_vec() };
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
        let text = instance.paths.text(profile)?;
        require!(is_profile(text), ERROR_PATH_UNSUPPORTED, "{} is no interaction profile", text);
        require!(!bindings.is_empty(), ERROR_VALIDATION_FAILURE, "no bindings are suggested");
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
            require!(is_binding(path), ERROR_PATH_UNSUPPORTED, "{} is no input or output of a device", path);
        }
        let pairs = bindings.iter().map(|it| (it.action, it.binding)).collect();
        self.instance_mut(handle)?.suggested.insert(profile, pairs);
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
        for set in sets {
            self.action_sets.get_mut(*set)?.frozen = true;
        }
        self.session_mut(session)?.attached = Some(Attached { sets: sets.to_vec() });
        Ok(self.success(session))
    }

    /// Always no profile: no device is connected.
    pub fn current_profile(&self, session: sys::Session, top: sys::Path) -> Outcome<sys::Path> {
        let session = self.session(session)?;
        self.instance(session.instance)?.paths.top_level(top)?;
        require!(
            session.attached.is_some(),
            ERROR_ACTIONSET_NOT_ATTACHED,
            "no action sets are attached to the session"
        );
        Ok(sys::Path::NULL)
    }

    pub fn sync_actions(
        &self,
        handle: sys::Session,
        active: &[sys::ActiveActionSet],
    ) -> Outcome<sys::Result> {
        let session = self.session(handle)?;
        let instance = self.instance(session.instance)?;
        for set in active {
            self.action_sets.get(set.action_set)?;
            self.check_attached(handle, set.action_set)?;
            if set.subaction_path != sys::Path::NULL {
                let text = instance.paths.text(set.subaction_path)?;
                let used = self.actions.iter().any(|(_, action)| {
                    action.set == set.action_set && action.subactions.contains(&set.subaction_path)
                });
                require!(used, ERROR_PATH_UNSUPPORTED, "no action of the set was made for {}", text);
            }
        }
        if session.state != sys::SessionState::FOCUSED {
            return Ok(sys::Result::SESSION_NOT_FOCUSED);
        }
        Ok(self.success(handle))
    }

    fn check_attached(&self, session: sys::Session, set: sys::ActionSet) -> Outcome<()> {
        let attached = &self.session(session)?.attached;
        require!(
            attached.as_ref().is_some_and(|it| it.sets.contains(&set)),
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
            action.subactions.contains(&path),
            ERROR_PATH_UNSUPPORTED,
            "action {} was not made for {}",
            action.name,
            text
        );
        Ok(())
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
        self.add_space(session, Origin::Action, offset)
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
        let instance = self.instance(self.session(session)?.instance)?;
        let (duration_ns, frequency_hz, amplitude) = match vibration {
            Some((duration, frequency, amplitude)) => (Some(duration), frequency, amplitude),
            None => (None, 0.0, 0.0),
        };
        let haptic = Haptic {
            action: action.name.clone(),
            subaction: instance.paths.text(subaction).ok().map(str::to_owned),
            duration_ns,
            frequency_hz,
            amplitude,
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

    /// A source's name in words; `which` holds the bits of XrInputSourceLocalizedNameFlags.
    pub fn source_name(
        &self,
        session: sys::Session,
        source: sys::Path,
        which: sys::InputSourceLocalizedNameFlags,
    ) -> Outcome<String> {
        let session = self.session(session)?;
        let text = self.instance(session.instance)?.paths.text(source)?;
        require!(
            matches!(which.into_raw(), 1..=7),
            ERROR_VALIDATION_FAILURE,
            "whichComponents {:#x} must be some of the three known bits",
            which.into_raw()
        );
        require!(
            session.attached.is_some(),
            ERROR_ACTIONSET_NOT_ATTACHED,
            "no action sets are attached to the session"
        );
        require!(is_binding(text), ERROR_PATH_UNSUPPORTED, "{} is no input source", text);
        Ok(localized(text, which.into_raw()))
    }
}

/// Two siblings must differ in both names.
fn check_distinct(new: (&str, &str), old: (&str, &str)) -> Outcome<()> {
    require!(new.0 != old.0, ERROR_NAME_DUPLICATED, "the name {:?} is taken", new.0);
    require!(new.1 != old.1, ERROR_LOCALIZED_NAME_DUPLICATED, "the localized name {:?} is taken", new.1);
    Ok(())
}
