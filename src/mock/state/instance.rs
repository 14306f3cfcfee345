//! Instances and the one system they find.

use std::{
    collections::{HashMap, HashSet},
    ffi::CString,
    sync::Arc,
};

use openxr::sys::{self, Handle as _};

use super::{Shared, State, action::Suggested, debug::Messenger, event::Queue, limit_reached, path::Paths};
use crate::mock::{
    fault::{Outcome, misuse, refusal, require},
    handle::Kind,
    journal::Leak,
    registry,
    vulkan::{KnownDevice, KnownInstance},
};

/// The application makes its own Vulkan instance and device.
pub const VULKAN_ENABLE: &str = "XR_KHR_vulkan_enable";
/// The runtime makes them for it.
pub const VULKAN_ENABLE2: &str = "XR_KHR_vulkan_enable2";

/// The extensions this runtime has, with their versions.
const EXTENSIONS: &[(&str, u32)] = &[
    (VULKAN_ENABLE, sys::KHR_vulkan_enable_SPEC_VERSION),
    (VULKAN_ENABLE2, sys::KHR_vulkan_enable2_SPEC_VERSION),
    ("XR_KHR_composition_layer_depth", sys::KHR_composition_layer_depth_SPEC_VERSION),
    ("XR_KHR_composition_layer_cube", sys::KHR_composition_layer_cube_SPEC_VERSION),
    ("XR_KHR_composition_layer_cylinder", sys::KHR_composition_layer_cylinder_SPEC_VERSION),
    ("XR_EXT_local_floor", sys::EXT_local_floor_SPEC_VERSION),
    ("XR_KHR_visibility_mask", sys::KHR_visibility_mask_SPEC_VERSION),
    ("XR_KHR_locate_spaces", sys::KHR_locate_spaces_SPEC_VERSION),
    ("XR_FB_display_refresh_rate", sys::FB_display_refresh_rate_SPEC_VERSION),
    ("XR_EXT_user_presence", sys::EXT_user_presence_SPEC_VERSION),
    ("XR_EXT_performance_settings", sys::EXT_performance_settings_SPEC_VERSION),
    ("XR_EXT_debug_utils", sys::EXT_debug_utils_SPEC_VERSION),
    ("XR_MND_headless", sys::MND_headless_SPEC_VERSION),
    #[cfg(all(unix, target_pointer_width = "64"))]
    ("XR_KHR_convert_timespec_time", sys::KHR_convert_timespec_time_SPEC_VERSION),
    ("XR_EXT_conformance_automation", sys::EXT_conformance_automation_SPEC_VERSION),
    ("XR_EXT_hand_tracking", sys::EXT_hand_tracking_SPEC_VERSION),
    ("XR_EXT_hand_tracking_data_source", sys::EXT_hand_tracking_data_source_SPEC_VERSION),
    // These give an application interaction profiles and components, and nothing else.
    ("XR_EXT_hand_interaction", sys::EXT_hand_interaction_SPEC_VERSION),
    ("XR_EXT_palm_pose", sys::EXT_palm_pose_SPEC_VERSION),
    ("XR_EXT_hp_mixed_reality_controller", sys::EXT_hp_mixed_reality_controller_SPEC_VERSION),
    ("XR_EXT_samsung_odyssey_controller", sys::EXT_samsung_odyssey_controller_SPEC_VERSION),
    ("XR_BD_controller_interaction", sys::BD_controller_interaction_SPEC_VERSION),
    ("XR_FB_touch_controller_pro", sys::FB_touch_controller_pro_SPEC_VERSION),
    ("XR_HTC_vive_cosmos_controller_interaction", sys::HTC_vive_cosmos_controller_interaction_SPEC_VERSION),
    ("XR_HTC_vive_focus3_controller_interaction", sys::HTC_vive_focus3_controller_interaction_SPEC_VERSION),
    ("XR_KHR_generic_controller", sys::KHR_generic_controller_SPEC_VERSION),
    ("XR_META_touch_controller_plus", sys::META_touch_controller_plus_SPEC_VERSION),
    ("XR_ML_ml2_controller_interaction", sys::ML_ml2_controller_interaction_SPEC_VERSION),
    ("XR_MSFT_hand_interaction", sys::MSFT_hand_interaction_SPEC_VERSION),
];

/// The one view configuration.
pub const STEREO: sys::ViewConfigurationType = sys::ViewConfigurationType::PRIMARY_STEREO;

/// The system's id, the same in every instance.
const SYSTEM: u64 = 0x5EED_0001;

pub struct Instance {
    pub version: (u16, u16),
    pub extensions: HashSet<String>,
    pub events: Queue,
    pub paths: Paths,
    pub suggested: Suggested,
    /// The Vulkan extensions through which the graphics requirements were asked for.
    pub requirements_asked: HashSet<&'static str>,
    pub vulkan_instances: Vec<KnownInstance>,
    pub vulkan_devices: Vec<KnownDevice>,
    /// From this time on everything answers XR_ERROR_INSTANCE_LOST.
    pub lost_at_ns: Option<i64>,
    /// What the application calls its objects, by type and handle.
    pub object_names: HashMap<(i32, u64), CString>,
    /// Hears of what goes wrong while the instance is destroyed.
    pub last_messenger: Option<Messenger>,
    /// xrGetSystem has answered.
    system_found: bool,
}

impl Instance {
    pub fn has(&self, extension: &str) -> bool {
        self.extensions.contains(extension)
    }

    pub fn has_local_floor(&self) -> bool {
        self.version >= (1, 1) || self.has("XR_EXT_local_floor")
    }

    pub fn is_lost(&self, now_ns: i64) -> bool {
        self.lost_at_ns.is_some_and(|at| now_ns >= at)
    }

    /// XR_ERROR_SYSTEM_INVALID unless it is the id that xrGetSystem gave.
    pub fn check_system(&self, system: sys::SystemId) -> Outcome<()> {
        require!(
            self.system_found && system.into_raw() == SYSTEM,
            ERROR_SYSTEM_INVALID,
            "XrSystemId {:#x} was not given by xrGetSystem",
            system.into_raw()
        );
        Ok(())
    }

    pub fn check_enabled(&self, extension: &str) -> Outcome<()> {
        require!(self.has(extension), ERROR_FUNCTION_UNSUPPORTED, "{} is not enabled", extension);
        Ok(())
    }
}

/// What xrCreateInstance was asked for.
pub struct InstanceRequest {
    pub application: String,
    pub version: sys::Version,
    pub layers: u32,
    pub extensions: Vec<String>,
}

impl State {
    /// Names and versions of the extensions offered: none without what it depends on.
    pub fn extensions(&self) -> impl Iterator<Item = (&'static str, u32)> {
        let absent = |name: &str| self.config.absent_extensions.iter().any(|gone| gone == name);
        let there = move |name: &str| EXTENSIONS.iter().any(|(known, _)| *known == name) && !absent(name);
        let version = self.config.max_api_version;
        EXTENSIONS.iter().copied().filter(move |(name, _)| {
            there(name) && registry::is_offered(registry::extension_needs(name), version, there)
        })
    }

    pub fn create_instance(
        &mut self,
        shared: &Arc<Shared>,
        request: InstanceRequest,
    ) -> Outcome<sys::Instance> {
        require!(!request.application.is_empty(), ERROR_NAME_INVALID, "applicationName is empty");
        let version = (request.version.major(), request.version.minor());
        if version.0 != 1 || version > self.config.max_api_version {
            return Err(refusal(
                sys::Result::ERROR_API_VERSION_UNSUPPORTED,
                format!("OpenXR {} is not supported", request.version),
            ));
        }
        if request.layers > 0 {
            return Err(refusal(sys::Result::ERROR_API_LAYER_NOT_PRESENT, "the runtime has no API layers"));
        }
        for extension in &request.extensions {
            if self.extensions().all(|(name, _)| name != extension) {
                return Err(refusal(
                    sys::Result::ERROR_EXTENSION_NOT_PRESENT,
                    format!("{extension} is not offered"),
                ));
            }
        }
        let enabled = |name: &str| request.extensions.iter().any(|extension| extension == name);
        for extension in &request.extensions {
            let needs = registry::extension_needs(extension);
            require!(
                registry::is_offered(needs, version, enabled),
                ERROR_EXTENSION_DEPENDENCY_NOT_ENABLED,
                "{} needs one of {:?}, all of it",
                extension,
                needs
            );
        }
        self.instances_made += 1;
        let instance = Instance {
            version,
            extensions: request.extensions.into_iter().collect(),
            events: Queue::default(),
            paths: Paths::new(self.instances_made),
            suggested: Suggested::new(),
            requirements_asked: HashSet::new(),
            vulkan_instances: Vec::new(),
            vulkan_devices: Vec::new(),
            lost_at_ns: None,
            object_names: HashMap::new(),
            last_messenger: None,
            system_found: false,
        };
        let handle = self.instances.insert(instance).ok_or_else(limit_reached::<sys::Instance>)?;
        self.keep_alive = Some(Arc::clone(shared));
        Ok(handle)
    }

    /// Destroys an instance and everything made from it; what the application left alive is recorded as leaked.
    pub fn destroy_instance(&mut self, handle: sys::Instance) -> Outcome<()> {
        self.instances.get(handle)?;
        let sessions = self.sessions.handles_where(|session| session.instance == handle);
        let action_sets = self.action_sets.handles_where(|set| set.instance == handle);
        for session in sessions {
            for swapchain in self.swapchains.handles_where(|it| it.session == session) {
                self.leak(Kind::Swapchain, swapchain.into_raw());
            }
            for space in self.spaces.handles_where(|it| it.session == session) {
                self.leak(Kind::Space, space.into_raw());
            }
            for tracker in self.hand_trackers.handles_where(|it| it.session == session) {
                self.leak(Kind::HandTracker, tracker.into_raw());
            }
            self.leak(Kind::Session, session.into_raw());
            self.destroy_session(session)?;
        }
        for set in action_sets {
            for action in self.actions.handles_where(|action| action.set == set) {
                self.leak(Kind::Action, action.into_raw());
            }
            self.leak(Kind::ActionSet, set.into_raw());
            self.destroy_action_set(set)?;
        }
        for messenger in self.messengers.handles_where(|it| it.instance == handle) {
            self.leak(Kind::Messenger, messenger.into_raw());
            self.messengers.remove(messenger)?;
        }
        self.instances.remove(handle)?;
        if self.instances.is_empty() {
            self.keep_alive = None;
        }
        Ok(())
    }

    fn leak(&mut self, kind: Kind, handle: u64) {
        self.journal.leaks.push(Leak { kind: kind.name(), handle });
    }

    pub fn get_system(
        &mut self,
        handle: sys::Instance,
        form_factor: sys::FormFactor,
    ) -> Outcome<sys::SystemId> {
        self.instance(handle)?;
        match form_factor {
            sys::FormFactor::HEAD_MOUNTED_DISPLAY => {}
            sys::FormFactor::HANDHELD_DISPLAY => {
                return Err(refusal(
                    sys::Result::ERROR_FORM_FACTOR_UNSUPPORTED,
                    "there is only a head-mounted display",
                ));
            }
            other => {
                return Err(misuse(
                    sys::Result::ERROR_FORM_FACTOR_UNSUPPORTED,
                    format!("{other:?} is no XrFormFactor"),
                ));
            }
        }
        if self.unavailable_calls > 0 {
            self.unavailable_calls -= 1;
            return Err(refusal(sys::Result::ERROR_FORM_FACTOR_UNAVAILABLE, "the headset is not connected"));
        }
        self.instance_mut(handle)?.system_found = true;
        Ok(sys::SystemId::from_raw(SYSTEM))
    }

    /// Verifies a system and a view configuration; the only one is stereo.
    pub fn check_view_configuration(
        &self,
        handle: sys::Instance,
        system: sys::SystemId,
        kind: sys::ViewConfigurationType,
    ) -> Outcome<()> {
        self.instance(handle)?.check_system(system)?;
        check_stereo(kind)
    }
}

pub fn check_stereo(kind: sys::ViewConfigurationType) -> Outcome<()> {
    require!(
        kind == STEREO,
        ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED,
        "view configuration {:?} is not supported, only PRIMARY_STEREO",
        kind
    );
    Ok(())
}
