//! One body on a ball joint: the paper's grid, and short arcs.
//!
//! ```text
//! t_i = o − R_i p + ε_i,  R̃_i = R_i exp(φ_i)          ε ~ N(0, σ_t² I),  φ ~ N(0, σ_r² I)         (1)
//! points:  e* = C Σ w_i (u_i − ū)(u_i·ε_i)             u_i from the center to the body               (2)
//! poses:   e* = C Σ A_iᵀ Σ_i⁻¹ (R_i (φ_i × p) + ε_i)   A_i = [I  −R_i]                               (3)
//! ```

use calib_cor::{Input, Options, Pose, bounds};
use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};

use calib_plugin::{Cor, Shape};

use super::method::{Gets, Method, method, record, taking};
use crate::{
    cell::{Quantity, Scene},
    experiment::Experiment,
    motion::Range,
    noise::Noise,
    tally::{Row, Tally},
    tried::{Tool, Tried, motion},
};

/// The center in the tracker's frame, m: a tripod's distance away, no coordinate special.
pub(crate) const CENTER: Vector3<f64> = Vector3::new(1.2, -0.8, 0.9);

/// Orientation noise that stands for "none" where an estimator wants a positive number, rad.
const NO_TURN: f64 = 1e-6;

/// The center in the body's frame: across both axes of the grid.
pub(crate) fn body_point(radius: f64) -> Vector3<f64> {
    Vector3::new(0.0, -radius, 0.0)
}

/// Marker positions and poses of one trial.
pub(crate) struct Draw {
    pub tracks: Vec<Vec<Option<Point3<f64>>>>,
    pub poses: Vec<Option<Pose>>,
    /// (2) and (3), where their matrices are known.
    pub of_points: Vector3<f64>,
    pub of_poses: Vector3<f64>,
}

/// A ball joint with a body and noise (1).
pub(crate) struct Ball {
    turns: Vec<UnitQuaternion<f64>>,
    point: Vector3<f64>,
    sigma_t: f64,
    sigma_r: f64,
    /// Trace of the bound from positions alone, and from poses.
    pub bound_points: Option<f64>,
    pub bound_poses: Option<f64>,
    /// Factors of ε_i in (2), of the residual in (3).
    by_points: Vec<Matrix3<f64>>,
    by_poses: Vec<Matrix3<f64>>,
}

impl Ball {
    pub fn new(turns: Vec<UnitQuaternion<f64>>, scene: &Scene) -> Self {
        let point = body_point(scene.radius_m);
        let (sigma_t, sigma_r) = (scene.sigma_t_m, scene.sigma_r_rad);
        let arms: Vec<Vector3<f64>> = turns.iter().map(|r| -(r * point)).collect();
        let n = arms.len() as f64;
        let directions: Vec<Vector3<f64>> = arms.iter().map(Vector3::normalize).collect();
        let mean = directions.iter().sum::<Vector3<f64>>() / n;
        let points = bounds::sphere_center(&[arms], sigma_t);
        let by_points = points.map_or_else(Vec::new, |c| {
            let c = c / (sigma_t * sigma_t);
            let factor = |u: &Vector3<f64>| c * (u - mean) * u.transpose();
            directions.iter().map(factor).collect()
        });
        let truth: Vec<Pose> = turns
            .iter()
            .map(|r| Pose {
                rotation: r.to_rotation_matrix().into_inner(),
                translation: CENTER - r * point,
            })
            .collect();
        let poses = bounds::hot_spot(&truth, &point, sigma_t, sigma_r);
        let by_poses = poses.map_or_else(Vec::new, |c| {
            let unit = point.normalize();
            let along = unit * unit.transpose();
            let across = sigma_t.powi(2) + sigma_r.powi(2) * point.norm_squared();
            let weight = along / sigma_t.powi(2) + (Matrix3::identity() - along) / across;
            let top_left: Matrix3<f64> = c.fixed_view::<3, 3>(0, 0).into();
            let top_right: Matrix3<f64> = c.fixed_view::<3, 3>(0, 3).into();
            let factor = |pose: &Pose| {
                let r = pose.rotation;
                (top_left - top_right * r.transpose()) * (r * weight * r.transpose())
            };
            truth.iter().map(factor).collect()
        });
        Self {
            turns,
            point,
            sigma_t,
            sigma_r,
            bound_points: points.map(|c| c.trace()),
            bound_poses: poses.map(|c| c.fixed_view::<3, 3>(0, 0).trace()),
            by_points,
            by_poses,
        }
    }

    pub fn draw(&self, noise: &mut Noise) -> Draw {
        let mut draw = Draw {
            tracks: vec![Vec::with_capacity(self.turns.len())],
            poses: Vec::with_capacity(self.turns.len()),
            of_points: Vector3::zeros(),
            of_poses: Vector3::zeros(),
        };
        for (k, turn) in self.turns.iter().enumerate() {
            let epsilon = noise.vector(self.sigma_t);
            let phi = noise.vector(self.sigma_r);
            let translation = CENTER - turn * self.point + epsilon;
            let measured = turn * UnitQuaternion::from_scaled_axis(phi);
            draw.tracks[0].push(Some(Point3::from(translation)));
            draw.poses.push(Some(Pose {
                rotation: measured.to_rotation_matrix().into_inner(),
                translation,
            }));
            if let Some(factor) = self.by_points.get(k) {
                draw.of_points += factor * epsilon;
            }
            if let Some(factor) = self.by_poses.get(k) {
                draw.of_poses += factor * (turn * phi.cross(&self.point) + epsilon);
            }
        }
        draw
    }

    /// True positions of the body relative to the center.
    pub fn arms(&self) -> Vec<Vector3<f64>> {
        self.turns.iter().map(|r| -(r * self.point)).collect()
    }

    pub fn options(&self, known: bool) -> Options {
        Options {
            sigma_t: known.then_some(self.sigma_t),
            sigma_r: known.then_some(self.sigma_r.max(NO_TURN)),
            ..Options::default()
        }
    }

    pub fn bound(&self, gets: Gets) -> Option<f64> {
        match gets {
            Gets::Points => self.bound_points,
            Gets::Poses => self.bound_poses,
        }
    }
}

fn gets(shape: Shape) -> Gets {
    match shape {
        Shape::Poses => Gets::Poses,
        _ => Gets::Points,
    }
}

/// Methods on one ball.
pub(crate) struct PoseScene {
    scene: Scene,
    ball: Ball,
    methods: Vec<Method>,
    plugins: Vec<(Tool<dyn Cor>, Shape)>,
    rows: Vec<Row>,
    stated: Options,
    unstated: Options,
}

impl PoseScene {
    /// The paper's grid. Positions do not depend on orientation noise: the point estimators that are not the paper's run
    /// where it is zero; the robust ones for poses at 1°.
    pub fn paper(range: Range, scene: Scene, tried: &Tried) -> Self {
        let scene = Scene {
            motion: range.word().to_owned(),
            ..scene
        };
        let turns = range.turns(scene.samples);
        let mut methods = vec![
            method("hse", "hse", Gets::Poses, false, 1),
            method("hsa", "hsa", Gets::Poses, false, 1),
            method("sfe", "sfe", Gets::Points, false, 1),
            method("hotspot_ml", "hotspot_ml", Gets::Poses, false, 1),
            method("hotspot_ml, σ known", "hotspot_ml", Gets::Poses, true, 1),
        ];
        let turn_deg = scene.sigma_r_rad.to_degrees();
        let head = range == Range::Head;
        if turn_deg < 0.01 || head {
            methods.extend([
                method("sfa", "sfa", Gets::Points, false, 20),
                method("kasa", "kasa", Gets::Points, false, 1),
                method("taubin", "taubin", Gets::Points, false, 1),
                method("hyper", "hyper", Gets::Points, false, 1),
                method("hyper_n", "hyper_n", Gets::Points, false, 10),
                method("gamage_lasenby", "gamage_lasenby", Gets::Points, false, 1),
                method("halvorsen", "halvorsen", Gets::Points, false, 1),
                method("ml_sphere", "ml_sphere", Gets::Points, false, 1),
                method("ml_sphere, σ known", "ml_sphere", Gets::Points, true, 1),
                method("sphere_eiv", "sphere_eiv", Gets::Points, false, 1),
                method("robust, points", "robust", Gets::Points, false, 5),
                method("consensus, points", "consensus", Gets::Points, false, 5),
            ]);
        }
        if (0.99..1.01).contains(&turn_deg) {
            methods.extend([
                method("robust, poses", "robust", Gets::Poses, false, 5),
                method("consensus, poses", "consensus", Gets::Poses, false, 5),
            ]);
        }
        Self::with(scene, turns, methods, tried)
    }

    /// A range of motion in the study of bias.
    pub fn arc(
        motion: String,
        turns: Vec<UnitQuaternion<f64>>,
        scene: Scene,
        tried: &Tried,
    ) -> Self {
        let methods = vec![
            method("kasa", "kasa", Gets::Points, false, 1),
            method("sfe", "sfe", Gets::Points, false, 1),
            method("taubin", "taubin", Gets::Points, false, 1),
            method("hyper", "hyper", Gets::Points, false, 1),
            method("ml_sphere", "ml_sphere", Gets::Points, false, 1),
            method("hyper_n", "hyper_n", Gets::Points, false, 5),
            method("sphere_eiv", "sphere_eiv", Gets::Points, false, 1),
            method("hse", "hse", Gets::Poses, false, 1),
            method("hotspot_ml, σ known", "hotspot_ml", Gets::Poses, true, 1),
        ];
        Self::with(Scene { motion, ..scene }, turns, methods, tried)
    }

    fn with(
        scene: Scene,
        turns: Vec<UnitQuaternion<f64>>,
        methods: Vec<Option<Method>>,
        tried: &Tried,
    ) -> Self {
        let ball = Ball::new(turns, &scene);
        let methods: Vec<Method> = methods.into_iter().flatten().collect();
        let mut rows: Vec<Row> = methods.iter().map(|m| m.row(ball.bound(m.gets))).collect();
        let plugins = taking(tried, &[Shape::Poses, Shape::Points]);
        rows.extend(plugins.iter().map(|(tool, shape)| {
            let bound = ball.bound(gets(*shape));
            tool.row(Quantity::Center, bound, bound)
        }));
        Self {
            stated: ball.options(true),
            unstated: ball.options(false),
            scene,
            ball,
            methods,
            plugins,
            rows,
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
        let draw = self.ball.draw(noise);
        let (own, others) = tallies.split_at_mut(self.methods.len());
        for (method, tally) in self.methods.iter().zip(own) {
            if !number.is_multiple_of(method.every) {
                continue;
            }
            let (input, linear) = match method.gets {
                Gets::Points => (Input::Points(&draw.tracks), draw.of_points),
                Gets::Poses => (Input::Poses(&draw.poses), draw.of_poses),
            };
            let options = if method.known {
                &self.stated
            } else {
                &self.unstated
            };
            record(method.info, &input, options, (CENTER, Some(linear)), tally);
        }
        for ((tool, shape), tally) in self.plugins.iter().zip(others) {
            let poses: Vec<_> = draw
                .poses
                .iter()
                .map(|p| p.map(|p| (p.rotation, p.translation)))
                .collect();
            let linear = match gets(*shape) {
                Gets::Points => draw.of_points,
                Gets::Poses => draw.of_poses,
            };
            let motion = motion(*shape, &draw.tracks, &poses);
            tool.record(&motion, (CENTER, Some(linear)), tally);
        }
    }
}
