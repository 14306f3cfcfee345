//! Script files: what stands in them, checked into a [`Script`].

use std::ops::Range;
use std::time::Duration;

use ash::vk;
use glam::{EulerRot, Quat, Vec3};
use openxr::sys;
use toml::Spanned;

use super::raw::{
    Number, RawCue, RawFault, RawHeadset, RawKey, RawPerformance, RawRecentre, RawScript, RawTiming, Whole,
};
use super::reader::{Reader, ScriptError};
use super::{Act, CallFault, Cue, InputAct, PerformanceNotice, Script, When};
use crate::mock::{
    abi,
    config::{Clock, Mask, MockConfig, Timing, TimingSpan, Tracking, TrackingSpan},
    input::InputError,
    journal::Calls,
    pose::{Fov, Pose, PoseTrack},
    registry,
    state::device::Devices,
};

impl Script {
    /// Reads a script; `name` is what errors call the file. `config/mock/tour.toml` shows every key.
    pub fn from_toml(text: &str, name: &str) -> Result<Self, ScriptError> {
        let reader = Reader { file: name, text };
        let raw: RawScript = toml::from_str(text).map_err(|error| reader.explain(&error))?;
        let mut config = match &raw.headset {
            Some(headset) => reader.headset(headset)?,
            None => MockConfig::default(),
        };
        if let Some(head) = reader.track(&raw.head)? {
            config.head = head;
        }
        let start = raw.start.as_ref().map(|start| reader.start(start)).transpose()?;
        Ok(Self {
            config,
            start: start.unwrap_or_default(),
            cues: raw.cue.iter().map(|cue| reader.cue(cue)).collect::<Result<_, _>>()?,
            faults: raw.fault.iter().map(|fault| reader.fault(fault)).collect::<Result<_, _>>()?,
        })
    }
}

const TRACKING: [(&str, Tracking); 4] = [
    ("full", Tracking::FULL),
    ("guessed", Tracking::GUESSED),
    ("orientation_only", Tracking::ORIENTATION_ONLY),
    ("lost", Tracking::LOST),
];

impl Reader<'_> {
    fn headset(&self, raw: &RawHeadset) -> Result<MockConfig, ScriptError> {
        let mut config = MockConfig::default();
        let hz = self.number("hz", raw.hz.as_ref(), 1.0..=1000.0)?.unwrap_or(config.clock.hz());
        let clocks = [("real", Clock::Real { hz }), ("stepped", Clock::Stepped { hz })];
        config.clock = self.choice("clock", raw.clock.as_ref(), &clocks)?.unwrap_or(Clock::Real { hz });
        set(&mut config.eye_size, self.size("eye_size", raw.eye_size.as_ref())?);
        config.right_eye_size = self.size("right_eye_size", raw.right_eye_size.as_ref())?;
        set(&mut config.max_image_size, self.size("max_image_size", raw.max_image_size.as_ref())?);
        set(&mut config.fov, self.fov(raw.fov_deg.as_ref())?);
        set(&mut config.fov_mutable, raw.fov_mutable);
        set(&mut config.eye_turn, self.turns(raw.eye_turn_deg.as_ref())?);
        set(&mut config.ipd_m, self.number("ipd_m", raw.ipd_m.as_ref(), 0.0..=1.0)?.map(|it| it as f32));
        set(&mut config.mask, self.mask(raw.mask.as_ref(), raw.mask_cut.as_ref())?);
        set(&mut config.refresh_rates_hz, self.rates(raw.refresh_rates_hz.as_ref())?);
        set(&mut config.user_presence, raw.user_presence);
        set(&mut config.user_present, raw.user_present);
        set(&mut config.asleep, raw.asleep);
        set(&mut config.early_error_m, self.vector("early_error_m", raw.early_error_m.as_ref(), 1e3)?);
        if let Some(origin) = &raw.local_origin {
            let (yaw, pitch, roll) = (&origin.yaw_deg, &origin.pitch_deg, &origin.roll_deg);
            config.local_origin = self.pose(origin.position.as_ref(), [yaw, pitch, roll])?;
        }
        set(&mut config.stage, raw.stage);
        set(&mut config.bounds_m, self.bounds(raw.bounds_m.as_ref())?);
        for span in &raw.tracking {
            let tracking = self.choice("state", Some(&span.state), &TRACKING)?.unwrap_or(Tracking::FULL);
            config.tracking.push(TrackingSpan { frames: self.frames(&span.frames)?, tracking });
        }
        if let Some(spans) = &raw.skip_rendering {
            for [first, end] in spans.get_ref() {
                if first >= end {
                    return Err(self.refuse("skip_rendering", spans));
                }
                config.skip_rendering.push(*first..*end);
            }
        }
        for span in &raw.timing {
            let at = span.span();
            let span = span.get_ref();
            let timing =
                self.timing(at, (&span.late, &span.every), (&span.jitter_ms, &span.ahead_ms), &span.frozen)?;
            config.timing.push(TimingSpan { frames: self.frames(&span.frames)?, timing });
        }
        set(&mut config.read_back, raw.read_back);
        let keep = self.whole("keep_frames", raw.keep_frames.as_ref(), 1..=100_000)?;
        set(&mut config.keep_frames, keep.map(|it| it as usize));
        let versions = [("1.0", (1, 0)), ("1.1", (1, 1))];
        set(&mut config.max_api_version, self.choice("api_version", raw.api_version.as_ref(), &versions)?);
        set(&mut config.absent_extensions, raw.absent_extensions.clone());
        set(&mut config.unavailable_calls, raw.unavailable_calls);
        set(&mut config.formats, raw.formats.as_deref().map(|it| self.formats(it)).transpose()?);
        let images = self.whole("image_count", raw.image_count.as_ref(), 1..=16)?;
        set(&mut config.image_count, images.map(|it| it as u32));
        let images = self.whole("depth_image_count", raw.depth_image_count.as_ref(), 1..=16)?;
        config.depth_image_count = images.map(|it| it as u32);
        set(&mut config.shuffle_images, raw.shuffle_images);
        set(&mut config.image_timeouts, raw.image_timeouts);
        let layers = self.whole("max_layers", raw.max_layers.as_ref(), 1..=10_000)?;
        set(&mut config.max_layers, layers.map(|it| it as u32));
        set(&mut config.view_count, self.few("view_count", raw.view_count.as_ref())?);
        set(&mut config.graphics_device, self.few("graphics_device", raw.graphics_device.as_ref())?);
        Ok(config)
    }

    fn start(&self, raw: &RawCue) -> Result<Vec<Act>, ScriptError> {
        let times = [raw.frame.as_ref().map(Spanned::span), raw.time_s.as_ref().map(Spanned::span)];
        let calls = [raw.call.as_ref().map(Spanned::span), raw.nth.as_ref().map(Spanned::span)];
        if let Some(at) = times.into_iter().chain(calls).flatten().next() {
            let remedy = "what is in [start] happens before anything else";
            return Err(self.error(at, "[start] has a moment", remedy));
        }
        self.acts(raw)
    }

    fn cue(&self, raw: &Spanned<RawCue>) -> Result<Cue, ScriptError> {
        let at = raw.span();
        let raw = raw.get_ref();
        let time_s = self.number("time_s", raw.time_s.as_ref(), 0.0..=1e6)?;
        let nth = self.whole("nth", raw.nth.as_ref(), 1..)?;
        let frame = raw.frame.as_ref().map(|frame| *frame.get_ref());
        let when = match (frame, time_s, &raw.call) {
            (Some(frame), None, None) if nth.is_none() => When::Frame(frame),
            (None, Some(seconds), None) if nth.is_none() => When::Seconds(seconds),
            (None, None, Some(call)) => When::Call { function: self.function(call)?, nth: nth.unwrap_or(1) },
            _ => {
                let remedy = "it should have one of `frame`, `time_s` and `call`, and `nth` only with `call`";
                return Err(self.error(at, "this cue is not due at one moment", remedy));
            }
        };
        let acts = self.acts(raw)?;
        if acts.is_empty() {
            let remedy = "it should have a key such as `session`; config/mock/tour.toml shows all of them";
            return Err(self.error(at, "nothing happens in this cue", remedy));
        }
        Ok(Cue { when, acts })
    }

    /// What a cue does, in the order of this list.
    fn acts(&self, raw: &RawCue) -> Result<Vec<Act>, ScriptError> {
        let events =
            [("repeated", Act::RepeatEvent), ("foreign", Act::ForeignEvent), ("unknown", Act::UnknownEvent)];
        let sessions = [
            ("focused", Act::GainFocus),
            ("visible", Act::LoseFocus),
            ("hidden", Act::Hide),
            ("stopped", Act::Stop),
            ("exit", Act::Exit),
            ("loss_pending", Act::LoseSession),
            ("lost", Act::KillSession),
        ];
        let renderings = [("yes", Some(true)), ("no", Some(false)), ("as_configured", None)];
        let seconds = |delay: f64| Duration::from_secs_f64(delay);
        let acts = [
            self.track(&raw.head)?.map(Act::Head),
            self.tracking(raw.tracking.as_ref())?.map(Act::Tracking),
            self.choice("should_render", raw.should_render.as_ref(), &renderings)?.map(Act::ShouldRender),
            self.bounds(raw.bounds_m.as_ref())?.map(Act::Bounds),
            self.yes("recentre_on_head", raw.recentre_on_head.as_ref())?.map(|()| Act::RecentreOnHead),
            raw.recentre.as_ref().map(|recentre| self.recentre(recentre)).transpose()?,
            self.fov(raw.fov_deg.as_ref())?.map(Act::Fov),
            self.number("ipd_m", raw.ipd_m.as_ref(), 0.0..=1.0)?.map(|ipd_m| Act::Ipd(ipd_m as f32)),
            self.turns(raw.eye_turn_deg.as_ref())?.map(Act::EyeTurn),
            self.eye_sizes(raw)?.map(Act::EyeSizes),
            self.mask(raw.mask.as_ref(), raw.mask_cut.as_ref())?.map(Act::Mask),
            raw.formats.as_deref().map(|it| self.formats(it)).transpose()?.map(Act::Formats),
            self.rates(raw.refresh_rates_hz.as_ref())?.map(Act::RefreshRates),
            self.number("refresh_hz", raw.refresh_hz.as_ref(), 1.0..=1000.0)?
                .map(|hz| Act::RefreshRate(hz as f32)),
            raw.user_present.map(Act::UserPresent),
            raw.timing.as_ref().map(|timing| self.new_timing(timing)).transpose()?,
            raw.image_timeouts.map(Act::ImageTimeouts),
            raw.shuffle_images.map(Act::ShuffleImages),
            self.few("view_count", raw.view_count.as_ref())?.map(Act::ViewCount),
            self.few("graphics_device", raw.graphics_device.as_ref())?.map(Act::GraphicsDevice),
            raw.performance.as_ref().map(|notice| self.performance(notice)).transpose()?,
            raw.lost_events.map(Act::ClaimLostEvents),
            self.choice("event", raw.event.as_ref(), &events)?,
            raw.unavailable_calls.map(Act::DisconnectFor),
            self.choice("session", raw.session.as_ref(), &sessions)?,
            raw.force_state.as_ref().map(|state| self.session_state(state)).transpose()?,
            self.number("instance_loss_s", raw.instance_loss_s.as_ref(), 0.0..=1e6)?
                .map(|delay| Act::LoseInstance(seconds(delay))),
        ];
        Ok(acts.into_iter().flatten().chain(self.input(raw)?).collect())
    }

    /// What a cue does to devices: those that go, those that come, what is pressed.
    fn input(&self, raw: &RawCue) -> Result<Vec<Act>, ScriptError> {
        let mut acts = Vec::new();
        let mut add = |at: Range<usize>, act: InputAct| match Devices::default().perform(act.clone(), 0) {
            // Whether the device is there then, only playing the script can tell.
            Ok(()) | Err(InputError::NotConnected(_)) => {
                acts.push(Act::Input(act));
                Ok(())
            }
            Err(error) => {
                let remedy = "paths, profiles and types of values are those of the OpenXR registry";
                Err(self.error(at, error.to_string(), remedy))
            }
        };
        for path in raw.disconnect.iter().flatten() {
            add(path.span(), InputAct::Disconnect { user_path: path.get_ref().clone() })?;
        }
        for (user_path, profile) in raw.connect.iter().flatten() {
            let (user_path, at) = (user_path.clone(), profile.span());
            add(at, InputAct::Connect { user_path, profile: profile.get_ref().clone() })?;
        }
        for (user_path, tracking) in raw.device_tracking.iter().flatten() {
            let (user_path, at) = (user_path.clone(), tracking.span());
            let tracking = self.chosen("device_tracking", tracking, &TRACKING)?;
            add(at, InputAct::Tracking { user_path, tracking })?;
        }
        for (user_path, seen) in raw.bare_hands.iter().flatten() {
            let user_path = user_path.clone();
            add(seen.span(), InputAct::Hand { user_path, seen: *seen.get_ref() })?;
        }
        for (path, keys) in raw.poses.iter().flatten() {
            let Some(track) = self.track(keys.get_ref())? else {
                return Err(self.refuse("poses", keys));
            };
            add(keys.span(), InputAct::Track { path: path.clone(), track })?;
        }
        for (path, value) in raw.input.iter().flatten() {
            let (path, at) = (path.clone(), value.span());
            add(at, InputAct::Set { path, value: (*value.get_ref()).into() })?;
        }
        Ok(acts)
    }

    fn fault(&self, raw: &RawFault) -> Result<CallFault, ScriptError> {
        let nth = self.whole("nth", raw.nth.as_ref(), 1..)?;
        let from = self.whole("from", raw.from.as_ref(), 1..)?;
        let calls = match (nth, from) {
            (Some(nth), None) => Calls::Nth(nth),
            (None, Some(from)) => Calls::From(from),
            (None, None) => Calls::All,
            (Some(_), Some(_)) => {
                let at = raw.call.span();
                return Err(self.error(at, "this fault has both `nth` and `from`", "keep one of the two"));
            }
        };
        let name = raw.returns.get_ref();
        let code = result_named(name).ok_or_else(|| self.refuse("returns", &raw.returns))?;
        Ok(CallFault { function: self.function(&raw.call)?, calls, code })
    }

    fn function(&self, call: &Spanned<String>) -> Result<&'static str, ScriptError> {
        abi::function_names().find(|name| name == call.get_ref()).ok_or_else(|| self.refuse("call", call))
    }

    fn session_state(&self, name: &Spanned<String>) -> Result<Act, ScriptError> {
        let states = (0..=8).map(sys::SessionState::from_raw);
        let wanted = name.get_ref().trim_start_matches("XR_SESSION_STATE_");
        let found = states.into_iter().find(|state| format!("{state:?}") == wanted);
        found.map(Act::ForceState).ok_or_else(|| self.refuse("force_state", name))
    }

    fn recentre(&self, raw: &RawRecentre) -> Result<Act, ScriptError> {
        let angles = [&raw.yaw_deg, &raw.pitch_deg, &raw.roll_deg];
        let delay = self.number("delay_s", raw.delay_s.as_ref(), 0.0..=1e6)?.unwrap_or(0.0);
        Ok(Act::Recentre {
            new_in_previous: self.pose(raw.position.as_ref(), angles)?,
            delay: Duration::from_secs_f64(delay),
        })
    }

    fn performance(&self, raw: &RawPerformance) -> Result<Act, ScriptError> {
        use sys::{
            PerfSettingsDomainEXT as Domain, PerfSettingsNotificationLevelEXT as Level,
            PerfSettingsSubDomainEXT as SubDomain,
        };
        let domains = [("cpu", Domain::CPU), ("gpu", Domain::GPU)];
        let sub_domains = [
            ("compositing", SubDomain::COMPOSITING),
            ("rendering", SubDomain::RENDERING),
            ("thermal", SubDomain::THERMAL),
        ];
        let levels = [("normal", Level::NORMAL), ("warning", Level::WARNING), ("impaired", Level::IMPAIRED)];
        Ok(Act::Performance(PerformanceNotice {
            domain: self.chosen("domain", &raw.domain, &domains)?,
            sub_domain: self.chosen("sub_domain", &raw.sub_domain, &sub_domains)?,
            from: self.chosen("from", &raw.from, &levels)?,
            to: self.chosen("to", &raw.to, &levels)?,
        }))
    }

    fn tracking(&self, word: Option<&Spanned<String>>) -> Result<Option<Option<Tracking>>, ScriptError> {
        let mut choices: Vec<_> = TRACKING.iter().map(|(name, it)| (*name, Some(*it))).collect();
        choices.push(("as_configured", None));
        self.choice("tracking", word, &choices)
    }

    /// The timing from now on; an empty table gives it back to the configuration.
    fn new_timing(&self, raw: &Spanned<RawTiming>) -> Result<Act, ScriptError> {
        let RawTiming { late, every, jitter_ms, ahead_ms, frozen } = raw.get_ref();
        let numbers = [jitter_ms, ahead_ms];
        let is_empty = late.is_none() && every.is_none() && numbers.iter().all(|it| it.is_none());
        if is_empty && frozen.is_none() {
            return Ok(Act::Timing(None));
        }
        self.timing(raw.span(), (late, every), (jitter_ms, ahead_ms), frozen).map(|it| Act::Timing(Some(it)))
    }

    /// The one timing that is given.
    fn timing(
        &self,
        at: Range<usize>,
        (late, every): (&Whole, &Whole),
        (jitter_ms, ahead_ms): (&Number, &Number),
        frozen: &Option<Spanned<bool>>,
    ) -> Result<Timing, ScriptError> {
        let periods = |key, value: &Whole| self.whole(key, value.as_ref(), 1..=1000);
        let given = [
            periods("late", late)?.map(|it| Timing::Late { periods: it as u32 }),
            periods("every", every)?.map(|it| Timing::Every { periods: it as u32 }),
            self.number("jitter_ms", jitter_ms.as_ref(), 0.0..=1e3)?
                .map(|ms| Timing::Jitter { most_ns: (ms * 1e6) as u32 }),
            self.number("ahead_ms", ahead_ms.as_ref(), 0.0..=1e10)?
                .map(|ms| Timing::Ahead { ns: (ms * 1e6) as i64 }),
            self.yes("frozen", frozen.as_ref())?.map(|()| Timing::Frozen),
        ];
        let mut given = given.into_iter().flatten();
        match (given.next(), given.next()) {
            (Some(timing), None) => Ok(timing),
            _ => Err(self.error(
                at,
                "this timing is not one of the five",
                "it should have one of `late`, `every`, `jitter_ms`, `ahead_ms` and `frozen = true`",
            )),
        }
    }

    fn rates(&self, raw: Option<&Spanned<Vec<f64>>>) -> Result<Option<Vec<f32>>, ScriptError> {
        match raw {
            Some(raw) if raw.get_ref().iter().all(|rate| (1.0..=1000.0).contains(rate)) => {
                Ok(Some(raw.get_ref().iter().map(|rate| *rate as f32).collect()))
            }
            Some(raw) => Err(self.refuse("refresh_rates_hz", raw)),
            None => Ok(None),
        }
    }

    fn formats(&self, names: &[Spanned<String>]) -> Result<Vec<vk::Format>, ScriptError> {
        let known = MockConfig::default().formats;
        let spelled: Vec<String> = known.iter().map(|format| format!("{format:?}")).collect();
        let choices: Vec<(&str, vk::Format)> = spelled.iter().map(String::as_str).zip(known).collect();
        names.iter().map(|name| self.chosen("formats", name, &choices)).collect()
    }

    fn eye_sizes(&self, raw: &RawCue) -> Result<Option<[[u32; 2]; 2]>, ScriptError> {
        let left = self.size("eye_size", raw.eye_size.as_ref())?;
        let right = self.size("right_eye_size", raw.right_eye_size.as_ref())?;
        match (left, right, &raw.right_eye_size) {
            (Some(left), right, _) => Ok(Some([left, right.unwrap_or(left)])),
            (None, Some(_), Some(given)) => {
                let remedy = "it should come with `eye_size`";
                Err(self.error(given.span(), "`right_eye_size` is alone in this cue", remedy))
            }
            _ => Ok(None),
        }
    }

    fn mask(
        &self,
        word: Option<&Spanned<String>>,
        cut: Option<&Spanned<f64>>,
    ) -> Result<Option<Mask>, ScriptError> {
        let given = self.number("mask_cut", cut, 0.0..=0.5)?;
        let octagon = Mask::Octagon { cut: given.unwrap_or(0.25) as f32 };
        let mask = self.choice("mask", word, &[("octagon", octagon), ("empty", Mask::Empty)])?;
        Ok(mask.or(given.map(|_| octagon)))
    }

    fn bounds(&self, raw: Option<&Spanned<Vec<f64>>>) -> Result<Option<Option<[f32; 2]>>, ScriptError> {
        let Some(raw) = raw else { return Ok(None) };
        match raw.get_ref()[..] {
            [] => Ok(Some(None)),
            [width, depth] if width > 0.0 && depth > 0.0 && width + depth < 1e6 => {
                Ok(Some(Some([width as f32, depth as f32])))
            }
            _ => Err(self.refuse("bounds_m", raw)),
        }
    }

    fn fov(&self, raw: Option<&Spanned<[[f64; 4]; 2]>>) -> Result<Option<[Fov; 2]>, ScriptError> {
        let Some(raw) = raw else { return Ok(None) };
        if !raw.get_ref().as_flattened().iter().all(|angle| angle.abs() < 90.0) {
            return Err(self.refuse("fov_deg", raw));
        }
        Ok(Some(raw.get_ref().map(|eye| {
            let [left, right, up, down] = eye.map(|angle| angle.to_radians() as f32);
            Fov { left, right, up, down }
        })))
    }

    fn turns(&self, raw: Option<&Spanned<[[f64; 3]; 2]>>) -> Result<Option<[Quat; 2]>, ScriptError> {
        let Some(raw) = raw else { return Ok(None) };
        if !raw.get_ref().as_flattened().iter().all(|angle| angle.abs() <= 360.0) {
            return Err(self.refuse("eye_turn_deg", raw));
        }
        Ok(Some(raw.get_ref().map(turn)))
    }

    /// A pose track; `None` without keyframes.
    fn track(&self, keys: &[RawKey]) -> Result<Option<PoseTrack>, ScriptError> {
        let key = |key: &RawKey| {
            let time_s = self.number("time_s", Some(&key.time_s), 0.0..=1e6)?.unwrap_or(0.0);
            let pose = self.pose(key.position.as_ref(), [&key.yaw_deg, &key.pitch_deg, &key.roll_deg])?;
            Ok((time_s, pose))
        };
        let keys: Vec<_> = keys.iter().map(key).collect::<Result<_, ScriptError>>()?;
        Ok((!keys.is_empty()).then(|| PoseTrack::new(keys)))
    }

    fn pose(
        &self,
        position: Option<&Spanned<[f64; 3]>>,
        [yaw, pitch, roll]: [&Number; 3],
    ) -> Result<Pose, ScriptError> {
        let angle =
            |key, value: &Number| Ok(self.number(key, value.as_ref(), -3600.0..=3600.0)?.unwrap_or(0.0));
        let position = self.vector("position", position, 1e6)?.unwrap_or(Vec3::ZERO);
        let angles = [angle("yaw_deg", yaw)?, angle("pitch_deg", pitch)?, angle("roll_deg", roll)?];
        Ok(Pose::new(position, turn(angles)))
    }
}

fn set<T>(place: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *place = value;
    }
}

/// Yaw to the left, then pitch upwards, then roll to the left, degrees.
fn turn([yaw, pitch, roll]: [f64; 3]) -> Quat {
    let [yaw, pitch, roll] = [yaw, pitch, roll].map(|angle| angle.to_radians() as f32);
    Quat::from_euler(EulerRot::YXZ, yaw, pitch, roll)
}

/// The code with a name of the registry, such as `XR_ERROR_SESSION_LOST`.
fn result_named(name: &str) -> Option<sys::Result> {
    registry::RESULTS.iter().find(|(_, known)| *known == name).map(|(raw, _)| sys::Result::from_raw(*raw))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_by_name() {
        for code in [
            sys::Result::SUCCESS,
            sys::Result::TIMEOUT_EXPIRED,
            sys::Result::ERROR_SESSION_LOST,
            sys::Result::ERROR_DISPLAY_REFRESH_RATE_UNSUPPORTED_FB,
        ] {
            assert_eq!(result_named(&format!("XR_{code:?}")), Some(code));
        }
        assert_eq!(result_named("ERROR_SESSION_LOST"), None);
        assert_eq!(result_named("XR_ERROR_NO_SUCH_THING"), None);
    }
}
