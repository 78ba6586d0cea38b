//! Jacobian and covariance against differences of poses.

use calib_model::file::{ModelPose, RobotModelFile};
use calib_model::nalgebra::{
    DMatrix, Isometry3, Matrix6, Quaternion, UnitQuaternion, Vector3, Vector6,
};
use calib_model::{Model, Place, Pose, Under};

use crate::common::{Effects, WARM, pose, posture, rng, robot, with_uncertainty};

/// Twist from one pose to another, [ω; v] in the first.
fn between(a: &Pose, b: &Pose) -> Vector6<f64> {
    let d = a.inverse().then(b).isometry();
    let omega = d.rotation.scaled_axis();
    let v = d.translation.vector;
    Vector6::new(omega.x, omega.y, omega.z, v.x, v.y, v.z)
}

fn at(model: &Model, q: &[f64], place: Place, approach: &[f64], tracker: bool) -> Pose {
    let mut work = model.work();
    let under = Under {
        approach,
        held: None,
        temperature_c: &WARM[..model.joints().len()],
    };
    model.forward(q, &under, &mut work).expect("poses");
    match tracker {
        true => model.tracker_from(place, &work),
        false => model.root_from(place, &work),
    }
    .expect("a place")
}

#[test]
fn the_jacobian_is_the_slope_of_the_pose() {
    /// Differences of the fourth order at steps of 1e-4, harmonics of a motor at 100 per turn.
    const SAME: f64 = 2e-6;
    for seed in 0..60 {
        let mut r = rng(seed);
        let file = robot(&mut r, 7, seed % 2 == 0, Effects::Smooth);
        let model = Model::new(&file).expect("a model");
        let dof = model.joints().len();
        let q = posture(&mut r, dof);
        let mut work = model.work();
        for link in [model.last_link(), model.link("link_3").expect("a link")] {
            let mut jacobian = vec![0.0; 6 * dof];
            let under = Under {
                temperature_c: &WARM[..dof],
                ..Under::default()
            };
            model
                .jacobian(&q, link, &under, &mut work, &mut jacobian)
                .expect("a jacobian");
            let base = at(&model, &q, link.into(), &[], false);
            for k in 0..dof {
                const H: f64 = 1e-4;
                let moved = |by: f64| {
                    let mut q = q.clone();
                    q[k] += by;
                    between(&base, &at(&model, &q, link.into(), &[], false))
                };
                let near = (moved(H) - moved(-H)) / (2.0 * H);
                let far = (moved(2.0 * H) - moved(-2.0 * H)) / (4.0 * H);
                let slope = (near * 4.0 - far) / 3.0;
                let own = Vector6::from_column_slice(&jacobian[6 * k..6 * k + 6]);
                assert!(
                    (own - slope).norm() < SAME,
                    "seed {seed}, joint {k}: {own} {slope}"
                );
            }
        }
    }
}

fn isometry(p: &ModelPose) -> Isometry3<f64> {
    let [x, y, z, w] = p.quat_xyzw;
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Vector3::from(p.xyz_m).into(), turn)
}

/// The file with one of its uncertain numbers changed.
fn moved(file: &RobotModelFile, n: usize, by: f64) -> RobotModelFile {
    let number = &file.uncertainty.as_ref().expect("stated").numbers[n];
    let mut out = file.clone();
    let axis = ["rx", "ry", "rz", "x", "y", "z"]
        .iter()
        .position(|c| *c == number.number);
    let shift = |p: &mut ModelPose| {
        let k = axis.expect("of a pose");
        let (v, w) = match k {
            0..3 => (Vector3::zeros(), Vector3::ith(k, by)),
            _ => (Vector3::ith(k - 3, by), Vector3::zeros()),
        };
        *p = pose(&(isometry(p) * Isometry3::new(v, w)));
    };
    match number.of.as_str() {
        "tracker" => shift(&mut out.tracker_from_root),
        "body" => {
            let body = out.bodies.get_mut(&number.name).expect("known");
            shift(body.link_from_body.as_mut().expect("a frame"));
        }
        "point" => {
            out.points.get_mut(&number.name).expect("known").xyz_m[axis.expect("x, y or z") - 3] +=
                by
        }
        "link" => {
            let link = out
                .links
                .iter_mut()
                .find(|l| l.name == number.name)
                .expect("known");
            link.first_moment_kg_m[axis.expect("x, y or z") - 3] += by;
        }
        _ => {
            let joint = out
                .joints
                .iter_mut()
                .find(|j| j.name == number.name)
                .expect("known");
            match (axis, number.number.strip_prefix("coupling:")) {
                (Some(_), _) => shift(&mut joint.parent_from_joint),
                (None, other) => {
                    let kind = other.map_or(number.number.as_str(), |_| "coupling");
                    let effect = joint.effects.iter_mut().find(|e| e.kind == kind);
                    effect.expect("an effect").value += by;
                }
            }
        }
    }
    out
}

#[test]
fn the_covariance_is_that_of_the_numbers() {
    for seed in 0..12 {
        let mut r = rng(100 + seed);
        let file = with_uncertainty(robot(&mut r, 5, seed % 2 == 0, Effects::All), &mut r);
        let model = Model::new(&file).expect("a model");
        let dof = model.joints().len();
        let q = posture(&mut r, dof);
        let approach: Vec<f64> = (0..dof)
            .map(|k| if k % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        let uncertainty = file.uncertainty.as_ref().expect("stated");
        let rows = uncertainty.root.len();
        let root = uncertainty.root.iter().flatten().copied();
        let root = DMatrix::from_row_iterator(rows, uncertainty.root[0].len(), root);
        let mut work = model.work();
        for (place, tracker) in [
            (model.last_link().into(), false),
            (model.place("body").expect("a body"), true),
            (model.place("tip").expect("a point"), false),
        ] {
            let base = at(&model, &q, place, &approach, tracker);
            let mut g = DMatrix::zeros(6, rows);
            for n in 0..rows {
                const H: f64 = 1e-6;
                let there = |by: f64| {
                    let model = Model::new(&moved(&file, n, by)).expect("a model");
                    between(&base, &at(&model, &q, place, &approach, tracker))
                };
                g.set_column(n, &((there(H) - there(-H)) / (2.0 * H)));
            }
            let spread = &g * &root;
            let expected = &spread * spread.transpose();
            let expected = Matrix6::from_iterator(expected.iter().copied());
            let under = Under {
                approach: &approach,
                held: None,
                temperature_c: &WARM[..model.joints().len()],
            };
            let own = match tracker {
                true => model.sigma_in_tracker(&q, place, &under, &mut work),
                false => model.sigma(&q, place, &under, &mut work),
            }
            .expect("a covariance");
            let off = (own - expected).norm() / expected.norm();
            assert!(off < 1e-6, "seed {seed}, {place:?}: {off:e}");
        }
    }
}
