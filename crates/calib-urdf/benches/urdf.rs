//! Forward kinematics of a 6R chain, its Jacobian, reading, and patching all six origins.

use calib_urdf::{RobotModel, UrdfEdit, patch};
use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Isometry3, Vector3};
use std::fmt::Write;
use std::hint::black_box;

/// Six turning joints with the axes of an industrial arm.
fn six_axes() -> String {
    let mut text = "<robot name=\"arm\">\n  <link name=\"l0\"/>\n".to_owned();
    for (i, axis) in ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"]
        .iter()
        .enumerate()
    {
        let _ = write!(
            text,
            "  <link name=\"l{next}\"><inertial><mass value=\"2\"/></inertial></link>\n  <joint name=\"j{next}\" type=\"revolute\">\n    <parent link=\"l{i}\"/>\n    \
             <child link=\"l{next}\"/>\n    <origin xyz=\"0.1 0 0.3\" rpy=\"0.01 -0.02 0.03\"/>\n    <axis xyz=\"{axis}\"/>\n    \
             <limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/>\n  </joint>\n",
            next = i + 1
        );
    }
    text + "</robot>\n"
}

fn bench(c: &mut Criterion) {
    let text = six_axes();
    let Ok(model) = RobotModel::from_urdf_text(&text, "arm.urdf") else {
        return;
    };
    let q = [0.3, -0.7, 1.1, 0.2, -0.4, 0.9];
    let Some(tip) = model.link_ids().last() else {
        return;
    };
    let mut poses = Vec::new();
    c.bench_function("fk_6r", |b| {
        b.iter(|| model.forward_kinematics_into(black_box(&q), black_box(&mut poses)))
    });
    c.bench_function("jacobian_6r", |b| {
        b.iter(|| model.jacobian(black_box(&q), tip))
    });
    c.bench_function("gravity_6r", |b| {
        b.iter(|| model.gravity_torques(black_box(&q), &Vector3::new(0.0, 0.0, -9.81)))
    });
    c.bench_function("read_6r", |b| {
        b.iter(|| RobotModel::from_urdf_text(black_box(&text), "arm.urdf"))
    });
    let edits: Vec<UrdfEdit> = (1..=6)
        .map(|i| UrdfEdit::SetOrigin {
            joint: format!("j{i}"),
            parent_link_from_joint: Isometry3::new(
                Vector3::new(0.1, 1e-3, 0.3),
                Vector3::new(0.01, 0.02, 0.03),
            ),
        })
        .collect();
    c.bench_function("patch_6r", |b| {
        b.iter(|| patch(black_box(&text), "arm.urdf", black_box(&edits)))
    });
}

criterion_group!(benches, bench);
criterion_main!(benches);
