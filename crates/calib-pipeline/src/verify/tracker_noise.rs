//! The noise of the tracker as the fit found it, by what was measured.

use std::collections::BTreeMap;

use calib_core::{
    FrameId, GroupId, MarkerObservation, MeasurementKind, NoiseEstimate, NoiseKind, PointId,
    PoseNoise,
};
use calib_report::{HeldOut, PoseError};

use crate::formulate::along_sight::coordinate;
use crate::formulate::formulation::MlFit;
use crate::formulate::ml::MARKER_SIGMA;
use crate::formulate::row_levels::HeldOutLevels;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

/// A level that was found scatters by a tenth; one above the markers' own scatter by more than this factor is not theirs.
const CLEARLY: f64 = 1.3;

/// Variances of one coordinate of a measured position, m².
#[derive(Debug, Clone, Default)]
pub(crate) struct TrackerNoise<'a> {
    /// By marker, and by body where its poses were measured.
    by_subject: BTreeMap<&'a str, f64>,
    /// Of everything else that was measured: markers first.
    common: Option<f64>,
    /// Recording and row of the fit's samples.
    samples: &'a [(String, usize)],
}

/// What a level of noise is of.
#[derive(Debug, Clone, Copy)]
enum Of {
    /// Markers, in all directions or across the line of sight.
    Marker,
    /// Markers along the line of sight.
    MarkerAlong,
    /// Bodies whose poses are measured.
    Pose,
}

impl<'a> TrackerNoise<'a> {
    /// Of a fit, as it found it.
    pub(crate) fn of(fit: &'a MlFit) -> Self {
        Self::with(fit, &|_, found| found.sigma)
    }

    /// The part of what a fit found that is the tracker's. What a model lacks is found as noise too: markers scatter about their bodies, which no
    /// robot moves, and clearly more than that and what was stated is not the tracker's. Where the fit is known to lack an effect, nothing is that
    /// is above what was stated, or above that scatter where nothing was.
    pub(crate) fn beside_lacking(
        fit: &'a MlFit,
        inputs: &Inputs,
        tracks: &BTreeMap<String, BodyTrack>,
        lacking: bool,
    ) -> Self {
        let stated = inputs.robot.profile.tracker.marker_coordinate();
        let sight = inputs.robot.profile.tracker.sight.marker;
        let scatter = tracks.values().filter_map(|track| track.marker_sigma);
        let scatter = scatter.reduce(f64::max);
        // In units of the level that the fit began with.
        let of_markers = match (stated, scatter) {
            (None, Some(scatter)) => Some(scatter / MARKER_SIGMA),
            (Some(stated), Some(scatter)) if !lacking => Some(f64::max(1.0, scatter / stated)),
            _ => lacking.then_some(1.0),
        };
        let of_poses = lacking.then_some(1.0);
        let above = if lacking { 1.0 } else { CLEARLY };
        Self::with(fit, &|of, found| {
            let times = match of {
                Of::Marker => of_markers,
                // All of the scatter may lie along one of three directions; a level that is stated is that of this one.
                Of::MarkerAlong if sight.is_none() => {
                    of_markers.map(|times| times * f64::sqrt(3.0))
                }
                Of::MarkerAlong => of_markers,
                Of::Pose => of_poses,
            };
            let most = times.map_or(f64::INFINITY, |times| times * found.stated);
            if found.sigma > above * most {
                most
            } else {
                found.sigma
            }
        })
    }

    /// With levels, m, of markers or else of poses, from those that were found.
    fn with(fit: &'a MlFit, of_level: &dyn Fn(Of, &NoiseEstimate) -> f64) -> Self {
        let level = |group: GroupId, of: Of| {
            let found = fit.solution.noise.iter().find(|n| n.id == group)?;
            Some(of_level(of, found).powi(2))
        };
        let (markers, bodies) = (markers(fit), bodies(fit));
        let mut by_subject = BTreeMap::new();
        // Single rows and means of holds have levels of their own: what is held out counts, else single rows, which come first.
        let measurements = fit.formulation.problem.measurements().iter().rev();
        let (with, without): (Vec<_>, Vec<_>) = measurements.partition(|m| held_out(fit, &m.kind));
        for measurement in without.into_iter().chain(with) {
            match &measurement.kind {
                MeasurementKind::Markers(seen) => {
                    // A point that stands for several markers, or the mean of a hold, has a shape of its own in each row.
                    let mut of_points: BTreeMap<PointId, Vec<&MarkerObservation>> = BTreeMap::new();
                    for observation in &seen.observations {
                        of_points
                            .entry(observation.point)
                            .or_default()
                            .push(observation);
                    }
                    for (point, observations) in of_points {
                        let name = markers.get(&point).copied();
                        let variance = level(seen.noise_of(point), Of::Marker);
                        let along = seen.sight.map(|sight| level(sight.along, Of::MarkerAlong));
                        let growth = seen.sight.map(|sight| sight.growth).unwrap_or_default();
                        let times = |o: &MarkerObservation, variance: f64| match (&o.shape, along) {
                            (Some(shape), _) => variance * shape.trace() / 3.0,
                            (None, Some(Some(along))) => {
                                let distance = std::iter::once(o.position.coords.norm());
                                coordinate((variance, along), growth, distance)
                            }
                            (None, _) => variance,
                        };
                        let mean = variance.map(|variance| {
                            let all = observations.iter().map(|o| times(o, variance));
                            all.sum::<f64>() / observations.len() as f64
                        });
                        by_subject.extend(name.zip(mean));
                    }
                }
                MeasurementKind::Poses(seen) => {
                    if let PoseNoise::Split { position, .. } = seen.noise {
                        let name = bodies.get(&measurement.to).copied();
                        let across = level(position, Of::Pose);
                        let distances = seen.observations.iter();
                        let distances = distances.map(|o| o.pose.translation.vector.norm());
                        let variance = match &seen.sight {
                            None => across,
                            Some(sight) => (across.zip(level(sight.along, Of::Pose)))
                                .map(|levels| coordinate(levels, sight.growth, distances)),
                        };
                        by_subject.extend(name.zip(variance));
                    }
                }
                _ => {}
            }
        }
        let groups = fit.formulation.noise;
        let common = groups.marker.and_then(|g| level(g, Of::Marker));
        Self {
            by_subject,
            common: common.or_else(|| level(groups.body_position?, Of::Pose)),
            samples: &fit.formulation.samples,
        }
    }

    /// Variance of one coordinate of a marker's or a body's position, m².
    pub(crate) fn variance(&self, subject: &str) -> Option<f64> {
        self.by_subject.get(subject).copied().or(self.common)
    }

    /// rms length of the noise in the positions that were held out, m.
    pub(crate) fn over(&self, inputs: &Inputs, held_out: &HeldOut) -> Option<f64> {
        let rows = HeldOutLevels::of(inputs, self.samples);
        let errors = held_out.poses.iter().filter(|p| !p.screened);
        let (mut sum, mut n) = (0.0, 0.0);
        for error in errors {
            let variance = self.variance(&error.subject)?;
            let recording = recording_of(inputs, error);
            let level = recording.map(|r| rows.level(r, NoiseKind::Position, variance));
            sum += 3.0 * level.unwrap_or(variance);
            n += 1.0;
        }
        (n > 0.0).then(|| f64::sqrt(sum / n))
    }
}

/// Whether some of what was measured is held out.
fn held_out(fit: &MlFit, kind: &MeasurementKind) -> bool {
    let held_out = &fit.formulation.problem.held_out;
    match kind {
        MeasurementKind::Markers(of) => {
            of.observations.iter().any(|o| held_out.contains(&o.sample))
        }
        MeasurementKind::Poses(of) => of.observations.iter().any(|o| held_out.contains(&o.sample)),
        _ => false,
    }
}

/// The recording that an error was seen in.
pub(crate) fn recording_of<'a>(inputs: &'a Inputs, error: &PoseError) -> Option<&'a Loaded> {
    let (recording, _) = error.pose.rsplit_once(':')?;
    inputs.recordings.get(recording)
}

/// Names of the markers.
fn markers(fit: &MlFit) -> BTreeMap<PointId, &str> {
    let bodies = fit.formulation.points.values();
    let named = bodies.flat_map(|names| names.iter().map(|(name, point)| (*point, name.as_str())));
    named.collect()
}

/// Names of the bodies.
fn bodies(fit: &MlFit) -> BTreeMap<FrameId, &str> {
    let named = fit.formulation.bodies.iter();
    named.map(|(name, frame)| (*frame, name.as_str())).collect()
}
