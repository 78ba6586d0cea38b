//! A profile's text with what a proposal adds to it. Everything that stands in it stays, byte for byte.

use calib_profile::edit::{Entry, Value, with_comments, with_entry, with_value};
use calib_profile::raw::{RawProfile, RawRecording, RawSimMount};
use calib_urdf::RobotModel;

use crate::entry;
use crate::error::InitError;
use crate::fact::{About, Fact, Place};
use crate::known::Known;
use crate::proposal::{Body, Proposal, Recording};
use crate::write;
use crate::yaml;

/// A profile's new text, and what is new in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Edited {
    /// The text.
    pub text: String,
    /// Bodies that were added.
    pub bodies: Vec<String>,
    /// Recordings that were added.
    pub recordings: Vec<String>,
    /// Recordings whose entries were completed: they could not be read, or had no file.
    pub completed: Vec<String>,
    /// What was invented.
    pub facts: Vec<Fact>,
}

impl Edited {
    /// Nothing was added.
    #[must_use]
    pub fn is_same(&self) -> bool {
        self.bodies.is_empty() && self.recordings.is_empty() && self.completed.is_empty()
    }
}

/// The edited profile with what the proposal found.
///
/// # Errors
/// [`InitError::NotInserted`] where the text has no place for an entry, with the lines to add; [`InitError::Profile`] where the whole is no valid profile.
pub fn edited(model: &RobotModel, proposal: &Proposal, known: &Known) -> Result<Edited, InitError> {
    let mut edit = Edit {
        model,
        proposal,
        known,
        raw: known.raw.clone(),
        done: Edited {
            text: known.text.clone(),
            bodies: Vec::new(),
            recordings: Vec::new(),
            completed: Vec::new(),
            facts: Vec::new(),
        },
        said: false,
    };
    if proposal.recordings.is_empty() {
        return Ok(edit.done);
    }
    let made = calib_profile::parse(&write::profile(model, proposal), &known.shown)?;
    edit.bodies(&made)?;
    for recording in &proposal.recordings {
        let Some(of_proposal) = made.recordings.get(&recording.name) else {
            continue;
        };
        match known.raw.recordings.get(&recording.name) {
            None => edit.add(recording, of_proposal)?,
            Some(_) => edit.complete(recording, of_proposal)?,
        }
    }
    calib_profile::check(&edit.raw, &edit.done.text, &known.shown, model)?;
    Ok(edit.done)
}

struct Edit<'a> {
    model: &'a RobotModel,
    proposal: &'a Proposal,
    known: &'a Known,
    /// What the text must say.
    raw: RawProfile,
    done: Edited,
    /// What is about all recordings stands in the text.
    said: bool,
}

impl Edit<'_> {
    fn bodies(&mut self, made: &RawProfile) -> Result<(), InitError> {
        for body in &self.proposal.bodies {
            let Some(new) = made.bodies.get(&body.name) else {
                continue;
            };
            if self.known.raw.bodies.contains_key(&body.name) {
                continue;
            }
            self.raw.bodies.insert(body.name.clone(), new.clone());
            let value = entry::body(self.model, body);
            let place = Place::Body(body.name.clone());
            let comments = self.comments("  ", &place);
            self.insert(&["bodies"], &body.name, value, comments)?;
            self.done.bodies.push(body.name.clone());
            self.mount(body)?;
        }
        Ok(())
    }

    /// A simulation has a mount for every body.
    fn mount(&mut self, body: &Body) -> Result<(), InitError> {
        let Some(simulate) = &mut self.raw.simulate else {
            return Ok(());
        };
        let fixed = |at: [i32; 3]| at.map(f64::from);
        let markers = body.markers.iter().enumerate();
        let markers = markers.map(|(k, name)| (name.clone(), fixed(entry::marker_mm(k))));
        let mount = RawSimMount {
            xyz_mm: fixed(entry::MOUNT_MM),
            rpy_deg: [0.0; 3],
            markers_mm: markers.collect(),
        };
        simulate.mounts.insert(body.name.clone(), mount);
        let fact = Fact::new(Place::Body(body.name.clone()), About::InventedMount);
        let comments = entry::comments(std::slice::from_ref(&fact), "    ", &fact.place);
        let path = ["simulate", "mounts"];
        self.insert(&path, &body.name, entry::mount(body), comments)?;
        self.done.facts.push(fact);
        Ok(())
    }

    fn add(&mut self, recording: &Recording, new: &RawRecording) -> Result<(), InitError> {
        let name = &recording.name;
        self.raw.recordings.insert(name.clone(), new.clone());
        let value = Value::Map {
            anchor: None,
            entries: self.entries(recording),
        };
        let comments = self.comments("  ", &Place::Recording(name.clone()));
        self.insert(&["recordings"], name, value, comments)?;
        self.done.recordings.push(name.clone());
        Ok(())
    }

    /// What a recording of the profile lacks to be read. An entry whose file the readers' own rules read lacks nothing.
    fn complete(&mut self, recording: &Recording, new: &RawRecording) -> Result<(), InitError> {
        let name = &recording.name;
        let path = ["recordings", name.as_str()];
        let mut changed = false;
        if self.known.waits(name) {
            if let Some(known) = self.raw.recordings.get_mut(name) {
                known.file.clone_from(&new.file);
            }
            let file = yaml::text(&new.file);
            let of_file = [path[0], path[1], "file"];
            let old = &self.known.raw.recordings[name].file;
            let text = with_value(&self.done.text, &of_file, old, &file, &self.raw);
            let text = text.and_then(|text| {
                // What stood there stays as a comment.
                let place = Place::Recording(name.clone());
                let is_replaced = |f: &&Fact| matches!(f.about, About::Replaced { .. });
                let facts = self.proposal.facts.iter().filter(is_replaced);
                let facts: Vec<Fact> = facts.cloned().collect();
                with_comments(&text, &path, &entry::comments(&facts, "  ", &place))
            });
            self.done.text =
                text.ok_or_else(|| self.no_place(&path, &[format!("file: {file}")]))?;
            changed = true;
        }
        let read = new.columns.is_none() && new.robot_log.is_none() && new.hold.is_empty();
        if !read {
            let mut comments = self.comments("    ", &Place::Recording(name.clone()));
            for (key, value) in self.entries(recording) {
                if let Some(known) = self.raw.recordings.get_mut(name) {
                    match key.as_str() {
                        "columns" => known.columns.clone_from(&new.columns),
                        "robot_log" => known.robot_log.clone_from(&new.robot_log),
                        "hold" => known.hold.clone_from(&new.hold),
                        "timing" => known.timing.clone_from(&new.timing),
                        _ => continue,
                    }
                }
                self.insert(&path, &key, value, std::mem::take(&mut comments))?;
                changed = true;
            }
        }
        if changed {
            self.done.completed.push(name.clone());
        }
        Ok(())
    }

    fn entries(&self, recording: &Recording) -> Vec<(String, Value)> {
        entry::recording(self.model, recording, |map| Value::Map {
            anchor: None,
            entries: yaml::columns(map),
        })
    }

    /// The facts about a part as comments; before the first recording those about all of them that a person must look at.
    fn comments(&mut self, indent: &str, place: &Place) -> Vec<String> {
        let is_recording = matches!(place, Place::Recording(_));
        let first = is_recording && !std::mem::replace(&mut self.said, true);
        let of_all = |fact: &&Fact| {
            let is_of_call = matches!(fact.about, About::NoNewBody { .. });
            let of_all = matches!(fact.place, Place::Recordings | Place::Tracker);
            first && fact.check && of_all && !is_of_call
        };
        let facts = self.proposal.facts.iter();
        let mut facts: Vec<Fact> = facts.filter(of_all).cloned().collect();
        facts.iter_mut().for_each(|fact| fact.place = place.clone());
        let others = self.proposal.facts.iter();
        let others = others.filter(|f| !matches!(f.about, About::Replaced { .. }));
        facts.extend(others.cloned());
        entry::comments(&facts, indent, place)
    }

    fn insert(
        &mut self,
        path: &[&str],
        name: &str,
        value: Value,
        comments: Vec<String>,
    ) -> Result<(), InitError> {
        let entry = Entry {
            comments,
            key: yaml::text(name),
            value,
        };
        let text = with_entry(&self.done.text, path, &entry, &self.raw);
        self.done.text = text.ok_or_else(|| self.no_place(path, &entry.lines("  ")))?;
        Ok(())
    }

    fn no_place(&self, path: &[&str], lines: &[String]) -> InitError {
        InitError::NotInserted {
            file: self.known.shown.clone(),
            section: path.join("."),
            lines: lines.to_vec(),
        }
    }
}
