//! The headset changes in mid-session: where LOCAL is, what the eyes see, how fast the display is, who wears it.

use std::time::Duration;

use ash::vk;
use glam::Quat;
use openxr::sys::{self, Handle as _, ReferenceSpaceType};

use super::{State, event::Event, instance::Instance};
use crate::mock::{
    config::Mask,
    fault::{Outcome, require},
    pose::{Fov, Pose},
    script::PerformanceNotice,
};

/// The floor under an origin.
pub fn floor_of(origin: Pose) -> Pose {
    let mut floor = origin;
    floor.position.y = 0.0;
    floor
}

impl State {
    /// The origin of LOCAL in STAGE at a time.
    pub fn local_origin(&self, time_ns: i64) -> Pose {
        let origin = self.origins.iter().rev().find(|(since, _)| *since <= time_ns);
        origin.or(self.origins.first()).map_or(Pose::IDENTITY, |(_, origin)| *origin)
    }

    /// Moves LOCAL, and LOCAL_FLOOR with it, to a pose in what it was.
    pub fn recentre(&mut self, new_in_previous: Pose, delay: Duration) {
        let delay_ns = i64::try_from(delay.as_nanos()).unwrap_or(i64::MAX);
        let (last_ns, old) = self.origins.last().copied().unwrap_or((i64::MIN, Pose::IDENTITY));
        let change_ns = self.timeline.now_ns().saturating_add(delay_ns).max(last_ns);
        let new = old.then(new_in_previous);
        self.origins.push((change_ns, new));
        let floor = floor_of(old).inverse().then(floor_of(new));
        let moved = |kind, pose| move |session| Event::ReferenceSpace { session, kind, change_ns, pose };
        self.tell_sessions(|_| true, moved(ReferenceSpaceType::LOCAL, new_in_previous));
        self.tell_sessions(Instance::has_local_floor, moved(ReferenceSpaceType::LOCAL_FLOOR, floor));
    }

    /// Moves LOCAL to where the head is, upright: what the recentre button of a headset does.
    pub fn recentre_on_head(&mut self) {
        let Some((session, _)) = self.sessions.iter().next() else { return };
        let now_ns = self.timeline.now_ns();
        let head = self.head(session, now_ns);
        let (yaw, ..) = head.orientation.to_euler(glam::EulerRot::YXZ);
        let upright = Pose::new(head.position, Quat::from_rotation_y(yaw));
        let last = self.origins.last().map_or(Pose::IDENTITY, |(_, origin)| *origin);
        self.recentre(last.inverse().then(upright), Duration::ZERO);
    }

    /// Other bounds of STAGE, which stays where it is.
    pub fn set_bounds(&mut self, bounds_m: Option<[f32; 2]>) {
        self.config.bounds_m = bounds_m;
        if self.config.stage {
            let change_ns = self.timeline.now_ns();
            let kind = ReferenceSpaceType::STAGE;
            let pose = Pose::IDENTITY;
            self.tell_sessions(|_| true, |session| Event::ReferenceSpace { session, kind, change_ns, pose });
        }
    }

    pub fn set_fov(&mut self, fov: [Fov; 2]) {
        let old = std::mem::replace(&mut self.config.fov, fov);
        if self.config.mask != Mask::Empty {
            self.tell_masks([0, 1].map(|eye| fov[eye] != old[eye]));
        }
    }

    pub fn set_mask(&mut self, mask: Mask) {
        let old = std::mem::replace(&mut self.config.mask, mask);
        self.tell_masks([mask != old; 2]);
    }

    fn tell_masks(&mut self, changed: [bool; 2]) {
        for view in [0, 1].into_iter().filter(|view| changed[*view as usize]) {
            let told = |instance: &Instance| instance.has("XR_KHR_visibility_mask");
            self.tell_sessions(told, |session| Event::VisibilityMask { session, view });
        }
    }

    pub fn set_present(&mut self, present: bool) {
        if std::mem::replace(&mut self.present, present) != present && self.config.user_presence {
            for handle in self.sessions.handles_where(|session| session.running && !session.lost) {
                self.tell_presence(handle);
            }
        }
    }

    /// Tells a session whether the headset is worn, if it asked for the extension.
    pub fn tell_presence(&mut self, handle: sys::Session) {
        let (present, sensed) = (self.present, self.config.user_presence);
        if let Ok(session) = self.sessions.get(handle)
            && let Ok(instance) = self.instances.get_mut(session.instance)
            && sensed
            && instance.has("XR_EXT_user_presence")
        {
            instance.events.push(Event::UserPresence { session: handle, present });
        }
    }

    /// Rates the display can have, hertz, rising.
    pub fn refresh_rates(&self) -> Vec<f32> {
        let mut rates = self.config.refresh_rates_hz.clone();
        rates.push(self.config.clock.hz() as f32);
        rates.sort_by(f32::total_cmp);
        rates.dedup();
        rates
    }

    /// The application asks for a rate; 0 leaves it to the runtime.
    pub fn request_refresh_rate(&mut self, hz: f32) -> Outcome<()> {
        if hz == 0.0 {
            self.set_refresh_rate(self.config.clock.hz() as f32);
            return Ok(());
        }
        require!(
            self.refresh_rates().contains(&hz),
            ERROR_DISPLAY_REFRESH_RATE_UNSUPPORTED_FB,
            "{} Hz is not among the rates xrEnumerateDisplayRefreshRatesFB gives",
            hz
        );
        self.set_refresh_rate(hz);
        Ok(())
    }

    pub fn set_refresh_rate(&mut self, to_hz: f32) {
        let from_hz = self.timeline.hz as f32;
        if to_hz == from_hz || !(1.0..=1000.0).contains(&to_hz) {
            return;
        }
        self.timeline.set_hz(f64::from(to_hz));
        for instance in self.instances.iter_mut() {
            if instance.has("XR_FB_display_refresh_rate") {
                instance.events.push(Event::RefreshRate { from_hz, to_hz });
            }
        }
    }

    /// Other formats, for sessions that are there too.
    pub fn set_formats(&mut self, formats: Vec<vk::Format>) {
        for session in self.sessions.iter_mut() {
            session.offer(&formats);
        }
        self.config.formats = formats;
    }

    pub fn notify_performance(&mut self, notice: PerformanceNotice) {
        for instance in self.instances.iter_mut() {
            if instance.has("XR_EXT_performance_settings") {
                instance.events.push(Event::Performance(notice));
            }
        }
    }

    /// Queues an event for every session of the instances that are to be told.
    fn tell_sessions(&mut self, told: impl Fn(&Instance) -> bool, event: impl Fn(sys::Session) -> Event) {
        for handle in self.sessions.handles_where(|session| !session.lost) {
            if let Ok(session) = self.sessions.get(handle)
                && let Ok(instance) = self.instances.get_mut(session.instance)
                && told(instance)
            {
                instance.events.push(event(handle));
            }
        }
    }

    /// Queues an event that belongs to a session nobody made.
    pub fn tell_foreign_event(&mut self) {
        let time_ns = self.timeline.now_ns();
        let session = sys::Session::from_raw(0xF0E1_D2C3_B4A5_9687);
        let state = sys::SessionState::STOPPING;
        for instance in self.instances.iter_mut() {
            instance.events.push(Event::SessionState { session, state, time_ns });
        }
    }
}
