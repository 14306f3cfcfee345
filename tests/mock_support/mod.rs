//! An application as small as can be: Vulkan made through `XR_KHR_vulkan_enable2` with validation on where it is
//! installed, one session, two-layer swapchains that are cleared.
#![allow(dead_code, reason = "each test uses its part")]
#![allow(unsafe_code, reason = "raw Vulkan and raw OpenXR")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::{
    ffi::{CStr, c_void},
    mem::ManuallyDrop,
    sync::{Mutex, MutexGuard},
};

use ash::vk::{self, Handle as _};
use fathomless::mock::{Clock, Mock, MockConfig, registry};
use openxr as xr;

pub const STEREO: xr::ViewConfigurationType = xr::ViewConfigurationType::PRIMARY_STEREO;
const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// A quick stepped headset with small eyes that reads frames back.
pub fn stepped() -> MockConfig {
    MockConfig {
        clock: Clock::Stepped { hz: 100.0 },
        eye_size: [64, 48],
        read_back: true,
        ..MockConfig::default()
    }
}

/// Runtime, Vulkan and an XrInstance; no session yet.
pub struct App {
    pub mock: Mock,
    pub instance: ManuallyDrop<xr::Instance>,
    pub system: xr::SystemId,
    pub vk_instance: ash::Instance,
    pub physical: vk::PhysicalDevice,
    pub device: ash::Device,
    pub queue: vk::Queue,
    pub family: u32,
    /// The validation layers are on.
    pub validated: bool,
    pool: vk::CommandPool,
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    messages: *mut Mutex<Vec<String>>,
    _entry: ash::Entry,
}

/// The extensions of this runtime that matter to drawing.
pub fn extensions() -> xr::ExtensionSet {
    let mut set = xr::ExtensionSet::default();
    set.khr_vulkan_enable2 = true;
    set.khr_composition_layer_depth = true;
    set.ext_local_floor = true;
    set
}

pub fn application(minor: u16) -> xr::ApplicationInfo<'static> {
    xr::ApplicationInfo {
        application_name: "mock test",
        api_version: xr::Version::new(1, minor, 0),
        ..Default::default()
    }
}

impl App {
    pub fn new(config: MockConfig) -> Self {
        Self::with_mock(Mock::new(config))
    }

    pub fn with_mock(mock: Mock) -> Self {
        Self::with_extensions(mock, &extensions())
    }

    pub fn with_extensions(mock: Mock, extensions: &xr::ExtensionSet) -> Self {
        let instance = mock.entry().unwrap().create_instance(&application(1), extensions, &[], &()).unwrap();
        let system = instance.system(xr::FormFactor::HEAD_MOUNTED_DISPLAY).unwrap();
        instance.graphics_requirements::<xr::Vulkan>(system).unwrap();
        let messages = Box::into_raw(Box::new(Mutex::new(Vec::new())));
        // SAFETY: ordinary Vulkan; everything is destroyed in `drop`, children first.
        unsafe {
            let entry =
                ash::Entry::load().expect("no Vulkan loader: install libvulkan1 and mesa-vulkan-drivers");
            let (vk_instance, messenger) = make_instance(&entry, &instance, system, messages);
            let physical =
                instance.vulkan_graphics_device(system, vk_instance.handle().as_raw() as _).unwrap();
            let physical = vk::PhysicalDevice::from_raw(physical as u64);
            let family = vk_instance
                .get_physical_device_queue_family_properties(physical)
                .iter()
                .position(|family| family.queue_flags.contains(vk::QueueFlags::GRAPHICS))
                .unwrap() as u32;
            let priorities = [1.0];
            let queues = [vk::DeviceQueueCreateInfo::default()
                .queue_family_index(family)
                .queue_priorities(&priorities)];
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues);
            let device = instance
                .create_vulkan_device(
                    system,
                    loader(&entry),
                    physical.as_raw() as _,
                    (&raw const info).cast(),
                )
                .unwrap()
                .unwrap();
            let device = ash::Device::load(vk_instance.fp_v1_0(), vk::Device::from_raw(device as u64));
            let pool = vk::CommandPoolCreateInfo::default().queue_family_index(family);
            Self {
                queue: device.get_device_queue(family, 0),
                pool: device.create_command_pool(&pool, None).unwrap(),
                instance: ManuallyDrop::new(instance),
                mock,
                system,
                vk_instance,
                physical,
                device,
                family,
                validated: messenger.is_some(),
                messenger,
                messages,
                _entry: entry,
            }
        }
    }

    /// What the validation layers said; empty without them.
    pub fn messages(&self) -> MutexGuard<'_, Vec<String>> {
        // SAFETY: freed only in `drop`.
        unsafe { &*self.messages }.lock().unwrap()
    }

    /// The binding for xrCreateSession.
    pub fn binding(&self) -> xr::vulkan::SessionCreateInfo {
        xr::vulkan::SessionCreateInfo {
            instance: self.vk_instance.handle().as_raw() as _,
            physical_device: self.physical.as_raw() as _,
            device: self.device.handle().as_raw() as _,
            queue_family_index: self.family,
            queue_index: 0,
        }
    }

    pub fn session(&self) -> (xr::Session<xr::Vulkan>, xr::FrameWaiter, xr::FrameStream<xr::Vulkan>) {
        // SAFETY: the binding's Vulkan objects outlive the session.
        unsafe { self.instance.create_session::<xr::Vulkan>(self.system, &self.binding()) }.unwrap()
    }

    /// The session states told since the last call.
    pub fn poll(&self) -> Vec<xr::SessionState> {
        let mut buffer = xr::EventDataBuffer::new();
        let mut states = Vec::new();
        while let Some(event) = self.instance.poll_event(&mut buffer).unwrap() {
            if let xr::Event::SessionStateChanged(change) = event {
                states.push(change.state());
            }
        }
        states
    }

    /// Clears each layer of an image to its colour (or depth, in the first component), layouts as the runtime wants.
    pub fn clear(&self, image: vk::Image, depth: bool, layers: &[[f32; 4]]) {
        let (aspect, layout) = if depth {
            (vk::ImageAspectFlags::DEPTH, vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL)
        } else {
            (vk::ImageAspectFlags::COLOR, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
        };
        let range = |base: u32, count: u32| vk::ImageSubresourceRange {
            aspect_mask: aspect,
            base_mip_level: 0,
            level_count: 1,
            base_array_layer: base,
            layer_count: count,
        };
        let target = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        let barrier = |from, to| {
            vk::ImageMemoryBarrier::default()
                .image(image)
                .old_layout(from)
                .new_layout(to)
                .src_access_mask(vk::AccessFlags::MEMORY_WRITE)
                .dst_access_mask(vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE)
                .subresource_range(range(0, vk::REMAINING_ARRAY_LAYERS))
        };
        let all = vk::PipelineStageFlags::ALL_COMMANDS;
        self.submit(|device, commands| {
            // SAFETY: the image is acquired and waited for, the command buffer is recording.
            unsafe {
                let no = vk::DependencyFlags::empty();
                let into = [barrier(layout, target)];
                device.cmd_pipeline_barrier(commands, all, all, no, &[], &[], &into);
                for (i, value) in layers.iter().enumerate() {
                    let range = [range(i as u32, 1)];
                    if depth {
                        let value = vk::ClearDepthStencilValue { depth: value[0], stencil: 0 };
                        device.cmd_clear_depth_stencil_image(commands, image, target, &value, &range);
                    } else {
                        let value = vk::ClearColorValue { float32: *value };
                        device.cmd_clear_color_image(commands, image, target, &value, &range);
                    }
                }
                let back = [barrier(target, layout)];
                device.cmd_pipeline_barrier(commands, all, all, no, &[], &[], &back);
            }
        });
    }

    fn submit(&self, record: impl FnOnce(&ash::Device, vk::CommandBuffer)) {
        // SAFETY: ordinary Vulkan, waited for before anything is freed.
        unsafe {
            let info =
                vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
            let commands = self.device.allocate_command_buffers(&info).unwrap();
            let begin =
                vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            self.device.begin_command_buffer(commands[0], &begin).unwrap();
            record(&self.device, commands[0]);
            self.device.end_command_buffer(commands[0]).unwrap();
            let submit = vk::SubmitInfo::default().command_buffers(&commands);
            self.device.queue_submit(self.queue, &[submit], vk::Fence::null()).unwrap();
            self.device.queue_wait_idle(self.queue).unwrap();
            self.device.free_command_buffers(self.pool, &commands);
        }
    }
}

impl Drop for App {
    fn drop(&mut self) {
        // SAFETY: the tests drop sessions before the application; then children before parents.
        unsafe {
            ManuallyDrop::drop(&mut self.instance);
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            if let Some((functions, messenger)) = self.messenger.take() {
                functions.destroy_debug_utils_messenger(messenger, None);
            }
            self.vk_instance.destroy_instance(None);
            drop(Box::from_raw(self.messages));
        }
    }
}

fn loader(entry: &ash::Entry) -> xr::sys::platform::VkGetInstanceProcAddr {
    // SAFETY: the same C function type under two names.
    unsafe {
        std::mem::transmute::<vk::PFN_vkGetInstanceProcAddr, xr::sys::platform::VkGetInstanceProcAddr>(
            entry.static_fn().get_instance_proc_addr,
        )
    }
}

unsafe fn make_instance(
    entry: &ash::Entry,
    instance: &xr::Instance,
    system: xr::SystemId,
    messages: *mut Mutex<Vec<String>>,
) -> (ash::Instance, Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>) {
    // SAFETY: ordinary Vulkan.
    unsafe {
        let validated = entry
            .enumerate_instance_layer_properties()
            .unwrap()
            .iter()
            .any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION));
        let layers = [VALIDATION.as_ptr()];
        let names = [vk::EXT_DEBUG_UTILS_NAME.as_ptr(), vk::EXT_VALIDATION_FEATURES_NAME.as_ptr()];
        let features = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&features);
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_0);
        let mut info = vk::InstanceCreateInfo::default().application_info(&application);
        if validated {
            info = info.enabled_layer_names(&layers).enabled_extension_names(&names).push_next(&mut features);
        }
        let handle = instance
            .create_vulkan_instance(system, loader(entry), (&raw const info).cast())
            .unwrap()
            .unwrap();
        let vk_instance = ash::Instance::load(entry.static_fn(), vk::Instance::from_raw(handle as u64));
        let messenger = validated.then(|| {
            let functions = ash::ext::debug_utils::Instance::new(entry, &vk_instance);
            let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                .message_severity(
                    vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                        | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                )
                .message_type(
                    vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                        | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
                )
                .pfn_user_callback(Some(on_message))
                .user_data(messages.cast());
            let messenger = functions.create_debug_utils_messenger(&info, None).unwrap();
            (functions, messenger)
        });
        (vk_instance, messenger)
    }
}

unsafe extern "system" fn on_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    messages: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan gives a valid message and the pointer we registered.
    unsafe {
        let text = (*data).message_as_c_str().unwrap_or(c"").to_string_lossy();
        (*messages.cast::<Mutex<Vec<String>>>()).lock().unwrap().push(text.into_owned());
    }
    vk::FALSE
}

/// A swapchain of two layers and its images.
pub struct Chain {
    pub swapchain: xr::Swapchain<xr::Vulkan>,
    pub images: Vec<vk::Image>,
    pub depth: bool,
}

impl Chain {
    pub fn new(session: &xr::Session<xr::Vulkan>, format: vk::Format, size: [u32; 2]) -> Self {
        let depth =
            matches!(format, vk::Format::D32_SFLOAT | vk::Format::D16_UNORM | vk::Format::D24_UNORM_S8_UINT);
        let attachment = if depth {
            xr::SwapchainUsageFlags::DEPTH_STENCIL_ATTACHMENT
        } else {
            xr::SwapchainUsageFlags::COLOR_ATTACHMENT
        };
        let swapchain = session
            .create_swapchain(&xr::SwapchainCreateInfo {
                create_flags: xr::SwapchainCreateFlags::EMPTY,
                usage_flags: attachment | xr::SwapchainUsageFlags::TRANSFER_DST,
                format: format.as_raw() as u32,
                sample_count: 1,
                width: size[0],
                height: size[1],
                face_count: 1,
                array_size: 2,
                mip_count: 1,
            })
            .unwrap();
        let images = swapchain.enumerate_images().unwrap();
        Self { images: images.into_iter().map(vk::Image::from_raw).collect(), swapchain, depth }
    }

    /// Acquires, clears each layer, releases.
    pub fn fill(&mut self, app: &App, layers: [[f32; 4]; 2]) {
        let index = self.swapchain.acquire_image().unwrap();
        self.swapchain.wait_image(xr::Duration::INFINITE).unwrap();
        app.clear(self.images[index as usize], self.depth, &layers);
        self.swapchain.release_image().unwrap();
    }

    /// One layer of the last released image, whole.
    pub fn part(&self, layer: u32, size: [u32; 2]) -> xr::sys::SwapchainSubImage {
        xr::sys::SwapchainSubImage {
            swapchain: self.swapchain.as_raw(),
            image_rect: xr::Rect2Di {
                offset: xr::Offset2Di { x: 0, y: 0 },
                extent: xr::Extent2Di { width: size[0] as i32, height: size[1] as i32 },
            },
            image_array_index: layer,
        }
    }
}

/// The last calls of every function answered with codes that the registry gives it.
pub fn assert_documented(mock: &Mock) {
    for call in mock.log() {
        let command = registry::command(call.function).unwrap();
        let code = call.code.into_raw();
        let known = command.successes.contains(&code) || command.errors.contains(&code);
        assert!(known, "{} must not answer {:?}", call.function, call.code);
    }
}

/// Polls to READY and begins.
pub fn begin(app: &App, session: &xr::Session<xr::Vulkan>) {
    assert_eq!(app.poll().last(), Some(&xr::SessionState::READY));
    session.begin(STEREO).unwrap();
}

/// A whole frame without layers; the state it was waited for with.
pub fn empty_frame(waiter: &mut xr::FrameWaiter, stream: &mut xr::FrameStream<xr::Vulkan>) -> xr::FrameState {
    let state = waiter.wait().unwrap();
    stream.begin().unwrap();
    stream.end(state.predicted_display_time, xr::EnvironmentBlendMode::OPAQUE, &[]).unwrap();
    state
}

/// Empty frames until the session is FOCUSED.
pub fn focus(app: &App, waiter: &mut xr::FrameWaiter, stream: &mut xr::FrameStream<xr::Vulkan>) {
    for _ in 0..3 {
        empty_frame(waiter, stream);
    }
    assert_eq!(app.poll().last(), Some(&xr::SessionState::FOCUSED));
}

/// An application with a focused session on a stepped clock.
pub struct Desk {
    pub session: xr::Session<xr::Vulkan>,
    pub waiter: xr::FrameWaiter,
    pub stream: xr::FrameStream<xr::Vulkan>,
    pub app: App,
}

impl Desk {
    pub fn new(extensions: &xr::ExtensionSet) -> Self {
        let app = App::with_extensions(Mock::new(stepped()), extensions);
        let (session, mut waiter, mut stream) = app.session();
        begin(&app, &session);
        focus(&app, &mut waiter, &mut stream);
        Self { session, waiter, stream, app }
    }

    /// A frame without a picture, and when it is shown.
    pub fn frame(&mut self) -> xr::Time {
        empty_frame(&mut self.waiter, &mut self.stream).predicted_display_time
    }
}
