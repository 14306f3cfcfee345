//! PURE: depths in things that people know: how large what is seen would be, if the start was the Earth.

use std::f64::consts::LOG10_2;

/// log10 of the Earth's diameter in metres.
const EARTH: f64 = 7.105_3;

/// Things by log10 of their size in metres, from the largest down.
const THINGS: &[(f64, &str)] = &[
    (26.94, "the observable universe"),
    (24.7, "a supercluster of galaxies"),
    (22.9, "the galaxies next to ours"),
    (20.9, "the Milky Way"),
    (19.0, "a spiral arm of the Milky Way"),
    (17.6, "the way to the nearest star"),
    (15.98, "a light year"),
    (13.0, "the Solar System out to Pluto"),
    (11.18, "the way to the Sun"),
    (9.14, "the Sun"),
    (8.15, "Jupiter"),
    (EARTH, "the Earth"),
    (6.54, "the Moon"),
    (6.0, "a large country"),
    (5.3, "a small country"),
    (4.5, "a large city"),
    (3.9, "a mountain"),
    (3.0, "a village"),
    (2.5, "a skyscraper"),
    (2.0, "a football pitch"),
    (1.4, "a house"),
    (0.7, "a car"),
    (0.23, "a person"),
    (-0.3, "a cat"),
    (-1.0, "a hand"),
    (-1.5, "a walnut"),
    (-2.0, "a fingernail"),
    (-2.6, "an ant"),
    (-3.3, "a grain of sand"),
    (-4.1, "the width of a hair"),
    (-5.1, "a blood cell"),
    (-5.7, "a bacterium"),
    (-7.0, "a virus"),
    (-8.6, "the width of DNA"),
    (-10.0, "an atom"),
    (-12.5, "an X-ray's wave"),
    (-14.0, "an atomic nucleus"),
    (-15.0, "a proton"),
    (-19.0, "the smallest thing ever measured"),
    (PLANCK, "the Planck length, the smallest that physics knows"),
];

/// log10 of the Planck length in metres.
const PLANCK: f64 = -34.79;

/// What is as large as what is seen `octaves` below the start (negative: above it), if the start was the Earth: a noun
/// with its article. Below the smallest thing that physics knows the Earth begins again; above the largest there is
/// only a number.
pub fn yardstick(octaves: f64) -> String {
    let size = EARTH - octaves * LOG10_2;
    let largest = THINGS[0].0;
    if size > largest + 1.0 {
        return format!("10^{:.0} times the observable universe", size - largest);
    }
    // Falling on and on: each time as far as from the Earth to the Planck length.
    let rounds = ((PLANCK - size - 0.5) / (EARTH - PLANCK)).ceil().max(0.0);
    let thing = nearest(size + rounds * (EARTH - PLANCK));
    match rounds {
        0.0 => thing.to_owned(),
        1.0 => format!("{thing}, if the Planck length was the Earth"),
        _ => format!("{thing}, after the way from the Earth to the Planck length {rounds:.0} times"),
    }
}

/// The things from one depth to another, deeper one, each with the depth at which it is as large as what is seen: the rungs
/// of a ladder. Falling on and on they come again, as [`yardstick`] says.
pub fn things_between(from: f64, to: f64) -> impl Iterator<Item = (f64, &'static str)> {
    let at = |size: f64| (EARTH - size) / LOG10_2;
    let [first, last] = [from, to].map(|depth| (depth / at(PLANCK)).floor().max(0.0) as u64);
    let rounds = (first..=last).flat_map(move |round| {
        // The Planck length is the Earth of the next round; what is larger than the first Earth is there once.
        let of_round = THINGS.iter().filter(move |(size, _)| round == 0 || *size < EARTH);
        of_round.map(move |(size, thing)| (at(*size) + round as f64 * at(PLANCK), *thing))
    });
    rounds.filter(move |(depth, _)| (from..=to).contains(depth))
}

/// The same as a power of ten: how many times smaller (or larger) than at the start, with the exponent's first decimal.
pub fn power_of_ten(octaves: f64) -> String {
    let exponent = octaves * LOG10_2;
    let word = if exponent < 0.0 { "larger" } else { "smaller" };
    match exponent.abs() {
        // 1000 times is still a number that says something.
        small if small < 3.0 => format!("{} times {word}", three_digits(10f64.powf(small))),
        large => format!("10^{large:.1} times {word}"),
    }
}

fn three_digits(number: f64) -> String {
    match number {
        n if n < 9.995 => format!("{n:.2}"),
        n if n < 99.95 => format!("{n:.1}"),
        n => format!("{n:.0}"),
    }
}

fn nearest(size: f64) -> &'static str {
    let how_far = |thing: &&(f64, &str)| (thing.0 - size).abs();
    THINGS.iter().min_by(|a, b| how_far(a).total_cmp(&how_far(b))).map_or("", |thing| thing.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_have_their_things() {
        let things = [
            (0.0, "the Earth"),
            (1.5, "the Moon"),
            (22.9, "a person"),
            (34.6, "a grain of sand"),
            (56.8, "an atom"),
            (139.2, "the Planck length, the smallest that physics knows"),
            (-6.8, "the Sun"),
            (-66.0, "the observable universe"),
            (-100.0, "10^10 times the observable universe"),
            (139.2 + 34.6, "a grain of sand, if the Planck length was the Earth"),
        ];
        for (octaves, thing) in things {
            assert_eq!(yardstick(octaves), thing, "{octaves}");
        }
        assert!(yardstick(100_000.0).ends_with("718 times"), "{}", yardstick(100_000.0));
    }

    #[test]
    fn things_shrink_down_the_list_and_none_leaves_a_gap_that_has_no_name() {
        for pair in THINGS.windows(2) {
            assert!(pair[0].0 > pair[1].0, "{pair:?}");
        }
        assert!((0..5000).all(|i| !yardstick(f64::from(i) * 0.37 - 200.0).is_empty()));
    }

    #[test]
    fn the_rungs_of_a_ladder_are_the_things_of_their_depths() {
        let names = |from, to| things_between(from, to).map(|(_, thing)| thing).collect::<Vec<_>>();
        assert_eq!(names(-1.0, 4.0), ["the Earth", "the Moon", "a large country"]);
        assert_eq!(names(-8.0, -1.0), ["the Sun", "Jupiter"]);
        assert_eq!(names(21.0, 26.0), ["a car", "a person", "a cat"]);
        assert_eq!(names(138.0, 142.0).len(), 2, "{:?}", names(138.0, 142.0));
        for from in [-90.0, 0.0, 57.0, 130.0, 1000.25, 1e6] {
            for (depth, thing) in things_between(from, from + 20.0) {
                assert!(yardstick(depth).starts_with(thing), "{depth}: {thing}, {}", yardstick(depth));
                assert!((from..=from + 20.0).contains(&depth));
            }
        }
    }

    #[test]
    fn powers_of_ten_are_numbers_as_long_as_they_say_something() {
        let texts = [
            (0.0, "1.00 times smaller"),
            (1.0, "2.00 times smaller"),
            (5.0, "32.0 times smaller"),
            (-3.0, "8.00 times larger"),
            (9.0, "512 times smaller"),
            (100.0, "10^30.1 times smaller"),
        ];
        for (octaves, text) in texts {
            assert_eq!(power_of_ten(octaves), text, "{octaves}");
        }
    }
}
