//! Where the texts come from, and when they change: the one file here that looks at the world.

use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use toml::Value;

use super::layers::{self, InForce, Leaf, Place, Problem};
use super::save::edit;
use super::schema;
use crate::files;
use crate::watch::{self, Stamp};
use crate::world::source::hint;

const PREFIX: &str = "FATHOMLESS_";

/// Environment variables that begin like a setting's and are none: those of the program, of its mock runtime, of
/// `setup.sh` and of the tests.
pub const VARIABLES_OF_OTHERS: [&str; 8] = [
    "FATHOMLESS_GPU",
    "FATHOMLESS_WINDOW",
    "FATHOMLESS_DATA_DIR",
    "FATHOMLESS_MOCK_LOG",
    "FATHOMLESS_MOCK_SCRIPT",
    "FATHOMLESS_ROOT",
    "FATHOMLESS_FUZZ_SEED",
    "FATHOMLESS_FUZZ_SEQUENCES",
];

/// What a process finds around it. [`Surroundings::default`] is nothing at all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Surroundings {
    /// The user's settings folder.
    pub folder: Option<PathBuf>,
    /// Environment variables.
    pub variables: Vec<(OsString, OsString)>,
}

impl Surroundings {
    /// Those of this process.
    pub fn of_process() -> Surroundings {
        let folders = directories::ProjectDirs::from("", "", "fathomless");
        Surroundings {
            folder: folders.map(|folders| folders.config_dir().to_owned()),
            variables: std::env::vars_os()
                .filter(|(name, _)| name.to_string_lossy().starts_with(PREFIX))
                .collect(),
        }
    }

    /// The user's own bindings of controllers, whether the file exists or not.
    pub fn bindings_file(&self) -> Option<PathBuf> {
        Some(self.folder.as_ref()?.join("bindings.toml"))
    }

    /// The user's own file, whether it exists or not.
    pub fn user_file(&self) -> Option<PathBuf> {
        Some(self.folder.as_ref()?.join("fathomless.toml"))
    }
}

/// All that settings come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sources {
    /// The user's file and the environment.
    pub around: Surroundings,
    /// `--config`.
    pub config: Option<PathBuf>,
    /// Each `--set`.
    pub sets: Vec<String>,
    /// Other options of the command line: setting, value, option.
    pub options: Vec<(&'static str, Value, &'static str)>,
}

impl Sources {
    /// Reads all of them, the later over the earlier: the manual, the user's file, `--config`, `--set`, the environment,
    /// other options.
    ///
    /// # Errors
    /// The first thing that is wrong. A user's file that is not there is none.
    pub fn load(&self) -> Result<InForce, Problem> {
        let mut leaves = Vec::new();
        if let Some(path) = self.around.user_file()
            && let Some(text) = read(&path, false)?
        {
            leaves.extend(layers::leaves(&path.display().to_string(), &text)?);
        }
        if let Some(path) = &self.config
            && let Some(text) = read(path, true)?
        {
            leaves.extend(layers::leaves(&path.display().to_string(), &text)?);
        }
        for text in &self.sets {
            leaves.push(set(text)?);
        }
        let mut remarks = Vec::new();
        for (name, value) in &self.around.variables {
            let (name, value) = (name.to_string_lossy(), value.to_string_lossy());
            match variable(&name, &value) {
                Named::Setting(leaf) => leaves.push(leaf?),
                Named::Nothing(remark) => remarks.push(remark),
                Named::Another => {}
            }
        }
        for (path, value, option) in &self.options {
            leaves.push(layers::leaf(path, value.clone(), Place::Option(option))?);
        }
        let mut in_force = layers::merge(&leaves)?;
        in_force.remarks.append(&mut remarks);
        Ok(in_force)
    }

    /// What tells that a file has changed.
    fn stamps(&self) -> [Stamp; 2] {
        [self.around.user_file(), self.config.clone()].map(|path| watch::stamp(&path?))
    }
}

/// A file's text; None where it is not there and need not be.
fn read(path: &Path, must: bool) -> Result<Option<String>, Problem> {
    match std::fs::read_to_string(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == ErrorKind::NotFound && !must => Ok(None),
        Err(error) => Err(Problem {
            place: Place::File { file: path.display().to_string(), line: 1, column: 1 },
            problem: format!("it cannot be read: {error}"),
            remedy: match must {
                true => "give --config the path of a file of settings",
                false => "it should be a file of settings that you may read, or not be there",
            }
            .to_owned(),
        }),
    }
}

/// What `--set` says.
fn set(text: &str) -> Result<Leaf, Problem> {
    let place = Place::Set(text.to_owned());
    let Some((path, value)) = text.split_once('=') else {
        return Err(Problem {
            place,
            problem: "there is no `=` in it".to_owned(),
            remedy: "it should be SECTION.KEY=VALUE, such as motion.speed=2".to_owned(),
        });
    };
    layers::spoken(path.trim(), value.trim(), place)
}

enum Named {
    Setting(Result<Leaf, Problem>),
    /// It looks like a setting's, and there is none of this name.
    Nothing(String),
    Another,
}

/// What an environment variable says.
fn variable(name: &str, value: &str) -> Named {
    let entries = schema::entries();
    if let Some(entry) = entries.iter().find(|entry| schema::variable(&entry.path) == name) {
        return Named::Setting(layers::spoken(&entry.path, value.trim(), Place::Variable(name.to_owned())));
    }
    if !name.starts_with(PREFIX) || VARIABLES_OF_OTHERS.contains(&name) {
        return Named::Another;
    }
    let known: Vec<String> = entries.iter().map(|entry| schema::variable(&entry.path)).collect();
    let known: Vec<&str> = known.iter().map(String::as_str).chain(VARIABLES_OF_OTHERS).collect();
    Named::Nothing(format!("the environment variable {name} sets nothing{}", hint(name, &known)))
}

/// Looks at the files of settings, beside everything else.
pub struct Watch(watch::Watch<Result<InForce, Problem>>);

impl Watch {
    /// From now on: what the files are at present is known already.
    pub fn new(sources: Sources) -> Watch {
        let looked_at = sources.clone();
        Watch(watch::Watch::new(move || looked_at.stamps(), move || sources.load()))
    }

    /// The settings since they were last asked for, where the files have changed; or what is wrong with them now.
    pub fn news(&self) -> Option<Result<InForce, Problem>> {
        self.0.news()
    }
}

/// Changes settings in the user's own file, which is made where it is missing, and otherwise keeps its comments. Returns
/// its path.
///
/// # Errors
/// A change that no setting allows; a file that is wrong, or cannot be read or written: it then stays as it is.
pub fn save(changes: &[(&str, Value)]) -> Result<PathBuf> {
    let path =
        Surroundings::of_process().user_file().context("there is no home folder to keep settings in")?;
    save_to(&path, changes)?;
    Ok(path)
}

/// The same in any file.
///
/// # Errors
/// As [`save`].
pub fn save_to(path: &Path, changes: &[(&str, Value)]) -> Result<()> {
    let shown = path.display().to_string();
    let text = read(path, false)?.unwrap_or_default();
    let text = edit(&shown, &text, changes)?;
    // Whoever keeps his settings elsewhere has a link here, and shall keep it.
    let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    if let Some(folder) = target.parent() {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    }
    files::write_whole(&target, |file| std::io::Write::write_all(file, text.as_bytes()))
        .with_context(|| format!("cannot write {shown}"))
}
