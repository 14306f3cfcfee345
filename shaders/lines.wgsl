// Lines over the ground (after scene.wgsl and shown.wgsl), a pixel wide. Mirrored by src/render/layout.rs.

struct LinePoint {
    // Metres from the middle of the head.
    at: vec3<f32>,
    // Red, green, blue as they are stored in a picture, from the lowest byte.
    colour: u32,
}

@group(0) @binding(1) var<storage, read> points: array<LinePoint>;

struct LineVertex {
    @builtin(position) position: vec4<f32>,
    @location(0) colour: vec3<f32>,
}

fn line(index: u32, view: u32) -> LineVertex {
    let point = points[index];
    var out: LineVertex;
    out.position = scene.views[view].clip_from_scene * vec4(point.at, 1.0);
    out.colour = unpack4x8unorm(point.colour).rgb;
    return out;
}

@vertex
fn line_vertex(@builtin(vertex_index) index: u32, @builtin(view_index) view: u32) -> LineVertex {
    return line(index, view);
}

@vertex
fn line_vertex_of_eye(@builtin(vertex_index) index: u32) -> LineVertex {
    return line(index, eye.view);
}

@fragment
fn line_fragment(in: LineVertex) -> @location(0) vec4<f32> {
    return vec4(shown(in.colour), 1.0);
}

// What is behind the ground shows through it.
@fragment
fn hidden_line_fragment(in: LineVertex) -> @location(0) vec4<f32> {
    return vec4(shown(in.colour), 0.25);
}
