//! The structures that functions are given, each field mostly good and sometimes nonsense.
#![allow(unsafe_code, reason = "memory for raw calls")]

use std::{
    ffi::{c_char, c_void},
    mem,
    ptr::{self, null},
};

use ash::vk::{self, Handle as _};
use openxr::sys::{self, Handle as _};

use crate::{ENOUGH, Kind::*, Run, USER_PATHS, barren_loader, listen};

impl Run<'_> {
    pub fn instance_info(&mut self) -> u64 {
        let minor = self.dice.pick(&[0, 1]);
        let version = if self.odd() {
            let any = self.dice.word();
            self.dice.pick(&[0, u64::MAX, 2 << 48, (1 << 48) | (2 << 32), any])
        } else {
            (1 << 48) | (minor << 32)
        };
        let mut names: Vec<String> = self.offered.clone();
        if self.dice.once_in(3) {
            let absent = self.dice.below(names.len());
            names.remove(absent);
        }
        let mut texts = Vec::new();
        for name in &names {
            texts.push(if self.odd() && self.dice.once_in(8) {
                self.text("XR_EXT_nobody_knows")
            } else {
                self.arena.text(name.as_bytes())
            });
        }
        self.doomed = false;
        let odd = self.odd();
        let layers = if odd { self.count(&[0, 1]) } else { 0 };
        let layer_names: Vec<*const c_char> =
            (0..8).map(|_| self.optional_text("XR_APILAYER_none")).collect();
        let info = sys::InstanceCreateInfo {
            ty: sys::InstanceCreateInfo::TYPE,
            next: null(),
            create_flags: sys::InstanceCreateFlags::from_raw(self.bits(&[0])),
            application_info: sys::ApplicationInfo {
                application_name: self.name(),
                application_version: self.count(&[1]),
                engine_name: self.name(),
                engine_version: self.count(&[1]),
                api_version: sys::Version::from_raw(version),
            },
            enabled_api_layer_count: layers.min(8),
            enabled_api_layer_names: self.arena.array(&layer_names),
            enabled_extension_count: texts.len() as u32,
            enabled_extension_names: if self.odd() { null() } else { self.arena.array(&texts) },
        };
        let mut info = info;
        if self.dice.once_in(2) {
            info.next = self.messenger_info().cast();
        }
        self.doomed = false;
        self.input(info)
    }

    pub fn messenger_info(&mut self) -> *mut sys::DebugUtilsMessengerCreateInfoEXT {
        let info = sys::DebugUtilsMessengerCreateInfoEXT {
            ty: sys::DebugUtilsMessengerCreateInfoEXT::TYPE,
            next: null(),
            message_severities: sys::DebugUtilsMessageSeverityFlagsEXT::from_raw(
                self.bits(&[0x1111, 0x1000]),
            ),
            message_types: sys::DebugUtilsMessageTypeFlagsEXT::from_raw(self.bits(&[0xF, 2])),
            user_callback: if self.odd() { None } else { Some(listen) },
            user_data: ptr::null_mut(),
        };
        self.put(info)
    }

    pub fn session_info(&mut self) -> u64 {
        let binding = self.graphics && !self.dice.once_in(4) || self.odd();
        let real = self.graphics && !self.odd();
        let binding = binding.then(|| sys::GraphicsBindingVulkanKHR {
            ty: sys::GraphicsBindingVulkanKHR::TYPE,
            next: null(),
            instance: if real { self.vulkan.instance.handle().as_raw() as _ } else { null() },
            physical_device: self.vulkan.physical.as_raw() as _,
            device: if real { self.vulkan.device.handle().as_raw() as _ } else { null() },
            queue_family_index: self.count(&[self.vulkan.family]),
            queue_index: self.count(&[0]),
        });
        let info = sys::SessionCreateInfo {
            ty: sys::SessionCreateInfo::TYPE,
            next: binding.map_or(null(), |binding| self.put(binding).cast_const().cast()),
            create_flags: sys::SessionCreateFlags::from_raw(self.bits(&[0])),
            system_id: sys::SystemId::from_raw(self.system()),
        };
        self.input(info)
    }

    pub fn stereo(&mut self) -> i32 {
        self.number(&[sys::ViewConfigurationType::PRIMARY_STEREO.into_raw()])
    }

    pub fn space_type(&mut self) -> i32 {
        self.number(&[1, 2, 3, sys::ReferenceSpaceType::LOCAL_FLOOR.into_raw()])
    }

    pub fn spaces_info(&mut self) -> [u64; 2] {
        let count = self.dice.below(5) as u32;
        let spaces: Vec<_> = (0..count).map(|_| sys::Space::from_raw(self.handle(Space))).collect();
        let info = sys::SpacesLocateInfo {
            ty: sys::SpacesLocateInfo::TYPE,
            next: null(),
            base_space: sys::Space::from_raw(self.handle(Space)),
            time: sys::Time::from_nanos(self.time()),
            space_count: count,
            spaces: if self.odd() { null() } else { self.arena.array(&spaces) },
        };
        let info = self.input(info);
        // SAFETY: plain numbers, valid as zeros.
        let (place, velocity) = unsafe { mem::zeroed::<(sys::SpaceLocationData, sys::SpaceVelocityData)>() };
        let velocities = sys::SpaceVelocities {
            ty: sys::SpaceVelocities::TYPE,
            next: ptr::null_mut(),
            velocity_count: self.count(&[count]),
            velocities: self.arena.array(&vec![velocity; count as usize]),
        };
        let chained = if self.dice.once_in(2) { self.put(velocities).cast() } else { ptr::null_mut() };
        let locations = sys::SpaceLocations {
            ty: sys::SpaceLocations::TYPE,
            next: chained,
            location_count: self.count(&[count]),
            locations: if self.odd() {
                ptr::null_mut()
            } else {
                self.arena.array(&vec![place; count as usize])
            },
        };
        [info, self.input(locations)]
    }

    pub fn swapchain_info(&mut self) -> u64 {
        let colour = !self.dice.once_in(4);
        let format = if colour { vk::Format::R8G8B8A8_SRGB } else { vk::Format::D32_SFLOAT };
        let usage = if colour { 0x11 } else { 0x12 };
        let any = self.dice.word() as i64;
        let info = sys::SwapchainCreateInfo {
            ty: sys::SwapchainCreateInfo::TYPE,
            next: null(),
            create_flags: sys::SwapchainCreateFlags::from_raw(self.bits(&[0, 0, 0, 2])),
            usage_flags: sys::SwapchainUsageFlags::from_raw(self.bits(&[usage])),
            format: if self.odd() { any } else { i64::from(format.as_raw()) },
            sample_count: self.count(&[1]),
            width: self.count(&[8]),
            height: self.count(&[8]),
            face_count: self.count(&[1, 1, 1, 6]),
            array_size: self.count(&[1, 2]),
            mip_count: self.count(&[1]),
        };
        self.input(info)
    }

    pub fn sub_image(&mut self) -> sys::SwapchainSubImage {
        sys::SwapchainSubImage {
            swapchain: sys::Swapchain::from_raw(self.handle(Swapchain)),
            image_rect: sys::Rect2Di {
                offset: sys::Offset2Di { x: self.number(&[0]), y: self.number(&[0]) },
                extent: sys::Extent2Di { width: self.number(&[8]), height: self.number(&[8]) },
            },
            image_array_index: self.count(&[0]),
        }
    }

    pub fn layer(&mut self) -> *const sys::CompositionLayerBaseHeader {
        let layer_flags = sys::CompositionLayerFlags::from_raw(self.bits(&[0, 2, 4]));
        let space = sys::Space::from_raw(self.handle(Space));
        let eye_visibility = sys::EyeVisibility::from_raw(self.number(&[0, 1, 2]));
        let layer = match self.dice.below(4) {
            0 => {
                let mut views = Vec::new();
                for _ in 0..self.count(&[2]).min(4) {
                    let [left, right] = [self.float(&[-0.7]), self.float(&[0.7])];
                    let depth = sys::CompositionLayerDepthInfoKHR {
                        ty: sys::CompositionLayerDepthInfoKHR::TYPE,
                        next: null(),
                        sub_image: self.sub_image(),
                        min_depth: self.float(&[0.0]),
                        max_depth: self.float(&[1.0]),
                        near_z: self.float(&[0.1, f32::INFINITY]),
                        far_z: self.float(&[100.0]),
                    };
                    let depth = if self.dice.once_in(3) { self.input(depth) } else { 0 };
                    let view = sys::CompositionLayerProjectionView {
                        ty: sys::CompositionLayerProjectionView::TYPE,
                        next: depth as *const c_void,
                        pose: self.pose(),
                        fov: sys::Fovf {
                            angle_left: left,
                            angle_right: right,
                            angle_up: self.float(&[0.7]),
                            angle_down: self.float(&[-0.7]),
                        },
                        sub_image: self.sub_image(),
                    };
                    views.push(view);
                }
                let layer = sys::CompositionLayerProjection {
                    ty: sys::CompositionLayerProjection::TYPE,
                    next: null(),
                    layer_flags,
                    space,
                    view_count: views.len() as u32,
                    views: if self.odd() { null() } else { self.arena.array(&views) },
                };
                self.input(layer)
            }
            1 => {
                let layer = sys::CompositionLayerQuad {
                    ty: sys::CompositionLayerQuad::TYPE,
                    next: null(),
                    layer_flags,
                    space,
                    eye_visibility,
                    sub_image: self.sub_image(),
                    pose: self.pose(),
                    size: sys::Extent2Df { width: self.float(&[1.0]), height: self.float(&[1.0]) },
                };
                self.input(layer)
            }
            2 => {
                let layer = sys::CompositionLayerCylinderKHR {
                    ty: sys::CompositionLayerCylinderKHR::TYPE,
                    next: null(),
                    layer_flags,
                    space,
                    eye_visibility,
                    sub_image: self.sub_image(),
                    pose: self.pose(),
                    radius: self.float(&[0.0, 1.0]),
                    central_angle: self.float(&[1.0]),
                    aspect_ratio: self.float(&[1.0]),
                };
                self.input(layer)
            }
            _ => {
                let layer = sys::CompositionLayerCubeKHR {
                    ty: sys::CompositionLayerCubeKHR::TYPE,
                    next: null(),
                    layer_flags,
                    space,
                    eye_visibility,
                    swapchain: sys::Swapchain::from_raw(self.handle(Swapchain)),
                    image_array_index: self.count(&[0]),
                    orientation: self.turn(),
                };
                self.input(layer)
            }
        };
        layer as *const sys::CompositionLayerBaseHeader
    }

    pub fn frame_end(&mut self) -> u64 {
        let most = if self.graphics { 4 } else { 2 };
        let layers: Vec<_> = (0..self.dice.below(most)).map(|_| self.layer()).collect();
        self.doomed = false;
        let too_many = self.odd() && self.dice.once_in(2);
        let info = sys::FrameEndInfo {
            ty: sys::FrameEndInfo::TYPE,
            next: null(),
            display_time: sys::Time::from_nanos(self.time()),
            environment_blend_mode: sys::EnvironmentBlendMode::from_raw(self.number(&[1])),
            layer_count: if too_many { self.dice.pick(&[17, u32::MAX]) } else { layers.len() as u32 },
            layers: if self.odd() { null() } else { self.arena.array(&layers).cast_const().cast() },
        };
        self.input(info)
    }

    pub fn action_info(&mut self) -> u64 {
        let paths: Vec<_> = (0..self.dice.below(3)).map(|i| self.path_of(USER_PATHS[i])).collect();
        let info = sys::ActionCreateInfo {
            ty: sys::ActionCreateInfo::TYPE,
            next: null(),
            action_name: self.name(),
            action_type: sys::ActionType::from_raw(self.number(&[1, 2, 3, 4, 4, 100])),
            count_subaction_paths: paths.len() as u32,
            subaction_paths: if self.odd() { null() } else { self.arena.array(&paths).cast_const().cast() },
            localized_action_name: self.name(),
        };
        self.input(info)
    }

    pub fn suggestion(&mut self) -> u64 {
        let (profile, first) = self.component();
        let mut bindings = Vec::new();
        for i in 0..self.dice.below(5) {
            let text = if i == 0 || self.odd() { first.clone() } else { self.component().1 };
            bindings.push(sys::ActionSuggestedBinding {
                action: sys::Action::from_raw(self.handle(Action)),
                binding: sys::Path::from_raw(self.path_of(&text)),
            });
        }
        let info = sys::InteractionProfileSuggestedBinding {
            ty: sys::InteractionProfileSuggestedBinding::TYPE,
            next: null(),
            interaction_profile: sys::Path::from_raw(self.path_of(profile.path)),
            count_suggested_bindings: bindings.len() as u32,
            suggested_bindings: if self.odd() { null() } else { self.arena.array(&bindings) },
        };
        self.input(info)
    }

    pub fn state_info(&mut self) -> u64 {
        let info = sys::ActionStateGetInfo {
            ty: sys::ActionStateGetInfo::TYPE,
            next: null(),
            action: sys::Action::from_raw(self.handle(Action)),
            subaction_path: sys::Path::from_raw(self.user_path()),
        };
        self.input(info)
    }

    pub fn haptic_info(&mut self) -> u64 {
        let info = sys::HapticActionInfo {
            ty: sys::HapticActionInfo::TYPE,
            next: null(),
            action: sys::Action::from_raw(self.handle(Action)),
            subaction_path: sys::Path::from_raw(self.user_path()),
        };
        self.input(info)
    }

    pub fn label(&mut self) -> u64 {
        let label = sys::DebugUtilsLabelEXT {
            ty: sys::DebugUtilsLabelEXT::TYPE,
            next: null(),
            label_name: self.text("region"),
        };
        self.input(label)
    }

    pub fn object(&mut self) -> sys::DebugUtilsObjectNameInfoEXT {
        let kind = self.dice.pick(&[Session, Space, ActionSet, Action]);
        let number = match kind {
            Session => sys::ObjectType::SESSION,
            Space => sys::ObjectType::SPACE,
            ActionSet => sys::ObjectType::ACTION_SET,
            _ => sys::ObjectType::ACTION,
        };
        sys::DebugUtilsObjectNameInfoEXT {
            ty: sys::DebugUtilsObjectNameInfoEXT::TYPE,
            next: null(),
            object_type: sys::ObjectType::from_raw(self.number(&[number.into_raw()])),
            object_handle: self.handle(kind),
            object_name: self.optional_text("an object"),
        }
    }

    pub fn message(&mut self) -> u64 {
        let objects: Vec<_> = (0..self.dice.below(3)).map(|_| self.object()).collect();
        let data = sys::DebugUtilsMessengerCallbackDataEXT {
            ty: sys::DebugUtilsMessengerCallbackDataEXT::TYPE,
            next: null(),
            message_id: self.optional_text("id"),
            function_name: self.optional_text("xrNothing"),
            message: self.text("a message"),
            object_count: objects.len() as u32,
            objects: if self.odd() { ptr::null_mut() } else { self.arena.array(&objects) },
            session_label_count: 0,
            session_labels: ptr::null_mut(),
        };
        self.input(data)
    }

    pub fn tracker_info(&mut self) -> u64 {
        let sources: Vec<_> = (0..self.dice.below(3))
            .map(|i| sys::HandTrackingDataSourceEXT::from_raw(self.number(&[i as i32 + 1])))
            .collect();
        let sources = sys::HandTrackingDataSourceInfoEXT {
            ty: sys::HandTrackingDataSourceInfoEXT::TYPE,
            next: null(),
            requested_data_source_count: sources.len() as u32,
            requested_data_sources: if self.odd() { ptr::null_mut() } else { self.arena.array(&sources) },
        };
        let chained = if self.dice.once_in(2) { self.put(sources).cast_const().cast() } else { null() };
        let info = sys::HandTrackerCreateInfoEXT {
            ty: sys::HandTrackerCreateInfoEXT::TYPE,
            next: chained,
            hand: sys::HandEXT::from_raw(self.number(&[1, 2])),
            hand_joint_set: sys::HandJointSetEXT::from_raw(self.number(&[0])),
        };
        self.input(info)
    }

    pub fn joints(&mut self) -> u64 {
        let count = self.count(&[26]);
        let room = (count as usize).min(26);
        // SAFETY: plain numbers, valid as zeros.
        let (place, velocity) =
            unsafe { mem::zeroed::<(sys::HandJointLocationEXT, sys::HandJointVelocityEXT)>() };
        let velocities = sys::HandJointVelocitiesEXT {
            ty: sys::HandJointVelocitiesEXT::TYPE,
            next: ptr::null_mut(),
            joint_count: count,
            joint_velocities: self.arena.array(&vec![velocity; room]),
        };
        let source = sys::HandTrackingDataSourceStateEXT {
            ty: sys::HandTrackingDataSourceStateEXT::TYPE,
            next: if self.dice.once_in(2) { self.put(velocities).cast() } else { ptr::null_mut() },
            is_active: sys::FALSE,
            data_source: sys::HandTrackingDataSourceEXT::UNOBSTRUCTED,
        };
        let chained = match self.dice.below(3) {
            0 => ptr::null_mut(),
            1 => self.put(velocities).cast(),
            _ => self.put(source).cast(),
        };
        let locations = sys::HandJointLocationsEXT {
            ty: sys::HandJointLocationsEXT::TYPE,
            next: chained,
            is_active: sys::FALSE,
            joint_count: count,
            joint_locations: if self.odd() { ptr::null_mut() } else { self.arena.array(&vec![place; room]) },
        };
        self.input(locations)
    }

    pub fn mask(&mut self) -> u64 {
        let room = self.dice.pick(&[0u32, ENOUGH as u32]);
        let (vertices, indices) = (self.count(&[room]), self.count(&[room]));
        let vertex = sys::Vector2f { x: 0.0, y: 0.0 };
        let mask = sys::VisibilityMaskKHR {
            ty: sys::VisibilityMaskKHR::TYPE,
            next: ptr::null_mut(),
            vertex_capacity_input: vertices,
            vertex_count_output: 0,
            vertices: if self.odd() {
                ptr::null_mut()
            } else {
                self.arena.array(&vec![vertex; (vertices as usize).min(ENOUGH)])
            },
            index_capacity_input: indices,
            index_count_output: 0,
            indices: if self.odd() {
                ptr::null_mut()
            } else {
                self.arena.array(&vec![0u32; (indices as usize).min(ENOUGH)])
            },
        };
        self.input(mask)
    }

    pub fn vulkan_instance_info(&mut self) -> u64 {
        let empty = self.put(vk::InstanceCreateInfo::default());
        let info = sys::VulkanInstanceCreateInfoKHR {
            ty: sys::VulkanInstanceCreateInfoKHR::TYPE,
            next: null(),
            system_id: sys::SystemId::from_raw(self.system()),
            create_flags: sys::VulkanInstanceCreateFlagsKHR::from_raw(self.bits(&[0])),
            pfn_get_instance_proc_addr: if self.odd() { None } else { Some(barren_loader) },
            vulkan_create_info: if self.odd() { null() } else { empty.cast_const().cast() },
            vulkan_allocator: null(),
        };
        self.input(info)
    }

    pub fn vulkan_device_info(&mut self) -> u64 {
        let empty = self.put(vk::DeviceCreateInfo::default());
        let info = sys::VulkanDeviceCreateInfoKHR {
            ty: sys::VulkanDeviceCreateInfoKHR::TYPE,
            next: null(),
            system_id: sys::SystemId::from_raw(self.system()),
            create_flags: sys::VulkanDeviceCreateFlagsKHR::from_raw(self.bits(&[0])),
            pfn_get_instance_proc_addr: if self.odd() { None } else { Some(barren_loader) },
            vulkan_physical_device: self.vulkan.physical.as_raw() as _,
            vulkan_create_info: if self.odd() { null() } else { empty.cast_const().cast() },
            vulkan_allocator: null(),
        };
        self.input(info)
    }
}
