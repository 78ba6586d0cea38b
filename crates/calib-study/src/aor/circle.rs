//! The paper's study of one axis: one body on one circle, positions only.
//!
//! ```text
//! x_i = m + ρ u_i + h n + ε_i;   S = Σ (u_i − ū)(u_i − ū)ᵀ, 2 × 2 across n                        (1)
//! center free:  δn* = −(1/ρ) S⁻¹ Σ (u_i − ū)(n·ε_i)         C = σ²/ρ² · S⁻¹                        (2)
//! center held:  C = σ²/(ρ² + h²) · S⁻¹       the radii tilt with the axis as the heights do          (3)
//! ```
//!
//! (2) is the control variate of both.

use calib_aor::{Input, Options, bounds};
use nalgebra::{Matrix2, Matrix6, Point3, Vector2, Vector3};

use calib_plugin::{Aor, Shape};

use super::method::{Method, POINT, arm, axis, method, plugin_rows, record, taking, truth, turned};
use crate::{
    cell::Scene,
    experiment::Experiment,
    motion::steps,
    noise::Noise,
    tally::{Row, Tally},
    tried::{Tool, Tried, motion},
};

pub(crate) struct CircleScene {
    scene: Scene,
    /// Positions relative to the axis's point.
    arms: Vec<Vector3<f64>>,
    /// Factors of n·ε_i in the tilt of (2).
    factors: Vec<Vector3<f64>>,
    methods: Vec<Method>,
    plugins: Vec<(Tool<dyn Aor>, Shape)>,
    rows: Vec<Row>,
}

impl CircleScene {
    pub fn new(scene: Scene, [from, to]: [f64; 2], tried: &Tried) -> Self {
        let n = axis().into_inner();
        let start = arm(scene.radius_m);
        let arms: Vec<Vector3<f64>> = steps(from, to, scene.samples)
            .map(|angle| turned(angle) * start)
            .collect();
        let height = start.dot(&n);
        let e1 = (start - n * height).normalize();
        let e2 = n.cross(&e1);
        let flat: Vec<Vector2<f64>> = arms
            .iter()
            .map(|a| Vector2::new(a.dot(&e1), a.dot(&e2)) / scene.radius_m)
            .collect();
        let mean = flat.iter().sum::<Vector2<f64>>() / flat.len() as f64;
        let spread: Matrix2<f64> = flat
            .iter()
            .map(|u| (u - mean) * (u - mean).transpose())
            .sum();
        let inverse = spread.try_inverse();
        let variance = scene.sigma_t_m * scene.sigma_t_m;
        let held = inverse.map(|s| {
            let mut c = Matrix6::zeros();
            c[(0, 0)] = variance * s.trace() / (scene.radius_m.powi(2) + height * height);
            c
        });
        let factors = inverse.map_or_else(Vec::new, |s| {
            flat.iter()
                .map(|u| {
                    // n tilts by δn, which is the rotation vector n × δn
                    let tilt = -(s * (u - mean)) / scene.radius_m;
                    n.cross(&(e1 * tilt.x + e2 * tilt.y))
                })
                .collect()
        });
        let positions: Vec<Point3<f64>> = arms.iter().map(|a| Point3::from(POINT + a)).collect();
        let free = bounds::common_line(&[positions], &truth(), scene.sigma_t_m);
        let control = inverse.map(|s| variance * s.trace() / scene.radius_m.powi(2));
        let (methods, mut rows) = methods(free, held, control);
        let plugins = taking(tried, &[Shape::Points]);
        rows.extend(plugins.iter().map(|(t, _)| plugin_rows(t, (free, control))));
        Self {
            scene,
            arms,
            factors,
            methods,
            plugins,
            rows: rows.into_iter().flatten().collect(),
        }
    }
}

/// The estimators of the study; the bounds with the center free and held, and the control variate's mean square.
fn methods(
    free: Option<Matrix6<f64>>,
    held: Option<Matrix6<f64>>,
    control: Option<f64>,
) -> (Vec<Method>, Vec<[Row; 2]>) {
    let center_held = Options {
        center: Some(Point3::from(POINT)),
        ..Options::default()
    };
    let plain = Options::default;
    [
        method("plane", "plane", plain(), 1, (free, control)),
        method(
            "planar_radial",
            "planar_radial",
            plain(),
            10,
            (free, control),
        ),
        method(
            "planar_radial_gn",
            "planar_radial_gn",
            plain(),
            1,
            (free, control),
        ),
        method(
            "planar_radial, center held",
            "planar_radial",
            center_held.clone(),
            10,
            (held, control),
        ),
        method(
            "planar_radial_gn, center held",
            "planar_radial_gn",
            center_held,
            1,
            (held, control),
        ),
        method("circle_ml", "circle_ml", plain(), 1, (free, control)),
        method("dir_ml", "dir_ml", plain(), 1, (free, control)),
        method("line_ml", "line_ml", plain(), 1, (free, control)),
        method(
            "halvorsen_line",
            "halvorsen_line",
            plain(),
            1,
            (free, control),
        ),
    ]
    .into_iter()
    .flatten()
    .unzip()
}

impl Experiment for CircleScene {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn rows(&self) -> &[Row] {
        &self.rows
    }

    fn trial(&self, number: u64, noise: &mut Noise, tallies: &mut [Tally]) {
        let mut linear = Vector3::zeros();
        let mut track = Vec::with_capacity(self.arms.len());
        let n = axis().into_inner();
        for (k, arm) in self.arms.iter().enumerate() {
            let epsilon = noise.vector(self.scene.sigma_t_m);
            track.push(Some(Point3::from(POINT + arm + epsilon)));
            if let Some(factor) = self.factors.get(k) {
                linear += factor * n.dot(&epsilon);
            }
        }
        let tracks = [track];
        for (method, pair) in self.methods.iter().zip(tallies.chunks_mut(2)) {
            if number.is_multiple_of(method.every) {
                method.record(&Input::Points(&tracks), Some(linear), pair);
            }
        }
        let pairs = tallies[2 * self.methods.len()..].chunks_mut(2);
        for ((tool, shape), pair) in self.plugins.iter().zip(pairs) {
            record(tool, &motion(*shape, &tracks, &[]), Some(linear), pair);
        }
    }
}
