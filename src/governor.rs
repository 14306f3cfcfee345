//! Holds a frame rate: how much is drawn follows what frames take. Times go in, changes come out; there is no clock in here.
//!
//! Frames are judged in windows of half a second or more. Where a fifth of a window's frames is late, one of three *dials*
//! goes down a step: the time for making tiles where that is what takes long, the detail of the tiles, the size of the
//! pictures. Where there is room for it, one goes up a step, later and with more margin; each step up that proves
//! wrong makes the next one wait for twice as long. So a load that stays the same is answered once.

/// What a governor aims for, and how far it may go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GovernorSettings {
    /// Frames per second to hold, 10 to 240; None: the display's.
    pub rate_hz: Option<f64>,
    /// Least share of the width and height of the eyes' pictures that is drawn, 0.3 to 1; 1: it is left alone.
    pub least_scale: f64,
    /// Least detail of the tiles: they split at so many of their own sizes, 2 to 4. What the quality has at most; it has a
    /// least of its own, too.
    pub least_split: f64,
    /// Least GPU time in milliseconds that a frame spends on making tiles, 0.25 to 10.
    pub least_tiles_ms: f64,
    /// Seconds without a late frame before a dial goes up, 1 to 60.
    pub patience_s: f64,
}

impl Default for GovernorSettings {
    /// The display's rate; down to half of the pixels.
    fn default() -> GovernorSettings {
        GovernorSettings {
            rate_hz: None,
            least_scale: 0.7,
            least_split: 2.0,
            least_tiles_ms: 0.5,
            patience_s: 3.0,
        }
    }
}

/// Allowed values, in the order of the settings.
pub const RATES_HZ: std::ops::RangeInclusive<f64> = 10.0..=240.0;
/// See [`GovernorSettings::least_scale`].
pub const SCALES: std::ops::RangeInclusive<f64> = 0.3..=1.0;
/// See [`GovernorSettings::least_split`].
pub const SPLITS: std::ops::RangeInclusive<f64> = 2.0..=4.0;
/// See [`GovernorSettings::least_tiles_ms`].
pub const TILES_MS: std::ops::RangeInclusive<f64> = 0.25..=10.0;
/// See [`GovernorSettings::patience_s`].
pub const PATIENCES_S: std::ops::RangeInclusive<f64> = 1.0..=60.0;

/// How much is drawn, as far as it can change from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dials {
    /// Tiles split at so many of their own sizes.
    pub split: f64,
    /// Share of the width and height of the eyes' pictures that is drawn.
    pub scale: f64,
    /// Milliseconds of GPU time for making tiles in a frame.
    pub tiles_ms: f64,
}

/// What a frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// From the frame before to this one.
    pub interval_ms: f64,
    /// The part of it in which nothing was waited for but the GPU.
    pub busy_ms: f64,
    /// Time of the frame's thread on a processor.
    pub cpu_ms: f64,
    /// GPU time; 0 where that is not known.
    pub gpu_ms: f64,
    /// The part of it that made tiles.
    pub tiles_ms: f64,
    /// From one frame to the next at the display's rate.
    pub period_ms: f64,
}

/// One of [`Dials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dial {
    /// [`Dials::split`].
    Split,
    /// [`Dials::scale`].
    Scale,
    /// [`Dials::tiles_ms`].
    Tiles,
}

/// Which way a dial goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Frames were late.
    Down,
    /// There is room.
    Up,
}

/// A step of a dial, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Which one.
    pub dial: Dial,
    /// Which way.
    pub way: Way,
    /// All of them from now on.
    pub dials: Dials,
    /// What frames took, as a share of the time there is: four fifths of them no more than this.
    pub load: f64,
    /// What most of it went to, for a person.
    pub most: &'static str,
}

/// Seconds and frames of a window, at least.
const WINDOW_S: f64 = 0.5;
const WINDOW_FRAMES: usize = 12;

/// Frames judged at a time at most.
const MOST_FRAMES: usize = 240;

/// Frames after a change that are not judged: those on their way were drawn as before.
const SETTLING: u32 = 6;

/// The share of the frames that decides.
const DECISIVE: f64 = 0.8;

/// Load above which a dial goes down; far above, at once.
const LATE: f64 = 0.95;
const MUCH_TOO_LATE: f64 = 1.2;
const FAR_TOO_LATE: f64 = 2.0;

/// Load that a step up must not lead beyond, by what it may cost at most.
const ROOM: f64 = 0.85;

/// A step down so soon after one up says that this was wrong.
const RELAPSE_S: f64 = 15.0;

/// Longest wait for a step up.
const MOST_PATIENCE_S: f64 = 240.0;

/// Steps of the dials; of the time for tiles a factor.
const SPLIT_STEP: f64 = 0.1;
const SCALE_STEP: f64 = 0.05;
const TILES_STEP: f64 = 0.75;

/// Share of the time there is from which on the making of tiles is what takes long.
const MUCH_MAKING: f64 = 0.15;

/// Steps add up to the ends of their ranges but for this.
const ROUNDING: f64 = 1e-6;

/// Decides what to draw less or more of.
#[derive(Clone, Debug)]
pub struct Governor {
    settings: GovernorSettings,
    most: Dials,
    dials: Dials,
    /// Load, and the GPU's and the tiles' share of the time there is, of the window's frames.
    window: [[f32; 3]; MOST_FRAMES],
    frames: usize,
    seconds: f64,
    /// What the processor took of the window, as a share of the time there is.
    cpu: f64,
    settling: u32,
    /// The window before was late, too.
    late_before: bool,
    /// Seconds since a frame was late, and since the last step up.
    calm_s: f64,
    raised_s: f64,
    patience_s: f64,
    /// What went down last.
    lowered: Dial,
}

/// What a window came to.
#[derive(Clone, Copy, Debug)]
struct Summary {
    load: f64,
    gpu: f64,
    tiles: f64,
    cpu: f64,
}

impl Summary {
    /// Fewer pixels would help.
    fn on_gpu(&self) -> bool {
        self.gpu == 0.0 || self.gpu >= self.cpu
    }

    fn most(&self) -> &'static str {
        match (self.on_gpu(), self.tiles > 0.5 * self.gpu) {
            (true, true) if self.gpu > 0.0 => "making tiles",
            (true, _) => "drawing",
            (false, _) => "the processor",
        }
    }
}

impl Governor {
    /// Begins with `most`, and never goes beyond. `floor` is the least split that what is drawn allows.
    pub fn new(settings: &GovernorSettings, most: Dials, floor: f64) -> Governor {
        let least_split = settings.least_split.max(floor).min(most.split);
        Governor {
            settings: GovernorSettings {
                least_split,
                least_scale: settings.least_scale.min(most.scale),
                least_tiles_ms: settings.least_tiles_ms.min(most.tiles_ms),
                ..*settings
            },
            most,
            dials: most,
            window: [[0.0; 3]; MOST_FRAMES],
            frames: 0,
            seconds: 0.0,
            cpu: 0.0,
            settling: SETTLING,
            late_before: false,
            calm_s: 0.0,
            raised_s: f64::INFINITY,
            patience_s: settings.patience_s,
            lowered: Dial::Scale,
        }
    }

    /// The dials as they are.
    pub fn dials(&self) -> Dials {
        self.dials
    }

    /// What was heard of the window so far is forgotten, and the next frames are not judged: something else than drawing has
    /// held them up.
    pub fn settle(&mut self) {
        (self.frames, self.seconds, self.cpu) = (0, 0.0, 0.0);
        (self.settling, self.late_before) = (SETTLING, false);
    }

    /// Hears of a frame; at the end of a window, what to change, if anything.
    pub fn observe(&mut self, sample: &Sample) -> Option<Change> {
        self.raised_s += sample.interval_ms * 1e-3;
        if self.settling > 0 {
            self.settling -= 1;
            return None;
        }
        let period = self.settings.rate_hz.map_or(sample.period_ms, |hz| 1e3 / hz).max(0.1);
        let load = sample.busy_ms.max(sample.gpu_ms) / period;
        self.window[self.frames] = [load, sample.gpu_ms / period, sample.tiles_ms / period].map(|x| x as f32);
        self.frames += 1;
        self.seconds += sample.interval_ms * 1e-3;
        self.cpu += sample.cpu_ms / period;
        let whole = self.seconds >= WINDOW_S && self.frames >= WINDOW_FRAMES || self.frames == MOST_FRAMES;
        whole.then(|| self.judge()).flatten()
    }

    fn judge(&mut self) -> Option<Change> {
        let summary = self.summary();
        let seconds = std::mem::take(&mut self.seconds);
        (self.frames, self.cpu) = (0, 0.0);
        if summary.load > LATE {
            self.calm_s = 0.0;
            let sure = std::mem::replace(&mut self.late_before, true) || summary.load > MUCH_TOO_LATE;
            return if sure { self.lower(&summary) } else { None };
        }
        (self.late_before, self.calm_s) = (false, self.calm_s + seconds);
        if self.calm_s < self.patience_s { None } else { self.raise(&summary) }
    }

    fn summary(&mut self) -> Summary {
        let frames = self.frames;
        let mut decisive = |column: usize| {
            let window = &mut self.window[..frames];
            window.sort_unstable_by(|a, b| a[column].total_cmp(&b[column]));
            f64::from(window[((frames - 1) as f64 * DECISIVE).round() as usize][column])
        };
        let [load, gpu, tiles] = [0, 1, 2].map(&mut decisive);
        Summary { load, gpu, tiles, cpu: self.cpu / frames as f64 }
    }

    fn lower(&mut self, summary: &Summary) -> Option<Change> {
        if self.raised_s < RELAPSE_S {
            self.patience_s = (2.0 * self.patience_s).min(MOST_PATIENCE_S);
            self.raised_s = f64::INFINITY;
        }
        let GovernorSettings { least_split, least_scale, least_tiles_ms, .. } = self.settings;
        let can_split = self.dials.split > least_split + ROUNDING;
        let can_scale = self.dials.scale > least_scale + ROUNDING && summary.on_gpu();
        let dial = if summary.tiles > MUCH_MAKING && self.dials.tiles_ms > least_tiles_ms {
            Dial::Tiles
        } else if can_split && (self.lowered != Dial::Split || !can_scale) {
            Dial::Split
        } else if can_scale {
            Dial::Scale
        } else {
            return None;
        };
        if dial != Dial::Tiles {
            self.lowered = dial;
        }
        // Far from the rate, large steps get there sooner.
        let steps = match summary.load {
            load if load > FAR_TOO_LATE => 4.0,
            load if load > MUCH_TOO_LATE => 2.0,
            _ => 1.0,
        };
        let Dials { split, scale, tiles_ms } = &mut self.dials;
        match dial {
            Dial::Split => *split = (*split - steps * SPLIT_STEP).max(least_split),
            Dial::Scale => *scale = (*scale - steps * SCALE_STEP).max(least_scale),
            Dial::Tiles => *tiles_ms = (*tiles_ms * TILES_STEP.powf(steps)).max(least_tiles_ms),
        }
        Some(self.changed(dial, Way::Down, summary))
    }

    fn raise(&mut self, summary: &Summary) -> Option<Change> {
        let (now, most) = (self.dials, self.most);
        let up = Dials {
            split: (now.split + SPLIT_STEP).min(most.split),
            scale: (now.scale + SCALE_STEP).min(most.scale),
            tiles_ms: (now.tiles_ms / TILES_STEP).min(most.tiles_ms),
        };
        let square = |up: f64, now: f64| (up / now) * (up / now);
        // Both work and pixels grow as squares, at most.
        let steps = [
            (Dial::Scale, up.scale > now.scale, square(up.scale, now.scale)),
            (Dial::Split, up.split > now.split, square(up.split, now.split)),
            (
                Dial::Tiles,
                up.tiles_ms > now.tiles_ms,
                1.0 + (up.tiles_ms - now.tiles_ms) / now.tiles_ms * summary.tiles,
            ),
        ];
        let affordable = |&(_, possible, cost): &(Dial, bool, f64)| possible && summary.load * cost <= ROOM;
        let (dial, ..) = steps.into_iter().find(affordable)?;
        match dial {
            Dial::Split => self.dials.split = up.split,
            Dial::Scale => self.dials.scale = up.scale,
            Dial::Tiles => self.dials.tiles_ms = up.tiles_ms,
        }
        (self.raised_s, self.calm_s) = (0.0, 0.0);
        Some(self.changed(dial, Way::Up, summary))
    }

    fn changed(&mut self, dial: Dial, way: Way, summary: &Summary) -> Change {
        self.settle();
        Change { dial, way, dials: self.dials, load: summary.load, most: summary.most() }
    }
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Dials { split, scale, tiles_ms } = self.dials;
        match self.dial {
            Dial::Split => write!(f, "tiles split at {split:.1} of their sizes")?,
            Dial::Scale => {
                write!(f, "pictures are drawn at {:.0} % of their width and height", 100.0 * scale)?
            }
            Dial::Tiles => write!(f, "making tiles may take {tiles_ms:.2} ms of a frame")?,
        }
        let load = 100.0 * self.load;
        match self.way {
            Way::Down => {
                write!(f, ": frames took {load:.0} % of the time there is, most of it {}", self.most)
            }
            Way::Up => write!(f, " again: frames took {load:.0} % of the time there is"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MOST: Dials = Dials { split: 3.0, scale: 1.0, tiles_ms: 2.0 };
    const FLOOR: f64 = 2.6;
    const PERIOD_MS: f64 = 1000.0 / 90.0;

    /// A machine: GPU time that is fixed, that goes with pixels and that goes with tiles, and CPU time; in milliseconds at
    /// the most of everything.
    #[derive(Clone, Copy, Debug)]
    struct Machine {
        fixed: f64,
        pixels: f64,
        tiles: f64,
        making: f64,
        cpu: f64,
        noise: f64,
    }

    impl Machine {
        fn gpu_ms(&self, dials: &Dials) -> f64 {
            let (scale, split) = (dials.scale / MOST.scale, dials.split / MOST.split);
            let making = self.making.min(dials.tiles_ms);
            self.fixed + self.pixels * scale * scale + self.tiles * split * split + making
        }

        fn cpu_ms(&self, dials: &Dials) -> f64 {
            self.cpu * (0.5 + 0.5 * (dials.split / MOST.split).powi(2))
        }

        fn sample(&self, dials: &Dials, random: &mut u64) -> Sample {
            *random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let noise = 1.0 + self.noise * ((*random >> 40) as f64 / (1u64 << 24) as f64 - 0.5);
            let (gpu_ms, cpu_ms) = (self.gpu_ms(dials) * noise, self.cpu_ms(dials));
            let busy_ms = gpu_ms.max(cpu_ms);
            let interval_ms = (busy_ms / PERIOD_MS).ceil().max(1.0) * PERIOD_MS;
            let tiles_ms = self.making.min(dials.tiles_ms);
            Sample { interval_ms, busy_ms, cpu_ms, gpu_ms, tiles_ms, period_ms: PERIOD_MS }
        }
    }

    /// Flies for so long; the changes with their times.
    fn fly(governor: &mut Governor, machine: &Machine, seconds: f64, random: &mut u64) -> Vec<(f64, Change)> {
        let (mut time, mut changes) = (0.0, Vec::new());
        while time < seconds {
            let sample = machine.sample(&governor.dials(), random);
            time += sample.interval_ms * 1e-3;
            changes.extend(governor.observe(&sample).map(|change| (time, change)));
        }
        changes
    }

    fn load(machine: &Machine, dials: &Dials) -> f64 {
        machine.gpu_ms(dials).max(machine.cpu_ms(dials)) / PERIOD_MS
    }

    fn machines() -> impl Strategy<Value = Machine> {
        (0.0f64..6.0, 0.0f64..16.0, 0.0f64..10.0, 0.0f64..4.0, 0.5f64..9.0, 0.0f64..0.3).prop_map(
            |(fixed, pixels, tiles, making, cpu, noise)| Machine { fixed, pixels, tiles, making, cpu, noise },
        )
    }

    proptest! {
        #[test]
        fn a_load_that_stays_is_answered_once(machine in machines(), seed: u64) {
            let mut governor = Governor::new(&GovernorSettings::default(), MOST, FLOOR);
            let least = Dials { split: FLOOR, scale: 0.7, tiles_ms: 0.5 };
            let mut random = seed;
            let first = fly(&mut governor, &machine, 120.0, &mut random);
            for pair in first.windows(2) {
                let far = |a: f64, b: f64| (a - b).abs() > 1e-3;
                let (a, b) = (pair[0].1.dials, pair[1].1.dials);
                let moved = far(a.split, b.split) || far(a.scale, b.scale) || far(a.tiles_ms, b.tiles_ms);
                prop_assert!(moved, "a step that leads nowhere: {:?}", pair[1].1);
                prop_assert!(pair[1].0 - pair[0].0 >= 0.5, "{pair:?}");
            }
            for (_, change) in &first {
                let Dials { split, scale, tiles_ms } = change.dials;
                prop_assert!((least.split..=MOST.split).contains(&split), "{change}");
                prop_assert!((least.scale..=MOST.scale).contains(&scale), "{change}");
                prop_assert!((least.tiles_ms..=MOST.tiles_ms).contains(&tiles_ms), "{change}");
            }
            // Ten minutes more: hardly a change, and where there is one, it is tried ever more rarely.
            let later = fly(&mut governor, &machine, 600.0, &mut random);
            prop_assert!(later.len() <= 12, "{} changes for {machine:?}", later.len());
            // What can be held is held.
            if load(&machine, &least) * (1.0 + 0.5 * machine.noise) < 0.9 {
                prop_assert!(load(&machine, &governor.dials()) <= 1.0, "{:?} for {machine:?}", governor.dials());
            }
        }

        #[test]
        fn what_is_light_is_drawn_in_full(machine in machines(), heavy in machines(), seed: u64) {
            let mut governor = Governor::new(&GovernorSettings::default(), MOST, FLOOR);
            let mut random = seed;
            fly(&mut governor, &heavy, 60.0, &mut random);
            let light = Machine { fixed: 0.1 * machine.fixed, pixels: 0.2 * machine.pixels, tiles: 0.2 * machine.tiles,
                making: 0.2 * machine.making, cpu: 0.5 * machine.cpu, noise: machine.noise };
            fly(&mut governor, &light, 1200.0, &mut random);
            prop_assert_eq!(governor.dials(), MOST);
        }
    }

    fn heavy() -> Machine {
        Machine { fixed: 1.0, pixels: 12.0, tiles: 3.0, making: 0.2, cpu: 1.0, noise: 0.1 }
    }

    #[test]
    fn one_late_frame_changes_nothing() {
        let mut governor = Governor::new(&GovernorSettings::default(), MOST, FLOOR);
        let calm = Sample {
            interval_ms: PERIOD_MS,
            busy_ms: 5.0,
            cpu_ms: 1.0,
            gpu_ms: 5.0,
            tiles_ms: 0.1,
            period_ms: PERIOD_MS,
        };
        for frame in 0..5000 {
            let late = Sample { interval_ms: 50.0, busy_ms: 50.0, gpu_ms: 50.0, ..calm };
            let sample = if frame % 20 == 0 { late } else { calm };
            assert_eq!(governor.observe(&sample), None, "frame {frame}");
        }
        assert_eq!(governor.dials(), MOST);
    }

    #[test]
    fn what_held_frames_up_for_once_is_not_judged() {
        let calm = Sample {
            interval_ms: PERIOD_MS,
            busy_ms: 5.0,
            cpu_ms: 1.0,
            gpu_ms: 5.0,
            tiles_ms: 0.1,
            period_ms: PERIOD_MS,
        };
        let late = Sample { interval_ms: 200.0, busy_ms: 200.0, gpu_ms: 200.0, ..calm };
        let mut governor = Governor::new(&GovernorSettings::default(), MOST, FLOOR);
        let hear = |governor: &mut Governor, sample: &Sample, frames: usize| {
            (0..frames).filter_map(|_| governor.observe(sample)).count()
        };
        hear(&mut governor, &calm, SETTLING as usize);
        assert_eq!(hear(&mut governor, &late, WINDOW_FRAMES - 1), 0, "a window is not whole");
        governor.settle();
        assert_eq!(hear(&mut governor, &late, SETTLING as usize), 0);
        assert_eq!(hear(&mut governor, &calm, 1000), 0);
        assert!(hear(&mut governor, &late, 30) > 0, "but what stays is");
    }

    #[test]
    fn each_dial_goes_down_for_what_it_is_good_for() {
        let dials = |machine: &Machine| {
            let mut governor = Governor::new(&GovernorSettings::default(), MOST, FLOOR);
            fly(&mut governor, machine, 60.0, &mut 7);
            governor.dials()
        };
        let drawn = dials(&heavy());
        assert!(
            drawn.scale < 1.0 && drawn.split < MOST.split && drawn.tiles_ms == MOST.tiles_ms,
            "{drawn:?}"
        );
        // The processor does not care how many pixels there are.
        let processor =
            dials(&Machine { fixed: 1.0, pixels: 2.0, tiles: 1.0, making: 0.0, cpu: 20.0, noise: 0.1 });
        assert_eq!(processor, Dials { split: FLOOR, ..MOST });
        let making =
            dials(&Machine { fixed: 8.0, pixels: 1.0, tiles: 0.0, making: 4.0, cpu: 1.0, noise: 0.0 });
        assert!(making.tiles_ms < MOST.tiles_ms, "{making:?}");
    }

    #[test]
    fn a_rate_of_its_own_and_a_scale_that_is_fixed() {
        let settings =
            GovernorSettings { rate_hz: Some(30.0), least_scale: 1.0, ..GovernorSettings::default() };
        let mut governor = Governor::new(&settings, MOST, FLOOR);
        assert!(fly(&mut governor, &heavy(), 60.0, &mut 1).is_empty(), "16 ms are little at 30 Hz");
        let mut governor = Governor::new(&GovernorSettings { rate_hz: Some(200.0), ..settings }, MOST, FLOOR);
        fly(&mut governor, &heavy(), 60.0, &mut 1);
        assert_eq!(governor.dials().scale, 1.0);
        assert_eq!(governor.dials().split, FLOOR);
    }

    #[test]
    fn a_change_says_why() {
        let mut governor = Governor::new(&GovernorSettings::default(), MOST, FLOOR);
        let changes = fly(&mut governor, &heavy(), 10.0, &mut 1);
        let texts: Vec<String> = changes.iter().map(|(_, change)| change.to_string()).collect();
        assert!(texts[0].starts_with("tiles split at 2.8 of their sizes: frames took 1"), "{texts:?}");
        assert!(
            texts[1].starts_with("pictures are drawn at ") && texts[1].ends_with("most of it drawing"),
            "{texts:?}"
        );
    }
}
