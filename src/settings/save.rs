//! Changes in the text of a file of settings that keeps its comments, its order and its blanks.

use toml::Value;
use toml_edit::{DocumentMut, Item, Table};

use super::layers::{self, Leaf, Place, Problem};

/// The text with these settings changed: those it names get the new value in their place, the others are added to their
/// section.
///
/// # Errors
/// A change that no setting allows, or a text that is wrong already: it is then better left as it is.
pub fn edit(file: &str, text: &str, changes: &[(&str, Value)]) -> Result<String, Problem> {
    let leaves: Vec<Leaf> = changes
        .iter()
        .map(|(path, value)| layers::leaf(path, value.clone(), Place::Change))
        .collect::<Result<_, _>>()?;
    layers::leaves(file, text)?;
    let odd = |problem: String| Problem {
        place: Place::File { file: file.to_owned(), line: 1, column: 1 },
        problem,
        remedy: "change it by hand".to_owned(),
    };
    let mut document: DocumentMut =
        text.parse().map_err(|error: toml_edit::TomlError| odd(error.message().to_owned()))?;
    let mut added = DocumentMut::new();
    for leaf in &leaves {
        let to = if has_place(&document, &leaf.path) { &mut document } else { &mut added };
        put(to.as_item_mut(), &leaf.path, &leaf.value)
            .ok_or_else(|| odd(format!("`{}` cannot be put into it", leaf.path)))?;
    }
    let edited = joined(document.to_string(), &added.to_string());
    layers::leaves(file, &edited)?;
    Ok(edited)
}

/// The setting's section is there, or within something that cannot go on further down.
fn has_place(document: &DocumentMut, path: &str) -> bool {
    let Some((sections, _)) = path.rsplit_once('.') else { return true };
    let mut item = document.as_item();
    for section in sections.split('.') {
        match item.get(section) {
            Some(inner) => item = inner,
            None => return item.as_table().is_none_or(Table::is_dotted),
        }
    }
    true
}

/// One text after the other, a blank line between: after all comments, those at the end, too.
fn joined(mut text: String, added: &str) -> String {
    if added.is_empty() {
        return text;
    }
    if !text.is_empty() {
        text.push_str(if text.ends_with('\n') { "\n" } else { "\n\n" });
    }
    text + added
}

fn put(document: &mut Item, path: &str, value: &Value) -> Option<()> {
    let (sections, name) = path.rsplit_once('.')?;
    let mut item = document;
    for section in sections.split('.') {
        let table = item.as_table_like_mut()?;
        if !table.contains_key(section) {
            let mut new = Table::new();
            // `[gamepad.axes]` needs no `[gamepad]` before it.
            new.set_implicit(true);
            table.insert(section, Item::Table(new));
        }
        item = table.get_mut(section)?;
    }
    let table = item.as_table_like_mut()?;
    let mut new = plain(value)?;
    match table.get_mut(name) {
        Some(Item::Value(old)) => {
            // What stands before and after it, such as a comment, stays.
            *new.decor_mut() = old.decor().clone();
            *old = new;
        }
        _ => {
            table.insert(name, Item::Value(new));
        }
    }
    Some(())
}

/// The same value in the editor's type.
fn plain(value: &Value) -> Option<toml_edit::Value> {
    value.to_string().parse().ok()
}
