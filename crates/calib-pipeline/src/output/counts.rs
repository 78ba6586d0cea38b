//! What became of every measurement: each is used, rejected, excluded or lost, and nothing is counted twice.

use std::collections::{BTreeMap, BTreeSet};

use calib_estimator::chance::hypergeometric_tail;
use calib_profile::{BodyKind, ByRow, Contact, Usage};
use calib_report::{HeldOut, Part, RejectedFor, RejectedPart, Share, Unit};
use calib_urdf::JointId;

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;
use crate::verify::deviations::is_moved;
use crate::verify::residuals::left_out;

/// What became of one measurement, or of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Fate {
    /// It took part in the fit, or in the verification where its recording is held out.
    Used,
    /// The fit rejected it, or the verification screened it.
    Rejected,
    /// It was excluded before the fit.
    Excluded,
    /// It was excluded because the row has the joint readings of another one.
    WithoutReadings,
    /// The tracker or a joint reading of its row was lost.
    Lost,
}

/// One marker, measured body or contact over the rows of a recording.
#[derive(Debug, Clone)]
pub(crate) struct Track {
    /// Its name.
    pub(crate) subject: String,
    /// Row by row.
    pub(crate) fates: Vec<Fate>,
}

/// By recording.
pub(crate) type Tracks = BTreeMap<String, Vec<Track>>;

/// The fate of every measurement of every body of the profile.
pub(crate) fn fates(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    fit: Option<&MlFit>,
    held_out: Option<&HeldOut>,
) -> Tracks {
    let rejected = fit.map(left_out).unwrap_or_default();
    let screened: BTreeSet<(&str, &str)> = held_out
        .into_iter()
        .flat_map(|h| &h.poses)
        .filter(|pose| pose.screened)
        .map(|pose| (pose.pose.as_str(), pose.subject.as_str()))
        .collect();
    let held = inputs.excluded.iter();
    let without = [
        RejectedFor::Copied,
        RejectedFor::HeldReadings,
        RejectedFor::StuckReading,
    ];
    let held = held.filter(|out| without.contains(&out.cause));
    let held: BTreeSet<(&str, usize)> = held.map(|out| (out.recording.as_str(), out.row)).collect();
    let mut out = Tracks::new();
    for (name, loaded) in &inputs.recordings {
        let validation = loaded.spec.usage == Usage::Validation;
        let fate = |subject: &str, row: usize, seen: bool| {
            let key = (name.clone(), row, subject.to_owned());
            let pose = || format!("{name}:{}", loaded.poses.rows[row]);
            let usable = seen && loaded.q[row].is_some();
            let is_out = inputs.taken_out.contains(&key);
            if is_out && held.contains(&(name.as_str(), row)) {
                Fate::WithoutReadings
            } else if is_out {
                Fate::Excluded
            } else if !usable {
                Fate::Lost
            } else if rejected.contains(&key)
                || validation && screened.contains(&(&pose(), subject))
            {
                Fate::Rejected
            } else {
                Fate::Used
            }
        };
        let of_recording = subjects(inputs, tracks, loaded, validation)
            .into_iter()
            .map(|(subject, seen)| Track {
                fates: (0..loaded.poses.len())
                    .map(|row| fate(&subject, row, seen[row]))
                    .collect(),
                subject,
            });
        out.insert(name.clone(), of_recording.collect());
    }
    out
}

/// What a recording measures, and in which rows it was seen.
fn subjects(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    loaded: &Loaded,
    validation: bool,
) -> Vec<(String, Vec<bool>)> {
    let mut out = Vec::new();
    let profile = &inputs.robot.profile;
    for (name, body) in &profile.bodies {
        // A body that no joint moves does not verify anything.
        if validation && !is_moved(inputs, body) {
            continue;
        }
        match &body.kind {
            BodyKind::Markers { names, .. } if !tracks[name].is_computed => {
                let seen = names.iter().filter_map(|marker| {
                    let track = loaded.poses.markers.get(marker)?;
                    Some((marker.clone(), track.iter().map(Option::is_some).collect()))
                });
                out.extend(seen);
            }
            _ => {
                let poses = tracks[name].in_recording(&loaded.name);
                if !poses.is_empty() {
                    out.push((name.clone(), poses.iter().map(Option::is_some).collect()));
                }
            }
        }
    }
    let touched = profile.contacts.iter();
    let touched = touched.filter(|(_, contact)| contact.recordings.contains(&loaded.name));
    out.extend(touched.map(|(name, contact)| {
        let touches = (0..loaded.poses.len()).map(|row| is_touch(contact, loaded, row));
        (name.clone(), touches.collect())
    }));
    out
}

/// Whether a row touches something: where rows state what, it is stated.
fn is_touch(contact: &Contact, loaded: &Loaded, row: usize) -> bool {
    match &contact.by_row {
        None => true,
        Some(ByRow::Coordinates(columns)) => {
            let track = loaded.poses.markers.get(columns);
            track.is_some_and(|track| track[row].is_some())
        }
        Some(ByRow::Spots(spots)) => {
            let names = loaded.poses.labels.get(&spots.named_in);
            names.is_some_and(|names| !names[row].is_empty())
        }
    }
}

/// How many of each fate.
pub(crate) fn count(fates: impl IntoIterator<Item = Fate>) -> calib_report::Fates {
    let mut counted = calib_report::Fates::default();
    for fate in fates {
        counted.of += 1;
        match fate {
            Fate::Used => counted.used += 1,
            Fate::Rejected => counted.rejected += 1,
            Fate::Excluded | Fate::WithoutReadings => counted.excluded += 1,
            Fate::Lost => counted.lost += 1,
        }
    }
    counted
}

/// The fate of a row: the best of what was measured in it.
pub(crate) fn rows(tracks: &[Track], rows: usize) -> Vec<Fate> {
    let of_row = |row: usize| tracks.iter().map(|track| track.fates[row]).min();
    (0..rows)
        .map(|row| of_row(row).unwrap_or(Fate::Lost))
        .collect()
}

/// Rejected and excluded measurements among those that were seen, over the fitted recordings: what has no readings cannot be compared with a model.
pub(crate) fn rejected_share(inputs: &Inputs, tracks: &Tracks) -> Share {
    let fitted = tracks
        .iter()
        .filter(|(name, _)| inputs.recordings[*name].spec.usage != Usage::Validation);
    share(
        fitted
            .flat_map(|(_, tracks)| tracks)
            .flat_map(|t| t.fates.iter().copied()),
    )
}

fn share(fates: impl IntoIterator<Item = Fate>) -> Share {
    let fates = fates.into_iter();
    let counted = count(fates.filter(|fate| *fate != Fate::WithoutReadings));
    Share {
        part: counted.rejected + counted.excluded,
        of: counted.of - counted.lost,
    }
}

/// A part of the data is rejected as a whole when more than this share of it is…
const WHOLE: f64 = 0.5;
/// …and it has at least so many measurements: fewer are rejected together by chance.
const FEWEST: usize = 5;
/// Expected number of ranges of a recording with so many rejected rows, were these anywhere: of 40 rows of which 5 are gross, 3 lie in one of 60 ranges of five
/// rows in four of ten recordings.
const BY_CHANCE: f64 = 0.01;
/// Ranges of a joint that are looked at, of equal width.
const RANGES: usize = 10;

/// Recordings, markers and bodies in a recording, and joint ranges of a recording that were rejected as a whole. What a
/// larger part explains is not repeated.
pub(crate) fn rejected_parts(inputs: &Inputs, tracks: &Tracks) -> Vec<RejectedPart> {
    let whole = |share: &Share| share.of >= FEWEST && share.ratio() > WHOLE;
    let mut out = Vec::new();
    for (name, tracks) in tracks {
        let loaded = &inputs.recordings[name];
        if loaded.spec.usage == Usage::Validation {
            continue;
        }
        let all = share(tracks.iter().flat_map(|t| t.fates.iter().copied()));
        if whole(&all) {
            out.push(RejectedPart {
                part: Part::Recording(name.clone()),
                rejected: all,
            });
            continue;
        }
        let before = out.len();
        for track in tracks {
            let rejected = share(track.fates.iter().copied());
            if whole(&rejected) {
                out.push(RejectedPart {
                    part: Part::Subject {
                        recording: name.clone(),
                        subject: track.subject.clone(),
                    },
                    rejected,
                });
            }
        }
        if out.len() == before {
            out.extend(rejected_ranges(inputs, loaded, tracks, &whole));
        }
    }
    out
}

/// Whether among so many ranges one has so many of all rejected rows by chance.
fn is_chance(all: Share, of_range: Share, ranges: usize) -> bool {
    let chance = hypergeometric_tail(all.of, all.part, of_range.of, of_range.part);
    chance * ranges as f64 >= BY_CHANCE
}

/// The tenth of a joint's range in which most was rejected, where so many are not rejected there by chance.
fn rejected_ranges(
    inputs: &Inputs,
    loaded: &Loaded,
    tracks: &[Track],
    whole: &dyn Fn(&Share) -> bool,
) -> Option<RejectedPart> {
    let model = &inputs.robot.model;
    let rows = rows(tracks, loaded.poses.len());
    let mut ranges: Vec<(JointId, f64, f64, Share)> = Vec::new();
    for joint in model.independent_joints() {
        let at: Vec<(f64, Fate)> = loaded
            .q
            .iter()
            .zip(&rows)
            .filter_map(|(q, fate)| Some((q.as_ref()?[joint.index()], *fate)))
            .collect();
        let low = at.iter().map(|a| a.0).fold(f64::INFINITY, f64::min);
        let high = at.iter().map(|a| a.0).fold(f64::NEG_INFINITY, f64::max);
        if high <= low {
            continue;
        }
        let width = (high - low) / RANGES as f64;
        for range in 0..RANGES {
            let from = low + range as f64 * width;
            let inside = |q: f64| ((q - low) / width).min(RANGES as f64 - 1.0) as usize == range;
            let rejected = share(at.iter().filter(|a| inside(a.0)).map(|a| a.1));
            ranges.push((joint, from, from + width, rejected));
        }
    }
    ranges.retain(|(.., rejected)| rejected.of >= FEWEST);
    let all = share(rows.iter().copied());
    let looked_at = ranges.len();
    ranges.retain(|(.., rejected)| whole(rejected) && !is_chance(all, *rejected, looked_at));
    // Of as many the first.
    let worst = ranges.into_iter().rev();
    let (joint, from, to, rejected) = worst.max_by_key(|(.., rejected)| rejected.part)?;
    let joint = model.joint(joint);
    let unit = match joint.kind.turns() {
        true => Unit::Radian,
        false => Unit::Meter,
    };
    let joint = joint.name.clone();
    Some(RejectedPart {
        part: Part::Range {
            joint,
            from,
            to,
            unit,
        },
        rejected,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 40 rows: a few gross ones meet in one range of some joint; those that a cable holds up are all there.
    #[test]
    fn gross_rows_that_meet_in_a_range_are_not_that_ranges() {
        let of_range = |part| Share { part, of: 5 };
        assert!(is_chance(Share { part: 5, of: 40 }, of_range(3), 60));
        assert!(is_chance(Share { part: 9, of: 40 }, of_range(4), 60));
        assert!(!is_chance(Share { part: 5, of: 40 }, of_range(5), 60));
        assert!(!is_chance(Share { part: 6, of: 40 }, of_range(5), 60));
    }
}
