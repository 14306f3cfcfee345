//! Pipelines: each made by one flat function, so that rebuilding them from new shaders costs nothing to write.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::ffi::CString;
use std::sync::Arc;

use anyhow::{Context, Result};
use ash::vk;

use super::program::Program;

/// What [`Commands`](super::Commands) binds.
pub trait Pipeline {
    /// Graphics or compute.
    const POINT: vk::PipelineBindPoint;
    /// The handle.
    fn raw(&self) -> vk::Pipeline;
    /// Whose layouts it has.
    fn program(&self) -> &Arc<Program>;
}

/// A compute entry point, ready to run.
pub struct ComputePipeline {
    raw: vk::Pipeline,
    program: Arc<Program>,
}

/// A vertex and a fragment entry point with the state round them, ready to draw.
pub struct GraphicsPipeline {
    raw: vk::Pipeline,
    program: Arc<Program>,
}

/// How a fragment joins what is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blend {
    /// It replaces it.
    None,
    /// It covers it by its alpha (colour not multiplied by alpha).
    Alpha,
    /// It covers it by its alpha, which its colour is multiplied by already.
    Premultiplied,
}

/// The depth test.
#[derive(Debug, Clone, Copy)]
pub struct Depth {
    /// Format of the attachment.
    pub format: vk::Format,
    /// GREATER for reversed depth.
    pub compare: vk::CompareOp,
    /// Whether depth is written.
    pub write: bool,
}

/// Everything about a graphics pipeline. Start from [`GraphicsInfo::new`] and say what differs.
#[derive(Clone, Copy)]
pub struct GraphicsInfo<'a> {
    /// The shader.
    pub program: &'a Arc<Program>,
    /// Vertex entry point.
    pub vertex: &'a str,
    /// Fragment entry point; none to write depth alone.
    pub fragment: Option<&'a str>,
    /// As in the [`Target`](super::Target) it draws to.
    pub view_mask: u32,
    /// Formats of the colour attachments, up to eight.
    pub colour: &'a [vk::Format],
    /// The depth test; none where there is no depth attachment.
    pub depth: Option<Depth>,
    /// Which faces are not drawn.
    pub cull: vk::CullModeFlags,
    /// Which way round a front face goes, as seen in the picture (y down).
    pub front: vk::FrontFace,
    /// Of all colour attachments.
    pub blend: Blend,
    /// What the vertices make.
    pub topology: vk::PrimitiveTopology,
    /// Of all attachments.
    pub samples: vk::SampleCountFlags,
}

impl<'a> GraphicsInfo<'a> {
    /// Opaque triangles of both faces, without depth, one view, one sample.
    pub fn new(
        program: &'a Arc<Program>,
        vertex: &'a str,
        fragment: &'a str,
        colour: &'a [vk::Format],
    ) -> Self {
        Self {
            program,
            vertex,
            fragment: Some(fragment),
            view_mask: 0,
            colour,
            depth: None,
            cull: vk::CullModeFlags::NONE,
            front: vk::FrontFace::COUNTER_CLOCKWISE,
            blend: Blend::None,
            topology: vk::PrimitiveTopology::TRIANGLE_LIST,
            samples: vk::SampleCountFlags::TYPE_1,
        }
    }
}

impl ComputePipeline {
    /// Makes it from an entry point of `program`.
    ///
    /// # Errors
    /// No such entry point, or the driver refuses it.
    pub fn new(program: &Arc<Program>, entry: &str) -> Result<Self> {
        let what = || format!("cannot make compute pipeline {}.{entry}", program.name);
        let device = &program.gpu.device;
        let module = Module::new(program, entry).with_context(what)?;
        let info = vk::ComputePipelineCreateInfo::default()
            .stage(module.stage(vk::ShaderStageFlags::COMPUTE))
            .layout(program.layout);
        // SAFETY: the module and the layout are alive.
        let made = unsafe { device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None) };
        let raw = made.map_err(|(_, error)| error).with_context(what)?[0];
        program.gpu.name(raw, &format!("{}.{entry}", program.name));
        Ok(Self { raw, program: Arc::clone(program) })
    }
}

impl GraphicsPipeline {
    /// Makes it; viewport and scissor are dynamic, there are no vertex buffers (shaders read storage).
    ///
    /// # Errors
    /// No such entry point, or the driver refuses it.
    pub fn new(info: &GraphicsInfo<'_>) -> Result<Self> {
        let program = info.program;
        let what = || format!("cannot make graphics pipeline {}.{}", program.name, info.vertex);
        let device = &program.gpu.device;

        let vertex = Module::new(program, info.vertex).with_context(what)?;
        let fragment =
            info.fragment.map(|entry| Module::new(program, entry)).transpose().with_context(what)?;
        let mut stages = vec![vertex.stage(vk::ShaderStageFlags::VERTEX)];
        stages.extend(fragment.iter().map(|module| module.stage(vk::ShaderStageFlags::FRAGMENT)));

        let vertex_input = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default().topology(info.topology);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let dynamic_states = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic_states);
        let raster = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .cull_mode(info.cull)
            .front_face(info.front)
            .line_width(1.0);
        let multisample =
            vk::PipelineMultisampleStateCreateInfo::default().rasterization_samples(info.samples);

        let mut depth = vk::PipelineDepthStencilStateCreateInfo::default();
        if let Some(test) = info.depth {
            depth =
                depth.depth_test_enable(true).depth_compare_op(test.compare).depth_write_enable(test.write);
        }
        let blends = vec![blend_state(info.blend); info.colour.len()];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);

        let mut rendering = vk::PipelineRenderingCreateInfo::default()
            .view_mask(info.view_mask)
            .color_attachment_formats(info.colour)
            .depth_attachment_format(info.depth.map_or(vk::Format::UNDEFINED, |test| test.format));
        let create = vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&vertex_input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&multisample)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(program.layout)
            .push_next(&mut rendering);
        // SAFETY: the modules and the layout are alive.
        let made = unsafe { device.create_graphics_pipelines(vk::PipelineCache::null(), &[create], None) };
        let raw = made.map_err(|(_, error)| error).with_context(what)?[0];
        program.gpu.name(raw, &format!("{}.{}", program.name, info.vertex));
        Ok(Self { raw, program: Arc::clone(program) })
    }
}

fn blend_state(blend: Blend) -> vk::PipelineColorBlendAttachmentState {
    let state =
        vk::PipelineColorBlendAttachmentState::default().color_write_mask(vk::ColorComponentFlags::RGBA);
    let own = match blend {
        Blend::None => return state,
        Blend::Alpha => vk::BlendFactor::SRC_ALPHA,
        Blend::Premultiplied => vk::BlendFactor::ONE,
    };
    state
        .blend_enable(true)
        .src_color_blend_factor(own)
        .dst_color_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
        .color_blend_op(vk::BlendOp::ADD)
        .src_alpha_blend_factor(vk::BlendFactor::ONE)
        .dst_alpha_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
        .alpha_blend_op(vk::BlendOp::ADD)
}

impl Pipeline for ComputePipeline {
    const POINT: vk::PipelineBindPoint = vk::PipelineBindPoint::COMPUTE;

    fn raw(&self) -> vk::Pipeline {
        self.raw
    }

    fn program(&self) -> &Arc<Program> {
        &self.program
    }
}

impl Pipeline for GraphicsPipeline {
    const POINT: vk::PipelineBindPoint = vk::PipelineBindPoint::GRAPHICS;

    fn raw(&self) -> vk::Pipeline {
        self.raw
    }

    fn program(&self) -> &Arc<Program> {
        &self.program
    }
}

impl Drop for ComputePipeline {
    fn drop(&mut self) {
        // SAFETY: the owner lets go only when the GPU has finished with it (see `Frames::bury`).
        self.program.gpu.destroy(|device| unsafe { device.destroy_pipeline(self.raw, None) });
    }
}

impl Drop for GraphicsPipeline {
    fn drop(&mut self) {
        // SAFETY: the owner lets go only when the GPU has finished with it (see `Frames::bury`).
        self.program.gpu.destroy(|device| unsafe { device.destroy_pipeline(self.raw, None) });
    }
}

/// SPIR-V of one entry point on the device, needed only while a pipeline is made.
struct Module<'a> {
    raw: vk::ShaderModule,
    entry: CString,
    program: &'a Program,
}

impl<'a> Module<'a> {
    fn new(program: &'a Program, entry: &str) -> Result<Self> {
        let code = program.shader.spirv(entry)?;
        let info = vk::ShaderModuleCreateInfo::default().code(&code);
        // SAFETY: the code was generated from a validated module.
        let raw = unsafe { program.gpu.device.create_shader_module(&info, None) }?;
        program.gpu.name(raw, entry);
        Ok(Self { raw, entry: CString::new(entry)?, program })
    }

    fn stage(&self, stage: vk::ShaderStageFlags) -> vk::PipelineShaderStageCreateInfo<'_> {
        vk::PipelineShaderStageCreateInfo::default().stage(stage).module(self.raw).name(&self.entry)
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: pipelines do not need their modules once made.
        self.program.gpu.destroy(|device| unsafe { device.destroy_shader_module(self.raw, None) });
    }
}
