//! A shader's resources on the device: layouts by reflection, and bind groups filled by name.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use ash::vk;

use super::buffer::Buffer;
use super::context::Gpu;
use super::image::Sampler;
use super::shader::{Binding, Constant, Shader, Source};
use super::shelf::replaced;

/// Every resource is visible to all stages in use, so groups fit all programs that declare them alike.
pub(super) const SHADER_STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::VERTEX.as_raw()
        | vk::ShaderStageFlags::FRAGMENT.as_raw()
        | vk::ShaderStageFlags::COMPUTE.as_raw(),
);

/// A shader with its layouts, which all its pipelines share.
pub struct Program {
    /// Shown in validation messages.
    pub name: String,
    /// The shader it was made of.
    pub shader: Shader,
    pub(super) layout: vk::PipelineLayout,
    groups: Vec<vk::DescriptorSetLayout>,
    pub(super) gpu: Arc<Gpu>,
}

impl Program {
    /// Compiles `pieces` (after a prelude of `constants`), or what [`Gpu::read_shaders_from`] has in their places, and makes
    /// its layouts.
    ///
    /// # Errors
    /// A [`ShaderError`](super::ShaderError), or out of memory.
    pub fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        pieces: &[Source<'_>],
        constants: &[(&str, Constant)],
    ) -> Result<Arc<Self>> {
        let texts = gpu.shelf.get().map(|shelf| shelf.texts()).unwrap_or_default();
        let shader = Shader::compile(&replaced(pieces, &texts), constants)?;
        let n_groups = shader.bindings().last().map_or(0, |last| last.group + 1);
        let mut made = Self {
            name: name.to_owned(),
            shader,
            layout: vk::PipelineLayout::null(),
            groups: Vec::new(),
            gpu: Arc::clone(gpu),
        };
        for group in 0..n_groups {
            let layout =
                made.make_group(group).with_context(|| format!("cannot lay out group {group} of {name}"))?;
            made.groups.push(layout);
        }
        made.layout = made.make_layout().with_context(|| format!("cannot lay out {name}"))?;
        gpu.name(made.layout, name);
        Ok(Arc::new(made))
    }

    /// Makes a bind group and fills it: every resource of the group by its name in the shader.
    ///
    /// # Errors
    /// A resource too many, missing or of the wrong kind; or out of memory.
    pub fn bind_group(self: &Arc<Self>, group: u32, resources: &[(&str, Resource<'_>)]) -> Result<BindGroup> {
        for binding in self.bindings_of(group) {
            if !resources.iter().any(|(name, _)| *name == binding.name) {
                bail!("group {group} of {} needs {}", self.name, binding.name);
            }
        }
        let made = BindGroup::new(self, group)
            .with_context(|| format!("cannot make group {group} of {}", self.name))?;
        for (name, resource) in resources {
            made.set(name, resource)?;
        }
        Ok(made)
    }

    fn bindings_of(&self, group: u32) -> impl Iterator<Item = &Binding> {
        self.shader.bindings().iter().filter(move |binding| binding.group == group)
    }

    fn make_group(&self, group: u32) -> Result<vk::DescriptorSetLayout, vk::Result> {
        let bindings: Vec<_> = self
            .bindings_of(group)
            .map(|binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding.binding)
                    .descriptor_type(binding.kind)
                    .descriptor_count(1)
                    .stage_flags(SHADER_STAGES)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: plain creation on a live device.
        unsafe { self.gpu.device.create_descriptor_set_layout(&info, None) }
    }

    fn make_layout(&self) -> Result<vk::PipelineLayout, vk::Result> {
        let push =
            [vk::PushConstantRange { stage_flags: SHADER_STAGES, offset: 0, size: self.shader.push_bytes() }];
        let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&self.groups);
        if self.shader.push_bytes() > 0 {
            info = info.push_constant_ranges(&push);
        }
        // SAFETY: the group layouts are alive.
        unsafe { self.gpu.device.create_pipeline_layout(&info, None) }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // SAFETY: pipelines and bind groups hold an `Arc` of this, so none is left; null is ignored.
        self.gpu.destroy(|device| unsafe {
            device.destroy_pipeline_layout(self.layout, None);
            self.groups.iter().for_each(|group| device.destroy_descriptor_set_layout(*group, None));
        });
    }
}

/// Something a shader can be given. It must outlive the bind group's last use on the GPU.
#[derive(Clone, Copy)]
pub enum Resource<'a> {
    /// A whole buffer, uniform or storage.
    Buffer(&'a Buffer),
    /// Part of a buffer: offset and size in bytes, the offset aligned as the device's limits say.
    Part(&'a Buffer, u64, u64),
    /// A texture, and the layout it is in when it is read.
    Texture(vk::ImageView, vk::ImageLayout),
    /// A storage image, in layout GENERAL.
    Storage(vk::ImageView),
    /// A sampler.
    Sampler(&'a Sampler),
}

/// A descriptor set with its own pool.
pub struct BindGroup {
    pub(super) raw: vk::DescriptorSet,
    /// Its `@group`.
    pub(super) group: usize,
    pool: vk::DescriptorPool,
    program: Arc<Program>,
}

impl BindGroup {
    fn new(program: &Arc<Program>, group: u32) -> Result<Self> {
        let device = &program.gpu.device;
        let layout = *program.groups.get(group as usize).context("the shader has no such group")?;
        let sizes: Vec<_> = program
            .bindings_of(group)
            .map(|binding| vk::DescriptorPoolSize::default().ty(binding.kind).descriptor_count(1))
            .collect();
        let pool_info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: plain creation on a live device.
        let pool = unsafe { device.create_descriptor_pool(&pool_info, None) }?;
        let mut made = Self {
            raw: vk::DescriptorSet::null(),
            group: group as usize,
            pool,
            program: Arc::clone(program),
        };
        let layouts = [layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool is ours alone and has room for this one set.
        made.raw = unsafe { device.allocate_descriptor_sets(&info) }?[0];
        program.gpu.name(made.raw, &program.name);
        Ok(made)
    }

    /// Replaces one resource. No frame in flight may be using the group.
    ///
    /// # Errors
    /// No resource of this name, or one of another kind.
    pub fn set(&self, name: &str, resource: &Resource<'_>) -> Result<()> {
        let program = &self.program;
        let Some(binding) = program.bindings_of(self.group as u32).find(|binding| binding.name == name)
        else {
            bail!("group {} of {} has no {name}", self.group, program.name);
        };
        let mut buffer = [vk::DescriptorBufferInfo::default()];
        let mut image = [vk::DescriptorImageInfo::default()];
        let write = vk::WriteDescriptorSet::default()
            .dst_set(self.raw)
            .dst_binding(binding.binding)
            .descriptor_type(binding.kind);
        let write = match (*resource, binding.kind) {
            (
                Resource::Buffer(whole),
                vk::DescriptorType::UNIFORM_BUFFER | vk::DescriptorType::STORAGE_BUFFER,
            ) => {
                buffer[0] = vk::DescriptorBufferInfo { buffer: whole.raw, offset: 0, range: vk::WHOLE_SIZE };
                write.buffer_info(&buffer)
            }
            (
                Resource::Part(whole, offset, range),
                vk::DescriptorType::UNIFORM_BUFFER | vk::DescriptorType::STORAGE_BUFFER,
            ) => {
                buffer[0] = vk::DescriptorBufferInfo { buffer: whole.raw, offset, range };
                write.buffer_info(&buffer)
            }
            (Resource::Texture(view, layout), vk::DescriptorType::SAMPLED_IMAGE) => {
                image[0] = image[0].image_view(view).image_layout(layout);
                write.image_info(&image)
            }
            (Resource::Storage(view), vk::DescriptorType::STORAGE_IMAGE) => {
                image[0] = image[0].image_view(view).image_layout(vk::ImageLayout::GENERAL);
                write.image_info(&image)
            }
            (Resource::Sampler(sampler), vk::DescriptorType::SAMPLER) => {
                image[0] = image[0].sampler(sampler.raw);
                write.image_info(&image)
            }
            (_, kind) => bail!("{name} of {} is a {kind:?} in the shader", program.name),
        };
        // SAFETY: the set is ours and idle, the resource is alive.
        unsafe { program.gpu.device.update_descriptor_sets(&[write], &[]) };
        Ok(())
    }
}

impl Drop for BindGroup {
    fn drop(&mut self) {
        // SAFETY: the owner lets go only when the GPU has finished with it; the set goes with its pool.
        self.program.gpu.destroy(|device| unsafe { device.destroy_descriptor_pool(self.pool, None) });
    }
}
