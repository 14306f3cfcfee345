//! What can be recorded. One short method per Vulkan command; nothing here allocates.
#![allow(unsafe_code, reason = "calls Vulkan; handles are trusted, see the module's head")]

use std::sync::atomic::Ordering;

use ash::vk;
use bytemuck::NoUninit;

use super::buffer::Buffer;
use super::context::Gpu;
use super::image::Image;
use super::pipeline::Pipeline;
use super::program::{BindGroup, SHADER_STAGES};
use super::sync::{Access, Transition};

/// Transitions, colour attachments and bind groups taken in one call.
const MAX_AT_ONCE: usize = 8;

/// A command buffer being recorded.
#[derive(Clone, Copy)]
pub struct Commands<'a> {
    gpu: &'a Gpu,
    /// The handle, for a command that has no method here.
    pub raw: vk::CommandBuffer,
}

/// What an attachment holds when a pass begins.
#[derive(Debug, Clone, Copy)]
pub enum Load {
    /// This colour, linear.
    Colour([f32; 4]),
    /// This depth; 0 is infinitely far when depth is reversed.
    Depth(f32),
    /// What it held before.
    Keep,
    /// Anything: every texel is going to be written.
    Discard,
}

/// Something drawn to: a view with as many layers as the pass has views.
#[derive(Debug, Clone, Copy)]
pub struct Attachment {
    /// The view; multisampled if there is a `resolve`.
    pub view: vk::ImageView,
    /// Its layout during the pass.
    pub layout: vk::ImageLayout,
    /// How it begins.
    pub load: Load,
    /// Whether its own texels outlive the pass (not needed for those that are resolved).
    pub store: bool,
    /// Where its samples are resolved to, in the same layout: averaged for colour, and for depth as the device's
    /// [`depth_resolve`](super::DeviceInfo::depth_resolve) says.
    pub resolve: Option<vk::ImageView>,
}

impl Attachment {
    /// A kept attachment, not multisampled.
    pub fn new(view: vk::ImageView, layout: vk::ImageLayout, load: Load) -> Self {
        Self { view, layout, load, store: true, resolve: None }
    }

    fn info(&self, resolve_mode: vk::ResolveModeFlags) -> vk::RenderingAttachmentInfo<'static> {
        let (load, clear) = match self.load {
            Load::Colour(float32) => {
                (vk::AttachmentLoadOp::CLEAR, vk::ClearValue { color: vk::ClearColorValue { float32 } })
            }
            Load::Depth(depth) => {
                let depth_stencil = vk::ClearDepthStencilValue { depth, stencil: 0 };
                (vk::AttachmentLoadOp::CLEAR, vk::ClearValue { depth_stencil })
            }
            Load::Keep => (vk::AttachmentLoadOp::LOAD, vk::ClearValue::default()),
            Load::Discard => (vk::AttachmentLoadOp::DONT_CARE, vk::ClearValue::default()),
        };
        let store = if self.store { vk::AttachmentStoreOp::STORE } else { vk::AttachmentStoreOp::DONT_CARE };
        let info = vk::RenderingAttachmentInfo::default()
            .image_view(self.view)
            .image_layout(self.layout)
            .load_op(load)
            .store_op(store)
            .clear_value(clear);
        match self.resolve {
            Some(view) => {
                info.resolve_mode(resolve_mode).resolve_image_view(view).resolve_image_layout(self.layout)
            }
            None => info,
        }
    }
}

/// What a pass draws to.
#[derive(Debug, Clone, Copy)]
pub struct Target<'a> {
    /// Texels, from the corner.
    pub extent: vk::Extent2D,
    /// 0 for a plain pass; a bit per layer for multiview (3: both eyes).
    pub view_mask: u32,
    /// Up to eight.
    pub colour: &'a [Attachment],
    /// The depth attachment, if any.
    pub depth: Option<Attachment>,
}

impl<'a> Commands<'a> {
    pub(super) fn new(gpu: &'a Gpu, raw: vk::CommandBuffer) -> Self {
        Self { gpu, raw }
    }

    /// Later commands doing `to` see what earlier commands did as `from`.
    pub fn barrier(&self, from: Access, to: Access) {
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(from.stage)
            .src_access_mask(from.access)
            .dst_stage_mask(to.stage)
            .dst_access_mask(to.access)];
        let dependency = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: recording, outside a pass.
        unsafe { self.gpu.device.cmd_pipeline_barrier2(self.raw, &dependency) };
    }

    /// Up to eight images change use and layout.
    pub fn transition(&self, transitions: &[Transition]) {
        let mut barriers = [vk::ImageMemoryBarrier2::default(); MAX_AT_ONCE];
        for (barrier, transition) in barriers[..transitions.len()].iter_mut().zip(transitions) {
            *barrier = transition.barrier();
        }
        let dependency = vk::DependencyInfo::default().image_memory_barriers(&barriers[..transitions.len()]);
        // SAFETY: recording, outside a pass.
        unsafe { self.gpu.device.cmd_pipeline_barrier2(self.raw, &dependency) };
    }

    /// Everything before, the host included, is done and seen before anything after, the host included.
    pub(super) fn wait_for_everything(&self) {
        self.barrier(Access::ALL | Access::HOST_WRITE, Access::ALL | Access::HOST_READ);
    }

    /// Copies between buffers.
    pub fn copy_buffer(&self, from: &Buffer, to: &Buffer, regions: &[vk::BufferCopy]) {
        // SAFETY: recording, outside a pass.
        unsafe { self.gpu.device.cmd_copy_buffer(self.raw, from.raw, to.raw, regions) };
    }

    /// Copies texels, e.g. of an image in TRANSFER_SRC_OPTIMAL, to a buffer.
    pub fn copy_image_to_buffer(
        &self,
        from: (vk::Image, vk::ImageLayout),
        to: &Buffer,
        regions: &[vk::BufferImageCopy],
    ) {
        // SAFETY: recording, outside a pass.
        unsafe { self.gpu.device.cmd_copy_image_to_buffer(self.raw, from.0, from.1, to.raw, regions) };
    }

    /// Copies texels of a buffer to an image, e.g. in TRANSFER_DST_OPTIMAL.
    pub fn copy_buffer_to_image(
        &self,
        from: &Buffer,
        to: (vk::Image, vk::ImageLayout),
        regions: &[vk::BufferImageCopy],
    ) {
        // SAFETY: recording, outside a pass.
        unsafe { self.gpu.device.cmd_copy_buffer_to_image(self.raw, from.raw, to.0, to.1, regions) };
    }

    /// Copies texels between images of the same size of texel, bit for bit.
    pub fn copy_image(
        &self,
        from: (vk::Image, vk::ImageLayout),
        to: (vk::Image, vk::ImageLayout),
        regions: &[vk::ImageCopy],
    ) {
        // SAFETY: recording, outside a pass.
        unsafe { self.gpu.device.cmd_copy_image(self.raw, from.0, from.1, to.0, to.1, regions) };
    }

    /// Copies rectangles between images, stretched and filtered linearly.
    pub fn blit(
        &self,
        from: (vk::Image, vk::ImageLayout),
        to: (vk::Image, vk::ImageLayout),
        regions: &[vk::ImageBlit],
    ) {
        let filter = vk::Filter::LINEAR;
        // SAFETY: recording, outside a pass.
        unsafe { self.gpu.device.cmd_blit_image(self.raw, from.0, from.1, to.0, to.1, regions, filter) };
    }

    /// Makes the mipmap of an image in GENERAL from its first level, each texel the mean of four; what draws to the first
    /// level or samples it may come right before and after.
    pub fn make_mips(&self, image: &Image, mips: u32) {
        use vk::ImageLayout as Layout;
        let size = |level: u32| {
            let side = |texels: u32| (texels >> level).max(1) as i32;
            [
                vk::Offset3D::default(),
                vk::Offset3D { x: side(image.extent.width), y: side(image.extent.height), z: 1 },
            ]
        };
        let layer_count = image.layer_views.len() as u32;
        let part = |mip_level| vk::ImageSubresourceLayers {
            aspect_mask: image.aspect,
            mip_level,
            base_array_layer: 0,
            layer_count,
        };
        let to = |level: u32, count: u32, (from, old): (Access, Layout), (to, new): (Access, Layout)| {
            let barrier =
                Transition { image: image.raw, aspect: image.aspect, from: (from, old), to: (to, new) }
                    .barrier()
                    .subresource_range(vk::ImageSubresourceRange {
                        aspect_mask: image.aspect,
                        base_mip_level: level,
                        level_count: count,
                        base_array_layer: 0,
                        layer_count,
                    });
            let dependency =
                vk::DependencyInfo::default().image_memory_barriers(std::slice::from_ref(&barrier));
            // SAFETY: recording, outside a pass.
            unsafe { self.gpu.device.cmd_pipeline_barrier2(self.raw, &dependency) };
        };
        let used = (Access::COLOUR_WRITE | Access::FRAGMENT_READ, Layout::GENERAL);
        let (read, written) = (
            (Access::COPY_READ, Layout::TRANSFER_SRC_OPTIMAL),
            (Access::COPY_WRITE, Layout::TRANSFER_DST_OPTIMAL),
        );
        to(0, 1, used, read);
        for level in 1..mips {
            // What is there is written over.
            to(level, 1, (used.0, Layout::UNDEFINED), written);
            let blit = vk::ImageBlit::default()
                .src_subresource(part(level - 1))
                .src_offsets(size(level - 1))
                .dst_subresource(part(level))
                .dst_offsets(size(level));
            // SAFETY: recording, outside a pass.
            unsafe {
                self.gpu.device.cmd_blit_image(
                    self.raw,
                    image.raw,
                    read.1,
                    image.raw,
                    written.1,
                    &[blit],
                    vk::Filter::LINEAR,
                );
            }
            to(level, 1, written, read);
        }
        to(0, mips, read, used);
    }

    /// Fills a buffer from `offset` to its end, both multiples of 4.
    pub fn fill(&self, buffer: &Buffer, offset: u64, value: u32) {
        // SAFETY: recording, outside a pass.
        unsafe { self.gpu.device.cmd_fill_buffer(self.raw, buffer.raw, offset, vk::WHOLE_SIZE, value) };
    }

    /// Binds a pipeline, and up to eight bind groups from group 0 on.
    pub fn bind<P: Pipeline>(&self, pipeline: &P, groups: &[&BindGroup]) {
        let mut sets = [vk::DescriptorSet::null(); MAX_AT_ONCE];
        for (index, (set, group)) in sets.iter_mut().zip(groups).enumerate() {
            debug_assert_eq!(group.group, index, "bind groups are given in order");
            *set = group.raw;
        }
        let (device, layout) = (&self.gpu.device, pipeline.program().layout);
        // SAFETY: recording; the pipeline and the groups are alive.
        unsafe {
            device.cmd_bind_pipeline(self.raw, P::POINT, pipeline.raw());
            if !groups.is_empty() {
                device.cmd_bind_descriptor_sets(self.raw, P::POINT, layout, 0, &sets[..groups.len()], &[]);
            }
        }
    }

    /// Sets the program's `var<immediate>`.
    ///
    /// # Panics
    /// When it has another size in the shader.
    pub fn push<P: Pipeline, T: NoUninit>(&self, pipeline: &P, value: &T) {
        let program = pipeline.program();
        let bytes = bytemuck::bytes_of(value);
        assert_eq!(bytes.len(), program.shader.push_bytes() as usize, "immediates of {}", program.name);
        // SAFETY: recording; the range is the whole of the layout's.
        unsafe { self.gpu.device.cmd_push_constants(self.raw, program.layout, SHADER_STAGES, 0, bytes) };
    }

    /// Runs the bound compute pipeline over this many workgroups.
    pub fn dispatch(&self, groups: [u32; 3]) {
        // SAFETY: recording, outside a pass, with a compute pipeline bound.
        unsafe { self.gpu.device.cmd_dispatch(self.raw, groups[0], groups[1], groups[2]) };
    }

    /// Records a pass: draws go between its begin and end. Viewport and scissor are the whole target.
    pub fn render<R>(&self, target: &Target<'_>, draw: impl FnOnce(Commands<'a>) -> R) -> R {
        let mut colour = [vk::RenderingAttachmentInfo::default(); MAX_AT_ONCE];
        for (info, attachment) in colour[..target.colour.len()].iter_mut().zip(target.colour) {
            *info = attachment.info(vk::ResolveModeFlags::AVERAGE);
        }
        let depth = target.depth.map(|depth| depth.info(self.gpu.info.depth_resolve));
        let area = vk::Rect2D { offset: vk::Offset2D::default(), extent: target.extent };
        let mut info = vk::RenderingInfo::default()
            .render_area(area)
            .layer_count(1)
            .view_mask(target.view_mask)
            .color_attachments(&colour[..target.colour.len()]);
        if let Some(depth) = &depth {
            info = info.depth_attachment(depth);
        }
        // SAFETY: recording, outside a pass; the attachments are alive.
        unsafe { self.gpu.device.cmd_begin_rendering(self.raw, &info) };
        self.viewport(area);
        let value = draw(*self);
        // SAFETY: begun just above.
        unsafe { self.gpu.device.cmd_end_rendering(self.raw) };
        value
    }

    /// Draws go to this rectangle only, depth from 0 to 1.
    pub fn viewport(&self, area: vk::Rect2D) {
        let viewport = vk::Viewport {
            x: area.offset.x as f32,
            y: area.offset.y as f32,
            width: area.extent.width as f32,
            height: area.extent.height as f32,
            min_depth: 0.0,
            max_depth: 1.0,
        };
        // SAFETY: recording.
        unsafe {
            self.gpu.device.cmd_set_viewport(self.raw, 0, &[viewport]);
            self.gpu.device.cmd_set_scissor(self.raw, 0, &[area]);
        }
    }

    /// Draws leave out what is outside this rectangle.
    pub fn scissor(&self, area: vk::Rect2D) {
        // SAFETY: recording.
        unsafe { self.gpu.device.cmd_set_scissor(self.raw, 0, &[area]) };
    }

    /// Indices for the indexed draws that follow.
    pub fn index_buffer(&self, buffer: &Buffer, kind: vk::IndexType) {
        // SAFETY: recording.
        unsafe { self.gpu.device.cmd_bind_index_buffer(self.raw, buffer.raw, 0, kind) };
    }

    /// Draws vertices 0..`vertices` of instances 0..`instances`.
    pub fn draw(&self, vertices: u32, instances: u32) {
        self.count(1);
        // SAFETY: recording, inside a pass, with a graphics pipeline bound.
        unsafe { self.gpu.device.cmd_draw(self.raw, vertices, instances, 0, 0) };
    }

    /// Draws `count` indices from `first` on, so many instances of them.
    pub fn draw_indexed_range(&self, first: u32, count: u32, instances: u32) {
        self.count(1);
        // SAFETY: recording, inside a pass, with a graphics pipeline and indices bound.
        unsafe { self.gpu.device.cmd_draw_indexed(self.raw, count, instances, first, 0, 0) };
    }

    /// `draws` indexed draws, whose arguments ([`vk::DrawIndexedIndirectCommand`], packed) begin at `offset`.
    /// More than one at a time where the device says so ([`DeviceInfo`](super::DeviceInfo)).
    pub fn draw_indexed_indirect(&self, arguments: &Buffer, offset: u64, draws: u32) {
        self.count(u64::from(draws));
        let stride = size_of::<vk::DrawIndexedIndirectCommand>() as u32;
        // SAFETY: recording, inside a pass, with a graphics pipeline and indices bound.
        unsafe { self.gpu.device.cmd_draw_indexed_indirect(self.raw, arguments.raw, offset, draws, stride) };
    }

    fn count(&self, draws: u64) {
        self.gpu.draws.fetch_add(draws, Ordering::Relaxed);
    }
}
