//! The rows of one sample as the memory of the noise is looked for in them.

use nalgebra::{DMatrix, DVector, Matrix3};

use super::MemoryOf;
use crate::analysis::solution::Solution;
use crate::graph::measurement::{MeasurementKind, PoseNoise};
use crate::solve::rows::add_block;
use crate::solve::whitened::Whitened;

/// One sample in units of each row's own σ.
pub(super) struct Scaled {
    pub k: DMatrix<f64>,
    pub w: DMatrix<f64>,
    pub y: DVector<f64>,
    /// Which row of which observation, the same in all samples; `None` for rows that are not asked.
    pub keys: Vec<Option<usize>>,
    /// First sample of a recording.
    pub starts: bool,
}

/// W = σ V⁻¹ σ,   k = σ V⁻¹ J,   y = σ V⁻¹ e
pub(super) fn scaled_sample(
    solution: &Solution,
    rows: &Whitened,
    of: MemoryOf,
    starts: bool,
    keys: &mut Keys,
) -> Scaled {
    let m = rows.w.len();
    let mut sigma = vec![1.0; m];
    let mut own = vec![None; m];
    for &(o, first, count) in &rows.blocks {
        add_block(&solution.model, o, |i, j, group, shape| {
            if i == j {
                sigma[first + i] = (solution.theta[group] * shape).sqrt();
            }
        });
        let observation = solution.model.observations[o];
        let kind = &solution.model.problem.measurements[observation.measurement].kind;
        let part = match kind {
            MeasurementKind::Markers(markers) => {
                markers.observations[observation.item].point.index() + 1
            }
            _ => 0,
        };
        for i in 0..count {
            if asked(of, kind, i) {
                own[first + i] = Some(keys.of(observation.measurement, part, i));
            }
        }
    }
    let mut scaled = rows.l_inverse.clone();
    for (j, s) in sigma.iter().enumerate() {
        scaled.column_mut(j).scale_mut(*s);
    }
    // Turned rows T x have the covariance T X Tᵀ, and its inverse is T W Tᵀ.
    for &(o, first, _) in &rows.blocks {
        let observation = solution.model.observations[o];
        let kind = &solution.model.problem.measurements[observation.measurement].kind;
        if let Some(turn) = turn_of_rows(kind, observation.item) {
            for three in [first, first + 3] {
                let turned = scaled.columns(three, 3) * turn.transpose();
                scaled.columns_mut(three, 3).copy_from(&turned);
            }
        }
    }
    // The product of a transpose has no fast kernel.
    let transposed = scaled.transpose();
    Scaled {
        k: rows.a.transposed_times(&scaled).transpose(),
        y: &transposed * &rows.w,
        w: &transposed * &scaled,
        keys: own,
        starts,
    }
}

/// From the axes of a body to those of the frame that its pose was measured from; `None` for rows that stand still, and where a
/// covariance is stated in the body's axes.
fn turn_of_rows(kind: &MeasurementKind, item: usize) -> Option<Matrix3<f64>> {
    match kind {
        MeasurementKind::Poses(poses) if matches!(poses.noise, PoseNoise::Split { .. }) => {
            let measured = &poses.observations[item].pose;
            Some(measured.rotation.to_rotation_matrix().into_inner())
        }
        _ => None,
    }
}

/// Whether a row of a measurement belongs to the rows that are asked.
fn asked(of: MemoryOf, kind: &MeasurementKind, row: usize) -> bool {
    let pose = matches!(kind, MeasurementKind::Poses(_));
    match of {
        MemoryOf::All => true,
        MemoryOf::Positions => pose && row >= 3,
        MemoryOf::Orientations => pose && row < 3,
    }
}

/// Numbers of (measurement, point, row).
#[derive(Default)]
pub(super) struct Keys(Vec<(usize, usize, usize)>);

impl Keys {
    fn of(&mut self, measurement: usize, part: usize, row: usize) -> usize {
        let key = (measurement, part, row);
        self.0.iter().position(|k| *k == key).unwrap_or_else(|| {
            self.0.push(key);
            self.0.len() - 1
        })
    }
}
