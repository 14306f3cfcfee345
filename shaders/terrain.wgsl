// Draws the tiles: the vertex part is the twin of src/terrain/morph.rs.
//
// One instance per tile, vertices from the slot. Constants from render/layout.rs: CELLS (data cells per side), MESH
// (mesh cells per side), and the offsets of a slot's parts.

struct Tile {
    // The corner of the tile's plane, metres from the middle of the head.
    origin: vec3<f32>,
    // Side in metres.
    size: f32,
    // Rise over run of the plane.
    slope: vec2<f32>,
    slot: u32,
    // Two bits per corner: mixed, pinned weight. Bit 8: at the rim of what is baked.
    corners: u32,
    // Lattice coordinates of the corner, mod 2³².
    x: u32,
    z: u32,
    // Height of the plane's corner mod 2³², 1/65 536 tile.
    c: u32,
    level: u32,
}

@group(0) @binding(1) var<storage, read> tiles: array<Tile>;
@group(0) @binding(2) var<storage, read> slots: array<i32>;

const STRIDE: u32 = CELLS / MESH;
const GRID_VERTICES: u32 = (MESH + 1u) * (MESH + 1u);
// A skirt goes on from the edge, along the slope and then into the ground, by so many mesh cells: it lies under the
// neighbour's edge and shows through where rounding leaves a pixel open, from whatever side one looks.
const SKIRT: f32 = 0.1;
// How far into the ground, per length along the slope.
const SKIRT_DROP: f32 = 1.2;
const AT_RIM: u32 = 256u;
// A residual of the fine grid in tiles.
const UNIT: f32 = 1.0 / (65536.0 * f32(CELLS));

struct TerrainVertex {
    @builtin(position) position: vec4<f32>,
    // Centroid, here and below: where a pixel has several samples, what is shaded lies on the triangle, so within the tile.
    // Metres from the middle of the head.
    @location(0) @interpolate(perspective, centroid) at: vec3<f32>,
    // Place in the tile, 0..=1, and the weight of the coarse mesh.
    @location(1) @interpolate(perspective, centroid) uvt: vec3<f32>,
    // Height over the tile's plane's corner, in tiles.
    @location(2) @interpolate(perspective, centroid) height: f32,
    @location(3) @interpolate(flat) tile: u32,
}

fn corner_weight(corners: u32, uv: vec2<f32>, distance_weight: f32) -> f32 {
    let blend = vec4((1.0 - uv.x) * (1.0 - uv.y), uv.x * (1.0 - uv.y), (1.0 - uv.x) * uv.y, uv.x * uv.y);
    let mixed = vec4(f32(corners & 1u), f32((corners >> 2u) & 1u), f32((corners >> 4u) & 1u), f32((corners >> 6u) & 1u));
    let pinned =
        vec4(f32((corners >> 1u) & 1u), f32((corners >> 3u) & 1u), f32((corners >> 5u) & 1u), f32((corners >> 7u) & 1u));
    return (1.0 - dot(blend, mixed)) * distance_weight + dot(blend, pinned);
}

fn coarse_at(slot: u32, x: u32, z: u32) -> i32 {
    return slots[slot + COARSE + (z * STRIDE + 1u) * COARSE_SIDE + x * STRIDE + 1u];
}

fn coarse_residual(slot: u32, i: u32, j: u32) -> i32 {
    let x = i >> 1u;
    let z = j >> 1u;
    let odd = vec2(i & 1u, j & 1u);
    // The parent's edges, or the diagonal of its quad from (1, 0) to (0, 1).
    return coarse_at(slot, x + odd.x, z) + coarse_at(slot, x, z + odd.y);
}

// Vertex (i, j) of the mesh, and the side whose skirt ends there; 4: none.
fn mesh_vertex(index: u32) -> vec3<u32> {
    if index < GRID_VERTICES {
        return vec3(index % (MESH + 1u), index / (MESH + 1u), 4u);
    }
    let side = (index - GRID_VERTICES) / (MESH + 1u);
    let k = (index - GRID_VERTICES) % (MESH + 1u);
    switch side {
        case 0u: { return vec3(k, 0u, side); }
        case 1u: { return vec3(k, MESH, side); }
        case 2u: { return vec3(0u, k, side); }
        default: { return vec3(MESH, k, side); }
    }
}

// The end of a skirt, from the edge, for one that reaches out by 1.
fn skirt(side: u32, slope: vec2<f32>) -> vec3<f32> {
    let sign = select(-1.0, 1.0, (side & 1u) == 1u);
    let outwards = select(vec2(0.0, sign), vec2(sign, 0.0), side >= 2u);
    let along = normalize(vec3(outwards.x, dot(slope, outwards), outwards.y));
    let normal = normalize(vec3(-slope.x, 1.0, -slope.y));
    return along - SKIRT_DROP * normal;
}

// All but the clip position.
fn terrain(index: u32, instance: u32) -> TerrainVertex {
    let tile = tiles[instance];
    let slot = tile.slot * SLOT_WORDS;
    let v = mesh_vertex(index);
    let uv = vec2<f32>(v.xy) / f32(MESH);
    let plane = dot(tile.slope, uv);
    let p = slot + FINE + (v.y * STRIDE + 1u) * FINE_SIDE + v.x * STRIDE + 1u;
    let fine = f32(slots[p]) * UNIT;
    let coarse = f32(coarse_residual(slot, v.x, v.y)) * UNIT;
    let head = tile.origin / tile.size;
    let distance = length(head + vec3(uv.x, plane + fine, uv.y));
    let weight = clamp((distance - scene.morph_start) * scene.per_morph_length, 0.0, 1.0);
    let t = corner_weight(tile.corners, uv, weight);
    let height = plane + mix(fine, coarse, t);
    var at = tile.origin + tile.size * vec3(uv.x, height, uv.y);
    if v.z < 4u {
        let side = CELLS + 1u;
        let gradient = unpack_gradient(slots[slot + FINE_GRADIENT + v.y * STRIDE * side + v.x * STRIDE]);
        let reach = select(SKIRT / f32(MESH), scene.rim_skirt, (tile.corners & AT_RIM) != 0u);
        at += tile.size * reach * skirt(v.z, tile.slope + gradient);
    }
    var out: TerrainVertex;
    out.at = at;
    out.uvt = vec3(uv, t);
    out.height = height;
    out.tile = instance;
    return out;
}

// Both eyes in one pass.
@vertex
fn terrain_vertex(
    @builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32, @builtin(view_index) view: u32,
) -> TerrainVertex {
    var out = terrain(index, instance);
    out.position = scene.views[view].clip_from_scene * vec4(out.at, 1.0);
    return out;
}

// One eye in a pass of its own.
@vertex
fn terrain_vertex_of_eye(@builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> TerrainVertex {
    var out = terrain(index, instance);
    out.position = scene.views[eye.view].clip_from_scene * vec4(out.at, 1.0);
    return out;
}

fn unpack_gradient(word: i32) -> vec2<f32> {
    return vec2(f32((word << 16u) >> 16u), f32(word >> 16u)) * (1.0 / 2048.0);
}

// Bilinear gradient over the plane, from one of the two grids of a slot; side is its points per side.
fn gradient_at(base: u32, side: u32, uv: vec2<f32>) -> vec2<f32> {
    let p = clamp(uv, vec2(0.0), vec2(1.0)) * f32(side - 1u);
    let cell = min(vec2<u32>(p), vec2(side - 2u));
    let f = p - vec2<f32>(cell);
    let i = base + cell.y * side + cell.x;
    let a = mix(unpack_gradient(slots[i]), unpack_gradient(slots[i + 1u]), f.x);
    let b = mix(unpack_gradient(slots[i + side]), unpack_gradient(slots[i + side + 1u]), f.x);
    return mix(a, b, f.y);
}

// Smooth noise over one lattice, −1..=1: cell is the lattice point, f the place in its cell.
fn value_noise(cell: vec2<u32>, f: vec2<f32>, level: u32) -> f32 {
    let key = mix32(level * 0x9e3779b1u);
    let row = vec2(mix32(cell.y ^ key), mix32((cell.y + 1u) ^ key));
    let s = f * f * (3.0 - 2.0 * f);
    let n = vec4(
        f32(mix32(cell.x ^ row.x) >> 8u), f32(mix32((cell.x + 1u) ^ row.x) >> 8u),
        f32(mix32(cell.x ^ row.y) >> 8u), f32(mix32((cell.x + 1u) ^ row.y) >> 8u),
    ) * (2.0 / 16777216.0) - 1.0;
    return mix(mix(n.x, n.y, s.x), mix(n.z, n.w, s.x), s.y);
}

// Where a pixel is on the lattices below its tile's: x and z, and height as a third axis.
struct Ground {
    uv: vec2<f32>,
    // Height above a multiple of 256 tiles: exact, whatever the depth.
    height: f32,
    // Shares of the noise on the ground plan, on walls across x, on walls across z.
    shares: vec3<f32>,
}

fn ground(tile: Tile, in: TerrainVertex, slope: vec2<f32>) -> Ground {
    var g: Ground;
    g.uv = in.uvt.xy;
    g.height = f32(tile.c & 0xffffffu) * (1.0 / 65536.0) + in.height;
    let across = abs(slope) / max(abs(slope.x) + abs(slope.y), 1e-4);
    let wall = smoothstep(0.7, 1.5, length(slope));
    g.shares = vec3(1.0 - wall, wall * across.x, wall * across.y);
    return g;
}

// Noise of the lattice so many levels below the tile's own, without stretching on walls.
fn grain_at(tile: Tile, g: Ground, below: u32) -> f32 {
    let scale = f32(1u << below);
    let p = g.uv * scale;
    let whole = floor(p);
    let cell = vec2(tile.x << below, tile.z << below) + vec2<u32>(whole);
    let level = tile.level + below;
    var noise = 0.0;
    if g.shares.x > 0.001 {
        noise += g.shares.x * value_noise(cell, p - whole, level);
    }
    if g.shares.x < 0.999 {
        let h = g.height * scale;
        let row = floor(h);
        // Rows repeat every 256: so much of a height is known at every level.
        let up = bitcast<u32>(i32(row)) & 255u;
        let f = h - row;
        noise += g.shares.y * value_noise(vec2(cell.y, up), vec2(p.y - whole.y, f), level ^ 0x5bd1e995u);
        noise += g.shares.z * value_noise(vec2(cell.x, up), vec2(p.x - whole.x, f), level ^ 0x27d4eb2fu);
    }
    return noise;
}

// Noise of two neighbouring octaves, cross-faded: the same grain on the screen at every depth and distance.
fn grain(tile: Tile, g: Ground, octave: f32) -> f32 {
    let o = clamp(octave, 0.0, 12.0);
    let below = u32(o);
    let fade = o - f32(below);
    let first = grain_at(tile, g, below);
    let second = grain_at(tile, g, below + 1u);
    return mix(first, second, fade) / sqrt(fade * fade + (1.0 - fade) * (1.0 - fade));
}

// The colour of a stratum: h counts rounds of all colours.
fn stratum(h: f32) -> vec3<f32> {
    let p = fract(h) * f32(scene.strata_used);
    let i = min(u32(p), scene.strata_used - 1u);
    let next = select(i + 1u, 0u, i + 1u >= scene.strata_used);
    // Most of a band is one colour; its upper edge blends into the next.
    return mix(scene.strata[i].rgb, scene.strata[next].rgb, smoothstep(0.55, 1.0, p - f32(i)));
}

// Strata of two neighbouring octaves, cross-faded.
fn strata(height: f32, octave: f32, waver: f32) -> vec3<f32> {
    let lower = floor(octave);
    let h = (height * exp2(lower) + waver) * scene.strata_per_cell;
    return mix(stratum(h), stratum(2.0 * h), smoothstep(0.2, 0.8, octave - lower));
}

// What covers the ground: by steepness, with strata and grain.
fn albedo(tile: Tile, at: Ground, steepness: f32, distance: f32) -> vec3<f32> {
    // Octaves below the tile at which a lattice cell is a 32nd of the distance.
    let octave = log2(tile.size / distance) + 5.0;
    let g = grain(tile, at, octave);
    var i = 0u;
    var s = steepness;
    for (var m = 1u; m < scene.materials_used; m++) {
        let rough = 1.0 + 0.5 * g * scene.materials[m].grain;
        i = select(i, m, s * rough >= scene.materials[m].slope);
    }
    let next = min(i + 1u, scene.materials_used - 1u);
    let a = scene.materials[i];
    let b = scene.materials[next];
    let rough = 1.0 + 0.5 * g * b.grain;
    let span = max(b.slope - a.slope, 1e-3);
    let f = smoothstep(0.15, 0.85, clamp((s * rough - a.slope) / span, 0.0, 1.0));
    var colour = mix(a.colour, b.colour, f);
    if scene.strata_used > 0u {
        let share = mix(a.strata, b.strata, f);
        let bands = strata(at.height, log2(tile.size / distance) + 2.5, 0.1 * g);
        colour = mix(colour, bands, share);
    }
    return colour * (1.0 + 0.3 * g * mix(a.grain, b.grain, f));
}

// The tint of an octave of the world.
fn drift(distance: f32) -> vec3<f32> {
    let p = scene.drift_phase - log2(distance * scene.per_drift_begin) * scene.drift_per_octave;
    let n = f32(scene.drift_tints);
    let q = p - floor(p / n) * n;
    let i = min(u32(q), scene.drift_tints - 1u);
    let next = select(i + 1u, 0u, i + 1u >= scene.drift_tints);
    return mix(scene.tints[i].rgb, scene.tints[next].rgb, q - f32(i));
}

fn slope_at(tile: Tile, in: TerrainVertex) -> vec2<f32> {
    let slot = tile.slot * SLOT_WORDS;
    let fine = gradient_at(slot + FINE_GRADIENT, FINE_SIDE - 2u, in.uvt.xy);
    let coarse = gradient_at(slot + COARSE_GRADIENT, COARSE_SIDE - 2u, in.uvt.xy);
    return tile.slope + mix(fine, coarse, clamp(in.uvt.z, 0.0, 1.0));
}

// The ground in the light of sun and sky, without air.
fn lit(tile: Tile, in: TerrainVertex, slope: vec2<f32>, distance: f32) -> vec3<f32> {
    let normal = normalize(vec3(-slope.x, 1.0, -slope.y));
    let base = albedo(tile, ground(tile, in, slope), length(slope), distance) * drift(distance);
    let sun = max(dot(normal, scene.sun_direction), 0.0);
    // The sky above the surface, and the light that the ground throws back from below.
    let up = 0.5 + 0.5 * normal.y;
    let from_sky = mix(scene.sky_horizon, scene.sky_zenith, up) * up;
    let from_ground = base * scene.sun_colour * scene.sun_direction.y * (1.0 - up) * 0.35;
    return base * (scene.sun_colour * sun + from_sky * scene.sky_strength + from_ground);
}

@fragment
fn terrain_fragment(in: TerrainVertex) -> @location(0) vec4<f32> {
    let tile = tiles[in.tile];
    let slope = slope_at(tile, in);
    if scene.flat_shading != 0u {
        return vec4(vec3(0.2 + 0.6 * inverseSqrt(1.0 + dot(slope, slope))), 1.0);
    }
    let distance = length(in.at);
    let air = sky(in.at / distance);
    return vec4(expose(mix(lit(tile, in, slope, distance), air, haze(distance))), 1.0);
}
