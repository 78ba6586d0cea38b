//! Smooth functions of the place in a measuring frame: equation (1) of [`by_place`](super::by_place).

use std::sync::Arc;

use nalgebra::{Matrix4, Vector3, Vector4};

use crate::graph::ids::FrameId;

/// Quadratic monomials of three coordinates.
pub(crate) const TERMS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// Smooth functions of the place: equation (1).
#[derive(Debug, Clone)]
pub(crate) struct Bends {
    frame: FrameId,
    middle: Vector3<f64>,
    /// 1, x, y, z of each function's part that is taken away.
    linear: [Vector4<f64>; 6],
    /// What each is multiplied by, 1/m²; 0 where the places do not show it.
    scale: [f64; 6],
}

/// One column of equation (1).
#[derive(Debug, Clone)]
pub(crate) struct Bend {
    of: Arc<Bends>,
    axis: usize,
    term: usize,
}

impl Bend {
    /// Displacement of what is measured from `frame` at a place, m per m.
    pub(crate) fn at(&self, frame: FrameId, place: &Vector3<f64>) -> Vector3<f64> {
        match frame == self.of.frame {
            true => Vector3::ith(self.axis, self.of.value(self.term, place)),
            false => Vector3::zeros(),
        }
    }
}

impl Bends {
    /// `None` where there are too few places.
    pub(crate) fn of(frame: FrameId, places: &[Vector3<f64>]) -> Option<Self> {
        let count = places.len() as f64;
        let middle = places.iter().sum::<Vector3<f64>>() / count;
        let mut moments = Matrix4::zeros();
        let mut products = [Vector4::zeros(); 6];
        for place in places {
            let p = place - middle;
            let linear = Vector4::new(1.0, p.x, p.y, p.z);
            moments += linear * linear.transpose();
            for (product, (i, j)) in products.iter_mut().zip(TERMS) {
                *product += linear * (p[i] * p[j]);
            }
        }
        let inverse = moments.pseudo_inverse(1e-9 * moments.trace()).ok()?;
        let mut out = Self {
            frame,
            middle,
            linear: products.map(|product| inverse * product),
            scale: [1.0; 6],
        };
        let rms = |term: usize| {
            let squares = places.iter().map(|place| out.value(term, place).powi(2));
            (squares.sum::<f64>() / count).sqrt()
        };
        let rms: [f64; 6] = std::array::from_fn(rms);
        let most = rms.iter().copied().fold(0.0, f64::max);
        out.scale = rms.map(|rms| if rms > 1e-3 * most { 1.0 / rms } else { 0.0 });
        (most > 0.0).then_some(out)
    }

    fn value(&self, term: usize, place: &Vector3<f64>) -> f64 {
        let p = place - self.middle;
        let (i, j) = TERMS[term];
        let taken = self.linear[term].dot(&Vector4::new(1.0, p.x, p.y, p.z));
        self.scale[term] * (p[i] * p[j] - taken)
    }

    /// The displacement along `axis` by one of the functions.
    pub(crate) fn along(of: &Arc<Self>, axis: usize, term: usize) -> Bend {
        let of = Arc::clone(of);
        Bend { of, axis, term }
    }
}
