//! Which mock answers which family of entry points. A slot is free again when its mock is gone.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use super::state::Shared;

/// Mocks that can live side by side in one process.
pub const SLOTS: usize = 32;

/// The slot of the shared library's mock, which `library` looks after: its entry points are the last ones.
pub const LIBRARY: usize = SLOTS;

static OCCUPANTS: [Mutex<Weak<Shared>>; SLOTS] = [const { Mutex::new(Weak::new()) }; SLOTS];

/// The mock in a slot, if it is alive.
pub fn occupant(slot: usize) -> Option<Arc<Shared>> {
    OCCUPANTS[slot].lock().unwrap_or_else(PoisonError::into_inner).upgrade()
}

/// The slot of a mock, which gets one if it has none yet; `None` when all are taken.
pub fn of(shared: &Arc<Shared>) -> Option<usize> {
    // One search at a time, so that a mock asked for twice at once does not get two slots.
    static SEARCH: Mutex<()> = Mutex::new(());
    let _search = SEARCH.lock().unwrap_or_else(PoisonError::into_inner);
    let taken = |slot: usize| OCCUPANTS[slot].lock().unwrap_or_else(PoisonError::into_inner).clone();
    let own = Arc::downgrade(shared);
    if let Some(slot) = (0..SLOTS).find(|slot| taken(*slot).ptr_eq(&own)) {
        return Some(slot);
    }
    let slot = (0..SLOTS).find(|slot| taken(*slot).strong_count() == 0)?;
    *OCCUPANTS[slot].lock().unwrap_or_else(PoisonError::into_inner) = own;
    Some(slot)
}
