//! What the OpenXR registry says of interaction profiles, names and extensions; the tables are made from it.

#[rustfmt::skip]
mod table;

pub use table::{COMMANDS, EXTENSIONS, OBJECT_TYPES, PROFILES, RESULTS, STRUCTURE_TYPES, VERSION};

/// Names of versions (`XR_VERSION_1_1`) and extensions: any of these lists, each all of its names.
pub type Needs = &'static [&'static [&'static str]];

/// What a component of an interaction profile measures or does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A button: pressed or not.
    Boolean,
    /// A number, [0, 1] or [-1, 1].
    Float,
    /// Two numbers, each [-1, 1].
    Vector,
    /// A place that can be located.
    Pose,
    /// An output that vibrates.
    Haptic,
}

/// A family of devices and what it has.
#[derive(Debug)]
pub struct Profile {
    /// Such as `/interaction_profiles/khr/simple_controller`.
    pub path: &'static str,
    /// For people.
    pub title: &'static str,
    /// What offers it.
    pub needs: Needs,
    /// Where such devices are, such as `/user/hand/left`.
    pub user_paths: &'static [&'static str],
    /// Inputs and outputs.
    pub components: &'static [Component],
}

/// An input or output of a device.
#[derive(Debug)]
pub struct Component {
    /// The only user path that has it; `None`: all of the profile's.
    pub user_path: Option<&'static str>,
    /// Such as `/input/trigger/value`.
    pub subpath: &'static str,
    /// Its type.
    pub kind: Kind,
    /// The system may keep it for itself.
    pub system: bool,
    /// What offers it, where the profile is offered.
    pub needs: Needs,
}

/// A function of the API.
#[derive(Debug)]
pub struct Command {
    /// Such as `xrEndFrame`.
    pub name: &'static str,
    /// What offers it.
    pub needs: Needs,
    /// The numbers of the result codes for success that it may return.
    pub successes: &'static [i32],
    /// The numbers of the result codes for failure that it may return.
    pub errors: &'static [i32],
}

/// An extension of the API.
#[derive(Debug)]
pub struct Extension {
    /// Such as `XR_EXT_hand_tracking`.
    pub name: &'static str,
    /// Version of its specification.
    pub version: u32,
    /// What must be there for it to be enabled.
    pub needs: Needs,
    /// It adds interaction profiles and components, and nothing else.
    pub only_paths: bool,
}

/// The profile of that path.
pub fn profile(path: &str) -> Option<&'static Profile> {
    PROFILES.iter().find(|profile| profile.path == path)
}

/// The function of that name.
pub fn command(name: &str) -> Option<&'static Command> {
    COMMANDS.iter().find(|command| command.name == name)
}

/// What must be there for the extension of that name to be enabled.
pub fn extension_needs(name: &str) -> Needs {
    EXTENSIONS.iter().find(|extension| extension.name == name).map_or(table::CORE, |it| it.needs)
}

/// The name of a number in one of the tables of names.
pub fn name(table: &'static [(i32, &'static str)], number: i32) -> Option<&'static str> {
    let index = table.binary_search_by_key(&number, |(number, _)| *number).ok()?;
    table.get(index).map(|(_, name)| *name)
}

/// Whether something is offered to an instance of a version (major, minor) with some extensions.
pub fn is_offered(needs: Needs, version: (u16, u16), has_extension: impl Fn(&str) -> bool) -> bool {
    let is_met = |need: &str| match need.strip_prefix("XR_VERSION_").and_then(|text| text.split_once('_')) {
        Some((major, minor)) => {
            let wanted = major.parse().ok().zip(minor.parse().ok());
            wanted.is_some_and(|wanted: (u16, u16)| version >= wanted)
        }
        None => has_extension(need),
    };
    needs.iter().any(|all| all.iter().all(|need| is_met(need)))
}

impl Component {
    /// Whether a device at a user path has it.
    pub fn is_at(&self, user_path: &str) -> bool {
        self.user_path.is_none_or(|only| only == user_path)
    }

    /// The part that it belongs to: `/input/trigger` for `/input/trigger/value`.
    pub fn identifier(&self) -> &'static str {
        identifier(self.subpath)
    }
}

/// The first two segments of a subpath: `/input/trigger` of `/input/trigger/value`.
pub fn identifier(subpath: &str) -> &str {
    let end = subpath.match_indices('/').nth(2).map_or(subpath.len(), |(index, _)| index);
    &subpath[..end]
}

impl Profile {
    /// The component at a user path and subpath, such as `/user/hand/left` and `/input/trigger/value`.
    pub fn component(&self, user_path: &str, subpath: &str) -> Option<&'static Component> {
        self.components.iter().find(|it| it.subpath == subpath && it.is_at(user_path))
    }

    /// Splits a full path into one of the profile's user paths and the rest.
    pub fn split<'a>(&self, path: &'a str) -> Option<(&'static str, &'a str)> {
        self.user_paths.iter().find_map(|user_path| {
            path.strip_prefix(user_path).filter(|rest| rest.starts_with('/')).map(|rest| (*user_path, rest))
        })
    }
}
