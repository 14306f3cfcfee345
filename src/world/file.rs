//! World files: the keys, their raw form, and the checks that make a [`World`] of it.

use serde::Deserialize;
use toml::Spanned;

use super::source::{Embedded, FileError, Kind, Source};
use super::{Look, Material, Sun, World, linear_from_srgb, luminance};
use crate::terrain::{Scheme, Surface, Terrace};

macro_rules! embed {
    ($name:literal) => {
        Embedded {
            name: $name,
            file: concat!("config/worlds/", $name, ".toml"),
            text: include_str!(concat!("../../config/worlds/", $name, ".toml")),
        }
    };
}

/// World files. The first built-in one is the default.
pub(super) static KIND: Kind = Kind {
    name: "world",
    embedded: &[embed!("canyonlands"), embed!("hills"), embed!("tunkovic")],
    keys: &[
        ("title", "one line of text for people, such as title = \"Mesas at every scale\""),
        ("surface", "a table [surface] with seed, scheme and amplitude"),
        ("seed", "a whole number from 0 to 18446744073709551615"),
        ("scheme", "\"bilinear\" or \"cubic\""),
        ("amplitude", "a number from 0 to below 1, in cells, such as 0.45"),
        ("terrace", "a table [surface.terrace] with period_cells, tread_slope and riser_width"),
        ("period_cells", "a power of two: 1, 2, 4, 8 or 16"),
        ("tread_slope", "a number from 0 (level treads) to 1 (no terrace)"),
        (
            "riser_width",
            "a number from 0.02 to below 1, the riser's share of a step, not too narrow: (1 - tread_slope) * (1 - riser_width) / riser_width * period_cells stays below 16",
        ),
        ("material", "4 to 8 tables [[material]], each with colour and slope, the flattest first"),
        ("colour", "an sRGB colour such as \"#c8a070\""),
        ("slope", "a gradient from 0 to 100 (1 is 45 degrees): 0 for the first material, then rising"),
        (
            "strata",
            "in a [[material]] a number from 0 to 1; else a table [strata] with colours and band_cells",
        ),
        ("grain", "a number from 0 to 1"),
        ("colours", "a list of 1 to 4 sRGB colours such as [\"#c8a070\", \"#7a3b28\"]"),
        ("band_cells", "a number from 0.001 to 64, the height of one band in cells"),
        ("drift", "a table [drift] with tints and round_octaves"),
        ("tints", "a list of 1 to 8 sRGB colours such as [\"#ffffff\", \"#ffe8d0\"], none of them black"),
        ("round_octaves", "a number from 1 to 1000, the octaves for one round of the tints"),
        ("light", "a table [light] with the sun's direction and colour and the sky's colours"),
        ("sun_azimuth_deg", "a number from -360 to 360: 0 is ahead of the start, 90 to its right"),
        ("sun_elevation_deg", "a number from 0 (horizon) to 90 (zenith)"),
        ("sun_colour", "an sRGB colour such as \"#fff2e0\""),
        ("sun_strength", "a number from 0 to 20"),
        ("sky_strength", "a number from 0 to 20"),
        ("sky_zenith", "an sRGB colour such as \"#5a84c0\""),
        ("sky_horizon", "an sRGB colour such as \"#a8b8d0\""),
        ("haze", "a table [haze] with clear_octaves and close_octaves"),
        ("clear_octaves", "a number from 0 to 64, the octaves of clear air"),
        ("close_octaves", "a number above clear_octaves, up to 64: where nothing but haze is left"),
    ],
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawWorld {
    title: Spanned<String>,
    surface: RawSurface,
    material: Spanned<Vec<RawMaterial>>,
    strata: Option<RawStrata>,
    drift: RawDrift,
    light: RawLight,
    haze: RawHaze,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSurface {
    seed: u64,
    scheme: Spanned<String>,
    amplitude: Spanned<f64>,
    terrace: Option<RawTerrace>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTerrace {
    period_cells: Spanned<u32>,
    tread_slope: Spanned<f64>,
    riser_width: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMaterial {
    colour: Spanned<String>,
    slope: Spanned<f64>,
    strata: Option<Spanned<f64>>,
    grain: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStrata {
    colours: Spanned<Vec<Spanned<String>>>,
    band_cells: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawDrift {
    tints: Spanned<Vec<Spanned<String>>>,
    round_octaves: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLight {
    sun_azimuth_deg: Spanned<f64>,
    sun_elevation_deg: Spanned<f64>,
    sun_colour: Spanned<String>,
    sun_strength: Spanned<f64>,
    sky_strength: Spanned<f64>,
    sky_zenith: Spanned<String>,
    sky_horizon: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawHaze {
    clear_octaves: Spanned<f64>,
    close_octaves: Spanned<f64>,
}

/// Reads and checks a world file.
pub(super) fn check(source: &Source<'_>) -> Result<World, FileError> {
    let raw: RawWorld = source.parse()?;
    Ok(World {
        name: source.name.to_string(),
        title: title(source, &raw.title)?,
        surface: surface(source, &raw.surface)?,
        look: look(source, &raw)?,
    })
}

fn title(source: &Source<'_>, title: &Spanned<String>) -> Result<String, FileError> {
    let text = title.get_ref().trim();
    if text.is_empty() || text.chars().any(char::is_control) {
        return Err(source.refuse("title", title));
    }
    Ok(text.to_owned())
}

fn surface(source: &Source<'_>, raw: &RawSurface) -> Result<Surface, FileError> {
    let scheme = match raw.scheme.get_ref().as_str() {
        "bilinear" => Scheme::Bilinear,
        "cubic" => Scheme::Cubic,
        _ => return Err(source.refuse("scheme", &raw.scheme)),
    };
    Ok(Surface {
        seed: raw.seed,
        scheme,
        // Fixed point; what is just below 1 stays below it.
        amplitude: (source.number("amplitude", &raw.amplitude, 0.0..1.0)? * 65_536.0).round().min(65_535.0)
            as u16,
        terrace: raw.terrace.as_ref().map(|terrace| self::terrace(source, terrace)).transpose()?,
        only: None,
    })
}

fn terrace(source: &Source<'_>, raw: &RawTerrace) -> Result<Terrace, FileError> {
    let period_cells = *raw.period_cells.get_ref();
    if !period_cells.is_power_of_two() || period_cells > 16 {
        return Err(source.refuse("period_cells", &raw.period_cells));
    }
    let tread_slope = source.number("tread_slope", &raw.tread_slope, 0.0..=1.0)?;
    let riser_width = source.number("riser_width", &raw.riser_width, 0.02..1.0)?;
    // Too steep a riser leaves 32 bits: the wider it is, the gentler.
    Terrace::new(period_cells, tread_slope, riser_width)
        .ok_or_else(|| source.refuse("riser_width", &raw.riser_width))
}

fn look(source: &Source<'_>, raw: &RawWorld) -> Result<Look, FileError> {
    let (strata_colours, strata_band_cells) = match &raw.strata {
        Some(strata) => self::strata(source, strata)?,
        None => (Vec::new(), 1.0),
    };
    let light = &raw.light;
    let clear = source.number("clear_octaves", &raw.haze.clear_octaves, 0.0..=64.0)?;
    let close = source.number("close_octaves", &raw.haze.close_octaves, ..=64.0)?;
    if close <= clear {
        return Err(source.refuse("close_octaves", &raw.haze.close_octaves));
    }
    let sun_strength = source.number("sun_strength", &light.sun_strength, 0.0..=20.0)? as f32;
    Ok(Look {
        materials: materials(source, &raw.material, raw.strata.is_some())?,
        strata_colours,
        strata_band_cells,
        drift_tints: tints(source, &raw.drift.tints)?,
        drift_octaves: source.number("round_octaves", &raw.drift.round_octaves, 1.0..=1000.0)? as f32,
        sun_direction: sun_direction(source, light)?,
        sun_colour: colour(source, "sun_colour", &light.sun_colour)?.map(|channel| channel * sun_strength),
        sky_strength: source.number("sky_strength", &light.sky_strength, 0.0..=20.0)? as f32,
        sky_zenith: colour(source, "sky_zenith", &light.sky_zenith)?,
        sky_horizon: colour(source, "sky_horizon", &light.sky_horizon)?,
        haze_clear_octaves: clear as f32,
        haze_close_octaves: close as f32,
    })
}

fn materials(
    source: &Source<'_>,
    raw: &Spanned<Vec<RawMaterial>>,
    has_strata: bool,
) -> Result<Vec<Material>, FileError> {
    let count = raw.get_ref().len();
    if !(4..=8).contains(&count) {
        let problem = format!("there are {count} materials");
        return Err(source.error(raw.span(), problem, "there should be 4 to 8 tables [[material]]"));
    }
    let mut materials: Vec<Material> = Vec::with_capacity(count);
    for raw in raw.get_ref() {
        let slope = source.number("slope", &raw.slope, 0.0..=100.0)? as f32;
        let in_order = materials.last().map_or(slope == 0.0, |flatter| slope > flatter.slope);
        if !in_order {
            return Err(source.refuse("slope", &raw.slope));
        }
        let strata = share(source, "strata", raw.strata.as_ref())?;
        if let Some(at) = raw.strata.as_ref().filter(|_| strata > 0.0 && !has_strata) {
            let remedy = "add a table [strata] with colours and band_cells, or drop `strata` here";
            return Err(source.error(
                at.span(),
                "a material shows strata that the file does not describe",
                remedy,
            ));
        }
        let grain = share(source, "grain", raw.grain.as_ref())?;
        materials.push(Material { colour: colour(source, "colour", &raw.colour)?, slope, strata, grain });
    }
    Ok(materials)
}

/// A number from 0 to 1; 0 where it is not given.
fn share(source: &Source<'_>, key: &str, raw: Option<&Spanned<f64>>) -> Result<f32, FileError> {
    raw.map_or(Ok(0.0), |raw| source.number(key, raw, 0.0..=1.0).map(|share| share as f32))
}

fn strata(source: &Source<'_>, raw: &RawStrata) -> Result<(Vec<[f32; 3]>, f32), FileError> {
    let colours = colour_list(source, "colours", &raw.colours, 4)?;
    // 0.001: a thinner band would vanish in any picture.
    let band = source.number("band_cells", &raw.band_cells, 0.001..=64.0)?;
    Ok((colours, band as f32))
}

/// Tints scaled to luminance 1, so that drifting changes the hue and not the brightness.
fn tints(source: &Source<'_>, raw: &Spanned<Vec<Spanned<String>>>) -> Result<Vec<[f32; 3]>, FileError> {
    let colours = colour_list(source, "tints", raw, 8)?;
    let black = colours.iter().zip(raw.get_ref()).find(|(colour, _)| luminance(**colour) <= 0.0);
    if let Some((_, at)) = black {
        return Err(source.refuse("tints", at));
    }
    Ok(colours.into_iter().map(|colour| colour.map(|channel| channel / luminance(colour))).collect())
}

fn colour_list(
    source: &Source<'_>,
    key: &str,
    raw: &Spanned<Vec<Spanned<String>>>,
    most: usize,
) -> Result<Vec<[f32; 3]>, FileError> {
    if !(1..=most).contains(&raw.get_ref().len()) {
        return Err(source.refuse(key, raw));
    }
    raw.get_ref().iter().map(|text| colour(source, key, text)).collect()
}

/// Linear RGB of an sRGB colour written `#rrggbb`.
fn colour(source: &Source<'_>, key: &str, text: &Spanned<String>) -> Result<[f32; 3], FileError> {
    let digits =
        text.get_ref().strip_prefix('#').filter(|d| d.len() == 6 && d.bytes().all(|b| b.is_ascii_hexdigit()));
    let number = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
    let [_, red, green, blue] = number.ok_or_else(|| source.refuse(key, text))?.to_be_bytes();
    Ok([red, green, blue].map(linear_from_srgb))
}

fn sun_direction(source: &Source<'_>, light: &RawLight) -> Result<[f32; 3], FileError> {
    let azimuth_deg = source.number("sun_azimuth_deg", &light.sun_azimuth_deg, -360.0..=360.0)?;
    let elevation_deg = source.number("sun_elevation_deg", &light.sun_elevation_deg, 0.0..=90.0)?;
    Ok(Sun { azimuth_deg, elevation_deg }.direction())
}
