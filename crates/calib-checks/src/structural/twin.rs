//! What the design cannot tell apart: noise-free twins.
//!
//! The twin of a hypothesis h is the data that the nominal robot would have given on the same rows, with the same lost samples, had h
//! been true. A hypothesis that fits the twin exactly as well is equivalent to h *on this design*.

use calib_geometry::so3;
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Vector3};

use super::apply::{apply, apply_all};
use super::data::{Data, Measured};
use super::hypothesis::{Hypothesis, Scoped};
use super::ids::SampleIndex;
use super::scan::{Fit, Scan};
use super::special::{rigid_motion, transform};

/// The twin of a set of corrections; with none, of the data as they are claimed to be.
pub(crate) fn twin(data: &Data, corrections: &[Scoped], screened: &[SampleIndex]) -> Data {
    let stages: Vec<Data> = corrections
        .iter()
        .scan(data.clone(), |stage, scoped| {
            let next = apply(scoped, stage);
            Some(std::mem::replace(stage, next))
        })
        .collect();
    let corrected = apply_all(corrections, data);
    let mut twin = predicted(&corrected, screened);
    for (scoped, before) in corrections.iter().zip(&stages).rev() {
        undo_measured(scoped, before, &mut twin);
    }
    Data {
        chain: data.chain.clone(),
        readings: data.readings.clone(),
        recording: data.recording.clone(),
        rates: data.rates.clone(),
        bodies: twin
            .bodies
            .into_iter()
            .zip(&data.bodies)
            .map(|(t, d)| super::data::Body {
                link: d.link,
                mounts: d.mounts.clone(),
                measured: t.measured,
            })
            .collect(),
    }
}

/// The data with every seen sample replaced by its prediction; rows without readings are lost.
fn predicted(data: &Data, screened: &[SampleIndex]) -> Data {
    let scan = Scan::new(data, screened);
    let fit = scan.fit(None);
    let n = scan.channels.len();
    // tracker coordinates: y = Qᵀ (R m + t − c) + center
    let y = |i: usize, k: usize| {
        let (p, _) = scan.predicted(&fit, i, k);
        fit.registration.q.tr_mul(&(p - fit.registration.c)) + fit.center
    };
    let mut twin = data.clone();
    for (b, body) in twin.bodies.iter_mut().enumerate() {
        let first = scan.channels.iter().position(|c| c.body == b).unwrap_or(0);
        match &mut body.measured {
            Measured::Markers(rows) => {
                for (i, row) in rows.iter_mut().enumerate() {
                    for (marker, sample) in row.iter_mut().enumerate() {
                        let k = first + marker;
                        *sample = (scan.weights[i * n + k] > 0.0).then(|| Point3::from(y(i, k)));
                    }
                }
            }
            Measured::Poses {
                tracker_from_body, ..
            } => {
                for (i, pose) in tracker_from_body.iter_mut().enumerate() {
                    *pose = (scan.weights[i * n + first] > 0.0)
                        .then(|| pose_of(&scan, &fit, i, first, y(i, first)))
                        .flatten();
                }
            }
        }
    }
    twin
}

/// The pose nearest to the four virtual points: exactly rigid.
fn pose_of(
    scan: &Scan<'_>,
    fit: &Fit,
    i: usize,
    first: usize,
    position: Vector3<f64>,
) -> Option<Isometry3<f64>> {
    let n = scan.channels.len();
    let r = scan.data.recording[i].0;
    let m = |a: usize| fit.points[r * n + first + a];
    let link_from_body = so3::nearest_rotation(&Matrix3::from_columns(&[
        m(1) - m(0),
        m(2) - m(0),
        m(3) - m(0),
    ]))?;
    let (_, link) = scan.predicted(fit, i, first);
    let rotation =
        fit.registration.q.transpose() * link.r * link_from_body.to_rotation_matrix().into_inner();
    Some(Isometry3::from_parts(
        Translation3::from(position),
        so3::nearest_rotation(&rotation)?,
    ))
}

fn undo_measured(scoped: &Scoped, before: &Data, twin: &mut Data) {
    match scoped.hypothesis {
        Hypothesis::TrackerUnit { .. }
        | Hypothesis::Mirrored
        | Hypothesis::TrackerAxes { .. }
        | Hypothesis::Poses { .. } => {
            let back = Scoped {
                hypothesis: scoped.hypothesis.undone(),
                scope: scoped.scope,
            };
            *twin = apply(&back, twin);
        }
        Hypothesis::ExchangedBodies { .. } => *twin = apply(scoped, twin),
        Hypothesis::TrackerMoved => undo_motion(scoped, before, twin),
        _ => {}
    }
}

/// Moves the tracker of the twin where that of the data was.
fn undo_motion(scoped: &Scoped, before: &Data, twin: &mut Data) {
    let after = apply(scoped, before);
    let Some(before_from_after) = rigid_motion(scoped.scope, &after, before) else {
        return;
    };
    let inside: Vec<bool> = before
        .recording
        .iter()
        .map(|r| scoped.scope.contains(*r))
        .collect();
    transform(twin, &inside, &before_from_after);
}
