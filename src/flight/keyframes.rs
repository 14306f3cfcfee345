//! Flights between keyframes.

use super::{FlightPose, Footing, Gaze};

/// The pose at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keyframe {
    /// Seconds since the flight began, 0 or more.
    pub time_s: f64,
    /// The pose.
    pub pose: FlightPose,
}

/// The pose at a time in seconds: before the first keyframe the first one's, after the last the last one's, between
/// two of them a monotone cubic, which has no corner and never overshoots.
pub(super) fn pose_at(keys: &[Keyframe], time_s: f64) -> FlightPose {
    let after = keys.partition_point(|key| key.time_s <= time_s);
    if after == 0 || after == keys.len() {
        return keys[after.saturating_sub(1)].pose;
    }
    let from = after - 1;
    let span = Span {
        before: from.checked_sub(1).map(|i| &keys[i]),
        from: &keys[from],
        to: &keys[after],
        after: keys.get(after + 1),
    };
    span.pose((time_s - keys[from].time_s) / (keys[after].time_s - keys[from].time_s))
}

/// Two neighbouring keyframes and the ones outside them, which decide the slopes at both ends.
struct Span<'a> {
    before: Option<&'a Keyframe>,
    from: &'a Keyframe,
    to: &'a Keyframe,
    after: Option<&'a Keyframe>,
}

impl Span<'_> {
    /// The pose at `u` from 0 (`from`, exactly) to 1 (`to`).
    fn pose(&self, u: f64) -> FlightPose {
        let start = &self.from.pose;
        let gain = |channel: fn(&FlightPose) -> f64| self.gain(channel, u);
        FlightPose {
            depth: start.depth + gain(|pose| pose.depth),
            yaw: start.yaw + gain(|pose| pose.yaw),
            pitch: start.pitch + gain(|pose| pose.pitch),
            roll: start.roll + gain(|pose| pose.roll),
            // By ratios, as the depth is: halving the height looks like one octave of falling.
            height: start.height * gain(|pose| pose.height.log2()).exp2(),
            offset: [
                start.offset[0] + gain(|pose| pose.offset[0]),
                start.offset[1] + gain(|pose| pose.offset[1]),
            ],
            footing: Footing::Target,
            gaze: Gaze::Pose,
        }
    }

    /// What one channel has gained at `u` over its value in `from`: a cubic Hermite with the slopes of
    /// Fritsch and Butland (1984), so exactly 0 at u = 0 and a straight line where the keyframes lie on one.
    fn gain(&self, channel: fn(&FlightPose) -> f64, u: f64) -> f64 {
        let time = self.to.time_s - self.from.time_s;
        let chord = chord(self.from, self.to, channel);
        let start = self.before.map_or(chord, |before| {
            tangent(chord_of(before, self.from, channel), Chord { slope: chord, time })
        });
        let end = self
            .after
            .map_or(chord, |after| tangent(Chord { slope: chord, time }, chord_of(self.to, after, channel)));
        let (u2, u3) = (u * u, u * u * u);
        time * ((3.0 * u2 - 2.0 * u3) * chord + (u3 - 2.0 * u2 + u) * start + (u3 - u2) * end)
    }
}

/// The straight line between two keyframes: its slope per second, and how long it is.
#[derive(Clone, Copy)]
struct Chord {
    slope: f64,
    time: f64,
}

fn chord(from: &Keyframe, to: &Keyframe, channel: fn(&FlightPose) -> f64) -> f64 {
    chord_of(from, to, channel).slope
}

fn chord_of(from: &Keyframe, to: &Keyframe, channel: fn(&FlightPose) -> f64) -> Chord {
    let time = to.time_s - from.time_s;
    Chord { slope: (channel(&to.pose) - channel(&from.pose)) / time, time }
}

/// The slope at a keyframe between two chords: 0 at a turning point, else their weighted harmonic mean, which is
/// at most three times the gentler one: the condition for not overshooting.
fn tangent(left: Chord, right: Chord) -> f64 {
    if left.slope * right.slope <= 0.0 {
        return 0.0;
    }
    let (left_weight, right_weight) = (left.time + 2.0 * right.time, 2.0 * left.time + right.time);
    (left_weight + right_weight) / (left_weight / left.slope + right_weight / right.slope)
}
