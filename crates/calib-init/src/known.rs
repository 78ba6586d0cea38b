//! A profile that is edited: what it says stands, and what it does not say is found.

use std::collections::{BTreeMap, BTreeSet};

use calib_profile::ProfileError;
use calib_profile::raw::{RawProfile, RawUse};
use calib_recording::Poses;
use calib_urdf::{JointId, LinkId, RobotModel};

use crate::bodies::Found;
use crate::fact::{About, Fact, Place};
use crate::proposal::{Body, Proposal};
use crate::session::{self, Draft, Others, Use};
use crate::source::{File, Source};

/// A profile that is edited.
#[derive(Debug, Clone)]
pub struct Known {
    /// The file, as messages name it.
    pub shown: String,
    /// Its text.
    pub text: String,
    /// What the text says.
    pub raw: RawProfile,
    /// Its bodies on their links.
    pub bodies: Vec<Body>,
    /// Files of its recordings as proposals name files, by recording: the tracker's, then the robot's log.
    files: BTreeMap<String, Vec<String>>,
    /// Recordings whose tracker's file does not exist.
    absent: BTreeSet<String>,
    /// Joints that its recordings hold, all at the same position, rad or m.
    held: BTreeMap<JointId, f64>,
}

impl Known {
    /// A profile of this robot. `path`: a file that the profile names, as [`File::path`] names it, and whether it exists.
    ///
    /// # Errors
    /// [`ProfileError`] where the text is no valid profile; one without recordings is what a first edit may begin with.
    pub fn of(
        model: &RobotModel,
        shown: &str,
        text: &str,
        path: impl Fn(&str) -> (String, bool),
    ) -> Result<Self, ProfileError> {
        let raw = calib_profile::parse(text, shown)?;
        let mut held = BTreeMap::new();
        if !raw.recordings.is_empty() {
            let profile = calib_profile::check(&raw, text, shown, model)?;
            let all = profile.recordings.values().flat_map(|r| &r.hold);
            let all: Vec<(JointId, f64)> = all.map(|(joint, at)| (*joint, *at)).collect();
            let is_only = |(joint, at): &&(JointId, f64)| {
                all.iter()
                    .all(|(other, value)| other != joint || value == at)
            };
            held.extend(all.iter().filter(is_only).copied());
        }
        let on = |(name, body): (&String, &calib_profile::raw::RawBody)| {
            Some(Body {
                name: name.clone(),
                markers: body.markers.clone(),
                link: model.link_id(&body.link).ok()?,
            })
        };
        let bodies = raw.bodies.iter().filter_map(on).collect();
        let (mut files, mut absent) = (BTreeMap::new(), BTreeSet::new());
        for (name, recording) in &raw.recordings {
            let (file, exists) = path(&recording.file);
            if !exists {
                absent.insert(name.clone());
            }
            let log = recording.robot_log.iter().map(|log| path(&log.file).0);
            files.insert(name.clone(), std::iter::once(file).chain(log).collect());
        }
        Ok(Self {
            shown: shown.to_owned(),
            text: text.to_owned(),
            raw,
            bodies,
            files,
            absent,
            held,
        })
    }

    /// The recording that has a file already.
    fn listed(&self, path: &str) -> Option<&str> {
        let has = |(_, files): &(&String, &Vec<String>)| files.iter().any(|file| file == path);
        self.files.iter().find(has).map(|(name, _)| name.as_str())
    }

    /// The recording of that name, where it has no file yet and does not say how to read one.
    #[must_use]
    pub fn waits(&self, name: &str) -> bool {
        self.absent.contains(name) && self.is_bare(name)
    }

    /// The recordings whose files do not exist, and those files.
    pub fn absent(&self) -> impl Iterator<Item = (&str, &str)> {
        let file = |name: &String| self.raw.recordings.get(name).map(|r| r.file.as_str());
        let of = move |name| Some((String::as_str(name), file(name)?));
        self.absent.iter().filter_map(of)
    }

    /// A recording says nothing of how to read its file: the readers' own rules hold.
    fn is_bare(&self, name: &str) -> bool {
        self.raw.recordings.get(name).is_some_and(|recording| {
            recording.columns.is_none()
                && recording.reader.is_none()
                && recording.robot_log.is_none()
                && recording.timing.is_none()
                && recording.hold.is_empty()
        })
    }

    /// Its recordings.
    #[must_use]
    pub fn others(&self) -> Others {
        let all = self.raw.recordings.iter();
        let there = all.filter(|(name, _)| !self.absent.contains(*name));
        let is_held_out = |usage: RawUse| matches!(usage, RawUse::Validation);
        let uses: Vec<bool> = there.map(|(_, r)| is_held_out(r.usage)).collect();
        let files = self.files.iter();
        let by_file = files.flat_map(|(name, of)| of.iter().map(|f| (f.clone(), name.clone())));
        let names = self.raw.recordings.keys();
        Others {
            names: names.clone().cloned().collect(),
            by_file: by_file.collect(),
            waiting: names.filter(|name| self.waits(name)).cloned().collect(),
            fitted: uses.contains(&false),
            held_out: uses.contains(&true),
        }
    }

    /// Names of its bodies.
    #[must_use]
    pub fn names_of_bodies(&self) -> BTreeSet<String> {
        self.bodies.iter().map(|body| body.name.clone()).collect()
    }

    /// Joints that its recordings hold, all at the same position, rad or m.
    #[must_use]
    pub fn held(&self) -> &BTreeMap<JointId, f64> {
        &self.held
    }

    /// Files that are to be read, and the recordings that need none: their entries say how to read their files, or these are read without.
    #[must_use]
    pub fn to_read(&self, model: &RobotModel, files: &[File]) -> (Vec<File>, Vec<Fact>) {
        let is_of_contact = |name: &str| {
            let mut contacts = self.raw.contacts.values();
            contacts.any(|contact| contact.recordings.iter().any(|r| r == name))
        };
        let settled = |file: &File| {
            let name = self.listed(&file.path)?;
            let label = self.raw.recordings.get(name)?.group.as_ref();
            let is_open = self.is_bare(name) && !is_of_contact(name);
            (!is_open || Source::reads(model, file, label)).then_some(name)
        };
        let names: BTreeSet<&str> = files.iter().filter_map(settled).collect();
        let of = |name: &str| Fact::new(Place::Recording(name.to_owned()), About::Listed);
        let facts = names.into_iter().map(of).collect();
        let open = files.iter().filter(|file| settled(file).is_none());
        (open.cloned().collect(), facts)
    }

    /// The profile has a body of that name.
    #[must_use]
    pub fn has_body(&self, name: &str) -> bool {
        self.bodies.iter().any(|body| body.name == name)
    }

    /// Markers of all bodies, with the body.
    fn markers(&self) -> BTreeMap<&String, &Body> {
        let of = |body| move |marker| (marker, body);
        let bodies = self.bodies.iter();
        bodies
            .flat_map(|body: &Body| body.markers.iter().map(of(body)))
            .collect()
    }

    /// Puts the profile's bodies in the place of those that were found of their markers, and says what differs. The bodies of the profile come first,
    /// each with its link.
    pub fn merge(
        &self,
        sources: &[Source],
        found: &mut Vec<Found>,
        facts: &mut Vec<Fact>,
    ) -> Vec<(usize, LinkId)> {
        let recordings = || sources.iter().map(|source| &source.recording);
        let markers: BTreeSet<&String> = recordings()
            .flat_map(|r| &r.markers)
            .filter(|m| !m.unlabeled)
            .map(|m| &m.name)
            .collect();
        let poses: BTreeSet<&String> = recordings()
            .flat_map(|r| &r.bodies)
            .map(|b| &b.name)
            .collect();
        let own = |body: &Body| -> Option<Found> {
            let seen: Vec<String> = body
                .markers
                .iter()
                .filter(|m| markers.contains(m))
                .cloned()
                .collect();
            let is_seen = match body.markers.is_empty() {
                true => poses.contains(&body.name),
                false => !seen.is_empty(),
            };
            is_seen.then(|| Found {
                name: body.name.clone(),
                markers: seen,
            })
        };
        let of_profile: Vec<Option<Found>> = self.bodies.iter().map(own).collect();
        let none_is = of_profile.iter().all(Option::is_none);
        let all = self.markers();
        facts.retain_mut(|fact| match &mut fact.about {
            About::Duplicate { marker, .. } => !all.contains_key(marker),
            About::Seldom { markers } => {
                markers.retain(|marker| !all.contains_key(marker));
                !markers.is_empty()
            }
            _ => true,
        });
        let mut merged = Vec::new();
        let mut links = Vec::new();
        for (body, seen) in self.bodies.iter().zip(of_profile) {
            let Some(seen) = seen else {
                let about = About::NotSeen {
                    markers: body.markers.clone(),
                    none_is,
                };
                facts.push(Fact::new(Place::Body(body.name.clone()), about));
                continue;
            };
            links.push((merged.len(), body.link));
            merged.push(seen);
        }
        for body in found.drain(..) {
            let owner = body.markers.iter().find_map(|marker| all.get(marker));
            let posed = body.markers.is_empty() && self.has_body(&body.name);
            if owner.is_none() && !posed {
                merged.push(body);
                continue;
            }
            // Only a tracked pose can be called like a body of the profile.
            let is_found = |fact: &Fact| match fact.about {
                About::NotSeen { .. } => false,
                _ => fact.place == Place::Body(body.name.clone()),
            };
            let left_out = facts.iter().filter(|fact| is_found(fact));
            let left_out = left_out.flat_map(|fact| match &fact.about {
                About::Flat { left_out } => left_out.clone(),
                _ => Vec::new(),
            });
            let left_out: Vec<String> = left_out.collect();
            facts.retain(|fact| !is_found(fact));
            let Some(owner) = owner else { continue };
            let more: Vec<String> = body
                .markers
                .iter()
                .chain(&left_out)
                .filter(|m| !all.contains_key(m))
                .cloned()
                .collect();
            if !more.is_empty() {
                let about = About::MoreMarkers { markers: more };
                facts.push(Fact::new(Place::Body(owner.name.clone()), about));
            }
        }
        *found = merged;
        links
    }

    /// Recordings without a file, and those whose files take the place of one that does not exist.
    #[must_use]
    pub fn of_files(&self, proposal: &Proposal) -> Vec<Fact> {
        let of = |(name, file): (&str, &str)| {
            let file = file.to_owned();
            let about = match proposal.recordings.iter().any(|r| r.name == name) {
                true => About::Replaced { file },
                false => About::Absent { file },
            };
            Fact::new(Place::Recording(name.to_owned()), about)
        };
        self.absent().map(of).collect()
    }

    /// What recordings are used for: of those of the profile only what contradicts it.
    #[must_use]
    pub fn of_uses(
        &self,
        model: &RobotModel,
        (drafts, tables): (&[Draft], &[Poses]),
        mut facts: Vec<Fact>,
    ) -> Vec<Fact> {
        facts.retain(|fact| match &fact.place {
            Place::Recording(name) => !self.raw.recordings.contains_key(name),
            _ => true,
        });
        for (draft, poses) in drafts.iter().zip(tables) {
            let Some(stated) = self.raw.recordings.get(&draft.name) else {
                continue;
            };
            let is_sweep = matches!(draft.usage, Use::Sweep(_));
            if stated.usage == RawUse::Sweep && !is_sweep {
                let about = About::OtherUse {
                    moved: session::moved(model, poses).len(),
                    rows: poses.len(),
                };
                facts.push(Fact::new(Place::Recording(draft.name.clone()), about));
            }
        }
        facts
    }

    /// What the recordings show of the tracker's noise, beside what the profile states.
    #[must_use]
    pub fn of_noise(&self, facts: Vec<Fact>) -> Vec<Fact> {
        let tracker = &self.raw.tracker;
        let beside = |fact: Fact| match (&fact.about, tracker.marker_sigma_mm) {
            (About::MarkerSigma { sigma, .. }, Some(stated)) => {
                let about = About::StatedSigma {
                    stated: stated * 1e-3,
                    shown: *sigma,
                };
                Some(Fact::new(fact.place, about))
            }
            (About::SigmaUnknown | About::Calculated, _) => None,
            (
                About::BodySigma {
                    position,
                    orientation,
                },
                _,
            ) => {
                let shown = (*position, *orientation);
                let about = match (tracker.body_sigma_mm, tracker.body_sigma_deg) {
                    (Some(mm), Some(deg)) => About::StatedBodySigma {
                        stated: (mm * 1e-3, deg.to_radians()),
                        shown,
                    },
                    _ => fact.about,
                };
                Some(Fact::new(fact.place, about))
            }
            _ => Some(fact),
        };
        facts.into_iter().filter_map(beside).collect()
    }
}
