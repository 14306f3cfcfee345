// What every pass over the scene shares: views, light, air. Mirrored by src/render/layout.rs.
//
// Positions are metres from the middle of the head, along the terrain's axes (y up): both eyes share them, and a
// metre is the user's own (after the rig's scale).

struct View {
    clip_from_scene: mat4x4<f32>,
    // The ray through a clip position, from the eye: the inverse, less the eye's place.
    ray_from_clip: mat4x4<f32>,
}

struct Material {
    colour: vec3<f32>,
    slope: f32,
    strata: f32,
    grain: f32,
    unused: vec2<f32>,
}

struct Scene {
    views: array<View, 2>,
    // Towards the sun.
    sun_direction: vec3<f32>,
    // 1: the target does not encode sRGB by itself.
    encode: u32,
    sun_colour: vec3<f32>,
    // 1 over the distance in metres at which the haze's octaves begin.
    per_haze_begin: f32,
    sky_zenith: vec3<f32>,
    sky_strength: f32,
    sky_horizon: vec3<f32>,
    // Octaves of distance at which the haze is half closed, and how fast it closes.
    haze_middle: f32,
    haze_steepness: f32,
    // Octaves at which nothing but haze is left.
    haze_close: f32,
    // Distance in tiles at which the morph begins, and 1 over its length.
    morph_start: f32,
    per_morph_length: f32,
    // Where on the round of tints the nearest ground lies, and tints per octave of distance.
    drift_phase: f32,
    drift_per_octave: f32,
    drift_tints: u32,
    materials_used: u32,
    // Colours of the strata, how many, and how many rounds of them there are in a cell of height.
    strata_used: u32,
    strata_per_cell: f32,
    // 1: no light, no air, no sky: covered pixels only (to find holes).
    flat_shading: u32,
    // 1 over the metres that the octaves of drift_phase count from.
    per_drift_begin: f32,
    // What the backdrop's log2 distance lacks to metres; and when it is baked, what is to be added to it.
    log_distance: f32,
    // 1: there is a backdrop.
    backdrop: u32,
    // How far the skirts of tiles at the rim of what is baked reach out, in tiles.
    rim_skirt: f32,
    unused: u32,
    materials: array<Material, 8>,
    tints: array<vec4<f32>, 8>,
    strata: array<vec4<f32>, 4>,
}

@group(0) @binding(0) var<uniform> scene: Scene;

// Which eye, or which face of the backdrop, a pass of its own draws; a pass for both eyes takes the eye from the view
// index. And where in the tiles its first instance is.
struct Eye {
    view: u32,
    first_tile: u32,
}
var<immediate> eye: Eye;

// Light from the sky in a direction; below the horizon, the horizon's.
fn sky(direction: vec3<f32>) -> vec3<f32> {
    let up = max(direction.y, 0.0);
    // Air mass falls off quickly above the horizon.
    let thickness = exp(-4.5 * up);
    var colour = mix(scene.sky_zenith, scene.sky_horizon, thickness);
    let to_sun = max(dot(direction, scene.sun_direction), 0.0);
    let glow = 0.12 * pow(to_sun, 6.0) + 0.25 * pow(to_sun, 48.0);
    return colour + scene.sun_colour * glow * 0.25;
}

// Share of the air's light in what is seen so many octaves away, from 0 to 1: a logistic.
fn haze_at(octaves: f32) -> f32 {
    let curve = 1.0 / (1.0 + exp(-(octaves - scene.haze_middle) * scene.haze_steepness));
    return max(curve, smoothstep(scene.haze_close - 2.0, scene.haze_close, octaves));
}

fn haze(distance: f32) -> f32 {
    return haze_at(log2(max(distance * scene.per_haze_begin, 1e-6)));
}

// Scene light to display light: a shoulder on the luminance, and bright colours fade towards white, nothing clips hard.
fn expose(colour: vec3<f32>) -> vec3<f32> {
    let light = max(colour, vec3(0.0)) * 1.35;
    let luminance = dot(light, vec3(0.2126, 0.7152, 0.0722));
    // Extended Reinhard (Reinhard et al. 2002, eq. 4), white at 3.
    let scale = (1.0 + luminance / 9.0) / (1.0 + 0.55 * luminance);
    let by_luminance = light * scale;
    let by_channel = light * (1.0 + light / 9.0) / (1.0 + 0.55 * light);
    let linear = clamp(mix(by_luminance, by_channel, 0.6), vec3(0.0), vec3(1.0));
    if scene.encode == 0u {
        return linear;
    }
    let low = linear * 12.92;
    let high = 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055;
    return select(high, low, linear <= vec3(0.0031308));
}
