//! Named passes: the GPU's time in each, and a mark when it begins one, so that a hang can be named.
//!
//! The marks are words in host memory, not the timestamps: some drivers block when asked for a query of a stuck frame.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::ffi::CStr;
use std::sync::Arc;

use anyhow::{Context, Result};
use ash::vk;

use super::buffer::{Buffer, BufferInfo, Location};
use super::clock::Calibration;
use super::context::{DeviceInfo, Gpu};

/// Passes timed per frame; later ones run untimed.
const MAX_PASSES: usize = 32;

/// Queries kept free for each timestamp. One is used; some drivers write one per view after a multiview pass,
/// so each timestamp is followed by an unused query.
const QUERIES_PER_STAMP: u32 = 2;

/// Bytes of a pass's mark.
const MARK_BYTES: u64 = 4;

/// Begin and end.
const QUERIES_PER_PASS: u32 = 2 * QUERIES_PER_STAMP;

/// GPU time of one pass of a finished frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassTime {
    /// As given to [`Frame::pass`](super::Frame::pass).
    pub name: &'static str,
    /// Milliseconds from the start of the frame's first pass.
    pub start_ms: f64,
    /// Milliseconds, from when all before had finished to when all of this had.
    pub ms: f64,
}

/// The passes recorded into a frame, in order.
#[derive(Clone, Copy)]
pub(super) struct Passes {
    names: [&'static CStr; MAX_PASSES],
    count: usize,
}

impl Passes {
    pub(super) const fn new() -> Self {
        Self { names: [c""; MAX_PASSES], count: 0 }
    }

    /// The name last begun when the frame was recorded.
    pub(super) fn last(&self) -> &'static str {
        self.count.checked_sub(1).map_or("none", |last| text(self.names[last]))
    }

    /// Notes a pass; `None` when there are too many.
    fn push(&mut self, name: &'static CStr) -> Option<u32> {
        let index = self.count;
        *self.names.get_mut(index)? = name;
        self.count += 1;
        Some(index as u32)
    }
}

fn text(name: &'static CStr) -> &'static str {
    name.to_str().unwrap_or("?")
}

/// Timestamps (null where the device has no clock) and marks of one frame in flight.
pub(super) struct Stamps {
    pool: vk::QueryPool,
    /// A word per pass: the serial of the last frame in which the GPU began it.
    marks: Buffer,
    gpu: Arc<Gpu>,
}

/// What a frame being recorded needs of its [`Stamps`].
#[derive(Clone, Copy)]
pub(super) struct Timer {
    pool: vk::QueryPool,
    marks: vk::Buffer,
    /// Written as the mark: the frame's serial.
    mark: u32,
    pub(super) passes: Passes,
}

/// Ticks and whether they were written.
pub(super) type Stamp = [u64; 2];

/// Room for all stamps of a frame.
pub(super) fn scratch() -> Vec<Stamp> {
    vec![[0; 2]; MAX_PASSES * QUERIES_PER_PASS as usize]
}

/// Room for all times of a frame.
pub(super) fn times() -> Vec<PassTime> {
    Vec::with_capacity(MAX_PASSES)
}

impl Stamps {
    pub(super) fn new(gpu: &Arc<Gpu>) -> Result<Self> {
        let marks = BufferInfo {
            name: "pass marks",
            size: MAX_PASSES as u64 * MARK_BYTES,
            usage: vk::BufferUsageFlags::TRANSFER_DST,
            location: Location::Readback,
        };
        let mut made =
            Self { pool: vk::QueryPool::null(), marks: Buffer::new(gpu, &marks)?, gpu: Arc::clone(gpu) };
        if gpu.info.timestamp_bits > 0 {
            let info = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::TIMESTAMP)
                .query_count(MAX_PASSES as u32 * QUERIES_PER_PASS);
            // SAFETY: plain creation on a live device.
            made.pool =
                unsafe { gpu.device.create_query_pool(&info, None) }.context("cannot make GPU timers")?;
            gpu.name(made.pool, "pass times");
            made.reset();
        }
        Ok(made)
    }

    /// Makes the stamps new. The frame that wrote them has finished.
    pub(super) fn reset(&self) {
        if self.pool != vk::QueryPool::null() {
            // SAFETY: host query reset is on, and no frame in flight uses the pool.
            unsafe { self.gpu.device.reset_query_pool(self.pool, 0, MAX_PASSES as u32 * QUERIES_PER_PASS) };
        }
    }

    /// Reads what has been written so far into `stamps`.
    fn read(&self, passes: &Passes, stamps: &mut [Stamp]) -> usize {
        let used = passes.count * QUERIES_PER_PASS as usize;
        stamps[..used].fill([0; 2]);
        if used == 0 || self.pool == vk::QueryPool::null() {
            return 0;
        }
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WITH_AVAILABILITY;
        // SAFETY: the pool holds more queries than are read; those never written are reported as such.
        match unsafe { self.gpu.device.get_query_pool_results(self.pool, 0, &mut stamps[..used], flags) } {
            Ok(()) | Err(vk::Result::NOT_READY) => used,
            Err(_) => 0,
        }
    }

    /// The times of a finished frame. Gives the device's ticks at the beginning of its first pass.
    pub(super) fn times(
        &self,
        passes: &Passes,
        stamps: &mut [Stamp],
        times: &mut Vec<PassTime>,
    ) -> Option<u64> {
        times.clear();
        let used = self.read(passes, stamps);
        let ms = |from: u64, to: u64| nanoseconds_between(&self.gpu.info, from, to) as f64 * 1e-6;
        let [first, begun_first] = stamps[0];
        for (index, pair) in stamps[..used].chunks_exact(QUERIES_PER_PASS as usize).enumerate() {
            let ([begin, begun], [end, ended]) = (pair[0], pair[QUERIES_PER_STAMP as usize]);
            if begun != 0 && ended != 0 {
                times.push(PassTime {
                    name: text(passes.names[index]),
                    start_ms: ms(first, begin),
                    ms: ms(begin, end),
                });
            }
        }
        (used > 0 && begun_first != 0).then_some(first)
    }

    /// When, by the processor's clock, the device's showed so many `ticks`, both having been read as `calibration` says.
    pub(super) fn host_ns(&self, ticks: u64, calibration: Calibration) -> u64 {
        let info = &self.gpu.info;
        let ago = nanoseconds_between(info, ticks, calibration.ticks);
        let since = nanoseconds_between(info, calibration.ticks, ticks);
        // The clock goes round: whichever way is shorter.
        if since < ago { calibration.ns + since } else { calibration.ns.saturating_sub(ago) }
    }

    /// The last pass that the GPU has begun, of a frame that does not finish.
    pub(super) fn last_begun(&self, passes: &Passes, serial: u64) -> &'static str {
        let marks: &[u32] = self.marks.slice();
        let begun = marks[..passes.count].iter().rposition(|mark| *mark == mark_of(serial));
        begun.map_or("none", |index| text(passes.names[index]))
    }

    /// To record the frame `serial`.
    pub(super) fn timer(&self, serial: u64) -> Timer {
        Timer { pool: self.pool, marks: self.marks.raw, mark: mark_of(serial), passes: Passes::new() }
    }
}

/// Nanoseconds from one reading of the device's clock, of which some bits mean something, to a later one.
fn nanoseconds_between(info: &DeviceInfo, from: u64, to: u64) -> u64 {
    let ticks = to.wrapping_sub(from) & (u64::MAX >> (64 - info.timestamp_bits.clamp(1, 64)));
    (ticks as f64 * info.timestamp_period_ns) as u64
}

/// The low half of a serial; two frames of one mark are four thousand million frames apart.
fn mark_of(serial: u64) -> u32 {
    serial as u32
}

impl Drop for Stamps {
    fn drop(&mut self) {
        // SAFETY: `Frames` waits for its frames before it lets go; null is ignored.
        self.gpu.destroy(|device| unsafe { device.destroy_query_pool(self.pool, None) });
    }
}

impl Timer {
    /// Begins a pass: a label for captures, a mark and a timestamp. Give the result to [`Timer::end`].
    pub(super) fn begin(&mut self, gpu: &Gpu, raw: vk::CommandBuffer, name: &'static CStr) -> Option<u32> {
        if let Some(debug) = &gpu.debug {
            let label = vk::DebugUtilsLabelEXT::default().label_name(name);
            // SAFETY: recording.
            unsafe { debug.cmd_begin_debug_utils_label(raw, &label) };
        }
        let index = self.passes.push(name)?;
        // SAFETY: recording, outside a pass; each word is written once per frame.
        unsafe {
            gpu.device.cmd_fill_buffer(raw, self.marks, u64::from(index) * MARK_BYTES, MARK_BYTES, self.mark);
        };
        self.stamp(gpu, raw, index * QUERIES_PER_PASS);
        Some(index)
    }

    /// Ends a pass.
    pub(super) fn end(&self, gpu: &Gpu, raw: vk::CommandBuffer, index: Option<u32>) {
        if let Some(index) = index {
            self.stamp(gpu, raw, index * QUERIES_PER_PASS + QUERIES_PER_STAMP);
        }
        if let Some(debug) = &gpu.debug {
            // SAFETY: recording, and begun in the same buffer.
            unsafe { debug.cmd_end_debug_utils_label(raw) };
        }
    }

    fn stamp(&self, gpu: &Gpu, raw: vk::CommandBuffer, query: u32) {
        if self.pool != vk::QueryPool::null() {
            let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
            // SAFETY: recording, outside a pass; each query is written once after its reset.
            unsafe { gpu.device.cmd_write_timestamp2(raw, stage, self.pool, query) };
        }
    }
}
