//! What changes from pose to pose and passes for noise: lengths of two scales, and a body, tracker or base that was moved between two rows.
//!
//! ```text
//! Λ = (f − p/2) ( ln(Σe²/Σe'²) + ln(Σθ²/Σθ'²) )  ~  χ²(p),   f = 3n − 6                         (8)
//! ```
//!
//! Each is fitted beside X and Z: one factor on the measured positions, or a second X or Z from some row on, for every row. The best is
//! judged by (8), times the number that was tried. One that lowers a residual by [`SHOWN`] and leaves noise is an explanation; another one
//! adds what it does to X and Z to their covariance.

use calib_estimator::chance::chi2_tail;
use nalgebra::{Isometry3, SMatrix, SVector, Translation3, Vector6};

use crate::{
    correction::{Correction, Explanation},
    gross,
    minimum::{Minimum, minimized},
    outcome::{Covariance, HandEye},
    problem::{Weights, linearize, moved},
    residuals::{Residuals, squares},
    simulated::difference,
};

/// Ratio of residuals from which an effect can be an explanation, and not only a part of the uncertainty.
const SHOWN: f64 = 1.3;
/// Ratio from which it is one whatever it leaves.
const FAR: f64 = 3.0;
/// A move is at one row: this many rows beside it, it explains less by [`STEP`] squares of what noise is left. Errors of 2 % in the length of an arm,
/// along 24 paths, reached 39; moves by 8 mm at 0.5 mm of noise began at 330.
const APART: usize = 2;
const STEP: f64 = 40.0;
/// Chance of a further effect below which what is left is no noise.
const LEFT: f64 = 0.01;
/// Poses on either side of a move: three determine a transform, one more judges it.
const SIDE: usize = 4;
/// Fewest poses that are judged.
const FEWEST: usize = 2 * SIDE;
/// Poses that were lost as gross errors and that a move must bring back: three times six numbers are explained by six.
const BROUGHT_BACK: usize = 3;
/// Rounds of Gauss–Newton: the start is a linear step away.
const ROUNDS: usize = 20;
/// Residuals, m and rad, below which data count as exact.
const EXACT: f64 = 1e-9;

/// Which of the two transforms is another one from some row on.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    X,
    Z,
}

/// An effect with the fit beside it.
struct Effect {
    correction: Correction,
    /// Measured poses without it.
    measured: Vec<Isometry3<f64>>,
    /// X and Z beside it: those of the rows before a move, and those after it.
    fits: Vec<Minimum>,
    parameters: f64,
    /// By how much a move [`APART`] rows or more beside its own explains less, in squares of the residuals' σ before it; infinite for a factor.
    lost_beside: f64,
}

/// What the residuals say beyond noise.
pub(crate) struct Unmodelled {
    /// Large enough to be named.
    pub explanation: Option<Explanation>,
    /// What a small effect adds to the covariance.
    pub covariance: Covariance,
}

/// Judges the rows that were `kept` of both tables; `judged` is their fit. What is left must be `plausible`.
pub(crate) fn unmodelled(
    tables: [&[Isometry3<f64>]; 2],
    kept: &[usize],
    judged: &HandEye,
    significance: f64,
    plausible: impl Fn(&Residuals) -> bool,
) -> Unmodelled {
    let mut out = Unmodelled {
        explanation: None,
        covariance: Covariance::zeros(),
    };
    let [sigma_t, sigma_r] =
        [judged.rms_translation, judged.rms_rotation].map(|rms| rms / 3f64.sqrt());
    if kept.len() < FEWEST || sigma_t < EXACT || sigma_r < EXACT {
        return out;
    }
    let w = Weights {
        rotation: 0.5 / (sigma_r * sigma_r),
        translation: 1.0 / (sigma_t * sigma_t),
    };
    if tables[0].len() >= kept.len() + BROUGHT_BACK {
        out.explanation = brought_back(tables, kept, w).filter(|e| plausible(&e.after));
        if out.explanation.is_some() {
            return out;
        }
    }
    let [a, b] = tables.map(|poses| chosen(poses, kept));
    let none = minimized(&a, &b, w);
    let Some((best, p)) = largest(&a, &b, &none, w) else {
        return out;
    };
    if p >= significance {
        return out;
    }
    let [before, after] = [sums(&a, &b, &none), sums(&a, &best.measured, &best.fits[0])];
    let correction = match best.correction {
        Correction::BodyMoved(row) => Correction::BodyMoved(kept[row]),
        Correction::TrackerMoved(row) => Correction::TrackerMoved(kept[row]),
        other => other,
    };
    let explanation = explained(correction, [before, after], [a.len(); 2]);
    if stands_out(&a, &best, [before, after], w) && plausible(&explanation.after) {
        out.explanation = Some(explanation);
        return out;
    }
    for fit in &best.fits {
        let by = difference(&none, fit);
        out.covariance += by * by.transpose();
    }
    out
}

/// The effect that chance explains least, with its chance (8), times the number that was tried.
fn largest(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    none: &Minimum,
    w: Weights,
) -> Option<(Effect, f64)> {
    let before = sums(a, b, none);
    let splits = moves(a, b, none, w);
    let tried = 1.0 + splits.tried as f64;
    let moved = splits.best.map(|(part, row)| Effect {
        lost_beside: splits.lost_beside,
        ..moved_from(a, b, none, w, part, row)
    });
    let chance = |e: &Effect| {
        let freedom = 3.0 * a.len() as f64 - 6.0 - 0.5 * e.parameters;
        let after = sums(a, &e.measured, &e.fits[0]);
        let ratio = (before[0] / after[0]).ln() + (before[1] / after[1]).ln();
        tried * chi2_tail(freedom * ratio, e.parameters)
    };
    let effects = std::iter::once(scale(a, b, none, w)).chain(moved);
    let judged = effects.map(|e| {
        let p = chance(&e);
        (e, p)
    });
    judged.min_by(|x, y| x.1.total_cmp(&y.1))
}

/// Whether an effect is what it is called: it lowers a residual by [`SHOWN`], a move is at one row and not about it, and what is left is noise. Errors of the
/// robot's own geometry change along ordered poses as well, but little by little, and leave as much of their kind; only what is far larger than these is
/// named beside them.
fn stands_out(
    a: &[Isometry3<f64>],
    effect: &Effect,
    [before, after]: [[f64; 2]; 2],
    w: Weights,
) -> bool {
    let ratio = (0..2)
        .map(|k| (before[k] / after[k]).sqrt())
        .fold(0.0, f64::max);
    let left = || largest(a, &effect.measured, &effect.fits[0], w).map_or(1.0, |(_, p)| p);
    let is_a_step = effect.lost_beside * ratio * ratio >= STEP;
    is_a_step && (ratio >= FAR || (ratio >= SHOWN && left() >= LEFT))
}

fn explained(correction: Correction, sums: [[f64; 2]; 2], rows: [usize; 2]) -> Explanation {
    let [before, after] = [0, 1].map(|k| Residuals {
        rms_translation: (sums[k][0] / rows[k] as f64).sqrt(),
        rms_rotation: (sums[k][1] / rows[k] as f64).sqrt(),
    });
    Explanation {
        candidates: vec![vec![correction]],
        before,
        after,
    }
}

/// A move that makes good poses of those that were taken for gross errors.
fn brought_back([a, b]: [&[Isometry3<f64>]; 2], kept: &[usize], w: Weights) -> Option<Explanation> {
    let of_kept = minimized(&chosen(a, kept), &chosen(b, kept), w);
    let splits = moves(a, b, &of_kept, w);
    let (part, row) = splits.best?;
    let effect = Effect {
        lost_beside: splits.lost_beside,
        ..moved_from(a, b, &of_kept, w, part, row)
    };
    let keeps = gross::kept(a, &effect.measured, w);
    if keeps.len() < kept.len() + BROUGHT_BACK {
        return None;
    }
    let kept_of = |poses: &[Isometry3<f64>]| chosen(poses, &keeps);
    let corrected = Effect {
        measured: kept_of(&effect.measured),
        ..effect
    };
    let all = sums(a, b, &of_kept);
    let good = sums(&kept_of(a), &corrected.measured, &corrected.fits[0]);
    let mean = |sums: [f64; 2], rows: usize| sums.map(|sum| sum / rows as f64);
    let means = [mean(all, a.len()), mean(good, keeps.len())];
    stands_out(&kept_of(a), &corrected, means, w)
        .then(|| explained(corrected.correction, [all, good], [a.len(), keeps.len()]))
}

fn chosen(poses: &[Isometry3<f64>], rows: &[usize]) -> Vec<Isometry3<f64>> {
    rows.iter().map(|&i| poses[i]).collect()
}

/// Sums of the squares of positions and of angles.
fn sums(a: &[Isometry3<f64>], b: &[Isometry3<f64>], fit: &Minimum) -> [f64; 2] {
    let rows = a.iter().zip(b).map(|(a, b)| squares(a, b, &fit.x, &fit.z));
    rows.fold([0.0; 2], |sum, s| [sum[0] + s[0], sum[1] + s[1]])
}

/// A factor on the measured positions beside X and Z.
fn scale(a: &[Isometry3<f64>], b: &[Isometry3<f64>], none: &Minimum, w: Weights) -> Effect {
    let by = |factor: f64| -> Vec<Isometry3<f64>> {
        let scaled = |p: &Isometry3<f64>| {
            Isometry3::from_parts(
                Translation3::from(p.translation.vector * factor),
                p.rotation,
            )
        };
        b.iter().map(scaled).collect()
    };
    let (mut factor, mut fit) = (1.0, *none);
    for _ in 0..ROUNDS {
        let measured = by(factor);
        // One column more: d e / d ln k = −R_Z k t_B.
        let (h, g, _) = linearize(a, &measured, &fit.x, &fit.z, w);
        let mut full = SMatrix::<f64, 13, 13>::zeros();
        let mut right = SVector::<f64, 13>::zeros();
        full.fixed_view_mut::<12, 12>(0, 0).copy_from(&h);
        right.fixed_rows_mut::<12>(0).copy_from(&g);
        let none = Weights { rotation: 0.0, ..w };
        for (a, b) in a.iter().zip(&measured) {
            // By the system of a row, in which d e / d v_z = −R_Z.
            let (row, gradient, _) = linearize(
                std::slice::from_ref(a),
                std::slice::from_ref(b),
                &fit.x,
                &fit.z,
                none,
            );
            let t = b.translation.vector;
            let column = row.fixed_view::<12, 3>(0, 9) * t;
            for k in 0..12 {
                full[(k, 12)] += column[k];
                full[(12, k)] += column[k];
            }
            full[(12, 12)] += w.translation * t.norm_squared();
            right[12] += gradient.fixed_rows::<3>(9).dot(&t);
        }
        let Some(step) = nalgebra::Cholesky::new(full).map(|c| -c.solve(&right)) else {
            break;
        };
        factor *= 1.0 + step[12].clamp(-0.5, 0.5);
        fit.x = moved(&fit.x, &step.fixed_rows::<6>(0).into_owned());
        fit.z = moved(&fit.z, &step.fixed_rows::<6>(6).into_owned());
        if step[12].abs() < 1e-12 {
            break;
        }
    }
    Effect {
        correction: Correction::Scaled(factor),
        measured: by(factor),
        fits: vec![fit],
        parameters: 1.0,
        lost_beside: f64::INFINITY,
    }
}

/// The best row of a move, and how many were tried.
struct Moves {
    best: Option<(Part, usize)>,
    /// As [`Effect::lost_beside`].
    lost_beside: f64,
    tried: usize,
}

/// The move that lowers the linear cost most. The columns of a second X (or Z) are those of the first, in the rows from it on.
fn moves(a: &[Isometry3<f64>], b: &[Isometry3<f64>], fit: &Minimum, w: Weights) -> Moves {
    let n = a.len();
    let (all, gradient, _) = linearize(a, b, &fit.x, &fit.z, w);
    let (mut h, mut g) = (SMatrix::<f64, 12, 12>::zeros(), SVector::<f64, 12>::zeros());
    let mut all_of: Vec<(f64, Part, usize)> = Vec::new();
    for row in (SIDE..n).rev() {
        let (of_row, of_gradient, _) = linearize(&a[row..=row], &b[row..=row], &fit.x, &fit.z, w);
        h += of_row;
        g += of_gradient;
        if n - row < SIDE {
            continue;
        }
        for (part, at) in [(Part::X, 0), (Part::Z, 6)] {
            let mut full = SMatrix::<f64, 18, 18>::zeros();
            let mut right = SVector::<f64, 18>::zeros();
            full.fixed_view_mut::<12, 12>(0, 0).copy_from(&all);
            full.fixed_view_mut::<12, 6>(0, 12)
                .copy_from(&h.fixed_columns::<6>(at));
            full.fixed_view_mut::<6, 12>(12, 0)
                .copy_from(&h.fixed_rows::<6>(at));
            full.fixed_view_mut::<6, 6>(12, 12)
                .copy_from(&h.fixed_view::<6, 6>(at, at));
            right.fixed_rows_mut::<12>(0).copy_from(&gradient);
            right
                .fixed_rows_mut::<6>(12)
                .copy_from(&g.fixed_rows::<6>(at));
            let Some(decrease) = nalgebra::Cholesky::new(full).map(|c| right.dot(&c.solve(&right)))
            else {
                continue;
            };
            all_of.push((decrease, part, row));
        }
    }
    let best = all_of.iter().copied().max_by(|x, y| x.0.total_cmp(&y.0));
    let lost_beside = best.map_or(0.0, |(most, part, row)| {
        let apart = |other: &&(f64, Part, usize)| other.1 == part && other.2.abs_diff(row) >= APART;
        let others = all_of.iter().filter(apart).map(|other| other.0);
        most - others.fold(0.0, f64::max)
    });
    Moves {
        best: best.map(|(_, part, row)| (part, row)),
        lost_beside,
        tried: all_of.len(),
    }
}

/// X (or Z) of the rows before `row` and of those from it on, beside one Z (or X).
fn moved_from(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    start: &Minimum,
    w: Weights,
    part: Part,
    row: usize,
) -> Effect {
    let mut fits = [*start; 2];
    let at = |part: Part| match part {
        Part::X => 0,
        Part::Z => 6,
    };
    let (own, common) = (at(part), 6 - at(part));
    for _ in 0..ROUNDS {
        let mut full = SMatrix::<f64, 18, 18>::zeros();
        let mut right = SVector::<f64, 18>::zeros();
        for (k, rows) in [0..row, row..a.len()].into_iter().enumerate() {
            let (h, g, _) = linearize(&a[rows.clone()], &b[rows], &fits[k].x, &fits[k].z, w);
            // [common; own of the rows before; own of those after]
            for (i, from) in [(0, common), (6 + 6 * k, own)] {
                for (j, to) in [(0, common), (6 + 6 * k, own)] {
                    let mut block = full.fixed_view_mut::<6, 6>(i, j);
                    block += h.fixed_view::<6, 6>(from, to);
                }
                let mut block = right.fixed_rows_mut::<6>(i);
                block += g.fixed_rows::<6>(from);
            }
        }
        let Some(step) = nalgebra::Cholesky::new(full).map(|c| -c.solve(&right)) else {
            break;
        };
        let shared: Vector6<f64> = step.fixed_rows::<6>(0).into_owned();
        for (k, fit) in fits.iter_mut().enumerate() {
            let own: Vector6<f64> = step.fixed_rows::<6>(6 + 6 * k).into_owned();
            let (x, z) = match part {
                Part::X => (own, shared),
                Part::Z => (shared, own),
            };
            (fit.x, fit.z) = (moved(&fit.x, &x), moved(&fit.z, &z));
        }
        if step.amax() < 1e-12 {
            break;
        }
    }
    // A X₂ = Z B → A X₁ = Z (B X₂⁻¹ X₁);   A X = Z₂ B → A X = Z₁ (Z₁⁻¹ Z₂ B)
    let back = match part {
        Part::X => fits[1].x.inverse() * fits[0].x,
        Part::Z => fits[0].z.inverse() * fits[1].z,
    };
    let measured = b.iter().enumerate().map(|(i, b)| match (i < row, part) {
        (true, _) => *b,
        (false, Part::X) => b * back,
        (false, Part::Z) => back * b,
    });
    Effect {
        correction: match part {
            Part::X => Correction::BodyMoved(row),
            Part::Z => Correction::TrackerMoved(row),
        },
        measured: measured.collect(),
        fits: fits.to_vec(),
        parameters: 6.0,
        lost_beside: 0.0,
    }
}
