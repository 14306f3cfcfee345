//! PURE: options for seeing how it works. All of them together are plain data; panels, the command line and the renderer
//! share it.
//!
//! Each option has a word for `--show`, a label, and one sentence: [`SWITCHES`], [`SurfaceView::CHOICES`],
//! [`BackdropView::CHOICES`] and [`OCTAVE`].

use std::str::FromStr;

/// What is shown otherwise than usual; the default is all as usual.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inspect {
    /// The mesh instead of the ground.
    pub wireframe: bool,
    /// Tiles coloured by their level.
    pub levels: bool,
    /// The bounding boxes of the tiles drawn.
    pub boxes: bool,
    /// The patches that the tiles drawn were made from.
    pub patches: bool,
    /// The eyes' frusta of the last selection.
    pub frusta: bool,
    /// No tiles are selected anew, and nothing is baked, while the viewer flies on.
    pub frozen: bool,
    /// Vertices go over to the parent's mesh with distance, and where tiles of two levels touch.
    pub morph: bool,
    /// Tiles have skirts.
    pub skirts: bool,
    /// Tiles alone: no backdrop, no sky, no haze.
    pub live_only: bool,
    /// The noise of this octave alone, in octaves below the world's start (negative: above it). None: all of them.
    pub octave: Option<i32>,
    /// How the ground is coloured.
    pub surface: SurfaceView,
    /// How the backdrop is shown.
    pub backdrop: BackdropView,
}

impl Default for Inspect {
    fn default() -> Inspect {
        Inspect {
            wireframe: false,
            levels: false,
            boxes: false,
            patches: false,
            frusta: false,
            frozen: false,
            morph: true,
            skirts: true,
            live_only: false,
            octave: None,
            surface: SurfaceView::Lit,
            backdrop: BackdropView::Shown,
        }
    }
}

/// How the ground is coloured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SurfaceView {
    /// In the light of sun and sky.
    #[default]
    Lit,
    /// By its normals.
    Normals,
    /// By its steepness.
    Slopes,
    /// By what the depth buffer holds.
    Depth,
}

/// How the backdrop is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BackdropView {
    /// As the land far away.
    #[default]
    Shown,
    /// Not at all: the sky is in its place.
    Off,
    /// In another colour than the live tiles.
    Tinted,
    /// Its cubemap's faces too, unfolded.
    Faces,
}

/// An option that is on or off.
#[derive(Clone, Copy, Debug)]
pub struct Switch {
    /// The word that changes it from what is usual.
    pub word: &'static str,
    /// A few words for a check box.
    pub label: &'static str,
    /// What it does, in one sentence.
    pub about: &'static str,
    field: fn(&mut Inspect) -> &mut bool,
}

impl Switch {
    /// Whether it is on.
    pub fn is_on(&self, inspect: &Inspect) -> bool {
        *(self.field)(&mut { *inspect })
    }

    /// Turns it on or off.
    pub fn set(&self, inspect: &mut Inspect, on: bool) {
        *(self.field)(inspect) = on;
    }

    /// Whether it is on where all is as usual.
    pub fn usual(&self) -> bool {
        self.is_on(&Inspect::default())
    }
}

/// One of several values of an option.
#[derive(Clone, Copy, Debug)]
pub struct Choice<T> {
    /// The value.
    pub value: T,
    /// The word for it; what is usual needs none.
    pub word: &'static str,
    /// A few words for a list to choose from.
    pub label: &'static str,
    /// What it does, in one sentence.
    pub about: &'static str,
}

/// An option with a number.
#[derive(Clone, Copy, Debug)]
pub struct Number {
    /// The word for it, before `=` and the number.
    pub word: &'static str,
    /// A few words for a check box beside the number.
    pub label: &'static str,
    /// What it does, in one sentence.
    pub about: &'static str,
}

/// The options that are on or off, in the order in which panels show them.
pub const SWITCHES: [Switch; 9] = [
    Switch {
        word: "wireframe",
        label: "Wireframe",
        about: "Draws the edges of the mesh, on a plain ground.",
        field: |inspect| &mut inspect.wireframe,
    },
    Switch {
        word: "levels",
        label: "Colours by level",
        about: "Gives the tiles of each level of the quadtree a colour of their own.",
        field: |inspect| &mut inspect.levels,
    },
    Switch {
        word: "boxes",
        label: "Bounding boxes",
        about: "Draws the box of every tile drawn, which holds all that any finer level can add: distances and the view are tested against it.",
        field: |inspect| &mut inspect.boxes,
    },
    Switch {
        word: "patches",
        label: "Corner patches",
        about: "Draws in blue the 4x4 heights from which the GPU makes each tile, all that the CPU computes of it: the tile's cell bright, the ring around it dark.",
        field: |inspect| &mut inspect.patches,
    },
    Switch {
        word: "frozen",
        label: "Freeze the selection",
        about: "Keeps the tiles and the backdrop of this moment while you fly on, to be looked at from elsewhere.",
        field: |inspect| &mut inspect.frozen,
    },
    Switch {
        word: "frusta",
        label: "Frusta of the eyes",
        about: "Draws what the left eye (red) and the right eye (cyan) saw when the tiles were selected: freeze the selection, then fly aside.",
        field: |inspect| &mut inspect.frusta,
    },
    Switch {
        word: "no-morph",
        label: "Morph",
        about: "Takes vertices over to the parent's mesh before it replaces theirs: without it tiles pop, and do not meet where levels differ.",
        field: |inspect| &mut inspect.morph,
    },
    Switch {
        word: "no-skirts",
        label: "Skirts",
        about: "Hangs a narrow rim on every tile, under its neighbours: without it rounding may leave a pixel open between two tiles.",
        field: |inspect| &mut inspect.skirts,
    },
    Switch {
        word: "live-only",
        label: "Live tiles only",
        about: "Draws nothing but the tiles of this frame, on a plain ground: no backdrop, no sky, no haze.",
        field: |inspect| &mut inspect.live_only,
    },
];

/// [`Inspect::octave`].
pub const OCTAVE: Number = Number {
    word: "octave",
    label: "A single octave",
    about: "Shows the noise of one level alone on a plain, so many octaves below the world's start, without the backdrop.",
};

/// The colours of the levels, which take turns: that of a tile of level n is number n mod 8. sRGB.
pub const LEVEL_COLOURS: [[u8; 3]; 8] = [
    [230, 60, 60],
    [60, 170, 240],
    [245, 205, 60],
    [150, 80, 200],
    [80, 200, 90],
    [240, 130, 40],
    [40, 200, 190],
    [235, 110, 180],
];

impl SurfaceView {
    /// All of them, the usual one first.
    pub const CHOICES: [Choice<SurfaceView>; 4] = [
        Choice {
            value: SurfaceView::Lit,
            word: "lit",
            label: "Lit",
            about: "Shows the ground in the light of sun and sky, through the air.",
        },
        Choice {
            value: SurfaceView::Normals,
            word: "normals",
            label: "Normals",
            about: "Colours the ground by its normal: red for east (x), green for up (y), blue for south (z), each from -1 (none) to 1 (full).",
        },
        Choice {
            value: SurfaceView::Slopes,
            word: "slopes",
            label: "Slopes",
            about: "Colours the ground by its steepness: level is blue, half a rise per run green, 45 degrees yellow, twice as steep red.",
        },
        Choice {
            value: SurfaceView::Depth,
            word: "depth",
            label: "Depth buffer",
            about: "Shows the reversed depth: white at the near plane, a twenty-fourth darker for every doubling of the distance, black where nothing was written.",
        },
    ];
}

impl BackdropView {
    /// All of them, the usual one first.
    pub const CHOICES: [Choice<BackdropView>; 4] = [
        Choice {
            value: BackdropView::Shown,
            word: "backdrop",
            label: "Shown",
            about: "Shows what is too far away for parallax from the cubemap in which it was baked.",
        },
        Choice {
            value: BackdropView::Off,
            word: "no-backdrop",
            label: "Off",
            about: "Shows the sky in the backdrop's place, so that you see where the live tiles end.",
        },
        Choice {
            value: BackdropView::Tinted,
            word: "tinted-backdrop",
            label: "Tinted",
            about: "Colours the backdrop magenta, so that you can tell it from live tiles.",
        },
        Choice {
            value: BackdropView::Faces,
            word: "backdrop-faces",
            label: "Its faces",
            about: "Unfolds the six faces of the backdrop's cubemap into a cross before your eyes, checked where nothing is baked.",
        },
    ];
}

/// What each word but the usual ones does, in one sentence.
pub fn explained() -> impl Iterator<Item = (String, String)> {
    let switches = SWITCHES.iter().map(|switch| {
        let about = match switch.usual() {
            // "Turns off what hangs a rim on every tile: without it ...".
            true => format!("Turns off what {}{}", switch.about[..1].to_lowercase(), &switch.about[1..]),
            false => switch.about.to_owned(),
        };
        (switch.word.to_owned(), about)
    });
    let surface = SurfaceView::CHOICES[1..].iter().map(|choice| (choice.word, choice.about));
    let backdrop = BackdropView::CHOICES[1..].iter().map(|choice| (choice.word, choice.about));
    let owned = |(word, about): (&str, &str)| (word.to_owned(), about.to_owned());
    let octave = (format!("{}=N", OCTAVE.word), OCTAVE.about.to_owned());
    switches.chain(surface.chain(backdrop).map(owned)).chain([octave])
}

impl Inspect {
    /// Whether nothing is otherwise than usual.
    pub fn is_usual(&self) -> bool {
        *self == Inspect::default()
    }

    /// Whether neither sky nor backdrop is drawn behind the tiles.
    pub fn on_plain_ground(&self) -> bool {
        self.wireframe || self.live_only || self.surface == SurfaceView::Depth
    }

    /// All words that its [`FromStr`] takes.
    pub fn words() -> impl Iterator<Item = &'static str> {
        let switches = SWITCHES.iter().map(|switch| switch.word);
        let surface = SurfaceView::CHOICES.iter().map(|choice| choice.word);
        let backdrop = BackdropView::CHOICES.iter().map(|choice| choice.word);
        switches.chain(surface).chain(backdrop).chain(["octave=N"])
    }

    fn set(&mut self, word: &str) -> Result<(), String> {
        if let Some(switch) = SWITCHES.iter().find(|switch| switch.word == word) {
            switch.set(self, !switch.usual());
        } else if let Some(choice) = SurfaceView::CHOICES.iter().find(|choice| choice.word == word) {
            self.surface = choice.value;
        } else if let Some(choice) = BackdropView::CHOICES.iter().find(|choice| choice.word == word) {
            self.backdrop = choice.value;
        } else if let Some(("octave", number)) = word.split_once('=') {
            let octave = number.parse().map_err(|_| {
                format!(
                    "`{number}` is no octave: a whole number of octaves below the start, such as octave=4"
                )
            })?;
            self.octave = Some(octave);
        } else {
            let words: Vec<_> = Inspect::words().collect();
            return Err(format!("there is nothing to show called `{word}`; there is {}", words.join(", ")));
        }
        Ok(())
    }
}

/// Words with commas between: what is to be otherwise than usual.
impl FromStr for Inspect {
    type Err = String;

    fn from_str(list: &str) -> Result<Inspect, String> {
        let mut inspect = Inspect::default();
        list.split(',').try_for_each(|word| inspect.set(word.trim()))?;
        Ok(inspect)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_is_told_apart_and_changes_what_it_names() {
        let mut words: Vec<_> = Inspect::words().collect();
        for word in &words {
            let inspect: Inspect = word.replace('N', "-7").parse().unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(inspect.is_usual(), ["lit", "backdrop"].contains(word), "{word}");
        }
        words.sort_unstable();
        words.dedup();
        assert_eq!(words.len(), 9 + 4 + 4 + 1);
    }

    #[test]
    fn every_switch_has_a_field_of_its_own() {
        for switch in SWITCHES {
            let mut inspect = Inspect::default();
            switch.set(&mut inspect, !switch.usual());
            let changed = SWITCHES.iter().filter(|other| other.is_on(&inspect) != other.usual());
            assert_eq!(changed.map(|other| other.word).collect::<Vec<_>>(), [switch.word]);
            switch.set(&mut inspect, switch.usual());
            assert!(inspect.is_usual());
        }
    }

    #[test]
    fn lists_are_taken_and_what_is_wrong_is_named() {
        let inspect: Inspect = "wireframe, octave=3,depth".parse().unwrap_or_else(|e| panic!("{e}"));
        let wanted =
            Inspect { wireframe: true, octave: Some(3), surface: SurfaceView::Depth, ..Inspect::default() };
        assert_eq!(inspect, wanted);
        for (list, named) in [("wireframes", "wireframes"), ("levels,,", "``"), ("octave=deep", "deep")] {
            let Err(error) = list.parse::<Inspect>() else { panic!("`{list}` is taken") };
            assert!(error.contains(named), "{error}");
        }
    }
}
