//! Buffers: named, sized, freed on drop.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::sync::Arc;

use anyhow::{Context, Result};
use ash::vk;
use bytemuck::Pod;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::context::Gpu;
use super::memory::Request;

/// Who touches a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Location {
    /// The GPU alone.
    Device,
    /// Written by the host, read by the GPU.
    Upload,
    /// Written by the GPU, read by the host.
    Readback,
}

/// What a buffer is to be.
#[derive(Debug, Clone, Copy)]
pub struct BufferInfo<'a> {
    /// Shown in validation messages.
    pub name: &'a str,
    /// Bytes, at least 1.
    pub size: u64,
    /// What it is used for.
    pub usage: vk::BufferUsageFlags,
    /// Who touches it.
    pub location: Location,
}

/// A buffer with its memory. `Upload` and `Readback` buffers stay mapped, start as zeros, and need no flushing.
pub struct Buffer {
    /// The handle.
    pub raw: vk::Buffer,
    /// Bytes.
    pub size: u64,
    memory: Option<Allocation>,
    gpu: Arc<Gpu>,
}

impl Buffer {
    /// A new buffer; its contents are undefined on the device and zeros where mapped.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(gpu: &Arc<Gpu>, info: &BufferInfo<'_>) -> Result<Self> {
        let create = vk::BufferCreateInfo::default().size(info.size.max(1)).usage(info.usage);
        // SAFETY: plain creation on a live device.
        let raw = unsafe { gpu.device.create_buffer(&create, None) }
            .with_context(|| format!("cannot make buffer {}", info.name))?;
        gpu.name(raw, info.name);
        let mut made = Self { raw, size: create.size, memory: None, gpu: Arc::clone(gpu) };
        let memory = made.gpu.memory.allocate(&Request {
            name: info.name,
            // SAFETY: the buffer is alive.
            requirements: unsafe { gpu.device.get_buffer_memory_requirements(raw) },
            location: match info.location {
                Location::Device => MemoryLocation::GpuOnly,
                Location::Upload => MemoryLocation::CpuToGpu,
                Location::Readback => MemoryLocation::GpuToCpu,
            },
            linear: true,
            transient: false,
        })?;
        let memory = made.memory.insert(memory);
        // SAFETY: the memory was allocated for this buffer and is bound once.
        unsafe { gpu.device.bind_buffer_memory(raw, memory.memory(), memory.offset()) }
            .with_context(|| format!("cannot bind buffer {}", info.name))?;
        if info.location != Location::Device {
            made.slice_mut::<u8>().fill(0);
        }
        Ok(made)
    }

    /// A device buffer holding `data`; `TRANSFER_DST` is added to its usage. Stalls: for start-up and tests.
    ///
    /// # Errors
    /// Out of memory, or the device is lost.
    pub fn with_data<T: Pod>(
        gpu: &Arc<Gpu>,
        name: &str,
        usage: vk::BufferUsageFlags,
        data: &[T],
    ) -> Result<Self> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let size = bytes.len() as u64;
        let mut staging = Self::new(
            gpu,
            &BufferInfo {
                name: "staging",
                size,
                usage: vk::BufferUsageFlags::TRANSFER_SRC,
                location: Location::Upload,
            },
        )?;
        staging.slice_mut()[..bytes.len()].copy_from_slice(bytes);
        let usage = usage | vk::BufferUsageFlags::TRANSFER_DST;
        let made = Self::new(gpu, &BufferInfo { name, size, usage, location: Location::Device })?;
        gpu.run(|cmd| cmd.copy_buffer(&staging, &made, &[vk::BufferCopy::default().size(staging.size)]))?;
        Ok(made)
    }

    /// A copy of the first `count` elements of a buffer made with `TRANSFER_SRC`. Stalls: for tests and captures.
    ///
    /// # Errors
    /// Out of memory, or the device is lost.
    pub fn read<T: Pod>(&self, count: usize) -> Result<Vec<T>> {
        let size = (count * size_of::<T>()) as u64;
        assert!(size <= self.size, "read of {size} bytes from a buffer of {}", self.size);
        let staging = Self::new(
            &self.gpu,
            &BufferInfo {
                name: "readback",
                size,
                usage: vk::BufferUsageFlags::TRANSFER_DST,
                location: Location::Readback,
            },
        )?;
        self.gpu.run(|cmd| cmd.copy_buffer(self, &staging, &[vk::BufferCopy::default().size(size)]))?;
        Ok(staging.slice()[..count].to_vec())
    }

    /// The mapped contents. The caller sees to it that the GPU is not writing them.
    ///
    /// # Panics
    /// When the buffer is not mapped, i.e. of [`Location::Device`].
    pub fn slice<T: Pod>(&self) -> &[T] {
        let whole = self.whole::<T>();
        let mapped = self.memory.as_ref().and_then(Allocation::mapped_slice);
        let Some(bytes) = mapped else { panic!("only Upload and Readback buffers can be read by the host") };
        bytemuck::cast_slice(&bytes[..whole])
    }

    /// The mapped contents, to be written. The caller sees to it that the GPU is not reading the part written.
    ///
    /// # Panics
    /// When the buffer is not mapped, i.e. of [`Location::Device`].
    pub fn slice_mut<T: Pod>(&mut self) -> &mut [T] {
        let whole = self.whole::<T>();
        let mapped = self.memory.as_mut().and_then(Allocation::mapped_slice_mut);
        let Some(bytes) = mapped else {
            panic!("only Upload and Readback buffers can be written by the host")
        };
        bytemuck::cast_slice_mut(&mut bytes[..whole])
    }

    /// Bytes of the whole elements of `T` that fit.
    fn whole<T>(&self) -> usize {
        self.size as usize / size_of::<T>() * size_of::<T>()
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let memory = self.memory.take();
        self.gpu.destroy(|device| {
            // SAFETY: the owner lets go only when the GPU has finished with it (see `Frames::bury`).
            unsafe { device.destroy_buffer(self.raw, None) };
            if let Some(memory) = memory {
                self.gpu.memory.free(memory);
            }
        });
    }
}
