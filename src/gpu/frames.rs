//! Frames in flight: recorded, submitted, waited for, and what was theirs destroyed when they have finished.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::any::Any;
use std::ffi::CStr;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result};
use ash::vk;

use super::commands::Commands;
use super::context::{Gpu, Lane};
use super::timing::{self, PassTime, Passes, Stamp, Stamps, Timer};

/// Longest wait for a frame, unless [`Frames::timeout`] is set.
const DEFAULT_TIMEOUT: Duration = Duration::from_secs(10);

/// Semaphores waited for, and signalled, by one submission.
const MAX_SEMAPHORES: usize = 4;

/// The device can be used no more. Drop everything made from it and open it anew.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Lost {
    /// It does not answer. What it holds is leaked, as it may still be in use.
    #[error("the GPU did not finish within {seconds} s; the last pass begun was \"{pass}\"")]
    DeviceHang {
        /// Last pass that the GPU began, or `none`.
        pass: &'static str,
        /// How long was waited.
        seconds: f64,
    },
    /// Vulkan says so, usually with ERROR_DEVICE_LOST.
    #[error("the GPU was lost ({result}); the last pass begun was \"{pass}\"")]
    Device {
        /// What Vulkan said.
        result: vk::Result,
        /// Last pass that the GPU is known to have begun, or `none`.
        pass: &'static str,
    },
}

/// A semaphore that a submission waits for or signals.
#[derive(Debug, Clone, Copy)]
pub struct SemaphoreAt {
    /// Timeline or binary.
    pub semaphore: vk::Semaphore,
    /// Of a timeline; ignored for a binary one.
    pub value: u64,
    /// The stages that wait, or after which it is signalled.
    pub stage: vk::PipelineStageFlags2,
}

impl SemaphoreAt {
    fn info(&self) -> vk::SemaphoreSubmitInfo<'static> {
        vk::SemaphoreSubmitInfo::default().semaphore(self.semaphore).value(self.value).stage_mask(self.stage)
    }
}

/// A frame being recorded. Dropping it without submitting is harmless.
pub struct Frame {
    /// Which of the frames in flight, from 0: choose per-frame buffers by it.
    pub index: usize,
    /// Counts submitted frames from 1: [`Frames::finished`] reaches it when the GPU has finished this one.
    pub serial: u64,
    raw: vk::CommandBuffer,
    timer: Timer,
    /// Which `begin` it came from.
    ticket: u64,
    gpu: Arc<Gpu>,
}

impl Frame {
    /// To record outside any named pass.
    pub fn commands(&self) -> Commands<'_> {
        Commands::new(&self.gpu, self.raw)
    }

    /// Records a named pass, timed on the GPU and labelled in captures. Passes do not nest.
    pub fn pass<R>(&mut self, name: &'static CStr, record: impl FnOnce(Commands<'_>) -> R) -> R {
        let index = self.timer.begin(&self.gpu, self.raw, name);
        let value = record(self.commands());
        self.timer.end(&self.gpu, self.raw, index);
        value
    }
}

/// What one frame in flight owns.
struct Slot {
    pool: vk::CommandPool,
    raw: vk::CommandBuffer,
    stamps: Stamps,
    /// Passes of the frame last submitted from here.
    passes: Passes,
    /// Serial of that frame; 0: none yet.
    serial: u64,
}

/// The frames in flight. In a steady state nothing here touches the heap.
pub struct Frames {
    /// Longest wait for a frame before it counts as a hang.
    pub timeout: Duration,
    slots: Vec<Slot>,
    /// Reaches a frame's serial when the GPU has finished it.
    timeline: vk::Semaphore,
    submitted: u64,
    ticket: u64,
    /// Things to drop, each with the last serial that may use it.
    graveyard: Vec<(u64, Box<dyn Any + Send>)>,
    stamps: Vec<Stamp>,
    times: Vec<PassTime>,
    timed_serial: u64,
    lane: Lane,
    gpu: Arc<Gpu>,
}

impl Frames {
    /// `in_flight` frames (2 is usual) may be recorded or on the GPU at a time.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(gpu: &Arc<Gpu>, in_flight: usize) -> Result<Self> {
        Self::in_lane(gpu, in_flight, Lane::Main)
    }

    pub(super) fn in_lane(gpu: &Arc<Gpu>, in_flight: usize, lane: Lane) -> Result<Self> {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: plain creation on a live device.
        let timeline =
            unsafe { gpu.device.create_semaphore(&info, None) }.context("cannot make a semaphore")?;
        gpu.name(timeline, "frames");
        let mut made = Self {
            timeout: DEFAULT_TIMEOUT,
            slots: Vec::with_capacity(in_flight),
            timeline,
            submitted: 0,
            ticket: 0,
            graveyard: Vec::with_capacity(64),
            stamps: timing::scratch(),
            times: timing::times(),
            timed_serial: 0,
            lane,
            gpu: Arc::clone(gpu),
        };
        for _ in 0..in_flight.max(1) {
            let slot = made.make_slot().context("cannot make a command buffer")?;
            made.slots.push(slot);
        }
        Ok(made)
    }

    fn make_slot(&self) -> Result<Slot> {
        let stamps = Stamps::new(&self.gpu)?;
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(self.gpu.queue_family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: plain creation on a live device.
        let pool = unsafe { self.gpu.device.create_command_pool(&info, None) }?;
        let mut slot =
            Slot { pool, raw: vk::CommandBuffer::null(), stamps, passes: Passes::new(), serial: 0 };
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool is ours alone.
        match unsafe { self.gpu.device.allocate_command_buffers(&info) } {
            Ok(buffers) => slot.raw = buffers[0],
            Err(error) => {
                // SAFETY: nothing uses the pool.
                unsafe { self.gpu.device.destroy_command_pool(pool, None) };
                return Err(error.into());
            }
        }
        self.gpu.name(slot.raw, "frame");
        Ok(slot)
    }

    /// How many may be in flight.
    pub fn in_flight(&self) -> usize {
        self.slots.len()
    }

    /// Which frame [`begin`](Frames::begin) would give without waiting; None while it would have to wait.
    ///
    /// # Errors
    /// [`Lost`]
    pub fn free(&self) -> Result<Option<usize>, Lost> {
        let index = (self.submitted % self.slots.len() as u64) as usize;
        Ok((self.slots[index].serial <= self.finished()?).then_some(index))
    }

    /// Waits until a frame is free, reads its timings, drops what was buried for it, and begins recording.
    ///
    /// # Errors
    /// [`Lost`]
    pub fn begin(&mut self) -> Result<Frame, Lost> {
        let index = (self.submitted % self.slots.len() as u64) as usize;
        self.wait(self.slots[index].serial)?;
        let finished = self.finished()?;
        self.graveyard.retain(|(last_use, _)| *last_use > finished);
        let slot = &mut self.slots[index];
        if slot.serial > self.timed_serial {
            slot.stamps.times(&slot.passes, &mut self.stamps, &mut self.times);
            self.timed_serial = slot.serial;
        }
        slot.stamps.reset();
        let serial = self.submitted + 1;
        let (pool, raw, timer) = (slot.pool, slot.raw, slot.stamps.timer(serial));
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the frame last recorded here has finished, so the pool is idle.
        let reset = unsafe { self.gpu.device.reset_command_pool(pool, vk::CommandPoolResetFlags::empty()) };
        // SAFETY: the buffer was just reset.
        let begun = reset.and_then(|()| unsafe { self.gpu.device.begin_command_buffer(raw, &info) });
        begun.map_err(|error| self.lost(error))?;
        self.ticket += 1;
        Ok(Frame { index, serial, raw, timer, ticket: self.ticket, gpu: Arc::clone(&self.gpu) })
    }

    /// Ends and submits a frame; returns its serial. Up to four semaphores each way.
    ///
    /// # Errors
    /// [`Lost`]
    ///
    /// # Panics
    /// When `frame` is not the one that [`begin`](Frames::begin) returned last.
    pub fn submit(
        &mut self,
        frame: Frame,
        waits: &[SemaphoreAt],
        signals: &[SemaphoreAt],
    ) -> Result<u64, Lost> {
        assert_eq!(frame.ticket, self.ticket, "a frame is submitted before the next one begins");
        self.ticket += 1;
        let serial = frame.serial;
        let slot = &mut self.slots[frame.index];
        slot.passes = frame.timer.passes;
        let mut wait_infos = [vk::SemaphoreSubmitInfo::default(); MAX_SEMAPHORES];
        let mut signal_infos = [vk::SemaphoreSubmitInfo::default(); MAX_SEMAPHORES + 1];
        for (info, wait) in wait_infos[..waits.len()].iter_mut().zip(waits) {
            *info = wait.info();
        }
        for (info, signal) in signal_infos[..signals.len()].iter_mut().zip(signals) {
            *info = signal.info();
        }
        signal_infos[signals.len()] = self.end_of(serial).info();
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(frame.raw)];
        let submits = [vk::SubmitInfo2::default()
            .wait_semaphore_infos(&wait_infos[..waits.len()])
            .command_buffer_infos(&buffers)
            .signal_semaphore_infos(&signal_infos[..=signals.len()])];
        let device = &self.gpu.device;
        // SAFETY: the buffer is being recorded, and is submitted once, with the queue locked.
        let result = unsafe { device.end_command_buffer(frame.raw) }.and_then(|()| {
            // SAFETY: as above.
            let submit = |queue| unsafe { device.queue_submit2(queue, &submits, vk::Fence::null()) };
            self.gpu.with_lane(self.lane, submit)
        });
        if let Err(result) = result {
            return Err(Lost::Device { result, pass: frame.timer.passes.last() });
        }
        self.slots[frame.index].serial = serial;
        self.submitted = serial;
        Ok(serial)
    }

    /// Serial of the last frame that the GPU has finished.
    ///
    /// # Errors
    /// [`Lost`]
    pub fn finished(&self) -> Result<u64, Lost> {
        // SAFETY: the semaphore is alive.
        let value = unsafe { self.gpu.device.get_semaphore_counter_value(self.timeline) };
        value.map_err(|error| self.lost(error))
    }

    /// Waits for one frame.
    ///
    /// # Errors
    /// [`Lost`]
    pub fn wait(&self, serial: u64) -> Result<(), Lost> {
        match self.gpu.wait_for(&self.end_of(serial), self.timeout) {
            Ok(true) => Ok(()),
            Ok(false) => {
                self.gpu.abandon();
                Err(Lost::DeviceHang { pass: self.last_pass(), seconds: self.timeout.as_secs_f64() })
            }
            Err(error) => Err(self.lost(error)),
        }
    }

    /// What other work waits for to see all that a frame wrote.
    pub(super) fn end_of(&self, serial: u64) -> SemaphoreAt {
        let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
        SemaphoreAt { semaphore: self.timeline, value: serial, stage }
    }

    /// Waits for all frames.
    ///
    /// # Errors
    /// [`Lost`]
    pub fn wait_idle(&self) -> Result<(), Lost> {
        self.wait(self.submitted)
    }

    /// Drops `thing` when the frames that may use it, the one being recorded included, have finished.
    pub fn bury(&mut self, thing: impl Send + 'static) {
        self.graveyard.push((self.submitted + 1, Box::new(thing)));
    }

    /// Drops all that was buried. All frames must have finished.
    pub(super) fn clear(&mut self) {
        self.graveyard.clear();
    }

    /// GPU time of each pass of the frame [`timed_serial`](Frames::timed_serial). Empty before the first frame
    /// comes round again, or where the device has no clock.
    pub fn times(&self) -> &[PassTime] {
        &self.times
    }

    /// Which frame [`times`](Frames::times) are of; 0: none yet.
    pub fn timed_serial(&self) -> u64 {
        self.timed_serial
    }

    fn lost(&self, result: vk::Result) -> Lost {
        Lost::Device { result, pass: self.last_pass() }
    }

    /// The last pass that the GPU has begun, of the oldest frame that has not finished.
    fn last_pass(&self) -> &'static str {
        // SAFETY: the semaphore is alive.
        let finished = unsafe { self.gpu.device.get_semaphore_counter_value(self.timeline) }.unwrap_or(0);
        let stuck = self.slots.iter().filter(|slot| slot.serial > finished).min_by_key(|slot| slot.serial);
        stuck.map_or("none", |slot| slot.stamps.last_begun(&slot.passes, slot.serial))
    }
}

impl Drop for Frames {
    fn drop(&mut self) {
        if let Err(lost) = self.wait_idle() {
            tracing::error!("{lost}");
        }
        self.clear();
        // SAFETY: all frames have finished; if they have not, the device is lost or abandoned (then nothing is done).
        self.gpu.destroy(|device| unsafe {
            self.slots.iter().for_each(|slot| device.destroy_command_pool(slot.pool, None));
            device.destroy_semaphore(self.timeline, None);
        });
    }
}
