//! The table of commands. Each mock occupies a slot, and each slot has entry points of its own, so that a call knows
//! its mock even when all its handles are nonsense.
#![allow(unsafe_code, reason = "function pointers lose their signature in xrGetInstanceProcAddr")]

use std::{
    ffi::c_char,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
};

use openxr::sys::{self, Handle as _, platform};

use super::{
    action, automation, debug, event, frame, hand, headset, instance,
    pointer::{In, Out},
    session, space, swapchain, text, vulkan,
};
use crate::mock::{
    fault::{Outcome, misuse, refusal},
    library,
    slot::{self, LIBRARY, SLOTS},
    state::{Shared, player::after_call},
};

type Code = sys::Result;

/// What an instance needs for a command to exist.
#[derive(Clone, Copy, PartialEq)]
enum Need {
    /// Nothing: it can be asked for without an instance.
    Nothing,
    Core,
    Version(u16, u16),
    Extension(&'static str),
}

const ENABLE: Need = Need::Extension("XR_KHR_vulkan_enable");
const ENABLE2: Need = Need::Extension("XR_KHR_vulkan_enable2");
const REFRESH_RATE: Need = Need::Extension("XR_FB_display_refresh_rate");
const VISIBILITY_MASK: Need = Need::Extension("XR_KHR_visibility_mask");
const PERFORMANCE: Need = Need::Extension("XR_EXT_performance_settings");
const TIMESPEC: Need = Need::Extension("XR_KHR_convert_timespec_time");
const DEBUG: Need = Need::Extension("XR_EXT_debug_utils");
const LOCATE_SPACES: Need = Need::Extension("XR_KHR_locate_spaces");
const AUTOMATION: Need = Need::Extension("XR_EXT_conformance_automation");
const HANDS: Need = Need::Extension("XR_EXT_hand_tracking");

struct Command {
    name: &'static str,
    need: Need,
    address: sys::pfn::VoidFunction,
}

/// A command of a slot, performed by its mock.
fn enter(slot: usize, name: &'static str, body: impl FnOnce(&Arc<Shared>) -> Outcome<Code>) -> Code {
    if slot == LIBRARY {
        return library::enter(name, |shared| perform(shared, name, body));
    }
    match slot::occupant(slot) {
        Some(shared) => perform(&shared, name, body),
        None => Code::ERROR_RUNTIME_UNAVAILABLE,
    }
}

/// Counts the call, lets a hook have its way, stops panics, records misuse.
fn perform(
    shared: &Arc<Shared>,
    name: &'static str,
    body: impl FnOnce(&Arc<Shared>) -> Outcome<Code>,
) -> Code {
    let scripted = shared.lock().journal.begin(name);
    if let Some(code) = scripted
        && (code.into_raw() < 0 || is_instead(code))
    {
        let mut state = shared.lock();
        state.journal.end(name, code);
        after_call(shared, &mut state, name);
        return code;
    }
    let outcome = catch_unwind(AssertUnwindSafe(|| body(shared)))
        .unwrap_or_else(|_| Err(refusal(Code::ERROR_RUNTIME_FAILURE, "the runtime panicked")));
    let mut state = shared.lock();
    let mut complaint = None;
    let code = match outcome {
        Ok(code) => scripted.unwrap_or(code),
        Err(fault) => {
            let code = fault.code;
            if fault.misuse {
                complaint = state.complaint(name, &fault);
                state.journal.record(name, fault);
            }
            code
        }
    };
    state.journal.end(name, code);
    after_call(shared, &mut state, name);
    drop(state);
    if let Some((listeners, message)) = complaint {
        debug::deliver(&listeners, &message);
    }
    code
}

/// Positive codes that mean the function did not do its work; the others are told after it has.
fn is_instead(code: Code) -> bool {
    matches!(code, Code::TIMEOUT_EXPIRED | Code::EVENT_UNAVAILABLE)
}

macro_rules! commands {
    ($($need:expr => $name:literal $module:ident::$function:ident($($arg:ident: $ty:ty),*);)*) => {
        /// The slot-independent halves, one per command.
        mod body {
            use super::*;
            $(
                #[inline(never)]
                pub fn $function(slot: usize, $($arg: $ty),*) -> Code {
                    enter(slot, $name, |shared| $module::$function(shared, $($arg),*))
                }
            )*
        }

        /// The entry points of one slot.
        mod entry {
            use super::*;
            $(
                pub extern "system" fn $function<const SLOT: usize>($($arg: $ty),*) -> Code {
                    body::$function(SLOT, $($arg),*)
                }
            )*
        }

        struct Commands<const SLOT: usize>;

        impl<const SLOT: usize> Commands<SLOT> {
            const ALL: &'static [Command] = &[$(
                Command {
                    name: $name,
                    need: $need,
                    // SAFETY: a function pointer; the application casts it back to the command's own signature.
                    address: unsafe {
                        std::mem::transmute::<extern "system" fn($($ty),*) -> Code, sys::pfn::VoidFunction>(
                            entry::$function::<SLOT>,
                        )
                    },
                },
            )*];
        }
    };
}

commands! {
    Need::Nothing => "xrEnumerateApiLayerProperties" instance::enumerate_layers(capacity: u32, count: Out<u32>, layers: Out<sys::ApiLayerProperties>);
    Need::Nothing => "xrEnumerateInstanceExtensionProperties" instance::enumerate_extensions(layer: In<c_char>, capacity: u32, count: Out<u32>, extensions: Out<sys::ExtensionProperties>);
    Need::Nothing => "xrCreateInstance" instance::create_instance(info: In<sys::InstanceCreateInfo>, out: Out<sys::Instance>);
    Need::Core => "xrDestroyInstance" instance::destroy_instance(handle: sys::Instance);
    Need::Core => "xrGetInstanceProperties" instance::get_instance_properties(handle: sys::Instance, out: Out<sys::InstanceProperties>);
    Need::Core => "xrPollEvent" event::poll_event(handle: sys::Instance, out: Out<sys::EventDataBuffer>);
    Need::Core => "xrGetSystem" instance::get_system(handle: sys::Instance, info: In<sys::SystemGetInfo>, out: Out<sys::SystemId>);
    Need::Core => "xrGetSystemProperties" instance::get_system_properties(handle: sys::Instance, system: sys::SystemId, out: Out<sys::SystemProperties>);
    Need::Core => "xrEnumerateViewConfigurations" instance::enumerate_view_configurations(handle: sys::Instance, system: sys::SystemId, capacity: u32, count: Out<u32>, kinds: Out<sys::ViewConfigurationType>);
    Need::Core => "xrEnumerateEnvironmentBlendModes" instance::enumerate_blend_modes(handle: sys::Instance, system: sys::SystemId, kind: sys::ViewConfigurationType, capacity: u32, count: Out<u32>, modes: Out<sys::EnvironmentBlendMode>);
    Need::Core => "xrGetViewConfigurationProperties" instance::get_view_configuration(handle: sys::Instance, system: sys::SystemId, kind: sys::ViewConfigurationType, out: Out<sys::ViewConfigurationProperties>);
    Need::Core => "xrEnumerateViewConfigurationViews" instance::enumerate_views(handle: sys::Instance, system: sys::SystemId, kind: sys::ViewConfigurationType, capacity: u32, count: Out<u32>, views: Out<sys::ViewConfigurationView>);
    Need::Core => "xrResultToString" text::result_to_string(handle: sys::Instance, value: sys::Result, out: Out<[c_char; sys::MAX_RESULT_STRING_SIZE]>);
    Need::Core => "xrStructureTypeToString" text::structure_type_to_string(handle: sys::Instance, value: sys::StructureType, out: Out<[c_char; sys::MAX_STRUCTURE_NAME_SIZE]>);
    Need::Core => "xrStringToPath" text::string_to_path(handle: sys::Instance, path: In<c_char>, out: Out<sys::Path>);
    Need::Core => "xrPathToString" text::path_to_string(handle: sys::Instance, path: sys::Path, capacity: u32, count: Out<u32>, buffer: Out<c_char>);
    Need::Core => "xrCreateSession" session::create_session(handle: sys::Instance, info: In<sys::SessionCreateInfo>, out: Out<sys::Session>);
    Need::Core => "xrDestroySession" session::destroy_session(handle: sys::Session);
    Need::Core => "xrBeginSession" session::begin_session(handle: sys::Session, info: In<sys::SessionBeginInfo>);
    Need::Core => "xrEndSession" session::end_session(handle: sys::Session);
    Need::Core => "xrRequestExitSession" session::request_exit(handle: sys::Session);
    Need::Core => "xrEnumerateReferenceSpaces" space::enumerate_reference_spaces(session: sys::Session, capacity: u32, count: Out<u32>, kinds: Out<sys::ReferenceSpaceType>);
    Need::Core => "xrCreateReferenceSpace" space::create_reference_space(session: sys::Session, info: In<sys::ReferenceSpaceCreateInfo>, out: Out<sys::Space>);
    Need::Core => "xrGetReferenceSpaceBoundsRect" space::get_bounds(session: sys::Session, kind: sys::ReferenceSpaceType, out: Out<sys::Extent2Df>);
    Need::Core => "xrCreateActionSpace" space::create_action_space(session: sys::Session, info: In<sys::ActionSpaceCreateInfo>, out: Out<sys::Space>);
    Need::Core => "xrLocateSpace" space::locate_space(space: sys::Space, base: sys::Space, time: sys::Time, out: Out<sys::SpaceLocation>);
    Need::Core => "xrDestroySpace" space::destroy_space(space: sys::Space);
    Need::Version(1, 1) => "xrLocateSpaces" space::locate_spaces(session: sys::Session, info: In<sys::SpacesLocateInfo>, out: Out<sys::SpaceLocations>);
    Need::Core => "xrLocateViews" space::locate_views(session: sys::Session, info: In<sys::ViewLocateInfo>, state: Out<sys::ViewState>, capacity: u32, count: Out<u32>, views: Out<sys::View>);
    Need::Core => "xrEnumerateSwapchainFormats" swapchain::enumerate_formats(session: sys::Session, capacity: u32, count: Out<u32>, formats: Out<i64>);
    Need::Core => "xrCreateSwapchain" swapchain::create_swapchain(session: sys::Session, info: In<sys::SwapchainCreateInfo>, out: Out<sys::Swapchain>);
    Need::Core => "xrDestroySwapchain" swapchain::destroy_swapchain(handle: sys::Swapchain);
    Need::Core => "xrEnumerateSwapchainImages" swapchain::enumerate_images(handle: sys::Swapchain, capacity: u32, count: Out<u32>, images: Out<sys::SwapchainImageVulkanKHR>);
    Need::Core => "xrAcquireSwapchainImage" swapchain::acquire_image(handle: sys::Swapchain, info: In<sys::SwapchainImageAcquireInfo>, out: Out<u32>);
    Need::Core => "xrWaitSwapchainImage" swapchain::wait_image(handle: sys::Swapchain, info: In<sys::SwapchainImageWaitInfo>);
    Need::Core => "xrReleaseSwapchainImage" swapchain::release_image(handle: sys::Swapchain, info: In<sys::SwapchainImageReleaseInfo>);
    Need::Core => "xrWaitFrame" frame::wait_frame(session: sys::Session, info: In<sys::FrameWaitInfo>, out: Out<sys::FrameState>);
    Need::Core => "xrBeginFrame" frame::begin_frame(session: sys::Session, info: In<sys::FrameBeginInfo>);
    Need::Core => "xrEndFrame" frame::end_frame(session: sys::Session, info: In<sys::FrameEndInfo>);
    Need::Core => "xrCreateActionSet" action::create_action_set(handle: sys::Instance, info: In<sys::ActionSetCreateInfo>, out: Out<sys::ActionSet>);
    Need::Core => "xrDestroyActionSet" action::destroy_action_set(set: sys::ActionSet);
    Need::Core => "xrCreateAction" action::create_action(set: sys::ActionSet, info: In<sys::ActionCreateInfo>, out: Out<sys::Action>);
    Need::Core => "xrDestroyAction" action::destroy_action(action: sys::Action);
    Need::Core => "xrSuggestInteractionProfileBindings" action::suggest_bindings(handle: sys::Instance, info: In<sys::InteractionProfileSuggestedBinding>);
    Need::Core => "xrAttachSessionActionSets" action::attach(session: sys::Session, info: In<sys::SessionActionSetsAttachInfo>);
    Need::Core => "xrGetCurrentInteractionProfile" action::get_profile(session: sys::Session, top: sys::Path, out: Out<sys::InteractionProfileState>);
    Need::Core => "xrGetActionStateBoolean" action::get_boolean(session: sys::Session, info: In<sys::ActionStateGetInfo>, out: Out<sys::ActionStateBoolean>);
    Need::Core => "xrGetActionStateFloat" action::get_float(session: sys::Session, info: In<sys::ActionStateGetInfo>, out: Out<sys::ActionStateFloat>);
    Need::Core => "xrGetActionStateVector2f" action::get_vector(session: sys::Session, info: In<sys::ActionStateGetInfo>, out: Out<sys::ActionStateVector2f>);
    Need::Core => "xrGetActionStatePose" action::get_pose(session: sys::Session, info: In<sys::ActionStateGetInfo>, out: Out<sys::ActionStatePose>);
    Need::Core => "xrSyncActions" action::sync(session: sys::Session, info: In<sys::ActionsSyncInfo>);
    Need::Core => "xrEnumerateBoundSourcesForAction" action::enumerate_sources(session: sys::Session, info: In<sys::BoundSourcesForActionEnumerateInfo>, capacity: u32, count: Out<u32>, sources: Out<sys::Path>);
    Need::Core => "xrGetInputSourceLocalizedName" action::source_name(session: sys::Session, info: In<sys::InputSourceLocalizedNameGetInfo>, capacity: u32, count: Out<u32>, buffer: Out<c_char>);
    Need::Core => "xrApplyHapticFeedback" action::apply_haptic(session: sys::Session, info: In<sys::HapticActionInfo>, vibration: In<sys::HapticVibration>);
    Need::Core => "xrStopHapticFeedback" action::stop_haptic(session: sys::Session, info: In<sys::HapticActionInfo>);
    DEBUG => "xrCreateDebugUtilsMessengerEXT" debug::create_messenger(handle: sys::Instance, info: In<sys::DebugUtilsMessengerCreateInfoEXT>, out: Out<sys::DebugUtilsMessengerEXT>);
    DEBUG => "xrDestroyDebugUtilsMessengerEXT" debug::destroy_messenger(handle: sys::DebugUtilsMessengerEXT);
    DEBUG => "xrSubmitDebugUtilsMessageEXT" debug::submit_message(handle: sys::Instance, severity: sys::DebugUtilsMessageSeverityFlagsEXT, types: sys::DebugUtilsMessageTypeFlagsEXT, data: In<sys::DebugUtilsMessengerCallbackDataEXT>);
    DEBUG => "xrSetDebugUtilsObjectNameEXT" debug::set_object_name(handle: sys::Instance, info: In<sys::DebugUtilsObjectNameInfoEXT>);
    DEBUG => "xrSessionBeginDebugUtilsLabelRegionEXT" debug::begin_label(session: sys::Session, label: In<sys::DebugUtilsLabelEXT>);
    DEBUG => "xrSessionEndDebugUtilsLabelRegionEXT" debug::end_label(session: sys::Session);
    DEBUG => "xrSessionInsertDebugUtilsLabelEXT" debug::insert_label(session: sys::Session, label: In<sys::DebugUtilsLabelEXT>);
    LOCATE_SPACES => "xrLocateSpacesKHR" space::locate_spaces_khr(session: sys::Session, info: In<sys::SpacesLocateInfo>, out: Out<sys::SpaceLocations>);
    REFRESH_RATE => "xrEnumerateDisplayRefreshRatesFB" headset::enumerate_refresh_rates(session: sys::Session, capacity: u32, count: Out<u32>, rates: Out<f32>);
    REFRESH_RATE => "xrGetDisplayRefreshRateFB" headset::get_refresh_rate(session: sys::Session, out: Out<f32>);
    REFRESH_RATE => "xrRequestDisplayRefreshRateFB" headset::request_refresh_rate(session: sys::Session, hz: f32);
    VISIBILITY_MASK => "xrGetVisibilityMaskKHR" headset::get_visibility_mask(session: sys::Session, kind: sys::ViewConfigurationType, view: u32, mask: sys::VisibilityMaskTypeKHR, out: Out<sys::VisibilityMaskKHR>);
    PERFORMANCE => "xrPerfSettingsSetPerformanceLevelEXT" headset::set_performance_level(session: sys::Session, domain: sys::PerfSettingsDomainEXT, level: sys::PerfSettingsLevelEXT);
    TIMESPEC => "xrConvertTimeToTimespecTimeKHR" headset::timespec_from_time(handle: sys::Instance, time: sys::Time, out: Out<headset::Timespec>);
    TIMESPEC => "xrConvertTimespecTimeToTimeKHR" headset::time_from_timespec(handle: sys::Instance, timespec: In<headset::Timespec>, out: Out<sys::Time>);
    AUTOMATION => "xrSetInputDeviceActiveEXT" automation::set_active(session: sys::Session, profile: sys::Path, top: sys::Path, active: sys::Bool32);
    AUTOMATION => "xrSetInputDeviceStateBoolEXT" automation::set_boolean(session: sys::Session, top: sys::Path, source: sys::Path, value: sys::Bool32);
    AUTOMATION => "xrSetInputDeviceStateFloatEXT" automation::set_float(session: sys::Session, top: sys::Path, source: sys::Path, value: f32);
    AUTOMATION => "xrSetInputDeviceStateVector2fEXT" automation::set_vector(session: sys::Session, top: sys::Path, source: sys::Path, value: sys::Vector2f);
    AUTOMATION => "xrSetInputDeviceLocationEXT" automation::set_location(session: sys::Session, top: sys::Path, source: sys::Path, space: sys::Space, pose: sys::Posef);
    HANDS => "xrCreateHandTrackerEXT" hand::create_tracker(session: sys::Session, info: In<sys::HandTrackerCreateInfoEXT>, out: Out<sys::HandTrackerEXT>);
    HANDS => "xrDestroyHandTrackerEXT" hand::destroy_tracker(tracker: sys::HandTrackerEXT);
    HANDS => "xrLocateHandJointsEXT" hand::locate_joints(tracker: sys::HandTrackerEXT, info: In<sys::HandJointsLocateInfoEXT>, out: Out<sys::HandJointLocationsEXT>);
    ENABLE => "xrGetVulkanInstanceExtensionsKHR" vulkan::get_instance_extensions(handle: sys::Instance, system: sys::SystemId, capacity: u32, count: Out<u32>, buffer: Out<c_char>);
    ENABLE => "xrGetVulkanDeviceExtensionsKHR" vulkan::get_device_extensions(handle: sys::Instance, system: sys::SystemId, capacity: u32, count: Out<u32>, buffer: Out<c_char>);
    ENABLE => "xrGetVulkanGraphicsDeviceKHR" vulkan::get_device_of(handle: sys::Instance, system: sys::SystemId, vulkan: platform::VkInstance, out: Out<platform::VkPhysicalDevice>);
    ENABLE => "xrGetVulkanGraphicsRequirementsKHR" vulkan::get_requirements(handle: sys::Instance, system: sys::SystemId, out: Out<sys::GraphicsRequirementsVulkanKHR>);
    ENABLE2 => "xrGetVulkanGraphicsRequirements2KHR" vulkan::get_requirements2(handle: sys::Instance, system: sys::SystemId, out: Out<sys::GraphicsRequirementsVulkanKHR>);
    ENABLE2 => "xrCreateVulkanInstanceKHR" vulkan::create_vulkan_instance(handle: sys::Instance, info: In<sys::VulkanInstanceCreateInfoKHR>, out: Out<platform::VkInstance>, result: Out<platform::VkResult>);
    ENABLE2 => "xrGetVulkanGraphicsDevice2KHR" vulkan::get_device(handle: sys::Instance, info: In<sys::VulkanGraphicsDeviceGetInfoKHR>, out: Out<platform::VkPhysicalDevice>);
    ENABLE2 => "xrCreateVulkanDeviceKHR" vulkan::create_vulkan_device(handle: sys::Instance, info: In<sys::VulkanDeviceCreateInfoKHR>, out: Out<platform::VkDevice>, result: Out<platform::VkResult>);
}

/// The names of all commands, `xrGetInstanceProcAddr` first.
pub fn function_names() -> impl Iterator<Item = &'static str> {
    std::iter::once(PROC_ADDR).chain(Commands::<0>::ALL.iter().map(|command| command.name))
}

const PROC_ADDR: &str = "xrGetInstanceProcAddr";

type Lookup = Out<Option<sys::pfn::VoidFunction>>;

extern "system" fn get_proc_addr<const SLOT: usize>(
    handle: sys::Instance,
    name: In<c_char>,
    out: Lookup,
) -> Code {
    // SAFETY: a function pointer; the application casts it back to its own signature.
    let own = unsafe {
        std::mem::transmute::<
            extern "system" fn(sys::Instance, In<c_char>, Lookup) -> Code,
            sys::pfn::VoidFunction,
        >(get_proc_addr::<SLOT>)
    };
    look_up(SLOT, Commands::<SLOT>::ALL, own, handle, name, out)
}

fn look_up(
    slot: usize,
    commands: &'static [Command],
    own: sys::pfn::VoidFunction,
    handle: sys::Instance,
    name: In<c_char>,
    out: Lookup,
) -> Code {
    enter(slot, PROC_ADDR, |shared| {
        out.check()?;
        out.write(None);
        let name = name.text()?;
        let command = commands.iter().find(|command| command.name == name);
        let state = shared.lock();
        if handle == sys::Instance::NULL {
            let Some(command) = command.filter(|command| command.need == Need::Nothing) else {
                return Err(misuse(Code::ERROR_HANDLE_INVALID, format!("{name} needs an instance")));
            };
            out.write(Some(command.address));
            return Ok(Code::SUCCESS);
        }
        let instance = state.instances.get(handle)?;
        let available = |need: Need| match need {
            Need::Nothing | Need::Core => true,
            Need::Version(major, minor) => instance.version >= (major, minor),
            Need::Extension(extension) => instance.has(extension),
        };
        let address = match command {
            Some(command) if available(command.need) => command.address,
            None if name == PROC_ADDR => own,
            _ => {
                return Err(refusal(
                    Code::ERROR_FUNCTION_UNSUPPORTED,
                    format!("{name} is not offered to this instance"),
                ));
            }
        };
        out.write(Some(address));
        Ok(Code::SUCCESS)
    })
}

/// `xrGetInstanceProcAddr` of a slot; of `LIBRARY` too.
pub fn proc_addr_of(slot: usize) -> Option<sys::pfn::GetInstanceProcAddr> {
    PROC_ADDRS.get(slot).map(|address| {
        // SAFETY: In and Out are as wide as the pointers they stand for.
        unsafe {
            std::mem::transmute::<
                extern "system" fn(sys::Instance, In<c_char>, Lookup) -> Code,
                sys::pfn::GetInstanceProcAddr,
            >(*address)
        }
    })
}

macro_rules! proc_addrs {
    ($($slot:literal)*) => { [$(get_proc_addr::<$slot>),*] };
}

static PROC_ADDRS: [extern "system" fn(sys::Instance, In<c_char>, Lookup) -> Code; SLOTS + 1] = proc_addrs!(
    0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32
);
