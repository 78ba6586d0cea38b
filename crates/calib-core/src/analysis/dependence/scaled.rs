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

/// A row of an observation: measurement, point and number.
type Row = (usize, usize, usize);

/// The same before its rows have the numbers of those of earlier samples.
pub(super) struct Unnumbered {
    k: DMatrix<f64>,
    w: DMatrix<f64>,
    y: DVector<f64>,
    rows: Vec<Option<Row>>,
}

impl Unnumbered {
    pub(super) fn numbered(self, starts: bool, keys: &mut Keys) -> Scaled {
        let rows = self.rows.into_iter();
        Scaled {
            k: self.k,
            w: self.w,
            y: self.y,
            keys: rows.map(|row| row.map(|row| keys.of(row))).collect(),
            starts,
        }
    }
}

/// W = σ V⁻¹ σ,   k = σ V⁻¹ J,   y = σ V⁻¹ e
pub(super) fn scaled_sample(solution: &Solution, rows: &Whitened, of: MemoryOf) -> Unnumbered {
    let m = rows.w.len();
    let mut sigma = vec![0.0; m];
    let mut own = vec![None; m];
    for &(o, first, count) in &rows.blocks {
        add_block(&solution.model, o, |i, j, group, shape| {
            if i == j {
                sigma[first + i] += solution.theta[group] * shape;
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
        // Rows that are turned are in one unit.
        if matches!(kind, MeasurementKind::Poses(poses) if poses.sight.is_some()) {
            for three in sigma[first..first + 6].chunks_exact_mut(3) {
                let mean = three.iter().sum::<f64>() / 3.0;
                three.fill(mean);
            }
        }
        for s in &mut sigma[first..first + count] {
            *s = s.sqrt();
        }
        for i in 0..count {
            if asked(of, kind, i) {
                own[first + i] = Some((observation.measurement, part, i));
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
    let apart = Unnumbered {
        k: rows.a.transposed_times(&scaled).transpose(),
        y: &transposed * &rows.w,
        w: &transposed * &scaled,
        rows: own,
    };
    match of {
        MemoryOf::Together => apart.together(solution, &sigma),
        _ => apart,
    }
}

impl Unnumbered {
    /// Three rows for each frame that the sample is measured from: what its motion along an axis does to all rows.
    fn together(self, solution: &Solution, sigma: &[f64]) -> Self {
        let unit = solution.theta.first().map_or(1.0, |theta| theta.sqrt());
        let problem = solution.model.problem();
        let mut all: Vec<Row> = Vec::new();
        let mut places = vec![None; sigma.len()];
        for (i, row) in self.rows.iter().enumerate() {
            let Some((measurement, _, axis)) = *row else {
                continue;
            };
            let from = problem.measurements[measurement].from.index();
            let key = (from, 0, axis % 3);
            let place = all.iter().position(|k| *k == key);
            let place = place.unwrap_or_else(|| {
                all.push(key);
                all.len() - 1
            });
            places[i] = Some(place);
        }
        let mut b = DMatrix::zeros(sigma.len(), all.len());
        for (i, place) in places.iter().enumerate() {
            if let Some(place) = place {
                b[(i, *place)] = unit / sigma[i];
            }
        }
        let across = b.transpose();
        Self {
            k: &across * &self.k,
            w: &across * &self.w * &b,
            y: &across * &self.y,
            rows: all.into_iter().map(Some).collect(),
        }
    }
}

/// From the axes of a body to those of the frame that its pose was measured from; `None` for rows that stand still, and where a
/// covariance is stated in the body's axes.
fn turn_of_rows(kind: &MeasurementKind, item: usize) -> Option<Matrix3<f64>> {
    match kind {
        MeasurementKind::Poses(poses) if matches!(poses.noise, PoseNoise::Split { .. }) => {
            let measured = &poses.observations[item].pose;
            let turn = measured.rotation.to_rotation_matrix().into_inner();
            let axes = kind.of().axes(item);
            Some(axes.map_or(turn, |axes| turn * axes.transpose()))
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
        MemoryOf::Together => match kind {
            MeasurementKind::Markers(_) => true,
            _ => pose && row >= 3,
        },
    }
}

/// Numbers of rows.
#[derive(Default)]
pub(super) struct Keys(Vec<Row>);

impl Keys {
    fn of(&mut self, key: Row) -> usize {
        self.0.iter().position(|k| *k == key).unwrap_or_else(|| {
            self.0.push(key);
            self.0.len() - 1
        })
    }
}
