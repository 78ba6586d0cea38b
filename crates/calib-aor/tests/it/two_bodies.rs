//! The axis between two moving bodies, both measured with noise, against its Cramér–Rao bound.
//!
//! The bound is that of all that was measured, with nothing eliminated by thought: the parent's pose of every frame is unknown too.
//!
//! ```text
//! P̃_i = P_i exp(α_i),   C̃_i = P_i W Rz(θ_i) Y exp(β_i)            α, β ~ N(0, diag(σ_r² I, σ_t² I)), each body its own
//! unknown: four of W, five of Y (gauge), θ_i, P_i:   9 + 7n
//! ```

use crate::common::{Noise, Tally, steps};
use calib_aor::{Input, Options, Pose, fit};
use calib_estimator::Verdict;
use calib_geometry::{Line, se3};
use nalgebra::{
    DMatrix, Isometry3, Matrix6, Point3, SMatrix, Translation3, Unit, UnitQuaternion, Vector3,
};

const MM: f64 = 1e-3;

/// σ of positions in m and of orientations in rad.
#[derive(Clone, Copy)]
struct Level {
    t: f64,
    r: f64,
}

fn level(mm: f64, degrees: f64) -> Level {
    Level {
        t: mm * MM,
        r: degrees.to_radians(),
    }
}

struct Scene {
    /// parent_from_joint.
    w: Isometry3<f64>,
    /// joint_from_child.
    y: Isometry3<f64>,
    angles: Vec<f64>,
    parents: Vec<Isometry3<f64>>,
    of_parent: Level,
    of_child: Level,
}

impl Scene {
    /// The parent wanders through the room where `wander` > 0; its origin lies `away` from the axis.
    fn new(arc: f64, n: usize, away: f64, wander: f64, levels: [Level; 2]) -> Self {
        let mut noise = Noise::new(77);
        let still = Isometry3::new(Vector3::new(1.2, -0.8, 0.9), Vector3::new(0.4, -0.7, 1.1));
        let step = |noise: &mut Noise| {
            let (t, w) = (noise.vector(wander), noise.vector(wander));
            still * Isometry3::new(t, w)
        };
        Self {
            w: Isometry3::new(
                Vector3::new(0.6, -0.5, 0.62) * away,
                Vector3::new(0.9, 0.2, -0.4),
            ),
            y: Isometry3::new(Vector3::new(-0.1, 0.06, 0.04), Vector3::new(0.3, 0.2, -0.5)),
            angles: steps(-0.4 * arc, 0.6 * arc, n),
            parents: (0..n).map(|_| step(&mut noise)).collect(),
            of_parent: levels[0],
            of_child: levels[1],
        }
    }

    fn relative(&self, angle: f64) -> Isometry3<f64> {
        self.w * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle) * self.y
    }

    fn line(&self) -> Line {
        Line {
            point: Point3::from(self.w.translation.vector),
            direction: Unit::new_normalize(self.w.rotation * Vector3::z()),
        }
    }

    fn measured(&self, noise: &mut Noise) -> [Vec<Option<Pose>>; 2] {
        let mut seen = |truth: &Isometry3<f64>, level: Level| {
            let rotation = truth.rotation * noise.turn(level.r);
            let place = truth.translation.vector + noise.vector(level.t);
            Some(Pose::from(Isometry3::from_parts(
                Translation3::from(place),
                rotation,
            )))
        };
        let (mut parents, mut children) = (Vec::new(), Vec::new());
        for (p, angle) in self.parents.iter().zip(&self.angles) {
            parents.push(seen(p, self.of_parent));
            children.push(seen(&(p * self.relative(*angle)), self.of_child));
        }
        [parents, children]
    }

    /// Mean squares below which no unbiased estimator of the direction and of the offset beside W's origin can be.
    fn bound(&self) -> [f64; 2] {
        let n = self.angles.len();
        let size = 9 + 7 * n;
        let weight = |level: Level| {
            // A body measured without noise is one measured a thousand times better.
            let of = |s: f64, least: f64| s.max(least).powi(-2);
            let (r, t) = (of(level.r, 1e-6), of(level.t, 1e-7));
            Matrix6::from_diagonal(&nalgebra::Vector6::new(r, r, r, t, t, t))
        };
        let mut information = DMatrix::<f64>::zeros(size, size);
        for (i, angle) in self.angles.iter().enumerate() {
            let inner = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *angle) * self.y;
            let (of_w, of_y) = (
                se3::adjoint(&inner.inverse()),
                se3::adjoint(&self.y.inverse()),
            );
            let mut child = DMatrix::<f64>::zeros(6, size);
            for (column, of) in [0, 1, 3, 4].into_iter().enumerate() {
                child.set_column(column, &of_w.column(of));
            }
            for (column, of) in [0, 1, 3, 4, 5].into_iter().enumerate() {
                child.set_column(4 + column, &of_y.column(of));
            }
            child.set_column(9 + 7 * i, &of_y.column(2));
            let of_parent = se3::adjoint(&(self.w * inner).inverse());
            let mut parent = DMatrix::<f64>::zeros(6, size);
            for k in 0..6 {
                child.set_column(10 + 7 * i + k, &of_parent.column(k));
                parent[(k, 10 + 7 * i + k)] = 1.0;
            }
            information += child.transpose() * weight(self.of_child) * &child;
            information += parent.transpose() * weight(self.of_parent) * &parent;
        }
        let d: Vec<f64> = (0..size)
            .map(|k| information[(k, k)].sqrt().recip())
            .collect();
        let scaled = DMatrix::from_fn(size, size, |i, k| information[(i, k)] * d[i] * d[k]);
        let inverse = scaled.cholesky().expect("an axis").inverse();
        let c = SMatrix::<f64, 4, 4>::from_fn(|i, k| inverse[(i, k)] * d[i] * d[k]);
        [c[(0, 0)] + c[(1, 1)], c[(2, 2)] + c[(3, 3)]]
    }
}

struct Cell {
    /// Direction, and offset beside W's origin.
    errors: [Tally; 2],
    /// Offset of the reported point.
    point: Tally,
    none: usize,
    not_ok: usize,
}

fn run(scene: &Scene, id: &str, options: &Options, trials: u64) -> Cell {
    let truth = scene.line();
    let mut cell = Cell {
        errors: [Tally::default(), Tally::default()],
        point: Tally::default(),
        none: 0,
        not_ok: 0,
    };
    for seed in 0..trials {
        let [parent, child] = scene.measured(&mut Noise::new(seed));
        let input = Input::TwoBodies {
            parent: &parent,
            child: &child,
        };
        let outcome = fit(id, &input, options).expect(id);
        cell.not_ok += usize::from(outcome.verdict() != Verdict::Ok);
        let Some(e) = outcome.estimate() else {
            cell.none += 1;
            continue;
        };
        let sine = e.line.direction.cross(&truth.direction).norm();
        let angle = sine.atan2(e.line.direction.dot(&truth.direction).abs());
        let predicted = e.covariance.fixed_view::<3, 3>(0, 0).trace();
        cell.errors[0].add(angle * angle, predicted);
        let beside = e.line.distance_to_point(&truth.point);
        cell.errors[1].add(beside * beside, 0.0);
        // The covariance is that of the estimate's own point.
        let own = truth.distance_to_point(&e.line.point);
        let predicted = e.covariance.fixed_view::<3, 3>(3, 3).trace();
        cell.point.add(own * own, predicted);
    }
    cell
}

/// name, arc, frames, distance of the parent, its wandering, noise of parent and child.
fn cells() -> Vec<(&'static str, Scene)> {
    let cell = |arc, n, away, wander, levels| Scene::new(arc, n, away, wander, levels);
    vec![
        (
            "still parent, near",
            cell(120.0, 20, 0.15, 0.0, [level(1.0, 0.5); 2]),
        ),
        (
            "moving parent, near",
            cell(120.0, 20, 0.15, 0.5, [level(1.0, 0.5); 2]),
        ),
        (
            "moving parent, far",
            cell(120.0, 20, 0.8, 0.5, [level(1.0, 0.5); 2]),
        ),
        (
            "moving parent, coarse turns",
            cell(120.0, 20, 0.3, 0.5, [level(1.0, 2.0); 2]),
        ),
        (
            "moving parent, fine turns",
            cell(120.0, 20, 0.3, 0.5, [level(2.5, 0.1); 2]),
        ),
        (
            "moving parent, short arc",
            cell(40.0, 20, 0.3, 0.5, [level(1.0, 0.5); 2]),
        ),
        (
            "moving parent, six frames",
            cell(120.0, 6, 0.3, 0.5, [level(1.0, 0.5); 2]),
        ),
        (
            "moving parent, quiet child",
            cell(120.0, 20, 0.3, 0.5, [level(1.0, 0.5), level(0.2, 0.1)]),
        ),
        (
            "moving parent, quiet parent",
            cell(120.0, 20, 0.3, 0.5, [level(0.2, 0.1), level(1.0, 0.5)]),
        ),
    ]
}

/// Required: the bound, with one noise for both bodies. Where one body is seen better than the other the estimator, which knows
/// one level of each kind only, leaves a tenth or two unused. With 2° the model of the noise bends within it.
fn study(trials: u64) {
    for (name, scene) in cells() {
        let bound = scene.bound();
        let alike = scene.of_parent.t == scene.of_child.t;
        let least = match (alike, scene.of_child.r > 0.02) {
            (true, false) => 0.98,
            (true, true) => 0.93,
            (false, _) => 0.80,
        };
        let stated = Options {
            sigma_t: Some(scene.of_child.t),
            sigma_r: Some(scene.of_child.r),
            ..Options::default()
        };
        for (how, options) in [("unknown", Options::default()), ("stated", stated)] {
            if !alike && how == "stated" {
                continue;
            }
            let c = run(&scene, "hinge_poses", &options, trials);
            let efficiency = [0, 1].map(|k| c.errors[k].efficiency(bound[k]));
            let [(direction, a), (offset, b)] = efficiency;
            let ratio = |t: &Tally| t.predicted / t.error2;
            let ratios = [ratio(&c.errors[0]), ratio(&c.point)];
            println!(
                "{name}, noise {how}: efficiency of the direction {direction:.3} ± {a:.3}, of the offset {offset:.3} ± {b:.3}; \
                 covariance / error² {:.3}, {:.3}",
                ratios[0], ratios[1]
            );
            assert_eq!((c.none, c.not_ok), (0, 0), "{name}, noise {how}");
            for ((efficiency, mc), ratio) in efficiency.into_iter().zip(ratios) {
                assert!(
                    efficiency > least - 3.0 * mc,
                    "{name}, noise {how}: {efficiency:.3} ± {mc:.3}"
                );
                assert!(
                    !alike || (ratio - 1.0).abs() < 0.10 + 3.0 * mc,
                    "{name}, noise {how}: covariance / error² {ratio:.3}"
                );
            }
        }
    }
}

#[test]
fn the_axis_between_two_bodies_reaches_its_bound() {
    study(150);
}

#[test]
#[ignore = "study: 6 000 trials in every cell"]
fn the_axis_between_two_bodies_reaches_its_bound_in_full() {
    study(6000);
}

/// A parent that is known exactly and stands still leaves the bound of one body's poses: the child's alone.
#[test]
fn a_still_parent_known_exactly_leaves_one_body() {
    let levels = [level(0.0, 0.0), level(1.0, 0.5)];
    let mut bounds = Vec::new();
    for wander in [0.0, 0.5] {
        bounds.push(Scene::new(120.0, 20, 0.3, wander, levels).bound());
    }
    // The parent's wandering is known and takes nothing away.
    for (still, moving) in bounds[0].iter().zip(&bounds[1]) {
        assert!((still / moving - 1.0).abs() < 1e-3, "{still} {moving}");
    }
    // One body by the same rule, without parents: each pose's angle its only own unknown.
    let scene = Scene::new(120.0, 20, 0.3, 0.0, levels);
    let n = scene.angles.len();
    let mut information = DMatrix::<f64>::zeros(9 + n, 9 + n);
    for (i, angle) in scene.angles.iter().enumerate() {
        let inner = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *angle) * scene.y;
        let (of_w, of_y) = (
            se3::adjoint(&inner.inverse()),
            se3::adjoint(&scene.y.inverse()),
        );
        let mut j = DMatrix::<f64>::zeros(6, 9 + n);
        for (column, of) in [0, 1, 3, 4].into_iter().enumerate() {
            j.set_column(column, &of_w.column(of));
        }
        for (column, of) in [0, 1, 3, 4, 5].into_iter().enumerate() {
            j.set_column(4 + column, &of_y.column(of));
        }
        j.set_column(9 + i, &of_y.column(2));
        let (r, t) = (scene.of_child.r.powi(-2), scene.of_child.t.powi(-2));
        let weight = Matrix6::from_diagonal(&nalgebra::Vector6::new(r, r, r, t, t, t));
        information += j.transpose() * weight * j;
    }
    let inverse = information.cholesky().expect("an axis").inverse();
    let direction = inverse[(0, 0)] + inverse[(1, 1)];
    assert!(
        (bounds[0][0] / direction - 1.0).abs() < 1e-3,
        "{} {direction}",
        bounds[0][0]
    );
}
