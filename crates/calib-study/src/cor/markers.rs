//! Raw markers of a rigid body on a ball joint: the bundle against spheres of the same markers.

use calib_cor::{Input, Options, bounds};
use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::{
    method::{Gets, Method, method, record},
    poses::{CENTER, body_point},
};
use crate::{
    cell::Scene, experiment::Experiment, motion::Range, noise::Noise, tally::Row, tally::Tally,
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
    methods: Vec<Method>,
    rows: Vec<Row>,
}

impl MarkerScene {
    pub fn new(scene: Scene) -> Self {
        let turns = Range::Hand.turns(scene.samples);
        let point = body_point(scene.radius_m);
        let layout: Vec<Vector3<f64>> = CLUSTER.iter().map(|b| b - point).collect();
        let bundle = bounds::ball(&layout, &turns, scene.sigma_t_m).map(|c| c.trace());
        let arms: Vec<Vec<Vector3<f64>>> = layout
            .iter()
            .map(|b| turns.iter().map(|r| r * b).collect())
            .collect();
        let spheres = bounds::sphere_center(&arms, scene.sigma_t_m).map(|c| c.trace());
        let methods: Vec<Method> = [
            method("ball_bundle", "ball_bundle", Gets::Points, false, 5),
            method("ml_sphere", "ml_sphere", Gets::Points, false, 5),
            method("halvorsen", "halvorsen", Gets::Points, false, 5),
            method("gamage_lasenby", "gamage_lasenby", Gets::Points, false, 5),
        ]
        .into_iter()
        .flatten()
        .collect();
        let rows = methods
            .iter()
            .map(|m| {
                m.row(if m.info.id == "ball_bundle" {
                    bundle
                } else {
                    spheres
                })
            })
            .collect();
        Self {
            scene: Scene {
                condition: "4 markers".to_owned(),
                ..scene
            },
            turns,
            layout,
            methods,
            rows,
        }
    }
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
        let tracks: Vec<Vec<Option<Point3<f64>>>> = self
            .layout
            .iter()
            .map(|b| {
                let mut seen = |r: &UnitQuaternion<f64>| CENTER + r * b + noise.vector(sigma);
                self.turns.iter().map(|r| Some(seen(r).into())).collect()
            })
            .collect();
        let options = Options::default();
        for (method, tally) in self.methods.iter().zip(tallies) {
            let input = Input::Markers(&tracks);
            record(method.info, &input, &options, &CENTER, None, tally);
        }
    }
}
