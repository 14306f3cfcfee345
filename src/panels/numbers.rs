//! What the panels know of the flight.

use std::collections::VecDeque;

use toml::Value;

use super::{ControllerLine, KeyLine};
use crate::inspect::Inspect;
use crate::quality::Fineness;
use crate::settings::Side;
use crate::telemetry::{Row, Span, quantile_of};
use crate::world::Sun;

/// Frames that are remembered: some seconds.
const REMEMBERED: usize = 300;

/// Frames whose mean is shown as the value of now.
const NOW: usize = 10;

/// Something for the panels to know.
#[expect(
    clippy::large_enum_variant,
    reason = "the largest comes with every frame, and is not to touch the heap"
)]
pub enum Report {
    /// A frame was drawn.
    Frame(Moment),
    /// What changes seldom has changed.
    Facts(Box<Facts>),
    /// Where this is.
    Address {
        /// The address.
        text: String,
        /// It was asked for, for the clipboard.
        copy: bool,
    },
    /// Keys and buttons do this from now on.
    Keys(Vec<KeyLine>),
    /// Other controllers are in the hands, or none.
    Controllers(Vec<ControllerLine>),
}

/// One frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    /// What it cost.
    pub row: Row,
    /// Octaves per second, and most of them; None: a flight goes by itself.
    pub speed: Option<[f64; 2]>,
    /// Whose picture the window shows.
    pub side: Side,
}

/// What changes seldom.
#[derive(Clone, Debug, PartialEq)]
pub struct Facts {
    /// The world's name.
    pub world: String,
    /// A line about it.
    pub title: String,
    /// Its seed.
    pub seed: u64,
    /// Its own light.
    pub sun: Sun,
    /// The GPU.
    pub device: String,
    /// Pixels of an eye's picture.
    pub eye_size: [u32; 2],
    /// How much is drawn.
    pub tuning: Tuning,
    /// Samples that a pixel may have on that GPU.
    pub samples: Vec<u32>,
    /// How much is drawn by the settings.
    pub by_settings: Tuning,
    /// Whose picture the window shows by the settings.
    pub side_by_settings: Side,
    /// What is shown otherwise than usual.
    pub inspect: Inspect,
    /// Whether the view is narrowed while the wearer is moved; None: nobody wears a headset.
    pub vignette: Option<bool>,
}

/// How much is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Tiles and samples.
    pub fineness: Fineness,
    /// Milliseconds of GPU time that tiles may take in a frame.
    pub tile_ms: f64,
    /// Milliseconds of GPU time that baking may take in a frame.
    pub bake_ms: f64,
}

impl Tuning {
    /// The settings that make the one out of another.
    pub fn changes(&self, from: &Tuning) -> Vec<(&'static str, Value)> {
        let all = |it: &Tuning| {
            let Fineness { split, down, cells, mesh, samples } = it.fineness;
            [
                ("quality.split", Value::from(split)),
                ("quality.levels_below", Value::from(down as i64)),
                ("quality.cells", Value::from(i64::from(cells))),
                ("quality.mesh", Value::from(i64::from(mesh))),
                ("quality.samples", Value::from(i64::from(samples))),
                ("quality.tile_ms", Value::from(it.tile_ms)),
                ("quality.bake_ms", Value::from(it.bake_ms)),
            ]
        };
        all(self).into_iter().zip(all(from)).filter(|(to, from)| to != from).map(|(to, _)| to).collect()
    }
}

/// All of it.
#[derive(Default)]
pub struct Numbers {
    /// None before there is anything to know.
    pub facts: Option<Box<Facts>>,
    /// The last frames.
    pub history: History,
    /// Where this is; empty before that is known.
    pub address: String,
}

/// The last frames, the oldest first.
#[derive(Default)]
pub struct History {
    moments: VecDeque<Moment>,
    /// Names of the GPU's passes, in the order in which they were first heard of.
    passes: Vec<&'static str>,
}

/// Milliseconds of one part of a frame, over the frames remembered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// The mean of the last few.
    pub now: f64,
    /// What 99 of 100 do not exceed.
    pub p99: f64,
    /// The longest.
    pub worst: f64,
}

/// A part of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// From frame to frame.
    Frame,
    /// On this side, by the clock.
    Clock(Span),
    /// On this side, on a processor.
    Processor(Span),
    /// On the GPU.
    Pass(&'static str),
}

impl Part {
    /// Milliseconds of it in a frame.
    pub fn of(self, moment: &Moment) -> f64 {
        match self {
            Part::Frame => moment.row.frame_ms,
            Part::Clock(span) => moment.row.spans.of(span).wall_ms,
            Part::Processor(span) => moment.row.spans.of(span).cpu_ms,
            Part::Pass(name) => moment.row.passes.of(name),
        }
    }
}

impl History {
    /// Remembers a frame, and forgets the oldest for it.
    pub fn push(&mut self, moment: Moment) {
        if self.moments.len() == REMEMBERED {
            self.moments.pop_front();
        }
        for (name, _) in moment.row.passes.iter() {
            if !self.passes.contains(&name) {
                self.passes.push(name);
            }
        }
        self.moments.push_back(moment);
    }

    /// The frames.
    pub fn moments(&self) -> impl DoubleEndedIterator<Item = &Moment> + ExactSizeIterator {
        self.moments.iter()
    }

    /// The last one.
    pub fn last(&self) -> Option<&Moment> {
        self.moments.back()
    }

    /// The GPU's passes.
    pub fn passes(&self) -> &[&'static str] {
        &self.passes
    }

    /// What a part of a frame costs. `scratch` is room to sort in.
    pub fn summary(&self, part: Part, scratch: &mut Vec<f64>) -> Summary {
        scratch.clear();
        scratch.extend(self.moments.iter().map(|moment| part.of(moment)));
        let last = &scratch[scratch.len().saturating_sub(NOW)..];
        let now = last.iter().sum::<f64>() / last.len().max(1) as f64;
        let worst = scratch.iter().copied().fold(0.0, f64::max);
        Summary { now, p99: quantile_of(scratch, 0.99).unwrap_or(0.0), worst }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moment(frame_ms: f64) -> Moment {
        Moment { row: Row { frame_ms, ..Row::default() }, ..Moment::default() }
    }

    #[test]
    fn the_window_slides_and_is_summed_up() {
        let mut history = History::default();
        assert_eq!(history.summary(Part::Frame, &mut Vec::new()), Summary::default());
        history.push(moment(1000.0));
        for i in 1..=REMEMBERED {
            history.push(moment(i as f64));
        }
        assert_eq!(history.moments().len(), REMEMBERED);
        let summary = history.summary(Part::Frame, &mut Vec::new());
        assert_eq!(summary, Summary { now: 295.5, p99: 297.0, worst: 300.0 });
    }

    #[test]
    fn passes_are_listed_as_they_come_up() {
        let mut history = History::default();
        for names in [&["terrain"][..], &["tiles", "terrain"], &["bake"]] {
            let mut one = moment(1.0);
            names.iter().for_each(|name| one.row.passes.add(name, 2.0));
            history.push(one);
        }
        assert_eq!(history.passes(), ["terrain", "tiles", "bake"]);
        assert_eq!(history.summary(Part::Pass("tiles"), &mut Vec::new()).worst, 2.0);
    }
}
