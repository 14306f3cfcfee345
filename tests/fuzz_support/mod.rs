//! Numbers that look random and memory that ends where it should: what sequences of calls are made of.
#![allow(unsafe_code, reason = "memory for raw calls")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

mod arguments;
pub mod graphics;
mod structures;
pub mod threads;

use std::{
    alloc::{Layout, alloc_zeroed, dealloc},
    ffi::c_char,
};

/// A sequence of numbers that a seed determines (SplitMix64).
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0xA24B_AED4_963E_E407) ^ 0x5851_F42D_4C95_7F2D)
    }

    pub fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ (x >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.word() % n.max(1) as u64) as usize
    }

    /// Once in so many times.
    pub fn once_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }
}

/// Memory lent to one call. Each piece is exactly as large as asked for, so that an address sanitizer sees every step
/// past an end.
#[derive(Default)]
pub struct Arena {
    pieces: Vec<(*mut u8, Layout)>,
}

impl Arena {
    /// Zeroed bytes, aligned for anything in the API.
    pub fn bytes(&mut self, size: usize) -> *mut u8 {
        let layout = Layout::from_size_align(size.max(1), 16).unwrap();
        // SAFETY: the size is not zero.
        let piece = unsafe { alloc_zeroed(layout) };
        assert!(!piece.is_null(), "out of memory");
        self.pieces.push((piece, layout));
        piece
    }

    pub fn array<T: Copy>(&mut self, values: &[T]) -> *mut T {
        let place = self.bytes(size_of_val(values)).cast::<T>();
        // SAFETY: the piece has room for the values, and nobody else knows of it.
        unsafe { place.copy_from_nonoverlapping(values.as_ptr(), values.len()) };
        place
    }

    pub fn put<T: Copy>(&mut self, value: T) -> *mut T {
        self.array(&[value])
    }

    /// Bytes with a terminator.
    pub fn text(&mut self, bytes: &[u8]) -> *mut c_char {
        let place = self.bytes(bytes.len() + 1);
        // SAFETY: the piece has room for the bytes and is zeroed after them.
        unsafe { place.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len()) };
        place.cast()
    }
}

impl Drop for Arena {
    fn drop(&mut self) {
        for (piece, layout) in &self.pieces {
            // SAFETY: allocated above with this layout, freed only here.
            unsafe { dealloc(*piece, *layout) };
        }
    }
}
