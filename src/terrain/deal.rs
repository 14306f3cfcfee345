//! What of a layer of the backdrop is baked in which frame: about as many texels in one as in the next.
//!
//! Tiles are dealt out to frames, the heaviest first. A tile that is too heavy for a frame is cut into parts, each the
//! share of a frame by itself.

use super::select::Drawn;
use std::ops::Range;

/// A tile covers so many times a frame's share before it is cut into parts.
const HEAVY: f64 = 1.1;

/// Most parts of a tile: it is cut between the rows of its mesh.
pub const MOST_PARTS: u32 = 4;

/// A frame's texels may be so many times its share: tiles are not that fine.
const OVER: f64 = 1.05;

/// A tile to be baked, or a part of one.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// The tile.
    pub tile: Drawn,
    /// About how many texels the piece covers.
    pub texels: f32,
    /// Which part of the tile it is, of how many.
    pub part: u32,
    /// 1: the whole tile.
    pub parts: u32,
}

/// A layer's tiles, in the order in which they are baked.
#[derive(Debug)]
pub struct Deal {
    pieces: Vec<Piece>,
    /// The same with the frame that each is dealt to, and what those frames have.
    dealt: Vec<(usize, Piece)>,
    loads: Vec<f32>,
    /// Where each frame's share of the pieces ends.
    ends: Vec<usize>,
    /// Pieces that are baked.
    done: usize,
}

impl Default for Deal {
    /// Room for a layer.
    fn default() -> Deal {
        Deal {
            pieces: Vec::with_capacity(1024),
            dealt: Vec::with_capacity(1024),
            loads: Vec::with_capacity(1024),
            ends: Vec::with_capacity(1024),
            done: 0,
        }
    }
}

impl Deal {
    /// Another layer: its tiles, and about how many texels each covers.
    pub fn begin(&mut self, tiles: impl Iterator<Item = (Drawn, f32)>) {
        self.pieces.clear();
        self.pieces.extend(tiles.map(|(tile, texels)| Piece { tile, texels, part: 0, parts: 1 }));
        self.ends.clear();
        self.done = 0;
    }

    /// Deals all of it out to frames of about `quota` texels each.
    pub fn deal(&mut self, quota: f64) {
        let quota = quota.max(1.0);
        self.cut(quota);
        self.pieces.sort_unstable_by(|a, b| {
            let place = |piece: &Piece| (piece.tile.corner.x, piece.tile.corner.z, piece.part);
            b.texels.total_cmp(&a.texels).then(place(a).cmp(&place(b)))
        });
        let whole = self.pieces.iter().filter(|piece| piece.parts == 1);
        let (texels, tiles) =
            whole.fold((0.0, 0usize), |(sum, n), piece| (sum + f64::from(piece.texels), n + 1));
        let frames = ((texels / quota).ceil() as usize).clamp(1, tiles.div_ceil(2).max(1));
        self.loads.clear();
        self.loads.resize(frames, 0.0);
        self.dealt.clear();
        let mut alone = frames;
        for &piece in &self.pieces {
            let lighter = |a: &usize, b: &usize| self.loads[*a].total_cmp(&self.loads[*b]);
            let frame = match piece.parts {
                1 => (0..frames).min_by(lighter).unwrap_or(0),
                _ => alone,
            };
            match self.loads.get_mut(frame) {
                Some(load) => *load += piece.texels,
                None => alone += 1,
            }
            self.dealt.push((frame, piece));
        }
        self.dealt.sort_unstable_by_key(|(frame, piece)| {
            (*frame, piece.tile.corner.x, piece.tile.corner.z, piece.part)
        });
        self.pieces.clear();
        self.ends.clear();
        for (i, &(frame, piece)) in self.dealt.iter().enumerate() {
            self.pieces.push(piece);
            if self.dealt.get(i + 1).is_none_or(|&(next, _)| next != frame) {
                self.ends.push(i + 1);
            }
        }
    }

    /// Tiles that are too heavy become their parts.
    fn cut(&mut self, quota: f64) {
        for i in 0..self.pieces.len() {
            let piece = self.pieces[i];
            let share = f64::from(piece.texels) / quota;
            if share <= HEAVY {
                continue;
            }
            let parts = (share.ceil() as u32).min(MOST_PARTS);
            let mut cut =
                (0..parts).map(|part| Piece { texels: piece.texels / parts as f32, part, parts, ..piece });
            self.pieces[i] = cut.next().unwrap_or(piece);
            self.pieces.extend(cut);
        }
    }

    /// The pieces for a frame of at most about `quota` texels, one frame's share at least: at most `most` whole tiles, or one
    /// part of a tile.
    pub fn next(&self, quota: f64, most: usize) -> Range<usize> {
        let begin = self.done;
        let mut end = begin;
        for &share in self.ends.iter().filter(|&&end| end > begin) {
            let texels = texels_of(&self.pieces[begin..share]);
            let cut = self.pieces[begin..share].iter().any(|piece| piece.parts > 1);
            if end > begin && (share - begin > most || texels > OVER * quota || cut) {
                break;
            }
            end = share.min(begin + most);
        }
        begin..end
    }

    /// A piece.
    pub fn piece(&self, index: usize) -> &Piece {
        &self.pieces[index]
    }

    /// Pieces that are baked.
    pub fn done(&self) -> usize {
        self.done
    }

    /// So many more are. True if that is all.
    pub fn finish(&mut self, pieces: usize) -> bool {
        self.done += pieces;
        self.done >= self.pieces.len()
    }

    /// About how many texels are still to come, and how many there are.
    pub fn texels(&self) -> (f64, f64) {
        (texels_of(&self.pieces[self.done..]), texels_of(&self.pieces))
    }
}

/// About how many texels these cover.
fn texels_of(pieces: &[Piece]) -> f64 {
    pieces.iter().map(|piece| f64::from(piece.texels)).sum()
}
