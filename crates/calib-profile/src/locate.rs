//! Where in the YAML text a key or value stands.

use std::fmt;

use calib_finding::printable_line;
use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use serde_saphyr::Spanned;

/// A 1-based place in the text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1.
    pub column: usize,
}

/// The places of every key and value of a YAML document.
pub struct Places(Option<Tree>);

impl Places {
    /// Reads the structure; a text that is not YAML has no places.
    #[must_use]
    pub fn of(text: &str) -> Self {
        // Otherwise one `.nan` would make the whole text unreadable, and no problem would have a place.
        let options = serde_saphyr::options! {
            non_finite_float_policy: serde_saphyr::options::NonFiniteFloatPolicy::PassThrough,
        };
        Self(serde_saphyr::from_str_with_options::<Tree>(text, options).ok())
    }

    /// Place of the value at `path` (keys, or list positions as decimal numbers); the nearest enclosing one
    /// when the path ends early.
    #[must_use]
    pub fn value(&self, path: &[&str]) -> Option<Place> {
        let mut tree = self.0.as_ref()?;
        for step in path {
            match tree.child(step) {
                Some(child) => tree = child,
                None => break,
            }
        }
        Some(tree.place)
    }

    /// Place of the last key of `path`.
    #[must_use]
    pub fn key(&self, path: &[&str]) -> Option<Place> {
        let (last, parents) = path.split_last()?;
        let mut tree = self.0.as_ref()?;
        for step in parents {
            tree = tree.child(step)?;
        }
        match &tree.kind {
            Kind::Map(entries) => entries
                .iter()
                .find(|e| e.0.value == **last)
                .map(|e| place_of(&e.0)),
            _ => None,
        }
    }
}

impl Places {
    /// Keys (and list positions as decimal numbers) that lead to the value at a place; empty for the document itself.
    #[must_use]
    pub fn path_to(&self, place: Place) -> Option<Vec<String>> {
        let mut path = Vec::new();
        let found = self.0.as_ref()?.find(place, &mut path);
        found.then_some(path)
    }

    /// Places of numbers that are NaN or infinite.
    #[must_use]
    pub fn not_finite(&self) -> Vec<Place> {
        let mut found = Vec::new();
        if let Some(tree) = &self.0 {
            tree.collect_not_finite(&mut found);
        }
        found
    }

    /// Keys and texts with characters that a reader would not see: control characters, line breaks in names, and marks that turn the direction of a
    /// text around.
    #[must_use]
    pub fn hidden(&self) -> Vec<(Place, char)> {
        let mut found = Vec::new();
        let Some(Kind::Map(entries)) = self.0.as_ref().map(|tree| &tree.kind) else {
            return found;
        };
        for (key, tree) in entries {
            // What is no name may have lines.
            let lines = matches!(key.value.as_str(), "identification" | "plugins");
            found.extend(hidden_in(&key.value, false).map(|c| (place_of(key), c)));
            tree.collect_hidden(lines, &mut found);
        }
        found
    }
}

/// The first character of a text that would not be seen; `lines`: line breaks and tabs may be in it.
fn hidden_in(text: &str, lines: bool) -> Option<char> {
    let shown = |c: &char| printable_line(c.encode_utf8(&mut [0; 4])) == c.to_string();
    let mut letters = text.chars();
    letters.find(|c| !(shown(c) || lines && matches!(c, '\n' | '\r' | '\t')))
}

struct Tree {
    place: Place,
    kind: Kind,
}

enum Kind {
    Leaf,
    NotFinite,
    Text(String),
    List(Vec<Tree>),
    Map(Vec<(Spanned<String>, Tree)>),
}

impl Tree {
    fn collect_not_finite(&self, found: &mut Vec<Place>) {
        match &self.kind {
            Kind::Leaf | Kind::Text(_) => {}
            Kind::NotFinite => found.push(self.place),
            Kind::List(items) => items.iter().for_each(|t| t.collect_not_finite(found)),
            Kind::Map(entries) => entries
                .iter()
                .for_each(|(_, t)| t.collect_not_finite(found)),
        }
    }

    fn collect_hidden(&self, lines: bool, found: &mut Vec<(Place, char)>) {
        match &self.kind {
            Kind::Leaf | Kind::NotFinite => {}
            Kind::Text(text) => found.extend(hidden_in(text, lines).map(|c| (self.place, c))),
            Kind::List(items) => items.iter().for_each(|t| t.collect_hidden(lines, found)),
            Kind::Map(entries) => {
                for (key, tree) in entries {
                    found.extend(hidden_in(&key.value, false).map(|c| (place_of(key), c)));
                    tree.collect_hidden(lines, found);
                }
            }
        }
    }

    /// Whether a value stands at `place`; `path` then leads to it from here.
    fn find(&self, place: Place, path: &mut Vec<String>) -> bool {
        if self.place == place && !matches!(self.kind, Kind::Map(_)) {
            return true;
        }
        let mut under = |key: String, tree: &Self| {
            path.push(key);
            let found = tree.find(place, path);
            if !found {
                path.pop();
            }
            found
        };
        match &self.kind {
            Kind::Leaf | Kind::NotFinite | Kind::Text(_) => false,
            Kind::List(items) => {
                let mut items = items.iter().enumerate();
                items.any(|(i, tree)| under(i.to_string(), tree))
            }
            Kind::Map(entries) => {
                let mut entries = entries.iter();
                // A block mapping begins where its first key does, not where a value does.
                entries.any(|(key, tree)| under(key.value.clone(), tree)) || self.place == place
            }
        }
    }

    fn child(&self, step: &str) -> Option<&Self> {
        match &self.kind {
            Kind::Leaf | Kind::NotFinite | Kind::Text(_) => None,
            Kind::List(items) => items.get(step.parse::<usize>().ok()?),
            Kind::Map(entries) => entries.iter().find(|e| e.0.value == step).map(|e| &e.1),
        }
    }
}

fn place_of<T>(spanned: &Spanned<T>) -> Place {
    let at = &spanned.referenced;
    Place {
        line: at.line() as usize,
        column: at.column() as usize,
    }
}

impl<'de> Deserialize<'de> for Tree {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let spanned = Spanned::<Kind>::deserialize(deserializer)?;
        Ok(Self {
            place: place_of(&spanned),
            kind: spanned.value,
        })
    }
}

impl<'de> Deserialize<'de> for Kind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(KindVisitor)
    }
}

struct KindVisitor;

impl<'de> Visitor<'de> for KindVisitor {
    type Value = Kind;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("any YAML value")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Kind, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(Kind::Map(entries))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Kind, A::Error> {
        let mut items = Vec::new();
        while let Some(item) = seq.next_element()? {
            items.push(item);
        }
        Ok(Kind::List(items))
    }

    fn visit_bool<E>(self, _: bool) -> Result<Kind, E> {
        Ok(Kind::Leaf)
    }

    fn visit_i64<E>(self, _: i64) -> Result<Kind, E> {
        Ok(Kind::Leaf)
    }

    fn visit_u64<E>(self, _: u64) -> Result<Kind, E> {
        Ok(Kind::Leaf)
    }

    fn visit_f64<E>(self, value: f64) -> Result<Kind, E> {
        Ok(if value.is_finite() {
            Kind::Leaf
        } else {
            Kind::NotFinite
        })
    }

    fn visit_str<E>(self, text: &str) -> Result<Kind, E> {
        Ok(Kind::Text(text.to_owned()))
    }

    fn visit_unit<E>(self) -> Result<Kind, E> {
        Ok(Kind::Leaf)
    }

    fn visit_none<E>(self) -> Result<Kind, E> {
        Ok(Kind::Leaf)
    }
}
