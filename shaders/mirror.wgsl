// The window's picture: parts of the eyes' pictures, and what is laid over them.
//
// All colours are numbers as they are stored, so sRGB stays sRGB.

@group(0) @binding(0) var eyes: texture_2d_array<f32>;
@group(0) @binding(1) var mirror_sampler: sampler;
@group(1) @binding(0) var overlay: texture_2d<f32>;

// A rectangle of the window. Mirrored by src/desktop/compose.rs.
struct Pane {
    // From (right, down, 1), 0 to 1 from the pane's corner, to a point of the eye's picture times its third coordinate.
    picture_from_pane: mat3x3<f32>,
    eye: u32,
    unused_0: u32,
    unused_1: u32,
    unused_2: u32,
}
var<immediate> pane: Pane;

struct Corner {
    @builtin(position) position: vec4<f32>,
    @location(0) place: vec2<f32>,
}

fn corner(index: u32) -> Corner {
    let place = vec2(f32((index << 1u) & 2u), f32(index & 2u));
    return Corner(vec4(place * 2.0 - 1.0, 0.0, 1.0), place);
}

@vertex
fn pane_vertex(@builtin(vertex_index) index: u32) -> Corner {
    return corner(index);
}

@fragment
fn pane_fragment(in: Corner) -> @location(0) vec4<f32> {
    let point = pane.picture_from_pane * vec3(in.place, 1.0);
    // The pictures have one mip; what their alpha holds is nobody's business here.
    return vec4(textureSampleLevel(eyes, mirror_sampler, point.xy / point.z, pane.eye, 0.0).rgb, 1.0);
}

@vertex
fn overlay_vertex(@builtin(vertex_index) index: u32) -> Corner {
    return corner(index);
}

@fragment
fn overlay_fragment(in: Corner) -> @location(0) vec4<f32> {
    return textureSampleLevel(overlay, mirror_sampler, in.place, 0.0);
}
