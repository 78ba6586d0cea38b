//! What successive samples share, seen in the shares that they have of one sum.
//!
//! ```text
//! K = Σ_s u_s u_sᵀ,   m = tr(K⁻¹ Σ_b U_b U_bᵀ) / (r (1 − 1/n)),   U_b = Σ_{s∈b} u_s                  (1)
//! ```
//!
//! Of samples with independent errors n blocks have the same variance as the samples, m = 1. A tracker with a memory, joints that stop off their
//! readings while several rows are taken and motions that the model does not follow give neighbors errors of the same sign: their sum then scatters m times
//! as much as K says (block bootstrap: Künsch 1989).

use calib_geometry::decompose::inverse_root;
use nalgebra::{DMatrix, DVector};

/// Blocks that the samples are cut into: more show their variance better, fewer a longer memory.
const BLOCKS: [usize; 2] = [48, 24];
/// Samples in a block, at least.
const LEAST: usize = 2;

/// Whether m, which has so many degrees of freedom, is more than chance makes it: 3 of its standard deviations above 1.
pub(crate) fn is_shown(m: f64, freedom: f64) -> bool {
    m > 1.0 + 3.0 * (2.0 / freedom).sqrt()
}

/// K of equation (1) times m, where that shows more than chance.
pub(crate) fn clustered(shares: &[DVector<f64>], r: usize) -> DMatrix<f64> {
    let mut k = DMatrix::zeros(r, r);
    for share in shares {
        k.ger(1.0, share, share, 1.0);
    }
    let memory = memory(shares, &k);
    k * memory
}

/// m of equation (1) at the count of blocks that shows most; 1 where none shows more than chance.
fn memory(shares: &[DVector<f64>], k: &DMatrix<f64>) -> f64 {
    let rank = k.nrows() as f64;
    let Some(root) = inverse_root(k) else {
        return 1.0;
    };
    let of = |blocks: usize| {
        if shares.len() < LEAST * blocks {
            return None;
        }
        let start = |block: usize| block * shares.len() / blocks;
        let energy = |block: usize| {
            let own = shares[start(block)..start(block + 1)].iter();
            let sum = own.fold(DVector::zeros(k.nrows()), |sum, share| sum + share);
            root.root.tr_mul(&sum).norm_squared()
        };
        let n = blocks as f64;
        let m = (0..blocks).map(energy).sum::<f64>() / (rank * (1.0 - 1.0 / n));
        is_shown(m, rank * n).then_some(m)
    };
    BLOCKS.into_iter().filter_map(of).fold(1.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Shares of an autoregression of first order.
    fn shares(seed: u64, count: usize, rho: f64) -> Vec<DVector<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut last = DVector::zeros(2);
        let next = |_| {
            let new = DVector::from_fn(2, |_, _| StandardNormal.sample(&mut rng));
            last = &last * rho + new * f64::sqrt(1.0 - rho * rho);
            last.clone()
        };
        (0..count).map(next).collect()
    }

    /// K over that without memory.
    fn ratio(shares: &[DVector<f64>]) -> f64 {
        let plain: f64 = shares.iter().map(DVector::norm_squared).sum();
        clustered(shares, 2).trace() / plain
    }

    #[test]
    fn independent_samples_show_no_memory() {
        let shown = (0..200).filter(|&seed| ratio(&shares(seed, 600, 0.0)) > 1.001);
        // 3 σ of a χ² of 48 and 96 degrees, of two counts: about 1 %.
        let shown = shown.count();
        assert!(shown <= 7, "{shown}");
        let few = (0..50).map(|seed| ratio(&shares(seed, 47, 0.9)));
        assert!(
            few.into_iter().all(|ratio| ratio < 1.001),
            "too few to be cut"
        );
    }

    /// (1 + ρ) / (1 − ρ) = 9 for ρ = 0.8 over long blocks; the shorter of 1200 samples have 25 and show less.
    #[test]
    fn a_memory_is_found_at_its_size() {
        let all = (0..40).map(|seed| ratio(&shares(seed, 1200, 0.8)));
        let mean = all.sum::<f64>() / 40.0;
        assert!((7.0..11.0).contains(&mean), "{mean}");
    }
}
