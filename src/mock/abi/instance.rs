//! Instances, events, the system and its view configuration.
#![allow(unsafe_code, reason = "follows the pointers inside verified structures")]

use std::{ffi::c_char, sync::Arc};

use openxr::sys::{self, Handle as _};

use super::{
    debug, hand,
    pointer::{In, Out, OutArray, fixed_chars, fixed_text, texts},
};
use crate::mock::{
    fault::{Outcome, misuse, refusal, require},
    journal::Leak,
    state::{
        Shared,
        debug::{Message, about},
        instance::InstanceRequest,
    },
};

const OK: Outcome<sys::Result> = Ok(sys::Result::SUCCESS);

pub fn enumerate_layers(
    _: &Arc<Shared>,
    capacity: u32,
    count: Out<u32>,
    layers: Out<sys::ApiLayerProperties>,
) -> Outcome<sys::Result> {
    let layers = OutArray { capacity, count, items: layers };
    layers.fill([].into_iter())?;
    OK
}

pub fn enumerate_extensions(
    shared: &Arc<Shared>,
    layer: In<c_char>,
    capacity: u32,
    count: Out<u32>,
    extensions: Out<sys::ExtensionProperties>,
) -> Outcome<sys::Result> {
    if !layer.is_null() {
        return Err(refusal(sys::Result::ERROR_API_LAYER_NOT_PRESENT, "the runtime has no API layers"));
    }
    let offered: Vec<_> = shared.lock().extensions().collect();
    let out = OutArray { capacity, count, items: extensions };
    out.fill_typed(offered.len(), |i, next| sys::ExtensionProperties {
        ty: sys::ExtensionProperties::TYPE,
        next,
        extension_name: fixed_chars(offered[i].0),
        extension_version: offered[i].1,
    })?;
    OK
}

pub fn create_instance(
    shared: &Arc<Shared>,
    info_chain: In<sys::InstanceCreateInfo>,
    out: Out<sys::Instance>,
) -> Outcome<sys::Result> {
    let info = info_chain.get()?;
    out.check()?;
    require!(info.create_flags.is_empty(), ERROR_VALIDATION_FAILURE, "createFlags must be 0");
    let application = &info.application_info;
    let named = fixed_text(&application.application_name).zip(fixed_text(&application.engine_name));
    let Some((name, _)) = named else {
        return Err(misuse(
            sys::Result::ERROR_NAME_INVALID,
            "applicationName or engineName is not a terminated UTF-8 string",
        ));
    };
    let request = InstanceRequest {
        application: name.to_owned(),
        version: application.api_version,
        layers: info.enabled_api_layer_count,
        // SAFETY: the structure is verified; its arrays are the caller's promise.
        extensions: unsafe { texts(info.enabled_extension_names, info.enabled_extension_count) }?,
    };
    let asked = request.extensions.iter().any(|name| name == "XR_EXT_debug_utils");
    let messenger = match info_chain.chained::<sys::DebugUtilsMessengerCreateInfoEXT>()? {
        Some(info) if asked => Some(debug::messenger(sys::Instance::NULL, info)?),
        _ => None,
    };
    let mut state = shared.lock();
    match state.create_instance(shared, request) {
        Ok(handle) => {
            state.instance_mut(handle)?.last_messenger = messenger;
            out.write(handle);
            OK
        }
        Err(fault) => {
            drop(state);
            if let Some(messenger) = messenger {
                debug::deliver(&[messenger], &about("xrCreateInstance", &fault));
            }
            Err(fault)
        }
    }
}

pub fn destroy_instance(shared: &Arc<Shared>, handle: sys::Instance) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    let messenger = state.instances.get(handle).ok().and_then(|it| it.last_messenger);
    let already = state.journal.leaks.len();
    let done = state.destroy_instance(handle);
    let leaks = state.journal.leaks.get(already..).unwrap_or_default().to_vec();
    drop(state);
    if let Some(messenger) = messenger {
        leaks.iter().for_each(|leak| debug::deliver(&[messenger], &about_leak(leak)));
    }
    shared.changed.notify_all();
    done?;
    OK
}

fn about_leak(leak: &Leak) -> Message {
    let text = format!("{} {:#x} was alive when its instance was destroyed", leak.kind, leak.handle);
    let mut message = about("xrDestroyInstance", &refusal(sys::Result::SUCCESS, text));
    message.severity = sys::DebugUtilsMessageSeverityFlagsEXT::WARNING;
    message
}

pub fn get_instance_properties(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    out: Out<sys::InstanceProperties>,
) -> Outcome<sys::Result> {
    shared.lock().instance(handle)?;
    out.check_typed()?;
    let part = |text: &str| text.parse().unwrap_or(0);
    out.write(sys::InstanceProperties {
        ty: sys::InstanceProperties::TYPE,
        next: out.next(),
        runtime_version: sys::Version::new(
            part(env!("CARGO_PKG_VERSION_MAJOR")),
            part(env!("CARGO_PKG_VERSION_MINOR")),
            part(env!("CARGO_PKG_VERSION_PATCH")).into(),
        ),
        runtime_name: fixed_chars("Fathomless mock runtime"),
    });
    OK
}

pub fn get_system(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    info: In<sys::SystemGetInfo>,
    out: Out<sys::SystemId>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.instance(handle)?;
    let form_factor = info.get()?.form_factor;
    out.check()?;
    out.write(state.get_system(handle, form_factor)?);
    OK
}

pub fn get_system_properties(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    system: sys::SystemId,
    out: Out<sys::SystemProperties>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    state.instance(handle)?.check_system(system)?;
    out.check_typed()?;
    // What belongs to an extension that is not enabled is left as it is.
    let presence = out.chained::<sys::SystemUserPresencePropertiesEXT>()?;
    let presence = presence.filter(|_| state.instance(handle).is_ok_and(|it| it.has("XR_EXT_user_presence")));
    hand::write_properties(state.instance(handle)?, &out)?;
    let config = &state.config;
    out.write(sys::SystemProperties {
        ty: sys::SystemProperties::TYPE,
        next: out.next(),
        system_id: system,
        vendor_id: 0,
        system_name: fixed_chars("Fathomless mock headset"),
        graphics_properties: sys::SystemGraphicsProperties {
            max_swapchain_image_height: config.max_image_size[1],
            max_swapchain_image_width: config.max_image_size[0],
            max_layer_count: config.max_layers.max(1),
        },
        tracking_properties: sys::SystemTrackingProperties {
            orientation_tracking: sys::TRUE,
            position_tracking: sys::TRUE,
        },
    });
    if let Some(out) = presence {
        out.write(sys::SystemUserPresencePropertiesEXT {
            ty: sys::SystemUserPresencePropertiesEXT::TYPE,
            next: out.next(),
            supports_user_presence: config.user_presence.into(),
        });
    }
    OK
}

pub fn enumerate_view_configurations(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    system: sys::SystemId,
    capacity: u32,
    count: Out<u32>,
    kinds: Out<sys::ViewConfigurationType>,
) -> Outcome<sys::Result> {
    shared.lock().instance(handle)?.check_system(system)?;
    let out = OutArray { capacity, count, items: kinds };
    out.fill([sys::ViewConfigurationType::PRIMARY_STEREO].into_iter())?;
    OK
}

pub fn enumerate_blend_modes(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    system: sys::SystemId,
    kind: sys::ViewConfigurationType,
    capacity: u32,
    count: Out<u32>,
    modes: Out<sys::EnvironmentBlendMode>,
) -> Outcome<sys::Result> {
    shared.lock().check_view_configuration(handle, system, kind)?;
    let out = OutArray { capacity, count, items: modes };
    out.fill([sys::EnvironmentBlendMode::OPAQUE].into_iter())?;
    OK
}

pub fn get_view_configuration(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    system: sys::SystemId,
    kind: sys::ViewConfigurationType,
    out: Out<sys::ViewConfigurationProperties>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    state.check_view_configuration(handle, system, kind)?;
    out.check_typed()?;
    let fov_mutable = state.config.fov_mutable;
    out.write(sys::ViewConfigurationProperties {
        ty: sys::ViewConfigurationProperties::TYPE,
        next: out.next(),
        view_configuration_type: kind,
        fov_mutable: fov_mutable.into(),
    });
    OK
}

pub fn enumerate_views(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    system: sys::SystemId,
    kind: sys::ViewConfigurationType,
    capacity: u32,
    count: Out<u32>,
    views: Out<sys::ViewConfigurationView>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    state.check_view_configuration(handle, system, kind)?;
    let max = state.config.max_image_size;
    let eyes = [0, 1].map(|eye| state.config.eye_size_of(eye));
    let out = OutArray { capacity, count, items: views };
    out.fill_typed(state.config.view_count as usize, |i, next| sys::ViewConfigurationView {
        ty: sys::ViewConfigurationView::TYPE,
        next,
        recommended_image_rect_width: eyes[i % 2][0],
        max_image_rect_width: max[0],
        recommended_image_rect_height: eyes[i % 2][1],
        max_image_rect_height: max[1],
        recommended_swapchain_sample_count: 1,
        max_swapchain_sample_count: 1,
    })?;
    OK
}
