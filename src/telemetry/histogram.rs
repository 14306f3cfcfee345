//! How long frames took: how many of which length, in memory that does not grow.

use std::fmt::Write as _;

/// Bins per octave: a length is known to 1 part in 46.
const PER_OCTAVE: f64 = 32.0;

/// The shortest length told apart, in milliseconds.
const SHORTEST_MS: f64 = 1.0 / 16.0;

/// Octaves from there on: to about a minute.
const OCTAVES: usize = 20;

const BINS: usize = OCTAVES * PER_OCTAVE as usize;

/// Bins in a bar of the text, and the length of the longest bar in characters.
const BINS_PER_BAR: usize = 8;
const LONGEST_BAR: usize = 50;

/// Lengths of frames, sorted into bins that grow by 2 %.
#[derive(Clone, Debug)]
pub struct Histogram {
    bins: [u32; BINS],
    count: u64,
    worst_ms: f64,
}

impl Default for Histogram {
    fn default() -> Histogram {
        Histogram { bins: [0; BINS], count: 0, worst_ms: 0.0 }
    }
}

impl Histogram {
    /// Counts a frame of so many milliseconds.
    pub fn add(&mut self, ms: f64) {
        let bin = ((ms / SHORTEST_MS).log2() * PER_OCTAVE).clamp(0.0, BINS as f64 - 1.0);
        self.bins[bin as usize] += 1;
        self.count += 1;
        self.worst_ms = self.worst_ms.max(ms);
    }

    /// Frames counted.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The longest, in milliseconds.
    pub fn worst_ms(&self) -> f64 {
        self.worst_ms
    }

    /// The length that a share `q` (0 to 1) of the frames do not exceed: at most 2.2 % too long, never longer than the
    /// worst. None without frames.
    pub fn quantile(&self, q: f64) -> Option<f64> {
        let rank = ((q * self.count as f64).ceil() as u64).clamp(1, self.count.max(1));
        let mut below = 0;
        let bin = self.bins.iter().position(|&count| {
            below += u64::from(count);
            below >= rank
        })?;
        Some(edge_ms(bin + 1).min(self.worst_ms))
    }

    /// A line of figures, and a bar for each quarter of an octave that has frames; empty without any.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let quantile = |q| self.quantile(q).unwrap_or(0.0);
        let bars: Vec<u32> = self.bins.chunks(BINS_PER_BAR).map(|bins| bins.iter().sum()).collect();
        let (Some(first), Some(last)) = (bars.iter().position(|&n| n > 0), bars.iter().rposition(|&n| n > 0))
        else {
            return text;
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{} frames: p50 {:.2} ms, p99 {:.2} ms, p99.9 {:.2} ms, worst {:.2} ms",
            self.count,
            quantile(0.5),
            quantile(0.99),
            quantile(0.999),
            self.worst_ms
        );
        let most = bars.iter().copied().max().unwrap_or(1).max(1) as usize;
        let mut gap = false;
        for (i, &count) in bars.iter().enumerate().take(last + 1).skip(first) {
            if count == 0 {
                gap = true;
                continue;
            }
            if std::mem::take(&mut gap) {
                text.push_str("      ...\n");
            }
            // A bar that is there is seen.
            let length = (count as usize * LONGEST_BAR).div_ceil(most);
            let (from, to) = (edge_ms(i * BINS_PER_BAR), edge_ms((i + 1) * BINS_PER_BAR));
            let _ = writeln!(text, "{from:>9.2} to {to:>8.2} ms {count:>8}  {}", "#".repeat(length));
        }
        text
    }
}

/// Where a bin begins, in milliseconds.
fn edge_ms(bin: usize) -> f64 {
    SHORTEST_MS * (bin as f64 / PER_OCTAVE).exp2()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use super::*;
    use crate::telemetry::quantile;

    #[test]
    fn quantiles_are_those_of_the_list_within_a_bin() {
        let mut list: Vec<f64> = (0..2000).map(|i| 3.0 + f64::from(i * 7919 % 2000) * 0.013).collect();
        list.push(400.0);
        let mut histogram = Histogram::default();
        list.iter().for_each(|ms| histogram.add(*ms));
        list.sort_by(f64::total_cmp);
        for q in [0.0, 0.01, 0.5, 0.9, 0.99, 0.999, 1.0] {
            let (exact, told) = (quantile(&list, q).unwrap(), histogram.quantile(q).unwrap());
            assert!(told >= exact && told <= exact * 1.023, "{q}: {told} for {exact}");
        }
        assert_eq!((histogram.count(), histogram.worst_ms()), (2001, 400.0));
    }

    #[test]
    fn nothing_is_too_short_or_too_long() {
        let mut histogram = Histogram::default();
        assert_eq!((histogram.quantile(0.5), histogram.text()), (None, String::new()));
        [0.0, -1.0, f64::NAN, 1e-9, 1e12].into_iter().for_each(|ms| histogram.add(ms));
        assert_eq!(histogram.count(), 5);
        assert_eq!(histogram.worst_ms(), 1e12);
    }

    #[test]
    fn bars_are_as_long_as_their_share_and_count_every_frame() {
        let mut histogram = Histogram::default();
        (0..100).for_each(|_| histogram.add(10.0));
        (0..50).for_each(|_| histogram.add(20.0));
        histogram.add(45.0);
        let text = histogram.text();
        let bars: Vec<&str> = text.lines().skip(1).filter(|line| line.contains('#')).collect();
        assert_eq!(text.matches("...").count(), 2);
        let length = |bar: &&str| bar.matches('#').count();
        assert_eq!(bars.iter().map(length).max(), Some(LONGEST_BAR));
        let counted: u32 =
            bars.iter().map(|bar| bar.split_whitespace().nth(4).unwrap().parse::<u32>().unwrap()).sum();
        assert_eq!(counted, 151);
        assert_eq!(bars.iter().map(length).filter(|&n| n > 0).collect::<Vec<_>>(), [50, 25, 1]);
        assert!(text.starts_with("151 frames: p50 10.") && text.contains("worst 45.00 ms"), "{text}");
    }
}
