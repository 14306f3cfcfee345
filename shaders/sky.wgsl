// What is behind the tiles: the backdrop, and the sky behind that, infinitely far.

@group(0) @binding(3) var backdrop_colour: texture_cube<f32>;
@group(0) @binding(4) var backdrop_distance: texture_cube<f32>;
@group(0) @binding(5) var smooth_sampler: sampler;
@group(0) @binding(6) var exact_sampler: sampler;

// Brightest light that the backdrop's 8 bits hold; twin of BAKED_BRIGHTEST in bake.wgsl.
const BRIGHTEST: f32 = 2.0;

struct SkyVertex {
    @builtin(position) position: vec4<f32>,
    @location(0) direction: vec3<f32>,
    @location(1) @interpolate(flat) view: u32,
}

fn sky_corner(index: u32, view: u32) -> SkyVertex {
    let corner = vec2(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0;
    // Any depth gives a point on the ray; 1 is the near plane.
    let near = scene.views[view].ray_from_clip * vec4(corner, 1.0, 1.0);
    var out: SkyVertex;
    out.position = vec4(corner, 0.0, 1.0);
    out.direction = near.xyz / near.w;
    out.view = view;
    return out;
}

@vertex
fn sky_vertex(@builtin(vertex_index) index: u32, @builtin(view_index) view: u32) -> SkyVertex {
    return sky_corner(index, view);
}

@vertex
fn sky_vertex_of_eye(@builtin(vertex_index) index: u32) -> SkyVertex {
    return sky_corner(index, eye.view);
}

struct SkyPixel {
    @location(0) colour: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn sky_fragment(in: SkyVertex) -> SkyPixel {
    let direction = normalize(in.direction);
    let behind = sky(direction);
    var out: SkyPixel;
    out.depth = 0.0;
    var light = behind;
    if scene.backdrop != 0u {
        // Sky texels are 0 throughout, so that what is filtered is already multiplied by its coverage.
        let baked = textureSampleLevel(backdrop_colour, smooth_sampler, direction, 0.0);
        if baked.a > 0.0 {
            let log_metres = textureSampleLevel(backdrop_distance, exact_sampler, direction, 0.0).x + scene.log_distance;
            let air = haze_at(log_metres - log2(1.0 / scene.per_haze_begin));
            light = behind * (1.0 - baked.a) + baked.rgb * BRIGHTEST * (1.0 - air) + behind * (baked.a * air);
            if baked.a > 0.5 {
                let at = scene.views[in.view].clip_from_scene * vec4(direction * exp2(min(log_metres, 60.0)), 1.0);
                out.depth = max(at.z / at.w, 0.0);
            }
        }
        if scene.flat_shading != 0u && baked.a > 0.5 {
            out.colour = vec4(0.5, 0.5, 0.5, 1.0);
            return out;
        }
    }
    if scene.flat_shading != 0u {
        discard;
    }
    out.colour = vec4(expose(light), 1.0);
    return out;
}
