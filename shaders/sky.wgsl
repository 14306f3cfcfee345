// What is behind the tiles: the backdrop, and the sky behind that.

@group(0) @binding(3) var backdrop_colour: texture_cube<f32>;
@group(0) @binding(4) var backdrop_distance: texture_cube<f32>;
@group(0) @binding(5) var smooth_sampler: sampler;
@group(0) @binding(6) var exact_sampler: sampler;

// Brightest light that the backdrop's 8 bits hold; twin of BAKED_BRIGHTEST in bake.wgsl.
const BRIGHTEST: f32 = 2.0;

struct SkyVertex {
    @builtin(position) position: vec4<f32>,
    @location(0) direction: vec3<f32>,
}

fn sky_corner(index: u32, view: u32) -> SkyVertex {
    let corner = vec2(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0;
    // Any depth gives a point on the ray; 1 is the near plane.
    let near = scene.views[view].ray_from_clip * vec4(corner, 1.0, 1.0);
    var out: SkyVertex;
    out.position = vec4(corner, 0.0, 1.0);
    out.direction = near.xyz / near.w;
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

// What is seen in a direction, air and all, as if no tile were in the way.
struct Behind {
    light: vec3<f32>,
    // Share of the backdrop in it, from 0 to 1.
    coverage: f32,
}

// Share of the air's light in what is seen of the backdrop: the mean over those of the four texels that show anything. One
// that shows nothing has a distance below any.
fn air_before(direction: vec3<f32>) -> f32 {
    let four = textureGather(0, backdrop_distance, exact_sampler, direction);
    let shows = step(vec4(-1e29), four);
    let count = dot(shows, vec4(1.0));
    // Where the mipmap reaches beyond the four, on a skyline, nothing is known of what it shows: it is left to the sky.
    if count == 0.0 {
        return 1.0;
    }
    let farthest = max(max(four.x, four.y), max(four.z, four.w));
    // On a ridge before a farther one each texel has its own air: the farther one's would lighten the nearer one's edge.
    let octaves = mix(vec4(farthest), four, shows) + scene.log_distance + log2(scene.per_haze_begin);
    if all(four > vec4(farthest - 0.1)) {
        return haze_at(octaves.x);
    }
    let air = vec4(haze_at(octaves.x), haze_at(octaves.y), haze_at(octaves.z), haze_at(octaves.w));
    return dot(air, shows) / count;
}

fn behind_tiles(direction: vec3<f32>) -> Behind {
    var out = Behind(sky(direction), 0.0);
    if scene.backdrop == 0u {
        return out;
    }
    // Sky texels are 0 throughout, so that what is filtered is already multiplied by its coverage.
    let baked = textureSample(backdrop_colour, smooth_sampler, direction);
    if baked.a > 0.0 {
        out.coverage = baked.a;
        let air = air_before(direction);
        out.light = out.light * (1.0 - baked.a) + baked.rgb * BRIGHTEST * (1.0 - air) + out.light * (baked.a * air);
    }
    return out;
}

// At depth 0, infinitely far: what shows no parallax needs no other depth, and no tile is ever hidden by it.
@fragment
fn sky_fragment(in: SkyVertex) -> @location(0) vec4<f32> {
    let behind = behind_tiles(normalize(in.direction));
    if scene.flat_shading != 0u {
        if behind.coverage <= 0.5 {
            discard;
        }
        return vec4(0.5, 0.5, 0.5, 1.0);
    }
    return vec4(expose(behind.light), 1.0);
}

// The same for the faces of a cubemap of our own, which has neither eyes nor depth.

struct FaceVertex {
    @builtin(position) position: vec4<f32>,
    @location(0) direction: vec3<f32>,
}

@vertex
fn face_vertex(@builtin(vertex_index) index: u32) -> FaceVertex {
    let corner = vec2(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0;
    let a = corner.x;
    let d = corner.y;
    var out: FaceVertex;
    out.position = vec4(corner, 0.0, 1.0);
    // The inverse of bake_vertex's: from across and down on the faces +x −x +y −y +z −z.
    switch eye.view {
        case 0u: { out.direction = vec3(1.0, -d, -a); }
        case 1u: { out.direction = vec3(-1.0, -d, a); }
        case 2u: { out.direction = vec3(a, 1.0, d); }
        case 3u: { out.direction = vec3(a, -1.0, -d); }
        case 4u: { out.direction = vec3(a, -d, 1.0); }
        default: { out.direction = vec3(-a, -d, -1.0); }
    }
    return out;
}

@fragment
fn face_fragment(in: FaceVertex) -> @location(0) vec4<f32> {
    return vec4(expose(behind_tiles(normalize(in.direction)).light), 1.0);
}
