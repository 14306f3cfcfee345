// A flat picture that hangs before the wearer: over the eyes' pictures, over their copies for the window, or alone into a
// layer of the runtime's own. The picture's colours are gamma-encoded and multiplied by their alpha, as panels.wgsl makes
// them. Mirrored by src/render/layout.rs.

struct Hung {
    // From (right, up, 0), −1/2 to 1/2 over the picture, for the left eye and the right one.
    clip_from_picture: array<mat4x4<f32>, 2>,
}

@group(0) @binding(0) var quad_picture: texture_2d<f32>;
@group(0) @binding(1) var quad_sampler: sampler;
@group(1) @binding(0) var<uniform> hung: Hung;

struct QuadPush {
    // The eye, in a pass for one.
    view: u32,
    // 1: the target encodes sRGB by itself, and so blends and is blended in linear light.
    linear: u32,
}
var<immediate> quad: QuadPush;

struct QuadCorner {
    @builtin(position) position: vec4<f32>,
    // Right and down, 0 to 1.
    @location(0) place: vec2<f32>,
}

// Two triangles, whose fronts are towards +z of the picture.
fn place_of(index: u32) -> vec2<f32> {
    let corner = array<u32, 6>(0u, 2u, 1u, 1u, 2u, 3u)[index];
    return vec2(f32(corner & 1u), f32(corner >> 1u));
}

fn hang(index: u32, view: u32) -> QuadCorner {
    let place = place_of(index);
    let at = vec4(place.x - 0.5, 0.5 - place.y, 0.0, 1.0);
    return QuadCorner(hung.clip_from_picture[view] * at, place);
}

@vertex
fn quad_vertex(@builtin(vertex_index) index: u32, @builtin(view_index) view: u32) -> QuadCorner {
    return hang(index, view);
}

@vertex
fn quad_vertex_of_eye(@builtin(vertex_index) index: u32) -> QuadCorner {
    return hang(index, quad.view);
}

// The whole target.
@vertex
fn quad_vertex_alone(@builtin(vertex_index) index: u32) -> QuadCorner {
    let place = place_of(index);
    return QuadCorner(vec4(place * 2.0 - 1.0, 0.0, 1.0), place);
}

@fragment
fn quad_fragment(in: QuadCorner) -> @location(0) vec4<f32> {
    let stored = textureSampleLevel(quad_picture, quad_sampler, in.place, 0.0);
    if quad.linear == 0u || stored.a == 0.0 {
        return stored;
    }
    let colour = min(stored.rgb / stored.a, vec3(1.0));
    return vec4(linear_from_srgb(colour) * stored.a, stored.a);
}
