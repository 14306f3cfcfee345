// Bakes tiles into the faces of the backdrop: the ground without air, and beside it the logarithm of its distance.
//
// Follows terrain.wgsl. Lengths are in tiles of the layer's level; the eye is where the layer is baked from.

// Brightest light that the backdrop's 8 bits hold; twin of BRIGHTEST in sky.wgsl.
const BAKED_BRIGHTEST: f32 = 2.0;
const NEAR: f32 = 0.25;

@vertex
fn bake_vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> TerrainVertex {
    var out = terrain(index, eye.first_tile + instance);
    let p = out.at;
    // Across, down and ahead for the faces +x −x +y −y +z −z (Vulkan specification, cube map face selection).
    var face: vec3<f32>;
    switch eye.view {
        case 0u: { face = vec3(-p.z, -p.y, p.x); }
        case 1u: { face = vec3(p.z, -p.y, -p.x); }
        case 2u: { face = vec3(p.x, p.z, p.y); }
        case 3u: { face = vec3(p.x, -p.z, -p.y); }
        case 4u: { face = vec3(p.x, -p.y, p.z); }
        default: { face = vec3(-p.x, -p.y, -p.z); }
    }
    out.position = vec4(face.xy, NEAR, face.z);
    return out;
}

struct Baked {
    @location(0) colour: vec4<f32>,
    @location(1) log_distance: f32,
}

@fragment
fn bake_fragment(in: TerrainVertex) -> Baked {
    let tile = tiles[in.tile];
    let distance = length(in.at);
    let light = lit(tile, in, slope_at(tile, in), distance);
    var out: Baked;
    out.colour = vec4(light / BAKED_BRIGHTEST, 1.0);
    out.log_distance = log2(distance) + scene.log_distance;
    return out;
}
