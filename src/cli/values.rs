//! Texts of single arguments and what they mean.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use super::{MAX_DEPTH, MAX_SHARDS, MAX_TILES, Shard};
use crate::export::MAX_CELLS;
use crate::quality::SAMPLES;

/// A value of an argument that makes no sense, as the end of clap's "invalid value 'X' for '--Y': ...".
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BadValue(String);

impl fmt::Display for BadValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for BadValue {}

/// A whole number within a range, both ends included.
pub(super) fn whole(text: &str, least: u32, most: u32) -> Result<u32, BadValue> {
    let number = text.parse().ok().filter(|number| (least..=most).contains(number));
    number.ok_or_else(|| BadValue(format!("it should be a whole number from {least} to {most}")))
}

pub(super) fn depth(text: &str) -> Result<u32, BadValue> {
    whole(text, 0, MAX_DEPTH)
}

pub(super) fn octaves(text: &str) -> Result<u32, BadValue> {
    whole(text, 1, MAX_DEPTH)
}

pub(super) fn refresh_rate(text: &str) -> Result<f32, BadValue> {
    let rate = text.parse().ok().filter(|hz| (1.0..=1000.0).contains(hz));
    rate.ok_or_else(|| BadValue("it should be a number from 1 to 1000".to_owned()))
}

pub(super) fn tiles(text: &str) -> Result<u32, BadValue> {
    whole(text, 1, MAX_TILES)
}

pub(super) fn samples(text: &str) -> Result<u32, BadValue> {
    let number = text.parse().ok().filter(|number| SAMPLES.contains(number));
    number.ok_or_else(|| BadValue("it should be 1, 2, 4 or 8".to_owned()))
}

pub(super) fn cells(text: &str) -> Result<u32, BadValue> {
    whole(text, 1, MAX_CELLS)
}

/// Beyond these, a grid would be the whole world, or finer than a place is known.
pub(super) fn level_offset(text: &str) -> Result<i32, BadValue> {
    let number = text.parse().ok().filter(|number| (-1_000_000..=1_000).contains(number));
    number.ok_or_else(|| BadValue("it should be a whole number from -1000000 to 1000".to_owned()))
}

pub(super) fn seed(text: &str) -> Result<u64, BadValue> {
    let number = match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16),
        None => text.parse(),
    };
    number.map_err(|_| BadValue(format!("it should be a whole number from 0 to {}", u64::MAX)))
}

pub(super) fn frames(text: &str) -> Result<Range<u64>, BadValue> {
    let wrong = || BadValue("it should be A..B, such as 0..60 for the frames 0 to 59".to_owned());
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    let frames: Range<u64> = start.parse().map_err(|_| wrong())?..end.parse().map_err(|_| wrong())?;
    if frames.is_empty() {
        let start = frames.start;
        let remedy = format!("B should be greater than A, such as {start}..{}", start.saturating_add(1));
        return Err(BadValue(format!("there is no frame in it; {remedy}")));
    }
    Ok(frames)
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        let shard = parts.map(|(index, count)| Shard { index, count });
        shard.filter(|s| s.index < s.count && s.count <= MAX_SHARDS).ok_or_else(|| {
            format!(
                "it should be I/N, part I of N counted from 0, such as 0/4 to 3/4, N at most {MAX_SHARDS}"
            )
        })
    }
}
