//! Several threads call the functions of one instance at once.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::{
    collections::HashMap,
    sync::{Arc, Barrier},
    thread,
};

use fathomless::mock::{Mock, function_names};

use super::{Arena, Dice, graphics::Vulkan};
use crate::{Any, BACK, Handle, Kind, PROGRESS, Run, Seen};

const THREADS: u64 = 3;

/// What a thread knows when it starts.
struct Start<'a> {
    mock: &'a Mock,
    vulkan: &'a Arc<Vulkan>,
    functions: &'a HashMap<&'static str, Any>,
    offered: &'a [String],
    living: &'a [Handle],
    foreign: u64,
    paths: &'a HashMap<(u64, String), u64>,
    system: u64,
    time: i64,
    waited: &'a [u64],
    seed: u64,
    tell: bool,
    graphics: bool,
}

/// What it leaves: what it saw, and the handles it knows.
type Left = (Seen, Vec<Handle>, Vec<(Kind, u64)>);

impl Start<'_> {
    /// One thread's part. The first one waits for frames; any may begin and end them.
    fn go(&self, thread: u64) -> Left {
        let mut seen = Seen::default();
        BACK.set(self.functions.get("xrEnumerateApiLayerProperties").copied());
        let mut run = Run {
            seen: &mut seen,
            vulkan: Arc::clone(self.vulkan),
            mock: self.mock.clone(),
            functions: self.functions.clone(),
            offered: self.offered.to_vec(),
            dice: Dice::new(self.seed.wrapping_mul(THREADS).wrapping_add(thread).wrapping_add(1 << 40)),
            arena: Arena::default(),
            seed: self.seed,
            tell: self.tell,
            graphics: self.graphics,
            progress: &PROGRESS,
            waits: thread == 0,
            shares: true,
            nonsense: 0,
            living: self.living.to_vec(),
            dead: Vec::new(),
            foreign: self.foreign,
            paths: self.paths.clone(),
            system: self.system,
            time: self.time,
            waited: self.waited.to_vec(),
            names: thread as u32 * 1_000_000,
            bad_subject: false,
            doomed: false,
            created: None,
        };
        let names: Vec<_> = function_names().collect();
        let most = 30 + run.dice.below(100);
        run.go_on(&names, most);
        let (living, dead) = (run.living, run.dead);
        (seen, living, dead)
    }
}

/// One sequence. Whether the calls of the threads came between each other.
pub fn play(seen: &mut Seen, vulkan: &Arc<Vulkan>, foreign: u64, seed: u64, tell: bool) -> bool {
    let mut run = Run::new(seen, Arc::clone(vulkan), foreign, seed, tell);
    run.begin_well();
    let start = Start {
        mock: &run.mock,
        vulkan,
        functions: &run.functions,
        offered: &run.offered,
        living: &run.living,
        foreign,
        paths: &run.paths,
        system: run.system,
        time: run.time,
        waited: &run.waited,
        seed,
        tell,
        graphics: run.graphics,
    };
    let gate = Barrier::new(THREADS as usize);
    let go = |thread| {
        gate.wait();
        start.go(thread)
    };
    let left: Vec<Left> = thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS).map(|thread| scope.spawn(move || go(thread))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    let log = run.mock.log();
    let turns = log.windows(2).filter(|pair| pair[0].thread != pair[1].thread).count();
    // What any thread has destroyed is dead, though others still think it alive.
    for (seen, living, dead) in left {
        run.seen.add(seen);
        let known: Vec<u64> = run.living.iter().map(|it| it.raw).collect();
        run.living.extend(living.into_iter().filter(|it| !known.contains(&it.raw)));
        run.dead.extend(dead);
    }
    for (_, raw) in run.dead.clone() {
        run.bury(raw);
    }
    run.dead.sort_by_key(|(_, raw)| *raw);
    run.dead.dedup_by_key(|(_, raw)| *raw);
    run.end();
    run.next_application();
    turns > THREADS as usize
}
