// What spares the stomach, laid over the eyes' finished pictures: the field of view narrowed, and all of it faded to
// black. Mirrored by src/render/layout.rs.

struct Veil {
    // Per eye: clip coordinates of a point on the plane 1 in front of it are its tangents times xy, plus zw.
    lenses: array<vec4<f32>, 2>,
    // Per eye: where the head looks, along the eye's own axes; of length 1. Both eyes see the circle in that direction,
    // however their pictures lie around it and however their displays are turned.
    ahead: array<vec4<f32>, 2>,
    // Radians from there at which it begins to darken, and at which it is as dark as it gets.
    inner: f32,
    outer: f32,
    // How dark that is, and how dark all of it is besides, 0 to 1 of what the eye takes for brightness.
    strength: f32,
    fade: f32,
}

@group(0) @binding(0) var<uniform> veil: Veil;

// Which eye a pass of its own draws; a pass for both eyes takes it from the view index.
struct Eye {
    view: u32,
    first_tile: u32,
}
var<immediate> eye: Eye;

struct VeilVertex {
    @builtin(position) position: vec4<f32>,
    @location(0) tangents: vec2<f32>,
    @location(1) @interpolate(flat) ahead: vec3<f32>,
}

fn veil_corner(index: u32, view: u32) -> VeilVertex {
    let corner = vec2(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0;
    let lens = veil.lenses[view];
    var out: VeilVertex;
    out.position = vec4(corner, 0.0, 1.0);
    out.tangents = (corner - lens.zw) / lens.xy;
    out.ahead = veil.ahead[view].xyz;
    return out;
}

@vertex
fn veil_vertex(@builtin(vertex_index) index: u32, @builtin(view_index) view: u32) -> VeilVertex {
    return veil_corner(index, view);
}

@vertex
fn veil_vertex_of_eye(@builtin(vertex_index) index: u32) -> VeilVertex {
    return veil_corner(index, eye.view);
}

// By how much a stored colour's step is to be moved, from -0.5 to 0.5: Jimenez's interleaved gradient noise (Next
// Generation Post Processing in Call of Duty, SIGGRAPH 2014).
fn step_noise(at: vec2<f32>) -> f32 {
    return fract(52.9829189 * fract(dot(at, vec2(0.06711056, 0.00583715)))) - 0.5;
}

// What is left of a colour as pictures store it.
fn clear_share(in: VeilVertex) -> f32 {
    let ray = vec3(in.tangents, -1.0);
    let off = atan2(length(cross(ray, in.ahead)), dot(ray, in.ahead));
    let dark = veil.strength * smoothstep(veil.inner, veil.outer, off);
    let clear = (1.0 - dark) * (1.0 - veil.fade);
    // Black stays black, and what is open untouched.
    let edge = clear > 0.0 && clear < 1.0;
    return clamp(clear + select(0.0, step_noise(in.position.xy) / 255.0, edge), 0.0, 1.0);
}

// Black, covering so much. Alpha is covered like colour: what is a layer behind the picture darkens with it.

// For a target that encodes sRGB by itself, whose light is blended: white becomes exactly what is wanted, and darker
// colours nearly.
@fragment
fn veil_fragment(in: VeilVertex) -> @location(0) vec4<f32> {
    let clear = clear_share(in);
    if clear >= 1.0 {
        discard;
    }
    let light = linear_from_srgb(vec3(clear)).x;
    return vec4(0.0, 0.0, 0.0, 1.0 - light);
}

// For one whose stored colours are blended.
@fragment
fn veil_fragment_encoded(in: VeilVertex) -> @location(0) vec4<f32> {
    let clear = clear_share(in);
    if clear >= 1.0 {
        discard;
    }
    return vec4(0.0, 0.0, 0.0, 1.0 - clear);
}
