//! Forward kinematics, chains, Jacobians and gravity torques against hand-multiplied numbers and against each other.

use calib_urdf::kinematics::Passing;
use calib_urdf::{JointKind, RobotModel};
use nalgebra::{Isometry3, Matrix4, Point3, Vector3, Vector6};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

/// Two links swing in a vertical plane, a slider pushes out, a finger mimics a mimic; a camera sits on the base.
const ARM: &str = r#"<robot name="arm">
  <link name="base"><inertial><mass value="10"/><origin xyz="0 0 0.1"/></inertial></link>
  <link name="upper"><inertial><mass value="2"/><origin xyz="0.2 0 0"/></inertial></link>
  <link name="fore"><inertial><mass value="1"/><origin xyz="0.1 0 0.05" rpy="1 2 3"/></inertial></link>
  <link name="hand"/>
  <link name="finger"><inertial><mass value="0.3"/><origin xyz="0 0.02 0.01"/></inertial></link>
  <link name="camera"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.3" rpy="0 0 0.5"/>
    <axis xyz="0 2 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0" rpy="0.1 -0.2 0.3"/><axis xyz="0 1 0"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="fore"/><child link="hand"/><origin rpy="0 1.5707963267948966 0"/><axis xyz="0 0 1"/>
    <limit upper="0.2" effort="1" velocity="1"/>
  </joint>
  <joint name="thumb" type="revolute">
    <parent link="hand"/><child link="finger"/><origin xyz="0 0.05 0"/>
    <mimic joint="middle" multiplier="-2" offset="0.1"/>
  </joint>
  <joint name="middle" type="revolute">
    <parent link="camera"/><child link="shade"/><mimic joint="slide" multiplier="3"/>
  </joint>
  <link name="shade"/>
  <joint name="mount" type="fixed"><parent link="base"/><child link="camera"/><origin xyz="1 2 3"/></joint>
</robot>"#;

fn arm() -> RobotModel {
    RobotModel::from_urdf_text(ARM, "arm.urdf").unwrap()
}

fn named(pairs: &[(&str, f64)]) -> BTreeMap<String, f64> {
    pairs
        .iter()
        .map(|(name, value)| ((*name).to_owned(), *value))
        .collect()
}

#[test]
fn defaults_and_tree() {
    let model = arm();
    assert_eq!(model.link(model.root()).name, "base");
    let thumb = model.joint(model.joint_id("thumb").unwrap());
    assert_eq!(
        thumb.kind,
        JointKind::Revolute {
            axis: Vector3::x_axis()
        }
    );
    assert_eq!(thumb.limits.range(), None);
    let slide = model.joint(model.joint_id("slide").unwrap());
    assert_eq!(slide.limits.range(), Some((0.0, 0.2)));
    let middle = model.joint(model.joint_id("middle").unwrap());
    assert_eq!(middle.parent_link_from_joint, Isometry3::identity());
    let independent: Vec<_> = model
        .independent_joints()
        .map(|id| model.joint(id).name.as_str())
        .collect();
    assert_eq!(independent, ["shoulder", "elbow", "slide"]);
}

#[test]
fn a_chain_of_mimics_is_followed() {
    let model = arm();
    let q = model.positions(&named(&[("slide", 0.05)])).unwrap();
    // middle = 3·0.05; thumb = −2·middle + 0.1
    let thumb = model.joint_id("thumb").unwrap();
    assert!((model.position(&q, thumb) - (-2.0 * 0.15 + 0.1)).abs() < 1e-15);
    let law = model.joint(thumb).law;
    assert_eq!(
        (law.source, law.multiplier, law.offset),
        (model.joint_id("slide").unwrap(), -6.0, 0.1)
    );
}

/// The same chain by 4×4 matrices, written out.
#[test]
fn a_hand_multiplied_chain() {
    let model = arm();
    let q = model
        .positions(&named(&[
            ("shoulder", 0.7),
            ("elbow", -1.1),
            ("slide", 0.12),
        ]))
        .unwrap();
    let rx = |a: f64| {
        Matrix4::new(
            1.,
            0.,
            0.,
            0.,
            0.,
            a.cos(),
            -a.sin(),
            0.,
            0.,
            a.sin(),
            a.cos(),
            0.,
            0.,
            0.,
            0.,
            1.,
        )
    };
    let ry = |a: f64| {
        Matrix4::new(
            a.cos(),
            0.,
            a.sin(),
            0.,
            0.,
            1.,
            0.,
            0.,
            -a.sin(),
            0.,
            a.cos(),
            0.,
            0.,
            0.,
            0.,
            1.,
        )
    };
    let rz = |a: f64| {
        Matrix4::new(
            a.cos(),
            -a.sin(),
            0.,
            0.,
            a.sin(),
            a.cos(),
            0.,
            0.,
            0.,
            0.,
            1.,
            0.,
            0.,
            0.,
            0.,
            1.,
        )
    };
    let t = |x, y, z| Matrix4::new(1., 0., 0., x, 0., 1., 0., y, 0., 0., 1., z, 0., 0., 0., 1.);
    let expected = t(0., 0., 0.3)
        * rz(0.5)
        * ry(0.7)
        * t(0.4, 0., 0.)
        * rz(0.3)
        * ry(-0.2)
        * rx(0.1)
        * ry(-1.1)
        * ry(FRAC_PI_2)
        * t(0., 0., 0.12)
        * t(0., 0.05, 0.)
        * rx(-6.0 * 0.12 + 0.1);
    let finger = model.link_id("finger").unwrap();
    let got = model.forward_kinematics(&q)[finger.index()];
    assert!(
        (got.to_homogeneous() - expected).norm() < 1e-15,
        "{got}\n{expected}"
    );
    let single = model.root_from_link(&q, finger);
    assert!((single.to_homogeneous() - expected).norm() < 1e-15);
}

#[test]
fn chains_go_up_and_down_with_their_signs() {
    let model = arm();
    let link = |name| model.link_id(name).unwrap();
    let chain: Vec<_> = model
        .chain(link("fore"), link("camera"))
        .into_iter()
        .map(|step| (model.joint(step.joint).name.clone(), step.passing))
        .collect();
    let expected = [
        ("elbow", Passing::Backward),
        ("shoulder", Passing::Backward),
        ("mount", Passing::Forward),
    ];
    assert_eq!(
        chain,
        expected.map(|(name, passing)| (name.to_owned(), passing))
    );
    assert!(model.chain(link("hand"), link("hand")).is_empty());
    let up: Vec<_> = model
        .chain_to_root(link("hand"))
        .iter()
        .map(|id| model.joint(*id).name.clone())
        .collect();
    assert_eq!(up, ["slide", "elbow", "shoulder"]);

    let q = model
        .positions(&named(&[
            ("shoulder", 0.7),
            ("elbow", -1.1),
            ("slide", 0.12),
        ]))
        .unwrap();
    let root_from_link = model.forward_kinematics(&q);
    for from in model.link_ids() {
        for to in model.link_ids() {
            let expected = root_from_link[from.index()].inverse() * root_from_link[to.index()];
            let got = model.link_from_link(&q, from, to);
            assert!((got.to_homogeneous() - expected.to_homogeneous()).norm() < 1e-14);
        }
    }
}

fn some_positions(model: &RobotModel) -> Vec<f64> {
    let mut q = model.zero_positions();
    for (i, id) in model.independent_joints().enumerate() {
        q[id.index()] = 0.3 - 0.55 * i as f64;
    }
    q
}

/// Central differences err by h²/6 · q''' ≈ 1e-11, rounding by 1e-16/h = 1e-11.
const STEP: f64 = 1e-5;

#[test]
fn the_jacobian_is_the_derivative_of_the_forward_kinematics() {
    let model = arm();
    let q = some_positions(&model);
    for link in model.link_ids() {
        let columns = model.jacobian(&q, link);
        for joint in model.independent_joints() {
            let (mut after, mut before) = (q.clone(), q.clone());
            after[joint.index()] += STEP;
            before[joint.index()] -= STEP;
            let here = model.root_from_link(&q, link);
            let log = |q: &[f64]| {
                let moved = here.inverse() * model.root_from_link(q, link);
                let (w, v) = (moved.rotation.scaled_axis(), moved.translation.vector);
                Vector6::new(w.x, w.y, w.z, v.x, v.y, v.z)
            };
            let numeric = (log(&after) - log(&before)) / (2.0 * STEP);
            let column = columns
                .iter()
                .find(|(id, _)| *id == joint)
                .map_or_else(Vector6::zeros, |(_, c)| *c);
            assert!(
                (numeric - column).norm() < 1e-9,
                "{} {}: {numeric} {column}",
                model.link(link).name,
                model.joint(joint).name
            );
        }
    }
}

#[test]
fn gravity_torques_are_the_derivative_of_the_potential_energy() {
    // Without mimics a joint's own torque is the whole derivative.
    let model = RobotModel::from_urdf_text(
        &ARM.replace(
            "<mimic joint=\"middle\" multiplier=\"-2\" offset=\"0.1\"/>",
            "",
        ),
        "arm.urdf",
    )
    .unwrap();
    let gravity = Vector3::new(1.0, -2.0, -9.0);
    let q = some_positions(&model);
    let energy = |q: &[f64]| {
        model
            .center_of_mass(q)
            .map_or(0.0, |(mass, c)| -mass * gravity.dot(&c.coords))
    };
    let torque = model.gravity_torques(&q, &gravity);
    for joint in model
        .independent_joints()
        .filter(|id| model.joint(*id).name != "slide")
    {
        let (mut after, mut before) = (q.clone(), q.clone());
        after[joint.index()] += STEP;
        before[joint.index()] -= STEP;
        let numeric = (energy(&after) - energy(&before)) / (2.0 * STEP);
        let got = torque[joint.index()];
        assert!(
            (numeric - got).abs() < 1e-8,
            "{}: {numeric} {got}",
            model.joint(joint).name
        );
    }
}

#[test]
fn gravity_torques_by_hand() {
    let text = r#"<robot name="p"><link name="b"/>
      <link name="l"><inertial><mass value="2"/><origin xyz="0.5 0 0"/></inertial></link>
      <joint name="j" type="continuous"><parent link="b"/><child link="l"/><axis xyz="0 1 0"/></joint>
      <link name="s"><inertial><mass value="3"/></inertial></link>
      <joint name="lift" type="prismatic"><parent link="l"/><child link="s"/><axis xyz="0 0 1"/></joint></robot>"#;
    let model = RobotModel::from_urdf_text(text, "p.urdf").unwrap();
    let torque = model.gravity_torques(&[0.0, 0.0], &Vector3::new(0.0, 0.0, -10.0));
    // +q about y lowers a rod along +x: holding it takes −2 kg · 10 m/s² · 0.5 m. The lift carries 3 kg.
    assert!(
        (torque[0] + 10.0).abs() < 1e-12 && (torque[1] - 30.0).abs() < 1e-12,
        "{torque:?}"
    );
    let upright = model.gravity_torques(&[-FRAC_PI_2, 0.0], &Vector3::new(0.0, 0.0, -10.0));
    assert!(
        upright[0].abs() < 1e-12 && upright[1].abs() < 1e-12,
        "{upright:?}"
    );
    assert_eq!(
        model.center_of_mass(&[0.0, 0.0]),
        Some((5.0, Point3::new(0.2, 0.0, 0.0)))
    );
}

#[test]
fn a_wrong_name_is_answered_with_the_nearest() {
    let model = arm();
    insta::assert_snapshot!(model.joint_id("elbo").unwrap_err(), @"the robot `arm` has no joint `elbo`; did you mean `elbow`?");
    insta::assert_snapshot!(model.link_id("tool0").unwrap_err(), @"the robot `arm` has no link `tool0`");
    insta::assert_snapshot!(model.positions(&named(&[("shulder", 1.0)])).unwrap_err(), @"the robot `arm` has no joint `shulder`; did you mean `shoulder`?");
}
