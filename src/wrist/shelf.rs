//! Bookmarks, worlds and settings, read and written by a thread of their own: no frame waits for a disk, nor for a place
//! that is a million levels deep.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use anyhow::{Context, Result};
use toml::Value;

use crate::address::Address;
use crate::at;
use crate::bookmarks::Store;
use crate::course::Stand;
use crate::world::World;

/// Writes settings, and says where; such as [`settings::save`](crate::settings::save).
pub type Saver = fn(&[(&str, Value)]) -> Result<PathBuf>;

/// Somewhere to go.
pub struct Departure {
    /// The world, which may be the one that he is in.
    pub world: World,
    /// Where in it.
    pub stand: Stand,
}

/// What came of something.
pub(super) enum News {
    Places(Vec<String>),
    Worlds(Vec<[String; 2]>),
    Notice(String),
    Departure(Box<Departure>),
}

type Job = Box<dyn FnOnce(&Sender<News>) + Send>;

/// Reads and writes beside the frames.
#[derive(Default)]
pub struct Shelf {
    /// The bookmarks; None: the user's own.
    pub store: Option<Store>,
    /// Keeps settings for the next start; None: they are not kept.
    pub saver: Option<Saver>,
    worker: Option<Worker>,
}

struct Worker {
    jobs: Option<Sender<Job>>,
    hears: Receiver<News>,
    thread: Option<JoinHandle<()>>,
}

impl Shelf {
    /// What came of something since it was last asked.
    pub(super) fn news(&mut self) -> Option<News> {
        self.worker.as_ref()?.hears.try_recv().ok()
    }

    /// Sees which bookmarks and worlds there are.
    pub(super) fn look(&mut self) {
        let store = self.store.clone();
        self.work("the bookmarks cannot be read", move |news| {
            let titled = |name: &str| Some([name.to_owned(), World::load(name).ok()?.title]);
            let _ = news.send(News::Worlds(World::names().filter_map(titled).collect()));
            list(store, news)
        });
    }

    /// Keeps a place as a bookmark under a name like this.
    pub fn mark(&mut self, name: String, address: Address) {
        let store = self.store.clone();
        self.work("the place is not kept", move |news| {
            let name = open(store.clone())?.add_like(&name, &address)?;
            tracing::info!("bookmark @{}", name.as_str());
            let _ = news.send(News::Notice(format!("Marked as {}", name.as_str())));
            list(store, news)
        });
    }

    /// Finds the way to a bookmark from this world.
    pub fn go(&mut self, name: String, here: World) {
        let store = self.store.clone();
        self.work("there is no way there", move |news| {
            let text = open(store)?.find(&name)?;
            let address: Address = text.parse().with_context(|| format!("@{name}"))?;
            let world = address.world(Some(&here)).with_context(|| format!("@{name}"))?;
            let stand = address.stand(&world.surface);
            let _ = news.send(News::Notice(format!("To {name}")));
            let _ = news.send(News::Departure(Box::new(Departure { world, stand })));
            Ok(())
        });
    }

    /// Finds the start of a world, by its name.
    pub fn enter(&mut self, name: String, here: World) {
        self.work("there is no way there", move |news| {
            let world = if here.name == name { here } else { World::load(&name)? };
            let stand = at::stand(&world, 0, None);
            let _ = news.send(News::Departure(Box::new(Departure { world, stand })));
            Ok(())
        });
    }

    /// Keeps settings for the next start, where they are kept.
    pub fn save(&mut self, changes: Vec<(&'static str, Value)>) {
        let Some(saver) = self.saver.filter(|_| !changes.is_empty()) else { return };
        self.work("the choice is not kept for the next start", move |_| {
            let path = saver(&changes)?;
            tracing::info!("settings: {} kept in {}", changes[0].0, path.display());
            Ok(())
        });
    }

    fn work(
        &mut self,
        trouble: &'static str,
        job: impl FnOnce(&Sender<News>) -> Result<()> + Send + 'static,
    ) {
        let worker = self.worker.get_or_insert_with(Worker::new);
        let job: Job = Box::new(move |news| {
            if let Err(error) = job(news) {
                tracing::warn!("{trouble}: {error:#}");
                let _ = news.send(News::Notice(format!("{trouble}: {error:#}")));
            }
        });
        if let Some(jobs) = &worker.jobs {
            // The thread ends only with this.
            let _ = jobs.send(job);
        }
    }
}

impl Worker {
    fn new() -> Worker {
        let (jobs, todo) = channel::<Job>();
        let (says, hears) = channel();
        let thread = std::thread::spawn(move || todo.iter().for_each(|job| job(&says)));
        Worker { jobs: Some(jobs), hears, thread: Some(thread) }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // Nothing that was asked for is lost by leaving.
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn open(store: Option<Store>) -> Result<Store> {
    Ok(store.map_or_else(Store::open, Ok)?)
}

fn list(store: Option<Store>, news: &Sender<News>) -> Result<()> {
    let listing = open(store)?.list()?;
    if let Some(damage) = listing.damage {
        tracing::warn!("{damage}");
    }
    let _ = news.send(News::Places(listing.bookmarks.into_keys().collect()));
    Ok(())
}
