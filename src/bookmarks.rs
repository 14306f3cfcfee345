//! Bookmarks: addresses under names, in a file of the user's data folder.
//!
//! The file is TOML, a line per bookmark. It is written whole or not at all, under a lock, so that several instances
//! lose nothing to each other. A damaged file is never overwritten: what can be read of it is taken over, and the
//! file itself is kept aside as `bookmarks.toml.bad-1`, `-2` and so on.

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::address::Address;
use crate::files;

/// The environment variable that names another data folder.
pub const FOLDER_VARIABLE: &str = "FATHOMLESS_DATA_DIR";

/// How long to wait for another instance to finish writing.
const PATIENCE: Duration = Duration::from_secs(10);

/// Letters of the longest name.
const MAX_NAME: usize = 64;

/// Names tried that are like one that is taken.
const MOST_ALIKE: u32 = 100_000;

const HEADING: &str = "\
# Places marked in Fathomless, a line each: name = \"address\". `fathomless bookmarks` lists them.
# The program rewrites this file: comments of your own are not kept.
";

/// A bookmark's name: 1 to 64 letters, digits, `-`, `_` or `.`, the first a letter or a digit.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Name(String);

impl Name {
    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for Name {
    type Err = String;

    fn from_str(text: &str) -> Result<Name, String> {
        let inside = |c: char| c.is_alphanumeric() || "-_.".contains(c);
        let good = text.starts_with(char::is_alphanumeric)
            && text.chars().all(inside)
            && text.chars().count() <= MAX_NAME;
        good.then(|| Name(text.to_owned())).ok_or_else(|| {
            format!("a bookmark's name is 1 to {MAX_NAME} letters, digits, `-`, `_` or `.`, such as red-mesa")
        })
    }
}

/// Why bookmarks cannot be had or changed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Nobody is at home.
    #[error("there is no home folder to keep bookmarks in: set {FOLDER_VARIABLE} to a folder")]
    NoFolder,
    /// The file is there and cannot be read.
    #[error("cannot read the bookmarks in {path}: {source}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The folder cannot be made or written.
    #[error(
        "cannot write bookmarks to {folder}: {source}; make it writable, or set {FOLDER_VARIABLE} to another folder"
    )]
    Unwritable {
        /// The folder.
        folder: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Another instance holds the lock.
    #[error("another fathomless has been changing the bookmarks in {folder} for {} seconds: try again when it is done", PATIENCE.as_secs())]
    Busy {
        /// The folder.
        folder: PathBuf,
    },
    /// The name is taken.
    #[error("there is a bookmark `{0}` already: `fathomless bookmarks remove {0}` makes room for it")]
    Exists(String),
    /// No such name.
    #[error("no bookmark is called `{name}`; {known}")]
    Missing {
        /// The name asked for.
        name: String,
        /// The names there are, as the rest of the sentence.
        known: String,
    },
}

/// What was wrong with the file, and where it is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// The damaged file: where it was found, or, after a change, where it is kept aside.
    pub path: PathBuf,
    /// What is wrong in it, on one line.
    pub problem: String,
    /// How many bookmarks could be read all the same.
    pub rescued: usize,
    /// It was moved: there is a sound file in its place now.
    pub aside: bool,
}

impl std::fmt::Display for Damage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Damage { path, problem, rescued, aside } = self;
        let end = match aside {
            true => format!("it is kept as {}", path.display()),
            false => format!(
                "{} stays as it is until bookmarks are changed, and is kept aside then",
                path.display()
            ),
        };
        write!(f, "the bookmarks file was damaged ({problem}); {rescued} bookmarks could be read, and {end}")
    }
}

/// The bookmarks by name, each the text of an address.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Listing {
    /// Name and address.
    pub bookmarks: BTreeMap<String, String>,
    /// What was wrong with the file, where anything was.
    pub damage: Option<Damage>,
}

#[derive(Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Document {
    bookmarks: BTreeMap<String, String>,
}

/// The folder with the bookmarks.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
}

impl Store {
    /// The user's own: the folder that `FATHOMLESS_DATA_DIR` names, or the system's place for data.
    ///
    /// # Errors
    /// [`Error::NoFolder`].
    pub fn open() -> Result<Store, Error> {
        let named = std::env::var_os(FOLDER_VARIABLE).filter(|folder| !folder.is_empty()).map(PathBuf::from);
        let own = || Some(directories::ProjectDirs::from("", "", "fathomless")?.data_dir().to_owned());
        named.or_else(own).map(Store::at).ok_or(Error::NoFolder)
    }

    /// A folder, made when something is written to it.
    pub fn at(folder: impl Into<PathBuf>) -> Store {
        Store { folder: folder.into() }
    }

    /// The file.
    pub fn path(&self) -> PathBuf {
        self.folder.join("bookmarks.toml")
    }

    /// All bookmarks. Changes nothing.
    ///
    /// # Errors
    /// [`Error::Unreadable`].
    pub fn list(&self) -> Result<Listing, Error> {
        let path = self.path();
        match fs::read(&path) {
            Ok(bytes) => Ok(read(&path, &String::from_utf8_lossy(&bytes))),
            Err(source) if source.kind() == io::ErrorKind::NotFound => Ok(Listing::default()),
            Err(source) => Err(Error::Unreadable { path, source }),
        }
    }

    /// The text of the address under a name.
    ///
    /// # Errors
    /// [`Error::Unreadable`], [`Error::Missing`].
    pub fn find(&self, name: &str) -> Result<String, Error> {
        let listing = self.list()?;
        if let Some(damage) = &listing.damage {
            tracing::warn!("{damage}");
        }
        listing.bookmarks.get(name).cloned().ok_or_else(|| missing(name, &listing))
    }

    /// Adds a bookmark. Says so if the file was damaged and is kept aside.
    ///
    /// # Errors
    /// [`Error`]: the name is taken, or nothing can be written. Then nothing has changed.
    pub fn add(&self, name: &Name, address: &Address) -> Result<Option<Damage>, Error> {
        self.change(|listing| match listing.bookmarks.contains_key(name.as_str()) {
            true => Err(Error::Exists(name.0.clone())),
            false => {
                listing.bookmarks.insert(name.0.clone(), address.to_string());
                Ok(())
            }
        })
    }

    /// Adds a bookmark under a name like this one that is free, and says which.
    ///
    /// # Errors
    /// [`Error`]: nothing can be written, or all such names are taken. Then nothing has changed.
    pub fn add_like(&self, wanted: &str, address: &Address) -> Result<Name, Error> {
        let allowed = |c: char| c.is_alphanumeric() || "-_.".contains(c);
        let plain: String = wanted.chars().map(|c| if allowed(c) { c } else { '-' }).take(48).collect();
        let plain = plain.trim_start_matches(|c: char| !c.is_alphanumeric());
        let plain = if plain.is_empty() { "place" } else { plain };
        for i in 1..MOST_ALIKE {
            // Letters of names, and few enough of them.
            let name = Name(if i == 1 { plain.to_owned() } else { format!("{plain}_{i}") });
            match self.add(&name, address) {
                Ok(damage) => {
                    damage.into_iter().for_each(|damage| tracing::warn!("{damage}"));
                    return Ok(name);
                }
                Err(Error::Exists(_)) => {}
                Err(error) => return Err(error),
            }
        }
        Err(Error::Exists(plain.to_owned()))
    }

    /// Removes a bookmark. Says so if the file was damaged and is kept aside.
    ///
    /// # Errors
    /// [`Error`]: there is none, or nothing can be written. Then nothing has changed.
    pub fn remove(&self, name: &str) -> Result<Option<Damage>, Error> {
        self.change(|listing| match listing.bookmarks.remove(name) {
            Some(_) => Ok(()),
            None => Err(missing(name, listing)),
        })
    }

    /// Reads, changes and writes, alone.
    fn change(
        &self,
        change: impl FnOnce(&mut Listing) -> Result<(), Error>,
    ) -> Result<Option<Damage>, Error> {
        let unwritable = |source| Error::Unwritable { folder: self.folder.clone(), source };
        fs::create_dir_all(&self.folder).map_err(unwritable)?;
        let _lock = self.lock()?;
        let mut listing = self.list()?;
        change(&mut listing)?;
        if let Some(damage) = &mut listing.damage {
            damage.path = keep_aside(&damage.path).map_err(unwritable)?;
            damage.aside = true;
        }
        let document = toml::to_string(&Document { bookmarks: listing.bookmarks });
        let document = document.map_err(|error| unwritable(io::Error::other(error)))?;
        let written = files::write_whole(&self.path(), |file| {
            file.write_all(HEADING.as_bytes())?;
            file.write_all(document.as_bytes())?;
            file.flush()?;
            // Also where the power fails: the old file or the new one.
            file.get_ref().sync_all()
        });
        written.map_err(unwritable)?;
        Ok(listing.damage)
    }

    /// Held until it is dropped, or the process ends in whatever way.
    fn lock(&self) -> Result<File, Error> {
        let unwritable = |source| Error::Unwritable { folder: self.folder.clone(), source };
        let path = self.folder.join("bookmarks.lock");
        let lock = File::options().create(true).append(true).open(path).map_err(unwritable)?;
        let start = Instant::now();
        loop {
            match lock.try_lock() {
                Ok(()) => return Ok(lock),
                Err(TryLockError::Error(source)) => return Err(unwritable(source)),
                Err(TryLockError::WouldBlock) if start.elapsed() > PATIENCE => {
                    return Err(Error::Busy { folder: self.folder.clone() });
                }
                Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(2)),
            }
        }
    }
}

fn missing(name: &str, listing: &Listing) -> Error {
    let names: Vec<&str> = listing.bookmarks.keys().map(String::as_str).collect();
    let known = match names.is_empty() {
        true => "there are none yet: `fathomless bookmarks add NAME --at PLACE` makes one".to_owned(),
        false => format!("there are {}", names.join(", ")),
    };
    Error::Missing { name: name.to_owned(), known }
}

/// Reads the file's text; where it is damaged, line by line.
fn read(path: &Path, text: &str) -> Listing {
    match toml::from_str::<Document>(text) {
        Ok(document) => Listing { bookmarks: document.bookmarks, damage: None },
        Err(error) => {
            let line = error.span().map_or(1, |at| 1 + text[..at.start].matches('\n').count());
            let bookmarks = rescue(text);
            let problem = format!("line {line}: {}", error.message().replace('\n', " "));
            let rescued = bookmarks.len();
            Listing {
                bookmarks,
                damage: Some(Damage { path: path.to_owned(), problem, rescued, aside: false }),
            }
        }
    }
}

/// Every line that is a bookmark by itself; of two with one name the first.
fn rescue(text: &str) -> BTreeMap<String, String> {
    let mut bookmarks = BTreeMap::new();
    for line in text.lines() {
        let line: BTreeMap<String, String> = toml::from_str(line).unwrap_or_default();
        for (name, address) in line {
            if name.parse::<Name>().is_ok() && address.starts_with(crate::address::PREFIX) {
                bookmarks.entry(name).or_insert(address);
            }
        }
    }
    bookmarks
}

/// Copies a damaged file to a name of its own, and says to which.
fn keep_aside(path: &Path) -> io::Result<PathBuf> {
    for i in 1u32.. {
        let mut name = path.as_os_str().to_owned();
        name.push(format!(".bad-{i}"));
        let aside = PathBuf::from(name);
        if !aside.exists() {
            fs::copy(path, &aside)?;
            return Ok(aside);
        }
    }
    Err(io::Error::other("too many damaged files are kept aside"))
}
