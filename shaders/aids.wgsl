// What is drawn over the land for a person in a headset (after scene.wgsl and shown.wgsl): solids, which are round all over,
// and lines, which are as wide as they are and never thinner than a pixel.
//
// Positions are metres of the play space from the seat. AROUND and ALONG, the cells of a solid's mesh, come with the
// prelude. Mirrored by src/render/layout.rs.

struct AidEye {
    clip_from_play: mat4x4<f32>,
    at: vec3<f32>,
    // Metres that a pixel spans at a distance of 1 m.
    pixel: f32,
}

struct AidSight {
    eyes: array<AidEye, 2>,
    // Towards the sun, and up, along the play space's axes.
    sun: vec3<f32>,
    unused: f32,
    up: vec3<f32>,
    unused_too: f32,
}

// A capsule from a to b, with a radius at each end; or a ring around a whose axis is b, with its radius and its tube's.
struct AidSolid {
    a: vec3<f32>,
    radius_a: f32,
    b: vec3<f32>,
    radius_b: f32,
    // Red, green, blue as they are seen in full light, from the lowest byte.
    colour: u32,
    // 1: a ring.
    ring: u32,
    // 0: it has the light of the land; 1: it shines by itself.
    glow: f32,
    unused: u32,
}

// A point of a line, which goes on to the next one.
struct AidPoint {
    at: vec3<f32>,
    // Metres; below 0: the line ends here.
    half_width: f32,
    // The way the line goes here: a unit vector.
    tangent: vec3<f32>,
    // Red, green, blue, alpha as they are stored in a picture, from the lowest byte.
    colour: u32,
}

@group(0) @binding(1) var<uniform> aids: AidSight;
@group(0) @binding(2) var<storage, read> solids: array<AidSolid>;
@group(0) @binding(3) var<storage, read> points: array<AidPoint>;

struct SolidVertex {
    @builtin(position) position: vec4<f32>,
    @location(0) normal: vec3<f32>,
    @location(1) to_eye: vec3<f32>,
    @location(2) colour: vec3<f32>,
    @location(3) glow: f32,
}

// Some unit vector across this one.
fn across(v: vec3<f32>) -> vec3<f32> {
    let other = select(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), abs(v.x) > 0.7);
    return normalize(cross(v, other));
}

fn solid(index: u32, instance: u32, view: u32) -> SolidVertex {
    let it = solids[instance];
    let round = f32(index % (AROUND + 1u)) / f32(AROUND) * 6.2831853;
    let row = index / (AROUND + 1u);
    var axis = select(it.b - it.a, it.b, it.ring == 1u);
    let long = length(axis);
    axis = select(vec3(0.0, 1.0, 0.0), axis / long, long > 1e-6);
    let x = across(axis);
    let outwards = cos(round) * x + sin(round) * cross(axis, x);
    var middle = it.a;
    var radius = it.radius_a;
    var out: SolidVertex;
    if it.ring == 1u {
        let turn = f32(row) / f32(ALONG) * 6.2831853;
        out.normal = cos(turn) * outwards + sin(turn) * axis;
        middle += it.radius_a * outwards;
        radius = it.radius_b;
    } else {
        // Half of the rows are at each end, and the cells between them are the capsule's side.
        let half = (ALONG - 1u) / 2u;
        let upper = row > half;
        let latitude = (f32(row) - f32(half) - f32(upper)) / f32(half) * 1.5707963;
        out.normal = cos(latitude) * outwards + sin(latitude) * axis;
        if upper {
            middle = it.b;
            radius = it.radius_b;
        }
    }
    let at = middle + radius * out.normal;
    out.position = aids.eyes[view].clip_from_play * vec4(at, 1.0);
    out.to_eye = aids.eyes[view].at - at;
    out.colour = unpack4x8unorm(it.colour).rgb;
    out.glow = it.glow;
    return out;
}

@vertex
fn solid_vertex(
    @builtin(vertex_index) index: u32,
    @builtin(instance_index) instance: u32,
    @builtin(view_index) view: u32,
) -> SolidVertex {
    return solid(index, instance, view);
}

@vertex
fn solid_vertex_of_eye(
    @builtin(vertex_index) index: u32,
    @builtin(instance_index) instance: u32,
) -> SolidVertex {
    return solid(index, instance, eye.view);
}

@fragment
fn solid_fragment(in: SolidVertex) -> @location(0) vec4<f32> {
    let normal = normalize(in.normal);
    let to_eye = normalize(in.to_eye);
    let facing = max(dot(normal, to_eye), 0.0);
    let base = linear_from_srgb(in.colour);
    // Soft: the sun reaches a little around the edge, and the sky and the ground light what it does not reach.
    let sun = max(dot(normal, aids.sun) * 0.8 + 0.2, 0.0);
    let up = 0.5 + 0.5 * dot(normal, aids.up);
    let around = mix(scene.sky_horizon * 0.5, scene.sky_zenith, up) * scene.sky_strength;
    let shine = pow(max(dot(normal, normalize(aids.sun + to_eye)), 0.0), 40.0) * 0.25;
    let edge = pow(1.0 - facing, 3.0) * 0.35;
    let light = base * (scene.sun_colour * sun + around + 0.06) + scene.sun_colour * shine + around * edge;
    let lit = expose(light);
    // What shines by itself has a dark edge: it is seen before the sky as before the ground.
    let own = shown(in.colour * smoothstep(0.1, 0.55, facing));
    return vec4(mix(lit, own, in.glow), 1.0);
}

struct AidLineVertex {
    @builtin(position) position: vec4<f32>,
    // Metres from the middle of the line, half its width, and how many of them a pixel spans: each changes evenly over
    // the line's quads as they lie in space, which pixels do not.
    @location(0) beside: f32,
    @location(1) half_width: f32,
    @location(2) pixel: f32,
    @location(3) colour: vec4<f32>,
}

fn aid_line(index: u32, instance: u32, view: u32) -> AidLineVertex {
    var out: AidLineVertex;
    if points[instance].half_width < 0.0 {
        out.position = vec4(2.0, 2.0, 0.0, 1.0);
        return out;
    }
    // Two triangles: this point and the next, to the left and to the right of the way.
    let end = select(0u, 1u, index == 1u || index == 2u || index == 4u);
    let side = select(-1.0, 1.0, index >= 2u && index != 3u);
    let it = points[instance + end];
    let to_eye = aids.eyes[view].at - it.at;
    // Metres that a pixel spans there.
    let pixel = max(length(to_eye), 0.01) * aids.eyes[view].pixel;
    let wanted = abs(it.half_width) / pixel;
    let given = max(wanted, 0.75);
    out.pixel = pixel;
    out.half_width = given * pixel;
    out.beside = side * (given + rim(given) + 1.0) * pixel;
    var aside = cross(it.tangent, to_eye);
    let turned = length(aside);
    aside = select(across(it.tangent), aside / turned, turned > 1e-6);
    out.position = aids.eyes[view].clip_from_play * vec4(it.at + aside * out.beside, 1.0);
    // What would be thinner than that is fainter instead, down to a third.
    out.colour = unpack4x8unorm(it.colour) * vec4(1.0, 1.0, 1.0, max(wanted / given, 0.35));
    return out;
}

// The dark rim of a line, in pixels: it is seen before the sky as before the ground.
fn rim(half_width: f32) -> f32 {
    return max(0.6 * half_width, 1.0);
}

@vertex
fn aid_line_vertex(
    @builtin(vertex_index) index: u32,
    @builtin(instance_index) instance: u32,
    @builtin(view_index) view: u32,
) -> AidLineVertex {
    return aid_line(index, instance, view);
}

@vertex
fn aid_line_vertex_of_eye(
    @builtin(vertex_index) index: u32,
    @builtin(instance_index) instance: u32,
) -> AidLineVertex {
    return aid_line(index, instance, eye.view);
}

fn line_colour(in: AidLineVertex) -> vec4<f32> {
    let beside = abs(in.beside) / in.pixel;
    let half_width = in.half_width / in.pixel;
    let core = clamp(half_width + 0.5 - beside, 0.0, 1.0);
    let outer = half_width + rim(half_width);
    let dark = 0.5 * (1.0 - smoothstep(half_width - 0.5, outer + 0.5, beside)) * (1.0 - core);
    let alpha = core + dark;
    // Brightest along its middle.
    let middle = 1.0 - min(beside / half_width, 1.0);
    let bright = mix(in.colour.rgb, vec3(1.0), 0.6 * middle * middle);
    return vec4(shown(bright * (core / max(alpha, 1e-3))), alpha * in.colour.a);
}

// What covers more than half of what is behind it has a depth of its own, ...
@fragment
fn aid_line_core(in: AidLineVertex) -> @location(0) vec4<f32> {
    let colour = line_colour(in);
    if colour.a < 0.5 {
        discard;
    }
    return colour;
}

// ... and what covers less leaves the land's.
@fragment
fn aid_line_veil(in: AidLineVertex) -> @location(0) vec4<f32> {
    let colour = line_colour(in);
    if colour.a >= 0.5 {
        discard;
    }
    return colour;
}

// What is behind the land shows through it a little.
@fragment
fn aid_line_hidden(in: AidLineVertex) -> @location(0) vec4<f32> {
    let colour = line_colour(in);
    return vec4(colour.rgb, 0.35 * colour.a);
}
