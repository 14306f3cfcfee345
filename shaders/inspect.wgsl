// Options for seeing how it works (after terrain.wgsl, sky.wgsl and shown.wgsl): the ground in other colours, the backdrop
// tinted or unfolded. Used only where one of them is on. Mirrored by src/render/layout.rs.

struct Inspection {
    // Colours of the levels, which take turns: as they are stored in a picture.
    palette: array<vec4<f32>, 8>,
    // Turns directions of the scene to the head's axes (−z ahead).
    head_from_scene: mat4x4<f32>,
    // 0: lit, 1: normals, 2: slopes, 3: depth buffer.
    surface: u32,
    // 1: coloured by level.
    levels: u32,
    // Side of an unfolded face, as a tangent.
    face: f32,
    unused: u32,
}

@group(0) @binding(7) var<uniform> inspection: Inspection;

// Level is blue, half a rise per run green, 45 degrees yellow, twice as steep red.
fn slope_colour(steepness: f32) -> vec3<f32> {
    let low = mix(vec3(0.13, 0.25, 0.75), vec3(0.20, 0.70, 0.30), clamp(steepness * 2.0, 0.0, 1.0));
    let middle = mix(low, vec3(0.95, 0.85, 0.15), clamp(steepness * 2.0 - 1.0, 0.0, 1.0));
    return mix(middle, vec3(0.80, 0.10, 0.10), clamp(steepness - 1.0, 0.0, 1.0));
}

// White at the near plane, a 24th darker for every octave of distance.
fn depth_colour(depth: f32) -> vec3<f32> {
    return vec3(clamp(1.0 + log2(max(depth, 1e-30)) / 24.0, 0.0, 1.0));
}

@fragment
fn inspect_fragment(in: TerrainVertex) -> @location(0) vec4<f32> {
    let tile = tiles[in.tile];
    let slope = slope_at(tile, in);
    let normal = normalize(vec3(-slope.x, 1.0, -slope.y));
    let of_level = inspection.palette[tile.level % 8u].rgb;
    if inspection.surface == 0u {
        if inspection.levels != 0u {
            let light = 0.45 + 0.55 * max(dot(normal, scene.sun_direction), 0.0);
            return vec4(shown(of_level * light), 1.0);
        }
        let distance = length(in.at);
        let air = sky(in.at / distance);
        return vec4(expose(mix(lit(tile, in, slope, distance), air, haze(distance))), 1.0);
    }
    var colour: vec3<f32>;
    switch inspection.surface {
        case 1u: { colour = 0.5 + 0.5 * normal; }
        case 2u: { colour = slope_colour(length(slope)); }
        default: { colour = depth_colour(in.position.z); }
    }
    return vec4(shown(mix(colour, of_level, 0.4 * f32(inspection.levels))), 1.0);
}

// The sky as usual, with the backdrop in magenta as far as it can be seen through the air.
@fragment
fn tinted_fragment(in: SkyVertex) -> @location(0) vec4<f32> {
    let direction = normalize(in.direction);
    let behind = behind_tiles(direction);
    let seen = behind.coverage * (1.0 - air_before(direction));
    let luminance = dot(behind.light, vec3(0.2126, 0.7152, 0.0722));
    let tinted = vec3(1.5, 0.35, 1.3) * luminance;
    return vec4(expose(mix(behind.light, tinted, 0.8 * seen)), 1.0);
}

// The backdrop's faces unfolded into a cross before the head, as far away as can be: ahead of it north (−z), beside that
// west and east, beyond east south; above and below what is above and below north. Everything around them is left as it is.
@fragment
fn faces_fragment(in: SkyVertex) -> @location(0) vec4<f32> {
    let ahead = (inspection.head_from_scene * vec4(in.direction, 0.0)).xyz;
    // Faces from the left edge of the cross and from its upper edge.
    let p = vec2(2.0, 1.5) + vec2(ahead.x, ahead.y) / (vec2(-1.0, 1.0) * ahead.z * inspection.face);
    let cell = floor(p);
    let in_row = cell.y == 1.0 && cell.x >= 0.0 && cell.x < 4.0;
    let in_column = cell.x == 1.0 && cell.y >= 0.0 && cell.y < 3.0;
    if ahead.z >= 0.0 || !(in_row || in_column) {
        discard;
    }
    // To the right and upwards on the face, −1..=1.
    let a = 2.0 * (p.x - cell.x) - 1.0;
    let b = 1.0 - 2.0 * (p.y - cell.y);
    if max(abs(a), abs(b)) > 0.985 {
        return vec4(shown(vec3(1.0)), 1.0);
    }
    var direction = vec3(a, b, -1.0);
    if cell.y == 0.0 {
        direction = vec3(a, 1.0, b);
    } else if cell.y == 2.0 {
        direction = vec3(a, -1.0, -b);
    } else if cell.x == 0.0 {
        direction = vec3(-1.0, b, -a);
    } else if cell.x == 2.0 {
        direction = vec3(1.0, b, a);
    } else if cell.x == 3.0 {
        direction = vec3(-a, b, 1.0);
    }
    let baked = textureSampleLevel(backdrop_colour, smooth_sampler, direction, 0.0);
    let square = floor(8.0 * (a + 1.0)) + floor(8.0 * (b + 1.0));
    let empty = shown(vec3(0.20 + 0.06 * (square - 2.0 * floor(0.5 * square))));
    return vec4(mix(empty, expose(baked.rgb * BRIGHTEST / max(baked.a, 1e-3)), baked.a), 1.0);
}
