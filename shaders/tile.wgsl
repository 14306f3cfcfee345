// Makes tiles (after hash.wgsl): the twin of src/terrain/{hash,surface,tile}.rs, same names, same integers.
//
// One workgroup makes one tile from its 4×4 patch. The steps ping-pong in workgroup memory, the last goes straight
// to the slot; then the gradients are made from what lies there. Constants from render/layout.rs:
// STEPS, FINE_SIDE, COARSE_SIDE, FINE, COARSE, FINE_GRADIENT, COARSE_GRADIENT, SLOT_WORDS.

struct Request {
    // Residuals of the patch, points (−1..=2)², rows of equal z.
    residuals: array<i32, 16>,
    level: u32,
    x: u32,
    z: u32,
    // The patch's plane, mod 2³².
    c: u32,
    gx: u32,
    gz: u32,
    slot: u32,
    unused: u32,
}

struct Surface {
    seed_low: u32,
    seed_high: u32,
    // 0: bilinear, 1: cubic.
    scheme: u32,
    amplitude: i32,
    // 0: no terraces.
    period: u32,
    tread_fall: u32,
    riser_fall: u32,
    // The level whose noise is there alone; 0: every level's is.
    only: u32,
}

@group(0) @binding(0) var<storage, read> requests: array<Request>;
@group(0) @binding(1) var<storage, read_write> slots: array<i32>;
@group(0) @binding(2) var<uniform> surface: Surface;

const THREADS: u32 = 128u;

// Two grids: the one whose last contents are the coarse grid, and the one before it.
const BEFORE_SIDE: u32 = (1u << (STEPS - 2u)) + 3u;
const GRID_A: u32 = 0u;
const GRID_B: u32 = COARSE_SIDE * COARSE_SIDE;
var<workgroup> grids: array<i32, GRID_B + BEFORE_SIDE * BEFORE_SIDE>;

fn amplitude_of(level: u32) -> i32 {
    return select(0, surface.amplitude, surface.only == 0u || surface.only == level);
}

fn level_key(level: u32) -> u32 {
    let low = mix32(surface.seed_low ^ 0x9e3779b9u);
    return mix32(mix32(low ^ surface.seed_high) + level * 0x9e3779b1u);
}

fn row_keys(key: u32, z: u32) -> vec2<u32> {
    let first = mix32(key ^ z);
    return vec2(first, mix32(first ^ ((key << 16u) | (key >> 16u))));
}

fn sample(row: vec2<u32>, x: u32) -> i32 {
    var h = x ^ row.x;
    h ^= h >> 16u;
    h = h * 0x7feb352du + row.y;
    h ^= h >> 15u;
    h *= 0x846ca68bu;
    return bitcast<i32>(h) >> 16u;
}

fn fall(height: u32) -> i32 {
    let f = height & (surface.period - 1u);
    let g = surface.period - f;
    return bitcast<i32>(min(f * surface.tread_fall, g * surface.riser_fall) >> 12u);
}

fn at(base: u32, side: u32, x: u32, z: u32) -> i32 {
    return grids[base + z * side + x];
}

// The subdivided residual of a fine point: x and z count from the first coarse point.
fn subdivided(base: u32, side: u32, x: u32, z: u32) -> i32 {
    let k = vec2(x >> 1u, z >> 1u);
    let odd = vec2((x & 1u) == 1u, (z & 1u) == 1u);
    if surface.scheme == 0u {
        let kx = select(k.x, k.x + 1u, odd.x);
        let kz = select(k.y, k.y + 1u, odd.y);
        return (at(base, side, k.x, k.y) + at(base, side, kx, k.y)
            + at(base, side, k.x, kz) + at(base, side, kx, kz)) >> 1u;
    }
    let wx = select(vec3(1, 6, 1), vec3(0, 4, 4), odd.x);
    let wz = select(vec3(1, 6, 1), vec3(0, 4, 4), odd.y);
    var sum = 0;
    // Where the first weight is 0 the point may lie outside: take any.
    let x0 = select(k.x - 1u, k.x, odd.x);
    let z0 = select(k.y - 1u, k.y, odd.y);
    let rows = vec3(z0, k.y, k.y + 1u);
    for (var j = 0u; j < 3u; j++) {
        let z = rows[j];
        let row = wx.x * at(base, side, x0, z) + wx.y * at(base, side, k.x, z) + wx.z * at(base, side, k.x + 1u, z);
        sum += wz[j] * row;
    }
    return sum >> 5u;
}

// Residual of point i of the next grid: subdivided plus the octave.
fn next(
    i: u32, side: u32, from_base: u32, from_side: u32, key: u32, amplitude: i32, corner: vec2<u32>, c: u32, slope: vec2<u32>,
) -> i32 {
    let p = vec2(i % side, i / side);
    let r = subdivided(from_base, from_side, p.x + 1u, p.y + 1u);
    // Points begin at (−1, −1).
    let q = p - vec2(1u, 1u);
    let at = corner + q;
    var octave = (sample(row_keys(key, at.y), at.x) * amplitude) >> 15u;
    if surface.period != 0u {
        octave -= fall(c + slope.x * q.x + slope.y * q.y + bitcast<u32>(r));
    }
    return r + octave;
}

// A gradient from the residuals two spacings apart: 1/2 048 rise per run, kept in 16 bits.
fn gradient(difference: i32) -> u32 {
    return bitcast<u32>(clamp(difference >> 6u, -32768, 32767)) & 0xffffu;
}

@compute @workgroup_size(THREADS)
fn make_tiles(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let request = group.x;
    // The grid before the first step; each step goes from one to the other, and the last but one ends in A.
    var from_base = select(GRID_B, GRID_A, (STEPS & 1u) == 1u);
    var from_side = 4u;
    if thread < 16u {
        grids[from_base + thread] = requests[request].residuals[thread];
    }
    workgroupBarrier();
    var level = requests[request].level;
    var corner = vec2(requests[request].x, requests[request].z);
    var c = requests[request].c;
    let slope = vec2(requests[request].gx, requests[request].gz);
    let slot = requests[request].slot * SLOT_WORDS;

    for (var step = 1u; step < STEPS; step++) {
        level += 1u;
        corner *= 2u;
        c *= 2u;
        let side = (1u << step) + 3u;
        let base = GRID_B - from_base;
        let key = level_key(level);
        let amplitude = amplitude_of(level);
        for (var i = thread; i < side * side; i += THREADS) {
            grids[base + i] = next(i, side, from_base, from_side, key, amplitude, corner, c, slope);
        }
        workgroupBarrier();
        from_base = base;
        from_side = side;
    }

    let key = level_key(level + 1u);
    let amplitude = amplitude_of(level + 1u);
    for (var i = thread; i < FINE_SIDE * FINE_SIDE; i += THREADS) {
        slots[slot + FINE + i] = next(i, FINE_SIDE, GRID_A, COARSE_SIDE, key, amplitude, corner * 2u, c * 2u, slope);
    }
    for (var i = thread; i < COARSE_SIDE * COARSE_SIDE; i += THREADS) {
        slots[slot + COARSE + i] = grids[GRID_A + i];
    }
    storageBarrier();

    let fine = FINE_SIDE - 2u;
    for (var i = thread; i < fine * fine; i += THREADS) {
        let p = slot + FINE + (i / fine + 1u) * FINE_SIDE + i % fine + 1u;
        let dx = gradient(slots[p + 1u] - slots[p - 1u]);
        let dz = gradient(slots[p + FINE_SIDE] - slots[p - FINE_SIDE]);
        slots[slot + FINE_GRADIENT + i] = bitcast<i32>(dx | (dz << 16u));
    }
    let coarse = COARSE_SIDE - 2u;
    for (var i = thread; i < coarse * coarse; i += THREADS) {
        let p = GRID_A + (i / coarse + 1u) * COARSE_SIDE + i % coarse + 1u;
        let dx = gradient(grids[p + 1u] - grids[p - 1u]);
        let dz = gradient(grids[p + COARSE_SIDE] - grids[p - COARSE_SIDE]);
        slots[slot + COARSE_GRADIENT + i] = bitcast<i32>(dx | (dz << 16u));
    }
}
