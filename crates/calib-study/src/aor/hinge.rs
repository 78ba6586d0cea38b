//! Four markers of a rigid body on a hinge: what each method makes of them, down to short arcs.

use calib_aor::{Input, Options, bounds};
use nalgebra::{DMatrix, Matrix3, Point3, Vector3};

use calib_plugin::{Aor, Shape};

use super::method::{Method, POINT, axis, method, plugin_rows, record, taking, truth, turned};
use crate::{
    cell::Scene,
    experiment::Experiment,
    linear::{Linear, linear},
    motion::steps,
    noise::Noise,
    tally::{Row, Tally},
    tried::{Tool, Tried, motion},
};

const MARKERS: usize = 4;

pub(crate) struct HingeScene {
    scene: Scene,
    angles: Vec<f64>,
    /// Markers at angle 0, relative to the axis's point.
    places: Vec<Vector3<f64>>,
    /// Efficient linear estimators of the tilt, of noise turned back to angle 0: angles unknown, and known.
    free: Option<Linear>,
    encoded: Option<Linear>,
    methods: Vec<Method>,
    plugins: Vec<(Tool<dyn Aor>, Shape)>,
    rows: Vec<Row>,
}

impl HingeScene {
    pub fn new(scene: Scene, arc: f64, tried: &Tried) -> Self {
        let angles: Vec<f64> = steps(0.0, arc, scene.samples).collect();
        let places = layout(scene.radius_m);
        let at = |p: &Vector3<f64>| Point3::from(POINT + p);
        let tracks: Vec<Vec<Point3<f64>>> = places
            .iter()
            .map(|p| angles.iter().map(|a| at(&(turned(*a) * p))).collect())
            .collect();
        let resting: Vec<Point3<f64>> = places.iter().map(at).collect();
        let sigma = scene.sigma_t_m;
        let spheres = bounds::common_line(&tracks, &truth(), sigma);
        let bundle = |known| bounds::hinge(&resting, &truth(), &angles, known, sigma);
        let encoder = Options {
            angles: angles.clone(),
            ..Options::default()
        };
        let plain = Options::default;
        let free = rigid(&angles, &places, false);
        let encoded = rigid(&angles, &places, true);
        let control = |of: &Option<Linear>| of.as_ref().map(|l| l.trace * sigma * sigma);
        let (unknown, known) = (control(&free), control(&encoded));
        let plugins = taking(tried, &[Shape::Markers, Shape::Points]);
        let of_plugins = plugins.iter().map(|(tool, shape)| {
            let rigid = *shape == Shape::Markers;
            let bound = if rigid { bundle(false) } else { spheres };
            plugin_rows(tool, (bound, unknown))
        });
        let of_plugins: Vec<[Row; 2]> = of_plugins.collect();
        let (methods, mut rows): (Vec<Method>, Vec<[Row; 2]>) = [
            method(
                "hinge_bundle",
                "hinge_bundle",
                plain(),
                1,
                (bundle(false), unknown),
            ),
            method(
                "hinge_bundle, encoder",
                "hinge_bundle",
                encoder,
                1,
                (bundle(true), known),
            ),
            method("line_ml", "line_ml", plain(), 5, (spheres, unknown)),
            method("dir_ml", "dir_ml", plain(), 5, (spheres, unknown)),
            method("plane", "plane", plain(), 5, (spheres, unknown)),
            method(
                "halvorsen_line",
                "halvorsen_line",
                plain(),
                5,
                (spheres, unknown),
            ),
        ]
        .into_iter()
        .flatten()
        .unzip();
        rows.extend(of_plugins);
        Self {
            scene: Scene {
                condition: format!("{MARKERS} markers"),
                ..scene
            },
            angles,
            places,
            free,
            encoded,
            methods,
            plugins,
            rows: rows.into_iter().flatten().collect(),
        }
    }
}

/// Markers spread around the axis, near the radius, at different heights.
fn layout(radius: f64) -> Vec<Vector3<f64>> {
    let n = axis().into_inner();
    let e1 = n.cross(&Vector3::x()).normalize();
    let e2 = n.cross(&e1);
    (0..MARKERS)
        .map(|p| {
            let p = p as f64;
            let r = radius * (1.0 + 0.15 * (1.7 * p).sin());
            let height = 0.3 * radius * (2.3 * p).cos();
            (e1 * (0.6 * p).cos() + e2 * (0.6 * p).sin()) * r + n * height
        })
        .collect()
}

/// Two directions across the axis.
fn across() -> [Vector3<f64>; 2] {
    let n = axis().into_inner();
    let e1 = n.cross(&Vector3::x()).normalize();
    [e1, n.cross(&e1)]
}

/// Unknowns `[tilt (2); shift across (2); places]`; each frame's own is the joint angle. Turned back to angle 0:
///
/// ```text
/// R_iᵀ dv_ip = (R_iᵀ ω) × p + R_iᵀ s + dp + (n × p) dθ_i
/// ```
fn rigid(angles: &[f64], places: &[Vector3<f64>], angles_known: bool) -> Option<Linear> {
    let rows = 3 * places.len();
    let n = axis().into_inner();
    let mut own = DMatrix::zeros(rows, 1);
    for (p, place) in places.iter().enumerate() {
        own.fixed_view_mut::<3, 1>(3 * p, 0)
            .copy_from(&n.cross(place));
    }
    let jacobians: Vec<DMatrix<f64>> = angles
        .iter()
        .map(|angle| {
            let back = turned(*angle).inverse();
            let mut j = DMatrix::zeros(rows, 4 + rows);
            for (p, place) in places.iter().enumerate() {
                for (k, e) in across().into_iter().enumerate() {
                    let e = back * e;
                    j.fixed_view_mut::<3, 1>(3 * p, k)
                        .copy_from(&e.cross(place));
                    j.fixed_view_mut::<3, 1>(3 * p, 2 + k).copy_from(&e);
                }
                j.fixed_view_mut::<3, 3>(3 * p, 4 + 3 * p)
                    .copy_from(&Matrix3::identity());
            }
            j
        })
        .collect();
    let own = (!angles_known).then_some(&own);
    linear(&jacobians, own, true, 2)
}

impl Experiment for HingeScene {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn rows(&self) -> &[Row] {
        &self.rows
    }

    fn trial(&self, number: u64, noise: &mut Noise, tallies: &mut [Tally]) {
        if self.methods.iter().all(|m| !number.is_multiple_of(m.every)) {
            return;
        }
        let mut tracks: Vec<Vec<Option<Point3<f64>>>> = vec![Vec::new(); MARKERS];
        let (mut unknown, mut known) = (Vector3::zeros(), Vector3::zeros());
        for (i, angle) in self.angles.iter().enumerate() {
            let turn = turned(*angle);
            for (p, (place, track)) in self.places.iter().zip(&mut tracks).enumerate() {
                let epsilon = noise.vector(self.scene.sigma_t_m);
                track.push(Some(Point3::from(POINT + turn * place + epsilon)));
                let back = turn.inverse() * epsilon;
                for (sum, of) in [(&mut unknown, &self.free), (&mut known, &self.encoded)] {
                    if let Some(of) = of {
                        let [e1, e2] = across();
                        let tilt = of.gains[i].fixed_view::<2, 3>(0, 3 * p) * back;
                        *sum += e1 * tilt.x + e2 * tilt.y;
                    }
                }
            }
        }
        for (method, pair) in self.methods.iter().zip(tallies.chunks_mut(2)) {
            let linear = if method.options.angles.is_empty() {
                unknown
            } else {
                known
            };
            method.record(&Input::Markers(&tracks), Some(linear), pair);
        }
        let pairs = tallies[2 * self.methods.len()..].chunks_mut(2);
        for ((tool, shape), pair) in self.plugins.iter().zip(pairs) {
            record(tool, &motion(*shape, &tracks, &[]), Some(unknown), pair);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two derivations of one bound.
    #[test]
    fn the_linear_estimator_has_the_bound() {
        let angles: Vec<f64> = steps(0.0, 60.0, 10).collect();
        let places = layout(0.1);
        let resting: Vec<Point3<f64>> = places.iter().map(|p| Point3::from(POINT + p)).collect();
        for known in [false, true] {
            let ours = rigid(&angles, &places, known).expect("determined").trace;
            let theirs = bounds::hinge(&resting, &truth(), &angles, known, 1.0).expect("a bound");
            let theirs = theirs.fixed_view::<3, 3>(0, 0).trace();
            assert!(
                (ours / theirs - 1.0).abs() < 1e-7,
                "{known}: {ours} {theirs}"
            );
        }
    }
}
