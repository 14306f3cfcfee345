//! PNG files: pictures with words about them, and the words read back without looking at the picture.
//!
//! Each picture carries the address of the place it shows in a text chunk. Reading takes the text chunks only: what
//! else is in the file, or claims to be, is skipped and costs nothing.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::Path;

use crate::address::MAX_TEXT;
use crate::files;

/// Keyword of the text chunk with the address.
pub const ADDRESS: &str = "Fathomless-Address";

/// What made the picture, for its chunk `Software`.
pub const SOFTWARE: &str = concat!("fathomless ", env!("CARGO_PKG_VERSION"));

/// What every PNG file begins with.
pub const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";

/// Chunks of a file that are looked at, one after the other, before it counts as forged: pictures have thousands.
const MAX_CHUNKS: usize = 1_000_000;

/// Bytes of a text chunk beside its text: keyword, language, flags.
const MAX_HEADER: usize = 1024;

/// Words about a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Note<'a> {
    /// The keyword: 1 to 79 Latin letters.
    pub keyword: &'static str,
    /// The words.
    pub text: &'a str,
}

/// What every picture of ours says: the program, what is seen, and the address of where it is seen from.
pub fn notes<'a>(description: &'a str, address: &'a str) -> [Note<'a>; 3] {
    [
        Note { keyword: "Software", text: SOFTWARE },
        Note { keyword: "Description", text: description },
        Note { keyword: ADDRESS, text: address },
    ]
}

/// What a picture is made of, rows from the top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pixels<'a> {
    /// sRGB, 3 bytes per pixel.
    Rgb8(&'a [u8]),
    /// One number per pixel, big-endian; not a colour.
    Grey16(&'a [u8]),
}

/// Why a picture leads nowhere.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// It cannot be opened or read.
    #[error("cannot be read: {0}")]
    Unreadable(#[from] io::Error),
    /// It is another kind of file.
    #[error("is not a PNG picture")]
    NotPng,
    /// A chunk goes beyond the file's end, or its checksum does not fit.
    #[error("is a damaged PNG picture: it is cut short or was changed on its way")]
    Damaged,
    /// There is no such text in it.
    #[error(
        "this picture carries no address: only pictures made by fathomless do, as long as no other program has saved them anew"
    )]
    NoAddress,
}

/// Writes a picture whole or not at all.
///
/// # Errors
/// The disk is full or the folder is gone.
pub fn write(path: &Path, size: [u32; 2], pixels: Pixels<'_>, notes: &[Note<'_>]) -> io::Result<()> {
    files::write_whole(path, |file| encode(file, size, pixels, notes).map_err(io::Error::from))
}

fn encode(
    file: &mut impl Write,
    [width, height]: [u32; 2],
    pixels: Pixels<'_>,
    notes: &[Note<'_>],
) -> Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_compression(png::Compression::Fast);
    let (colour, depth, bytes) = match pixels {
        Pixels::Rgb8(bytes) => (png::ColorType::Rgb, png::BitDepth::Eight, bytes),
        Pixels::Grey16(bytes) => (png::ColorType::Grayscale, png::BitDepth::Sixteen, bytes),
    };
    encoder.set_color(colour);
    encoder.set_depth(depth);
    if matches!(pixels, Pixels::Rgb8(_)) {
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    }
    for note in notes {
        let (keyword, text) = (note.keyword.to_owned(), note.text.to_owned());
        match text.is_ascii() {
            true => encoder.add_text_chunk(keyword, text)?,
            false => encoder.add_itxt_chunk(keyword, text)?,
        }
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    writer.finish()
}

/// The text of the address that a picture carries.
///
/// # Errors
/// [`PictureError`]: the rest of a sentence that begins with the file's name.
pub fn address(path: &Path) -> Result<String, PictureError> {
    text(&mut BufReader::new(File::open(path)?), ADDRESS)
}

/// The text of the first chunk with this keyword. Takes memory for one text at most.
///
/// # Errors
/// [`PictureError`].
pub fn text(file: &mut (impl Read + Seek), keyword: &str) -> Result<String, PictureError> {
    let mut signature = [0; 8];
    if !fill(file, &mut signature)? || signature != SIGNATURE {
        return Err(PictureError::NotPng);
    }
    for _ in 0..MAX_CHUNKS {
        let mut head = [0; 8];
        if !fill(file, &mut head)? {
            return Err(PictureError::Damaged);
        }
        let [a, b, c, d, kind @ ..] = head;
        let length = u32::from_be_bytes([a, b, c, d]) as usize;
        match &kind {
            b"IEND" => return Err(PictureError::NoAddress),
            b"tEXt" | b"zTXt" | b"iTXt" if length <= MAX_TEXT + MAX_HEADER => {
                let mut data = vec![0; length];
                let mut check = [0; 4];
                if !fill(file, &mut data)? || !fill(file, &mut check)? {
                    return Err(PictureError::Damaged);
                }
                let Some(rest) =
                    data.strip_prefix(keyword.as_bytes()).and_then(|rest| rest.strip_prefix(&[0]))
                else {
                    continue;
                };
                let mut sum = crc32fast::Hasher::new();
                sum.update(&kind);
                sum.update(&data);
                let sound = sum.finalize() == u32::from_be_bytes(check);
                return sound.then(|| plain(&kind, rest)).flatten().ok_or(PictureError::Damaged);
            }
            // Beyond the end the next head says so.
            _ => _ = file.seek(SeekFrom::Current(length as i64 + 4))?,
        }
    }
    Err(PictureError::Damaged)
}

/// Fills the buffer; false where the file ends before.
fn fill(file: &mut impl Read, buffer: &mut [u8]) -> io::Result<bool> {
    match file.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

/// The text behind a chunk's keyword. Other programs may have packed it.
fn plain(kind: &[u8; 4], data: &[u8]) -> Option<String> {
    match (kind, data) {
        (b"tEXt", text) => String::from_utf8(text.to_vec()).ok(),
        (b"zTXt", [0, packed @ ..]) => unpack(packed),
        (b"iTXt", [packed, _, rest @ ..]) => {
            // Language and translated keyword, each closed by a zero byte.
            let mut parts = rest.splitn(3, |byte| *byte == 0);
            let text = parts.nth(2)?;
            if *packed == 1 { unpack(text) } else { String::from_utf8(text.to_vec()).ok() }
        }
        _ => None,
    }
}

/// No more than the longest address, whatever it was packed from.
fn unpack(packed: &[u8]) -> Option<String> {
    let mut text = Vec::new();
    let mut reader = flate2::read::ZlibDecoder::new(packed).take(MAX_TEXT as u64 + 1);
    reader.read_to_end(&mut text).ok()?;
    (text.len() <= MAX_TEXT).then(|| String::from_utf8(text).ok()).flatten()
}
