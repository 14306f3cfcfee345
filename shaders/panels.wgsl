// The panels' triangles into a picture of their own. Colours are gamma-encoded and premultiplied all the way, as egui
// blends them. Mirrored by src/render/layout.rs.

struct PanelPush {
    // Clip units per point.
    clip_per_point: vec2<f32>,
}

var<immediate> panel: PanelPush;

@group(0) @binding(0) var panel_texture: texture_2d<f32>;
@group(0) @binding(1) var panel_sampler: sampler;
// Five words each: position in points, place in the texture, colour.
@group(1) @binding(0) var<storage, read> panel_vertices: array<u32>;

struct PanelCorner {
    @builtin(position) clip: vec4<f32>,
    @location(0) uv: vec2<f32>,
    @location(1) colour: vec4<f32>,
}

@vertex
fn panel_vertex(@builtin(vertex_index) index: u32) -> PanelCorner {
    let at = 5u * index;
    let position = bitcast<vec2<f32>>(vec2<u32>(panel_vertices[at], panel_vertices[at + 1u]));
    let uv = bitcast<vec2<f32>>(vec2<u32>(panel_vertices[at + 2u], panel_vertices[at + 3u]));
    let colour = unpack4x8unorm(panel_vertices[at + 4u]);
    return PanelCorner(vec4(position * panel.clip_per_point - 1.0, 0.0, 1.0), uv, colour);
}

@fragment
fn panel_fragment(corner: PanelCorner) -> @location(0) vec4<f32> {
    return corner.colour * textureSample(panel_texture, panel_sampler, corner.uv);
}
