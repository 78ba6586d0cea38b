//! The URDF that predicts best alone: equation (2) of the crate, by Gauss–Newton steps.
//!
//! ```text
//! r(q) = [l ω; v] of tool_urdf(q)⁻¹ tool_model(q),   ∂tool/∂origin_i = Ad(joint_i_from_tool⁻¹)                    (1)
//! (Σ JᵀJ + n ρ² 1) δ = Σ Jᵀr,   origin_i ← origin_i · exp(δ_i)
//! ```
//!
//! Rotations of neighboring origins about one axis move the tool alike: the ridge ρ shares such motions out.

use calib_model::file::RobotModelFile;
use calib_model::{LinkId, ModelError, Pose};
use nalgebra::{Cholesky, DMatrix, DVector, Isometry3, Vector6};

use crate::geometric::{evaluated, isometry, pose};

/// l of equation (1), m: a rotation of the tool counts as the motion of a point as far away.
const LEVER: f64 = 0.1;
/// ρ of equation (1): a correction of 1 cm (0.1 rad) costs as little as 10 µm at the tool.
pub(crate) const RIDGE: f64 = 1e-4;
/// The residuals are nearly linear in corrections of millimeters: the third step is below rounding.
pub(crate) const STEPS: usize = 4;

/// The file with origins of the chain to a link refitted to where the tool should be at postures.
pub(crate) fn refitted(
    file: &RobotModelFile,
    link: LinkId,
    postures: &[Vec<f64>],
    wanted: &[Pose],
) -> Result<RobotModelFile, ModelError> {
    let mut file = file.clone();
    let chain = chain(&file, link);
    for _ in 0..STEPS {
        let model = evaluated(&file)?;
        let n = 6 * chain.len();
        let mut normal = DMatrix::identity(n, n) * (postures.len() as f64 * RIDGE * RIDGE);
        let mut right = DVector::zeros(n);
        let mut work = model.work();
        for (q, wanted) in postures.iter().zip(wanted) {
            model.forward(q, &calib_model::Under::default(), &mut work)?;
            let tool = work.root_from_link(link);
            let residual = weighed(&twist(&tool.inverse().then(wanted)));
            let mut rows = DMatrix::zeros(6, n);
            for (k, &i) in chain.iter().enumerate() {
                let joint = &file.joints[i];
                let parent = work.root_from_link(model.link(&joint.parent)?);
                let origin = Pose::of(&isometry(&joint.parent_from_joint));
                let joint_from_tool = parent.then(&origin).inverse().then(&tool);
                for c in 0..6 {
                    let column = joint_from_tool.pull_back(&Vector6::ith(c, 1.0));
                    rows.set_column(6 * k + c, &weighed(&column));
                }
            }
            normal += rows.tr_mul(&rows);
            right += rows.tr_mul(&residual);
        }
        let Some(factor) = Cholesky::new(normal) else {
            break;
        };
        let step = factor.solve(&right);
        for (k, &i) in chain.iter().enumerate() {
            let d = step.rows(6 * k, 6);
            let moved = Isometry3::new(
                nalgebra::Vector3::new(d[3], d[4], d[5]),
                nalgebra::Vector3::new(d[0], d[1], d[2]),
            );
            let joint = &mut file.joints[i];
            joint.parent_from_joint = pose(&(isometry(&joint.parent_from_joint) * moved));
        }
    }
    Ok(file)
}

/// Joints that lead to a link, root first.
pub(crate) fn chain(file: &RobotModelFile, link: LinkId) -> Vec<usize> {
    let mut chain = Vec::new();
    // Link 0 is the root, link i + 1 the child of joint i.
    let mut at = link.index();
    while let Some(i) = at.checked_sub(1) {
        chain.push(i);
        let parent = &file.joints[i].parent;
        let above = file.joints.iter().position(|j| j.child == *parent);
        at = above.map_or(0, |j| j + 1);
    }
    chain.reverse();
    chain
}

pub(crate) fn weighed(twist: &Vector6<f64>) -> Vector6<f64> {
    let mut out = *twist;
    out.fixed_rows_mut::<3>(0).scale_mut(LEVER);
    out
}

/// [ω; v] of a small motion.
pub(crate) fn twist(of: &Pose) -> Vector6<f64> {
    let omega = of.isometry().rotation.scaled_axis();
    Vector6::new(omega.x, omega.y, omega.z, of.t.x, of.t.y, of.t.z)
}
