//! A head with one marker near its axes, moved by little: the marker on the other side of the joints, and the robot turned, explain about the same.

use crate::scratch::Scratch;

use nalgebra::{Quaternion, UnitQuaternion};

const URDF: &str = r#"<robot name="head">
  <link name="torso"/><link name="neck"/><link name="skull"/>
  <joint name="pan" type="revolute"><parent link="torso"/><child link="neck"/>
    <origin xyz="0 0 0.1"/><axis xyz="0 0 1"/><limit lower="-1.5" upper="1.5" effort="1" velocity="1"/></joint>
  <joint name="tilt" type="revolute"><parent link="neck"/><child link="skull"/>
    <origin xyz="0.01 0 0.08"/><axis xyz="0 1 0"/><limit lower="-0.5" upper="0.8" effort="1" velocity="1"/></joint>
</robot>
"#;

fn profile(from_root: &str) -> String {
    format!(
        "calib: 1
robot: {{name: head, urdf: head.urdf}}
tracker: {{frame: lab{from_root}}}
bodies:
  dot: {{link: skull, markers: [dot]}}
recordings:
  poses: {{file: poses.csv, use: static}}
  checks: {{file: checks.csv, use: validation}}
solve:
  free: [bodies, tracker, joint_offsets, joint_axes]
  limits: {{held_out_rms_mm: 3, held_out_max_mm: 10}}
simulate:
  seed: 1
  tracker_from_root: {{xyz_mm: [1400, 300, -600], rpy_deg: [-50, 20, 60]}}
  mounts:
    dot: {{xyz_mm: [0, 0, 0], markers_mm: {{dot: [MX, MY, MZ]}}}}
  errors: {{joint_offset_deg: 0.3, axis_mm: 0.5, axis_deg: 0.1}}
  noise: {{marker_mm: 0.2}}
  recordings:
    poses:
      random: {{pan_deg: [-13, 13], tilt_deg: [4, 15]}}
      poses: 40
    checks:
      random: {{pan_deg: [-13, 13], tilt_deg: [4, 15]}}
      poses: 12
"
    )
}

/// Whether a session is accepted, whether it names two places, and whether the robot stands where it stood, to 60°.
fn judged(seed: u64, from_root: &str) -> (bool, bool, bool) {
    // Within 40 mm of the axes.
    let at = |k: u64| -40.0 + ((seed * 2 + 1) * (2 * k + 3) * 37 % 81) as f64;
    let mut text = profile(from_root);
    for (k, name) in ["MX", "MY", "MZ"].into_iter().enumerate() {
        text = text.replace(name, &at(k as u64).to_string());
    }
    let dir = Scratch::new()
        .file("head.urdf", URDF)
        .file("head.yaml", text);
    let seed = seed.to_string();
    dir.calib(["simulate", "head.yaml", "--seed", &seed, "--out", "."])
        .expect(0);
    let ran = dir.calib(["run", "head.yaml", "--out", "results"]);
    assert!(ran.code < 6 && ran.code != 3, "{seed}: {}", ran.stderr);
    let report = dir.json("results/report.json").to_string();
    let model = dir.json("results/head.calibrated.model.json");
    let q: Vec<f64> = serde_json::from_value(model["tracker_from_root"]["quat_xyzw"].clone())
        .expect("a rotation");
    let found = UnitQuaternion::from_quaternion(Quaternion::new(q[3], q[0], q[1], q[2]));
    let [roll, pitch, yaw] = [-50.0_f64, 20.0, 60.0].map(f64::to_radians);
    let true_one = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    let near = found.angle_to(&true_one) < 60_f64.to_radians();
    (ran.code == 0, report.contains("\"two-places\""), near)
}

/// Of forty sessions none is accepted in the wrong place; where the recordings do not decide, that is said.
#[test]
fn the_robot_is_not_accepted_in_the_wrong_place() {
    let seeds: Vec<u64> = (1..=40).collect();
    let mut all = Vec::new();
    for some in seeds.chunks(2) {
        std::thread::scope(|scope| {
            let runs: Vec<_> = some
                .iter()
                .map(|seed| scope.spawn(move || (*seed, judged(*seed, ""))))
                .collect();
            all.extend(runs.into_iter().map(|run| run.join().expect("a run")));
        });
    }
    let of = |wanted: fn(&(bool, bool, bool)) -> bool| -> Vec<u64> {
        let found = all.iter().filter(|(_, judged)| wanted(judged));
        found.map(|(seed, _)| *seed).collect()
    };
    let wrong = of(|(accepted, _, near)| *accepted && !near);
    assert!(wrong.is_empty(), "{all:?}");
    let (right, undecided) = (of(|(accepted, ..)| *accepted), of(|(_, two, _)| *two));
    assert!(right.len() >= 10 && undecided.len() >= 4, "{all:?}");
    // What is said mends it.
    let measured = ", from_root: {xyz_mm: [1400, 300, -600], rpy_deg: [-50, 20, 60], sigma_mm: 2, sigma_deg: 1}";
    for seed in undecided.into_iter().take(4) {
        assert_eq!(judged(seed, measured), (true, false, true), "{seed}");
    }
}
