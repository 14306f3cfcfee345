//! The noise value of a lattice point: a hash of (seed, level, x, z).
//!
//! Three keys are made on the way (level, row, second row key), so that a sample costs two multiplications.
//! The mixer is `lowbias32` (C. Wellons, "hash-prospector", 2018), a bijection of 32 bits with near-ideal
//! avalanche. Its twin is in `shaders/tile.wgsl`.

/// Scatters the bits of `v`; a bijection.
#[inline(always)]
pub const fn mix(v: u32) -> u32 {
    let mut h = v;
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

/// The key of one level of one world. Levels count mod 2³².
#[inline]
pub const fn level_key(seed: u64, level: u32) -> u32 {
    let low = mix(seed as u32 ^ 0x9e37_79b9);
    mix(mix(low ^ (seed >> 32) as u32).wrapping_add(level.wrapping_mul(0x9e37_79b1)))
}

/// The two keys of one row of lattice points of equal z.
#[inline(always)]
pub const fn row_keys(level_key: u32, z: u32) -> [u32; 2] {
    let first = mix(level_key ^ z);
    [first, mix(first ^ level_key.rotate_left(16))]
}

/// The noise at x in a row: uniform over −32 768..=32 767.
#[inline(always)]
pub const fn sample(row: [u32; 2], x: u32) -> i32 {
    let mut h = x ^ row[0];
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d).wrapping_add(row[1]);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    // The high half is what is used; the mixer's last xor-shift only changes the low half.
    (h as i32) >> 16
}

/// The noise of one lattice point, −32 768..=32 767.
pub const fn noise(seed: u64, level: u32, x: u32, z: u32) -> i32 {
    sample(row_keys(level_key(seed, level), z), x)
}
