//! What each function is given.
#![allow(unsafe_code, reason = "memory for raw calls")]

use std::ptr::null;

use ash::vk::Handle as _;
use fathomless::mock::function_names;
use openxr::sys::{self, Handle as _};

use crate::{Kind::*, Run};

impl Run<'_> {
    /// The arguments of a function, but for floats and structures by value.
    pub fn arguments(&mut self, name: &str) -> Vec<u64> {
        macro_rules! info {
            ($name:ident { $($field:ident: $value:expr),* $(,)? }) => {{
                let it = sys::$name { ty: sys::$name::TYPE, next: null(), $($field: $value),* };
                self.input(it)
            }};
        }
        macro_rules! out {
            ($name:ident) => {
                self.output::<sys::$name>(sys::$name::TYPE)
            };
        }
        macro_rules! typed_list {
            ($name:ident) => {
                self.typed_list::<sys::$name>(sys::$name::TYPE)
            };
        }
        fn all<const N: usize>(first: &[u64], rest: [u64; N]) -> Vec<u64> {
            [first, &rest].concat()
        }
        match name {
            "xrGetInstanceProcAddr" => {
                let names: Vec<_> = function_names().collect();
                let wanted = self.dice.pick(&names);
                let handle = if self.dice.once_in(8) { 0 } else { self.handle(Instance) };
                vec![handle, self.text(wanted) as u64, self.place(0u64)]
            }
            "xrEnumerateApiLayerProperties" => typed_list!(ApiLayerProperties).into(),
            "xrEnumerateInstanceExtensionProperties" => {
                let layer = if self.odd() { self.optional_text("XR_APILAYER_none") } else { null() };
                all(&[layer as u64], typed_list!(ExtensionProperties))
            }
            "xrCreateInstance" => vec![self.instance_info(), self.new_handle(Instance)],
            "xrDestroyInstance" => vec![self.subject(Instance)],
            "xrGetInstanceProperties" => vec![self.subject(Instance), out!(InstanceProperties)],
            "xrPollEvent" => vec![self.subject(Instance), out!(EventDataBuffer)],
            "xrGetSystem" => vec![
                self.subject(Instance),
                info!(SystemGetInfo { form_factor: sys::FormFactor::from_raw(self.number(&[1])) }),
                self.place(0u64),
            ],
            "xrGetSystemProperties" => vec![self.subject(Instance), self.system(), out!(SystemProperties)],
            "xrEnumerateViewConfigurations" => all(&[self.subject(Instance), self.system()], self.list(0i32)),
            "xrEnumerateEnvironmentBlendModes" => {
                all(&[self.subject(Instance), self.system(), self.stereo() as u64], self.list(0i32))
            }
            "xrGetViewConfigurationProperties" => vec![
                self.subject(Instance),
                self.system(),
                self.stereo() as u64,
                out!(ViewConfigurationProperties),
            ],
            "xrEnumerateViewConfigurationViews" => all(
                &[self.subject(Instance), self.system(), self.stereo() as u64],
                typed_list!(ViewConfigurationView),
            ),
            "xrResultToString" => {
                let code = self.number(&[0, -1, -12, 4, -1_000_000_000]);
                vec![self.subject(Instance), code as u64, self.place([0u8; sys::MAX_RESULT_STRING_SIZE])]
            }
            "xrStructureTypeToString" => {
                let ty = self.number(&[1, 2, 40, 1_000_025_000]);
                vec![self.subject(Instance), ty as u64, self.place([0u8; sys::MAX_STRUCTURE_NAME_SIZE])]
            }
            "xrStringToPath" => {
                let (_, text) = self.component();
                vec![self.subject(Instance), self.text(&text) as u64, self.place(0u64)]
            }
            "xrPathToString" => all(&[self.subject(Instance), self.source_path()], self.list(0u8)),
            "xrCreateSession" => {
                vec![self.subject(Instance), self.session_info(), self.new_handle(Session)]
            }
            "xrDestroySession" | "xrEndSession" | "xrRequestExitSession" => vec![self.subject(Session)],
            "xrBeginSession" => {
                let stereo = self.stereo();
                let kind = sys::ViewConfigurationType::from_raw(stereo);
                vec![self.subject(Session), info!(SessionBeginInfo { primary_view_configuration_type: kind })]
            }
            "xrEnumerateReferenceSpaces" => all(&[self.subject(Session)], self.list(0i32)),
            "xrCreateReferenceSpace" => vec![
                self.subject(Session),
                info!(ReferenceSpaceCreateInfo {
                    reference_space_type: sys::ReferenceSpaceType::from_raw(self.space_type()),
                    pose_in_reference_space: self.pose(),
                }),
                self.new_handle(Space),
            ],
            "xrGetReferenceSpaceBoundsRect" => {
                vec![self.subject(Session), self.space_type() as u64, self.place([0f32; 2])]
            }
            "xrCreateActionSpace" => vec![
                self.subject(Session),
                info!(ActionSpaceCreateInfo {
                    action: sys::Action::from_raw(self.handle(Action)),
                    subaction_path: sys::Path::from_raw(self.user_path()),
                    pose_in_action_space: self.pose(),
                }),
                self.new_handle(Space),
            ],
            "xrLocateSpace" => {
                vec![self.subject(Space), self.handle(Space), self.time() as u64, out!(SpaceLocation)]
            }
            "xrDestroySpace" => vec![self.subject(Space)],
            "xrLocateSpaces" | "xrLocateSpacesKHR" => all(&[self.subject(Session)], self.spaces_info()),
            "xrLocateViews" => {
                let info = info!(ViewLocateInfo {
                    view_configuration_type: sys::ViewConfigurationType::from_raw(self.stereo()),
                    display_time: sys::Time::from_nanos(self.time()),
                    space: sys::Space::from_raw(self.handle(Space)),
                });
                all(&[self.subject(Session), info, out!(ViewState)], typed_list!(View))
            }
            "xrEnumerateSwapchainFormats" => all(&[self.subject(Session)], self.list(0i64)),
            "xrCreateSwapchain" => {
                vec![self.subject(Session), self.swapchain_info(), self.new_handle(Swapchain)]
            }
            "xrDestroySwapchain" => vec![self.subject(Swapchain)],
            "xrEnumerateSwapchainImages" => {
                all(&[self.subject(Swapchain)], typed_list!(SwapchainImageVulkanKHR))
            }
            "xrAcquireSwapchainImage" => {
                let info =
                    sys::SwapchainImageAcquireInfo { ty: sys::SwapchainImageAcquireInfo::TYPE, next: null() };
                vec![self.subject(Swapchain), self.typed(info, true), self.place(0u32)]
            }
            "xrWaitSwapchainImage" => {
                let timeout = sys::Duration::from_nanos(self.bits(&[0, i64::MAX as u64]) as i64);
                vec![self.subject(Swapchain), info!(SwapchainImageWaitInfo { timeout: timeout })]
            }
            "xrReleaseSwapchainImage" => {
                let info =
                    sys::SwapchainImageReleaseInfo { ty: sys::SwapchainImageReleaseInfo::TYPE, next: null() };
                vec![self.subject(Swapchain), self.typed(info, true)]
            }
            "xrWaitFrame" => {
                let info = sys::FrameWaitInfo { ty: sys::FrameWaitInfo::TYPE, next: null() };
                vec![self.subject(Session), self.typed(info, true), out!(FrameState)]
            }
            "xrBeginFrame" => {
                let info = sys::FrameBeginInfo { ty: sys::FrameBeginInfo::TYPE, next: null() };
                vec![self.subject(Session), self.typed(info, true)]
            }
            "xrEndFrame" => vec![self.subject(Session), self.frame_end()],
            "xrCreateActionSet" => vec![
                self.subject(Instance),
                info!(ActionSetCreateInfo {
                    action_set_name: self.name(),
                    localized_action_set_name: self.name(),
                    priority: self.count(&[0, 1, 2]),
                }),
                self.new_handle(ActionSet),
            ],
            "xrDestroyActionSet" => vec![self.subject(ActionSet)],
            "xrCreateAction" => vec![self.subject(ActionSet), self.action_info(), self.new_handle(Action)],
            "xrDestroyAction" => vec![self.subject(Action)],
            "xrSuggestInteractionProfileBindings" => vec![self.subject(Instance), self.suggestion()],
            "xrAttachSessionActionSets" => {
                let count = self.dice.below(3);
                let sets: Vec<_> =
                    (0..count).map(|_| sys::ActionSet::from_raw(self.handle(ActionSet))).collect();
                vec![
                    self.subject(Session),
                    info!(SessionActionSetsAttachInfo {
                        count_action_sets: count as u32,
                        action_sets: if self.odd() { null() } else { self.arena.array(&sets) },
                    }),
                ]
            }
            "xrGetCurrentInteractionProfile" => {
                vec![self.subject(Session), self.user_path(), out!(InteractionProfileState)]
            }
            "xrGetActionStateBoolean" => {
                vec![self.subject(Session), self.state_info(), out!(ActionStateBoolean)]
            }
            "xrGetActionStateFloat" => vec![self.subject(Session), self.state_info(), out!(ActionStateFloat)],
            "xrGetActionStateVector2f" => {
                vec![self.subject(Session), self.state_info(), out!(ActionStateVector2f)]
            }
            "xrGetActionStatePose" => vec![self.subject(Session), self.state_info(), out!(ActionStatePose)],
            "xrSyncActions" => {
                let count = self.dice.below(3);
                let mut sets = Vec::new();
                for _ in 0..count {
                    sets.push(sys::ActiveActionSet {
                        action_set: sys::ActionSet::from_raw(self.handle(ActionSet)),
                        subaction_path: sys::Path::from_raw(self.user_path()),
                    });
                }
                vec![
                    self.subject(Session),
                    info!(ActionsSyncInfo {
                        count_active_action_sets: count as u32,
                        active_action_sets: if self.odd() { null() } else { self.arena.array(&sets) },
                    }),
                ]
            }
            "xrEnumerateBoundSourcesForAction" => {
                let action = sys::Action::from_raw(self.handle(Action));
                let info = info!(BoundSourcesForActionEnumerateInfo { action: action });
                all(&[self.subject(Session), info], self.list(0u64))
            }
            "xrGetInputSourceLocalizedName" => {
                let info = info!(InputSourceLocalizedNameGetInfo {
                    source_path: sys::Path::from_raw(self.source_path()),
                    which_components: sys::InputSourceLocalizedNameFlags::from_raw(self.bits(&[7, 1, 4])),
                });
                all(&[self.subject(Session), info], self.list(0u8))
            }
            "xrApplyHapticFeedback" => {
                let info = self.haptic_info();
                let any = self.dice.word() as i64;
                vec![
                    self.subject(Session),
                    info,
                    info!(HapticVibration {
                        duration: sys::Duration::from_nanos(if self.odd() { any } else { 1_000_000 }),
                        frequency: self.float(&[0.0, 100.0]),
                        amplitude: self.float(&[0.5]),
                    }),
                ]
            }
            "xrStopHapticFeedback" => vec![self.subject(Session), self.haptic_info()],
            "xrCreateDebugUtilsMessengerEXT" => {
                let info = self.messenger_info();
                // SAFETY: the arena's own memory.
                let info = unsafe { *info };
                vec![self.subject(Instance), self.input(info), self.new_handle(Messenger)]
            }
            "xrDestroyDebugUtilsMessengerEXT" => vec![self.subject(Messenger)],
            "xrSubmitDebugUtilsMessageEXT" => {
                vec![self.subject(Instance), self.bits(&[0x1000, 1]), self.bits(&[1, 2]), self.message()]
            }
            "xrSetDebugUtilsObjectNameEXT" => {
                let object = self.object();
                vec![self.subject(Instance), self.input(object)]
            }
            "xrSessionBeginDebugUtilsLabelRegionEXT" | "xrSessionInsertDebugUtilsLabelEXT" => {
                vec![self.subject(Session), self.label()]
            }
            "xrSessionEndDebugUtilsLabelRegionEXT" => vec![self.subject(Session)],
            "xrEnumerateDisplayRefreshRatesFB" => all(&[self.subject(Session)], self.list(0f32)),
            "xrGetDisplayRefreshRateFB" => vec![self.subject(Session), self.place(0f32)],
            "xrRequestDisplayRefreshRateFB" => vec![self.subject(Session)],
            "xrGetVisibilityMaskKHR" => vec![
                self.subject(Session),
                self.stereo() as u64,
                u64::from(self.count(&[0, 1])),
                self.number(&[1, 2, 3]) as u64,
                self.mask(),
            ],
            "xrPerfSettingsSetPerformanceLevelEXT" => {
                vec![self.subject(Session), self.number(&[1, 2]) as u64, self.number(&[0, 25, 50, 75]) as u64]
            }
            "xrConvertTimeToTimespecTimeKHR" => {
                vec![self.subject(Instance), self.time() as u64, self.place([0u64; 2])]
            }
            "xrConvertTimespecTimeToTimeKHR" => {
                let spec = [self.bits(&[5, 100]), self.bits(&[0, 999_999_999])];
                vec![self.subject(Instance), self.place(spec), self.place(0u64)]
            }
            "xrSetInputDeviceActiveEXT" => {
                let (profile, _) = self.component();
                vec![
                    self.subject(Session),
                    self.path_of(profile.path),
                    self.user_path(),
                    u64::from(self.boolean()),
                ]
            }
            "xrSetInputDeviceStateBoolEXT" => {
                vec![self.subject(Session), self.user_path(), self.source_path(), u64::from(self.boolean())]
            }
            "xrSetInputDeviceStateFloatEXT" | "xrSetInputDeviceStateVector2fEXT" => {
                vec![self.subject(Session), self.user_path(), self.source_path()]
            }
            "xrSetInputDeviceLocationEXT" => {
                vec![self.subject(Session), self.user_path(), self.source_path(), self.handle(Space)]
            }
            "xrCreateHandTrackerEXT" => {
                vec![self.subject(Session), self.tracker_info(), self.new_handle(HandTracker)]
            }
            "xrDestroyHandTrackerEXT" => vec![self.subject(HandTracker)],
            "xrLocateHandJointsEXT" => vec![
                self.subject(HandTracker),
                info!(HandJointsLocateInfoEXT {
                    base_space: sys::Space::from_raw(self.handle(Space)),
                    time: sys::Time::from_nanos(self.time()),
                }),
                self.joints(),
            ],
            "xrGetVulkanInstanceExtensionsKHR" | "xrGetVulkanDeviceExtensionsKHR" => {
                all(&[self.subject(Instance), self.system()], self.list(0u8))
            }
            "xrGetVulkanGraphicsDeviceKHR" => {
                let real = self.vulkan.instance.handle().as_raw();
                let vulkan = if self.odd() { 0 } else { real };
                vec![self.subject(Instance), self.system(), vulkan, self.place(0u64)]
            }
            "xrGetVulkanGraphicsRequirementsKHR" | "xrGetVulkanGraphicsRequirements2KHR" => {
                vec![self.subject(Instance), self.system(), out!(GraphicsRequirementsVulkanKHR)]
            }
            "xrCreateVulkanInstanceKHR" => {
                vec![self.subject(Instance), self.vulkan_instance_info(), self.place(0u64), self.place(0i32)]
            }
            "xrGetVulkanGraphicsDevice2KHR" => {
                let any = self.dice.word();
                let real = self.vulkan.instance.handle().as_raw();
                vec![
                    self.subject(Instance),
                    info!(VulkanGraphicsDeviceGetInfoKHR {
                        system_id: sys::SystemId::from_raw(self.system()),
                        vulkan_instance: self.dice.pick(&[0, any, real]) as _,
                    }),
                    self.place(0u64),
                ]
            }
            "xrCreateVulkanDeviceKHR" => {
                vec![self.subject(Instance), self.vulkan_device_info(), self.place(0u64), self.place(0i32)]
            }
            _ => panic!("{name} is a function that this test does not know: teach it"),
        }
    }
}
