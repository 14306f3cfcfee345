//! Worlds: what the surface is made of and what it looks like, described in TOML files, checked here, drawn elsewhere.
//!
//! A file is read twice over: [`file`] into raw values that remember their place in the text, then into [`World`],
//! where units are converted once (sRGB to linear, degrees to directions) and every value is in range.

mod file;
pub mod source;

use crate::terrain::Surface;

pub use source::{FileError, LoadError};

/// A world, checked: any value of this type that came from [`World::load`] can be generated and drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct World {
    /// What it is called: the built-in name, or the file's name without `.toml`.
    pub name: String,
    /// One line for people.
    pub title: String,
    /// The shape of the ground: everything the heights depend on.
    pub surface: Surface,
    /// Its colours, light and air.
    pub look: Look,
}

/// Colours, light and air. Colours are linear RGB, 0 to 1, unless they say otherwise.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// 4 to 8 materials, from flat ground to the steepest cliff; `slope` rises strictly from 0.
    pub materials: Vec<Material>,
    /// Bands of colour by height, from the lowest up, repeating for ever; 0 to 4. Empty: no strata.
    pub strata_colours: Vec<[f32; 3]>,
    /// Height of one band in cells of the level looked at, above 0. 1 where there are no strata.
    pub strata_band_cells: f32,
    /// 1 to 8 tints of luminance 1 (so a channel may exceed 1): a colour is multiplied by the tint of its depth.
    pub drift_tints: Vec<[f32; 3]>,
    /// Octaves of depth for one round through all the tints, after which they start again.
    pub drift_octaves: f32,
    /// Unit vector towards the sun: x to the right of a viewer of yaw 0, y up, z behind him.
    pub sun_direction: [f32; 3],
    /// Sunlight, colour times strength: what a white surface facing the sun sends back. May exceed 1.
    pub sun_colour: [f32; 3],
    /// Light of the whole sky on the ground, as a factor on the sky's own colours.
    pub sky_strength: f32,
    /// The sky straight above.
    pub sky_zenith: [f32; 3],
    /// The sky at the horizon, which is also the colour the haze closes to.
    pub sky_horizon: [f32; 3],
    /// Octaves of distance beyond the nearest ground up to which the air is clear.
    pub haze_clear_octaves: f32,
    /// Octaves of distance at which nothing but haze is left; more than `haze_clear_octaves`.
    pub haze_close_octaves: f32,
}

/// Where the sun stands.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sun {
    /// Degrees: 0 is ahead of the start, 90 to its right.
    pub azimuth_deg: f64,
    /// Degrees over the horizon: 0 to 90.
    pub elevation_deg: f64,
}

impl Sun {
    /// The unit vector towards it, as [`Look::sun_direction`].
    pub fn direction(self) -> [f32; 3] {
        let [azimuth, elevation] = [self.azimuth_deg, self.elevation_deg].map(f64::to_radians);
        let direction = [elevation.cos() * azimuth.sin(), elevation.sin(), -elevation.cos() * azimuth.cos()];
        direction.map(|component| component as f32)
    }

    /// Where it stands in this direction, a unit vector; its azimuth is 0 to 360.
    pub fn towards(direction: [f32; 3]) -> Sun {
        let [x, y, z] = direction.map(f64::from);
        let azimuth_deg = x.atan2(-z).to_degrees().rem_euclid(360.0);
        Sun { azimuth_deg, elevation_deg: y.clamp(-1.0, 1.0).asin().to_degrees() }
    }
}

/// What covers ground of one steepness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Its colour, before strata and drift.
    pub colour: [f32; 3],
    /// Gradient (rise over run; 1 is 45 degrees) at which only this material shows. Between the slopes of two
    /// neighbouring materials they blend.
    pub slope: f32,
    /// How much of its colour the strata take over, 0 to 1.
    pub strata: f32,
    /// How much noise roughens its borders and mottles its colour, 0 to 1.
    pub grain: f32,
}

impl World {
    /// The world of a built-in name, or of the TOML file at a path.
    ///
    /// # Errors
    /// [`LoadError`], a sentence that says what to do: an unknown name, an unreadable file, or a file with
    /// something wrong in it (then with its line).
    pub fn load(name_or_path: &str) -> Result<World, LoadError> {
        Ok(file::check(&file::KIND.find(name_or_path)?)?)
    }

    /// The world a text describes, as if it had been read from `file`; named after it.
    ///
    /// # Errors
    /// The first thing wrong in the text.
    pub fn parse(file: &str, text: &str) -> Result<World, FileError> {
        let name = std::path::Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
        file::check(&file::KIND.source(name, file, text))
    }

    /// The names of the built-in worlds, the default first.
    pub fn names() -> impl Iterator<Item = &'static str> {
        file::KIND.embedded.iter().map(|world| world.name)
    }
}

/// Linear light, 0 to 1, of one sRGB channel.
pub fn linear_from_srgb(channel: u8) -> f32 {
    linear_from_share(f32::from(channel) / 255.0)
}

/// The same of a channel from 0 to 1 (IEC 61966-2-1); the twin of `shaders/srgb.wgsl`.
pub fn linear_from_share(c: f32) -> f32 {
    if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Relative luminance of a linear colour (Rec. 709 weights).
pub fn luminance(colour: [f32; 3]) -> f32 {
    0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sun_is_found_again_in_its_direction() {
        assert_eq!(
            Sun { azimuth_deg: 90.0, elevation_deg: 0.0 }.direction().map(f32::round),
            [1.0, 0.0, 0.0]
        );
        assert_eq!(
            Sun { azimuth_deg: 0.0, elevation_deg: 0.0 }.direction().map(f32::round),
            [0.0, 0.0, -1.0]
        );
        for (azimuth_deg, elevation_deg) in [(0.0, 0.0), (125.0, 32.0), (270.0, 89.0), (359.0, 1.0)] {
            let found = Sun::towards(Sun { azimuth_deg, elevation_deg }.direction());
            let error = (found.azimuth_deg - azimuth_deg).abs() + (found.elevation_deg - elevation_deg).abs();
            assert!(error < 1e-3, "{azimuth_deg} {elevation_deg}: {found:?}");
        }
    }
}
