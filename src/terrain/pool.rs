//! Which tile is in which slot: a pure state machine that speaks slot numbers.
//!
//! A slot is given out by [`Pool::assign`], may be drawn once it is [`Pool::mark_ready`], and is taken back from
//! the tile that was wanted least recently, never from one that the current frame wants. What refills a slot comes after
//! the frames that drew it, in the order of the queue.

use super::surface::Corner;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Number of a slot in the pool.
pub type Slot = u32;

/// Mixes a tile's corner into a hash: three words, no attacker.
#[derive(Clone, Copy, Default)]
pub struct CornerHasher(u64);

impl Hasher for CornerHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u32(u32::from(byte));
        }
    }

    fn write_u32(&mut self, word: u32) {
        self.0 = (self.0.rotate_left(23) ^ u64::from(word)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
}

type CornerMap<V> = HashMap<Corner, V, BuildHasherDefault<CornerHasher>>;

#[derive(Clone, Copy, Debug)]
struct Entry {
    tile: Option<Corner>,
    ready: bool,
    /// Frame in which the tile was last wanted.
    wanted: u64,
}

/// Slots, and the tiles in them.
#[derive(Debug)]
pub struct Pool {
    entries: Vec<Entry>,
    slots: CornerMap<Slot>,
    frame: u64,
    /// Slots that may be given away in this frame, the least recently wanted last; found when first needed.
    victims: Vec<Slot>,
    victims_of: u64,
}

impl Pool {
    /// A pool of so many slots, all free.
    pub fn new(slots: u32) -> Pool {
        let free = Entry { tile: None, ready: false, wanted: 0 };
        Pool {
            entries: vec![free; slots as usize],
            slots: CornerMap::with_capacity_and_hasher(slots as usize, BuildHasherDefault::default()),
            frame: 1,
            victims: Vec::with_capacity(slots as usize),
            victims_of: 0,
        }
    }

    /// Slots there are.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// True for a pool of no slots.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Tiles in the pool.
    pub fn resident(&self) -> usize {
        self.slots.len()
    }

    /// A new frame begins: what it wants is asked for by [`Pool::want`].
    pub fn begin_frame(&mut self) {
        self.frame += 1;
    }

    /// The slot of a tile whose contents may be drawn; the tile counts as wanted in this frame.
    pub fn want(&mut self, tile: Corner) -> Option<Slot> {
        let slot = *self.slots.get(&tile)?;
        let entry = &mut self.entries[slot as usize];
        entry.wanted = self.frame;
        entry.ready.then_some(slot)
    }

    /// True if the tile has a slot, ready or on its way.
    pub fn holds(&self, tile: Corner) -> bool {
        self.slots.contains_key(&tile)
    }

    /// Gives a slot to a tile that has none. None if every slot is wanted by the current frame.
    pub fn assign(&mut self, tile: Corner) -> Option<Slot> {
        debug_assert!(!self.holds(tile));
        if self.victims_of != self.frame {
            self.find_victims();
        }
        while let Some(slot) = self.victims.pop() {
            let entry = &mut self.entries[slot as usize];
            if entry.wanted >= self.frame {
                continue; // Wanted since the victims were found.
            }
            if let Some(old) = entry.tile {
                self.slots.remove(&old);
            }
            *entry = Entry { tile: Some(tile), ready: false, wanted: self.frame };
            self.slots.insert(tile, slot);
            return Some(slot);
        }
        None
    }

    fn find_victims(&mut self) {
        let Pool { entries, victims, frame, .. } = self;
        victims.clear();
        victims.extend((0..entries.len() as Slot).filter(|&s| entries[s as usize].wanted < *frame));
        victims.sort_unstable_by_key(|&slot| std::cmp::Reverse((entries[slot as usize].wanted, slot)));
        self.victims_of = self.frame;
    }

    /// The slot's contents may be drawn from now on.
    pub fn mark_ready(&mut self, slot: Slot) {
        self.entries[slot as usize].ready = true;
    }

    /// Forgets every tile (another world).
    pub fn clear(&mut self) {
        self.slots.clear();
        self.victims_of = 0;
        for entry in &mut self.entries {
            entry.tile = None;
            entry.ready = false;
            entry.wanted = 0;
        }
    }
}
