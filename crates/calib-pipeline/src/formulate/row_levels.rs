//! Rows with different noise of the tracker: means of holds beside single rows, and recordings in which it saw worse. Each kind that is
//! fitted has a level, and rows that are held out are judged by their own, (C17b).

use std::collections::{BTreeMap, BTreeSet};

use calib_core::NoiseKind;
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::Usage;

use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::row_noise::{RowNoise, middle};
use crate::prepare::scatter;

/// Recordings that share a level of noise.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RowLevel {
    /// What follows the name of a level: nothing for the first.
    pub(crate) name: String,
    /// Names of recordings, fitted and held out.
    pub(crate) recordings: BTreeSet<String>,
    /// σ of the scatter in these recordings over that of the first level of their kind; 1 for that.
    pub(crate) times: f64,
}

impl RowLevel {
    /// σ of a coordinate by the scatter in the recordings, m; `None` where nothing tells.
    pub(crate) fn scatter(&self, inputs: &Inputs) -> Option<f64> {
        let known = self
            .recordings
            .iter()
            .filter_map(|r| inputs.recordings[r].scatter);
        let (sum, values) = known.fold((0.0, 0.0), |(sum, values), s| {
            (sum + s.values * s.variance, values + s.values)
        });
        (values > 0.0).then(|| (sum / values).sqrt())
    }
}

/// The levels of a problem with these samples. One where the profile states the noise as known, and where nothing speaks for more.
pub(crate) fn row_levels(inputs: &Inputs, samples: &[(String, usize)]) -> Vec<RowLevel> {
    let names: BTreeSet<&String> = samples.iter().map(|(recording, _)| recording).collect();
    let all: Vec<&Loaded> = names.iter().map(|name| &inputs.recordings[*name]).collect();
    let one = |name: &str, of: &[&Loaded]| RowLevel {
        name: name.to_owned(),
        recordings: of.iter().map(|recording| recording.name.clone()).collect(),
        times: 1.0,
    };
    if inputs.robot.profile.solve.noise.known {
        return vec![one("", &all)];
    }
    let (means, single): (Vec<&Loaded>, Vec<&Loaded>) = all.iter().partition(|r| of_means(r));
    if fitted(&means).next().is_none() || fitted(&single).next().is_none() {
        // Held-out rows of the other kind are predicted from the level of the fitted ones.
        let (first, second) = if fitted(&means).next().is_some() {
            (means, single)
        } else {
            (single, means)
        };
        let mut levels = by_scatter("", &first);
        levels[0].recordings.extend(one("", &second).recordings);
        return levels;
    }
    let mut levels = by_scatter("", &single);
    levels.extend(by_scatter(" in holds", &means));
    levels
}

fn fitted<'a>(recordings: &'a [&'a Loaded]) -> impl Iterator<Item = &'a Loaded> {
    let recordings = recordings.iter().copied();
    recordings.filter(|recording| recording.spec.usage != Usage::Validation)
}

/// Whether the rows of a recording are means of holds.
pub(crate) fn of_means(recording: &Loaded) -> bool {
    let alignment = recording.alignment.as_ref();
    alignment.is_some_and(|alignment| alignment.holds.is_some())
}

/// How far ln σ of a recording is above that of another, where that is certain.
fn unlike(recording: &Loaded, other: &Loaded) -> Option<f64> {
    recording.scatter?.above(other.scatter?)
}

/// Recordings of one kind by their scatter: the first level has the one that is told by most values, and all like it.
fn by_scatter(name: &str, recordings: &[&Loaded]) -> Vec<RowLevel> {
    let values = |recording: &Loaded| recording.scatter.map_or(0.0, |s| s.values);
    let usual = fitted(recordings).reduce(|a, b| if values(b) > values(a) { b } else { a });
    let mut levels = vec![RowLevel {
        name: name.to_owned(),
        recordings: BTreeSet::new(),
        times: 1.0,
    }];
    let Some(usual) = usual else {
        levels[0].recordings = recordings.iter().map(|r| r.name.clone()).collect();
        return levels;
    };
    // Of the others, fitted ones make levels, and what is held out joins the nearest.
    let mut order: Vec<&Loaded> = fitted(recordings).collect();
    let held_out = recordings
        .iter()
        .filter(|r| r.spec.usage == Usage::Validation);
    order.extend(held_out);
    for recording in order {
        let Some(above) = unlike(recording, usual) else {
            levels[0].recordings.insert(recording.name.clone());
            continue;
        };
        let near = |level: &&mut RowLevel| (above - level.times.ln()).abs() < scatter::UNLIKE.ln();
        if let Some(level) = levels.iter_mut().skip(1).find(near) {
            level.recordings.insert(recording.name.clone());
        } else if recording.spec.usage == Usage::Validation {
            levels[0].recordings.insert(recording.name.clone());
        } else {
            levels.push(RowLevel {
                name: format!("{name} in {}", recording.name),
                recordings: BTreeSet::from([recording.name.clone()]),
                times: above.exp(),
            });
        }
    }
    levels
}

/// The level of rows that are held out, from the one that a fit finds. Where it has nothing but means of holds, that level is the means'; where
/// it has both, a level of few single rows is known badly, and no row has less noise than within holds. Where a held-out recording scatters
/// unlike those that were fitted, its level is as many times theirs:
///
/// ```text
/// σ²_row = σ²_level + s²   of means,   max(σ²_level, s²)   of single rows        s²: the rows' variance within holds
/// ```
#[derive(Debug, Clone)]
pub(crate) struct HeldOutLevels {
    /// s² of the fitted means.
    pub(crate) within: RowNoise,
    fitted: Fitted,
    /// σ in held-out recordings over that of the level that they have in the problem.
    times: BTreeMap<String, f64>,
}

/// What the levels that are found were found of.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fitted {
    /// Means of holds alone.
    Means,
    /// Means of holds and single rows, each with a level.
    Both,
    /// Single rows, or nothing: the profile states the levels.
    Other,
}

impl HeldOutLevels {
    /// Of a fit's samples: recording and row.
    pub(crate) fn of(inputs: &Inputs, samples: &[(String, usize)]) -> Self {
        let names: BTreeSet<&String> = samples.iter().map(|(recording, _)| recording).collect();
        let all: Vec<&Loaded> = names.iter().map(|name| &inputs.recordings[*name]).collect();
        let noise = fitted(&all).filter(|recording| of_means(recording));
        let noise: Vec<RowNoise> = noise.map(|recording| recording.row_noise).collect();
        let usual = |of: fn(&RowNoise) -> f64| middle(noise.iter().map(of)).unwrap_or(0.0);
        let within = RowNoise {
            position: usual(|n| n.position),
            orientation: usual(|n| n.orientation),
        };
        let known = inputs.robot.profile.solve.noise.known;
        let of_fit = if known || noise.is_empty() {
            Fitted::Other
        } else if fitted(&all).all(of_means) {
            Fitted::Means
        } else {
            Fitted::Both
        };
        let mut times = BTreeMap::new();
        let held_out = all.iter().filter(|r| r.spec.usage == Usage::Validation);
        for recording in held_out.filter(|_| !known) {
            let levels = row_levels(inputs, samples);
            let level = levels
                .iter()
                .find(|l| l.recordings.contains(&recording.name));
            let of_level =
                fitted(&all).filter(|r| level.is_some_and(|l| l.recordings.contains(&r.name)));
            let like = of_level.filter(|r| of_means(r) == of_means(recording));
            let values = |recording: &Loaded| recording.scatter.map_or(0.0, |s| s.values);
            let usual = like.reduce(|a, b| if values(b) > values(a) { b } else { a });
            if let Some(above) = usual.and_then(|usual| unlike(recording, usual)) {
                times.insert(recording.name.clone(), above.exp());
            }
        }
        Self {
            within,
            fitted: of_fit,
            times,
        }
    }

    /// σ² of a kind of noise in a recording, from the one that was found.
    pub(crate) fn level(&self, recording: &Loaded, kind: NoiseKind, found: f64) -> f64 {
        let within = self.within.of_kind(kind);
        let of_tracker = matches!(kind, NoiseKind::Position | NoiseKind::Orientation);
        let times = self.times.get(&recording.name).filter(|_| of_tracker);
        match (self.fitted, times) {
            (_, Some(times)) => found * times * times,
            (Fitted::Other, _) => found,
            _ if of_means(recording) => found,
            (Fitted::Means, _) => found + within,
            (Fitted::Both, _) => found.max(within),
        }
    }
}

/// Recordings whose noise is not that of the others.
pub(crate) fn findings(inputs: &Inputs, samples: &[(String, usize)]) -> Vec<Finding> {
    let mut findings = Vec::new();
    let finding = |recording: &str, kind: &'static str, [sigma, others]: [f64; 2]| {
        Finding::of_kind(
            catalog::RECORDING_NOISE,
            kind,
            Subject::recording(recording),
        )
        .with("sigma", Fact::meters(sigma))
        .with("others", Fact::meters(others))
    };
    let sigma = |recording: &str| Some(inputs.recordings[recording].scatter?.variance.sqrt());
    for level in row_levels(inputs, samples) {
        for recording in level.recordings.iter().filter(|_| level.times != 1.0) {
            if let Some(own) = sigma(recording) {
                findings.push(finding(recording, "fitted", [own, own / level.times]));
            }
        }
    }
    for (recording, times) in HeldOutLevels::of(inputs, samples).times {
        if let Some(own) = sigma(&recording) {
            findings.push(finding(&recording, "held_out", [own, own / times]));
        }
    }
    findings
}
