//! Memory for buffers and images, cut from a few blocks and counted.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result};
use ash::vk;
use gpu_allocator::vulkan::{
    Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc,
};
use gpu_allocator::{AllocationSizes, AllocatorDebugSettings, MemoryLocation};

const MIB: u64 = 1 << 20;

/// A mutex round the allocator, and the sum of what is alive.
pub(super) struct Memory {
    allocator: Mutex<Option<Allocator>>,
    /// Types that take memory only as far as it is needed, a bit each.
    lazy_types: u32,
    used: AtomicU64,
}

/// What a resource asks for.
pub(super) struct Request<'a> {
    pub(super) name: &'a str,
    pub(super) requirements: vk::MemoryRequirements,
    pub(super) location: MemoryLocation,
    /// A buffer (images are tiled, and some devices keep the two apart).
    pub(super) linear: bool,
    /// Nothing of it outlives a pass.
    pub(super) transient: bool,
}

impl Memory {
    pub(super) fn new(
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        device: &ash::Device,
    ) -> Result<Self> {
        // The whole program needs tens of MiB: the tile pool, a few targets, small per-frame buffers. Blocks start
        // small and double; what is larger than a block gets its own.
        let sizes = AllocationSizes::new(8 * MIB, 4 * MIB)
            .with_max_device_memblock_size(64 * MIB)
            .with_max_host_memblock_size(16 * MIB);
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device: physical,
            debug_settings: AllocatorDebugSettings::default(),
            buffer_device_address: false,
            allocation_sizes: sizes,
        })
        .context("cannot set up GPU memory")?;
        // SAFETY: `physical` is of this instance.
        let types = unsafe { instance.get_physical_device_memory_properties(physical) };
        let lazy = vk::MemoryPropertyFlags::LAZILY_ALLOCATED;
        let lazy_types = (0u32..)
            .zip(types.memory_types_as_slice())
            .filter(|(_, kind)| kind.property_flags.contains(lazy))
            .fold(0, |types, (index, _)| types | 1 << index);
        Ok(Self { allocator: Mutex::new(Some(allocator)), lazy_types, used: AtomicU64::new(0) })
    }

    pub(super) fn allocate(&self, request: &Request<'_>) -> Result<Allocation> {
        let mut allocator = self.allocator.lock().unwrap_or_else(PoisonError::into_inner);
        let allocator = allocator.as_mut().context("GPU memory is closed")?;
        let mut requirements = request.requirements;
        let lazy = requirements.memory_type_bits & self.lazy_types;
        if request.transient && lazy != 0 {
            requirements.memory_type_bits = lazy;
        }
        let size = requirements.size;
        let allocation = allocator
            .allocate(&AllocationCreateDesc {
                name: request.name,
                requirements,
                location: request.location,
                linear: request.linear,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            })
            .with_context(|| format!("no GPU memory for {}: {size} bytes", request.name))?;
        self.used.fetch_add(allocation.size(), Ordering::Relaxed);
        Ok(allocation)
    }

    pub(super) fn free(&self, allocation: Allocation) {
        let mut allocator = self.allocator.lock().unwrap_or_else(PoisonError::into_inner);
        self.used.fetch_sub(allocation.size(), Ordering::Relaxed);
        if let Some(Err(error)) = allocator.as_mut().map(|allocator| allocator.free(allocation)) {
            tracing::error!("cannot free GPU memory: {error}");
        }
    }

    pub(super) fn used(&self) -> u64 {
        self.used.load(Ordering::Relaxed)
    }

    pub(super) fn reserved(&self) -> u64 {
        let allocator = self.allocator.lock().unwrap_or_else(PoisonError::into_inner);
        allocator.as_ref().map_or(0, Allocator::capacity)
    }

    /// Gives all blocks back to the driver.
    pub(super) fn close(&self) {
        drop(self.take());
    }

    /// Forgets all blocks: a hanging GPU may still be writing to them.
    pub(super) fn leak(&self) {
        std::mem::forget(self.take());
    }

    fn take(&self) -> Option<Allocator> {
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}
