//! The command's own flight (`Flying` under a `Supervisor`) on a mock headset, with a script of what befalls it.
#![allow(dead_code, reason = "each test binary uses its part")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests stop at the first surprise")]

pub mod documented_codes;

use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use fathomless::course::Course;
use fathomless::flight::Flight;
use fathomless::flying::{Flying, Headset};
use fathomless::mock::{Clock, Mock, MockConfig};
use fathomless::render::BackdropConfig;
use fathomless::render::layout::SlotLayout;
use fathomless::supervisor::{Absent, Chronicle, Patience, Stage, Supervisor, Venue};
use fathomless::terrain::morph::Detail;
use fathomless::terrain::tile::Cells;
use fathomless::viewer::{Quality, Remarks, Step, Viewer, ViewerConfig};
use fathomless::world::World;
use openxr::sys;

static WORLD: LazyLock<World> = LazyLock::new(|| World::load("hills").unwrap());
static FLIGHT: LazyLock<Flight> = LazyLock::new(|| Flight::load("still").unwrap());

/// Turns within which everything ends.
const SOON: usize = 2000;

/// A small headset in stepped time.
pub fn headset() -> MockConfig {
    MockConfig { clock: Clock::Stepped { hz: 90.0 }, eye_size: [16, 16], ..MockConfig::default() }
}

/// As little as can be drawn, for lives by the hundred.
pub fn least() -> ViewerConfig {
    let quality = Quality {
        layout: SlotLayout { cells: Cells::new(16).unwrap(), mesh: 4 },
        detail: Detail::new(2.6),
        down: 0,
        backdrop: BackdropConfig { face: 16, lag: 4, bound: 3.0, layers: 2, detail: Detail::new(2.6) },
        samples: 1,
    };
    ViewerConfig { quality: Some(quality), complete: false, ..ViewerConfig::default() }
}

/// The command's patience, a thousand times as short.
pub fn patience(absent: Absent) -> Patience {
    let short = Duration::from_millis(1);
    Patience { retry: short, idle: short, lasting: 3, ..Patience::new(absent) }
}

/// A flight with a script.
pub struct Scripted<'a, F> {
    pub flying: Flying<'static>,
    mock: Mock,
    stop: &'a AtomicBool,
    /// Hears of every turn of the loop before it is taken: how many came before it, and how many of them drew.
    script: F,
    turns: usize,
    drawn: usize,
    /// Venues opened, in order.
    pub venues: Vec<Venue>,
}

/// What the script may do.
pub struct Hand<'a> {
    pub mock: &'a Mock,
    pub stop: &'a AtomicBool,
    pub turn: usize,
    pub drawn: usize,
    pub venue: Venue,
    pub viewer: &'a mut Viewer,
    /// Time flown.
    pub flown: Duration,
}

impl Hand<'_> {
    /// Ends the flight.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl<F: FnMut(Hand<'_>)> Stage for Scripted<'_, F> {
    type Show = Viewer;

    fn open(&mut self, venue: Venue) -> anyhow::Result<Viewer> {
        self.venues.push(venue);
        assert!(self.venues.len() < 100, "opened for ever");
        self.flying.open(venue)
    }

    fn renew(&mut self, viewer: Viewer) -> anyhow::Result<Viewer> {
        self.flying.renew(viewer)
    }

    fn frame(&mut self, viewer: &mut Viewer, flown: Duration) -> anyhow::Result<Step> {
        assert!(self.turns < SOON, "the flight does not end: {:?}", self.mock.session_state());
        let (turn, drawn) = (self.turns, self.drawn);
        self.turns += 1;
        let venue = *self.venues.last().unwrap();
        (self.script)(Hand { mock: &self.mock, stop: self.stop, turn, drawn, venue, viewer, flown });
        let step = self.flying.frame(viewer, flown)?;
        self.drawn += usize::from(step == Step::Drew);
        Ok(step)
    }

    fn speed(&self, viewer: &Viewer) -> f64 {
        self.flying.speed(viewer)
    }

    fn request_exit(&mut self, viewer: &mut Viewer) -> anyhow::Result<()> {
        self.flying.request_exit(viewer)
    }

    fn headset_answers(&mut self) -> bool {
        self.flying.headset_answers()
    }
}

/// How a flight ended.
pub struct Flown {
    pub result: anyhow::Result<()>,
    pub chronicle: Chronicle,
    pub remarks: Remarks,
    pub venues: Vec<Venue>,
    pub flown: Duration,
}

/// Flies on a mock until the script stops it.
pub fn fly(mock: &Mock, config: ViewerConfig, patience: Patience, script: impl FnMut(Hand<'_>)) -> Flown {
    let stop = AtomicBool::new(false);
    let course = Course::new(WORLD.surface, 3, 1.0, |_| ());
    let mut flying = Flying::new(&WORLD, &FLIGHT, course, config, Headset::Mock(mock.clone()));
    // Pictures are compared that are drawn right after something has happened.
    flying.comfort.settings.fades = false;
    let mut scripted =
        Scripted { flying, mock: mock.clone(), stop: &stop, script, turns: 0, drawn: 0, venues: Vec::new() };
    let mut supervisor = Supervisor::new(patience, &stop);
    let result = supervisor.fly(&mut scripted);
    let (chronicle, flown) = (supervisor.chronicle, supervisor.flown);
    let remarks = scripted.flying.remarks();
    let venues = scripted.venues.clone();
    drop(scripted);
    Flown { result, chronicle, remarks, venues, flown }
}

/// Nothing is wrong with our use of the runtime, nothing of it is left, and no frame begun was left open.
pub fn assert_clean(mock: &Mock, case: &str) {
    assert_eq!(mock.violations(), [], "{case}");
    assert_eq!(mock.leaks(), [], "{case}");
    let mut open = false;
    for call in mock.log() {
        match (call.function, call.code.into_raw() >= 0) {
            ("xrBeginFrame", true) => {
                assert!(!open, "{case}: a frame is begun while another is open");
                open = true;
            }
            ("xrEndFrame", true) => open = false,
            ("xrDestroySession", _) => assert!(!open, "{case}: a frame is left open"),
            _ => {}
        }
    }
    assert!(!open, "{case}: a frame is left open");
}

/// The codes that the registry documents for a function, SUCCESS aside.
pub fn documented(function: &str) -> &'static [sys::Result] {
    let found = documented_codes::DOCUMENTED_CODES.iter().find(|(name, _)| *name == function);
    found.unwrap_or_else(|| panic!("{function} is not in documented_codes.rs")).1
}
