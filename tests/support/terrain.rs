//! Random worlds, paths and viewers for the property tests of the terrain.
#![allow(dead_code, reason = "each test file uses its own part")]

use fathomless::terrain::hash::mix;
use fathomless::terrain::place::{Place, gentlest};
use fathomless::terrain::{Block, Patch, Scheme, Spine, Surface, Terrace};
use proptest::prelude::*;

/// Any surface a world file can describe.
pub fn surface() -> impl Strategy<Value = Surface> {
    let scheme = prop_oneof![Just(Scheme::Bilinear), Just(Scheme::Cubic)];
    let terrace = prop_oneof![
        1 => Just(None),
        // Risers too narrow for their period are refused, and so are they here: None.
        3 => (0u32..=4, 0.0f64..=1.0, 0.02f64..1.0).prop_map(|(p, t, w)| Terrace::new(1 << p, t, w)),
    ];
    (any::<u64>(), scheme, any::<u16>(), terrace).prop_map(|(seed, scheme, amplitude, terrace)| Surface {
        seed,
        scheme,
        amplitude,
        terrace,
        only: None,
    })
}

/// A path: steered levels (they keep slopes moderate), wild ones (any digits: slopes of hundreds), then given digits.
#[derive(Clone, Debug)]
pub struct Path {
    pub root: [u32; 2],
    pub steered: usize,
    pub wild: usize,
    pub digits: Vec<[i8; 2]>,
}

/// Deepest path that the properties try.
pub const DEEPEST: usize = 100_000;

/// Paths of up to [`DEEPEST`] levels (few of them are long) and up to `free` given digits.
pub fn path(free: usize) -> impl Strategy<Value = Path> {
    let length = || prop_oneof![60 => 0usize..64, 12 => 0usize..1_000, 1 => 0..DEEPEST];
    let wild = prop_oneof![3 => Just(0), 1 => length()];
    let digits = prop::collection::vec([-1i8..=2, -1i8..=2], 0..free);
    (any::<[u32; 2]>(), length(), wild, digits).prop_map(|(root, steered, wild, digits)| Path {
        root,
        steered,
        wild,
        digits,
    })
}

impl Path {
    /// The spine along this path.
    pub fn spine(&self, surface: Surface) -> Spine {
        let mut spine = Spine::new(surface, self.root[0], self.root[1]);
        for _ in 0..self.steered {
            spine.push(gentlest(&spine));
        }
        for i in 0..self.wild {
            let bits = mix(i as u32 ^ self.root[0]);
            spine.push([(bits & 3) as i8 - 1, (bits >> 2 & 3) as i8 - 1]);
        }
        for &digit in &self.digits {
            spine.push(digit);
        }
        spine
    }

    /// The block at its end.
    pub fn block(&self, surface: Surface) -> Block {
        self.spine(surface).bottom().block
    }

    /// The centre tile's patch at its end.
    pub fn patch(&self, surface: Surface) -> Patch {
        self.block(surface).patch(0, 0).0
    }
}

/// A place at a path's end, so many tiles above the plane.
pub fn place(surface: Surface, path: &Path, position: [f64; 3]) -> Place {
    let mut place = Place { spine: path.spine(surface), position: glam::DVec3::ZERO };
    place.walk(glam::DVec3::from_array(position));
    place
}
