//! A chain of joints in the parameters of Denavit and Hartenberg (1955), and of Hayati (1985) between parallel axes.
//!
//! Frame i has its z on the axis of joint i and moves with what the joint moves; q_i turns about z, or slides along it:
//!
//! ```text
//! root_from_link(q) = B · M(q_1) · T_1 · M(q_2) · T_2 … M(q_n) · E                            (1)
//! T = Rz(θ) Tz(d) Tx(a) Rx(α)                    axes that are not parallel                   (2)
//! T = Rz(θ) Tx(a) Rx(α) Ry(β)                    parallel axes                                (3)
//! ```
//!
//! B is where the first joint's frame of the URDF stands, its z turned onto the axis; E leads from the last frame to the link. Where
//! B lies on its axis and how it is turned about it is a convention, and with it θ and d of the first joint.

use std::f64::consts::FRAC_PI_2;

use calib_urdf::{JointId, LinkId, RobotModel};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

/// Axes whose angle's sine is below this (about 9°) are treated as parallel, as in `invariants`.
const PARALLEL: f64 = 0.15;

/// One number of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum DhParameter {
    /// Rotation about z, rad.
    Theta,
    /// Translation along z, m.
    D,
    /// Translation along x, m.
    A,
    /// Rotation about x, rad.
    Alpha,
    /// Rotation about y, rad; between parallel axes only.
    Beta,
}

impl DhParameter {
    /// Whether it is an angle.
    #[must_use]
    pub fn is_angle(self) -> bool {
        !matches!(self, Self::D | Self::A)
    }
}

/// How a row is written: the same for the nominal and the calibrated robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Form {
    /// Equation (3) instead of (2).
    pub parallel: bool,
    /// x against z_i × z_{i+1}: chosen so that the nominal a is not negative.
    pub flipped: bool,
}

/// T of equation (1) behind a joint.
#[derive(Debug, Clone, PartialEq)]
pub struct DhRow {
    /// The joint in front.
    pub joint: JointId,
    /// How it is written.
    pub form: Form,
    /// Four numbers.
    pub values: [(DhParameter, f64); 4],
}

/// A chain of joints as equation (1).
#[derive(Debug, Clone, PartialEq)]
pub struct DhChain {
    /// B.
    pub root_from_first: Isometry3<f64>,
    /// The T between the joints.
    pub rows: Vec<DhRow>,
    /// The last joint.
    pub last: JointId,
    /// E.
    pub last_from_link: Isometry3<f64>,
}

/// The chain from the root to a link; `forms` are those of the nominal robot, or `None` to choose them. `None` where fewer than
/// two joints move.
#[must_use]
pub fn dh_chain(model: &RobotModel, link: LinkId, forms: Option<&[Form]>) -> Option<DhChain> {
    let poses = model.forward_kinematics(&model.zero_positions());
    let chain = model.chain(model.root(), link);
    let joints = chain.iter().map(|step| step.joint);
    let axes: Vec<(JointId, Isometry3<f64>)> = joints
        .filter_map(|id| {
            let joint = model.joint(id);
            let axis = joint.kind.axis()?;
            let turned = onto(&axis);
            Some((id, poses[joint.child.index()] * turned))
        })
        .collect();
    let (first, _) = (axes.first()?, axes.get(1)?);
    let root_from_first = first.1;
    let mut frame = root_from_first;
    let mut rows = Vec::new();
    for (i, pair) in axes.windows(2).enumerate() {
        let next = frame.inverse() * pair[1].1;
        let (point, direction) = (next.translation.vector.into(), next.rotation * Vector3::z());
        let form = forms.map_or_else(|| form(&point, &direction), |forms| forms[i]);
        let row = DhRow {
            joint: pair[0].0,
            form,
            values: parameters(&point, &direction, form),
        };
        frame *= transform(&row.values);
        rows.push(row);
    }
    Some(DhChain {
        root_from_first,
        rows,
        last: axes.last()?.0,
        last_from_link: frame.inverse() * poses[link.index()],
    })
}

impl DhChain {
    /// How the rows are written.
    #[must_use]
    pub fn forms(&self) -> Vec<Form> {
        self.rows.iter().map(|row| row.form).collect()
    }
}

/// A rotation that takes z onto an axis.
fn onto(axis: &Vector3<f64>) -> UnitQuaternion<f64> {
    let turned = UnitQuaternion::rotation_between(&Vector3::z(), axis);
    // Against z: half a turn about x.
    turned.unwrap_or_else(|| UnitQuaternion::from_euler_angles(2.0 * FRAC_PI_2, 0.0, 0.0))
}

fn form(point: &Point3<f64>, direction: &Vector3<f64>) -> Form {
    let cross = Vector3::z().cross(direction);
    let parallel = cross.norm() <= PARALLEL;
    Form {
        parallel,
        // A length that is zero has no sign.
        flipped: !parallel && point.coords.dot(&cross) < -1e-9,
    }
}

/// From a frame on an axis to the next axis, a line in that frame.
fn parameters(
    point: &Point3<f64>,
    direction: &Vector3<f64>,
    form: Form,
) -> [(DhParameter, f64); 4] {
    use DhParameter::{A, Alpha, Beta, D, Theta};
    if form.parallel {
        // Where the axis meets the plane z = 0: p + s·z' with s = −p_z / z'_z.
        let at = point - direction * (point.z / direction.z);
        let theta = at.y.atan2(at.x);
        // Rx(α) Ry(β) e_z = (sin β, −sin α cos β, cos α cos β)
        let z = UnitQuaternion::from_euler_angles(0.0, 0.0, -theta) * direction;
        return [
            (Theta, theta),
            (A, at.x.hypot(at.y)),
            (Alpha, (-z.y).atan2(z.z)),
            (Beta, z.x.clamp(-1.0, 1.0).asin()),
        ];
    }
    let cross = Vector3::z().cross(direction);
    let sine = cross.norm();
    let sign = if form.flipped { -1.0 } else { 1.0 };
    let x = cross * (sign / sine);
    // Foot of the common normal on z: |d·z − p − t·z'| is smallest.
    let d = point.coords.cross(direction).dot(&cross) / (sine * sine);
    [
        (Theta, x.y.atan2(x.x)),
        (D, d),
        (A, point.coords.dot(&x)),
        (Alpha, sign * sine.atan2(direction.z)),
    ]
}

/// T of equations (2) and (3): the numbers are in the order in which they act.
#[must_use]
pub fn transform(values: &[(DhParameter, f64); 4]) -> Isometry3<f64> {
    let one = |(parameter, value): &(DhParameter, f64)| {
        let x = *value;
        let turn = |roll, pitch, yaw| {
            let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            Isometry3::from_parts(Translation3::identity(), rotation)
        };
        match parameter {
            DhParameter::Theta => turn(0.0, 0.0, x),
            DhParameter::D => Isometry3::translation(0.0, 0.0, x),
            DhParameter::A => Isometry3::translation(x, 0.0, 0.0),
            DhParameter::Alpha => turn(x, 0.0, 0.0),
            DhParameter::Beta => turn(0.0, x, 0.0),
        }
    };
    values
        .iter()
        .map(one)
        .fold(Isometry3::identity(), |a, b| a * b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_urdf::JointKind;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    /// Forward kinematics from the numbers alone, in 4 × 4 matrices written out: nothing of the code above.
    fn by_hand(chain: &DhChain, moved: &[(bool, f64)]) -> nalgebra::Matrix4<f64> {
        use nalgebra::Matrix4;
        let rz = |t: f64| {
            let (s, c) = t.sin_cos();
            Matrix4::new(c, -s, 0., 0., s, c, 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.)
        };
        let tz = |d: f64| {
            Matrix4::new(
                1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., d, 0., 0., 0., 1.,
            )
        };
        let motion = |(turns, q): (bool, f64)| if turns { rz(q) } else { tz(q) };
        let of = |row: &DhRow, wanted| {
            let mut values = row.values.iter().filter(|v| v.0 == wanted);
            values.next().map_or(0.0, |v| v.1)
        };
        let mut pose = chain.root_from_first.to_homogeneous();
        for (row, q) in chain.rows.iter().zip(moved) {
            let (st, ct) = of(row, DhParameter::Theta).sin_cos();
            let (sa, ca) = of(row, DhParameter::Alpha).sin_cos();
            let (d, a) = (of(row, DhParameter::D), of(row, DhParameter::A));
            let (sb, cb) = of(row, DhParameter::Beta).sin_cos();
            // The textbook's matrix, and Ry(β) behind it.
            #[rustfmt::skip]
            let dh = Matrix4::new(
                ct, -st * ca,  st * sa, a * ct,
                st,  ct * ca, -ct * sa, a * st,
                0.,  sa,       ca,      d,
                0.,  0.,       0.,      1.);
            let ry = Matrix4::new(
                cb, 0., sb, 0., 0., 1., 0., 0., -sb, 0., cb, 0., 0., 0., 0., 1.,
            );
            pose = pose * motion(*q) * dh * ry;
        }
        let last = moved[chain.rows.len()];
        pose * motion(last) * chain.last_from_link.to_homogeneous()
    }

    /// A robot of six joints: parallel, crossing, meeting and sliding axes, a fixed joint between, slightly disturbed.
    fn robot(rng: &mut ChaCha8Rng, disturbed: f64) -> RobotModel {
        let joints = [
            ("revolute", "0 0 0.3", "0 0 0", "0 0 1"),
            ("revolute", "0.1 0 0.2", "-1.5708 0 0", "0 0 1"),
            ("revolute", "0.4 0 0.05", "0 0 0.2", "0 0 1"),
            ("fixed", "0.02 0.03 0", "0.1 0 0", "0 0 1"),
            ("revolute", "0.3 0 0", "0.5 0.1 0.7", "0 -1 0"),
            ("prismatic", "0 0.1 0", "0 1.2 0", "1 0 0"),
            ("continuous", "0 0 0.1", "1.1 0 0", "0.6 0 0.8"),
            ("fixed", "0 0 0.1", "0 0 0.4", "0 0 1"),
        ];
        let mut text = String::from("<robot name=\"r\"><link name=\"l0\"/>");
        for (i, (kind, xyz, rpy, axis)) in joints.iter().enumerate() {
            let next = i + 1;
            text += &format!(
                "<link name=\"l{next}\"/><joint name=\"j{next}\" type=\"{kind}\"><parent link=\"l{i}\"/><child link=\"l{next}\"/>\
                 <origin xyz=\"{xyz}\" rpy=\"{rpy}\"/><axis xyz=\"{axis}\"/>\
                 <limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>"
            );
        }
        let mut model =
            RobotModel::from_urdf_text(&(text + "</robot>"), "r.urdf").expect("a robot");
        for id in model.joint_ids().collect::<Vec<_>>() {
            let mut small = || rng.random_range(-disturbed..=disturbed);
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(small(), small(), small()));
            let moved = Isometry3::from_parts(Translation3::new(small(), small(), small()), turn);
            let origin = model.joint(id).parent_link_from_joint * moved;
            model = model.with_origin(id, origin);
        }
        model
    }

    fn moves(model: &RobotModel, q: &[f64]) -> Vec<(bool, f64)> {
        let moving = model
            .joint_ids()
            .filter(|id| model.joint(*id).kind.axis().is_some());
        let turns = |kind: &JointKind| kind.turns();
        moving
            .map(|id| (turns(&model.joint(id).kind), model.position(q, id)))
            .collect()
    }

    #[test]
    fn the_numbers_alone_give_the_forward_kinematics_of_the_urdf() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for trial in 0..20 {
            let nominal = robot(&mut rng, 0.0);
            let disturbed = robot(&mut rng, 0.01);
            let link = nominal.link_id("l8").expect("the last link");
            let of_nominal = dh_chain(&nominal, link, None).expect("six joints");
            assert_eq!(of_nominal.rows.len(), 5);
            assert!(of_nominal.rows[1].form.parallel && !of_nominal.rows[0].form.parallel);
            let forms = of_nominal.forms();
            for (model, chain) in [
                (&nominal, of_nominal.clone()),
                (
                    &disturbed,
                    dh_chain(&disturbed, link, Some(&forms)).expect("six joints"),
                ),
            ] {
                for _ in 0..10 {
                    let q: Vec<f64> = model
                        .zero_positions()
                        .iter()
                        .map(|_| rng.random_range(-2.5..2.5))
                        .collect();
                    let urdf = model.forward_kinematics(&q)[link.index()].to_homogeneous();
                    let off = (by_hand(&chain, &moves(model, &q)) - urdf).amax();
                    assert!(off < 1e-9, "trial {trial}: {off}");
                }
            }
            // Small changes of the robot are small changes of the numbers: no row jumps.
            let after = dh_chain(&disturbed, link, Some(&forms)).expect("six joints");
            for (a, b) in of_nominal.rows.iter().zip(&after.rows) {
                for (x, y) in a.values.iter().zip(&b.values) {
                    let change = (y.1 - x.1).sin().atan2((y.1 - x.1).cos());
                    assert!(change.abs() < 0.4, "{x:?} {y:?}");
                }
            }
        }
    }

    #[test]
    fn offsets_of_the_joints_turn_the_nominal_zeros_into_the_calibrated_ones() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let (nominal, other) = (robot(&mut rng, 0.0), robot(&mut rng, 0.01));
        let link = nominal.link_id("l8").expect("the last link");
        let before = dh_chain(&nominal, link, None).expect("six joints");
        let after = dh_chain(&other, link, Some(&before.forms())).expect("six joints");
        // Everything calibrated but the zeros, and the offsets added to what the joints indicate.
        let mut mixed = after.clone();
        let at = [0.3, -0.7, 1.1, 0.0, 0.4, 0.2, -0.9, 0.0];
        let mut q = moves(&other, &at);
        for (i, (row, nominal)) in mixed.rows.iter_mut().zip(&before.rows).enumerate() {
            let offset = row.values[0].1 - nominal.values[0].1;
            row.values[0].1 = nominal.values[0].1;
            if q[i].0 {
                q[i].1 += offset;
            } else {
                row.values[0].1 += offset;
            }
        }
        let urdf = other.forward_kinematics(&at);
        let off = (by_hand(&mixed, &q) - urdf[link.index()].to_homogeneous()).amax();
        assert!(off < 1e-9, "{off}");
    }
}
