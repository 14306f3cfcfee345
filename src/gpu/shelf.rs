//! Shaders' texts that take the place of those that are built in.

use std::sync::{Arc, PoisonError, RwLock};

use super::shader::Source;

/// A text that takes the place of a built-in one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShaderText {
    /// [`Source::name`] of the built-in one.
    pub replaces: &'static str,
    /// What errors call it by: usually its file.
    pub name: String,
    /// WGSL.
    pub text: String,
}

/// The texts in use instead of built-in ones. Programs take them as they are made; others may be put there later.
#[derive(Debug, Default)]
pub struct Shelf(RwLock<Arc<[ShaderText]>>);

impl Shelf {
    /// With these texts.
    pub fn new(texts: Vec<ShaderText>) -> Shelf {
        Shelf(RwLock::new(texts.into()))
    }

    /// Those that are there.
    pub fn texts(&self) -> Arc<[ShaderText]> {
        Arc::clone(&self.0.read().unwrap_or_else(PoisonError::into_inner))
    }

    /// Puts others there. Returns those that were.
    pub fn put(&self, texts: Arc<[ShaderText]>) -> Arc<[ShaderText]> {
        std::mem::replace(&mut self.0.write().unwrap_or_else(PoisonError::into_inner), texts)
    }
}

/// A shelf is itself.
impl PartialEq for Shelf {
    fn eq(&self, other: &Shelf) -> bool {
        std::ptr::eq(self, other)
    }
}

/// The pieces, each replaced where there is a text for it.
pub fn replaced<'a>(pieces: &[Source<'a>], texts: &'a [ShaderText]) -> Vec<Source<'a>> {
    let own = |piece: &Source<'_>| texts.iter().find(|text| text.replaces == piece.name);
    let chosen = pieces
        .iter()
        .map(|piece| own(piece).map_or(*piece, |text| Source { name: &text.name, text: &text.text }));
    chosen.collect()
}
