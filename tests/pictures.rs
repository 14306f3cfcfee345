//! Pictures carry their address: what was drawn can be gone to again, and is drawn again to the same pixels; what is
//! no picture of ours is refused in a sentence and does no harm.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::io::{Cursor, Write};
use std::path::Path;
use std::process::{Command, Output};
use std::sync::atomic::AtomicBool;

use fathomless::address::{Address, MAX_TEXT};
use fathomless::at::{self, Destination};
use fathomless::capture::{Job, capture};
use fathomless::cli::{Eyes, Shard};
use fathomless::course::Stand;
use fathomless::flight::Flight;
use fathomless::picture::{self, Note, PictureError, Pixels};
use fathomless::terrain::Place;
use fathomless::terrain::place::{Dive, START_LEVEL};
use fathomless::viewer::ViewerConfig;
use fathomless::world::World;
use glam::{DVec3, Quat};
use indicatif::ProgressBar;

const SIZE: [u32; 2] = [96, 96];

fn draw(world: &World, flight: &Flight, depth: usize, at: Option<&Destination>, frame: u64, out: &Path) {
    let job = Job {
        world,
        flight,
        depth,
        at,
        frames: frame..frame + 1,
        every: 1,
        shard: Shard::WHOLE,
        eyes: Eyes::Both,
        out,
        viewer: ViewerConfig { eye_size: Some(SIZE), ..ViewerConfig::default() },
    };
    let done = capture(&job, &AtomicBool::new(false), &ProgressBar::hidden()).unwrap();
    assert_eq!((done.frames, done.remarks), (1, Default::default()));
}

fn pixels(path: &Path) -> Vec<u8> {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    pixels
}

#[test]
fn a_picture_drawn_again_is_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let still = Flight::load("still").unwrap();
    // The dive's middle; sideways of the target, with pitch and heading; deep down.
    for (flight, depth, frame) in [("dive", 0, 77), ("over", 3, 201), ("dive", 2_000, 180)] {
        let world = World::load("canyonlands").unwrap();
        let flight = Flight::load(flight).unwrap();
        let [first, again] = ["first", "again"].map(|name| folder.path().join(format!("{name}-{frame}")));
        draw(&world, &flight, depth, None, frame, &first);
        let picture = first.join(format!("frame_{frame:06}_left.png"));
        let address = at::find(picture.as_os_str()).unwrap();
        assert_eq!(address.world(None).unwrap(), world);

        let at = Destination { address: address.clone(), stays: true };
        draw(&world, &still, 0, Some(&at), 0, &again);
        for side in ["left", "right"] {
            let before = pixels(&first.join(format!("frame_{frame:06}_{side}.png")));
            let after = pixels(&again.join(format!("frame_000000_{side}.png")));
            assert!(before.iter().max() > before.iter().min(), "an empty picture proves nothing");
            let apart = before.iter().zip(&after).filter(|(a, b)| a != b).count();
            assert_eq!(apart, 0, "{} of {}, depth {depth}, {side} eye: bytes differ", flight.name, frame);
        }
        // And its own address is the one that it was drawn from.
        assert_eq!(at::find(again.join("frame_000000_left.png").as_os_str()).unwrap(), address);
    }
}

/// Where a world begins there is nothing further out; a forged address may lead there all the same.
#[test]
fn the_worlds_beginning_can_be_gone_to() {
    let folder = tempfile::tempdir().unwrap();
    let world = World::load("tunkovic").unwrap();
    for level in [0, 1, 2, 5, 12] {
        let place = Dive::new(world.surface, level, |_| ()).place(level);
        let position = place.position + DVec3::new(0.0, 2.0, 0.0);
        let depth = level as f64 - START_LEVEL as f64;
        let stand =
            Stand { place: Place { position, ..place }, height: 2.0, depth, orientation: Quat::IDENTITY };
        let address = Address::of(&world, &stand.standpoint()).to_string().parse().unwrap();
        let dive = Flight::load("dive").unwrap();
        for stays in [true, false] {
            let at = Destination { address: Address::clone(&address), stays };
            draw(&world, &dive, 0, Some(&at), 100, &folder.path().join(format!("{level}")));
        }
    }
}

/// A flight from a picture of a dive goes on where the dive would have gone.
#[test]
fn a_flight_goes_on_from_a_picture() {
    let world = World::load("canyonlands").unwrap();
    let dive = Flight::load("dive").unwrap();
    let mut course = at::course(&world, &dive, 7, None);
    let address = Address::of(&world, &course.at(&dive.pose(90)));
    let at = Destination { address, stays: false };
    let mut on = at::course(&world, &dive, 0, Some(&at));
    let start = dive.pose(0);
    let here = on.at(&start);
    assert_eq!(here.depth, 7.0 + dive.pose(90).depth);
    let mut further = start;
    further.depth = dive.pose(90).depth;
    let (block, position) = (here.place.spine.bottom().block, here.position);
    let there = course.at(&further);
    assert_eq!(there.place.spine.bottom().block, block);
    assert!((there.position - position).length() < 1e-9, "{} {position}", there.position);
    // Its end is an address again, deeper by the flight's depth.
    let end = Address::of(&world, &on.at(&dive.pose(180)));
    assert_eq!(end.view.depth, at.address.view.depth + 6.0);
}

fn chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let sum = crc32fast::hash(&[kind, data].concat());
    [&(data.len() as u32).to_be_bytes(), kind.as_slice(), data, &sum.to_be_bytes()].concat()
}

fn file(chunks: &[Vec<u8>]) -> Vec<u8> {
    let end = chunk(b"IEND", b"");
    [picture::SIGNATURE.as_slice(), &chunks.concat(), &end].concat()
}

fn text(bytes: &[u8]) -> Result<String, PictureError> {
    picture::text(&mut Cursor::new(bytes), "Fathomless-Address")
}

fn packed(text: &[u8]) -> Vec<u8> {
    let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    packer.write_all(text).unwrap();
    packer.finish().unwrap()
}

#[test]
fn words_are_found_wherever_they_are() {
    let key = b"Fathomless-Address\0".as_slice();
    let body = chunk(b"IDAT", &[7; 100_000]);
    let other = chunk(b"tEXt", b"Software\0another");
    let plain = chunk(b"tEXt", &[key, b"here"].concat());
    let international = chunk(b"iTXt", &[key, b"\0\0en\0Ort\0here"].concat());
    let small = chunk(b"zTXt", &[key, b"\0", &packed(b"here")].concat());
    let both = chunk(b"iTXt", &[key, b"\x01\0\0\0", &packed(b"here")].concat());
    for kind in [plain, international, small, both] {
        for chunks in
            [[other.clone(), kind.clone(), body.clone()], [body.clone(), other.clone(), kind.clone()]]
        {
            assert_eq!(text(&file(&chunks)).unwrap(), "here");
        }
    }
}

#[test]
fn written_words_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.png");
    let long = "x".repeat(300_000);
    for text in ["short", "山 and é", &long] {
        let notes = [Note { keyword: "Software", text: "s" }, Note { keyword: picture::ADDRESS, text }];
        picture::write(&path, [2, 1], Pixels::Rgb8(&[1, 2, 3, 4, 5, 6]), &notes).unwrap();
        assert_eq!(picture::address(&path).unwrap(), text);
        assert_eq!(pixels(&path), [1, 2, 3, 4, 5, 6]);
    }
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1, "nothing half-written is left");
}

#[test]
fn forged_pictures_do_no_harm() {
    let key = b"Fathomless-Address\0".as_slice();
    let bomb = packed(&vec![b' '; 64 << 20]);
    assert!(bomb.len() < 100_000);
    let mut giant = file(&[]);
    giant.splice(8..16, [&u32::MAX.to_be_bytes(), b"IDAT".as_slice()].concat());
    let mut giant_text = file(&[]);
    giant_text.splice(8..16, [&u32::MAX.to_be_bytes(), b"tEXt".as_slice()].concat());
    let mut wrong_sum = file(&[chunk(b"tEXt", &[key, b"here"].concat())]);
    wrong_sum[36] ^= 1;
    let too_long = chunk(b"tEXt", &[key, &vec![b'x'; MAX_TEXT + 2_000]].concat());
    let damaged: [(&str, Vec<u8>); 9] = [
        ("giant chunk", giant),
        ("giant text chunk", giant_text),
        ("wrong sum", wrong_sum),
        ("bomb", file(&[chunk(b"zTXt", &[key, b"\0", &bomb].concat())])),
        ("international bomb", file(&[chunk(b"iTXt", &[key, b"\x01\0\0\0", &bomb].concat())])),
        ("packed noise", file(&[chunk(b"zTXt", &[key, b"\0noise"].concat())])),
        ("no method", file(&[chunk(b"zTXt", key)])),
        ("no flags", file(&[chunk(b"iTXt", key)])),
        ("not text", file(&[chunk(b"tEXt", &[key, b"\xff\xfe"].concat())])),
    ];
    for (what, bytes) in damaged {
        assert!(matches!(text(&bytes), Err(PictureError::Damaged)), "{what}: {:?}", text(&bytes));
    }
    // What is too long for an address, or goes beyond the end, is passed over like any other chunk.
    assert!(matches!(text(&file(&[too_long])), Err(PictureError::NoAddress)));
    assert!(matches!(text(&file(&[])), Err(PictureError::NoAddress)));
    assert!(matches!(text(b"GIF89a"), Err(PictureError::NotPng)));
    assert!(matches!(text(b""), Err(PictureError::NotPng)));

    let whole = file(&[chunk(b"IDAT", &[0; 50]), chunk(b"tEXt", &[key, b"here"].concat())]);
    for end in 0..whole.len() - 12 {
        assert!(text(&whole[..end]).is_err(), "cut at {end}");
    }
}

fn fathomless(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fathomless")).args(args).output().unwrap()
}

#[test]
fn what_leads_nowhere_is_told_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let world = World::load("hills").unwrap();
    let stand = at::stand(&world, 3, None);
    let address = Address::of(&world, &stand.standpoint()).to_string();
    let mut own = world.clone();
    own.name = "my hills".to_owned();
    let own = Address::of(&own, &stand.standpoint()).to_string();
    let cases: &[(&[&str], &[&str])] = &[
        (&["view", "--at", "mesa"], &["`mesa`", "neither an address", "@NAME"]),
        (&["view", "--at", &path("a.png", &file(&[]))], &["a.png", "only pictures made by fathomless do"]),
        (&["view", "--at", &path("b.png", &file(&[])[..15])], &["b.png", "damaged"]),
        (&["view", "--at", &path("c.png", b"GIF89a")], &["c.png", "neither a PNG"]),
        (&["view", "--at", &path("d.txt", &address.as_bytes()[..90])], &["d.txt", "cut short or mistyped"]),
        (&["view", "--at", folder.path().to_str().unwrap()], &["cannot be read"]),
        (&["view", "--at", ""], &["neither an address"]),
        (&["view", "--at", &address[..90]], &["cut short or mistyped"]),
        (&["view", "--at", &own], &["`my hills`", "--world"]),
        (&["view", "--at", &own, "--world", "canyonlands"], &["`my hills`", "`canyonlands`", "has changed"]),
        (&["capture", "--at", &address, "--seed", "3"], &["--seed"]),
        (&["capture", "--at", &address, "--depth", "3"], &["--depth"]),
        (&["capture", "--at", &address, "--frames", "0..2"], &["which has 1"]),
    ];
    for (args, words) in cases {
        let output = fathomless(args);
        let sentence = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {sentence}");
        assert_eq!(sentence.matches('\n').count(), 1, "{args:?}: {sentence}");
        for word in *words {
            assert!(sentence.contains(word), "{args:?}: {word:?} expected: {sentence}");
        }
    }
    for good in [address.as_str(), &path("e.txt", format!("{address}\n").as_bytes())] {
        assert!(fathomless(&["export", "--at", good, "--cells", "1"]).status.success());
    }
    assert!(fathomless(&["export", "--at", &own, "--world", "hills", "--cells", "1"]).status.success());
}
