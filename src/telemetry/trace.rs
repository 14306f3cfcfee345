//! Frames as a Chrome trace, which <https://ui.perfetto.dev> and `chrome://tracing` show: spans of the frame thread, the
//! GPU's passes on a track of their own, and counters.
//!
//! Every event stands on a line of its own. The file is readable after every frame: the brackets at its end may be
//! missing.

use std::fmt::{Display, Formatter, Write as _};

use super::{FrameStats, GpuClock, GpuPass, Lap};

/// Tracks.
const CPU: u32 = 1;
const GPU: u32 = 2;

/// Turns frames into the text of a trace.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Where the trace's time begins.
    origin_ns: Option<u64>,
    /// Until when the GPU is known to have been at work: its track must not overlap.
    gpu_until_ns: u64,
    /// The frame whose passes were last written.
    timed: u64,
    /// How those were placed.
    clock: Option<GpuClock>,
}

/// Microseconds, exact to the nanosecond, so that what touches in one unit touches in the other.
struct Micros(u64);

impl Display for Micros {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{:03}", self.0 / 1000, self.0 % 1000)
    }
}

impl Trace {
    /// How the file begins.
    pub fn begin(&self, out: &mut String) {
        out.push_str("{\"displayTimeUnit\":\"ms\",\"traceEvents\":[\n");
        let name = |what: &str, track: u32, name: &str| {
            format!(
                "{{\"ph\":\"M\",\"pid\":1,\"tid\":{track},\"name\":\"{what}\",\"args\":{{\"name\":\"{name}\"}}}}"
            )
        };
        out.push_str(&name("process_name", CPU, "Fathomless"));
        out.push_str(",\n");
        out.push_str(&name("thread_name", CPU, "frame thread"));
    }

    /// A frame `depth` octaves below the start, and the passes of the one before it whose times have come in.
    pub fn frame(&mut self, out: &mut String, stats: &FrameStats, depth: f64) {
        let laps = stats.laps.as_slice();
        let (Some(first), Some(last)) = (laps.first(), laps.last()) else { return };
        let origin = *self.origin_ns.get_or_insert(first.begin_ns);
        let serial = stats.serial;
        let begin = at(origin, first.begin_ns);
        let whole = Lap { span: first.span, begin_ns: first.begin_ns, end_ns: last.end_ns };
        let args = format!("{{\"frame\":{serial},\"depth\":{depth:.4}}}");
        span(out, CPU, "frame", origin, (whole.begin_ns, whole.end_ns), &args);
        for lap in laps {
            span(out, CPU, lap.span.name(), origin, (lap.begin_ns, lap.end_ns), "{}");
        }
        let work = &stats.work;
        // Writing to a string cannot fail.
        let _ = write!(
            out,
            ",\n{{\"ph\":\"C\",\"pid\":1,\"name\":\"tiles\",\"ts\":{begin},\"args\":\
             {{\"drawn\":{},\"made\":{},\"waiting\":{}}}}}",
            work.tiles_drawn, work.tiles_made, work.tiles_waiting
        );
        let _ = write!(
            out,
            ",\n{{\"ph\":\"C\",\"pid\":1,\"name\":\"headroom\",\"ts\":{begin},\"args\":{{\"share\":{:.4}}}}}",
            stats.headroom
        );
        let _ = write!(
            out,
            ",\n{{\"ph\":\"C\",\"pid\":1,\"name\":\"texels baked\",\"ts\":{begin},\"args\":{{\"texels\":{}}}}}",
            work.texels_baked
        );
        self.passes(out, stats, origin);
    }

    fn passes(&mut self, out: &mut String, stats: &FrameStats, origin: u64) {
        let passes = stats.gpu.as_slice();
        let (Some(first), Some(last)) = (passes.first(), passes.last()) else { return };
        if stats.timed_serial == self.timed {
            return;
        }
        self.timed = stats.timed_serial;
        if self.clock != Some(stats.gpu.clock) {
            self.clock = Some(stats.gpu.clock);
            let how = match stats.gpu.clock {
                GpuClock::Calibrated => "GPU (its clock compared to the processor's)",
                GpuClock::Submission => "GPU (frames placed by when they were handed over)",
            };
            let _ = write!(
                out,
                ",\n{{\"ph\":\"M\",\"pid\":1,\"tid\":{GPU},\"name\":\"thread_name\",\"args\":{{\"name\":\"{how}\"}}}}"
            );
        }
        // Clocks that drift, and what is only known from submission, must not make passes of two frames overlap.
        let late = self.gpu_until_ns.max(origin).saturating_sub(first.begin_ns);
        let shifted = |pass: &GpuPass| (pass.begin_ns + late, pass.end_ns + late);
        let whole = (shifted(first).0, shifted(last).1);
        self.gpu_until_ns = whole.1;
        let args = format!("{{\"frame\":{}}}", stats.timed_serial);
        span(out, GPU, "frame", origin, whole, &args);
        for pass in passes {
            span(out, GPU, pass.name, origin, shifted(pass), "{}");
        }
    }

    /// How the file ends, `missing` frames having been left out.
    pub fn end(&self, out: &mut String, missing: u64) {
        let clock = match self.clock {
            None => "none",
            Some(GpuClock::Calibrated) => "calibrated timestamps",
            Some(GpuClock::Submission) => "submission",
        };
        let _ = write!(
            out,
            "\n],\"otherData\":{{\"program\":\"fathomless {}\",\"gpu_clock\":\"{clock}\",\"frames_missing\":{missing}}}}}\n",
            env!("CARGO_PKG_VERSION")
        );
    }
}

fn at(origin: u64, ns: u64) -> Micros {
    Micros(ns.saturating_sub(origin))
}

/// A span of a track; `args` is JSON.
fn span(out: &mut String, track: u32, name: &str, origin: u64, (from, to): (u64, u64), args: &str) {
    let (ts, dur) = (at(origin, from), Micros(to.saturating_sub(from)));
    let _ = write!(
        out,
        ",\n{{\"ph\":\"X\",\"pid\":1,\"tid\":{track},\"name\":\"{name}\",\"ts\":{ts},\"dur\":{dur},\"args\":{args}}}"
    );
}
