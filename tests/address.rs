//! Addresses: text and back to the same bits, a place rebuilt exactly at any depth, and whatever is no address of ours
//! refused in a sentence.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

#[path = "support/terrain.rs"]
mod support;

use std::sync::LazyLock;
use std::time::Instant;

use fathomless::address::{Address, AddressError, MAX_LEVEL, MAX_TEXT, Scribe, WorldError, fingerprint};
use fathomless::course::Stand;
use fathomless::terrain::hash::mix;
use fathomless::terrain::place::{Dive, START_LEVEL};
use fathomless::terrain::tile::Cells;
use fathomless::terrain::{GENERATOR_VERSION, Place, Scheme, Spine, Surface, Terrace, Tile};
use fathomless::world::World;
use glam::{DVec3, Quat};
use proptest::prelude::*;
use support::{path, surface};

fn world(name: &str, surface: Surface) -> World {
    World { name: name.to_owned(), surface, ..World::load("hills").unwrap() }
}

fn canyonlands() -> World {
    World::load("canyonlands").unwrap()
}

/// A viewer somewhere in the anchor tile or a quarter tile beside it, with all 52 bits used.
fn stand(place: Place, [x, y, z]: [f64; 3], turn: [f32; 3]) -> Stand {
    let depth = place.level() as f64 - START_LEVEL as f64 + 0.3;
    let orientation =
        Quat::from_rotation_y(turn[0]) * Quat::from_rotation_x(turn[1]) * Quat::from_rotation_z(turn[2]);
    Stand {
        place: Place { position: DVec3::new(x, y, z), ..place },
        height: 1.7 + y.abs(),
        depth,
        orientation,
    }
}

fn bits(address: &Address) -> Vec<u64> {
    let view = &address.view;
    let doubles =
        [view.position.x, view.position.y, view.position.z, view.height, view.depth].map(f64::to_bits);
    let turn = view.orientation.to_array().map(|v| u64::from(v.to_bits()));
    doubles.into_iter().chain(turn).collect()
}

/// Its checksum put right, as a forger would.
fn signed(body: &str) -> String {
    format!("{body}:{:08x}", crc32fast::hash(body.as_bytes()))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn text_and_back_to_the_same_place(
        surface in surface(), path in path(12), name in "[a-zA-Z0-9_. :%é山-]{1,20}",
        at in [-0.25f64..1.25, -3.0f64..9.0, -0.25f64..1.25], turn in [-3.0f32..3.0, -1.5f32..1.5, -3.0f32..3.0],
    ) {
        let world = world(&name, surface);
        let stand = stand(Place { spine: path.spine(surface), position: DVec3::ZERO }, at, turn);
        let address = Address::of(&world, &stand.standpoint());
        let text = address.to_string();
        let again: Address = text.parse().unwrap();
        prop_assert_eq!(&again, &address);
        prop_assert_eq!(bits(&again), bits(&address));
        prop_assert_eq!(again.to_string(), text);

        prop_assert_eq!(again.level(), stand.place.level());
        let found = again.world(Some(&world)).unwrap();
        prop_assert_eq!(&found, &world);
        let there = again.stand(&found.surface);
        prop_assert_eq!(there.place.spine.canonical(), stand.place.spine.canonical());
        prop_assert_eq!(there.place.spine.bottom().block, stand.place.spine.bottom().block);
        prop_assert_eq!(there.place.position.to_array().map(f64::to_bits), at.map(f64::to_bits));
        for (dx, dz) in [(0.0, 0.0), (0.3, -0.7), (-0.75, 0.75)] {
            let ground = |place: &Place| place.ground(at[0] + dx, at[2] + dz).to_bits();
            prop_assert_eq!(ground(&there.place), ground(&stand.place));
        }
        let (patch, other) = (there.place.spine.bottom().block.patch(1, -1), stand.place.spine.bottom().block.patch(1, -1));
        let cells = Cells::new(16).unwrap();
        prop_assert_eq!(Tile::of(&surface, &patch.0, cells), Tile::of(&surface, &other.0, cells));
    }

}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    /// Two ways to one tile, one of them with redundant digits and over borders: one text.
    #[test]
    fn one_place_has_one_address(surface in surface(), path in path(8), steps in prop::collection::vec((-1i32..=1, -1i32..=1), 0..9)) {
        let world = world("w", surface);
        let mut spine = path.spine(surface);
        for (dx, dz) in steps {
            spine.walk(dx, dz);
        }
        let (root, quadrants) = spine.canonical();
        let mut direct = Spine::new(surface, root[0], root[1]);
        for quadrant in quadrants {
            direct.push(quadrant.map(|q| q as i8));
        }
        let address = |spine: Spine| {
            let stand = stand(Place { spine, position: DVec3::ZERO }, [0.5; 3], [0.0; 3]);
            Address::of(&world, &stand.standpoint()).to_string()
        };
        prop_assert_eq!(address(spine), address(direct));
    }

    /// A scribe that remembers writes what one that has just begun would.
    #[test]
    fn a_scribe_writes_the_same_however_much_it_remembers(
        surface in surface(), path in path(4), moves in prop::collection::vec((-1i32..=1, -1i32..=1, -9i32..9), 1..12),
    ) {
        let world = world("w", surface);
        let mut scribe = Scribe::new(&world);
        let mut place = Place { spine: path.spine(surface), position: DVec3::new(0.4, 1.0, 0.6) };
        for (dx, dz, levels) in moves {
            place.spine.walk(dx, dz);
            for _ in 0..levels.abs() {
                if levels > 0 { place.deeper() } else { _ = place.shallower() }
            }
            let stand = stand(place.clone(), [0.5; 3], [0.0; 3]);
            let standpoint = stand.standpoint();
            prop_assert_eq!(scribe.address(&standpoint), Address::of(&world, &standpoint));
        }
    }

}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4_000, ..ProptestConfig::default() })]

    /// Whatever a forger writes, with a checksum that fits: a place that can be drawn, or a typed error.
    #[test]
    fn forgeries_are_refused_or_harmless(at in 11usize..140, with in "[ -~]{0,6}", cut in 0usize..12) {
        let text = at_start().0.to_string();
        let body = text.rsplit_once(':').unwrap().0;
        let at = at.min(body.len());
        let forged = signed(&format!("{}{with}{}", &body[..at], &body[(at + cut).min(body.len())..]));
        match forged.parse::<Address>() {
            Ok(address) => {
                prop_assert!(address.level() <= MAX_LEVEL && address.view.height > 0.0);
                prop_assert_eq!(address.to_string(), forged);
            }
            Err(error) => prop_assert!(!error.to_string().contains('\n')),
        }
    }

    #[test]
    fn noise_is_no_address(text in "(fathomless:)?[ -~\n:é]{0,300}") {
        prop_assert!(text.parse::<Address>().is_err());
    }
}

/// A place on the world's own dive, with its address.
fn at_start() -> (Address, Stand) {
    static START: LazyLock<(Address, Stand)> = LazyLock::new(make_start);
    START.clone()
}

fn make_start() -> (Address, Stand) {
    let world = canyonlands();
    let place = Dive::new(world.surface, START_LEVEL, |_| ()).place(START_LEVEL);
    let position = (place.position + DVec3::new(0.0, 3.0, 0.0)).to_array();
    let stand = stand(place, position, [0.5, -0.2, 0.0]);
    (Address::of(&world, &stand.standpoint()), stand)
}

#[test]
fn a_dive_is_a_short_text_at_any_depth() {
    let world = canyonlands();
    let dive = Dive::new(world.surface, START_LEVEL + 100_000, |_| ());
    for depth in [0, 1, 1_000, 100_000] {
        let place = dive.place(START_LEVEL + depth);
        let position = place.position.to_array();
        let stand = stand(place, position, [1.0; 3]);
        let start = Instant::now();
        let address = Address::of(&world, &stand.standpoint());
        let text = address.to_string();
        let written = start.elapsed();
        assert!(text.len() < 160, "{} letters: {text}", text.len());
        let start = Instant::now();
        let there = text.parse::<Address>().unwrap().place(&world.surface);
        println!("depth {depth}: written in {written:?}, read and rebuilt in {:?}", start.elapsed());
        assert_eq!(there.spine.bottom().block, stand.place.spine.bottom().block);
    }
}

#[test]
fn any_path_takes_two_bits_a_level() {
    let world = canyonlands();
    let mut spine = Spine::new(world.surface, 5, u32::MAX);
    for i in 0..100_000 {
        spine.push([(mix(i) & 1) as i8, (mix(i) >> 1 & 1) as i8]);
    }
    let stand = stand(Place { spine, position: DVec3::ZERO }, [0.1; 3], [0.0; 3]);
    let text = Address::of(&world, &stand.standpoint()).to_string();
    // 6 bits a letter.
    assert!(text.len() <= 100_000 / 3 + 200, "{} letters", text.len());
    let start = Instant::now();
    let address: Address = text.parse().unwrap();
    let there = address.place(&world.surface);
    println!(
        "100 000 levels of no pattern: {} letters, read and rebuilt in {:?}",
        text.len(),
        start.elapsed()
    );
    assert_eq!(there.spine.bottom().block, stand.place.spine.bottom().block);

    // A path along a border, and one that leaves the dive for a while.
    let mut spine = Spine::new(world.surface, 0, 0);
    for _ in 0..100_000 {
        spine.push([1, 0]);
    }
    let along = self::stand(Place { spine, position: DVec3::ZERO }, [0.1; 3], [0.0; 3]);
    let text = Address::of(&world, &along.standpoint()).to_string();
    assert!(text.len() < 200 && text.contains("r1."), "{text}");
}

#[test]
fn blanks_and_line_breaks_do_not_count() {
    let address = at_start().0;
    let text = address.to_string();
    let wrapped: Vec<&str> = (0..text.len()).step_by(30).map(|i| &text[i..text.len().min(i + 30)]).collect();
    assert_eq!(format!("  {}\r\n", wrapped.join("\n ")).parse::<Address>().unwrap(), address);
}

#[test]
fn every_typing_error_is_found() {
    let text = at_start().0.to_string();
    for i in 0..text.len() {
        for letter in ["x", "0", ":", "", "é", "AA"] {
            let wrong = format!("{}{letter}{}", &text[..i], &text[i + 1..]);
            if wrong == text {
                continue;
            }
            let error = wrong.parse::<Address>().unwrap_err();
            assert!(matches!(error, AddressError::Damaged | AddressError::Foreign), "{wrong}: {error}");
        }
        assert!(text[..i].parse::<Address>().is_err(), "cut short at {i}");
    }
}

#[test]
fn what_is_no_address_is_told_in_a_sentence() {
    let text = at_start().0.to_string();
    let body = text.rsplit_once(':').unwrap().0;
    let with = |from: &str, to: &str| {
        assert!(body.contains(from), "{from} in {body}");
        signed(&body.replacen(from, to, 1))
    };
    let next = format!("fathomless:{}:", GENERATOR_VERSION + 1);
    let seed = format!(":{}:", canyonlands().surface.seed);
    let viewer = body.rsplit_once(':').unwrap().1;
    let cases = [
        ("geo:45.8,15.9".to_owned(), "begins with `fathomless:`"),
        (String::new(), "begins with `fathomless:`"),
        ("fathomless".to_owned(), "begins with `fathomless:`"),
        ("fathomless:".to_owned(), "cut short or mistyped"),
        (text.to_uppercase(), "begins with `fathomless:`"),
        (format!("fathomless:{}", "A".repeat(MAX_TEXT)), "no address is longer"),
        (with("fathomless:1:", &next), "generator version 2, and this fathomless has version 1"),
        (signed(&format!("{next}a-format-nobody-knows-yet")), "generator version 2"),
        (with("fathomless:1:", "fathomless:-1:"), "the version of this address"),
        (with("fathomless:1:", "fathomless::"), "the version of this address"),
        (with("canyonlands.", "canyonlands"), "the world of this address"),
        (with("canyonlands", ""), "the world of this address"),
        (with("canyonlands", "%0A"), "the world of this address"),
        (with("canyonlands", "%ff"), "the world of this address"),
        (with("canyonlands", "%4"), "the world of this address"),
        (with("canyonlands", &"w".repeat(256)), "the world of this address"),
        (with("canyonlands", "c%61nyonlands"), "the spelling of this address"),
        (with(&seed, ":18446744073709551616:"), "the seed of this address"),
        (with(&seed, ":+1:"), "the seed of this address"),
        (with(&seed, ":007:"), "the spelling of this address"),
        (with(":0.0:", ":0.4294967296:"), "the root of this address"),
        (with(":0.0:", ":0:"), "the root of this address"),
        (with(":d4096:", ":d2100001:"), "the path of this address"),
        (with(":d4096:", ":d2000000d2000000:"), "the path of this address"),
        (with(":d4096:", ":d99999999999999999999999:"), "the path of this address"),
        (with(":d4096:", ":r4.4096:"), "the path of this address"),
        (with(":d4096:", ":d4096q0.:"), "the path of this address"),
        (with(":d4096:", ":q2000000.AAAA:"), "the path of this address"),
        (with(":d4096:", ":d4095q1.é:"), "the path of this address"),
        (with(":d4096:", ":d4095q1._:"), "the spelling of this address"),
        (with(":d4096:", ":x4096:"), "the path of this address"),
        // Another level than the viewer's depth says.
        (with(":d4096:", ":d40:"), "the viewer of this address"),
        (with(viewer, &viewer[1..]), "the viewer of this address"),
        (with(viewer, &format!("{viewer}AAAA")), "the viewer of this address"),
        (with(viewer, &"A".repeat(75)), "the viewer of this address"),
        (with(viewer, &"_".repeat(75)), "the viewer of this address"),
        (signed(&format!("{body}:x")), "the number of parts of this address"),
        (signed("fathomless:1"), "the world of this address"),
    ];
    for (text, words) in cases {
        let sentence = text.parse::<Address>().expect_err(&text).to_string();
        assert!(
            sentence.contains(words) && !sentence.contains('\n'),
            "{words:?} expected: {sentence}: {text:.300}"
        );
    }
}

#[test]
fn a_view_that_cannot_be_drawn_is_refused() {
    let (good, _) = at_start();
    let spoilt: [fn(&mut Address); 10] = [
        |a| a.view.position.x = f64::NAN,
        |a| a.view.position.z = 2.1,
        |a| a.view.position.y = f64::INFINITY,
        |a| a.view.height = 0.0,
        |a| a.view.height = -1.0,
        |a| a.view.height = f64::NAN,
        |a| a.view.depth = 1e6,
        |a| a.view.depth = f64::NAN,
        |a| a.view.orientation = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0),
        |a| a.view.orientation = Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0),
    ];
    for (i, spoil) in spoilt.into_iter().enumerate() {
        let mut address = good.clone();
        spoil(&mut address);
        let error = address.to_string().parse::<Address>().unwrap_err();
        assert_eq!(error, AddressError::Forged { part: "viewer" }, "case {i}");
    }
}

#[test]
fn a_changed_world_says_so() {
    let (address, _) = at_start();
    assert_eq!(address.world(None).unwrap(), canyonlands());
    // The look is not part of the place, the seed is the address's.
    let mut repainted =
        World { look: World::load("hills").unwrap().look, name: "mine".to_owned(), ..canyonlands() };
    repainted.surface.seed = 5;
    let found = address.world(Some(&repainted)).unwrap();
    assert_eq!((found.look, found.surface), (repainted.look.clone(), canyonlands().surface));

    let surface = canyonlands().surface;
    let terrace = surface.terrace.unwrap();
    let changed = [
        Surface { amplitude: surface.amplitude + 1, ..surface },
        Surface { scheme: Scheme::Bilinear, ..surface },
        Surface { terrace: None, ..surface },
        Surface { terrace: Some(Terrace { tread_fall: terrace.tread_fall + 1, ..terrace }), ..surface },
        Surface { terrace: Some(Terrace { riser_fall: terrace.riser_fall + 1, ..terrace }), ..surface },
        Surface { terrace: Some(Terrace { period: terrace.period * 2, ..terrace }), ..surface },
    ];
    for surface in changed {
        let error = address.world(Some(&world("other", surface))).unwrap_err();
        assert!(matches!(error, WorldError::Changed { .. }));
        let sentence = error.to_string();
        for word in ["`canyonlands`", "`other`", "has changed", &format!("{:08x}", fingerprint(&surface))] {
            assert!(sentence.contains(word), "{word}: {sentence}");
        }
    }
    let own = Address::of(&world("mine", surface), &at_start().1.standpoint());
    assert_eq!(own.world(None), Err(WorldError::Unknown { name: "mine".to_owned() }));
}

/// Where this fails, heights have changed: count GENERATOR_VERSION up, and put the new sum here.
#[test]
fn heights_of_this_generator_version() {
    let surfaces = [
        (Scheme::Cubic, Terrace::new(4, 0.6, 0.2)),
        (Scheme::Bilinear, Terrace::new(2, 0.5, 0.3)),
        (Scheme::Cubic, None),
        (Scheme::Bilinear, None),
    ];
    let mut sum = crc32fast::Hasher::new();
    for (scheme, terrace) in surfaces {
        let surface = Surface { seed: 0x0123_4567_89ab_cdef, scheme, amplitude: 29_491, terrace, only: None };
        let dive = Dive::new(surface, 5_000, |_| ());
        for level in [0, 1, 100, 4_096, 5_000] {
            let (patch, _) = dive.step(level).block.patch(0, -1);
            let tile = Tile::of(&surface, &patch, Cells::new(16).unwrap());
            for height in tile.fine {
                sum.update(&height.to_le_bytes());
            }
        }
    }
    assert_eq!((GENERATOR_VERSION, sum.finalize()), (1, 4_247_828_872));
}
