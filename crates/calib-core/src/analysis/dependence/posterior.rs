//! What is known of the parameters under noise with a memory: by the data, and by the priors.
//!
//! The estimate takes the data for independent. In the basis of R, C = R Rᵀ, with Π = RᵀPR of the priors and J = I − Π of the data,
//!
//! ```text
//! b = J u + s,   cov s = S = κ (J + M),   u ~ N(0, Π⁻¹)                                            (4)
//! C₁ = (Π + J S⁻¹ J)⁻¹,   m = C₁ J S⁻¹ b,   û = b                                                (5)
//! E (û − u)(û − u)ᵀ = C₁ + (û − m)(û − m)ᵀ                                                        (6)
//! ```
//!
//! M is what the memory adds to the variance of the data's part of the gradient, κ the level of the noise, u the deviation from the means of the
//! priors. Without priors (6) is κ(I + M), equation (2). With them it says that no parameter is known worse than by its prior and by how far
//! the estimate went from what the data and the prior together say. Over all robots that a prior is of, (6) is (2) again.

use calib_geometry::decompose::{inverse_root, symmetric_eigen};
use nalgebra::{DMatrix, DVector};

/// A direction that the data see less than so (of 1) is one of the priors alone.
const UNSEEN: f64 = 1e-9;

/// (6) for Π, M, κ and û; `None` where something is not finite.
pub(super) fn posterior(
    priors: &DMatrix<f64>,
    more: &DMatrix<f64>,
    level: f64,
    estimate: &DVector<f64>,
) -> Option<DMatrix<f64>> {
    let n = priors.nrows();
    let eigen = symmetric_eigen(&((priors + priors.transpose()) * 0.5));
    let of_prior = eigen.values.map(|p| p.clamp(0.0, 1.0));
    let seen: Vec<usize> = (0..n).filter(|&i| 1.0 - of_prior[i] > UNSEEN).collect();
    let of_data = DVector::from_iterator(seen.len(), seen.iter().map(|&i| 1.0 - of_prior[i]));
    let seen_axes = eigen.vectors.select_columns(&seen);
    // S of the directions that the data see.
    let noise =
        (DMatrix::from_diagonal(&of_data) + seen_axes.transpose() * more * &seen_axes) * level;
    let known = inverse_root(&noise)?.inverse();
    // J S⁻¹
    let weight = DMatrix::from_fn(seen.len(), seen.len(), |i, j| of_data[i] * known[(i, j)]);
    let mut information = DMatrix::from_diagonal(&of_prior);
    for (a, &i) in seen.iter().enumerate() {
        for (b, &j) in seen.iter().enumerate() {
            information[(i, j)] += weight[(a, b)] * of_data[b];
        }
    }
    let c = inverse_root(&information)?.inverse();
    let along = eigen.vectors.transpose() * estimate;
    let pulled = &weight * along.select_rows(&seen);
    let mut gradient = DVector::zeros(n);
    for (a, &i) in seen.iter().enumerate() {
        gradient[i] = pulled[a];
    }
    let off = along - &c * gradient;
    let all = c + &off * off.transpose();
    let all = &eigen.vectors * all * eigen.vectors.transpose();
    all.iter().all(|x| x.is_finite()).then_some(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without priors it is the variance of the estimate; where the noise says nothing, the prior and how far the estimate went.
    #[test]
    fn data_and_priors_alone() {
        let (n, level) = (3, 1.7);
        let more = DMatrix::from_fn(n, n, |i, j| if i == j { 4.0 } else { 0.5 });
        let estimate = DVector::from_vec(vec![2.0, -1.0, 0.3]);
        let none = posterior(&DMatrix::zeros(n, n), &more, level, &estimate).expect("finite");
        let expected = (DMatrix::identity(n, n) + &more) * level;
        assert!((none - expected).amax() < 1e-9);
        // Half of what is known is the prior's: its variance is 2.
        let half = DMatrix::identity(n, n) * 0.5;
        let loud = posterior(&half, &(&more * 1e9), level, &estimate).expect("finite");
        let expected = DMatrix::identity(n, n) * 2.0 + &estimate * estimate.transpose();
        assert!((loud - expected).amax() < 1e-6);
    }

    /// Over estimates drawn from (4) the mean of (6) is equation (2).
    #[test]
    fn over_all_robots_it_is_the_variance_of_the_estimate() {
        let (n, level) = (2, 1.3);
        let priors = DMatrix::from_row_slice(n, n, &[0.3, 0.1, 0.1, 0.6]);
        let more = DMatrix::from_row_slice(n, n, &[2.0, 0.4, 0.4, 1.0]);
        let identity = DMatrix::<f64>::identity(n, n);
        let data = &identity - &priors;
        let noise = (&data + &more) * level;
        // cov û = J Π⁻¹ J + S; the mean of (û − m)(û − m)ᵀ is A cov û Aᵀ, and (6) is affine in û ûᵀ.
        let inverse = priors.clone().try_inverse().expect("positive");
        let spread = &data * inverse * &data + &noise;
        let root = spread.cholesky().expect("positive").l();
        let mean = (0..n).fold(DMatrix::zeros(n, n), |sum, i| {
            let draw = root.column(i) * (n as f64).sqrt();
            sum + posterior(&priors, &more, level, &draw.into_owned()).expect("finite") / n as f64
        });
        let expected = &priors + &noise;
        assert!((&mean - &expected).amax() < 1e-9, "{mean} {expected}");
    }
}
