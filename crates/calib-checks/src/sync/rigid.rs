//! Equation (1) of [`super::point`] where A is that of rigid R₀, m and t₀: nominal kinematics leave more of the motion than 13 free numbers do, and a
//! wrong offset leaves much, also where the motion is slow.

use nalgebra::{
    Isometry3, Matrix3, Point3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3,
};

use crate::structural::registration;

/// Numbers of x in equation (1).
pub(super) const SIZE: usize = 13;
pub(super) type Regressors = SVector<f64, SIZE>;

/// Changes of R₀, t₀ and m.
const CHANGES: usize = 9;

/// R₀, m and t₀ for samples, and what their changes explain.
pub(super) struct Rigid {
    tracker_from_root: Isometry3<f64>,
    /// m: the marker's place on its link, m.
    marker: Vector3<f64>,
    /// R₀ (t + R m) + t₀ of each sample, m.
    places: Vec<Vector3<f64>>,
    /// ∂place/∂(turn of R₀, t₀, m) of each sample.
    columns: Vec<SMatrix<f64, 3, CHANGES>>,
    inverse: SMatrix<f64, CHANGES, CHANGES>,
}

impl Rigid {
    /// `None` where the samples leave them open.
    pub(super) fn new(x: &[Regressors], y: &[Vector3<f64>]) -> Option<Self> {
        let links: Vec<Isometry3<f64>> = x.iter().map(pose_of).collect();
        let rows = links.iter().zip(y);
        let rows = rows.map(|(link, y)| (*link, Point3::from(*y))).collect();
        let tracker_from_root = registration(&[rows], &Isometry3::identity())?.tracker_from_root;
        let in_link = links.iter().zip(y);
        let in_link = in_link
            .map(|(link, y)| (tracker_from_root * link).inverse_transform_point(&(*y).into()));
        let marker = in_link.map(|p| p.coords).sum::<Vector3<f64>>() / y.len().max(1) as f64;
        let rotation = tracker_from_root.rotation.to_rotation_matrix().into_inner();
        let mut places = Vec::with_capacity(y.len());
        let mut columns = Vec::with_capacity(y.len());
        let mut normal = SMatrix::<f64, CHANGES, CHANGES>::zeros();
        for link in &links {
            let arm = rotation * (link * Point3::from(marker)).coords;
            let turned = rotation * link.rotation.to_rotation_matrix().into_inner();
            let mut column = SMatrix::<f64, 3, CHANGES>::zeros();
            column
                .fixed_columns_mut::<3>(0)
                .copy_from(&-arm.cross_matrix());
            column
                .fixed_columns_mut::<3>(3)
                .copy_from(&Matrix3::identity());
            column.fixed_columns_mut::<3>(6).copy_from(&turned);
            normal += column.tr_mul(&column);
            places.push(arm + tracker_from_root.translation.vector);
            columns.push(column);
        }
        let inverse = ridged_inverse(&normal)?;
        Some(Self {
            tracker_from_root,
            marker,
            places,
            columns,
            inverse,
        })
    }

    /// A of equation (1).
    pub(super) fn a(&self) -> SMatrix<f64, 3, SIZE> {
        let rotation = self.tracker_from_root.rotation.to_rotation_matrix();
        let rotation = rotation.matrix();
        let mut a = SMatrix::<f64, 3, SIZE>::zeros();
        a.set_column(0, &self.tracker_from_root.translation.vector);
        a.fixed_columns_mut::<3>(1).copy_from(rotation);
        for k in 0..3 {
            let turned = rotation * self.marker[k];
            a.fixed_columns_mut::<3>(4 + 3 * k).copy_from(&turned);
        }
        a
    }

    /// What changes of R₀, t₀ and m leave of a column.
    pub(super) fn left(&self, column: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut right = SVector::<f64, CHANGES>::zeros();
        for (of, y) in self.columns.iter().zip(column) {
            right += of.tr_mul(y);
        }
        let change = self.inverse * right;
        let rows = self.columns.iter().zip(column);
        rows.map(|(of, y)| y - of * change).collect()
    }

    /// What rigid R₀, m and t₀ leave of the places that were seen.
    pub(super) fn residuals(&self, y: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let off: Vec<Vector3<f64>> = y.iter().zip(&self.places).map(|(y, p)| y - p).collect();
        self.left(&off)
    }
}

/// Offsets, s, with the share of the squared motion that rigid R₀, m and t₀ leave at each, best first. `common` gives the samples at an offset.
pub(super) fn as_rigid(
    offsets: &[(f64, f64)],
    common: impl Fn(f64) -> (Vec<Regressors>, Vec<Vector3<f64>>),
) -> Vec<(f64, f64)> {
    let left = |offset: f64| {
        let (x, y) = common(offset);
        let squares = |of: &[Vector3<f64>]| of.iter().map(Vector3::norm_squared).sum::<f64>();
        let total = squares(&about_mean(&y));
        let left = squares(&Rigid::new(&x, &y)?.residuals(&y));
        (total > 0.0).then(|| left / total)
    };
    let all = offsets.iter();
    let mut all: Vec<(f64, f64)> = all
        .map(|(offset, _)| (*offset, left(*offset).unwrap_or(1.0)))
        .collect();
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    all
}

/// Inverse of normal equations whose columns may depend on each other, as motions of few joints leave them.
pub(super) fn ridged_inverse<const N: usize>(
    normal: &SMatrix<f64, N, N>,
) -> Option<SMatrix<f64, N, N>> {
    /// Added to the diagonal of scaled columns.
    const RIDGE: f64 = 1e-9;
    let scale = normal
        .diagonal()
        .map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scale = SMatrix::<f64, N, N>::from_diagonal(&scale);
    let ridge = SMatrix::<f64, N, N>::identity() * RIDGE;
    let inverse = (scale * normal * scale + ridge).try_inverse()?;
    Some(scale * inverse * scale)
}

/// The pose whose numbers are x of equation (1).
fn pose_of(x: &Regressors) -> Isometry3<f64> {
    let rotation = Matrix3::from_column_slice(&x.as_slice()[4..]);
    Isometry3::from_parts(
        Translation3::new(x[1], x[2], x[3]),
        UnitQuaternion::from_matrix(&rotation),
    )
}

pub(super) fn about_mean(y: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mean = y.iter().sum::<Vector3<f64>>() / y.len().max(1) as f64;
    y.iter().map(|y| y - mean).collect()
}
