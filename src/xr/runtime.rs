//! The runtime and the headset behind it: extensions, versions, what the eyes want, and Vulkan made through it.

#![allow(unsafe_code, reason = "calls the C interface of the OpenXR runtime")]

use std::ffi::CStr;
use std::sync::{Mutex, PoisonError};

use anyhow::Context;
use ash::vk::{self, Handle as _};
use openxr::{
    ApplicationInfo, EnvironmentBlendMode, ExtensionSet, FormFactor, SystemId, Version,
    ViewConfigurationType, sys,
};

use super::arrays::{text, two_call};
use super::error::{Error, check};
use super::messages::Messenger;
use crate::bindings::ProfileBindings;
use crate::gpu;

/// The view configuration this module drives.
pub(super) const STEREO: ViewConfigurationType = ViewConfigurationType::PRIMARY_STEREO;

/// Extensions for controllers that the core does not know, or not before 1.1.
const CONTROLLERS: [&CStr; 5] = [
    c"XR_EXT_hand_interaction",
    c"XR_EXT_hp_mixed_reality_controller",
    c"XR_BD_controller_interaction",
    c"XR_FB_touch_controller_pro",
    c"XR_META_touch_controller_plus",
];

/// Pixels one eye wants and can have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EyeSize {
    /// Width and height at which one image pixel is about one display pixel.
    pub recommended: [u32; 2],
    /// Width and height the runtime takes at most.
    pub max: [u32; 2],
}

/// What the runtime said about itself and the headset; plain data for reports and decisions.
#[derive(Debug, Clone)]
pub struct RuntimeInfo {
    /// The runtime's name for itself.
    pub name: String,
    /// The runtime's own version.
    pub version: Version,
    /// OpenXR version in use: 1.1, or 1.0 where the runtime refused that.
    pub api_version: Version,
    /// The headset's name.
    pub headset: String,
    /// Left, right.
    pub eyes: [EyeSize; 2],
    /// Largest swapchain image of the runtime, width and height in pixels.
    pub max_image: [u32; 2],
    /// Layers that a frame may have; 0 is a runtime that forgot to say.
    pub max_layers: u32,
    /// Whether frames carry their depth (`XR_KHR_composition_layer_depth`).
    pub depth_layer: bool,
    /// Whether a cubemap can go behind the eyes' pictures (`XR_KHR_composition_layer_cube`).
    pub cube_layer: bool,
    /// Whether `XR_EXT_local_floor` is in use; part of the core since 1.1.
    pub local_floor: bool,
    /// Whether the runtime says which parts of the pictures nobody sees (`XR_KHR_visibility_mask`).
    pub visibility_mask: bool,
    /// Whether the display's rate can be chosen (`XR_FB_display_refresh_rate`).
    pub refresh_rate: bool,
    /// Whether the runtime takes hints about clock rates (`XR_EXT_performance_settings`).
    pub performance_settings: bool,
    /// Whether the runtime says when the headset is put on and taken off (`XR_EXT_user_presence`).
    pub user_presence: bool,
}

/// An open OpenXR runtime with a headset. Makes the Vulkan instance and device ([`gpu::Bootstrap`]) and sessions.
pub struct Runtime {
    /// Goes before the instance that it listens to.
    _messenger: Option<Messenger>,
    pub(super) instance: openxr::Instance,
    pub(super) system: SystemId,
    pub(super) blend: EnvironmentBlendMode,
    info: RuntimeInfo,
    /// Those of [`CONTROLLERS`] that are in use.
    controllers: [Option<&'static CStr>; CONTROLLERS.len()],
    /// The Vulkan loader that the instance was last made with: the device is made with the same one.
    vulkan: Mutex<Option<ash::Entry>>,
}

impl Runtime {
    /// Opens the runtime behind `entry` and finds its headset. `name` is shown to the wearer by the runtime's menus; at
    /// most 127 bytes of it are used.
    ///
    /// # Errors
    /// `Unavailable` when no runtime or no headset answers at the moment; `Unsupported` when they lack what is needed
    /// (Vulkan, two eyes, OpenXR 1.0); `Lost` and `Call` as everywhere.
    pub fn open(entry: openxr::Entry, name: &str) -> Result<Self, Error> {
        let offered = offered_extensions(&entry)?;
        let has = |extension: &CStr| offered.iter().any(|o| o.as_bytes() == extension.to_bytes());
        if !has(c"XR_KHR_vulkan_enable2") {
            return Err(Error::Unsupported(
                "the OpenXR runtime cannot work with Vulkan (no XR_KHR_vulkan_enable2): update the headset's software".into(),
            ));
        }
        let depth_layer = has(c"XR_KHR_composition_layer_depth");
        let cube_layer = has(c"XR_KHR_composition_layer_cube");
        let visibility_mask = has(c"XR_KHR_visibility_mask");
        let refresh_rate = has(c"XR_FB_display_refresh_rate");
        let performance_settings = has(c"XR_EXT_performance_settings");
        let user_presence = has(c"XR_EXT_user_presence");
        let debug_utils = has(c"XR_EXT_debug_utils");
        let controllers = CONTROLLERS.map(|name| has(name).then_some(name));
        let [hands, reverb, pico, touch_pro, touch_plus] = controllers.map(|name| name.is_some());
        // Where hands are controllers, nobody asks for their joints.
        let joints = !hands && has(c"XR_EXT_hand_tracking");
        let create = |api_version, local_floor| {
            let mut extensions = ExtensionSet::default();
            extensions.khr_vulkan_enable2 = true;
            extensions.khr_composition_layer_depth = depth_layer;
            extensions.khr_composition_layer_cube = cube_layer;
            extensions.ext_local_floor = local_floor;
            extensions.khr_visibility_mask = visibility_mask;
            extensions.fb_display_refresh_rate = refresh_rate;
            extensions.ext_performance_settings = performance_settings;
            extensions.ext_user_presence = user_presence;
            extensions.ext_debug_utils = debug_utils;
            extensions.ext_hand_interaction = hands;
            extensions.ext_hand_tracking = joints;
            extensions.ext_hp_mixed_reality_controller = reverb;
            extensions.bd_controller_interaction = pico;
            extensions.fb_touch_controller_pro = touch_pro;
            extensions.meta_touch_controller_plus = touch_plus;
            let application = ApplicationInfo {
                application_name: shortened(name),
                application_version: 1,
                engine_name: env!("CARGO_PKG_NAME"),
                engine_version: 1,
                api_version,
            };
            entry.create_instance(&application, &extensions, &[], &())
        };
        let (new, old) = (Version::new(1, 1, 0), Version::new(1, 0, 0));
        let mut local_floor = false;
        let mut api_version = new;
        let mut created = create(new, local_floor);
        if created.as_ref().err() == Some(&sys::Result::ERROR_API_VERSION_UNSUPPORTED) {
            tracing::debug!("the OpenXR runtime refuses API 1.1, asking for 1.0");
            local_floor = has(c"XR_EXT_local_floor");
            api_version = old;
            created = create(old, local_floor);
        }
        let instance = created.map_err(|code| Error::from_code("xrCreateInstance", code))?;

        let mut properties = sys::InstanceProperties {
            ty: sys::InstanceProperties::TYPE,
            next: std::ptr::null_mut(),
            runtime_version: Version::default(),
            runtime_name: [0; sys::MAX_RUNTIME_NAME_SIZE],
        };
        // SAFETY: a live instance and a properly typed structure to fill.
        let code = unsafe { (instance.fp().get_instance_properties)(instance.as_raw(), &mut properties) };
        check("xrGetInstanceProperties", code)?;
        let nothing = EyeSize { recommended: [0; 2], max: [0; 2] };
        let mut runtime = Self {
            _messenger: Messenger::new(&instance)?,
            instance,
            system: SystemId::NULL,
            blend: EnvironmentBlendMode::OPAQUE,
            info: RuntimeInfo {
                name: text(&properties.runtime_name),
                version: properties.runtime_version,
                api_version,
                headset: String::new(),
                eyes: [nothing; 2],
                max_image: [0; 2],
                max_layers: 0,
                depth_layer,
                cube_layer,
                local_floor,
                visibility_mask,
                refresh_rate,
                performance_settings,
                user_presence,
            },
            controllers,
            vulkan: Mutex::new(None),
        };
        runtime.find_headset()?;
        Ok(runtime)
    }

    /// Looks for the headset again, after the session was lost: it may be a different one now.
    ///
    /// # Errors
    /// `Unavailable` while none answers, `Unsupported` when it is of no use.
    pub fn find_headset(&mut self) -> Result<(), Error> {
        self.system = self
            .instance
            .system(FormFactor::HEAD_MOUNTED_DISPLAY)
            .map_err(|code| Error::from_code("xrGetSystem", code))?;
        self.read_system()?;
        self.info.eyes = self.read_eyes()?;
        self.blend = self.choose_blend()?;
        Ok(())
    }

    /// What the runtime said about itself and the headset.
    pub fn info(&self) -> &RuntimeInfo {
        &self.info
    }

    /// Whether the runtime knows the controllers of these bindings, so that it may be told of them.
    pub(super) fn knows(&self, bindings: &ProfileBindings) -> bool {
        let version = self.info.api_version;
        let is_in_use =
            |name: &str| self.controllers.iter().flatten().any(|it| it.to_bytes() == name.as_bytes());
        bindings.is_offered((version.major(), version.minor()), is_in_use)
    }

    fn read_system(&mut self) -> Result<(), Error> {
        let mut properties = sys::SystemProperties {
            ty: sys::SystemProperties::TYPE,
            next: std::ptr::null_mut(),
            system_id: self.system,
            vendor_id: 0,
            system_name: [0; sys::MAX_SYSTEM_NAME_SIZE],
            graphics_properties: sys::SystemGraphicsProperties::default(),
            tracking_properties: sys::SystemTrackingProperties::default(),
        };
        // SAFETY: a live instance, its system, and a properly typed structure to fill.
        let code = unsafe {
            (self.instance.fp().get_system_properties)(self.instance.as_raw(), self.system, &mut properties)
        };
        check("xrGetSystemProperties", code)?;
        let graphics = properties.graphics_properties;
        self.info.headset = text(&properties.system_name);
        self.info.max_image = [graphics.max_swapchain_image_width, graphics.max_swapchain_image_height];
        self.info.max_layers = graphics.max_layer_count;
        Ok(())
    }

    fn read_eyes(&self) -> Result<[EyeSize; 2], Error> {
        let (fp, instance) = (self.instance.fp(), self.instance.as_raw());
        let empty = sys::ViewConfigurationView {
            ty: sys::ViewConfigurationView::TYPE,
            next: std::ptr::null_mut(),
            recommended_image_rect_width: 0,
            max_image_rect_width: 0,
            recommended_image_rect_height: 0,
            max_image_rect_height: 0,
            recommended_swapchain_sample_count: 0,
            max_swapchain_sample_count: 0,
        };
        let views = two_call(empty, |capacity, count, out| {
            // SAFETY: `out` has room for `capacity` properly typed elements.
            unsafe {
                (fp.enumerate_view_configuration_views)(instance, self.system, STEREO, capacity, count, out)
            }
        })
        .map_err(|code| Error::from_code("xrEnumerateViewConfigurationViews", code))?;
        let Ok([left, right]) = <[_; 2]>::try_from(views) else {
            return Err(Error::from_code(
                "xrEnumerateViewConfigurationViews",
                sys::Result::ERROR_VIEW_CONFIGURATION_TYPE_UNSUPPORTED,
            ));
        };
        Ok([left, right].map(|view| EyeSize {
            recommended: [view.recommended_image_rect_width, view.recommended_image_rect_height],
            max: [view.max_image_rect_width, view.max_image_rect_height],
        }))
    }

    /// Opaque where the headset is, else what it prefers (see-through glasses).
    fn choose_blend(&self) -> Result<EnvironmentBlendMode, Error> {
        let (fp, instance) = (self.instance.fp(), self.instance.as_raw());
        let modes = two_call(EnvironmentBlendMode::OPAQUE, |capacity, count, out| {
            // SAFETY: `out` has room for `capacity` elements.
            unsafe {
                (fp.enumerate_environment_blend_modes)(instance, self.system, STEREO, capacity, count, out)
            }
        })
        .map_err(|code| Error::from_code("xrEnumerateEnvironmentBlendModes", code))?;
        if modes.contains(&EnvironmentBlendMode::OPAQUE) {
            return Ok(EnvironmentBlendMode::OPAQUE);
        }
        modes.first().copied().ok_or_else(|| {
            Error::Unsupported(
                "the OpenXR runtime offers no way to show a picture: update the headset's software".into(),
            )
        })
    }

    /// The runtime's demands on Vulkan, which it wants asked before anything is made with it: lowest and highest version.
    pub(super) fn graphics_requirements(&self) -> Result<(Version, Version), Error> {
        let needs = self
            .instance
            .graphics_requirements::<openxr::Vulkan>(self.system)
            .map_err(|code| Error::from_code("xrGetVulkanGraphicsRequirements2KHR", code))?;
        Ok((needs.min_api_version_supported, needs.max_api_version_supported))
    }

    /// Refuses a Vulkan version that the runtime does not take. `wanted` is a packed Vulkan version, 0 meaning 1.0.
    fn check_vulkan_version(&self, wanted: u32) -> Result<(), Error> {
        let (low, high) = self.graphics_requirements()?;
        let wanted = Version::new(
            vk::api_version_major(wanted).max(1) as u16,
            vk::api_version_minor(wanted) as u16,
            0,
        );
        let minor = |v: Version| (v.major(), v.minor());
        if minor(wanted) < minor(low) {
            return Err(Error::Unsupported(format!(
                "the OpenXR runtime asks for Vulkan {}.{} or later, which this program does not use: take an older runtime",
                low.major(),
                low.minor()
            )));
        }
        if minor(wanted) > minor(high) {
            // The highest version is the highest tried by the runtime's makers, not a limit.
            tracing::warn!("the OpenXR runtime was made for Vulkan up to {high}, {wanted} is used");
        }
        Ok(())
    }
}

impl gpu::Bootstrap for Runtime {
    fn create_instance(
        &self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
    ) -> anyhow::Result<vk::Instance> {
        // SAFETY: the pointer of a create-info is null or points to an application-info that lives as long.
        let application = unsafe { info.p_application_info.as_ref() };
        self.check_vulkan_version(application.map_or(0, |a| a.api_version))?;
        *self.vulkan.lock().unwrap_or_else(PoisonError::into_inner) = Some(entry.clone());
        // SAFETY: `get_instance_proc_addr` is the Vulkan loader's, only its type's spelling differs between the two
        // bindings; `info` is a valid create-info.
        let made = unsafe {
            self.instance.create_vulkan_instance(
                self.system,
                vulkan_loader(entry),
                std::ptr::from_ref(info).cast(),
            )
        };
        let made = made
            .map_err(|code| Error::from_code("xrCreateVulkanInstanceKHR", code))?
            .map_err(vk::Result::from_raw);
        if made == Err(vk::Result::ERROR_INCOMPATIBLE_DRIVER) {
            anyhow::bail!(gpu::NO_DRIVER);
        }
        let raw = made
            .context("the OpenXR runtime could not make the Vulkan instance: check the Vulkan driver with `vulkaninfo`")?;
        Ok(vk::Instance::from_raw(raw as u64))
    }

    fn physical_device(&self, instance: &ash::Instance) -> anyhow::Result<vk::PhysicalDevice> {
        // SAFETY: the instance was made by `create_instance` above.
        let raw =
            unsafe { self.instance.vulkan_graphics_device(self.system, instance.handle().as_raw() as _) }
                .map_err(|code| Error::from_code("xrGetVulkanGraphicsDevice2KHR", code))?;
        Ok(vk::PhysicalDevice::from_raw(raw as u64))
    }

    fn create_device(
        &self,
        _instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> anyhow::Result<vk::Device> {
        let entry = self.vulkan.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let entry = entry.context(
            "the OpenXR runtime makes a Vulkan device only in a Vulkan instance that it made: make the instance first",
        )?;
        // SAFETY: the physical device is the runtime's own choice, `info` a valid create-info for it.
        let made = unsafe {
            self.instance.create_vulkan_device(
                self.system,
                vulkan_loader(&entry),
                physical.as_raw() as _,
                std::ptr::from_ref(info).cast(),
            )
        };
        let raw = made
            .map_err(|code| Error::from_code("xrCreateVulkanDeviceKHR", code))?
            .map_err(vk::Result::from_raw)
            .context("the OpenXR runtime could not make the Vulkan device: update the GPU's driver")?;
        Ok(vk::Device::from_raw(raw as u64))
    }
}

/// The Vulkan loader's `vkGetInstanceProcAddr`, typed as the OpenXR bindings spell it.
fn vulkan_loader(entry: &ash::Entry) -> sys::platform::VkGetInstanceProcAddr {
    // SAFETY: the same C function type; a dispatchable Vulkan handle is a pointer.
    unsafe {
        std::mem::transmute::<vk::PFN_vkGetInstanceProcAddr, sys::platform::VkGetInstanceProcAddr>(
            entry.static_fn().get_instance_proc_addr,
        )
    }
}

pub(super) fn offered_extensions(entry: &openxr::Entry) -> Result<Vec<String>, Error> {
    let empty = sys::ExtensionProperties {
        ty: sys::ExtensionProperties::TYPE,
        next: std::ptr::null_mut(),
        extension_name: [0; sys::MAX_EXTENSION_NAME_SIZE],
        extension_version: 0,
    };
    let offered = two_call(empty, |capacity, count, out| {
        // SAFETY: no layer is named; `out` has room for `capacity` properly typed elements.
        unsafe {
            (entry.fp().enumerate_instance_extension_properties)(std::ptr::null(), capacity, count, out)
        }
    })
    .map_err(|code| Error::from_code("xrEnumerateInstanceExtensionProperties", code))?;
    Ok(offered.iter().map(|o| text(&o.extension_name)).collect())
}

/// As much of a name as OpenXR's field holds.
fn shortened(name: &str) -> &str {
    let room = sys::MAX_APPLICATION_NAME_SIZE - 1;
    let end = (0..=name.len().min(room)).rev().find(|&i| name.is_char_boundary(i));
    &name[..end.unwrap_or(0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_are_cut_between_characters() {
        assert_eq!(shortened("Fathomless"), "Fathomless");
        let long = "é".repeat(100);
        assert_eq!(shortened(&long).len(), 126);
        assert!(long.starts_with(shortened(&long)));
    }
}
