//! Rows that the robust fit left out, and what is wrong with them.
//!
//! If a fraction of the way to another row makes a row right (`body_error`), joints and tracker were read at different times, or the
//! robot had not settled. Where an error of one joint alone leaves clearly less, its reading was wrong. Where each of two bodies is where the other should
//! be, the tracker exchanged their names.

use std::collections::{BTreeMap, BTreeSet};

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::{Body, Usage};
use calib_report::RejectedFor;
use calib_urdf::RobotModel;

use crate::formulate::body_error::{BodyError, FarOff, OnTheWay, Usual, usual_of};
use crate::formulate::formulation::MlFit;
use crate::formulate::row_checks::Exchanged;
use crate::formulate::row_levels::{RowLevel, row_levels};
use crate::formulate::standing::{OneJoint, Standing, standing};
use crate::formulate::starts::rows_of_no_side;
use crate::prepare::conditions::conditions;
use crate::prepare::excluded::Excluded;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

/// Rows that a fit cannot explain, and what is wrong with them.
#[derive(Debug, Clone, Default)]
pub struct BadRows {
    /// For the report and for `calib check`.
    pub findings: Vec<Finding>,
    /// Rows that lie on the way to a neighbor: joints and tracker were not read at the same time.
    pub unsettled: Vec<Excluded>,
    /// Rows in which the readings of a joint stand although it moved.
    pub stuck: Vec<Excluded>,
}

/// Whether single rows of a recording are judged. Where rows follow each other in time, a lag is the clock's, and every row has one.
pub(crate) fn is_judged(loaded: &Loaded) -> bool {
    loaded.spec.usage != Usage::Validation && loaded.alignment.is_none()
}

/// What is wrong with the rows that `fit` left out.
#[must_use]
pub fn bad_rows(inputs: &Inputs, tracks: &BTreeMap<String, BodyTrack>, fit: &MlFit) -> BadRows {
    let mut bad = BadRows::default();
    if !fit.solution.status.is_converged() {
        return bad;
    }
    let rejected = rejected_bodies(fit, tracks);
    let load = inputs.robot.profile.solve.load;
    let recordings = inputs.recordings.iter();
    let conditions = recordings
        .map(|(name, r)| (name.as_str(), conditions(r, &inputs.robot, load)))
        .collect();
    let of_no_side = rows_of_no_side(inputs);
    let levels = row_levels(inputs, &fit.formulation.samples);
    let bodies = inputs.robot.profile.bodies.keys();
    let is_concerned = |name: &&String| rejected.iter().any(|(.., body)| body == *name);
    let bodies = bodies.filter(is_concerned);
    let errors = bodies.map(|name| BodyError {
        inputs,
        fit,
        name,
        track: &tracks[name],
        conditions: &conditions,
    });
    let judged = errors.map(|off| Judged::new(off, &rejected, &levels));
    let judged: Vec<Judged<'_>> = judged.collect();
    let exchanged = exchanged(inputs, &judged, &mut bad.findings);
    let model = &inputs.robot.model;
    let mut known: BTreeSet<RowOfBody> = BTreeSet::new();
    for Judged { off, rows, usual } in &judged {
        for (recording, loaded) in inputs.recordings.iter().filter(|(_, r)| is_judged(r)) {
            let Some(&usual) = usual.get(recording) else {
                continue;
            };
            let (mut moving, mut others) = (Vec::new(), Vec::new());
            for &row in rows.get(recording).into_iter().flatten() {
                let of_no_side = of_no_side.contains(&(recording.clone(), row));
                if of_no_side && off.is_usual_on_a_side(loaded, row, usual) {
                    continue;
                }
                if exchanged.contains(&(recording, row, off.name)) {
                    continue;
                }
                match off.between_rows(loaded, row, usual) {
                    Some(on_the_way) => moving.push((row, on_the_way)),
                    None => others.extend(off.far_off(loaded, row, usual).map(|w| (row, w))),
                }
            }
            let explained: Vec<(usize, OneJoint)> = others
                .iter()
                .filter_map(|(row, off)| Some((*row, off.joint?)))
                .collect();
            if let Some(standing) = standing(model, loaded, &explained) {
                others.retain(|(row, _)| !standing.rows.contains(row));
                bad.findings.push(standing.finding(model, off.name, loaded));
                if standing.is_in_rows(loaded) {
                    others.retain(|(row, _)| !standing.run.contains(row));
                    moving.retain(|(row, _)| !standing.run.contains(row));
                    for out in stuck(inputs, recording, &standing) {
                        if known.insert((out.recording.clone(), out.row, out.body.clone())) {
                            bad.stuck.push(out);
                        }
                    }
                }
            }
            bad.findings
                .extend(unsettled_finding(recording, off.name, loaded, &moving));
            bad.findings
                .extend(outlier_finding(model, off.name, loaded, &others));
            bad.unsettled.extend(moving.iter().map(|(row, _)| Excluded {
                recording: recording.clone(),
                row: *row,
                body: off.name.to_owned(),
                cause: RejectedFor::OnTheWay,
            }));
        }
    }
    bad
}

/// What of the rows shows the joint: all bodies behind it.
fn stuck(inputs: &Inputs, recording: &str, standing: &Standing) -> Vec<Excluded> {
    let model = &inputs.robot.model;
    let bodies = inputs.robot.profile.bodies.iter();
    let behind = bodies.filter(|(_, b)| model.chain_to_root(b.link).contains(&standing.joint));
    let of_body = |(name, _): (&String, &Body)| -> Vec<Excluded> {
        let row = |row| Excluded {
            recording: recording.to_owned(),
            row,
            body: name.clone(),
            cause: RejectedFor::StuckReading,
        };
        standing.run.clone().map(row).collect()
    };
    behind.flat_map(of_body).collect()
}

/// Adds what is found beside a fit to what was `said`: of bodies whose names were exchanged, the finding that has more rows stays.
pub(crate) fn say(said: &mut Vec<Finding>, findings: Vec<Finding>) {
    let pair = |f: &Finding| {
        let (first, second) = (f.facts.get("first")?, f.facts.get("second")?);
        Some((first.clone(), second.clone()))
    };
    for finding in findings {
        let is_same = |s: &&mut Finding| {
            let same = s.id == finding.id && s.subject == finding.subject;
            same && pair(s).is_some() && pair(s) == pair(&finding)
        };
        match said.iter_mut().find(is_same) {
            Some(earlier) if finding.rows.len() > earlier.rows.len() => *earlier = finding,
            Some(_) => {}
            None => said.push(finding),
        }
    }
}

/// A body, and the rows in which the fit left it out.
struct Judged<'a> {
    off: BodyError<'a>,
    /// By recording.
    rows: BTreeMap<&'a String, BTreeSet<usize>>,
    /// By recording; none where too few rows tell.
    usual: BTreeMap<&'a String, Usual>,
}

impl<'a> Judged<'a> {
    fn new(off: BodyError<'a>, rejected: &BTreeSet<RowOfBody>, levels: &[RowLevel]) -> Self {
        let inputs = off.inputs;
        // What is usual where the tracker has the same noise, else in all rows.
        let sizes = off.sizes(rejected);
        let of_all = usual_of(&sizes, &|_| true);
        let of_levels: Vec<Option<Usual>> = levels
            .iter()
            .map(|level| usual_of(&sizes, &|r| level.recordings.contains(r)))
            .collect();
        let usual = |name: &'a String| {
            let level = levels.iter().position(|l| l.recordings.contains(name));
            let of_level = level.and_then(|level| of_levels[level]);
            Some((name, of_level.or(of_all)?))
        };
        let usual = inputs.recordings.keys().filter_map(usual).collect();
        let rows = inputs.recordings.keys().map(|name| {
            let own = rejected
                .iter()
                .filter(|(r, _, b)| r == name && b == off.name);
            (name, own.map(|(_, row, _)| *row).collect())
        });
        let rows = rows.collect();
        Self { off, rows, usual }
    }
}

/// Rows in which each of two bodies is where the other should be, with what is said of them.
fn exchanged<'a>(
    inputs: &'a Inputs,
    judged: &[Judged<'a>],
    findings: &mut Vec<Finding>,
) -> BTreeSet<(&'a String, usize, &'a str)> {
    let mut all = BTreeSet::new();
    for (k, first) in judged.iter().enumerate() {
        for second in &judged[k + 1..] {
            for (name, loaded) in inputs.recordings.iter().filter(|(_, r)| is_judged(r)) {
                let usual = first.usual.get(name).zip(second.usual.get(name));
                let (Some((of_first, of_second)), Some(own), Some(others)) =
                    (usual, first.rows.get(name), second.rows.get(name))
                else {
                    continue;
                };
                let is_exchanged = |row: &usize| {
                    first.off.is_where(&second.off, loaded, *row, *of_first)
                        && second.off.is_where(&first.off, loaded, *row, *of_second)
                };
                let rows: BTreeSet<usize> = own
                    .intersection(others)
                    .copied()
                    .filter(is_exchanged)
                    .collect();
                if rows.is_empty() {
                    continue;
                }
                let bodies = [first.off.name, second.off.name];
                let of_body = |body| rows.iter().map(move |row| (name, *row, body));
                all.extend(bodies.into_iter().flat_map(of_body));
                let found = Exchanged {
                    loaded,
                    bodies,
                    rows,
                };
                findings.push(found.finding(inputs));
            }
        }
    }
    all
}

/// Recording, row and body.
type RowOfBody = (String, usize, String);

/// Where nothing that was seen of a body takes part, or one of the markers that alone were seen does not.
fn rejected_bodies(fit: &MlFit, tracks: &BTreeMap<String, BodyTrack>) -> BTreeSet<RowOfBody> {
    // (sample, measurement) → observations
    let mut rejected: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for r in &fit.solution.rejected {
        *rejected
            .entry((r.sample, r.measurement.index()))
            .or_default() += 1;
    }
    let measurements = fit.formulation.problem.measurements();
    let mut seen: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for (m, measurement) in measurements.iter().enumerate() {
        if let calib_core::MeasurementKind::Markers(calib_core::measurement::Markers {
            observations,
            ..
        }) = &measurement.kind
        {
            for o in observations {
                *seen.entry((o.sample, m)).or_default() += 1;
            }
        }
    }
    let of_body = |((sample, m), count): ((usize, usize), usize)| {
        let (recording, row) = &fit.formulation.samples[sample];
        let name = &measurements[m].name;
        let pose = tracks.get(name).and_then(|track| {
            let row = track.in_recording(recording).get(*row)?;
            row.as_ref()
        });
        let all = seen.get(&(sample, m)).is_none_or(|all| count >= *all);
        (all || pose.is_none()).then(|| (recording.clone(), *row, name.clone()))
    };
    rejected.into_iter().filter_map(of_body).collect()
}

fn unsettled_finding(
    recording: &str,
    body: &str,
    loaded: &Loaded,
    moving: &[(usize, OnTheWay)],
) -> Option<Finding> {
    let (_, worst) = moving
        .iter()
        .max_by(|a, b| a.1.position.total_cmp(&b.1.position))?;
    let angle = moving.iter().filter_map(|(_, w)| w.angle).reduce(f64::max);
    Some(
        Finding::of_kind(
            catalog::UNSETTLED_ROWS,
            "between",
            Subject::body(body).in_recording(recording),
        )
        .with("count", Fact::count(moving.len()))
        .with("position", Fact::meters(worst.position))
        .with_some("angle", angle.map(Fact::radians))
        .with("fraction", Fact::ratio(worst.fraction.abs()))
        .at_rows(moving.iter().map(|(row, _)| loaded.poses.rows[*row])),
    )
}

fn outlier_finding(
    model: &RobotModel,
    body: &str,
    loaded: &Loaded,
    rows: &[(usize, FarOff)],
) -> Option<Finding> {
    let (_, worst) = rows.iter().max_by(|a, b| a.1.ratio.total_cmp(&b.1.ratio))?;
    let joints: BTreeSet<&str> = rows
        .iter()
        .filter_map(|(_, off)| Some(model.joint(off.joint?.joint).name.as_str()))
        .collect();
    let joints = (!joints.is_empty()).then(|| Fact::names(joints));
    Some(
        Finding::of_kind(
            catalog::ROW_OUTLIER,
            "one_body",
            Subject::body(body).in_recording(&loaded.name),
        )
        .with("count", Fact::count(rows.len()))
        .with("position", Fact::meters(worst.position))
        .with_some("angle", worst.angle.map(Fact::radians))
        .with("ratio", Fact::ratio(worst.ratio))
        .with_some("joints", joints)
        .at_rows(rows.iter().map(|(row, _)| loaded.poses.rows[*row])),
    )
}
