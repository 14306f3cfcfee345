//! Every OpenXR call of a session, made safe: typed arguments in, checked codes out, the Vulkan queue held where it must be.

#![allow(unsafe_code, reason = "calls the C interface of the OpenXR runtime")]

use std::ffi::{CString, c_char};
use std::mem::MaybeUninit;
use std::ptr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use ash::vk::{self, Handle as _};
use glam::Vec2;
use openxr::{ReferenceSpaceType, SessionState, sys};

use super::arrays::{ATTEMPTS, text, two_call};
use super::error::{Error, check};
use super::outcome::{Outcome, outcome};
use super::runtime::{Runtime, STEREO};
use super::view::{Pose, pose_to_sys};
use crate::bindings::Action;
use crate::gpu::Gpu;
use crate::mock::registry::Kind;

/// How long the GPU gets to finish before the session's images go.
const GPU_TIMEOUT_NS: u64 = 10_000_000_000;

/// The session's handle. Destroyed last: swapchains and spaces hold it alive, and it holds the device.
pub(super) struct RawSession {
    instance: openxr::Instance,
    handle: sys::Session,
    /// A call answered `SESSION_LOSS_PENDING`.
    loss_pending: AtomicBool,
    /// The GPU did not finish in time.
    hung: AtomicBool,
    pub(super) gpu: Arc<Gpu>,
}

/// What `xrPollEvent` brought, as far as this module cares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Event {
    State(SessionState),
    InstanceLossPending,
    /// A space's origin moves at this time in nanoseconds.
    SpaceChange(ReferenceSpaceType, i64),
    EventsLost(u32),
    /// What an eye cannot see is another part of its picture now.
    MaskChanged,
    /// The headset was put on or taken off.
    Presence(bool),
    /// The hands hold other controllers, or none.
    ProfilesChanged,
    /// The display runs at so many frames per second now.
    RefreshRate(f32),
    /// Nothing to do for it: its structure type.
    Other(i32),
}

/// One eye of a projection layer.
pub(super) struct LayerEye {
    pub(super) pose: sys::Posef,
    pub(super) fov: sys::Fovf,
    pub(super) color: sys::SwapchainSubImage,
    pub(super) depth: Option<sys::SwapchainSubImage>,
}

/// A cube layer, behind everything.
pub(super) struct CubeLayer {
    pub(super) swapchain: sys::Swapchain,
    /// Turns the cube's axes to those of the frame's space.
    pub(super) orientation: sys::Quaternionf,
}

/// A flat rectangle in front of everything, its colours multiplied by their alpha.
pub(super) struct QuadLayer {
    pub(super) image: sys::SwapchainSubImage,
    /// Its middle in the frame's space; it faces +z.
    pub(super) pose: sys::Posef,
    /// Width and height in metres.
    pub(super) size: sys::Extent2Df,
}

/// Triangles that nobody sees.
pub(super) struct HiddenMesh {
    /// On the plane 1 in front of the eye, to the right and upwards.
    pub(super) corners: Vec<sys::Vector2f>,
    /// Three of each triangle.
    pub(super) indices: Vec<u32>,
}

/// What the images of a swapchain are like, apart from their format.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    pub(super) extent: vk::Extent2D,
    /// 6: cubemaps, whose faces are layers of the image; else 1.
    pub(super) faces: u32,
    pub(super) array: u32,
}

/// The projection layer of a frame.
pub(super) struct Layer {
    pub(super) space: sys::Space,
    pub(super) eyes: [LayerEye; 2],
    /// Where depth is 1, in metres; it falls to 0 at infinity.
    pub(super) near_m: f32,
    /// What shows where the eyes' pictures are transparent (their colour multiplied by alpha); without it they are
    /// opaque.
    pub(super) behind: Option<CubeLayer>,
    /// What is seen before them.
    pub(super) front: Option<QuadLayer>,
}

impl RawSession {
    pub(super) fn new(runtime: &Runtime, gpu: Arc<Gpu>) -> Result<Self, Error> {
        // Wanted before every xrCreateSession, also when the device was made long ago.
        runtime.graphics_requirements()?;
        let binding = sys::GraphicsBindingVulkanKHR {
            ty: sys::GraphicsBindingVulkanKHR::TYPE,
            next: ptr::null(),
            instance: gpu.instance.handle().as_raw() as _,
            physical_device: gpu.physical.as_raw() as _,
            device: gpu.device.handle().as_raw() as _,
            queue_family_index: gpu.queue_family,
            queue_index: 0,
        };
        let info = sys::SessionCreateInfo {
            ty: sys::SessionCreateInfo::TYPE,
            next: ptr::from_ref(&binding).cast(),
            create_flags: sys::SessionCreateFlags::EMPTY,
            system_id: runtime.system,
        };
        let instance = runtime.instance.clone();
        let mut handle = sys::Session::default();
        // SAFETY: the device is alive and kept so by `gpu` for as long as the session.
        let code = gpu
            .with_queue(|_| unsafe { (instance.fp().create_session)(instance.as_raw(), &info, &mut handle) });
        check("xrCreateSession", code)?;
        Ok(Self { instance, handle, loss_pending: AtomicBool::new(false), hung: AtomicBool::new(false), gpu })
    }

    /// Whether the runtime announced, by a result code, that the session is about to be lost.
    pub(super) fn loss_pending(&self) -> bool {
        self.loss_pending.load(Ordering::Relaxed)
    }

    pub(super) fn instance(&self) -> &openxr::Instance {
        &self.instance
    }

    pub(super) fn handle(&self) -> sys::Session {
        self.handle
    }

    pub(super) fn check(&self, call: &'static str, code: sys::Result) -> Result<sys::Result, Error> {
        if code.into_raw() > 0 && outcome(call, code) == Outcome::ReopenSession {
            self.loss_pending.store(true, Ordering::Relaxed);
        }
        check(call, code)
    }

    /// Calls that may use the Vulkan queue, with the queue held.
    fn with_queue(&self, call: &'static str, f: impl FnOnce() -> sys::Result) -> Result<sys::Result, Error> {
        let code = self.gpu.with_queue(|_| f());
        self.check(call, code)
    }

    /// Collects an array by the two-call idiom, as [`two_call`] does.
    fn array<T: Clone>(
        &self,
        call: &'static str,
        init: T,
        mut f: impl FnMut(u32, &mut u32, *mut T) -> sys::Result,
    ) -> Result<Vec<T>, Error> {
        let mut pending = sys::Result::SUCCESS;
        let elements = two_call(init, |capacity, count, out| {
            let code = f(capacity, count, out);
            if code.into_raw() > 0 {
                pending = code;
            }
            code
        });
        self.check(call, pending)?;
        elements.map_err(|code| Error::from_code(call, code))
    }

    pub(super) fn poll_event(&self) -> Result<Option<Event>, Error> {
        let mut buffer = MaybeUninit::<sys::EventDataBuffer>::uninit();
        let head = buffer.as_mut_ptr();
        // SAFETY: the two fields the runtime reads are set through the pointer; it writes the rest.
        let code = unsafe {
            ptr::addr_of_mut!((*head).ty).write(sys::EventDataBuffer::TYPE);
            ptr::addr_of_mut!((*head).next).write(ptr::null());
            (self.instance.fp().poll_event)(self.instance.as_raw(), head)
        };
        if self.check("xrPollEvent", code)? == sys::Result::EVENT_UNAVAILABLE {
            return Ok(None);
        }
        // SAFETY: the runtime filled in an event, whose type says which structure the buffer (large enough for and
        // aligned as each of them) now holds.
        Ok(Some(unsafe { self.read_event(head) }))
    }

    /// # Safety
    /// `event` points to an event written by a successful `xrPollEvent`.
    unsafe fn read_event(&self, event: *const sys::EventDataBuffer) -> Event {
        use sys::StructureType as Ty;
        // SAFETY: of the caller; each structure is read only under its own type.
        unsafe {
            let ty = ptr::addr_of!((*event).ty).read();
            match ty {
                Ty::EVENT_DATA_SESSION_STATE_CHANGED => {
                    let e = event.cast::<sys::EventDataSessionStateChanged>().read();
                    if e.session == self.handle {
                        return Event::State(e.state);
                    }
                }
                Ty::EVENT_DATA_REFERENCE_SPACE_CHANGE_PENDING => {
                    let e = event.cast::<sys::EventDataReferenceSpaceChangePending>().read();
                    if e.session == self.handle {
                        return Event::SpaceChange(e.reference_space_type, e.change_time.as_nanos());
                    }
                }
                Ty::EVENT_DATA_INSTANCE_LOSS_PENDING => return Event::InstanceLossPending,
                Ty::EVENT_DATA_EVENTS_LOST => {
                    let e = event.cast::<sys::EventDataEventsLost>().read();
                    return Event::EventsLost(e.lost_event_count);
                }
                Ty::EVENT_DATA_VISIBILITY_MASK_CHANGED_KHR => {
                    let e = event.cast::<sys::EventDataVisibilityMaskChangedKHR>().read();
                    if e.session == self.handle {
                        return Event::MaskChanged;
                    }
                }
                Ty::EVENT_DATA_USER_PRESENCE_CHANGED_EXT => {
                    let e = event.cast::<sys::EventDataUserPresenceChangedEXT>().read();
                    if e.session == self.handle {
                        return Event::Presence(e.is_user_present.into());
                    }
                }
                Ty::EVENT_DATA_INTERACTION_PROFILE_CHANGED => {
                    let e = event.cast::<sys::EventDataInteractionProfileChanged>().read();
                    if e.session == self.handle {
                        return Event::ProfilesChanged;
                    }
                }
                Ty::EVENT_DATA_DISPLAY_REFRESH_RATE_CHANGED_FB => {
                    let e = event.cast::<sys::EventDataDisplayRefreshRateChangedFB>().read();
                    return Event::RefreshRate(e.to_display_refresh_rate);
                }
                _ => {}
            }
            Event::Other(ty.into_raw())
        }
    }

    pub(super) fn begin_session(&self) -> Result<(), Error> {
        let info = sys::SessionBeginInfo {
            ty: sys::SessionBeginInfo::TYPE,
            next: ptr::null(),
            primary_view_configuration_type: STEREO,
        };
        // SAFETY: a live session and a properly typed structure.
        let code = unsafe { (self.instance.fp().begin_session)(self.handle, &info) };
        self.check("xrBeginSession", code).map(drop)
    }

    pub(super) fn end_session(&self) -> Result<(), Error> {
        // SAFETY: a live session.
        let code = unsafe { (self.instance.fp().end_session)(self.handle) };
        self.check("xrEndSession", code).map(drop)
    }

    pub(super) fn request_exit(&self) -> Result<(), Error> {
        // SAFETY: a live session.
        let code = unsafe { (self.instance.fp().request_exit_session)(self.handle) };
        self.check("xrRequestExitSession", code).map(drop)
    }

    /// Blocks until the runtime wants the next frame; the queue is free meanwhile.
    pub(super) fn wait_frame(&self) -> Result<sys::FrameState, Error> {
        let mut state = sys::FrameState {
            ty: sys::FrameState::TYPE,
            next: ptr::null_mut(),
            predicted_display_time: sys::Time::from_nanos(0),
            predicted_display_period: sys::Duration::NONE,
            should_render: sys::FALSE,
        };
        // SAFETY: a live session and a properly typed structure to fill.
        let code = unsafe { (self.instance.fp().wait_frame)(self.handle, ptr::null(), &mut state) };
        self.check("xrWaitFrame", code).map(|_| state)
    }

    /// The code is `FRAME_DISCARDED` where the frame begun before was never ended.
    pub(super) fn begin_frame(&self) -> Result<sys::Result, Error> {
        // SAFETY: a live session; the info may be null.
        self.with_queue("xrBeginFrame", || unsafe {
            (self.instance.fp().begin_frame)(self.handle, ptr::null())
        })
    }

    /// Ends the frame with its layers, the cube behind the projection and the quad before it; without a layer nothing of
    /// it is shown.
    pub(super) fn end_frame(
        &self,
        display_time_ns: i64,
        blend: sys::EnvironmentBlendMode,
        layer: Option<&Layer>,
    ) -> Result<(), Error> {
        let depths = layer.map(|layer| {
            layer.eyes.each_ref().map(|eye| {
                eye.depth.map(|sub_image| sys::CompositionLayerDepthInfoKHR {
                    ty: sys::CompositionLayerDepthInfoKHR::TYPE,
                    next: ptr::null(),
                    sub_image,
                    // Reversed and infinite: depth 0 (the smallest) lies at infinity, depth 1 at the near plane.
                    min_depth: 0.0,
                    max_depth: 1.0,
                    near_z: f32::INFINITY,
                    far_z: layer.near_m,
                })
            })
        });
        let views = layer.zip(depths.as_ref()).map(|(layer, depths)| {
            [0, 1].map(|i| sys::CompositionLayerProjectionView {
                ty: sys::CompositionLayerProjectionView::TYPE,
                next: depths[i].as_ref().map_or(ptr::null(), |d| ptr::from_ref(d).cast()),
                pose: layer.eyes[i].pose,
                fov: layer.eyes[i].fov,
                sub_image: layer.eyes[i].color,
            })
        });
        let projection = layer.zip(views.as_ref()).map(|(layer, views)| sys::CompositionLayerProjection {
            ty: sys::CompositionLayerProjection::TYPE,
            next: ptr::null(),
            layer_flags: match layer.behind {
                // Without UNPREMULTIPLIED_ALPHA: the colours are multiplied already.
                Some(_) => sys::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA,
                None => sys::CompositionLayerFlags::EMPTY,
            },
            space: layer.space,
            view_count: views.len() as u32,
            views: views.as_ptr(),
        });
        let cube = layer.and_then(|layer| {
            layer.behind.as_ref().map(|cube| sys::CompositionLayerCubeKHR {
                ty: sys::CompositionLayerCubeKHR::TYPE,
                next: ptr::null(),
                layer_flags: sys::CompositionLayerFlags::EMPTY,
                space: layer.space,
                eye_visibility: sys::EyeVisibility::BOTH,
                swapchain: cube.swapchain,
                image_array_index: 0,
                orientation: cube.orientation,
            })
        });
        let quad = layer.and_then(|layer| {
            layer.front.as_ref().map(|quad| sys::CompositionLayerQuad {
                ty: sys::CompositionLayerQuad::TYPE,
                next: ptr::null(),
                // As above.
                layer_flags: sys::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA,
                space: layer.space,
                eye_visibility: sys::EyeVisibility::BOTH,
                sub_image: quad.image,
                pose: quad.pose,
                size: quad.size,
            })
        });
        // The first is the farthest.
        let mut layers = [ptr::null::<sys::CompositionLayerBaseHeader>(); 3];
        let mut count = 0;
        let cube = cube.as_ref().map(|c| ptr::from_ref(c).cast());
        let projection = projection.as_ref().map(|p| ptr::from_ref(p).cast());
        let quad = quad.as_ref().map(|q| ptr::from_ref(q).cast());
        for layer in [cube, projection, quad].into_iter().flatten() {
            layers[count] = layer;
            count += 1;
        }
        let info = sys::FrameEndInfo {
            ty: sys::FrameEndInfo::TYPE,
            next: ptr::null(),
            display_time: sys::Time::from_nanos(display_time_ns),
            environment_blend_mode: blend,
            layer_count: count as u32,
            layers: if count > 0 { layers.as_ptr() } else { ptr::null() },
        };
        // SAFETY: the structures and what they point to live on this stack until after the call; the swapchains and the
        // space belong to this session and are alive.
        self.with_queue("xrEndFrame", || unsafe { (self.instance.fp().end_frame)(self.handle, &info) })
            .map(drop)
    }

    /// Both eyes in `space`; `Unsupported` when they are not two.
    pub(super) fn locate_views(
        &self,
        display_time_ns: i64,
        space: sys::Space,
    ) -> Result<(sys::ViewStateFlags, [sys::View; 2]), Error> {
        let info = sys::ViewLocateInfo {
            ty: sys::ViewLocateInfo::TYPE,
            next: ptr::null(),
            view_configuration_type: STEREO,
            display_time: sys::Time::from_nanos(display_time_ns),
            space,
        };
        let mut state = sys::ViewState {
            ty: sys::ViewState::TYPE,
            next: ptr::null_mut(),
            view_state_flags: sys::ViewStateFlags::EMPTY,
        };
        let mut views = [sys::View {
            ty: sys::View::TYPE,
            next: ptr::null_mut(),
            pose: sys::Posef::default(),
            fov: sys::Fovf::default(),
        }; 2];
        let mut count = 0;
        // SAFETY: a live session and space, room for two properly typed views.
        let code = unsafe {
            (self.instance.fp().locate_views)(
                self.handle,
                &info,
                &mut state,
                views.len() as u32,
                &mut count,
                views.as_mut_ptr(),
            )
        };
        if code == sys::Result::ERROR_SIZE_INSUFFICIENT || (code.into_raw() >= 0 && count != 2) {
            return Err(Error::Unsupported(format!(
                "the OpenXR runtime locates {count} eyes where it announced two: update the headset's software"
            )));
        }
        self.check("xrLocateViews", code)?;
        Ok((state.view_state_flags, views))
    }

    /// The part of an eye's picture that nobody sees. `None` where the runtime has no such extension.
    pub(super) fn hidden_area(&self, eye: u32) -> Result<Option<HiddenMesh>, Error> {
        let Some(functions) = self.instance.exts().khr_visibility_mask else { return Ok(None) };
        let (mut vertices, mut indices) = (Vec::new(), Vec::new());
        for _ in 0..ATTEMPTS {
            let mut mask = sys::VisibilityMaskKHR {
                ty: sys::VisibilityMaskKHR::TYPE,
                next: ptr::null_mut(),
                vertex_capacity_input: vertices.len() as u32,
                vertex_count_output: 0,
                vertices: vertices.as_mut_ptr(),
                index_capacity_input: indices.len() as u32,
                index_count_output: 0,
                indices: indices.as_mut_ptr(),
            };
            let kind = sys::VisibilityMaskTypeKHR::HIDDEN_TRIANGLE_MESH;
            // SAFETY: a live session, a properly typed structure, and arrays of the lengths it says.
            let code = unsafe { (functions.get_visibility_mask)(self.handle, STEREO, eye, kind, &mut mask) };
            if code != sys::Result::ERROR_SIZE_INSUFFICIENT {
                self.check("xrGetVisibilityMaskKHR", code)?;
            }
            let (n_vertices, n_indices) =
                (mask.vertex_count_output as usize, mask.index_count_output as usize);
            if n_vertices <= vertices.len() && n_indices <= indices.len() {
                vertices.truncate(n_vertices);
                indices.truncate(n_indices);
                return Ok(Some(HiddenMesh { corners: vertices, indices }));
            }
            vertices.resize(n_vertices, sys::Vector2f { x: 0.0, y: 0.0 });
            indices.resize(n_indices, 0);
        }
        Err(Error::from_code("xrGetVisibilityMaskKHR", sys::Result::ERROR_SIZE_INSUFFICIENT))
    }

    /// Display rates to choose from, in Hz; none where the runtime has no such extension.
    pub(super) fn refresh_rates(&self) -> Result<Vec<f32>, Error> {
        let Some(functions) = self.instance.exts().fb_display_refresh_rate else { return Ok(Vec::new()) };
        self.array("xrEnumerateDisplayRefreshRatesFB", 0f32, |capacity, count, out| {
            // SAFETY: a live session; `out` has room for `capacity` elements.
            unsafe { (functions.enumerate_display_refresh_rates)(self.handle, capacity, count, out) }
        })
    }

    /// Asks for a display rate, one of [`RawSession::refresh_rates`].
    pub(super) fn request_refresh_rate(&self, hz: f32) -> Result<(), Error> {
        let Some(functions) = self.instance.exts().fb_display_refresh_rate else { return Ok(()) };
        // SAFETY: a live session.
        let code = unsafe { (functions.request_display_refresh_rate)(self.handle, hz) };
        self.check("xrRequestDisplayRefreshRateFB", code).map(drop)
    }

    /// Asks for clock rates that last; nothing happens where the runtime has no such extension.
    pub(super) fn request_sustained_performance(&self) -> Result<(), Error> {
        let Some(functions) = self.instance.exts().ext_performance_settings else { return Ok(()) };
        let level = sys::PerfSettingsLevelEXT::SUSTAINED_HIGH;
        for domain in [sys::PerfSettingsDomainEXT::CPU, sys::PerfSettingsDomainEXT::GPU] {
            // SAFETY: a live session.
            let code = unsafe { (functions.perf_settings_set_performance_level)(self.handle, domain, level) };
            self.check("xrPerfSettingsSetPerformanceLevelEXT", code)?;
        }
        Ok(())
    }

    pub(super) fn reference_spaces(&self) -> Result<Vec<ReferenceSpaceType>, Error> {
        self.array("xrEnumerateReferenceSpaces", ReferenceSpaceType::VIEW, |capacity, count, out| {
            // SAFETY: a live session; `out` has room for `capacity` elements.
            unsafe { (self.instance.fp().enumerate_reference_spaces)(self.handle, capacity, count, out) }
        })
    }

    pub(super) fn create_space(
        &self,
        kind: ReferenceSpaceType,
        pose: sys::Posef,
    ) -> Result<sys::Space, Error> {
        let info = sys::ReferenceSpaceCreateInfo {
            ty: sys::ReferenceSpaceCreateInfo::TYPE,
            next: ptr::null(),
            reference_space_type: kind,
            pose_in_reference_space: pose,
        };
        let mut space = sys::Space::default();
        // SAFETY: a live session and a properly typed structure.
        let code = unsafe { (self.instance.fp().create_reference_space)(self.handle, &info, &mut space) };
        self.check("xrCreateReferenceSpace", code).map(|_| space)
    }

    /// `None` where the runtime does not know both place and direction.
    pub(super) fn locate_space(
        &self,
        space: sys::Space,
        base: sys::Space,
        time_ns: i64,
    ) -> Result<Option<sys::Posef>, Error> {
        let mut location = sys::SpaceLocation {
            ty: sys::SpaceLocation::TYPE,
            next: ptr::null_mut(),
            location_flags: sys::SpaceLocationFlags::EMPTY,
            pose: sys::Posef::default(),
        };
        let time = sys::Time::from_nanos(time_ns);
        // SAFETY: two live spaces of this session and a properly typed structure to fill.
        let code = unsafe { (self.instance.fp().locate_space)(space, base, time, &mut location) };
        self.check("xrLocateSpace", code)?;
        let known = sys::SpaceLocationFlags::ORIENTATION_VALID | sys::SpaceLocationFlags::POSITION_VALID;
        Ok(location.location_flags.contains(known).then_some(location.pose))
    }

    pub(super) fn create_action_space(
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

    pub(super) fn path(&self, text: &str) -> Result<sys::Path, Error> {
        let text = CString::new(text)
            .map_err(|_| Error::from_code("xrStringToPath", sys::Result::ERROR_PATH_FORMAT_INVALID))?;
        let mut path = sys::Path::NULL;
        // SAFETY: a live instance and a terminated string.
        let code =
            unsafe { (self.instance.fp().string_to_path)(self.instance.as_raw(), text.as_ptr(), &mut path) };
        self.check("xrStringToPath", code).map(|_| path)
    }

    /// Both names are short enough for their fields.
    pub(super) fn create_action_set(&self, name: &str, title: &str) -> Result<sys::ActionSet, Error> {
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
    pub(super) fn create_action(
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
    pub(super) fn suggest(
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

    pub(super) fn attach(&self, set: sys::ActionSet) -> Result<(), Error> {
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
    pub(super) fn sync(&self, set: sys::ActionSet) -> Result<bool, Error> {
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
    pub(super) fn float_state(&self, action: sys::Action, hand: sys::Path) -> Result<Option<f32>, Error> {
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
    pub(super) fn vector_state(&self, action: sys::Action, hand: sys::Path) -> Result<Vec2, Error> {
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
    pub(super) fn boolean_state(&self, action: sys::Action, hand: sys::Path) -> Result<bool, Error> {
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
    pub(super) fn is_pose_active(&self, action: sys::Action, hand: sys::Path) -> Result<bool, Error> {
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
    pub(super) fn pulse(&self, action: sys::Action, hand: sys::Path, amplitude: f32) -> Result<(), Error> {
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
    pub(super) fn interaction_profile(&self, hand: sys::Path) -> Result<Option<String>, Error> {
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
    pub(super) fn bound_sources(&self, action: sys::Action) -> Result<Vec<sys::Path>, Error> {
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
    pub(super) fn source_name(&self, source_path: sys::Path) -> Result<String, Error> {
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

    pub(super) fn destroy_action_set(&self, set: sys::ActionSet) {
        // SAFETY: the caller owns the action set and gives it up.
        unsafe { (self.instance.fp().destroy_action_set)(set) };
    }

    pub(super) fn destroy_space(&self, space: sys::Space) {
        // SAFETY: the caller owns the space and gives it up.
        unsafe { (self.instance.fp().destroy_space)(space) };
    }

    pub(super) fn swapchain_formats(&self) -> Result<Vec<vk::Format>, Error> {
        let formats = self.array("xrEnumerateSwapchainFormats", 0i64, |capacity, count, out| {
            // SAFETY: a live session; `out` has room for `capacity` elements.
            unsafe { (self.instance.fp().enumerate_swapchain_formats)(self.handle, capacity, count, out) }
        })?;
        let known = formats.iter().filter_map(|&f| i32::try_from(f).ok());
        Ok(known.map(vk::Format::from_raw).collect())
    }

    pub(super) fn create_swapchain(
        &self,
        format: vk::Format,
        usage: sys::SwapchainUsageFlags,
        shape: Shape,
    ) -> Result<sys::Swapchain, Error> {
        let info = sys::SwapchainCreateInfo {
            ty: sys::SwapchainCreateInfo::TYPE,
            next: ptr::null(),
            create_flags: sys::SwapchainCreateFlags::EMPTY,
            usage_flags: usage,
            format: i64::from(format.as_raw()),
            sample_count: 1,
            width: shape.extent.width,
            height: shape.extent.height,
            face_count: shape.faces,
            array_size: shape.array,
            mip_count: 1,
        };
        let mut swapchain = sys::Swapchain::default();
        // SAFETY: a live session and a properly typed structure.
        self.with_queue("xrCreateSwapchain", || unsafe {
            (self.instance.fp().create_swapchain)(self.handle, &info, &mut swapchain)
        })?;
        Ok(swapchain)
    }

    pub(super) fn swapchain_images(&self, swapchain: sys::Swapchain) -> Result<Vec<vk::Image>, Error> {
        let empty = sys::SwapchainImageVulkanKHR {
            ty: sys::SwapchainImageVulkanKHR::TYPE,
            next: ptr::null_mut(),
            image: 0,
        };
        let images = self.array("xrEnumerateSwapchainImages", empty, |capacity, count, out| {
            // SAFETY: a live swapchain; `out` has room for `capacity` properly typed Vulkan images.
            unsafe { (self.instance.fp().enumerate_swapchain_images)(swapchain, capacity, count, out.cast()) }
        })?;
        Ok(images.iter().map(|i| vk::Image::from_raw(i.image)).collect())
    }

    pub(super) fn acquire_image(&self, swapchain: sys::Swapchain) -> Result<u32, Error> {
        let mut index = 0;
        // SAFETY: a live swapchain; the info may be null.
        self.with_queue("xrAcquireSwapchainImage", || unsafe {
            (self.instance.fp().acquire_swapchain_image)(swapchain, ptr::null(), &mut index)
        })?;
        Ok(index)
    }

    /// Waits for the acquired image, the queue being free meanwhile. False when it is still in use after the time-out:
    /// `TIMEOUT_EXPIRED` is a success code, but the image must not be touched.
    pub(super) fn wait_image(&self, swapchain: sys::Swapchain, timeout_ns: i64) -> Result<bool, Error> {
        let info = sys::SwapchainImageWaitInfo {
            ty: sys::SwapchainImageWaitInfo::TYPE,
            next: ptr::null(),
            timeout: sys::Duration::from_nanos(timeout_ns),
        };
        // SAFETY: a live swapchain and a properly typed structure.
        let code = unsafe { (self.instance.fp().wait_swapchain_image)(swapchain, &info) };
        let code = self.check("xrWaitSwapchainImage", code)?;
        Ok(outcome("xrWaitSwapchainImage", code) != Outcome::SkipFrame)
    }

    pub(super) fn release_image(&self, swapchain: sys::Swapchain) -> Result<(), Error> {
        // SAFETY: a live swapchain; the info may be null.
        self.with_queue("xrReleaseSwapchainImage", || unsafe {
            (self.instance.fp().release_swapchain_image)(swapchain, ptr::null())
        })
        .map(drop)
    }

    pub(super) fn destroy_swapchain(&self, swapchain: sys::Swapchain) {
        // SAFETY: the caller owns the swapchain, gives it up, and has waited for the GPU to be done with its images.
        self.gpu.with_queue(|_| unsafe { (self.instance.fp().destroy_swapchain)(swapchain) });
    }

    /// Waits until the GPU has finished everything submitted. When it does not, nothing of the session is destroyed any
    /// more: a leak is better than images freed in use.
    pub(super) fn wait_gpu_idle(&self) {
        let device = &self.gpu.device;
        // SAFETY: plain creation on a live device; the fence is submitted once, and destroyed when it is signalled.
        let waited = unsafe {
            device.create_fence(&vk::FenceCreateInfo::default(), None).and_then(|fence| {
                self.gpu.with_queue(|queue| device.queue_submit(queue, &[], fence))?;
                device.wait_for_fences(&[fence], true, GPU_TIMEOUT_NS)?;
                device.destroy_fence(fence, None);
                Ok(())
            })
        };
        if let Err(code) = waited {
            tracing::warn!("the GPU did not finish its work ({code}); the session's images are left to it");
            self.hung.store(true, Ordering::Relaxed);
        }
    }

    /// Whether the GPU may still be using the session's images, so that they must stay.
    pub(super) fn hung(&self) -> bool {
        self.hung.load(Ordering::Relaxed)
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

impl Drop for RawSession {
    fn drop(&mut self) {
        if self.hung() {
            return;
        }
        // SAFETY: the last owner of the handle; everything made from it is gone.
        self.gpu.with_queue(|_| unsafe { (self.instance.fp().destroy_session)(self.handle) });
    }
}
