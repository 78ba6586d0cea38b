//! Bodies and markers under other names: the profile's in place of the tracker's.

use std::collections::{BTreeMap, BTreeSet};

use crate::error::{At, Error, Problem};
use crate::model::{Meta, Recording};

/// That `name` is what the tracker calls `from`, as a comment of a table says it. Who reads the table again does not rename it once more.
#[must_use]
pub fn renamed_comment(name: &str, from: &str) -> String {
    format!("{name} is the tracker's {from}")
}

impl Meta {
    /// Whether a body or marker was renamed so: when the file was read, or before, as the file says of itself.
    #[must_use]
    pub fn renamed(&self, name: &str, from: &str) -> bool {
        self.conversions.contains(&note(name, from))
            || self.comments.contains(&renamed_comment(name, from))
    }

    /// The comments of the file that say what was renamed before.
    pub fn renamed_comments(&self) -> impl Iterator<Item = String> {
        let middle = renamed_comment("", "");
        let comments = self.comments.iter().cloned();
        comments.filter(move |said| said.contains(&middle))
    }
}

fn note(name: &str, from: &str) -> String {
    format!("`{name}` is the tracker's `{from}`")
}

impl Recording {
    /// Calls bodies and markers by other names, all at once, so that two of them can be exchanged: new name → name in the recording. A
    /// name that the recording does not have stays as it is, and so does one where the file says that it was renamed so before; what was renamed
    /// is among the conversions.
    ///
    /// # Errors
    /// [`Problem::NameTaken`] where the new name belongs to something else that keeps it.
    pub fn rename(&mut self, names: &BTreeMap<String, String>) -> Result<(), Error> {
        let there = self.tracked();
        let asked = names.iter();
        let asked = asked.filter(|(new, old)| new != old && there.contains(*old));
        let said = |new: &str, old: &str| self.meta.comments.contains(&renamed_comment(new, old));
        let asked = asked.filter(|(new, old)| !said(new, old));
        let new: BTreeMap<String, String> =
            asked.map(|(new, old)| (old.clone(), new.clone())).collect();
        let taken = |name: &String| there.contains(name) && !new.contains_key(name);
        if let Some((from, name)) = new.iter().find(|(_, name)| taken(name)) {
            return Err(self.problem(Problem::NameTaken {
                name: name.clone(),
                from: from.clone(),
            }));
        }
        let inverse = std::mem::take(&mut self.meta.inverse_bodies).into_iter();
        let inverse = inverse.map(|name| new.get(&name).cloned().unwrap_or(name));
        self.meta.inverse_bodies = inverse.collect();
        let bodies = self.bodies.iter_mut().map(|b| &mut b.name);
        let markers = self.markers.iter_mut().map(|m| &mut m.name);
        for name in bodies.chain(markers) {
            if let Some(new) = new.get(name) {
                let note = note(new, name);
                if !self.meta.conversions.contains(&note) {
                    self.meta.conversions.push(note);
                }
                name.clone_from(new);
            }
        }
        Ok(())
    }

    /// [`Self::rename`] where every name must be there, whatever the file says of it.
    ///
    /// # Errors
    /// [`Problem::NoSuchName`], and as [`Self::rename`].
    pub fn rename_all(&mut self, names: &BTreeMap<String, String>) -> Result<(), Error> {
        let there = self.tracked();
        if let Some(from) = names.values().find(|from| !there.contains(*from)) {
            let nearest = calib_finding::nearest_word(from, there.iter().map(String::as_str));
            return Err(self.problem(Problem::NoSuchName {
                name: from.clone(),
                nearest: nearest.map(str::to_owned),
                known: there.iter().cloned().collect(),
            }));
        }
        let asked = |said: &String| {
            let mut pairs = names.iter();
            pairs.any(|(name, from)| *said == renamed_comment(name, from))
        };
        self.meta.comments.retain(|said| !asked(said));
        self.rename(names)
    }

    /// The names of its bodies and markers.
    fn tracked(&self) -> BTreeSet<String> {
        let bodies = self.bodies.iter().map(|b| &b.name);
        let markers = self.markers.iter().map(|m| &m.name);
        bodies.chain(markers).cloned().collect()
    }

    fn problem(&self, problem: Problem) -> Error {
        Error {
            file: self.meta.source.clone(),
            at: At::File,
            problem: Box::new(problem),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::renamed_comment;
    use crate::{Problem, ReadOptions, Recording, read_bytes};
    use std::collections::BTreeMap;

    const TABLE: &str = "t_s,M.x_m,M.y_m,M.z_m,N.x_m,N.y_m,N.z_m\n0,1,2,3,4,5,6\n";

    fn read(comments: &[String]) -> Recording {
        let above: String = comments.iter().map(|c| format!("# {c}\n")).collect();
        let text = above + TABLE;
        read_bytes("log.csv", text.as_bytes(), &ReadOptions::default()).expect("a table")
    }

    fn map(names: &[(&str, &str)]) -> BTreeMap<String, String> {
        let owned = |(a, b): &(&str, &str)| ((*a).to_owned(), (*b).to_owned());
        names.iter().map(owned).collect()
    }

    fn names(recording: &Recording) -> Vec<&str> {
        recording.markers.iter().map(|m| m.name.as_str()).collect()
    }

    #[test]
    fn two_names_are_exchanged_and_only_once() {
        let exchange = map(&[("M", "N"), ("N", "M")]);
        let mut recording = read(&[]);
        let before = recording.markers[0].samples.clone();
        recording.rename(&exchange).expect("exchanged");
        assert_eq!(names(&recording), ["N", "M"]);
        assert_eq!(recording.markers[0].samples, before);
        assert!(recording.meta.renamed("M", "N") && !recording.meta.renamed("M", "Q"));
        // A table that was written with the new names.
        let said: Vec<String> = (exchange.iter())
            .map(|(name, from)| renamed_comment(name, from))
            .collect();
        let mut again = read(&said);
        again.rename(&exchange).expect("exchanged before");
        assert_eq!(names(&again), ["M", "N"]);
        assert!(again.meta.renamed("M", "N"));
        again.rename_all(&exchange).expect("asked for");
        assert_eq!(names(&again), ["N", "M"]);
        // Another name than the one that the file has it from.
        let mut once = read(&[renamed_comment("M", "Q")]);
        once.rename(&map(&[("A", "M")])).expect("not renamed so");
        assert_eq!(names(&once), ["A", "N"]);
    }

    #[test]
    fn a_name_that_something_else_keeps_is_refused() {
        let mut recording = read(&[]);
        let problem = recording.rename(&map(&[("M", "N")])).expect_err("taken");
        assert!(matches!(*problem.problem, Problem::NameTaken { .. }));
        recording
            .rename(&map(&[("M", "M"), ("A", "zz")]))
            .expect("nothing to do");
        assert_eq!(names(&recording), ["M", "N"]);
        let problem = recording
            .rename_all(&map(&[("A", "zz")]))
            .expect_err("unknown");
        assert!(matches!(*problem.problem, Problem::NoSuchName { .. }));
        recording
            .rename(&map(&[("M", "N"), ("A", "M")]))
            .expect("a chain");
        assert_eq!(names(&recording), ["A", "M"]);
    }
}
