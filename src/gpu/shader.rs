//! WGSL, joined from pieces, checked and reflected: no device needed.
//!
//! Two of WGSL's safety nets are off, for speed: workgroup memory is not cleared (write before you read) and
//! indices are not clamped.

use std::fmt::Write;

use ash::vk;
use naga::back::spv;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, GlobalVariable, ImageClass, Module, StorageAccess, TypeInner};

use super::diagnostic::Joined;
use super::layout::{Member, StructLayout};

/// A piece of shader text and the name that errors call it by.
#[derive(Debug, Clone, Copy)]
pub struct Source<'a> {
    /// Usually the file, e.g. `shaders/terrain.wgsl`.
    pub name: &'a str,
    /// WGSL.
    pub text: &'a str,
}

/// The value of a constant that Rust and the shader share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Constant {
    /// `u32`
    U32(u32),
    /// `i32`
    I32(i32),
    /// `f32`, finite
    F32(f32),
    /// `bool`
    Bool(bool),
}

/// What is wrong with a shader, with the file, the line and carets under the place.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{0}")]
pub struct ShaderError(String);

/// One resource that a shader declares.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Binding {
    /// The variable's name.
    pub name: String,
    /// `@group`
    pub group: u32,
    /// `@binding`
    pub binding: u32,
    /// What kind of resource it is.
    pub kind: vk::DescriptorType,
    /// Storage that the shader may write.
    pub writable: bool,
}

/// A checked shader module.
pub struct Shader {
    module: Module,
    info: ModuleInfo,
    bindings: Vec<Binding>,
    push_bytes: u32,
}

impl Shader {
    /// Joins a prelude of `constants` and the `pieces`, and checks the whole.
    ///
    /// # Errors
    /// WGSL that is wrong, or two resources in one place.
    pub fn compile(pieces: &[Source<'_>], constants: &[(&str, Constant)]) -> Result<Self, ShaderError> {
        let prelude = prelude(constants);
        let mut all = vec![Source { name: "constants", text: &prelude }];
        all.extend_from_slice(pieces);
        let joined = Joined::new(&all);
        let module = parse(&joined)?;
        let info = validate(&module, &joined)?;
        let bindings = bindings(&module, &joined)?;
        let push_bytes = push_bytes(&module);
        Ok(Self { module, info, bindings, push_bytes })
    }

    /// All resources, by group and binding.
    pub fn bindings(&self) -> &[Binding] {
        &self.bindings
    }

    /// Bytes of the `var<immediate>`; 0 without one.
    pub fn push_bytes(&self) -> u32 {
        self.push_bytes
    }

    /// Names of the entry points.
    pub fn entry_points(&self) -> impl Iterator<Item = &str> {
        self.module.entry_points.iter().map(|entry| entry.name.as_str())
    }

    /// Threads per workgroup of a compute entry point.
    pub fn workgroup_size(&self, entry: &str) -> Option<[u32; 3]> {
        self.module.entry_points.iter().find(|one| one.name == entry).map(|one| one.workgroup_size)
    }

    /// Where the members of a struct lie.
    pub fn layout(&self, name: &str) -> Option<StructLayout> {
        let (_, kind) = self.module.types.iter().find(|(_, kind)| kind.name.as_deref() == Some(name))?;
        let TypeInner::Struct { members, span } = &kind.inner else {
            return None;
        };
        let members = members.iter().map(|member| Member {
            name: member.name.clone().unwrap_or_default(),
            offset: member.offset,
            size: match &self.module.types[member.ty].inner {
                TypeInner::Array { size: naga::ArraySize::Dynamic, .. } => 0,
                inner => inner.size(self.module.to_ctx()),
            },
        });
        Some(StructLayout { size: *span, members: members.collect() })
    }

    /// Whether it can take another one's place: what the program hands to that one, this one takes in the same form.
    ///
    /// # Errors
    /// The first thing that is missing or otherwise: a resource, an entry point, a struct that both sides share.
    pub fn stands_in_for(&self, other: &Shader) -> Result<(), ShaderError> {
        let wrong = |what: String| Err(ShaderError(format!("{what}, as the program hands it over")));
        for binding in &other.bindings {
            if !self.bindings.contains(binding) {
                let Binding { name, group, binding, kind, .. } = binding;
                return wrong(format!(
                    "there should be {name}, a {kind:?} in group {group} at binding {binding}"
                ));
            }
        }
        if let Some(more) = self.bindings.iter().find(|binding| !other.bindings.contains(binding)) {
            return wrong(format!("there should be no resource {}", more.name));
        }
        if self.push_bytes != other.push_bytes {
            return wrong(format!("its var<immediate> should have {} bytes", other.push_bytes));
        }
        if let Some(entry) = other.entry_points().find(|entry| !self.entry_points().any(|own| own == *entry))
        {
            return wrong(format!("there should be the entry point {entry}"));
        }
        let odd = other.shared_structs().into_iter().find(|name| self.layout(name) != other.layout(name));
        odd.map_or(Ok(()), |name| {
            let members = other.layout(&name).map(|layout| layout.members).unwrap_or_default();
            let members = members.iter().map(|one| format!("{} ({} bytes)", one.name, one.size));
            wrong(format!("struct {name} should be {}", members.collect::<Vec<_>>().join(", ")))
        })
    }

    /// Names of the structs that lie in resources.
    fn shared_structs(&self) -> Vec<String> {
        let mut found = Vec::new();
        let globals = self.module.global_variables.iter();
        let shared = globals.filter(|(_, one)| one.binding.is_some() || one.space == AddressSpace::Immediate);
        let mut left: Vec<_> = shared.map(|(_, variable)| variable.ty).collect();
        while let Some(kind) = left.pop() {
            let kind = &self.module.types[kind];
            match &kind.inner {
                TypeInner::Struct { members, .. } => {
                    found.extend(kind.name.clone());
                    left.extend(members.iter().map(|member| member.ty));
                }
                TypeInner::Array { base, .. } => left.push(*base),
                _ => {}
            }
        }
        found
    }

    /// SPIR-V for one entry point.
    ///
    /// # Errors
    /// No such entry point, or one that Vulkan cannot express.
    pub fn spirv(&self, entry: &str) -> Result<Vec<u32>, ShaderError> {
        let Some(point) = self.module.entry_points.iter().find(|one| one.name == entry) else {
            let names: Vec<&str> = self.entry_points().collect();
            return Err(ShaderError(format!("no entry point {entry:?}; there is: {}", names.join(", "))));
        };
        let options = spv::Options {
            lang_version: (1, 3),
            flags: spv::WriterFlags::empty(),
            fake_missing_bindings: true,
            zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
            force_loop_bounding: false,
            ..spv::Options::default()
        };
        let which = spv::PipelineOptions { shader_stage: point.stage, entry_point: entry.to_owned() };
        spv::write_vec(&self.module, &self.info, &options, Some(&which))
            .map_err(|error| ShaderError(format!("{entry}: {error}")))
    }
}

fn prelude(constants: &[(&str, Constant)]) -> String {
    let mut text = String::new();
    for (name, value) in constants {
        // Writing to a string cannot fail.
        let _ = match value {
            Constant::U32(value) => writeln!(text, "const {name}: u32 = {value}u;"),
            Constant::I32(value) => writeln!(text, "const {name}: i32 = i32({value});"),
            Constant::F32(value) => writeln!(text, "const {name}: f32 = f32({value:?});"),
            Constant::Bool(value) => writeln!(text, "const {name}: bool = {value};"),
        };
    }
    text
}

fn parse(joined: &Joined) -> Result<Module, ShaderError> {
    naga::front::wgsl::parse_str(&joined.text).map_err(|error| {
        let labels = error.labels().map(|(span, label)| (span.to_range(), label));
        ShaderError(joined.explain(error.message(), labels, error.notes().map(str::to_owned)))
    })
}

fn validate(module: &Module, joined: &Joined) -> Result<ModuleInfo, ShaderError> {
    let allowed = Capabilities::IMMEDIATES | Capabilities::MULTIVIEW | Capabilities::EARLY_DEPTH_TEST;
    Validator::new(ValidationFlags::all(), allowed).validate(module).map_err(|error| {
        let labels = error.spans().map(|(span, label)| (span.to_range(), label.as_str()));
        ShaderError(joined.explain(&error.as_inner().to_string(), labels, causes(error.as_inner())))
    })
}

/// What lies behind an error, from the outside in.
fn causes(error: &dyn std::error::Error) -> impl Iterator<Item = String> {
    std::iter::successors(error.source(), |cause| cause.source()).map(ToString::to_string)
}

fn bindings(module: &Module, joined: &Joined) -> Result<Vec<Binding>, ShaderError> {
    let mut found: Vec<Binding> = Vec::new();
    for (handle, variable) in module.global_variables.iter() {
        let Some(place) = variable.binding else {
            continue;
        };
        let name = variable.name.clone().unwrap_or_default();
        let span = module.global_variables.get_span(handle).to_range();
        let wrong = |what: &str| {
            ShaderError(joined.explain(what, std::iter::once((span.clone(), "")), std::iter::empty()))
        };
        let Some((kind, writable)) = kind_of(module, variable) else {
            return Err(wrong("this kind of resource is not supported here"));
        };
        let twin = found.iter().find(|other| (other.group, other.binding) == (place.group, place.binding));
        if let Some(twin) = twin {
            return Err(wrong(&format!("{name} has the group and binding of {}", twin.name)));
        }
        found.push(Binding { name, group: place.group, binding: place.binding, kind, writable });
    }
    found.sort_by_key(|one| (one.group, one.binding));
    Ok(found)
}

fn kind_of(module: &Module, variable: &GlobalVariable) -> Option<(vk::DescriptorType, bool)> {
    let inner = &module.types[variable.ty].inner;
    match (variable.space, inner) {
        (AddressSpace::Uniform, _) => Some((vk::DescriptorType::UNIFORM_BUFFER, false)),
        (AddressSpace::Storage { access }, _) => {
            Some((vk::DescriptorType::STORAGE_BUFFER, access.contains(StorageAccess::STORE)))
        }
        (_, TypeInner::Sampler { .. }) => Some((vk::DescriptorType::SAMPLER, false)),
        (_, TypeInner::Image { class: ImageClass::Storage { access, .. }, .. }) => {
            Some((vk::DescriptorType::STORAGE_IMAGE, access.contains(StorageAccess::STORE)))
        }
        (_, TypeInner::Image { class: ImageClass::Sampled { .. } | ImageClass::Depth { .. }, .. }) => {
            Some((vk::DescriptorType::SAMPLED_IMAGE, false))
        }
        _ => None,
    }
}

fn push_bytes(module: &Module) -> u32 {
    let immediate =
        module.global_variables.iter().find(|(_, variable)| variable.space == AddressSpace::Immediate);
    immediate.map_or(0, |(_, variable)| module.types[variable.ty].inner.size(module.to_ctx()))
}
