//! What the hands do: actions, what they are bound to, and their state.

#![allow(unsafe_code, reason = "calls the C interface of the OpenXR runtime")]

use std::ffi::{CString, c_char};
use std::ptr;

use glam::Vec2;
use openxr::sys;

use super::RawSession;
use crate::bindings::Action;
use crate::mock::registry::Kind;
use crate::xr::arrays::text;
use crate::xr::error::Error;
use crate::xr::view::{Pose, pose_to_sys};

impl RawSession {
    pub(in crate::xr) fn create_action_space(
        &self,
        action: sys::Action,
        hand: sys::Path,
    ) -> Result<sys::Space, Error> {
        let info = sys::ActionSpaceCreateInfo {
            ty: sys::ActionSpaceCreateInfo::TYPE,
            next: ptr::null(),
            action,
            subaction_path: hand,
            pose_in_action_space: pose_to_sys(&Pose::IDENTITY),
        };
        let mut space = sys::Space::default();
        // SAFETY: a live session, a live action, and a properly typed structure.
        let code = unsafe { (self.instance.fp().create_action_space)(self.handle, &info, &mut space) };
        self.check("xrCreateActionSpace", code).map(|_| space)
    }

    pub(in crate::xr) fn path(&self, text: &str) -> Result<sys::Path, Error> {
        let text = CString::new(text)
            .map_err(|_| Error::from_code("xrStringToPath", sys::Result::ERROR_PATH_FORMAT_INVALID))?;
        let mut path = sys::Path::NULL;
        // SAFETY: a live instance and a terminated string.
        let code =
            unsafe { (self.instance.fp().string_to_path)(self.instance.as_raw(), text.as_ptr(), &mut path) };
        self.check("xrStringToPath", code).map(|_| path)
    }

    /// Both names are short enough for their fields.
    pub(in crate::xr) fn create_action_set(&self, name: &str, title: &str) -> Result<sys::ActionSet, Error> {
        let info = sys::ActionSetCreateInfo {
            ty: sys::ActionSetCreateInfo::TYPE,
            next: ptr::null(),
            action_set_name: field(name),
            localized_action_set_name: field(title),
            priority: 0,
        };
        let mut set = sys::ActionSet::default();
        // SAFETY: a live instance and a properly typed structure.
        let code = unsafe { (self.instance.fp().create_action_set)(self.instance.as_raw(), &info, &mut set) };
        self.check("xrCreateActionSet", code).map(|_| set)
    }

    /// An action that each of these user paths has for itself.
    pub(in crate::xr) fn create_action(
        &self,
        set: sys::ActionSet,
        action: Action,
        of: &[sys::Path],
    ) -> Result<sys::Action, Error> {
        let info = sys::ActionCreateInfo {
            ty: sys::ActionCreateInfo::TYPE,
            next: ptr::null(),
            action_name: field(action.name()),
            action_type: match action.kind() {
                Kind::Boolean => sys::ActionType::BOOLEAN_INPUT,
                Kind::Float => sys::ActionType::FLOAT_INPUT,
                Kind::Vector => sys::ActionType::VECTOR2F_INPUT,
                Kind::Pose => sys::ActionType::POSE_INPUT,
                Kind::Haptic => sys::ActionType::VIBRATION_OUTPUT,
            },
            count_subaction_paths: of.len() as u32,
            subaction_paths: of.as_ptr(),
            localized_action_name: field(action.title()),
        };
        let mut handle = sys::Action::default();
        // SAFETY: a live action set, a properly typed structure, and as many paths as it says.
        let code = unsafe { (self.instance.fp().create_action)(set, &info, &mut handle) };
        self.check("xrCreateAction", code).map(|_| handle)
    }

    /// Says what a profile's inputs are to do.
    pub(in crate::xr) fn suggest(
        &self,
        profile: sys::Path,
        bindings: &[sys::ActionSuggestedBinding],
    ) -> Result<(), Error> {
        let info = sys::InteractionProfileSuggestedBinding {
            ty: sys::InteractionProfileSuggestedBinding::TYPE,
            next: ptr::null(),
            interaction_profile: profile,
            count_suggested_bindings: bindings.len() as u32,
            suggested_bindings: bindings.as_ptr(),
        };
        // SAFETY: a live instance, live actions, and as many bindings as the structure says.
        let code = unsafe {
            (self.instance.fp().suggest_interaction_profile_bindings)(self.instance.as_raw(), &info)
        };
        self.check("xrSuggestInteractionProfileBindings", code).map(drop)
    }

    pub(in crate::xr) fn attach(&self, set: sys::ActionSet) -> Result<(), Error> {
        let info = sys::SessionActionSetsAttachInfo {
            ty: sys::SessionActionSetsAttachInfo::TYPE,
            next: ptr::null(),
            count_action_sets: 1,
            action_sets: &set,
        };
        // SAFETY: a live session and action set.
        let code = unsafe { (self.instance.fp().attach_session_action_sets)(self.handle, &info) };
        self.check("xrAttachSessionActionSets", code).map(drop)
    }

    /// Takes note of all inputs. False while the input goes elsewhere.
    pub(in crate::xr) fn sync(&self, set: sys::ActionSet) -> Result<bool, Error> {
        let active = sys::ActiveActionSet { action_set: set, subaction_path: sys::Path::NULL };
        let info = sys::ActionsSyncInfo {
            ty: sys::ActionsSyncInfo::TYPE,
            next: ptr::null(),
            count_active_action_sets: 1,
            active_action_sets: &active,
        };
        // SAFETY: a live session and an action set that is attached to it.
        let code = unsafe { (self.instance.fp().sync_actions)(self.handle, &info) };
        Ok(self.check("xrSyncActions", code)? != sys::Result::SESSION_NOT_FOCUSED)
    }

    /// `None` where it is not active.
    pub(in crate::xr) fn float_state(
        &self,
        action: sys::Action,
        hand: sys::Path,
    ) -> Result<Option<f32>, Error> {
        let mut state = sys::ActionStateFloat {
            ty: sys::ActionStateFloat::TYPE,
            next: ptr::null_mut(),
            current_state: 0.0,
            changed_since_last_sync: sys::FALSE,
            last_change_time: sys::Time::from_nanos(0),
            is_active: sys::FALSE,
        };
        let info = get_info(action, hand);
        // SAFETY: a live session, an attached action of this type, and a properly typed structure to fill.
        let code = unsafe { (self.instance.fp().get_action_state_float)(self.handle, &info, &mut state) };
        self.check("xrGetActionStateFloat", code)?;
        let active = bool::from(state.is_active) && state.current_state.is_finite();
        Ok(active.then_some(state.current_state))
    }

    /// 0 where it is not active.
    pub(in crate::xr) fn vector_state(&self, action: sys::Action, hand: sys::Path) -> Result<Vec2, Error> {
        let mut state = sys::ActionStateVector2f {
            ty: sys::ActionStateVector2f::TYPE,
            next: ptr::null_mut(),
            current_state: sys::Vector2f { x: 0.0, y: 0.0 },
            changed_since_last_sync: sys::FALSE,
            last_change_time: sys::Time::from_nanos(0),
            is_active: sys::FALSE,
        };
        let info = get_info(action, hand);
        // SAFETY: a live session, an attached action of this type, and a properly typed structure to fill.
        let code = unsafe { (self.instance.fp().get_action_state_vector2f)(self.handle, &info, &mut state) };
        self.check("xrGetActionStateVector2f", code)?;
        let vector = Vec2::new(state.current_state.x, state.current_state.y);
        Ok(if state.is_active.into() && vector.is_finite() { vector } else { Vec2::ZERO })
    }

    /// False where it is not active.
    pub(in crate::xr) fn boolean_state(&self, action: sys::Action, hand: sys::Path) -> Result<bool, Error> {
        let mut state = sys::ActionStateBoolean {
            ty: sys::ActionStateBoolean::TYPE,
            next: ptr::null_mut(),
            current_state: sys::FALSE,
            changed_since_last_sync: sys::FALSE,
            last_change_time: sys::Time::from_nanos(0),
            is_active: sys::FALSE,
        };
        let info = get_info(action, hand);
        // SAFETY: a live session, an attached action of this type, and a properly typed structure to fill.
        let code = unsafe { (self.instance.fp().get_action_state_boolean)(self.handle, &info, &mut state) };
        self.check("xrGetActionStateBoolean", code)?;
        Ok(bool::from(state.is_active) && bool::from(state.current_state))
    }

    /// Whether something stands behind a pose action.
    pub(in crate::xr) fn is_pose_active(&self, action: sys::Action, hand: sys::Path) -> Result<bool, Error> {
        let mut state = sys::ActionStatePose {
            ty: sys::ActionStatePose::TYPE,
            next: ptr::null_mut(),
            is_active: sys::FALSE,
        };
        let info = get_info(action, hand);
        // SAFETY: a live session, an attached action of this type, and a properly typed structure to fill.
        let code = unsafe { (self.instance.fp().get_action_state_pose)(self.handle, &info, &mut state) };
        self.check("xrGetActionStatePose", code)?;
        Ok(state.is_active.into())
    }

    /// As short a tick as the device can, of an amplitude from 0 to 1.
    pub(in crate::xr) fn pulse(
        &self,
        action: sys::Action,
        hand: sys::Path,
        amplitude: f32,
    ) -> Result<(), Error> {
        let info = sys::HapticActionInfo {
            ty: sys::HapticActionInfo::TYPE,
            next: ptr::null(),
            action,
            subaction_path: hand,
        };
        let vibration = sys::HapticVibration {
            ty: sys::HapticVibration::TYPE,
            next: ptr::null(),
            duration: sys::Duration::MIN_HAPTIC,
            frequency: sys::FREQUENCY_UNSPECIFIED,
            amplitude,
        };
        // SAFETY: a live session, an attached output action, and a vibration, which begins as its base does.
        let code = unsafe {
            (self.instance.fp().apply_haptic_feedback)(
                self.handle,
                &info,
                ptr::from_ref(&vibration).cast::<sys::HapticBaseHeader>(),
            )
        };
        self.check("xrApplyHapticFeedback", code).map(drop)
    }

    /// The interaction profile of what a hand holds; `None`: nothing.
    pub(in crate::xr) fn interaction_profile(&self, hand: sys::Path) -> Result<Option<String>, Error> {
        let mut state = sys::InteractionProfileState {
            ty: sys::InteractionProfileState::TYPE,
            next: ptr::null_mut(),
            interaction_profile: sys::Path::NULL,
        };
        // SAFETY: a live session and a properly typed structure to fill.
        let code =
            unsafe { (self.instance.fp().get_current_interaction_profile)(self.handle, hand, &mut state) };
        self.check("xrGetCurrentInteractionProfile", code)?;
        let path = state.interaction_profile;
        if path == sys::Path::NULL {
            return Ok(None);
        }
        let (fp, instance) = (self.instance.fp(), self.instance.as_raw());
        let characters = self.array("xrPathToString", 0, |capacity, count, out| {
            // SAFETY: a live instance and one of its paths; `out` has room for `capacity` characters.
            unsafe { (fp.path_to_string)(instance, path, capacity, count, out) }
        })?;
        Ok(Some(text(&characters)))
    }

    /// Paths of the inputs that an action has now.
    pub(in crate::xr) fn bound_sources(&self, action: sys::Action) -> Result<Vec<sys::Path>, Error> {
        let info = sys::BoundSourcesForActionEnumerateInfo {
            ty: sys::BoundSourcesForActionEnumerateInfo::TYPE,
            next: ptr::null(),
            action,
        };
        let fp = self.instance.fp();
        self.array("xrEnumerateBoundSourcesForAction", sys::Path::NULL, |capacity, count, out| {
            // SAFETY: a live session and one of its actions; `out` has room for `capacity` paths.
            unsafe { (fp.enumerate_bound_sources_for_action)(self.handle, &info, capacity, count, out) }
        })
    }

    /// An input in the runtime's words, for people: the hand and the part of what it holds.
    pub(in crate::xr) fn source_name(&self, source_path: sys::Path) -> Result<String, Error> {
        let info = sys::InputSourceLocalizedNameGetInfo {
            ty: sys::InputSourceLocalizedNameGetInfo::TYPE,
            next: ptr::null(),
            source_path,
            which_components: sys::InputSourceLocalizedNameFlags::USER_PATH
                | sys::InputSourceLocalizedNameFlags::COMPONENT,
        };
        let fp = self.instance.fp();
        let characters = self.array("xrGetInputSourceLocalizedName", 0, |capacity, count, out| {
            // SAFETY: a live session and one of its paths; `out` has room for `capacity` characters.
            unsafe { (fp.get_input_source_localized_name)(self.handle, &info, capacity, count, out) }
        })?;
        Ok(text(&characters))
    }

    pub(in crate::xr) fn destroy_action_set(&self, set: sys::ActionSet) {
        // SAFETY: the caller owns the action set and gives it up.
        unsafe { (self.instance.fp().destroy_action_set)(set) };
    }
}

/// What is asked of an action, at one hand or (null) anywhere.
fn get_info(action: sys::Action, hand: sys::Path) -> sys::ActionStateGetInfo {
    sys::ActionStateGetInfo {
        ty: sys::ActionStateGetInfo::TYPE,
        next: ptr::null(),
        action,
        subaction_path: hand,
    }
}

/// A text in a field of fixed length, terminated; what does not fit is cut off.
fn field<const N: usize>(text: &str) -> [c_char; N] {
    let mut field = [0; N];
    for (to, byte) in field[..N - 1].iter_mut().zip(text.bytes()) {
        *to = byte as c_char;
    }
    field
}
