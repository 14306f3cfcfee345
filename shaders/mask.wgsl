// Covers what nobody sees of the eyes' pictures: black, and nearer than anything that could be drawn there.
//
// The corners of both eyes' triangles are drawn for both eyes; those of the other eye fall outside its picture.
// Mirrored by src/render/layout.rs.

struct MaskCorner {
    // Tangents of the angles to the right and upwards.
    tangents: vec2<f32>,
    eye: u32,
    unused: u32,
}

// Per eye: clip coordinates of a point on the plane 1 in front of it are its tangents times xy, plus zw.
@group(0) @binding(0) var<uniform> mask_lenses: array<vec4<f32>, 2>;
@group(0) @binding(1) var<storage, read> mask_corners: array<MaskCorner>;

// Which eye a pass of its own draws; a pass for both eyes takes it from the view index.
struct Eye {
    view: u32,
    first_tile: u32,
}
var<immediate> eye: Eye;

fn mask_position(index: u32, view: u32) -> vec4<f32> {
    let corner = mask_corners[index];
    if corner.eye != view {
        return vec4(2.0, 2.0, 0.0, 1.0);
    }
    let lens = mask_lenses[view];
    // Depth 1: the near plane.
    return vec4(corner.tangents * lens.xy + lens.zw, 1.0, 1.0);
}

@vertex
fn mask_vertex(@builtin(vertex_index) index: u32, @builtin(view_index) view: u32) -> @builtin(position) vec4<f32> {
    return mask_position(index, view);
}

@vertex
fn mask_vertex_of_eye(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return mask_position(index, eye.view);
}

@fragment
fn mask_fragment() -> @location(0) vec4<f32> {
    return vec4(0.0, 0.0, 0.0, 1.0);
}
