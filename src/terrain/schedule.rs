//! What to bake next, and how fast: the two cubemaps of the backdrop, and the layers that each holds.
//!
//! The cubemap *in use* is seen; the *spare* one is on its way to be. Each holds layers far to near and can only be
//! added to at its near end, or begun anew.
//!
//! - Inwards, the next layer goes over those in use: until it is whole, live tiles cover what it shows.
//! - Outwards, a layer cannot be taken away again. So the spare is kept [`TRAIL`] levels farther than the one in use,
//!   and takes over when that shows what has become too near; live tiles cover the levels between. By the time
//!   they are used up, the other one has been begun anew, as much farther again.
//! - Sideways, the nearest layers leave their bound first. The spare, whose layers are larger, gets the levels that it
//!   is behind, from where the viewer is now, and takes over.
//!
//! Where all that cannot be in time, [`Schedule::headroom`] says how much slower the viewer must go.

use super::backdrop::{Ladder, LayerId};
use super::place::START_LEVEL;
use glam::DVec3;

/// Levels by which the spare is farther than the one in use.
pub const TRAIL: usize = 3;

/// Levels that the spare may be behind when it takes over.
const SPARE_LEVELS: usize = 3;

/// Most levels that live tiles cover beyond the usual, where a backdrop is farther than wanted: one may be added while the
/// viewer comes to a stop.
pub const MOST_EXTRA: usize = SPARE_LEVELS + 1;

/// Layers beyond the air that a cubemap begins with: so many octaves can be climbed without missing any.
const FAR_SLACK: usize = 3;

/// So many times its bound a layer may be shown while the viewer slows down.
const FAR_BEYOND: f64 = 2.0;

/// Share of its bound from which on a layer is replaced, and the share that this must win.
const STALE: f64 = 0.55;
const WIN: f64 = 0.15;

/// Share of its bound at which the spare takes over, and at which the viewer stands still until there is one.
const DUE: f64 = 0.9;
const STOP: f64 = 0.93;

/// The share of what is really allowed that [`Want::bound`] should be: sudden turns may go so far beyond it.
pub const SUDDEN: f64 = 0.8;

/// Bakes are planned to be whole in this share of the time there is.
const MARGIN: f64 = 0.85;

/// How much faster a dive bakes where it is a little behind.
const MOST_BACKLOG: f64 = 0.06;

/// Frames in which the spare is made where nothing asks for it.
const LEISURE: f64 = 180.0;

/// Frames that it takes to have the tiles at hand that a farther backdrop leaves to be drawn.
const FETCH: f64 = 12.0;

/// Octaves per frame below which a viewer neither falls nor climbs.
const STILL: f64 = 1e-5;

/// The least that [`Schedule::headroom`] says while something is being baked: it must not stand still for ever.
const CRAWL: f64 = 0.01;

/// Layers that are remembered at least: more than are ever wanted.
const KEPT: usize = 64;

/// What a viewer needs of a backdrop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Want {
    /// Level of the nearest layer that shows no parallax.
    pub nearest: usize,
    /// Level of the farthest layer that the air leaves visible.
    pub farthest: usize,
    /// Least level that a layer can have.
    pub least: usize,
    /// Levels from a layer down to the tile it is baked above.
    pub lag: usize,
    /// The farthest that a viewer may be from where a layer was baked, in tiles of its key.
    pub bound: f64,
    /// Exactly the layers of the place, whatever it takes; else any within their bounds.
    pub exact: bool,
    /// Octaves below the start.
    pub depth: f64,
}

impl Want {
    /// Octaves that he is deeper than his anchor, 0 to 1.
    fn beyond_anchor(&self) -> f64 {
        (self.depth + START_LEVEL as f64 - (self.nearest + self.lag) as f64).clamp(0.0, 1.0)
    }
}

/// A layer to be baked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Task {
    /// Into which cubemap.
    pub cube: usize,
    /// What to bake.
    pub id: LayerId,
    /// The cubemap is cleared first.
    pub first: bool,
}

#[derive(Debug, Default)]
struct Stack {
    /// Levels without a gap, far to near.
    layers: Vec<LayerId>,
    /// The next one, if parts of it are in the texels already.
    begun: Option<LayerId>,
}

impl Stack {
    fn nearest(&self) -> Option<usize> {
        self.layers.last().map(|layer| layer.level)
    }

    /// What it is good for from where the viewer is.
    fn sight(&self, ladder: &Ladder, want: &Want, drift: f64) -> Sight {
        let canonical = |level: usize| ladder.id(level, want.lag);
        let takes = match (self.begun, self.nearest()) {
            // Not over parts of another layer.
            (Some(begun), Some(level)) => {
                (want.farthest..want.nearest).contains(&level) && begun == canonical(level + 1)
            }
            (Some(_), None) => false,
            (None, _) => true,
        };
        let out = Sight { used: None, stale: true, takes, frames: 0.0, octaves: 0.0 };
        let (Some(first), Some(nearest)) = (self.layers.first(), self.nearest()) else { return out };
        let spoilt = want.exact && self.begun.is_some() && !takes;
        // One that has been begun reaches so far only beyond the air.
        let elsewhere = first.level > want.farthest || nearest + 2 * MOST_EXTRA < want.farthest;
        if elsewhere || spoilt || want.exact && nearest > want.nearest {
            return out;
        }
        let share = |layer: &LayerId| ladder.moved(layer, want.lag) / want.bound;
        // A climb comes to the end of the layers, too.
        let octaves = (want.farthest - first.level) as f64 + want.beyond_anchor();
        let mut sight = Sight { used: Some(0.0), stale: false, takes, frames: f64::INFINITY, octaves };
        // A climb takes him away from all points alike; the layers' tiles are twice as large each.
        let away = self.layers.last().map_or(1.0, share).max(0.1);
        for (i, layer) in
            self.layers.iter().rev().take_while(|layer| layer.level >= want.farthest).enumerate()
        {
            let fresh = (layer.level <= want.nearest).then(|| canonical(layer.level));
            if want.exact && Some(*layer) != fresh {
                return out;
            }
            let (used, larger) = (share(layer), (i as f64).exp2());
            let left = (STOP - used).max(0.0);
            sight.used = sight.used.map(|most: f64| most.max(used));
            sight.octaves = sight.octaves.min((1.0 + left * larger / away).log2());
            if used > STALE && fresh.is_none_or(|fresh| used > share(&fresh) + WIN) {
                sight.stale = true;
                if drift > 0.0 {
                    sight.frames = sight.frames.min(left * larger / drift);
                }
            }
        }
        sight
    }
}

/// What a cubemap is good for, from where the viewer is.
#[derive(Clone, Copy, Debug, Default)]
struct Sight {
    /// The greatest share of its bound that a visible layer has used up; None where it cannot be shown from here.
    used: Option<f64>,
    /// A layer is on its way out of its bound, and one baked from here would be better.
    stale: bool,
    /// The next layer may go over those that are there.
    takes: bool,
    /// Frames until a layer leaves its bound, if the viewer goes on as he does.
    frames: f64,
    /// Octaves that he can climb until then.
    octaves: f64,
}

/// The layers of both cubemaps, what is being baked, and how the viewer moves.
#[derive(Debug)]
pub struct Schedule {
    stacks: [Stack; 2],
    front: usize,
    running: Option<Task>,
    want: Option<Want>,
    sights: [Sight; 2],
    /// The layer that is being baked will do from here.
    running_is_good: bool,
    /// Tiles of this level and deeper can be drawn at once.
    at_hand: Option<usize>,
    /// See [`Schedule::is_hasty`].
    hasty: bool,
    /// Octaves that the viewer falls in a frame, smoothed.
    falling: f64,
    /// Share of its bound that the nearest layer in use loses in a frame, smoothed, and what it had used up.
    drift: f64,
    nearest_used: Option<(LayerId, f64)>,
    /// The way that the viewer goes in a frame, smoothed, in tiles of the nearest layer's key, and where he was.
    pace: DVec3,
    was: Option<(LayerId, DVec3)>,
    /// What [`Schedule::headroom`] said, and the same smoothed as `falling` is: he moves so much slower than he would.
    slowed: [f64; 2],
    /// Texels of a layer, smoothed.
    layer_texels: f64,
}

impl Default for Schedule {
    fn default() -> Schedule {
        Schedule {
            stacks: Default::default(),
            front: 0,
            running: None,
            want: None,
            sights: Default::default(),
            running_is_good: false,
            at_hand: None,
            hasty: false,
            falling: 0.0,
            drift: 0.0,
            nearest_used: None,
            pace: DVec3::ZERO,
            was: None,
            slowed: [1.0; 2],
            layer_texels: 0.0,
        }
    }
}

impl Schedule {
    /// Index of the cubemap in use.
    pub fn front(&self) -> usize {
        self.front
    }

    fn spare(&self) -> usize {
        1 - self.front
    }

    /// The layers of the cubemap in use, far to near.
    pub fn layers(&self) -> &[LayerId] {
        &self.stacks[self.front].layers
    }

    /// Level of the nearest whole layer in use: live tiles begin at the next one. None: nothing is shown.
    pub fn nearest(&self) -> Option<usize> {
        let wanted = self.want.is_some_and(|want| want.nearest >= want.least);
        self.stacks[self.front].nearest().filter(|_| wanted)
    }

    /// Level from which on tiles should be at hand, where live ones will begin there soon.
    pub fn prefetch_from(&self) -> Option<usize> {
        let soon = self.climbs() || self.is_stale() || self.used().is_none_or(|used| used > STALE);
        self.will_do().filter(|_| soon).map(|level| level + 1)
    }

    /// All tiles from this level on are at hand, as of this frame; None: not those that [`Schedule::prefetch_from`] asks for.
    pub fn set_at_hand(&mut self, from: Option<usize>) {
        self.at_hand = from;
    }

    /// The spare has taken over in this frame before the tiles that it leaves to be drawn were at hand: as it may where a
    /// viewer does not slow down.
    pub fn is_hasty(&self) -> bool {
        self.hasty
    }

    /// The share of its bound that the cubemap in use has used up: above 1 the viewer has been too fast. None: it cannot
    /// be shown from here.
    pub fn used(&self) -> Option<f64> {
        self.sights[self.front].used
    }

    /// Begins a frame: sees how the viewer moves. True if the spare took over.
    pub fn begin_frame(&mut self, ladder: &Ladder, want: &Want) -> bool {
        if let Some(old) = self.want.replace(*want) {
            let fallen = want.depth - old.depth;
            if fallen.abs() > 1.0 {
                (self.falling, self.drift, self.slowed) = (0.0, 0.0, [1.0; 2]);
                (self.pace, self.was) = (DVec3::ZERO, None);
            }
            self.falling += 0.2 * (fallen.clamp(-1.0, 1.0) - self.falling);
            self.slowed[1] += 0.2 * (self.slowed[0] - self.slowed[1]);
        }
        let nearest = self.layers().last().filter(|_| want.nearest >= want.least).copied();
        let now = nearest.map(|layer| (layer, ladder.moved(&layer, want.lag) / want.bound));
        if let (Some((layer, now)), Some((before, then))) = (now, self.nearest_used)
            && layer == before
        {
            self.drift += 0.2 * ((now - then).clamp(-0.2, 0.2) - self.drift);
        }
        self.nearest_used = now;
        let here = nearest.and_then(|layer| Some((layer, ladder.way(&layer, want.lag)?)));
        if let (Some((layer, here)), Some((before, was))) = (here, self.was)
            && layer == before
        {
            self.pace += 0.2 * (here - was - self.pace);
        }
        self.was = here;
        self.hasty = false;
        self.look(ladder);
        self.take_over(ladder)
    }

    /// The way that the viewer goes in a frame, smoothed, in tiles of the level that comes with it.
    pub fn pace(&self) -> (DVec3, usize) {
        let lag = self.want.map_or(0, |want| want.lag);
        self.was.map_or((DVec3::ZERO, 0), |(layer, _)| (self.pace, layer.level + lag))
    }

    /// What is there, seen from where the viewer is.
    fn look(&mut self, ladder: &Ladder) {
        let Some(want) = &self.want else { return };
        if want.nearest < want.least {
            (self.sights, self.running_is_good) = ([Sight::default(); 2], false);
            return;
        }
        self.sights = [0, 1].map(|i| self.stacks[i].sight(ladder, want, self.drift));
        self.running_is_good = self.running.is_some_and(|task| {
            let next = self.stacks[task.cube].nearest().is_none_or(|level| level + 1 == task.id.level);
            let near = task.id.level <= want.nearest && task.id.level >= want.least;
            let base = task.first || self.sights[task.cube].used.is_some();
            let moved = ladder.moved(&task.id, want.lag);
            let canonical = || moved.is_finite() && task.id == ladder.id(task.id.level, want.lag);
            next && near && base && (canonical() || !want.exact && moved <= want.bound)
        });
    }

    /// The spare takes over where the one in use is of no use any more, or it is the better one.
    fn take_over(&mut self, ladder: &Ladder) -> bool {
        let Some(want) = &self.want else { return false };
        let spare = self.spare();
        let (Some(used), Some(level)) = (self.sights[spare].used, self.stacks[spare].nearest()) else {
            return false;
        };
        // One that is nearer than wanted is as good while it is within its bound.
        let extra = want.nearest.saturating_sub(level);
        // Live tiles will begin behind its nearest layer, however near that is to what is wanted.
        let nearer = self.nearest().is_some_and(|front| level >= front);
        let at_hand = nearer || self.at_hand.is_some_and(|from| from <= level + 1);
        let better = match self.used() {
            None if want.exact => extra == 0,
            None => extra <= SPARE_LEVELS,
            Some(_) if want.exact => false,
            Some(now) if now > DUE => extra <= SPARE_LEVELS && used < now && (at_hand || now > 1.0),
            Some(_) => self.is_stale() && extra == 0 && !self.sights[spare].stale && at_hand,
        };
        if better {
            self.front = spare;
            self.hasty = !at_hand;
            self.nearest_used = None;
            self.look(ladder);
        }
        better
    }

    /// True where nothing that is there can be shown: everything is to be baked at once.
    pub fn is_lost(&self) -> bool {
        let Some(want) = &self.want else { return true };
        if want.nearest < want.least {
            return false;
        }
        let far = self.nearest().is_none_or(|level| level + MOST_EXTRA < want.nearest);
        far || self.used().is_none_or(|used| used > FAR_BEYOND)
    }

    fn falls(&self) -> bool {
        self.falling > STILL
    }

    fn climbs(&self) -> bool {
        self.falling < -STILL
    }

    /// Whether the one in use is on its way out of its bound and one baked from here would be better, or it lacks a layer
    /// that cannot be added.
    fn is_stale(&self) -> bool {
        let sight = self.sights[self.front];
        let lacks = || self.want.is_some_and(|want| self.nearest().is_none_or(|level| level < want.nearest));
        sight.stale || !sight.takes && lacks()
    }

    /// The level of the spare's nearest layer, if it can take over where the one in use ends.
    fn will_do(&self) -> Option<usize> {
        self.sights[self.spare()].used?;
        let level = self.stacks[self.spare()].nearest()?;
        let farther = self.nearest().is_none_or(|front| level < front);
        let near = self.want.is_some_and(|want| level + SPARE_LEVELS + 1 >= want.nearest);
        (farther && near).then_some(level)
    }

    /// The level that the spare should reach.
    fn goal(&self, want: &Want) -> usize {
        if want.exact || self.is_stale() {
            return want.nearest;
        }
        self.nearest().unwrap_or(want.nearest).min(want.nearest).saturating_sub(TRAIL).max(want.least)
    }

    /// The spare's nearest layer, if it can be added to until the goal. None: it is to be begun anew.
    fn spare_level(&self) -> Option<usize> {
        let spare = self.spare();
        let sight = self.sights[spare];
        let level = self.stacks[spare].nearest().filter(|_| sight.used.is_some() && sight.takes)?;
        // What has been in use before may be as far out of its bound, or nearer than what is in use now.
        let farther = self.nearest().is_none_or(|front| level < front);
        let good = !sight.stale && (farther || self.is_stale());
        good.then_some(level)
    }

    /// Where a cubemap begins that is used until the nearest layer wanted is of level `goal`, and a climb from there on.
    fn far_end(&self, want: &Want, goal: usize) -> usize {
        let farther = want.nearest.saturating_sub(goal).max(SPARE_LEVELS) + FAR_SLACK;
        want.farthest.saturating_sub(farther).max(want.least).min(goal)
    }

    /// Which cubemap is to have which level next, cleared first or not.
    fn choose(&self) -> Option<(usize, usize, bool)> {
        let want = self.want.as_ref().filter(|want| want.nearest >= want.least)?;
        if let (Some(_), Some(level)) = (self.used(), self.nearest())
            && (want.exact || !self.climbs())
            && level < want.nearest
            && self.sights[self.front].takes
        {
            return Some((self.front, level + 1, false));
        }
        if want.exact && self.used().is_some() && self.nearest() == Some(want.nearest) {
            return None;
        }
        let goal = self.goal(want);
        match self.spare_level() {
            Some(level) => (level < goal).then_some((self.spare(), level + 1, false)),
            None => Some((self.spare(), self.far_end(want, goal), true)),
        }
    }

    /// The layer to bake now, and whether it is a new one. None: nothing is left.
    pub fn next(&mut self, ladder: &Ladder) -> Option<(Task, bool)> {
        if let Some(task) = self.running.filter(|_| self.running_is_good) {
            return Some((task, false));
        }
        self.running = None;
        let (cube, level, first) = self.choose()?;
        let id = ladder.id(level, self.want?.lag);
        let task = Task { cube, id, first };
        let stack = &mut self.stacks[cube];
        if first {
            stack.layers.clear();
        }
        stack.begun = Some(id);
        self.running = Some(task);
        self.look(ladder);
        Some((task, true))
    }

    /// The layer that was being baked is whole; it took so many texels. True if the cubemap in use shows more than it did.
    pub fn finish(&mut self, texels: f64, ladder: &Ladder) -> bool {
        let Some(task) = self.running.take() else { return false };
        let stack = &mut self.stacks[task.cube];
        stack.begun = None;
        stack.layers.push(task.id);
        if stack.layers.len() > 4 * KEPT {
            // A dive goes on for ever: what is known of far layers, beyond all haze, is forgotten.
            stack.layers.drain(..3 * KEPT);
        }
        self.layer_texels = match self.layer_texels {
            0.0 => texels,
            known => known + 0.03 * (texels - known),
        };
        self.look(ladder);
        let shown = task.cube == self.front;
        if self.want.is_some_and(|want| want.exact) {
            return self.take_over(ladder) || shown;
        }
        shown
    }

    /// Texels to bake in this frame, at most `most`; `left` of the layer being baked are still to come.
    pub fn quota(&self, left: f64, most: f64) -> f64 {
        let Some(want) = self.want.as_ref().filter(|want| !want.exact) else { return most };
        let layers = self.layers_left(want);
        let needed = if self.slowed[0] < 1.0 {
            // He waits for it.
            most
        } else if self.falls() && !self.is_stale() {
            // A layer in use and one of the spare for every octave, as evenly as can be; more while behind.
            let behind = self.nearest().map_or(0, |level| want.nearest.saturating_sub(level));
            let backlog = ((layers - 1.0).max(0.0) / 20.0 + behind.saturating_sub(1) as f64 / 12.0)
                .min(MOST_BACKLOG)
                + behind.saturating_sub(2) as f64 / 4.0;
            2.0 * self.layer_texels * self.falling / MARGIN * (1.0 + backlog)
        } else {
            (left + layers * self.layer_texels) / (MARGIN * self.frames_left())
        };
        needed.clamp(0.01 * most, most)
    }

    /// Whole layers until the spare is where it should be, the one being baked apart.
    fn layers_left(&self, want: &Want) -> f64 {
        let goal = self.goal(want);
        let next = match self.running.filter(|task| task.cube != self.front) {
            Some(task) => task.id.level + 1,
            None => self.spare_level().map_or(self.far_end(want, goal), |level| level + 1),
        };
        (goal + 1).saturating_sub(next) as f64
    }

    /// Frames until the spare is needed.
    fn frames_left(&self) -> f64 {
        let mut frames = LEISURE;
        if self.climbs() {
            frames = frames.min(self.sights[self.front].octaves / -self.falling);
        }
        frames.min(self.sights[self.front].frames).max(1.0)
    }

    /// How fast the viewer may go, as a share of what he would, if no more than `most` texels are baked in a frame, and
    /// `left` of the layer being baked are still to come: slower where he would outrun the bake. Ask once a frame.
    pub fn headroom(&mut self, left: f64, most: f64) -> f64 {
        self.slowed[0] = self.room(left, most).clamp(CRAWL, 1.0);
        self.slowed[0]
    }

    fn room(&self, left: f64, most: f64) -> f64 {
        let Some(want) = self.want.as_ref().filter(|want| !want.exact && want.nearest >= want.least) else {
            return 1.0;
        };
        if self.used().is_none() {
            return 0.0;
        }
        let frames = |layers: f64| ((left + layers * self.layer_texels) / (MARGIN * most)).max(1.0);
        // What he would do, were he not slowed down.
        let falling = self.falling / self.slowed[1].max(CRAWL);
        let mut room = 1.0f64;
        if self.falls() {
            let behind = want.nearest.saturating_sub(self.nearest().unwrap_or(want.nearest)) as f64;
            // One level is kept for what goes on while he stops.
            let octaves = SPARE_LEVELS as f64 - behind - want.beyond_anchor();
            room = room.min(octaves / falling / frames(behind + 1.0));
        }
        let spare = self.will_do().filter(|level| level + SPARE_LEVELS >= want.nearest);
        let needed = match spare {
            Some(level) if self.at_hand.is_some_and(|from| from <= level + 1) => 0.0,
            Some(_) => FETCH,
            None => frames(self.layers_left(want)) + FETCH,
        };
        if self.climbs() && needed > 0.0 {
            room = room.min(self.sights[self.front].octaves / -falling / needed);
        }
        let until_out = self.sights[self.front].frames * self.slowed[1].max(CRAWL);
        // Sideways, one from here is better than one that is farther.
        room.min(until_out / frames(self.layers_left(want)).max(needed))
    }
}
