//! Rotations of Jacobi: one-sided on the columns of a matrix, two-sided on a symmetric one.

/// Sweeps after which Jacobi has converged for every matrix met (typically 6–10); a bound, not a tuning.
const MAX_SWEEPS: usize = 60;

/// One-sided Jacobi (Hestenes) on an n × n column-major matrix `a`: on return `a` holds U, `v` V where it is wanted.
pub(super) fn one_sided_jacobi(a: &mut [f64], mut v: Option<&mut [f64]>, s: &mut [f64], n: usize) {
    // Scale to avoid overflow and underflow of the squared norms.
    let scale = a.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if scale == 0.0 || !scale.is_finite() {
        complete_basis(a, n, 0);
        s.fill(if scale == 0.0 { 0.0 } else { f64::NAN });
        return;
    }
    a.iter_mut().for_each(|x| *x /= scale);
    let threshold = f64::EPSILON;
    for _ in 0..MAX_SWEEPS {
        // Squared norms of the columns: kept up to date within a sweep, and new with each.
        for j in 0..n {
            let column = &a[j * n..(j + 1) * n];
            s[j] = dot(column, column);
        }
        let mut rotated = false;
        for p in 0..n {
            for q in p + 1..n {
                let product = s[p] * s[q];
                // Underflowing columns are zero columns.
                if product == 0.0 {
                    continue;
                }
                let (x, y) = pair(a, p, q, n);
                let gamma = dot(x, y);
                if gamma == 0.0 || gamma.abs() <= threshold * product.sqrt() {
                    continue;
                }
                rotated = true;
                let (t, c) = rotation((s[q] - s[p]) / (2.0 * gamma));
                rotate(x, y, c, c * t);
                (s[p], s[q]) = match 16.0 * t.abs() * gamma.abs() < s[p].min(s[q]) {
                    true => (s[p] - t * gamma, s[q] + t * gamma),
                    // What is left of a column after most of it went has too few digits as a difference.
                    false => (dot(x, x), dot(y, y)),
                };
                if let Some(v) = v.as_deref_mut() {
                    let (x, y) = pair(v, p, q, n);
                    rotate(x, y, c, c * t);
                }
            }
        }
        if !rotated {
            break;
        }
    }
    for j in 0..n {
        s[j] = (0..n)
            .map(|k| a[j * n + k] * a[j * n + k])
            .sum::<f64>()
            .sqrt();
    }
    sort_descending(a, v, s, n);
    let smallest_meaningful = s[0] * f64::EPSILON * n as f64;
    let mut independent = n;
    for j in 0..n {
        if s[j] <= smallest_meaningful {
            independent = j;
            break;
        }
        for k in 0..n {
            a[j * n + k] /= s[j];
        }
    }
    complete_basis(a, n, independent);
    s.iter_mut().for_each(|x| *x *= scale);
}

/// Columns `p < q` of an n × n column-major matrix.
#[inline]
fn pair(a: &mut [f64], p: usize, q: usize, n: usize) -> (&mut [f64], &mut [f64]) {
    let (before, from_q) = a.split_at_mut(q * n);
    (&mut before[p * n..(p + 1) * n], &mut from_q[..n])
}

/// `x'y` of two slices of one length, in four sums that run beside each other: one sum would wait for each of its additions.
#[inline]
#[must_use]
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    let (fours_x, rest_x) = x.as_chunks::<4>();
    let (fours_y, rest_y) = y.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (x, y) in fours_x.iter().zip(fours_y) {
        for i in 0..4 {
            sums[i] += x[i] * y[i];
        }
    }
    let rest: f64 = rest_x.iter().zip(rest_y).map(|(x, y)| x * y).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// Tangent and cosine of the rotation that makes two columns orthogonal, the smaller of the two angles, from the cotangent of twice the angle.
///
/// Square roots only, which every machine rounds alike.
#[inline]
fn rotation(cotangent: f64) -> (f64, f64) {
    let size = cotangent.abs();
    // Above 1e8 the root is `size` to the last digit, and its square might overflow.
    let root = if size < 1e8 {
        (size * size + 1.0).sqrt()
    } else {
        size
    };
    let t = cotangent.signum() / (size + root);
    (t, 1.0 / (t * t + 1.0).sqrt())
}

/// Columns x and y ← (c x − s y, s x + c y).
#[inline]
fn rotate(x: &mut [f64], y: &mut [f64], c: f64, s: f64) {
    for (x, y) in x.iter_mut().zip(y) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}

fn sort_descending(a: &mut [f64], mut v: Option<&mut [f64]>, s: &mut [f64], n: usize) {
    for i in 0..n {
        let largest = (i..n).fold(i, |best, j| if s[j] > s[best] { j } else { best });
        if largest != i {
            s.swap(i, largest);
            for k in 0..n {
                a.swap(i * n + k, largest * n + k);
                if let Some(v) = v.as_deref_mut() {
                    v.swap(i * n + k, largest * n + k);
                }
            }
        }
    }
}

/// Replaces columns `from..n` of `a` by unit vectors orthogonal to all others (Gram–Schmidt, twice).
fn complete_basis(a: &mut [f64], n: usize, from: usize) {
    // Squared norm of each axis in the span of the columns so far.
    let mut inside = vec![0.0; n];
    let add = |inside: &mut [f64], column: &[f64]| {
        inside
            .iter_mut()
            .zip(column)
            .for_each(|(sum, x)| *sum += x * x);
    };
    for column in a[..from * n].chunks_exact(n.max(1)) {
        add(&mut inside, column);
    }
    for j in from..n {
        let outmost = (0..n).fold(0, |best, axis| {
            if inside[axis] < inside[best] {
                axis
            } else {
                best
            }
        });
        let (done, rest) = a.split_at_mut(j * n);
        let own = &mut rest[..n];
        own.fill(0.0);
        own[outmost] = 1.0;
        for _ in 0..2 {
            for column in done.chunks_exact(n.max(1)) {
                let along = dot(column, own);
                own.iter_mut()
                    .zip(column)
                    .for_each(|(x, c)| *x -= along * c);
            }
            let norm = dot(own, own).sqrt();
            own.iter_mut().for_each(|x| *x /= norm);
        }
        add(&mut inside, own);
    }
}

/// Cyclic Jacobi on a symmetric column-major matrix; eigenvalues ascending into `values`.
pub(super) fn cyclic_jacobi(a: &mut [f64], v: &mut [f64], values: &mut [f64], n: usize) {
    // The lower triangle is authoritative.
    for j in 0..n {
        for i in 0..j {
            a[j * n + i] = a[i * n + j];
        }
    }
    for _ in 0..MAX_SWEEPS {
        let mut rotated = false;
        for p in 0..n {
            for q in p + 1..n {
                let off = a[p * n + q];
                let (app, aqq) = (a[p * n + p], a[q * n + q]);
                // Relative to both diagonal entries: keeps small eigenvalues of graded matrices.
                if off == 0.0 || off.abs() <= f64::EPSILON * 0.5 * (app * aqq).abs().sqrt() {
                    continue;
                }
                if off.abs() < f64::MIN_POSITIVE / f64::EPSILON {
                    continue;
                }
                rotated = true;
                let (t, c) = rotation((aqq - app) / (2.0 * off));
                let (x, y) = pair(a, p, q, n);
                rotate(x, y, c, c * t);
                // The rows are the columns of a symmetric matrix, but for the four entries where both meet.
                (x[p], x[q], y[p], y[q]) = (app - t * off, 0.0, 0.0, aqq + t * off);
                for k in 0..n {
                    (a[k * n + p], a[k * n + q]) = (a[p * n + k], a[q * n + k]);
                }
                let (x, y) = pair(v, p, q, n);
                rotate(x, y, c, c * t);
            }
        }
        if !rotated {
            break;
        }
    }
    for i in 0..n {
        values[i] = a[i * n + i];
    }
    for i in 0..n {
        let smallest = (i..n).fold(i, |best, j| if values[j] < values[best] { j } else { best });
        if smallest != i {
            values.swap(i, smallest);
            for k in 0..n {
                v.swap(i * n + k, smallest * n + k);
            }
        }
    }
}
