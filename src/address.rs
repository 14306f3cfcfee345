//! PURE: addresses: a place and how it is looked at, as one line of text, exact to the bit at any depth.
//!
//! ```text
//! fathomless:1:canyonlands.18f6444c:20181109:0.0:d4099q2.C:JjSuFeA24z_crrjF3Nvz...5dT8:6b700d83
//!            |      |         |        |      |     |              |               |
//!            |      |         |        |      |     |              |               +- CRC-32 of all before its
//!            |      |         |        |      |     |              |                  colon, hexadecimal
//!            |      |         |        |      |     |              +- the viewer: 56 bytes in base64
//!            |      |         |        |      |     |                 (RFC 4648 §5, no padding)
//!            |      |         |        |      |     +- the path from the root, in runs of levels
//!            |      |         |        |      +- the root tile: x.z
//!            |      |         |        +- the seed
//!            |      |         +- fingerprint of the surface without its seed: a CRC-32
//!            |      +- the world's name; bytes other than letters, digits, `-` and `_` as %XX
//!            +- GENERATOR_VERSION
//! ```
//!
//! The checksum stands last in every version, so that a typing error is told from another version. Blanks and line
//! breaks, as mail programs put them in, do not count.
//!
//! The path is the canonical one: a quadrant 0 to 3 (x + 2 z of the child) per level, whichever way the viewer came.
//! Its runs:
//!
//! | run | meaning | costs |
//! |---|---|---|
//! | `d4099` | 4 099 levels steered as a dive steers: into the gentlest child | a few letters, at any depth |
//! | `r3.500` | quadrant 3 at 500 levels | a few letters |
//! | `q5.Xk` | 5 quadrants as they come, three to a letter, the first in the lowest bits | 2 bits per level |
//!
//! The viewer's bytes, little-endian: position x, y, z in anchor tiles over the plane's corner, height and depth (five
//! `f64`), then the orientation quaternion x, y, z, w (four `f32`). All of them are kept to the bit.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use glam::{DVec3, Quat};

use crate::course::{Stand, Standpoint};
use crate::terrain::place::{START_LEVEL, gentlest};
use crate::terrain::{GENERATOR_VERSION, Place, Scheme, Spine, Surface, Terrace};
use crate::world::World;

/// What every address begins with.
pub const PREFIX: &str = "fathomless:";

/// Levels of the deepest address: the start, the deepest dive that can be asked for and the deepest flight below it.
pub const MAX_LEVEL: usize = 2_100_000;

/// Bytes of the longest text that is looked at: a path of [`MAX_LEVEL`] levels without any pattern takes less.
pub const MAX_TEXT: usize = 1 << 20;

/// Bytes of the longest name of a world.
const MAX_NAME: usize = 255;

/// A steered run shorter than this is written as quadrants: three of them take one letter.
const LEAST_STEERED: usize = 12;

/// The same for a quadrant that repeats.
const LEAST_REPEATED: usize = 24;

/// The letters of base64 for URLs, RFC 4648 §5.
const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";

/// A place and how it is looked at. Its text is [`fmt::Display`], and parsing gives it back.
#[derive(Clone, Debug, PartialEq)]
pub struct Address {
    /// The world's name.
    pub world: String,
    /// Of the world's surface, without the seed: [`fingerprint`].
    pub fingerprint: u32,
    /// The landscape's seed.
    pub seed: u64,
    /// The viewer.
    pub view: View,
    root: [u32; 2],
    path: Vec<Run>,
}

/// The viewer at the end of the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// In anchor tiles over the corner of the anchor's plane; x and z within −1..=2.
    pub position: DVec3,
    /// Height in anchor tiles: the scale of what is seen, above 0.
    pub height: f64,
    /// Octaves below the start, with fraction; negative further out.
    pub depth: f64,
    /// Turns a viewer who looks along −z. A unit quaternion.
    pub orientation: Quat,
}

/// Levels of the path that are written in one way. Counts are at least 1.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Run {
    Steered(usize),
    Repeated(u8, usize),
    Quadrants(Vec<u8>),
}

/// Why a text is no address of ours.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// Something else altogether.
    #[error("this is not an address: an address begins with `{PREFIX}`")]
    Foreign,
    /// Longer than any address.
    #[error("this is not an address: no address is longer than {MAX_TEXT} characters")]
    TooLong,
    /// The checksum does not fit.
    #[error(
        "this address is cut short or mistyped (its checksum does not fit): copy it again, from `{PREFIX}` to its end"
    )]
    Damaged,
    /// Heights have changed since.
    #[error(
        "this address was made by generator version {theirs}, and this fathomless has version {GENERATOR_VERSION}, where \
         it would lead to another place: use the fathomless that made it"
    )]
    OtherVersion {
        /// The address's version.
        theirs: u32,
    },
    /// The checksum fits, and yet it makes no sense.
    #[error(
        "the {part} of this address makes no sense, though its checksum fits: it was not made by fathomless"
    )]
    Forged {
        /// Which part of it.
        part: &'static str,
    },
}

/// Why an address leads nowhere here.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WorldError {
    /// It is in a world of somebody's own.
    #[error("this address is in the world `{name}`, which is not built in: give its file with --world")]
    Unknown {
        /// The world's name.
        name: String,
    },
    /// The world's heights are not what they were.
    #[error(
        "this address is in a world `{theirs}` whose surface (fingerprint {address:08x}) is not that of `{ours}` here \
         ({here:08x}): the world has changed since, and the address would lead to another place"
    )]
    Changed {
        /// The address's world.
        theirs: String,
        /// The world it was compared with.
        ours: String,
        /// The address's fingerprint.
        address: u32,
        /// That of the world it was compared with.
        here: u32,
    },
}

/// A number that changes with anything the heights depend on, but the seed.
pub fn fingerprint(surface: &Surface) -> u32 {
    // Without `..`: whatever is added to a surface has to be added here.
    let &Surface { seed: _, scheme, amplitude, terrace, only } = surface;
    let scheme = match scheme {
        Scheme::Bilinear => 0u32,
        Scheme::Cubic => 1,
    };
    let mut words = vec![scheme, u32::from(amplitude)];
    if let Some(Terrace { period, tread_fall, riser_fall }) = terrace {
        words.extend([period, tread_fall, riser_fall]);
    }
    words.extend(only);
    let bytes: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).collect();
    crc32fast::hash(&bytes)
}

impl Address {
    /// The address of a standpoint. For many of them, a [`Scribe`] is faster.
    pub fn of(world: &World, standpoint: &Standpoint<'_>) -> Address {
        Scribe::new(world).address(standpoint)
    }

    /// Level of the anchor, counted from the root.
    pub fn level(&self) -> usize {
        self.path.iter().map(Run::levels).sum()
    }

    /// The world that it is in, with its seed: the one given, or the built-in one of its name.
    ///
    /// # Errors
    /// [`WorldError`]: there is none, or its heights are others.
    pub fn world(&self, given: Option<&World>) -> Result<World, WorldError> {
        let unknown = || WorldError::Unknown { name: self.world.clone() };
        let mut world = match given {
            Some(world) => world.clone(),
            None if World::names().any(|name| name == self.world) => {
                World::load(&self.world).map_err(|_| unknown())?
            }
            None => return Err(unknown()),
        };
        world.surface.seed = self.seed;
        let here = fingerprint(&world.surface);
        if here != self.fingerprint {
            let (theirs, ours) = (self.world.clone(), world.name);
            return Err(WorldError::Changed { theirs, ours, address: self.fingerprint, here });
        }
        Ok(world)
    }

    /// The anchor and the viewer, on the surface of [`Address::world`]. Steered levels cost about a microsecond each,
    /// others a tenth of it.
    pub fn place(&self, surface: &Surface) -> Place {
        let mut spine = Spine::new(*surface, self.root[0], self.root[1]);
        for run in &self.path {
            for i in 0..run.levels() {
                let digit = match run {
                    Run::Steered(_) => gentlest(&spine),
                    Run::Repeated(quadrant, _) => digit(*quadrant),
                    Run::Quadrants(quadrants) => digit(quadrants[i]),
                };
                spine.push(digit);
            }
        }
        Place { spine, position: self.view.position }
    }

    /// [`Address::place`] and how it is looked at.
    pub fn stand(&self, surface: &Surface) -> Stand {
        let View { height, depth, orientation, .. } = self.view;
        Stand { place: self.place(surface), height, depth, orientation }
    }
}

impl Run {
    fn levels(&self) -> usize {
        match self {
            Run::Steered(count) | Run::Repeated(_, count) => *count,
            Run::Quadrants(quadrants) => quadrants.len(),
        }
    }
}

fn digit(quadrant: u8) -> [i8; 2] {
    [(quadrant & 1) as i8, (quadrant >> 1) as i8]
}

/// Writes addresses of one world. It remembers the last path: an address near it costs only what is new.
#[derive(Clone, Debug)]
pub struct Scribe {
    world: String,
    fingerprint: u32,
    spine: Spine,
    /// The path that `spine` follows: its root, and each level's quadrant with whether a dive would steer there.
    root: [u32; 2],
    path: Vec<(u8, bool)>,
}

impl Scribe {
    /// Knows no path yet.
    pub fn new(world: &World) -> Scribe {
        Scribe {
            world: world.name.clone(),
            fingerprint: fingerprint(&world.surface),
            spine: Spine::new(world.surface, 0, 0),
            root: [0, 0],
            path: Vec::new(),
        }
    }

    /// The address of a standpoint in this scribe's world.
    pub fn address(&mut self, standpoint: &Standpoint<'_>) -> Address {
        self.follow(&standpoint.place.spine);
        let &Standpoint { position, height, depth, orientation, .. } = standpoint;
        Address {
            world: self.world.clone(),
            fingerprint: self.fingerprint,
            seed: self.spine.surface().seed,
            view: View { position, height, depth, orientation },
            root: self.root,
            path: runs(&self.path),
        }
    }

    /// Takes over the canonical path of `spine`.
    fn follow(&mut self, spine: &Spine) {
        let (root, quadrants) = spine.canonical();
        if root != self.root {
            self.root = root;
            self.spine = Spine::new(*self.spine.surface(), root[0], root[1]);
            self.path.clear();
        }
        let quadrants: Vec<u8> = quadrants.into_iter().map(|[x, z]| x + 2 * z).collect();
        let common = self.path.iter().zip(&quadrants).take_while(|((known, _), new)| known == *new).count();
        self.path.truncate(common);
        while self.spine.level() > common {
            self.spine.pop();
        }
        for &quadrant in &quadrants[common..] {
            self.path.push((quadrant, gentlest(&self.spine) == digit(quadrant)));
            self.spine.push(digit(quadrant));
        }
    }
}

/// The shortest runs, nearly: whatever is steered or repeats for long enough, and the rest as it is.
fn runs(path: &[(u8, bool)]) -> Vec<Run> {
    let mut runs = Vec::new();
    let mut rest = Vec::new();
    let mut done = 0;
    while let Some(&(quadrant, _)) = path.get(done) {
        let ahead = &path[done..];
        let steered = ahead.iter().take_while(|(_, steered)| *steered).count();
        let repeated = ahead.iter().take_while(|(next, _)| *next == quadrant).count();
        let run = match () {
            () if steered >= LEAST_STEERED => Run::Steered(steered),
            () if repeated >= LEAST_REPEATED => Run::Repeated(quadrant, repeated),
            () => {
                rest.push(quadrant);
                done += 1;
                continue;
            }
        };
        done += run.levels();
        if !rest.is_empty() {
            runs.push(Run::Quadrants(std::mem::take(&mut rest)));
        }
        runs.push(run);
    }
    if !rest.is_empty() {
        runs.push(Run::Quadrants(rest));
    }
    runs
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = format!("{PREFIX}{GENERATOR_VERSION}:");
        for &byte in self.world.as_bytes() {
            match byte {
                b'-' | b'_' => text.push(byte.into()),
                _ if byte.is_ascii_alphanumeric() => text.push(byte.into()),
                _ => text.push_str(&format!("%{byte:02X}")),
            }
        }
        let [x, z] = self.root;
        text.push_str(&format!(".{:08x}:{}:{x}.{z}:", self.fingerprint, self.seed));
        for run in &self.path {
            match run {
                Run::Steered(count) => text.push_str(&format!("d{count}")),
                Run::Repeated(quadrant, count) => text.push_str(&format!("r{quadrant}.{count}")),
                Run::Quadrants(quadrants) => {
                    text.push_str(&format!("q{}.", quadrants.len()));
                    let letter = |three: &[u8]| three.iter().rev().fold(0, |bits, q| bits << 2 | q);
                    text.extend(
                        quadrants.chunks(3).map(|three| char::from(LETTERS[usize::from(letter(three))])),
                    );
                }
            }
        }
        text.push(':');
        text.push_str(&base64(&self.view.bytes()));
        write!(f, "{text}:{:08x}", crc32fast::hash(text.as_bytes()))
    }
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Address, AddressError> {
        if text.len() > MAX_TEXT {
            return Err(AddressError::TooLong);
        }
        let text: Cow<'_, str> = match text.contains(char::is_whitespace) {
            true => text.split_whitespace().collect::<String>().into(),
            false => text.into(),
        };
        if !text.starts_with(PREFIX) {
            return Err(AddressError::Foreign);
        }
        let (body, check) = text.rsplit_once(':').ok_or(AddressError::Damaged)?;
        if check != format!("{:08x}", crc32fast::hash(body.as_bytes())) {
            return Err(AddressError::Damaged);
        }
        let address = fields(body)?;
        // Only what would be written in this way: each place has one text.
        if address.to_string() != text {
            return Err(AddressError::Forged { part: "spelling" });
        }
        Ok(address)
    }
}

/// Reads what stands between prefix and checksum.
fn fields(body: &str) -> Result<Address, AddressError> {
    let forged = |part| move || AddressError::Forged { part };
    let mut fields = body[PREFIX.len().min(body.len())..].split(':');
    let version: u32 = number(fields.next()).ok_or_else(forged("version"))?;
    if version != GENERATOR_VERSION {
        return Err(AddressError::OtherVersion { theirs: version });
    }
    let (world, fingerprint) = fields.next().and_then(world).ok_or_else(forged("world"))?;
    let seed = number(fields.next()).ok_or_else(forged("seed"))?;
    let root = fields.next().and_then(|text| text.split_once('.'));
    let root =
        root.and_then(|(x, z)| Some([number(Some(x))?, number(Some(z))?])).ok_or_else(forged("root"))?;
    let path = fields.next().and_then(path).ok_or_else(forged("path"))?;
    let bytes = fields.next().and_then(bytes_of_base64).ok_or_else(forged("viewer"))?;
    let level = path.iter().map(Run::levels).sum();
    let view = View::checked(&bytes, level).ok_or_else(forged("viewer"))?;
    match fields.next() {
        None => Ok(Address { world, fingerprint, seed, view, root, path }),
        Some(_) => Err(forged("number of parts")()),
    }
}

fn number<T: FromStr>(text: Option<&str>) -> Option<T> {
    text.filter(|text| text.bytes().all(|b| b.is_ascii_digit())).and_then(|text| text.parse().ok())
}

/// A world's name and fingerprint.
fn world(text: &str) -> Option<(String, u32)> {
    let (name, fingerprint) = text.rsplit_once('.')?;
    let mut bytes = Vec::new();
    let mut rest = name.bytes();
    while let Some(byte) = rest.next() {
        bytes.push(match byte {
            b'%' => hex(rest.next()?)? << 4 | hex(rest.next()?)?,
            _ => byte,
        });
    }
    let name = String::from_utf8(bytes).ok()?;
    let proper = !name.is_empty() && name.len() <= MAX_NAME && !name.chars().any(char::is_control);
    let fingerprint = u32::from_str_radix(fingerprint, 16).ok()?;
    proper.then_some((name, fingerprint))
}

fn hex(letter: u8) -> Option<u8> {
    char::from(letter).to_digit(16).map(|value| value as u8)
}

/// The runs of a path, no more than [`MAX_LEVEL`] levels together.
fn path(mut text: &str) -> Option<Vec<Run>> {
    let mut runs = Vec::new();
    let mut room = MAX_LEVEL;
    while !text.is_empty() {
        let (run, rest) = run(text)?;
        room = room.checked_sub(run.levels())?;
        if run.levels() == 0 {
            return None;
        }
        runs.push(run);
        text = rest;
    }
    Some(runs)
}

/// The first run of a path, and the text behind it.
fn run(text: &str) -> Option<(Run, &str)> {
    let (kind, text) = text.split_at_checked(1)?;
    match kind {
        "d" => counted(text).map(|(count, rest)| (Run::Steered(count), rest)),
        "r" => {
            let (quadrant, text) = counted(text)?;
            let (count, rest) = counted(text.strip_prefix('.')?)?;
            Some((Run::Repeated(u8::try_from(quadrant).ok().filter(|q| *q < 4)?, count), rest))
        }
        "q" => {
            let (count, text) = counted(text)?;
            let (letters, rest) = text.strip_prefix('.')?.split_at_checked(count.div_ceil(3))?;
            let values: Option<Vec<u8>> = letters.bytes().map(value).collect();
            let quadrants =
                values?.into_iter().flat_map(|v| [v & 3, v >> 2 & 3, v >> 4]).take(count).collect();
            Some((Run::Quadrants(quadrants), rest))
        }
        _ => None,
    }
}

/// The number that a text begins with, at most [`MAX_LEVEL`], and the text behind it.
fn counted(text: &str) -> Option<(usize, &str)> {
    let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    number(Some(digits)).filter(|count| *count <= MAX_LEVEL).map(|count| (count, rest))
}

impl View {
    /// Five `f64`, then four `f32`, little-endian.
    fn bytes(&self) -> Vec<u8> {
        let [x, y, z] = self.position.to_array();
        let doubles = [x, y, z, self.height, self.depth].into_iter().flat_map(f64::to_le_bytes);
        doubles.chain(self.orientation.to_array().into_iter().flat_map(f32::to_le_bytes)).collect()
    }

    /// A view that can be drawn from, at a level.
    fn checked(bytes: &[u8], level: usize) -> Option<View> {
        let (doubles, singles) = bytes.split_at_checked(40)?;
        let mut values = [0.0; 5];
        for (value, bytes) in values.iter_mut().zip(doubles.as_chunks().0) {
            *value = f64::from_le_bytes(*bytes);
        }
        let mut turn = [0.0; 4];
        for (value, bytes) in turn.iter_mut().zip(singles.as_chunks().0) {
            *value = f32::from_le_bytes(*bytes);
        }
        let [x, y, z, height, depth] = values;
        let orientation = Quat::from_array(turn);
        // So far and no further: beyond, arithmetic would leave the range of numbers.
        let far = 64f64.exp2();
        let sound = singles.len() == 16
            && [x, z].iter().all(|v| (-1.0..=2.0).contains(v))
            && (-far..=far).contains(&y)
            && (1.0 / far..=far).contains(&height)
            && (depth + START_LEVEL as f64 - level as f64).abs() <= 64.0
            && (orientation.length_squared() - 1.0).abs() < 1e-3;
        sound.then_some(View { position: DVec3::new(x, y, z), height, depth, orientation })
    }
}

/// Bytes as base64 for URLs, without padding.
fn base64(bytes: &[u8]) -> String {
    let letters = |three: &[u8]| {
        let bits = (0..3).fold(0, |bits, i| bits << 8 | u32::from(three.get(i).copied().unwrap_or(0)));
        let letter = move |i: usize| char::from(LETTERS[(bits >> (18 - 6 * i) & 63) as usize]);
        (0..=three.len()).map(letter).collect::<String>()
    };
    bytes.chunks(3).map(letters).collect()
}

/// The bytes of base64 text; None where a letter is none of its own.
fn bytes_of_base64(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(3 * text.len() / 4);
    for four in text.as_bytes().chunks(4) {
        let mut bits = 0;
        for i in 0..4 {
            bits = bits << 6 | four.get(i).map_or(Some(0), |&letter| value(letter).map(u32::from))?;
        }
        bytes.extend_from_slice(bits.to_be_bytes().get(1..four.len())?);
    }
    Some(bytes)
}

/// The six bits of a letter.
fn value(letter: u8) -> Option<u8> {
    match letter {
        b'A'..=b'Z' => Some(letter - b'A'),
        b'a'..=b'z' => Some(letter - b'a' + 26),
        b'0'..=b'9' => Some(letter - b'0' + 52),
        b'-' => Some(62),
        b'_' => Some(63),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        // RFC 4648 §10, and the two letters of its §5.
        let cases: [(&[u8], &str); 5] =
            [(b"", ""), (b"f", "Zg"), (b"fo", "Zm8"), (b"foobar", "Zm9vYmFy"), (&[0xfb, 0xff], "-_8")];
        for (bytes, text) in cases {
            assert_eq!(base64(bytes), text);
            assert_eq!(bytes_of_base64(text).as_deref(), Some(bytes));
        }
    }

    #[test]
    fn runs_are_found() {
        let path = |parts: &[(u8, bool, usize)]| {
            parts.iter().flat_map(|&(q, steered, n)| vec![(q, steered); n]).collect::<Vec<_>>()
        };
        assert_eq!(
            runs(&path(&[(2, true, 4096), (1, false, 2)])),
            [Run::Steered(4096), Run::Quadrants(vec![1, 1])]
        );
        assert_eq!(runs(&path(&[(3, false, 500)])), [Run::Repeated(3, 500)]);
        assert_eq!(runs(&path(&[(3, true, 11)])), [Run::Quadrants(vec![3; 11])]);
        assert_eq!(runs(&[]), []);
    }
}
