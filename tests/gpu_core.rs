//! The Vulkan layer keeps its promises, on whatever device there is, without one validation message.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]
#![allow(unsafe_code, reason = "a counting allocator, and semaphores of the test's own")]

mod support;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use std::time::Duration;

use ash::vk;
use bytemuck::{Pod, Zeroable};
use fathomless::gpu::{
    Access, Attachment, Blend, Buffer, BufferInfo, Commands, ComputePipeline, Constant, Depth, Frames, Gpu,
    GraphicsInfo, GraphicsPipeline, Image, ImageInfo, Load, Location, Lost, PassTime, Pipeline, Program,
    Resource, Sampler, SemaphoreAt, Shader, Source, Target, Transition,
};
use fathomless::rust_layout;
use support::{assert_clean, gpu};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// Counts the allocations of each thread.
struct Counting;

// SAFETY: the system's allocator does the work.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: passed on as it came.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: passed on as it came.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const STORAGE: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
    vk::BufferUsageFlags::STORAGE_BUFFER.as_raw() | vk::BufferUsageFlags::TRANSFER_SRC.as_raw(),
);

const DOUBLE: Source<'_> = Source {
    name: "double.wgsl",
    text: "
struct Push { factor: i32, count: u32 }
var<immediate> push: Push;
@group(0) @binding(0) var<storage, read> numbers: array<i32>;
@group(0) @binding(1) var<storage, read_write> results: array<i32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < push.count {
        results[id.x] = numbers[id.x] * push.factor + BIAS;
    }
}
",
};

const GROUP: u32 = 64;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    factor: i32,
    count: u32,
}

struct Doubler {
    pipeline: ComputePipeline,
    group: fathomless::gpu::BindGroup,
    results: Buffer,
    _numbers: Buffer,
    push: Push,
}

impl Doubler {
    fn new(gpu: &Arc<Gpu>, numbers: &[i32]) -> Self {
        let constants = [("GROUP", Constant::U32(GROUP)), ("BIAS", Constant::I32(i32::MIN))];
        let program = Program::new(gpu, "double", &[DOUBLE], &constants).unwrap();
        let pipeline = ComputePipeline::new(&program, "main").unwrap();
        let push = Push { factor: 2, count: numbers.len() as u32 };
        let info = BufferInfo {
            name: "results",
            size: 4 * numbers.len() as u64,
            usage: STORAGE,
            location: Location::Device,
        };
        let results = Buffer::new(gpu, &info).unwrap();
        let numbers = Buffer::with_data(gpu, "numbers", STORAGE, numbers).unwrap();
        let resources = [("numbers", Resource::Buffer(&numbers)), ("results", Resource::Buffer(&results))];
        let group = program.bind_group(0, &resources).unwrap();
        Self { pipeline, group, results, _numbers: numbers, push }
    }

    fn record(&self, cmd: Commands<'_>) {
        cmd.bind(&self.pipeline, &[&self.group]);
        cmd.push(&self.pipeline, &self.push);
        cmd.dispatch([self.push.count.div_ceil(GROUP), 1, 1]);
    }
}

#[test]
fn a_compute_shader_doubles_numbers() {
    let gpu = gpu();
    let numbers: Vec<i32> = (0..1000).map(|n| n * 7 - 3000).collect();
    let doubler = Doubler::new(&gpu, &numbers);
    gpu.run(|cmd| doubler.record(cmd)).unwrap();
    let expected: Vec<i32> = numbers.iter().map(|n| (n * 2).wrapping_add(i32::MIN)).collect();
    assert_eq!(doubler.results.read::<i32>(numbers.len()).unwrap(), expected);
    drop(doubler);
    assert_clean(gpu);
}

const TRIANGLES: Source<'_> = Source {
    name: "triangles.wgsl",
    text: "
struct View { colour: vec4<f32>, shift: f32, depth: f32 }
struct Push { first_view: u32 }
var<immediate> push: Push;
@group(0) @binding(0) var<storage, read> views: array<View>;

struct Varying { @builtin(position) position: vec4<f32>, @location(0) colour: vec4<f32> }

// Instance 0 is near and moved by the view's shift, instance 1 is far. Both lie wholly within the picture: some
// software drivers put clipped triangles of a multiview pass in the wrong layer.
@vertex
fn vertex(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32, @builtin(view_index) eye: u32) -> Varying {
    let view = views[push.first_view + eye];
    let corner = vec2<f32>(f32(v & 1u) - 0.75, f32(v >> 1u) - 0.5);
    if i == 0u {
        return Varying(vec4<f32>(corner.x + view.shift, corner.y, view.depth, 1.0), view.colour);
    }
    return Varying(vec4<f32>(corner, view.depth * 0.5, 1.0), vec4<f32>(0.0, 0.0, 1.0, 1.0));
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    return in.colour;
}
",
};

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct View {
    colour: [f32; 4],
    shift: f32,
    depth: f32,
    _pad: [f32; 2],
}

const SIZE: u32 = 16;

/// Two layers of colour and reversed depth, drawn in one multiview pass or in one pass per layer.
struct Stereo {
    colour: Image,
    depth: Image,
    indices: Buffer,
    arguments: Buffer,
    program: Arc<Program>,
    group: fathomless::gpu::BindGroup,
    _views: Buffer,
}

const VIEWS: [View; 2] = [
    View { colour: [1.0, 0.0, 0.0, 1.0], shift: 0.5, depth: 0.5, _pad: [0.0; 2] },
    View { colour: [0.0, 1.0, 0.0, 1.0], shift: 0.0, depth: 0.25, _pad: [0.0; 2] },
];

impl Stereo {
    fn new(gpu: &Arc<Gpu>) -> Self {
        let target = ImageInfo { width: SIZE, height: SIZE, layers: 2, ..ImageInfo::default() };
        let colour = ImageInfo {
            name: "eyes",
            format: vk::Format::R8G8B8A8_UNORM,
            usage: vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC,
            ..target
        };
        let depth = ImageInfo {
            name: "depths",
            format: vk::Format::D32_SFLOAT,
            usage: vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC,
            ..target
        };
        let program = Program::new(gpu, "triangles", &[TRIANGLES], &[]).unwrap();
        let views = Buffer::with_data(gpu, "views", STORAGE, &VIEWS).unwrap();
        let group = program.bind_group(0, &[("views", Resource::Buffer(&views))]).unwrap();
        let arguments = [3u32, 2, 0, 0, 0];
        Self {
            colour: Image::new(gpu, &colour).unwrap(),
            depth: Image::new(gpu, &depth).unwrap(),
            indices: Buffer::with_data(gpu, "indices", vk::BufferUsageFlags::INDEX_BUFFER, &[0u16, 1, 2])
                .unwrap(),
            arguments: Buffer::with_data(gpu, "arguments", vk::BufferUsageFlags::INDIRECT_BUFFER, &arguments)
                .unwrap(),
            program,
            group,
            _views: views,
        }
    }

    fn pipeline(&self, view_mask: u32) -> GraphicsPipeline {
        GraphicsPipeline::new(&GraphicsInfo {
            view_mask,
            depth: Some(Depth { format: self.depth.format, compare: vk::CompareOp::GREATER, write: true }),
            ..GraphicsInfo::new(&self.program, "vertex", "fragment", &[self.colour.format])
        })
        .unwrap()
    }

    /// From whatever layout and use to attachments.
    fn prepare(&self, cmd: Commands<'_>) {
        let ready = |image: &Image, access, layout| Transition {
            image: image.raw,
            aspect: image.aspect,
            from: (Access::COPY_READ | access, vk::ImageLayout::UNDEFINED),
            to: (access, layout),
        };
        cmd.transition(&[
            ready(&self.colour, Access::COLOUR_WRITE, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL),
            ready(&self.depth, Access::DEPTH_WRITE, vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL),
        ]);
    }

    fn draw(&self, cmd: Commands<'_>, pipeline: &GraphicsPipeline, view_mask: u32, eye: u32) {
        let (colour, depth) = match view_mask {
            0 => (self.colour.layer_views[eye as usize], self.depth.layer_views[eye as usize]),
            _ => (self.colour.view, self.depth.view),
        };
        let layouts = (vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL, vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL);
        let target = Target {
            extent: self.colour.extent,
            view_mask,
            colour: &[Attachment::new(colour, layouts.0, Load::Colour([0.0, 0.0, 0.0, 1.0]))],
            depth: Some(Attachment::new(depth, layouts.1, Load::Depth(0.0))),
        };
        cmd.render(&target, |cmd| {
            cmd.bind(pipeline, &[&self.group]);
            cmd.push(pipeline, &eye);
            cmd.index_buffer(&self.indices, vk::IndexType::UINT16);
            cmd.draw_indexed_indirect(&self.arguments, 0, 1);
        });
    }

    /// Along one row: what is where in each eye, and how near (1 is nearest, 0 infinitely far).
    fn check(&self, gpu: &Arc<Gpu>) {
        let colours = read::<[u8; 4]>(gpu, &self.colour, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
        let depths = read::<f32>(gpu, &self.depth, vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL);
        let at = |eye: u32, x: u32| ((eye * SIZE + 5) * SIZE + x) as usize;
        let (red, green, blue, black) =
            ([255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [0, 0, 0, 255]);
        let left = [(0, 3, blue, 0.25), (0, 7, red, 0.5), (0, 11, red, 0.5), (0, 14, black, 0.0)];
        let right = [(1, 3, green, 0.25), (1, 7, green, 0.25), (1, 11, black, 0.0), (1, 14, black, 0.0)];
        for (eye, x, colour, depth) in left.into_iter().chain(right) {
            assert_eq!((colours[at(eye, x)], depths[at(eye, x)]), (colour, depth), "eye {eye}, x {x}");
        }
    }
}

/// All layers of an image of 16 by 16 texels of 4 bytes.
fn read<T: Pod>(gpu: &Arc<Gpu>, image: &Image, layout: vk::ImageLayout) -> Vec<T> {
    let layers = image.layer_views.len() as u32;
    let size = u64::from(image.extent.width * image.extent.height * layers * 4);
    let usage = vk::BufferUsageFlags::TRANSFER_DST;
    let buffer =
        Buffer::new(gpu, &BufferInfo { name: "picture", size, usage, location: Location::Readback }).unwrap();
    let source = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
    let region = vk::BufferImageCopy::default()
        .image_subresource(vk::ImageSubresourceLayers {
            aspect_mask: image.aspect,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: layers,
        })
        .image_extent(image.extent.into());
    gpu.run(|cmd| {
        let to_source = Transition {
            image: image.raw,
            aspect: image.aspect,
            from: (Access::ALL, layout),
            to: (Access::COPY_READ, source),
        };
        cmd.transition(&[to_source]);
        cmd.copy_image_to_buffer((image.raw, source), &buffer, &[region]);
    })
    .unwrap();
    buffer.slice().to_vec()
}

#[test]
fn multiview_draws_each_layer_from_its_own_view() {
    let gpu = gpu();
    assert!(gpu.info.multiview_offered, "{} has no multiview", gpu.info.name);
    let stereo = Stereo::new(&gpu);
    let pipeline = stereo.pipeline(0b11);
    gpu.run(|cmd| {
        stereo.prepare(cmd);
        stereo.draw(cmd, &pipeline, 0b11, 0);
    })
    .unwrap();
    stereo.check(&gpu);
    drop((stereo, pipeline));
    assert_clean(gpu);
}

#[test]
fn one_pass_per_layer_draws_the_same() {
    let gpu = gpu();
    let stereo = Stereo::new(&gpu);
    let pipeline = stereo.pipeline(0);
    gpu.run(|cmd| {
        stereo.prepare(cmd);
        stereo.draw(cmd, &pipeline, 0, 0);
        stereo.draw(cmd, &pipeline, 0, 1);
    })
    .unwrap();
    stereo.check(&gpu);
    drop((stereo, pipeline));
    assert_clean(gpu);
}

#[test]
fn a_hundred_frames_give_right_results_and_monotone_times_and_bury_their_dead() {
    let gpu = gpu();
    let start = gpu.memory_bytes();
    let stereo = Stereo::new(&gpu);
    let pipeline = stereo.pipeline(0b11);
    let doubler = Doubler::new(&gpu, &(0..100).collect::<Vec<i32>>());
    let mut frames = Frames::new(&gpu, 2).unwrap();
    let steady = gpu.memory_bytes();
    let mut most = steady;
    for n in 1..=100u64 {
        let mut frame = frames.begin().unwrap();
        check_times(frames.times());
        assert_eq!((frame.serial, frames.timed_serial()), (n, n.saturating_sub(2)));
        frame.pass(c"compute", |cmd| {
            cmd.barrier(Access::COMPUTE_WRITE, Access::COMPUTE_WRITE);
            doubler.record(cmd);
        });
        let scratch = BufferInfo {
            name: "short-lived",
            size: 4096,
            usage: vk::BufferUsageFlags::TRANSFER_DST,
            location: Location::Device,
        };
        let scratch = Buffer::new(&gpu, &scratch).unwrap();
        frame.pass(c"fill", |cmd| cmd.fill(&scratch, 0, 7));
        frames.bury(scratch);
        frame.pass(c"eyes", |cmd| {
            stereo.prepare(cmd);
            stereo.draw(cmd, &pipeline, 0b11, 0);
        });
        frame.pass(c"after", |_| ());
        most = most.max(gpu.memory_bytes());
        assert_eq!(frames.submit(frame, &[], &[]).unwrap(), n);
    }
    assert!(most <= steady + 3 * 4096, "the graveyard holds more than the frames in flight need");
    frames.wait_idle().unwrap();
    assert_eq!(frames.finished().unwrap(), 100);
    stereo.check(&gpu);
    drop((frames, stereo, pipeline, doubler));
    assert_eq!(gpu.memory_bytes(), start);
    assert_clean(gpu);
}

fn check_times(times: &[PassTime]) {
    if times.is_empty() {
        return;
    }
    assert_eq!(times.iter().map(|pass| pass.name).collect::<Vec<_>>(), ["compute", "fill", "eyes", "after"]);
    assert_eq!(times[0].start_ms, 0.0);
    for pair in times.windows(2) {
        assert!(pair[0].ms >= 0.0 && pair[0].start_ms + pair[0].ms <= pair[1].start_ms + 1e-9, "{times:?}");
    }
    assert!(times.iter().all(|pass| pass.ms < 10_000.0), "{times:?}");
}

#[test]
fn a_steady_frame_does_not_touch_the_heap() {
    let gpu = gpu();
    let stereo = Stereo::new(&gpu);
    let pipeline = stereo.pipeline(0b11);
    let doubler = Doubler::new(&gpu, &[1, 2, 3]);
    let mut frames = Frames::new(&gpu, 2).unwrap();
    let one = |frames: &mut Frames| {
        let mut frame = frames.begin().unwrap();
        frame.pass(c"compute", |cmd| {
            cmd.barrier(Access::COMPUTE_WRITE, Access::COMPUTE_WRITE);
            doubler.record(cmd);
        });
        frame.pass(c"eyes", |cmd| {
            stereo.prepare(cmd);
            stereo.draw(cmd, &pipeline, 0b11, 0);
        });
        frames.submit(frame, &[], &[]).unwrap();
        frames.times().len()
    };
    (0..4).for_each(|_| {
        one(&mut frames);
    });
    let before = ALLOCATIONS.get();
    let timed: usize = (0..20).map(|_| one(&mut frames)).sum();
    assert_eq!(ALLOCATIONS.get() - before, 0, "heap allocations in 20 frames");
    assert_eq!(timed, 40);
    drop((frames, stereo, pipeline, doubler));
    assert_clean(gpu);
}

#[test]
fn a_shader_error_names_the_piece_and_its_line() {
    let message = |bad: &str| {
        let common = Source { name: "common.wgsl", text: "fn twice(x: i32) -> i32 {\n    return 2 * x;\n}" };
        let bad = Source { name: "bad.wgsl", text: bad };
        match Shader::compile(&[common, bad], &[("N", Constant::U32(3))]) {
            Ok(_) => panic!("accepted"),
            Err(error) => error.to_string(),
        }
    };
    let parse = message("fn good() {}\nfn bad() -> i32 {\n    return thrice(1);\n}\n");
    assert!(parse.contains("--> bad.wgsl:3:12") && parse.contains("3 |     return thrice(1);"), "{parse}");
    assert!(parse.contains("|            ^^^^^^"), "{parse}");
    let types = message("@compute @workgroup_size(N)\nfn main() {\n    var x: i32 = twice(2) + 1.5;\n}\n");
    assert!(types.contains("bad.wgsl:3:"), "{types}");
    let invalid = message(
        "@group(0) @binding(0) var<storage, read> a: array<u32>;\n@compute @workgroup_size(1)\nfn main() {\n    a[0] = 1u;\n}\n",
    );
    assert!(invalid.contains("bad.wgsl:4:"), "{invalid}");
    let twins = message("@group(0) @binding(1) var a: sampler;\n@group(0) @binding(1) var b: sampler;\n");
    assert!(twins.contains("bad.wgsl:2:") && twins.contains("b has the group and binding of a"), "{twins}");
    let at_end = message("fn open(");
    assert!(at_end.contains("bad.wgsl:1:") || at_end.contains("bad.wgsl:2:"), "{at_end}");
}

#[test]
fn rust_structs_match_their_shader_twins() {
    let shader = Shader::compile(&[TRIANGLES], &[]).unwrap();
    assert_eq!(shader.layout("View").unwrap(), rust_layout!(View { colour, shift, depth }));
    let shader =
        Shader::compile(&[DOUBLE], &[("GROUP", Constant::U32(64)), ("BIAS", Constant::I32(0))]).unwrap();
    assert_eq!(shader.layout("Push").unwrap(), rust_layout!(Push { factor, count }));
    assert_eq!((shader.push_bytes(), shader.workgroup_size("main")), (8, Some([64, 1, 1])));
    let names: Vec<_> =
        shader.bindings().iter().map(|one| (one.name.as_str(), one.binding, one.writable)).collect();
    assert_eq!(names, [("numbers", 0, false), ("results", 1, true)]);
    assert!(shader.layout("Nothing").is_none());
    assert!(shader.spirv("mian").unwrap_err().to_string().contains("there is: main"));
}

#[test]
fn a_bind_group_says_what_is_missing_or_wrong() {
    let gpu = gpu();
    let program = Program::new(&gpu, "triangles", &[TRIANGLES], &[]).unwrap();
    let error = |resources: &[(&str, Resource<'_>)]| match program.bind_group(0, resources) {
        Ok(_) => panic!("accepted"),
        Err(error) => error.to_string(),
    };
    let sampler =
        Sampler::new(&gpu, "linear", vk::Filter::LINEAR, vk::SamplerAddressMode::CLAMP_TO_EDGE).unwrap();
    assert_eq!(error(&[]), "group 0 of triangles needs views");
    assert!(
        error(&[("views", Resource::Sampler(&sampler))]).contains("views of triangles is a STORAGE_BUFFER")
    );
    let views = Buffer::with_data(&gpu, "views", STORAGE, &VIEWS).unwrap();
    let both = [("views", Resource::Buffer(&views)), ("extra", Resource::Buffer(&views))];
    assert_eq!(error(&both), "group 0 of triangles has no extra");
    drop((program, sampler, views));
    assert_clean(gpu);
}

const MATERIALS: Source<'_> = Source {
    name: "materials.wgsl",
    text: "
@group(0) @binding(0) var<uniform> tint: vec4<f32>;
@group(0) @binding(1) var sky: texture_cube<f32>;
@group(0) @binding(2) var smooth_sampler: sampler;
@group(1) @binding(0) var canvas: texture_storage_2d_array<rgba8unorm, write>;

@compute @workgroup_size(4, 4)
fn paint(@builtin(global_invocation_id) id: vec3<u32>) {
    textureStore(canvas, id.xy, id.z, vec4<f32>(f32(id.z) * 0.2, 0.0, 0.0, 1.0));
}

@vertex
fn whole(@builtin(vertex_index) v: u32) -> @builtin(position) vec4<f32> {
    return vec4<f32>(f32(v & 1u) * 4.0 - 1.0, f32(v >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn look_up() -> @location(0) vec4<f32> {
    return textureSampleLevel(sky, smooth_sampler, vec3<f32>(0.0, 0.0, -1.0), 0.0) + tint;
}
",
};

#[test]
fn compute_paints_a_cube_that_a_multisampled_blended_pass_samples() {
    let gpu = gpu();
    let start = gpu.memory_bytes();
    let format = vk::Format::R8G8B8A8_UNORM;
    let cube = ImageInfo {
        name: "sky",
        width: 4,
        height: 4,
        layers: 6,
        format,
        usage: vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::SAMPLED,
        cube: true,
        ..ImageInfo::default()
    };
    let picture = ImageInfo {
        name: "picture",
        width: SIZE,
        height: SIZE,
        format,
        usage: vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC,
        ..ImageInfo::default()
    };
    let samples = ImageInfo { name: "samples", samples: vk::SampleCountFlags::TYPE_4, ..picture };
    let cube = Image::new(&gpu, &cube).unwrap();
    let picture = Image::new(&gpu, &picture).unwrap();
    let samples = Image::new(&gpu, &samples).unwrap();
    let sampler =
        Sampler::new(&gpu, "smooth", vk::Filter::LINEAR, vk::SamplerAddressMode::CLAMP_TO_EDGE).unwrap();
    let mut tint = Buffer::new(
        &gpu,
        &BufferInfo {
            name: "tint",
            size: 16,
            usage: vk::BufferUsageFlags::UNIFORM_BUFFER,
            location: Location::Upload,
        },
    )
    .unwrap();
    tint.slice_mut().copy_from_slice(&[0.0f32, 1.0, 0.0, -0.5]);
    let program = Program::new(&gpu, "materials", &[MATERIALS], &[]).unwrap();
    let inputs = [
        ("tint", Resource::Part(&tint, 0, 16)),
        ("sky", Resource::Texture(cube.cube_view, vk::ImageLayout::GENERAL)),
        ("smooth_sampler", Resource::Sampler(&sampler)),
    ];
    let inputs = program.bind_group(0, &inputs).unwrap();
    let canvas = program.bind_group(1, &[("canvas", Resource::Storage(cube.view))]).unwrap();
    let paint = ComputePipeline::new(&program, "paint").unwrap();
    let draw = GraphicsPipeline::new(&GraphicsInfo {
        samples: vk::SampleCountFlags::TYPE_4,
        blend: Blend::Alpha,
        ..GraphicsInfo::new(&program, "whole", "look_up", &[format])
    })
    .unwrap();
    assert!(Arc::ptr_eq(paint.program(), draw.program()));
    let attach = vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL;
    let fresh = |image: &Image, access, layout| Transition {
        image: image.raw,
        aspect: image.aspect,
        from: (Access::NONE, vk::ImageLayout::UNDEFINED),
        to: (access, layout),
    };
    gpu.run(|cmd| {
        cmd.transition(&[
            fresh(&cube, Access::COMPUTE_WRITE, vk::ImageLayout::GENERAL),
            fresh(&picture, Access::COLOUR_WRITE, attach),
            fresh(&samples, Access::COLOUR_WRITE, attach),
        ]);
        cmd.bind(&paint, &[&inputs, &canvas]);
        cmd.dispatch([1, 1, 6]);
        cmd.barrier(Access::COMPUTE_WRITE, Access::FRAGMENT_READ);
        let attachment = Attachment {
            store: false,
            resolve: Some(picture.view),
            ..Attachment::new(samples.view, attach, Load::Colour([0.0, 0.0, 1.0, 1.0]))
        };
        let target = Target { extent: picture.extent, view_mask: 0, colour: &[attachment], depth: None };
        cmd.render(&target, |cmd| {
            cmd.bind(&draw, &[&inputs, &canvas]);
            cmd.draw(3, 1);
        });
    })
    .unwrap();
    // Face 5 looks along -z and is red 1.0; with the tint (1, 1, 0) at alpha 0.5 over opaque blue:
    // colour = half and half, alpha = 0.5 + 0.5 * 1.
    for texel in read::<[u8; 4]>(&gpu, &picture, attach) {
        let expected = [128u8, 128, 128, 255];
        assert!(texel.iter().zip(expected).all(|(value, wanted)| value.abs_diff(wanted) <= 2), "{texel:?}");
    }
    drop((cube, picture, samples, sampler, tint, program, inputs, canvas, paint, draw));
    assert_eq!(gpu.memory_bytes(), start);
    assert_clean(gpu);
}

/// A timeline semaphore of the test's own.
fn timeline(gpu: &Gpu) -> vk::Semaphore {
    let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
    let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
    // SAFETY: plain creation on a live device.
    unsafe { gpu.device.create_semaphore(&info, None) }.unwrap()
}

#[test]
fn a_frame_waits_for_and_signals_the_semaphores_it_is_given() {
    let gpu = gpu();
    let (before, after) = (timeline(&gpu), timeline(&gpu));
    let mut frames = Frames::new(&gpu, 2).unwrap();
    let frame = frames.begin().unwrap();
    let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
    let at = |semaphore, value| SemaphoreAt { semaphore, value, stage };
    frames.submit(frame, &[at(before, 1)], &[at(after, 5)]).unwrap();
    assert_eq!(frames.finished().unwrap(), 0);
    let signal = vk::SemaphoreSignalInfo::default().semaphore(before).value(1);
    // SAFETY: the semaphores are alive and the value is higher than before.
    unsafe { gpu.device.signal_semaphore(&signal) }.unwrap();
    frames.wait_idle().unwrap();
    // SAFETY: as above; nothing uses them any more.
    unsafe {
        assert_eq!(gpu.device.get_semaphore_counter_value(after).unwrap(), 5);
        gpu.device.destroy_semaphore(before, None);
        gpu.device.destroy_semaphore(after, None);
    }
    drop(frames);
    assert_clean(gpu);
}

#[test]
fn a_frame_that_never_finishes_is_a_typed_error_and_its_device_is_left_alone() {
    let gpu = gpu();
    let never = timeline(&gpu);
    let mut frames = Frames::new(&gpu, 1).unwrap();
    frames.timeout = Duration::from_millis(30);
    let mut frame = frames.begin().unwrap();
    frame.pass(c"terrain", |_| ());
    let wait = SemaphoreAt { semaphore: never, value: 1, stage: vk::PipelineStageFlags2::ALL_COMMANDS };
    frames.submit(frame, &[wait], &[]).unwrap();
    let lost = frames.begin().err().expect("the frame cannot have finished");
    assert_eq!(lost, Lost::DeviceHang { pass: "none", seconds: 0.03 });
    drop(frames);
    assert_clean(gpu);
}

#[test]
fn a_hang_names_the_pass_that_hangs() {
    let gpu = gpu();
    // SAFETY: plain creation on a live device.
    let event = unsafe { gpu.device.create_event(&vk::EventCreateInfo::default(), None) }.unwrap();
    let mut frames = Frames::new(&gpu, 1).unwrap();
    frames.timeout = Duration::from_millis(300);
    let mut frame = frames.begin().unwrap();
    frame.pass(c"quick", |_| ());
    frame.pass(c"stuck", |cmd| {
        let (host, all) = (vk::PipelineStageFlags::HOST, vk::PipelineStageFlags::ALL_COMMANDS);
        // SAFETY: recording; the event is set by the host below.
        unsafe { gpu.device.cmd_wait_events(cmd.raw, &[event], host, all, &[], &[], &[]) };
    });
    frame.pass(c"never", |_| ());
    frames.submit(frame, &[], &[]).unwrap();
    let lost = frames.begin().err().expect("the frame cannot have finished");
    assert_eq!(lost, Lost::DeviceHang { pass: "stuck", seconds: 0.3 });
    assert_eq!(lost.to_string(), "the GPU did not finish within 0.3 s; the last pass begun was \"stuck\"");
    // SAFETY: the event is alive; like all of a device that hung, it is leaked.
    unsafe { gpu.device.set_event(event) }.unwrap();
    drop(frames);
    assert_clean(gpu);
}

#[test]
fn a_fault_is_counted() {
    let gpu = gpu();
    let info = vk::BufferCreateInfo::default().size(0).usage(vk::BufferUsageFlags::TRANSFER_DST);
    // SAFETY: deliberately a size that the specification forbids; the layer reports it before the driver sees it.
    if let Ok(raw) = unsafe { gpu.device.create_buffer(&info, None) } {
        // SAFETY: just made.
        unsafe { gpu.device.destroy_buffer(raw, None) };
    }
    let report = gpu.validation();
    assert_eq!(report.count, 1);
    assert!(report.texts[0].contains("VUID-VkBufferCreateInfo-size-00912"), "{:?}", report.texts);
}

#[test]
fn a_missing_barrier_is_counted_and_a_barrier_cures_it() {
    let gpu = gpu();
    let usage = vk::BufferUsageFlags::TRANSFER_DST;
    let info = BufferInfo { name: "twice", size: 64, usage, location: Location::Device };
    let buffer = Buffer::new(&gpu, &info).unwrap();
    let fill_twice = |between: Option<Access>| {
        gpu.run(|cmd| {
            cmd.fill(&buffer, 0, 1);
            between.into_iter().for_each(|access| cmd.barrier(access, access));
            cmd.fill(&buffer, 0, 2);
        })
        .unwrap();
        gpu.validation().count
    };
    assert_eq!(fill_twice(Some(Access::COPY_WRITE)), 0);
    assert_eq!(fill_twice(None), 1);
    assert!(gpu.validation().texts[0].contains("SYNC-HAZARD-WRITE"), "{:?}", gpu.validation().texts);
}
