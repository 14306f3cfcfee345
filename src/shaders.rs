//! The shaders as files: those that are built in, written to a folder, and those of a folder instead of them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, bail, ensure};

use crate::desktop::MIRROR_SHADER;
use crate::files;
use crate::gpu::{Constant, Shader, ShaderText, Shelf, Source, replaced};
use crate::render::layout::SlotLayout;
use crate::render::{
    AID_CONSTANTS, AIDS_SHADER, BAKE_SHADER, HASH_SHADER, INSPECT_SHADER, LINES_SHADER, MASK_SHADER,
    PANELS_SHADER, QUAD_SHADER, SCENE_SHADER, SHOWN_SHADER, SKY_SHADER, SRGB_SHADER, TERRAIN_SHADER,
    TILE_SHADER, VEIL_SHADER,
};
use crate::terrain::tile::Cells;
use crate::watch::{self, Stamp, Watch};
use crate::world::source::hint;

/// Every shader that is built in, with a line about it.
pub const BUILT_IN: [(Source<'static>, &str); 16] = [
    (HASH_SHADER, "noise: the same numbers as the processor's"),
    (TILE_SHADER, "the heights of a tile: the same as the processor's, to the bit"),
    (SCENE_SHADER, "what all that draw the world are given"),
    (TERRAIN_SHADER, "a tile's vertices, its colours and their light"),
    (SKY_SHADER, "sky and backdrop behind the tiles"),
    (BAKE_SHADER, "tiles into the backdrop"),
    (MASK_SHADER, "what a headset's lenses hide"),
    (SRGB_SHADER, "light of the colours that are stored"),
    (SHOWN_SHADER, "what the options for seeing how it works share"),
    (INSPECT_SHADER, "levels, normals, slopes, depth; a tinted backdrop, its faces"),
    (LINES_SHADER, "boxes, patches, frusta"),
    (MIRROR_SHADER, "the window's picture from the eyes'"),
    (PANELS_SHADER, "the panels"),
    (QUAD_SHADER, "a panel that hangs before the wearer"),
    (VEIL_SHADER, "what narrows the view, or darkens it"),
    (AIDS_SHADER, "hands, their rays, the way back, the grid that stands still"),
];

/// The pieces that are compiled together.
pub const PROGRAMS: [&[Source<'static>]; 11] = [
    &[HASH_SHADER, TILE_SHADER],
    &[HASH_SHADER, SCENE_SHADER, TERRAIN_SHADER, SKY_SHADER],
    &[HASH_SHADER, SCENE_SHADER, TERRAIN_SHADER, BAKE_SHADER],
    &[MASK_SHADER],
    &[HASH_SHADER, SCENE_SHADER, TERRAIN_SHADER, SKY_SHADER, SRGB_SHADER, SHOWN_SHADER, INSPECT_SHADER],
    &[SCENE_SHADER, SRGB_SHADER, SHOWN_SHADER, LINES_SHADER],
    &[MIRROR_SHADER],
    &[PANELS_SHADER],
    &[SRGB_SHADER, QUAD_SHADER],
    &[SRGB_SHADER, VEIL_SHADER],
    &[SCENE_SHADER, SRGB_SHADER, SHOWN_SHADER, AIDS_SHADER],
];

/// The constants of all programs' preludes, for tiles of this layout.
pub fn constants(layout: SlotLayout) -> Vec<(&'static str, Constant)> {
    layout.constants().into_iter().chain(AID_CONSTANTS).collect()
}

/// The name of a built-in shader's file.
pub fn file_name(source: &Source<'static>) -> &'static str {
    source.name.rsplit('/').next().unwrap_or(source.name)
}

/// Writes the built-in shaders to a folder, which is made where it is missing.
///
/// # Errors
/// A file of the same name that says something else, which stays as it is; or the folder cannot be written.
pub fn write(folder: &Path) -> Result<()> {
    for (source, _) in &BUILT_IN {
        let path = folder.join(file_name(source));
        let other = std::fs::read(&path).is_ok_and(|text| text != source.text.as_bytes());
        ensure!(!other, "{} is there already and has been changed: choose another folder", path.display());
    }
    files::prepare_folder(folder, "--out")?;
    for (source, _) in &BUILT_IN {
        let path = folder.join(file_name(source));
        files::write_whole(&path, |file| std::io::Write::write_all(file, source.text.as_bytes()))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// The shaders of a folder, checked: each program of them can take the place of the built-in one. Files that are not called
/// `.wgsl` are nobody's business.
///
/// # Errors
/// A folder that cannot be read, lacks a shader or has one that is none of ours; WGSL that is wrong, with file, line and
/// column ([`ShaderError`](crate::gpu::ShaderError)).
pub fn load(folder: &Path) -> Result<Arc<[ShaderText]>> {
    let texts = read(folder)?;
    check(&texts)?;
    Ok(texts.into())
}

fn read(folder: &Path) -> Result<Vec<ShaderText>> {
    let shown = folder.display();
    let advice = "`fathomless shaders --out DIR` writes all of them, to begin from";
    let entries = std::fs::read_dir(folder)
        .with_context(|| format!("there are no shaders to be read in {shown}; {advice}"))?;
    let known = BUILT_IN.map(|(source, _)| file_name(&source));
    for entry in entries {
        let name = entry.with_context(|| format!("cannot read {shown}"))?.file_name();
        let name = name.to_string_lossy();
        if name.ends_with(".wgsl") && !name.starts_with('.') && !known.contains(&name.as_ref()) {
            bail!("{shown} has {name}, and there is no such shader{}", hint(&name, &known));
        }
    }
    let missing: Vec<&str> = known.into_iter().filter(|name| !folder.join(name).exists()).collect();
    ensure!(missing.is_empty(), "{shown} lacks {}; {advice}", missing.join(", "));
    let texts = BUILT_IN.iter().map(|(source, _)| {
        let path = folder.join(file_name(source));
        let name = path.display().to_string();
        let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {name}"))?;
        Ok(ShaderText { replaces: source.name, name, text })
    });
    texts.collect()
}

/// Compiles every program that has a piece of these, as far as that goes without a device.
fn check(texts: &[ShaderText]) -> Result<()> {
    // Which layout does not matter to what can be wrong.
    let constants = constants(SlotLayout { cells: Cells::N32, mesh: 16 });
    for pieces in PROGRAMS {
        let built_in = Shader::compile(pieces, &constants)?;
        let own = replaced(pieces, texts);
        let shader = Shader::compile(&own, &constants)?;
        let names = || own.iter().map(|piece| piece.name).collect::<Vec<_>>().join(" + ");
        shader.stands_in_for(&built_in).with_context(names)?;
        for entry in built_in.entry_points() {
            shader.spirv(entry).with_context(names)?;
        }
    }
    Ok(())
}

/// A folder with shaders, which is looked at while they are in use.
pub struct Folder {
    /// What is in use.
    pub shelf: &'static Shelf,
    watch: Watch<Result<Arc<[ShaderText]>>>,
}

impl Folder {
    /// Its shaders are on the shelf from now on; the shelf stays until the program ends.
    ///
    /// # Errors
    /// As [`load`].
    pub fn open(folder: &Path) -> Result<Folder> {
        let (at, seen) = (folder.to_owned(), folder.to_owned());
        // What changes while it is read is news.
        let watch = Watch::new(move || stamps(&seen), move || load(&at));
        let shelf = Box::leak(Box::new(Shelf::default()));
        shelf.put(load(folder)?);
        Ok(Folder { shelf, watch })
    }

    /// The shaders since they were last asked for, where a file has changed; or what is wrong with them. Never waits.
    pub fn news(&self) -> Option<Result<Arc<[ShaderText]>>> {
        self.watch.news()
    }
}

/// What tells that a folder's shaders have changed: the folder's own stamp, for files that come and go, and theirs.
fn stamps(folder: &Path) -> Vec<Stamp> {
    let paths = BUILT_IN.iter().map(|(source, _)| folder.join(file_name(source)));
    std::iter::once(folder.to_owned()).chain(paths).map(|path: PathBuf| watch::stamp(&path)).collect()
}
