//! Raw markers of a rigid body on a ball joint: the bundle against spheres of the same markers.

use calib_cor::{Input, Options, bounds};
use calib_plugin::{Cor, Shape};
use nalgebra::{DMatrix, Matrix3, Point3, UnitQuaternion, Vector3};

use super::{
    method::{Gets, Method, method, record, taking},
    poses::{CENTER, body_point},
};
use crate::{
    cell::{Quantity, Scene},
    experiment::Experiment,
    linear::{Linear, linear},
    motion::Range,
    noise::Noise,
    tally::{Row, Tally},
    tried::{Tool, Tried, motion},
};

/// Four markers around the body's origin, m: a cluster of 60–90 mm.
const CLUSTER: [Vector3<f64>; 4] = [
    Vector3::new(0.040, 0.010, 0.005),
    Vector3::new(-0.030, 0.035, -0.010),
    Vector3::new(-0.020, -0.030, 0.025),
    Vector3::new(0.015, -0.015, -0.035),
];

pub(crate) struct MarkerScene {
    scene: Scene,
    turns: Vec<UnitQuaternion<f64>>,
    /// Markers relative to the center, in the body's axes.
    layout: Vec<Vector3<f64>>,
    /// The efficient linear estimator of the bundle, of noise in the body's axes.
    gains: Vec<DMatrix<f64>>,
    methods: Vec<Method>,
    plugins: Vec<(Tool<dyn Cor>, Shape)>,
    rows: Vec<Row>,
}

impl MarkerScene {
    pub fn new(scene: Scene, tried: &Tried) -> Self {
        let turns = Range::Hand.turns(scene.samples);
        let point = body_point(scene.radius_m);
        let layout: Vec<Vector3<f64>> = CLUSTER.iter().map(|b| b - point).collect();
        let bundle = bounds::ball(&layout, &turns, scene.sigma_t_m).map(|c| c.trace());
        let arms: Vec<Vec<Vector3<f64>>> = layout
            .iter()
            .map(|b| turns.iter().map(|r| r * b).collect())
            .collect();
        let spheres = bounds::sphere_center(&arms, scene.sigma_t_m).map(|c| c.trace());
        let rigid = rigid(&turns, &layout);
        let control = rigid.as_ref().map(|l| l.trace * scene.sigma_t_m.powi(2));
        let methods: Vec<Method> = [
            method("ball_bundle", "ball_bundle", Gets::Points, false, 5),
            method("ml_sphere", "ml_sphere", Gets::Points, false, 5),
            method("halvorsen", "halvorsen", Gets::Points, false, 5),
            method("gamage_lasenby", "gamage_lasenby", Gets::Points, false, 5),
        ]
        .into_iter()
        .flatten()
        .collect();
        let mut rows: Vec<Row> = methods
            .iter()
            .map(|m| {
                let own = m.info.id == "ball_bundle";
                Row {
                    control,
                    ..m.row(if own { bundle } else { spheres })
                }
            })
            .collect();
        let plugins = taking(tried, &[Shape::Markers, Shape::Points]);
        rows.extend(plugins.iter().map(|(tool, shape)| {
            let rigid = *shape == Shape::Markers;
            let bound = if rigid { bundle } else { spheres };
            tool.row(Quantity::Center, bound, control)
        }));
        Self {
            scene: Scene {
                condition: "4 markers".to_owned(),
                ..scene
            },
            turns,
            layout,
            gains: rigid.map_or_else(Vec::new, |l| l.gains),
            methods,
            plugins,
            rows,
        }
    }
}

/// Unknowns `[center; layout]`; each frame's own is the body's turn. In the body's axes:
///
/// ```text
/// R_iᵀ dv_ip = R_iᵀ do + db_p − [b_p]ₓ ω_i
/// ```
fn rigid(turns: &[UnitQuaternion<f64>], layout: &[Vector3<f64>]) -> Option<Linear> {
    let rows = 3 * layout.len();
    let mut own = DMatrix::zeros(rows, 3);
    for (p, b) in layout.iter().enumerate() {
        own.fixed_view_mut::<3, 3>(3 * p, 0)
            .copy_from(&(-b.cross_matrix()));
    }
    let jacobians: Vec<DMatrix<f64>> = turns
        .iter()
        .map(|r| {
            let back = r.inverse().to_rotation_matrix().into_inner();
            let mut j = DMatrix::zeros(rows, 3 + rows);
            for p in 0..layout.len() {
                j.fixed_view_mut::<3, 3>(3 * p, 0).copy_from(&back);
                j.fixed_view_mut::<3, 3>(3 * p, 3 + 3 * p)
                    .copy_from(&Matrix3::identity());
            }
            j
        })
        .collect();
    linear(&jacobians, Some(&own), true, 3)
}

impl Experiment for MarkerScene {
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
        let sigma = self.scene.sigma_t_m;
        let mut tracks: Vec<Vec<Option<Point3<f64>>>> = vec![Vec::new(); self.layout.len()];
        let mut linear = Vector3::zeros();
        for (i, turn) in self.turns.iter().enumerate() {
            for (p, (b, track)) in self.layout.iter().zip(&mut tracks).enumerate() {
                let epsilon = noise.vector(sigma);
                track.push(Some(Point3::from(CENTER + turn * b + epsilon)));
                if let Some(gain) = self.gains.get(i) {
                    linear += gain.fixed_view::<3, 3>(0, 3 * p) * (turn.inverse() * epsilon);
                }
            }
        }
        let options = Options::default();
        let (own, others) = tallies.split_at_mut(self.methods.len());
        for (method, tally) in self.methods.iter().zip(own) {
            let input = Input::Markers(&tracks);
            record(method.info, &input, &options, (CENTER, Some(linear)), tally);
        }
        for ((tool, shape), tally) in self.plugins.iter().zip(others) {
            let motion = motion(*shape, &tracks, &[]);
            tool.record(&motion, (CENTER, Some(linear)), tally);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two derivations of one bound.
    #[test]
    fn the_linear_estimator_has_the_bound() {
        let turns = Range::Hand.turns(16);
        let layout: Vec<Vector3<f64>> = CLUSTER.iter().map(|b| b - body_point(0.1)).collect();
        let ours = rigid(&turns, &layout).expect("determined").trace;
        let theirs = bounds::ball(&layout, &turns, 1.0).expect("a bound").trace();
        assert!((ours / theirs - 1.0).abs() < 1e-8, "{ours} {theirs}");
    }
}
