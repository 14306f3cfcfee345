//! Every OpenXR call of a session, made safe: typed arguments in, checked codes out, the Vulkan queue held where it must be: here its life, its
//! events and its spaces.

#![allow(unsafe_code, reason = "calls the C interface of the OpenXR runtime")]

mod frame;
mod images;
mod input;

use std::mem::MaybeUninit;
use std::ptr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use ash::vk::{self, Handle as _};
use openxr::{ReferenceSpaceType, SessionState, sys};

pub(super) use self::frame::{CubeLayer, Layer, LayerEye, QuadLayer};
pub(super) use self::images::Shape;
use super::arrays::two_call;
use super::error::{Error, check};
use super::outcome::{Outcome, outcome};
use super::runtime::{Runtime, STEREO};
use crate::gpu::Gpu;

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

    pub(super) fn destroy_space(&self, space: sys::Space) {
        // SAFETY: the caller owns the space and gives it up.
        unsafe { (self.instance.fp().destroy_space)(space) };
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

impl Drop for RawSession {
    fn drop(&mut self) {
        if self.hung() {
            return;
        }
        // SAFETY: the last owner of the handle; everything made from it is gone.
        self.gpu.with_queue(|_| unsafe { (self.instance.fp().destroy_session)(self.handle) });
    }
}
