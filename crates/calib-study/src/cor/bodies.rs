//! Two moving bodies with a ball joint between them.
//!
//! ```text
//! R_i c₁ + t_i = S_i c₂ + d_i;   z_i = R_i (φ_i × c₁) + ε_i − S_i (ψ_i × c₂) − η_i                (1)
//! C ≥ ( Σ A_iᵀ Σ_i⁻¹ A_i )⁻¹,  A_i = [R_i  −S_i],
//! Σ_i = 2σ_t² I + σ_r² ( |c₁|² R_i (I − ĉ₁ĉ₁ᵀ) R_iᵀ + |c₂|² S_i (I − ĉ₂ĉ₂ᵀ) S_iᵀ )                (2)
//! ```

use calib_cor::{EstimatorInfo, Input, Options, Pose, estimators};
use nalgebra::{Matrix3, Matrix6, SMatrix, UnitQuaternion, Vector3};

use super::{
    method::record,
    poses::{CENTER, body_point},
};
use crate::{
    cell::{Quantity, Scene},
    experiment::Experiment,
    motion::Range,
    noise::Noise,
    tally::{Row, Tally},
};

/// The center in the second body, m.
const IN_SECOND: Vector3<f64> = Vector3::new(0.06, 0.15, -0.04);
/// How far the second body wanders, rad and m.
const WANDER: f64 = 0.3;

pub(crate) struct BodiesScene {
    scene: Scene,
    /// (first, second) orientations.
    turns: Vec<(UnitQuaternion<f64>, UnitQuaternion<f64>)>,
    places: Vec<Vector3<f64>>,
    in_first: Vector3<f64>,
    estimator: Option<&'static EstimatorInfo>,
    rows: Vec<Row>,
}

impl BodiesScene {
    pub fn new(scene: Scene) -> Self {
        let in_first = body_point(scene.radius_m);
        let mut wander = Noise::of_trial(0, "second body", 0);
        let turns: Vec<_> = Range::Hand
            .turns(scene.samples)
            .into_iter()
            .map(|relative| {
                let second = wander.turn(WANDER);
                (second * relative, second)
            })
            .collect();
        let places = turns
            .iter()
            .map(|_| CENTER + wander.vector(WANDER))
            .collect();
        let bound = bound(
            &turns,
            &in_first,
            &IN_SECOND,
            scene.sigma_t_m,
            scene.sigma_r_rad,
        );
        let estimator = estimators().iter().find(|e| e.id == "score");
        let rows = estimator
            .map(|info| Row {
                method: info.id.to_owned(),
                estimator: info.id.to_owned(),
                from_plugin: false,
                quantity: Quantity::Center,
                bound: bound.map(|c| c.fixed_view::<3, 3>(3, 3).trace()),
                control: None,
            })
            .into_iter()
            .collect();
        Self {
            scene: Scene {
                condition: "both bodies move".to_owned(),
                ..scene
            },
            turns,
            places,
            in_first,
            estimator,
            rows,
        }
    }
}

/// (2) over `[in_first; in_second]`.
fn bound(
    turns: &[(UnitQuaternion<f64>, UnitQuaternion<f64>)],
    in_first: &Vector3<f64>,
    in_second: &Vector3<f64>,
    sigma_t: f64,
    sigma_r: f64,
) -> Option<Matrix6<f64>> {
    // |c|² (I − ĉĉᵀ) = [c]ₓ[c]ₓᵀ
    let lever = |r: &Matrix3<f64>, c: &Vector3<f64>| {
        let cross = r * c.cross_matrix();
        cross * cross.transpose()
    };
    let mut information = Matrix6::zeros();
    for (first, second) in turns {
        let r = first.to_rotation_matrix().into_inner();
        let s = second.to_rotation_matrix().into_inner();
        let sigma = Matrix3::identity() * (2.0 * sigma_t * sigma_t)
            + (lever(&r, in_first) + lever(&s, in_second)) * (sigma_r * sigma_r);
        let mut a = SMatrix::<f64, 3, 6>::zeros();
        a.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
        a.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-s));
        information += a.transpose() * sigma.cholesky()?.inverse() * a;
    }
    Some(information.cholesky()?.inverse())
}

impl Experiment for BodiesScene {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn rows(&self) -> &[Row] {
        &self.rows
    }

    fn trial(&self, _: u64, noise: &mut Noise, tallies: &mut [Tally]) {
        let (Some(info), Some(tally)) = (self.estimator, tallies.first_mut()) else {
            return;
        };
        let (sigma_t, sigma_r) = (self.scene.sigma_t_m, self.scene.sigma_r_rad);
        let mut seen =
            |turn: &UnitQuaternion<f64>, center: &Vector3<f64>, inside: &Vector3<f64>| {
                let measured = turn * noise.turn(sigma_r);
                Some(Pose {
                    rotation: measured.to_rotation_matrix().into_inner(),
                    translation: center - turn * inside + noise.vector(sigma_t),
                })
            };
        let (mut first, mut second) = (Vec::new(), Vec::new());
        for ((r, s), center) in self.turns.iter().zip(&self.places) {
            first.push(seen(r, center, &self.in_first));
            second.push(seen(s, center, &IN_SECOND));
        }
        let input = Input::TwoBodies {
            parent: &first,
            child: &second,
        };
        record(info, &input, &Options::default(), (IN_SECOND, None), tally);
    }
}
