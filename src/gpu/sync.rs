//! Coarse, named barriers: who wrote, who reads next.

use std::ops::BitOr;

use ash::vk;

/// Pipeline stages and what they do to memory. Join several with `|`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Access {
    pub(super) stage: vk::PipelineStageFlags2,
    pub(super) access: vk::AccessFlags2,
}

impl Access {
    /// Nothing before, or nothing after.
    pub const NONE: Self = Self::of(vk::PipelineStageFlags2::NONE, vk::AccessFlags2::NONE);
    /// The host wrote mapped memory. (A submission sees what was written before it without any barrier.)
    pub const HOST_WRITE: Self = Self::of(vk::PipelineStageFlags2::HOST, vk::AccessFlags2::HOST_WRITE);
    /// The host will read mapped memory, once it has waited for the frame.
    pub const HOST_READ: Self = Self::of(vk::PipelineStageFlags2::HOST, vk::AccessFlags2::HOST_READ);
    /// Source of a copy or blit.
    pub const COPY_READ: Self =
        Self::of(vk::PipelineStageFlags2::ALL_TRANSFER, vk::AccessFlags2::TRANSFER_READ);
    /// Destination of a copy, blit or fill.
    pub const COPY_WRITE: Self =
        Self::of(vk::PipelineStageFlags2::ALL_TRANSFER, vk::AccessFlags2::TRANSFER_WRITE);
    /// Buffers, textures and uniforms read by a compute shader.
    pub const COMPUTE_READ: Self = Self::of(vk::PipelineStageFlags2::COMPUTE_SHADER, SHADER_READ);
    /// Buffers and storage images read and written by a compute shader.
    pub const COMPUTE_WRITE: Self = Self::of(vk::PipelineStageFlags2::COMPUTE_SHADER, SHADER_WRITE);
    /// Buffers, textures and uniforms read by a vertex shader.
    pub const VERTEX_READ: Self = Self::of(vk::PipelineStageFlags2::VERTEX_SHADER, SHADER_READ);
    /// Buffers, textures and uniforms read by a fragment shader.
    pub const FRAGMENT_READ: Self = Self::of(vk::PipelineStageFlags2::FRAGMENT_SHADER, SHADER_READ);
    /// Arguments of indirect draws and dispatches.
    pub const INDIRECT_READ: Self =
        Self::of(vk::PipelineStageFlags2::DRAW_INDIRECT, vk::AccessFlags2::INDIRECT_COMMAND_READ);
    /// Index buffers.
    pub const INDEX_READ: Self = Self::of(vk::PipelineStageFlags2::INDEX_INPUT, vk::AccessFlags2::INDEX_READ);
    /// Colour attachments, blended, written and resolved (depth resolves belong to this stage too).
    pub const COLOUR_WRITE: Self = Self::of(
        vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
        vk::AccessFlags2::from_raw(
            vk::AccessFlags2::COLOR_ATTACHMENT_READ.as_raw()
                | vk::AccessFlags2::COLOR_ATTACHMENT_WRITE.as_raw(),
        ),
    );
    /// Depth attachments, tested and written.
    pub const DEPTH_WRITE: Self = Self::of(
        vk::PipelineStageFlags2::from_raw(
            vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS.as_raw()
                | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS.as_raw(),
        ),
        vk::AccessFlags2::from_raw(
            vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_READ.as_raw()
                | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE.as_raw(),
        ),
    );
    /// Everything: for one-off work, where nobody counts microseconds.
    pub const ALL: Self = Self::of(
        vk::PipelineStageFlags2::ALL_COMMANDS,
        vk::AccessFlags2::from_raw(
            vk::AccessFlags2::MEMORY_READ.as_raw() | vk::AccessFlags2::MEMORY_WRITE.as_raw(),
        ),
    );

    const fn of(stage: vk::PipelineStageFlags2, access: vk::AccessFlags2) -> Self {
        Self { stage, access }
    }
}

const SHADER_READ: vk::AccessFlags2 = vk::AccessFlags2::from_raw(
    vk::AccessFlags2::SHADER_READ.as_raw() | vk::AccessFlags2::UNIFORM_READ.as_raw(),
);

const SHADER_WRITE: vk::AccessFlags2 =
    vk::AccessFlags2::from_raw(SHADER_READ.as_raw() | vk::AccessFlags2::SHADER_WRITE.as_raw());

impl BitOr for Access {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self::of(self.stage | other.stage, self.access | other.access)
    }
}

/// A whole image (all layers and mips) going from one use and layout to another.
#[derive(Debug, Clone, Copy)]
pub struct Transition {
    /// Also one that is not ours, as a swapchain's.
    pub image: vk::Image,
    /// Colour or depth.
    pub aspect: vk::ImageAspectFlags,
    /// What it was used for; UNDEFINED drops its contents.
    pub from: (Access, vk::ImageLayout),
    /// What it is used for next.
    pub to: (Access, vk::ImageLayout),
}

impl Transition {
    pub(super) fn barrier(&self) -> vk::ImageMemoryBarrier2<'static> {
        let ((from, old), (to, new)) = (self.from, self.to);
        vk::ImageMemoryBarrier2::default()
            .src_stage_mask(from.stage)
            .src_access_mask(from.access)
            .dst_stage_mask(to.stage)
            .dst_access_mask(to.access)
            .old_layout(old)
            .new_layout(new)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(self.image)
            .subresource_range(vk::ImageSubresourceRange {
                aspect_mask: self.aspect,
                base_mip_level: 0,
                level_count: vk::REMAINING_MIP_LEVELS,
                base_array_layer: 0,
                layer_count: vk::REMAINING_ARRAY_LAYERS,
            })
    }
}
