//! The paper's study of one axis with a body's poses: what orientations add.

use calib_aor::{Input, Options, Pose};
use calib_plugin::{Aor, Shape};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::{
    bounds::hinge_poses,
    method::{Method, POINT, arm, axis, method, plugin_rows, record, taking, turned},
};
use crate::{
    cell::Scene,
    experiment::Experiment,
    motion::steps,
    noise::Noise,
    tally::{Row, Tally},
    tried::{Tool, Tried, motion},
};

pub(crate) struct PoseScene {
    scene: Scene,
    truth: Vec<Isometry3<f64>>,
    methods: Vec<Method>,
    plugins: Vec<(Tool<dyn Aor>, Shape)>,
    rows: Vec<Row>,
}

impl PoseScene {
    pub fn new(scene: Scene, [from, to]: [f64; 2], tried: &Tried) -> Self {
        let start = arm(scene.radius_m);
        let mounted = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 0.2, -0.5));
        let truth: Vec<Isometry3<f64>> = steps(from, to, scene.samples)
            .map(|angle| {
                let turn = turned(angle);
                Isometry3::from_parts(Translation3::from(POINT + turn * start), turn * mounted)
            })
            .collect();
        let bound = hinge_poses(&truth, &axis(), &POINT, scene.sigma_t_m, scene.sigma_r_rad);
        let plugins = taking(tried, &[Shape::Poses]);
        let (methods, mut rows): (Vec<Method>, Vec<[Row; 2]>) = [
            method("sara", "sara", Options::default(), 1, (bound, None)),
            method(
                "rotation_axis",
                "rotation_axis",
                Options::default(),
                1,
                (bound, None),
            ),
            method(
                "hinge_poses",
                "hinge_poses",
                Options::default(),
                2,
                (bound, None),
            ),
            method(
                "hinge_poses, σ known",
                "hinge_poses",
                Options {
                    sigma_t: Some(scene.sigma_t_m),
                    sigma_r: Some(scene.sigma_r_rad),
                    ..Options::default()
                },
                2,
                (bound, None),
            ),
        ]
        .into_iter()
        .flatten()
        .unzip();
        rows.extend(plugins.iter().map(|(t, _)| plugin_rows(t, (bound, None))));
        Self {
            scene,
            truth,
            methods,
            plugins,
            rows: rows.into_iter().flatten().collect(),
        }
    }
}

impl Experiment for PoseScene {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn rows(&self) -> &[Row] {
        &self.rows
    }

    fn trial(&self, number: u64, noise: &mut Noise, tallies: &mut [Tally]) {
        let poses: Vec<Option<Pose>> = self
            .truth
            .iter()
            .map(|pose| {
                let measured = pose.rotation * noise.turn(self.scene.sigma_r_rad);
                Some(Pose {
                    rotation: measured.to_rotation_matrix().into_inner(),
                    translation: pose.translation.vector + noise.vector(self.scene.sigma_t_m),
                })
            })
            .collect();
        for (method, pair) in self.methods.iter().zip(tallies.chunks_mut(2)) {
            if number.is_multiple_of(method.every) {
                method.record(&Input::Poses(&poses), None, pair);
            }
        }
        let pairs = tallies[2 * self.methods.len()..].chunks_mut(2);
        for ((tool, shape), pair) in self.plugins.iter().zip(pairs) {
            let poses: Vec<_> = poses
                .iter()
                .map(|p| p.map(|p| (p.rotation, p.translation)))
                .collect();
            record(tool, &motion(*shape, &[], &poses), None, pair);
        }
    }
}
