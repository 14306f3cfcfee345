//! Handles: numbers that say nothing about memory. Each names a kind, a slot and the slot's generation, scrambled
//! with a salt of its mock, so a handle that is stale, of another kind, of another mock or invented is recognised.

use std::{
    marker::PhantomData,
    sync::atomic::{AtomicU64, Ordering},
};

use openxr::sys::{self, Handle};

use super::fault::{Outcome, misuse};

/// What a handle names; the number is its tag inside the handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// `XrInstance`
    Instance = 1,
    /// `XrSession`
    Session,
    /// `XrSwapchain`
    Swapchain,
    /// `XrSpace`
    Space,
    /// `XrActionSet`
    ActionSet,
    /// `XrAction`
    Action,
    /// `XrHandTrackerEXT`
    HandTracker,
    /// `XrDebugUtilsMessengerEXT`
    Messenger,
}

impl Kind {
    const ALL: [Self; 8] = [
        Self::Instance,
        Self::Session,
        Self::Swapchain,
        Self::Space,
        Self::ActionSet,
        Self::Action,
        Self::HandTracker,
        Self::Messenger,
    ];

    /// The handle type's name in the C header.
    pub fn name(self) -> &'static str {
        match self {
            Self::Instance => "XrInstance",
            Self::Session => "XrSession",
            Self::Swapchain => "XrSwapchain",
            Self::Space => "XrSpace",
            Self::ActionSet => "XrActionSet",
            Self::Action => "XrAction",
            Self::HandTracker => "XrHandTrackerEXT",
            Self::Messenger => "XrDebugUtilsMessengerEXT",
        }
    }

    fn from_tag(tag: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == tag)
    }
}

/// A handle type of the API, with the kind it names.
pub trait Named: Handle {
    const KIND: Kind;
}

macro_rules! named {
    ($($name:ident)*) => { $(impl Named for sys::$name { const KIND: Kind = Kind::$name; })* };
}
named!(Instance Session Swapchain Space ActionSet Action);

impl Named for sys::DebugUtilsMessengerEXT {
    const KIND: Kind = Kind::Messenger;
}

impl Named for sys::HandTrackerEXT {
    const KIND: Kind = Kind::HandTracker;
}

static SALTS: AtomicU64 = AtomicU64::new(1);

/// Leaves some salts out, so that those to come are not those of another copy of this code.
pub fn skip_salts(count: u64) {
    SALTS.fetch_add(count, Ordering::Relaxed);
}

/// A number no other table family of this process has; deterministic, so that failures repeat.
pub fn fresh_salt() -> u64 {
    let mut x = SALTS.fetch_add(1, Ordering::Relaxed).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

const FACTOR: u64 = 0xD6E8_FEB8_6659_FD93;
const FACTOR_INVERSE: u64 = inverse(FACTOR);
const INDEX_BITS: u32 = 24;

/// Multiplicative inverse modulo 2^64 of an odd number (Newton: each step doubles the bits that are right).
const fn inverse(odd: u64) -> u64 {
    let mut x = odd;
    let mut step = 0;
    while step < 6 {
        x = x.wrapping_mul(2u64.wrapping_sub(odd.wrapping_mul(x)));
        step += 1;
    }
    x
}

fn scramble(plain: u64, salt: u64) -> u64 {
    let x = plain ^ salt;
    let x = (x ^ (x >> 32)).wrapping_mul(FACTOR);
    x ^ (x >> 32)
}

fn unscramble(raw: u64, salt: u64) -> u64 {
    let x = raw ^ (raw >> 32);
    let x = x.wrapping_mul(FACTOR_INVERSE);
    (x ^ (x >> 32)) ^ salt
}

struct Slot<T> {
    /// Counts the objects that lived here; part of the handle.
    generation: u32,
    object: Option<T>,
}

/// All objects of one kind in one mock.
pub struct Table<H, T> {
    salt: u64,
    slots: Vec<Slot<T>>,
    free: Vec<u32>,
    handles: PhantomData<fn() -> H>,
}

impl<H: Named, T> Table<H, T> {
    pub fn new(salt: u64) -> Self {
        Self { salt, slots: Vec::new(), free: Vec::new(), handles: PhantomData }
    }

    fn handle(&self, index: usize) -> H {
        let plain =
            (H::KIND as u64) << 56 | u64::from(self.slots[index].generation) << INDEX_BITS | index as u64;
        H::from_raw(scramble(plain, self.salt))
    }

    /// `None` when the table is full (2^24 live objects).
    pub fn insert(&mut self, object: T) -> Option<H> {
        let index = match self.free.pop() {
            Some(index) => index as usize,
            None if self.slots.len() >> INDEX_BITS != 0 => return None,
            None => {
                self.slots.push(Slot { generation: 1, object: None });
                self.slots.len() - 1
            }
        };
        if self.handle(index).into_raw() == 0 {
            self.slots[index].generation += 1;
        }
        self.slots[index].object = Some(object);
        Some(self.handle(index))
    }

    fn index(&self, handle: H) -> Option<usize> {
        let plain = unscramble(handle.into_raw(), self.salt);
        let index = (plain & ((1 << INDEX_BITS) - 1)) as usize;
        let generation = (plain >> INDEX_BITS) as u32;
        let slot = self.slots.get(index)?;
        ((plain >> 56) as u8 == H::KIND as u8 && slot.generation == generation && slot.object.is_some())
            .then_some(index)
    }

    pub fn get(&self, handle: H) -> Outcome<&T> {
        self.index(handle)
            .and_then(|index| self.slots[index].object.as_ref())
            .ok_or_else(|| misuse(sys::Result::ERROR_HANDLE_INVALID, self.diagnosis(handle)))
    }

    pub fn get_mut(&mut self, handle: H) -> Outcome<&mut T> {
        match self.index(handle) {
            Some(index) => self.slots[index].object.as_mut(),
            None => None,
        }
        .ok_or_else(|| misuse(sys::Result::ERROR_HANDLE_INVALID, diagnosis(handle, self.salt)))
    }

    pub fn remove(&mut self, handle: H) -> Outcome<T> {
        let index = self.index(handle);
        let object = index.and_then(|index| self.slots[index].object.take());
        let (Some(index), Some(object)) = (index, object) else {
            return Err(misuse(sys::Result::ERROR_HANDLE_INVALID, self.diagnosis(handle)));
        };
        // A slot whose generations are used up is retired: a handle value never comes back.
        if self.slots[index].generation < u32::MAX - 1 {
            self.slots[index].generation += 1;
            self.free.push(index as u32);
        }
        Ok(object)
    }

    pub fn iter(&self) -> impl Iterator<Item = (H, &T)> {
        self.slots
            .iter()
            .enumerate()
            .filter_map(|(index, slot)| Some((self.handle(index), slot.object.as_ref()?)))
    }

    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.slots.iter_mut().filter_map(|slot| slot.object.as_mut())
    }

    pub fn is_empty(&self) -> bool {
        self.slots.iter().all(|slot| slot.object.is_none())
    }

    /// The handles of the objects that satisfy a predicate.
    pub fn handles_where(&self, mut predicate: impl FnMut(&T) -> bool) -> Vec<H> {
        self.iter().filter(|(_, object)| predicate(object)).map(|(handle, _)| handle).collect()
    }

    fn diagnosis(&self, handle: H) -> String {
        diagnosis(handle, self.salt)
    }
}

fn diagnosis<H: Named>(handle: H, salt: u64) -> String {
    let (raw, wanted) = (handle.into_raw(), H::KIND.name());
    let plain = unscramble(raw, salt);
    match Kind::from_tag((plain >> 56) as u8) {
        _ if raw == 0 => format!("{wanted} is XR_NULL_HANDLE"),
        Some(kind) if kind == H::KIND => {
            format!("{wanted} {raw:#x} was destroyed or is invented")
        }
        Some(kind) => format!("{raw:#x} is no {wanted}; it looks like an {}", kind.name()),
        None => format!("{wanted} {raw:#x} was never made by this runtime"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scrambling_is_reversible() {
        for (plain, salt) in [(0, 0), (1, 7), (u64::MAX, 3), (0x0123_4567_89AB_CDEF, 99)] {
            assert_eq!(unscramble(scramble(plain, salt), salt), plain);
        }
    }

    #[test]
    fn a_handle_value_never_comes_back() {
        let mut table = Table::<sys::Space, u32>::new(fresh_salt());
        let mut seen = std::collections::HashSet::new();
        for round in 0..1_000 {
            let handle = table.insert(round).unwrap_or(sys::Space::NULL);
            assert!(seen.insert(handle.into_raw()));
            assert_eq!(table.get(handle).ok().copied(), Some(round));
            assert!(table.remove(handle).is_ok());
            assert!(table.get(handle).is_err());
        }
        assert!(table.is_empty());
    }
}
