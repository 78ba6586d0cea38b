//! The frame of the hand's joint on a 6 × 6 grid: Algorithm 1 as printed, with its axes turned back, and maximum likelihood.

use calib_aor::{
    Center, FrameAxes, FrameEstimate, FrameOptions, FrameSample, Pose, bounds,
    frame_ml::{self, Residuals},
    frame_planes,
};
use calib_geometry::se3;
use nalgebra::{Isometry3, Matrix6, Point3, Vector3};

use super::literal::algorithm1_as_printed;
use crate::{
    cell::{Quantity, Scene},
    experiment::Experiment,
    motion::steps,
    noise::Noise,
    tally::{Row, Tally},
};

/// Steps of the grid along each axis.
const GRID: usize = 6;

const METHODS: [(&str, &str); 3] = [
    ("algorithm1, as printed", "algorithm1"),
    ("algorithm1, turned back", "algorithm1"),
    ("frame_ml", "frame_ml"),
];

pub(crate) struct FrameScene {
    scene: Scene,
    world_from_joint: Isometry3<f64>,
    body_from_joint: Isometry3<f64>,
    angles: Vec<(f64, f64)>,
    rows: Vec<Row>,
}

impl FrameScene {
    pub fn new(scene: Scene) -> Self {
        let world_from_joint =
            Isometry3::new(Vector3::new(1.2, -0.8, 0.9), Vector3::new(0.4, -0.7, 1.1));
        let body_from_joint = Isometry3::new(
            Vector3::new(0.0, -scene.radius_m, 0.0),
            Vector3::new(-0.9, 0.3, 0.5),
        );
        let mut angles = Vec::new();
        for proximal in steps(-45.0, 135.0, GRID) {
            for distal in steps(-45.0, 80.0, GRID) {
                angles.push((proximal, distal));
            }
        }
        let bound = bounds::frame(
            FrameAxes::default(),
            &angles,
            &body_from_joint,
            scene.sigma_t_m,
            scene.sigma_r_rad,
        );
        let row = |(name, id): (&str, &'static str), quantity, first: usize| Row {
            method: name.to_owned(),
            estimator: id,
            quantity,
            bound: bound.map(|b: Matrix6<f64>| b.fixed_view::<3, 3>(first, first).trace()),
            control: None,
        };
        let rows = METHODS
            .into_iter()
            .flat_map(|m| [row(m, Quantity::Turn, 0), row(m, Quantity::Shift, 3)])
            .collect();
        Self {
            scene: Scene {
                condition: format!("{GRID} × {GRID} grid"),
                ..scene
            },
            world_from_joint,
            body_from_joint,
            angles,
            rows,
        }
    }

    fn sample(&self, (proximal, distal): (f64, f64), noise: &mut Noise) -> FrameSample {
        let turn = FrameAxes::default().turned(proximal, distal);
        let truth = self.world_from_joint * turn * self.body_from_joint.inverse();
        let measured = truth.rotation * noise.turn(self.scene.sigma_r_rad);
        FrameSample {
            world_from_body: Some(Pose {
                rotation: measured.to_rotation_matrix().into_inner(),
                translation: truth.translation.vector + noise.vector(self.scene.sigma_t_m),
            }),
            proximal,
            distal,
        }
    }

    fn record(
        &self,
        found: Option<(Isometry3<f64>, Option<&FrameEstimate>)>,
        tallies: &mut [Tally],
    ) {
        let [turn, shift] = tallies else {
            return;
        };
        let Some((body_from_joint, estimate)) = found else {
            turn.verdict(false, false);
            shift.verdict(false, false);
            return;
        };
        let error = se3::log(&(self.body_from_joint.inverse() * body_from_joint));
        let trace = |first: usize| {
            estimate.map_or(f64::NAN, |e| {
                e.covariance.fixed_view::<3, 3>(first, first).trace()
            })
        };
        let observable = estimate.is_none_or(|e| e.verdict == calib_geometry::Verdict::Ok);
        turn.error(observable, error.angular(), trace(0), None);
        // The origin itself, not the twist that leads to it: 90° errors bend the twist.
        let origin =
            self.body_from_joint.inverse() * Point3::from(body_from_joint.translation.vector);
        shift.error(observable, origin.coords, trace(3), None);
    }
}

/// Center of rotation of all poses: the paper's SFE.
fn sfe(poses: &[Option<Pose>]) -> Option<Point3<f64>> {
    let outcome = calib_cor::fit(
        "sfe",
        &calib_cor::Input::Poses(poses),
        &calib_cor::Options::default(),
    );
    outcome.ok()?.estimate().map(|e| e.center)
}

impl Experiment for FrameScene {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn rows(&self) -> &[Row] {
        &self.rows
    }

    fn trial(&self, number: u64, noise: &mut Noise, tallies: &mut [Tally]) {
        // Algorithm 1's covariance differentiates the whole chain: a fifth of the trials.
        if !number.is_multiple_of(5) {
            return;
        }
        let samples: Vec<FrameSample> =
            self.angles.iter().map(|a| self.sample(*a, noise)).collect();
        let options = FrameOptions::default();
        let mut places = tallies.chunks_mut(2);

        let poses: Vec<Option<Pose>> = samples.iter().map(|s| s.world_from_body).collect();
        let printed = sfe(&poses).and_then(|m| {
            algorithm1_as_printed(&samples, &m, options.axes, &self.world_from_joint)
        });
        if let Some(place) = places.next() {
            self.record(printed.map(|x| (x, None)), place);
        }

        let turned_back = frame_planes::algorithm1(&samples, Center::From(&sfe), &options).ok();
        let likelihood = frame_ml::fit(&samples, Residuals::Poses, &options).ok();
        for outcome in [turned_back, likelihood] {
            let estimate = outcome.as_ref().and_then(|o| o.estimate());
            if let Some(place) = places.next() {
                self.record(estimate.map(|e| (e.body_from_joint, Some(e))), place);
            }
        }
    }
}
