//! The frame of the hand's joint on a 6 × 6 grid: Algorithm 1 as printed, with its axes turned back, and maximum likelihood.
//!
//! Two errors each: of the frame in the body (what a calibration is for) and of the frame in the tracker at the reference
//! configuration (what the paper's Algorithm 1 computes).

use calib_aor::{
    Center, FrameAxes, FrameEstimate, FrameSample, Options, Pose, bounds,
    frame_ml::{self, Residuals},
    frame_planes,
};
use calib_estimator::Verdict;
use calib_geometry::so3;
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

const METHODS: [(&str, &str); 6] = [
    ("algorithm1, as printed", "algorithm1"),
    ("algorithm1, as printed, in the tracker", "algorithm1"),
    ("algorithm1, turned back", "algorithm1"),
    ("algorithm1, turned back, in the tracker", "algorithm1"),
    ("frame_ml", "frame_ml"),
    ("frame_ml, in the tracker", "frame_ml"),
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
        // Across both axes, like the paper's hand; turned against the joint's frame.
        let joint_from_body = Isometry3::new(
            Vector3::new(0.0, scene.radius_m, 0.0),
            Vector3::new(0.9, -0.3, -0.5),
        );
        let body_from_joint = joint_from_body.inverse();
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
        let turns: Vec<_> = angles
            .iter()
            .map(|(p, d)| FrameAxes::default().turned(*p, *d))
            .collect();
        let both =
            super::bounds::frame(&turns, &joint_from_body, scene.sigma_t_m, scene.sigma_r_rad);
        let in_tracker: Option<Matrix6<f64>> = both.map(|b| b.fixed_view::<6, 6>(0, 0).into());
        let row = |(name, id): (&str, &'static str), quantity, first: usize| {
            let bound = if name.ends_with("tracker") {
                in_tracker
            } else {
                bound
            };
            Row {
                method: name.to_owned(),
                estimator: id.to_owned(),
                from_plugin: false,
                quantity,
                bound: bound.map(|b| b.fixed_view::<3, 3>(first, first).trace()),
                control: None,
            }
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
            weight: 1.0,
        }
    }

    /// `tallies`: turn and shift in the body, turn and shift in the tracker.
    fn record(&self, found: Option<Found<'_>>, tallies: &mut [Tally]) {
        let Some(found) = found else {
            for tally in tallies {
                tally.verdict(false, false);
            }
            return;
        };
        let estimate = found.estimate;
        let observable = estimate.is_none_or(|e| e.verdict == Verdict::Ok);
        let predicted = |first: usize| {
            estimate.map_or(f64::NAN, |e| {
                e.covariance.fixed_view::<3, 3>(first, first).trace()
            })
        };
        let pairs = [
            (
                self.body_from_joint,
                found.body_from_joint,
                [0, 3].map(predicted),
            ),
            (self.world_from_joint, found.world_from_joint, [f64::NAN; 2]),
        ];
        for ((truth, got, predicted), tallies) in pairs.into_iter().zip(tallies.chunks_mut(2)) {
            let [turn, shift] = tallies else {
                return;
            };
            let error = truth.inverse() * got;
            turn.error(observable, so3::log(&error.rotation), predicted[0], None);
            shift.error(observable, error.translation.vector, predicted[1], None);
        }
    }
}

/// A frame found by some method.
struct Found<'a> {
    body_from_joint: Isometry3<f64>,
    world_from_joint: Isometry3<f64>,
    estimate: Option<&'a FrameEstimate>,
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

    fn trial(&self, _: u64, noise: &mut Noise, tallies: &mut [Tally]) {
        let samples: Vec<FrameSample> =
            self.angles.iter().map(|a| self.sample(*a, noise)).collect();
        let options = Options::default();
        let mut places = tallies.chunks_mut(4);

        let poses: Vec<Option<Pose>> = samples.iter().map(|s| s.world_from_body).collect();
        let printed = sfe(&poses).and_then(|m| {
            algorithm1_as_printed(&samples, &m, options.axes, &self.world_from_joint)
        });
        if let Some(place) = places.next() {
            let found = printed.map(|(body_from_joint, world_from_joint)| Found {
                body_from_joint,
                world_from_joint,
                estimate: None,
            });
            self.record(found, place);
        }

        let turned_back = frame_planes::algorithm1(&samples, Center::From(&sfe), &options).ok();
        let likelihood = frame_ml::fit(&samples, Residuals::Poses, &options).ok();
        for outcome in [turned_back, likelihood] {
            let estimate = outcome.as_ref().and_then(|o| o.estimate());
            if let Some(place) = places.next() {
                let found = estimate.map(|e| Found {
                    body_from_joint: e.body_from_joint,
                    world_from_joint: e.world_from_joint,
                    estimate: Some(e),
                });
                self.record(found, place);
            }
        }
    }
}
