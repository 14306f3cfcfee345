//! A flight in a world, as the [`Supervisor`](crate::supervisor::Supervisor) keeps it going: the viewer on whatever runtime
//! there is.

mod wrist;

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::Result;

use crate::aids::Aids;
use crate::at;
use crate::comfort::{Comfort, Senses};
use crate::course::{Course, Standpoint};
use crate::flight::Flight;
use crate::gpu::Lost;
use crate::helm::Helm;
use crate::input::Input;
use crate::mock::Mock;
use crate::panels::wrist::Choices;
use crate::pilot::Pilot;
use crate::shaders::Folder;
use crate::sound::Sound;
use crate::supervisor::{Stage, Venue};
use crate::telemetry::{Logbook, Memory, Span, Stopwatch};
use crate::viewer::{Remarks, Step, Viewer, ViewerConfig, Witness, stand_in, survive};
use crate::world::World;
use crate::wrist::{Departure, Wrist};
use crate::xr;

/// Where runtimes come from.
pub type Source = fn() -> Result<xr::Runtime, xr::Error>;

/// The system's own runtime, with a headset that answers.
///
/// # Errors
/// There is none, or no headset answers it.
pub fn system_runtime() -> Result<xr::Runtime, xr::Error> {
    xr::Runtime::open(xr::system_entry()?, "Fathomless")
}

/// A flight in a world. World, flight, way and settings stay through everything that happens to sessions.
pub struct Flying<'a> {
    /// The world.
    pub world: World,
    /// The flight.
    pub flight: &'a Flight,
    /// Its way through the world.
    pub course: Course,
    /// The settings of every viewer.
    pub config: ViewerConfig,
    /// Opens the headset's runtime; None: a mock of one's own takes its place.
    pub headset: Headset,
    /// Whoever wears the headset may take over.
    pub helm: Helm,
    /// What is heard.
    pub sound: Sound,
    /// What spares his stomach.
    pub comfort: Comfort,
    /// His panel.
    pub wrist: Wrist,
    /// What was chosen on it before a slider began to move.
    kept: Option<Choices>,
    /// What is kept of the frames.
    pub logbook: Logbook,
    /// Shaders of one's own.
    pub shaders: Option<Folder>,
    /// Of every viewer so far.
    witnesses: Vec<Witness>,
    /// A question under way, whether a headset answers.
    question: Option<JoinHandle<bool>>,
}

/// What is taken for the headset.
#[derive(Clone)]
pub enum Headset {
    /// What this opens.
    Runtime(Source),
    /// A mock.
    Mock(Mock),
}

impl<'a> Flying<'a> {
    /// Nothing is opened yet.
    pub fn new(
        world: &World,
        flight: &'a Flight,
        course: Course,
        config: ViewerConfig,
        headset: Headset,
    ) -> Flying<'a> {
        let (world, logbook) = (world.clone(), Logbook::default());
        let (helm, comfort) = (Helm::default(), Comfort::default());
        Flying {
            world,
            flight,
            course,
            config,
            headset,
            helm,
            sound: Sound::default(),
            comfort,
            wrist: Wrist::default(),
            kept: None,
            logbook,
            shaders: None,
            witnesses: Vec::new(),
            question: None,
        }
    }

    /// Where the viewer is: where somebody has steered, or where the flight is after so long.
    pub fn standpoint(&mut self, flown: Duration) -> Standpoint<'_> {
        let Flying { helm, flight, course, .. } = self;
        helm.standpoint().unwrap_or_else(|| {
            let pose = flight.pose_at(flown.as_secs_f64().min(flight.duration_s));
            course.at(&pose)
        })
    }

    /// Takes the viewer on by a frame of `dt`. Somebody who steers takes over from the flight.
    pub fn steer(&mut self, viewer: &mut Viewer, input: &Input, flown: Duration, dt: Duration) {
        // Somebody who has taken the headset off moves nothing, and is not moved.
        let input = self.comfort.hold(input, !input.worn || viewer.is_seen());
        if self.helm.pilot().is_none() && input.steers() {
            let here = self.standpoint(flown).stand();
            self.helm.take(&here);
        }
        if input.recentre && input.worn {
            self.helm.recentre(viewer);
        }
        self.helm.advance(&input, dt, viewer.headroom());
        if input.worn {
            let by_hand = input.grab != [None; 2];
            let senses = Senses { by_hand, ..self.senses(viewer, flown) };
            self.comfort.advance(dt, &senses);
        } else {
            self.comfort.rest();
        }
        let mut aids = Aids::default();
        if input.worn {
            self.helm.aids(viewer, &mut aids);
            self.wrist.cut(&mut aids);
        }
        self.comfort.fill(&mut aids);
        viewer.set_aids(&aids);
    }

    /// How the wearer is moved now, and what he saw of it in the last frame.
    fn senses(&mut self, viewer: &Viewer, flown: Duration) -> Senses {
        let flow = self.helm.pilot().map(Pilot::flow);
        let Standpoint { depth, heading, .. } = self.standpoint(flown);
        Senses {
            flow,
            depth,
            heading,
            by_hand: self.helm.pilot().is_some_and(|pilot| pilot.holds() != [false; 2]),
            seen: viewer.is_seen(),
            tracked: viewer.is_tracked(),
            jolted: viewer.has_jolted(),
            widest: viewer.widest(),
            floor_m: viewer.floor_m(),
        }
    }

    /// Keeps what is to be known of a frame, of which `watch` has what was done before and after the viewer's part.
    pub fn note(&mut self, viewer: &Viewer, watch: &Stopwatch, step: Step, depth: f64) {
        match step {
            Step::Drew => {
                let mut stats = *viewer.stats();
                stats.surround(watch);
                // Whoever steers has left the flight's path.
                let steered = self.helm.standpoint().map(|here| here.place.spine.path_bytes());
                let path_bytes = steered.unwrap_or_else(|| self.course.path_bytes()) as u64;
                let gpu_bytes = viewer.gpu().memory_bytes();
                self.logbook.frame(&stats, depth, Memory { path_bytes, gpu_bytes, ..Memory::default() });
            }
            // Nobody waits for a frame: it is not the frame that is long.
            Step::Idle | Step::Skipped => self.logbook.pause(),
            Step::Exited => {}
        }
    }

    /// Another world is drawn from now on, and the flight begins at its start. False where there is no room for it: all
    /// stays as it was.
    ///
    /// # Errors
    /// The device is lost.
    pub fn enter(&mut self, viewer: &mut Viewer, world: World) -> Result<bool> {
        let entered = survive(viewer.redraw(&world, viewer.wanted_quality()))?;
        if entered {
            self.helm.start = Some(at::stand(&world, 0, None));
            self.course = at::course(&world, self.flight, 0, None);
            self.world = world;
        }
        Ok(entered)
    }

    /// Takes up shaders that have changed; those that cannot be used are said, and the old ones stay. None: nothing has
    /// changed; else whether other ones are in use now.
    ///
    /// # Errors
    /// The device is lost.
    pub fn heed_shaders(&mut self, viewer: &mut Viewer) -> Result<Option<bool>> {
        let Some((folder, new)) = self.shaders.as_ref().and_then(|folder| Some((folder, folder.news()?)))
        else {
            return Ok(None);
        };
        let done = new.and_then(|texts| match texts == folder.shelf.texts() {
            true => Ok(()),
            false => viewer.set_shaders(&self.world, texts),
        });
        match done {
            Ok(()) => {
                tracing::info!("the shaders are taken up");
                Ok(Some(true))
            }
            Err(error) if error.is::<Lost>() => Err(error),
            Err(error) => {
                tracing::warn!("the shaders stay as they were: {error:#}");
                Ok(Some(false))
            }
        }
    }

    /// Where the wearer asked to go, once he does not see the jump.
    pub fn departure(&mut self) -> Option<Departure> {
        let leaves = self.wrist.departs() && self.comfort.may_jump();
        if leaves { self.wrist.departure() } else { None }
    }

    fn depart(&mut self, viewer: &mut Viewer, Departure { world, stand }: Departure) -> Result<()> {
        // The way may have been found in a world that he has left since.
        if world == self.world || self.enter(viewer, world)? {
            self.helm.go_to(&stand);
        }
        Ok(())
    }

    /// What validation layers and mocks have said of all viewers so far.
    pub fn remarks(&self) -> Remarks {
        let each = self.witnesses.iter().map(Witness::remarks);
        each.fold(Remarks::default(), |sum, one| Remarks {
            validation: sum.validation + one.validation,
            violations: sum.violations + one.violations,
            first: sum.first.or(one.first),
        })
    }
}

impl Headset {
    fn open(&self) -> Result<(xr::Runtime, Option<Mock>)> {
        match self {
            Headset::Runtime(open) => Ok((open()?, None)),
            Headset::Mock(mock) => Ok((xr::Runtime::open(mock.entry()?, "Fathomless")?, Some(mock.clone()))),
        }
    }
}

impl Stage for Flying<'_> {
    type Show = Viewer;

    fn open(&mut self, venue: Venue) -> Result<Viewer> {
        let (runtime, mock) = match venue {
            Venue::Headset => self.headset.open()?,
            Venue::StandIn => stand_in(&self.config)?,
        };
        let viewer = Viewer::on(&self.world, &self.config, runtime, mock)?;
        self.witnesses.push(viewer.witness());
        Ok(viewer)
    }

    fn renew(&mut self, viewer: Viewer) -> Result<Viewer> {
        let before = Arc::clone(viewer.gpu());
        let viewer = viewer.renew(&self.world)?;
        if !Arc::ptr_eq(&before, viewer.gpu()) {
            self.witnesses.push(viewer.witness());
        }
        Ok(viewer)
    }

    fn frame(&mut self, viewer: &mut Viewer, flown: Duration) -> Result<Step> {
        let mut watch = Stopwatch::start();
        self.heed_shaders(viewer)?;
        let dt = self.helm.begin_frame();
        let input = self.hands(viewer, flown, dt)?;
        if let Some(departure) = self.departure() {
            self.depart(viewer, departure)?;
        }
        self.steer(viewer, &input, flown, dt);
        let standpoint = self.standpoint(flown);
        let depth = standpoint.depth;
        watch.lap(Span::Place);
        let step = viewer.frame(&standpoint, true)?;
        if step == Step::Drew {
            self.helm.feel(viewer, depth)?;
        }
        self.sound.follow(depth, dt, self.helm.jumped());
        self.note(viewer, &watch, step, depth);
        Ok(step)
    }

    fn speed(&self, viewer: &Viewer) -> f64 {
        if viewer.is_seen() { viewer.headroom() } else { 0.0 }
    }

    fn request_exit(&mut self, viewer: &mut Viewer) -> Result<()> {
        Ok(viewer.request_exit()?)
    }

    fn headset_answers(&mut self) -> bool {
        let headset = self.headset.clone();
        // Runtimes that are not there may take their time to say so.
        match self.question.take_if(|question| question.is_finished()) {
            Some(answer) => answer.join().unwrap_or(false),
            None => {
                self.question.get_or_insert_with(|| std::thread::spawn(move || headset.open().is_ok()));
                false
            }
        }
    }
}

impl Drop for Flying<'_> {
    fn drop(&mut self) {
        // The loader allows one instance at a time: none is left behind.
        if let Some(question) = self.question.take() {
            let _ = question.join();
        }
    }
}
