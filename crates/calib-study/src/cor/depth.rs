//! Noise along the line of sight, `ratio` times that across it.
//!
//! ```text
//! Σ = σ² (I + (ratio² − 1) s sᵀ),   information of a sample along its radius: w_i = 1 / u_iᵀ Σ u_i
//! C = ( Σ w_i (u_i − ū)(u_i − ū)ᵀ )⁻¹,   ū weighted: the common radius is eliminated
//! ```
//!
//! Beside the bound stand what no unbiased estimator exceeds at such noise, and what is left to second order where weights are read off
//! the samples themselves ([`calib_cor::bounds::sphere_center_weighted`]).

use calib_cor::{EstimatorInfo, Input, Options, bounds, estimators};
use nalgebra::{Matrix3, Point3, Vector3};

use super::{
    method::record,
    poses::{CENTER, body_point},
};
use crate::{
    cell::{Part, Quantity, Scene},
    experiment::{Experiment, Limits},
    motion::Range,
    noise::Noise,
    tally::{Row, Tally},
};

pub(crate) struct DepthScene {
    scene: Scene,
    arms: Vec<Vector3<f64>>,
    /// Root of Σ over σ.
    root: Matrix3<f64>,
    factors: Vec<Matrix3<f64>>,
    methods: Vec<(&'static EstimatorInfo, Options)>,
    rows: Vec<Row>,
    limits: Limits,
}

impl DepthScene {
    pub fn new(scene: Scene, ratio: f64) -> Self {
        let sigma = scene.sigma_t_m;
        let sight = Vector3::new(0.55, 0.8, -0.25).normalize();
        let root = Matrix3::identity() + sight * sight.transpose() * (ratio - 1.0);
        let covariance = root * root * (sigma * sigma);
        let point = body_point(scene.radius_m);
        let arms: Vec<Vector3<f64>> = Range::Hand
            .turns(scene.samples)
            .iter()
            .map(|r| -(r * point))
            .collect();
        let directions: Vec<Vector3<f64>> = arms.iter().map(Vector3::normalize).collect();
        let weights: Vec<f64> = directions
            .iter()
            .map(|u| 1.0 / u.dot(&(covariance * u)))
            .collect();
        let weighted = || directions.iter().zip(&weights);
        let mean =
            weighted().map(|(u, w)| u * *w).sum::<Vector3<f64>>() / weights.iter().sum::<f64>();
        let all = bounds::sphere_center_weighted(
            std::slice::from_ref(&arms),
            &[vec![covariance; arms.len()]],
        );
        let bound = all.map(|b| b.cramer_rao);
        let share = |of: fn(&bounds::SphereBounds) -> Matrix3<f64>| {
            all.map(|b| b.cramer_rao.trace() / of(&b).trace())
        };
        let limits = Limits {
            unbiased: share(|b| b.unbiased),
            second_order: share(|b| b.second_order),
        };
        let factors = bound.map_or_else(Vec::new, |c| {
            weighted()
                .map(|(u, w)| c * (u - mean) * u.transpose() * *w)
                .collect()
        });
        let weighted_options = Options {
            covariances: vec![vec![covariance; arms.len()]],
            ..Options::default()
        };
        let uses = [
            ("sfe", "sfe", Options::default()),
            ("ml_sphere", "ml_sphere", Options::default()),
            (
                "ml_sphere, covariances",
                "ml_sphere",
                weighted_options.clone(),
            ),
            ("sphere_eiv, covariances", "sphere_eiv", weighted_options),
        ];
        let (mut methods, mut rows) = (Vec::new(), Vec::new());
        for (name, id, options) in uses {
            if let Some(info) = estimators().iter().find(|e| e.id == id) {
                rows.push(Row {
                    method: name.to_owned(),
                    estimator: info.id.to_owned(),
                    from_plugin: false,
                    quantity: Quantity::Center,
                    bound: bound.map(|c| c.trace()),
                    control: bound.map(|c| c.trace()),
                });
                methods.push((info, options));
            }
        }
        Self {
            scene: Scene {
                condition: format!("depth × {ratio}"),
                part: Part::Depth,
                ..scene
            },
            arms,
            root,
            factors,
            methods,
            rows,
            limits,
        }
    }
}

impl Experiment for DepthScene {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn rows(&self) -> &[Row] {
        &self.rows
    }

    fn limits(&self) -> Limits {
        self.limits
    }

    fn trial(&self, _: u64, noise: &mut Noise, tallies: &mut [Tally]) {
        let mut linear = Vector3::zeros();
        let mut track = Vec::with_capacity(self.arms.len());
        for (k, arm) in self.arms.iter().enumerate() {
            let epsilon = self.root * noise.vector(self.scene.sigma_t_m);
            track.push(Some(Point3::from(CENTER + arm + epsilon)));
            if let Some(factor) = self.factors.get(k) {
                linear += factor * epsilon;
            }
        }
        let tracks = [track];
        for ((info, options), tally) in self.methods.iter().zip(tallies) {
            record(
                info,
                &Input::Points(&tracks),
                options,
                (CENTER, Some(linear)),
                tally,
            );
        }
    }
}
