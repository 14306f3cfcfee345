//! World files: the shipped ones load, and a bad one gets its line, what is wrong and what would be right.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::path::Path;

use fathomless::terrain::{Scheme, Terrace};
use fathomless::world::{LoadError, World, linear_from_srgb, luminance};
use proptest::prelude::*;

const CANYONLANDS: &str = include_str!("../config/worlds/canyonlands.toml");

#[test]
fn every_file_in_config_is_a_built_in_world() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/worlds");
    let mut files: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    files.sort();
    let mut names: Vec<&str> = World::names().collect();
    names.sort_unstable();
    assert_eq!(files, names);
    for name in names {
        let built_in = World::load(name).unwrap();
        let path = folder.join(format!("{name}.toml"));
        let from_file = World::load(path.to_str().unwrap()).unwrap();
        assert_eq!(built_in, from_file, "{name}");
        assert_eq!(built_in.name, name);
    }
}

#[test]
fn the_worlds_are_the_designs() {
    assert_eq!(World::names().next(), Some("canyonlands"), "the default comes first");

    let canyonlands = World::load("canyonlands").unwrap().surface;
    assert_eq!(canyonlands.scheme, Scheme::Cubic);
    assert_eq!(canyonlands.amplitude, 29_491, "0.45 of 65 536");
    assert_eq!(canyonlands.terrace, Terrace::new(4, 0.6, 0.2));
    assert!(canyonlands.terrace.is_some());

    let tunkovic = World::load("tunkovic").unwrap().surface;
    assert_eq!((tunkovic.scheme, tunkovic.amplitude, tunkovic.terrace), (Scheme::Bilinear, 26_214, None));

    let hills = World::load("hills").unwrap().surface;
    assert_eq!((hills.scheme, hills.amplitude, hills.terrace), (Scheme::Cubic, 36_045, None));
}

#[test]
fn a_look_is_in_range() {
    for name in World::names() {
        let look = World::load(name).unwrap().look;
        assert!((4..=8).contains(&look.materials.len()), "{name}");
        assert_eq!(look.materials[0].slope, 0.0, "{name}");
        assert!(look.materials.windows(2).all(|pair| pair[0].slope < pair[1].slope), "{name}");
        let length = look.sun_direction.iter().map(|c| c * c).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 1e-6, "{name}: the sun's direction is {length} long");
        assert!(look.sun_direction[1] > 0.0, "{name}: the sun is above the horizon");
        for tint in &look.drift_tints {
            assert!((luminance(*tint) - 1.0).abs() < 1e-5, "{name}: {tint:?}");
        }
        assert!(look.haze_clear_octaves < look.haze_close_octaves, "{name}");
    }
}

#[test]
fn colours_become_linear_light() {
    assert_eq!(linear_from_srgb(0), 0.0);
    assert_eq!(linear_from_srgb(255), 1.0);
    // Mid grey of sRGB holds about a fifth of the light.
    assert!((linear_from_srgb(0x77) - 0.1845).abs() < 1e-3);
    let sand = World::load("canyonlands").unwrap().look.materials[0].colour;
    assert_eq!(sand, [0xd8, 0xbb, 0x8a].map(linear_from_srgb));
}

/// The shipped file with one piece of its text exchanged.
fn canyonlands_with(from: &str, to: &str) -> String {
    assert!(CANYONLANDS.contains(from), "the shipped file has no {from:?}");
    CANYONLANDS.replacen(from, to, 1)
}

/// A bad text is refused at the line that holds `at`, with all these words.
fn refused(text: &str, at: &str, words: &[&str]) {
    let line =
        1 + text.find(at).map(|start| text[..start].matches('\n').count()).expect("the text holds `at`");
    let error = World::parse("my.toml", text).expect_err(at);
    let sentence = error.to_string();
    assert!(sentence.starts_with(&format!("my.toml:{line}: ")), "line {line} expected: {sentence}");
    assert!(sentence.contains("; "), "says what would be right: {sentence}");
    assert!(!sentence.contains('\n'), "one line: {sentence}");
    for word in words {
        assert!(sentence.contains(word), "{word:?} expected: {sentence}");
    }
}

#[test]
fn values_out_of_range_are_refused_with_their_line() {
    let cases: &[(&str, &str, &[&str])] = &[
        ("amplitude = 0.45", "amplitude = 1", &["`amplitude` is 1", "from 0 to below 1"]),
        ("amplitude = 0.45", "amplitude = -0.1", &["`amplitude` is -0.1"]),
        ("amplitude = 0.45", "amplitude = nan", &["`amplitude` is nan"]),
        ("amplitude = 0.45", "amplitude = inf", &["`amplitude` is inf"]),
        ("amplitude = 0.45", "amplitude = \"big\"", &["`amplitude` is \"big\"", "a number"]),
        ("scheme = \"cubic\"", "scheme = \"quintic\"", &["\"quintic\"", "\"bilinear\" or \"cubic\""]),
        ("scheme = \"cubic\"", "scheme = 3", &["`scheme` is 3", "\"bilinear\" or \"cubic\""]),
        ("seed = 42", "seed = -1", &["`seed` is -1", "whole number"]),
        ("seed = 42", "seed = 1.5", &["`seed` is 1.5", "whole number"]),
        ("seed = 42", "seed = 18446744073709551616", &["`seed` is 18446744073709551616"]),
        ("period_cells = 4", "period_cells = 6", &["`period_cells` is 6", "1, 2, 4, 8 or 16"]),
        ("period_cells = 4", "period_cells = 0", &["`period_cells` is 0"]),
        ("period_cells = 4", "period_cells = 32", &["`period_cells` is 32"]),
        ("tread_slope = 0.6", "tread_slope = 1.01", &["`tread_slope` is 1.01", "from 0"]),
        ("riser_width = 0.2", "riser_width = 0.01", &["`riser_width` is 0.01", "0.02 to below 1"]),
        ("riser_width = 0.2", "riser_width = 1", &["`riser_width` is 1", "0.02 to below 1"]),
        ("riser_width = 0.2", "riser_width = 0.05", &["`riser_width` is 0.05", "stays below 16"]),
        ("colour = \"#d8bb8a\"", "colour = \"d8bb8a\"", &["`colour` is \"d8bb8a\"", "#c8a070"]),
        ("colour = \"#d8bb8a\"", "colour = \"#d8bb8\"", &["`colour` is"]),
        ("colour = \"#d8bb8a\"", "colour = \"#d8bb8g\"", &["`colour` is"]),
        ("colour = \"#d8bb8a\"", "colour = \"#+8bb8a\"", &["`colour` is"]),
        ("colour = \"#d8bb8a\"", "colour = 7", &["`colour` is 7", "sRGB"]),
        ("slope = 0.0\n", "slope = 0.1\n", &["`slope` is 0.1", "0 for the first"]),
        ("slope = 0.95", "slope = 0.3", &["`slope` is 0.3;", "rising"]),
        ("grain = 0.35", "grain = 2", &["`grain` is 2", "0 to 1"]),
        ("band_cells = 0.5", "band_cells = 0", &["`band_cells` is 0"]),
        ("\"#a5573a\"", "\"red\"", &["`colours` is \"red\""]),
        ("colours = [", "colours = [\"#102030\",", &["`colours` is [\"#102030\"", "1 to 4"]),
        ("\"#ffe2c4\"", "\"#000000\"", &["`tints` is \"#000000\"", "black"]),
        ("round_octaves = 60", "round_octaves = 0", &["`round_octaves` is 0"]),
        ("sun_elevation_deg = 32", "sun_elevation_deg = 91", &["`sun_elevation_deg` is 91", "90"]),
        ("sun_azimuth_deg = 125", "sun_azimuth_deg = 361", &["`sun_azimuth_deg` is 361"]),
        ("sun_strength = 1.35", "sun_strength = -1", &["`sun_strength` is -1"]),
        ("sky_strength = 0.75", "sky_strength = 21", &["`sky_strength` is 21"]),
        ("close_octaves = 32", "close_octaves = 5", &["`close_octaves` is 5", "above clear_octaves"]),
        ("clear_octaves = 5", "clear_octaves = 65", &["`clear_octaves` is 65"]),
    ];
    for (from, to, words) in cases {
        refused(&canyonlands_with(from, to), to.trim_end(), words);
    }
}

#[test]
fn keys_are_checked_with_their_line() {
    let unknown = canyonlands_with("amplitude = 0.45", "amplitud = 0.45");
    refused(&unknown, "amplitud", &["unknown key `amplitud`", "`seed`", "did you mean `amplitude`?"]);
    let unknown = canyonlands_with("[haze]", "[fog]");
    refused(&unknown, "[fog]", &["unknown key `fog`", "`haze`", "`light`"]);
    let missing = canyonlands_with("amplitude = 0.45", "");
    refused(&missing, "[surface]", &["`amplitude` is missing", "a number from 0"]);
    let missing = canyonlands_with("title = ", "# ");
    refused(&missing, "#", &["`title` is missing", "one line"]);
    let twice = canyonlands_with("seed = 42", "seed = 1\nseed  = 2");
    refused(&twice, "seed  =", &["`seed` is given twice"]);
    let empty = canyonlands_with(
        "title = \"Sandstone mesas and canyons, with a ledge at every scale (the default)\"",
        "title = ''",
    );
    refused(&empty, "title", &["`title` is ''"]);
    refused("\n\n[surface\n", "[surface", &["unclosed table"]);
    refused("title = 'x'\nsurface = 3\n", "surface", &["`surface` is 3", "[surface] with seed"]);
    refused("", "", &["`title` is missing"]);
}

#[test]
fn materials_are_four_to_eight() {
    let head = CANYONLANDS.split_once("[[material]]").unwrap().0;
    let tail = CANYONLANDS.split_once("[strata]").unwrap().1;
    let with = |count: usize| {
        let one = |i| format!("[[material]]\ncolour = \"#808080\"\nslope = {i}\n");
        format!("{head}{}[strata]{tail}", (0..count).map(one).collect::<String>())
    };
    for count in 4..=8 {
        assert_eq!(World::parse("my.toml", &with(count)).unwrap().look.materials.len(), count);
    }
    refused(&with(3), "[[material]]", &["3 materials", "4 to 8"]);
    refused(&with(9), "[[material]]", &["9 materials", "4 to 8"]);
    let none = with(0);
    let error = World::parse("my.toml", &none).unwrap_err().to_string();
    assert!(error.contains("`material` is missing") && error.contains("4 to 8"), "{error}");
}

#[test]
fn strata_need_their_table() {
    let (head, tail) = CANYONLANDS.split_once("[strata]").unwrap();
    let rest = tail.split_once("[drift]").unwrap().1;
    let without = format!("{head}[drift]{rest}");
    refused(&without, "strata = 0.1", &["does not describe", "[strata]"]);
}

#[test]
fn the_whole_range_of_seeds_can_be_written() {
    for seed in [0, u64::MAX] {
        let text = canyonlands_with("seed = 42", &format!("seed = {seed}"));
        assert_eq!(World::parse("my.toml", &text).unwrap().surface.seed, seed);
    }
}

#[test]
fn a_world_goes_by_name_or_path() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml");
    std::fs::write(&path, CANYONLANDS).unwrap();
    let mine = World::load(path.to_str().unwrap()).unwrap();
    assert_eq!(mine.name, "mine");
    assert_eq!(mine.surface, World::load("canyonlands").unwrap().surface);

    let error = World::load("canyonland").unwrap_err();
    assert!(matches!(error, LoadError::Unknown { .. }));
    let sentence = error.to_string();
    for word in ["`canyonland`", "canyonlands, hills, tunkovic", "did you mean `canyonlands`?"] {
        assert!(sentence.contains(word), "{sentence}");
    }

    let absent = folder.path().join("absent.toml");
    let error = World::load(absent.to_str().unwrap()).unwrap_err();
    assert!(matches!(error, LoadError::Unreadable { .. }));
    assert!(error.to_string().contains("absent.toml"), "{error}");

    std::fs::write(&path, [0xff, 0xfe, 0x00]).unwrap();
    let error = World::load(path.to_str().unwrap()).unwrap_err();
    assert!(matches!(error, LoadError::Unreadable { .. }), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Whatever is done to a file, it is either a good world or refused in one line that names a line of it.
    #[test]
    fn a_damaged_file_never_panics(at in 0..CANYONLANDS.len(), length in 0usize..40, junk in "[ -~\n]{0,6}") {
        let floor = |i: usize| (0..=i.min(CANYONLANDS.len())).rev().find(|&i| CANYONLANDS.is_char_boundary(i)).unwrap();
        let (start, end) = (floor(at), floor(at + length));
        let text = format!("{}{junk}{}", &CANYONLANDS[..start], &CANYONLANDS[end..]);
        match World::parse("my.toml", &text) {
            Ok(world) => prop_assert!(world.look.materials.len() >= 4),
            Err(error) => {
                prop_assert!((1..=text.lines().count() + 1).contains(&error.line), "{error}");
                prop_assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
}
