//! Axes with a sign, frames and hand-eye transforms.

use crate::fit::{jitter, numbers, pivot};
use crate::scratch::Scratch;
use serde_json::Value;

#[test]
fn an_axis_takes_its_sign_from_the_joint_and_goes_through_a_stated_center() {
    let dir = pivot();
    // The joint `a` alone: about z through (0.1, 0.2).
    let rows: Vec<String> = dir
        .read("pivot.csv")
        .lines()
        .enumerate()
        .filter(|(i, _)| *i == 0 || (i - 1) % 7 == 3)
        .map(|(_, line)| line.to_owned())
        .collect();
    let lost = rows[3]
        .rsplit_once(',')
        .and_then(|(rest, _)| rest.rsplit_once(','));
    let lost = format!("{},,0", lost.expect("columns").0);
    let mut gap = rows.clone();
    gap[3] = lost;
    let dir = dir
        .file("axis.csv", rows.join("\n") + "\n")
        .file("gap.csv", gap.join("\n") + "\n");
    let fit = |file: &str, more: &[&str]| {
        let mut arguments = vec!["fit", "aor", file, "--json"];
        arguments.extend(more);
        dir.calib_with(&arguments).expect(0).json()
    };
    let up = fit("axis.csv", &["--towards", "0,0,1"]);
    let down = fit("axis.csv", &["--towards", "0,0,-1"]);
    assert!(numbers(&up["direction"])[2] > 0.999 && numbers(&down["direction"])[2] < -0.999);
    let encoder = fit("axis.csv", &["--joint", "a", "--towards", "0,0,-1"]);
    assert!(numbers(&encoder["direction"])[2] > 0.999, "{encoder}");
    // A row without an angle is left out.
    let six = fit("gap.csv", &["--joint", "a"]);
    assert_eq!((&encoder["used"], &six["used"]), (&7.into(), &6.into()));
    let held = fit(
        "axis.csv",
        &["--estimator", "planar_radial", "--center-m", "0.1,0.2,0.3"],
    );
    assert!(numbers(&held["direction"])[2].abs() > 0.999, "{held}");
    let ran = dir
        .calib(["fit", "aor", "axis.csv", "--towards", "0,0,0"])
        .expect(2);
    assert!(ran.stderr.contains("no direction"), "{}", ran.stderr);
    let ran = dir
        .calib(["fit", "aor", "axis.csv", "--joint", "elbow"])
        .expect(3);
    assert!(ran.stderr.contains("it has `a`, `b`"), "{}", ran.stderr);
}

/// Two tables of poses of one motion with a little noise; `spoil` edits the robot's numbers (x, y, z, qx, qy, qz, qw).
fn hand_eye(spoil: impl Fn([f64; 7]) -> [f64; 7]) -> Scratch {
    use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
    let x = Isometry3::new(Vector3::new(0.05, 0.02, 0.1), Vector3::new(0.1, 0.3, -0.2));
    let z = Isometry3::new(Vector3::new(1.0, -0.5, 0.2), Vector3::new(0.1, 0.4, 1.2));
    let names = ["x", "y", "z", "qx", "qy", "qz", "qw"];
    let header = |prefix: &str| names.map(|n| format!("{prefix}_{n}")).join(",");
    let mut table = format!("{},{}\n", header("flange"), header("meas"));
    for k in 0..20_usize {
        let t = k as f64;
        let a = Isometry3::new(
            Vector3::new(
                0.4 * (0.9 * t).sin(),
                0.4 * (1.3 * t).cos(),
                0.3 * (2.1 * t).sin(),
            ),
            Vector3::new((0.7 * t).sin(), (1.1 * t).cos(), (1.9 * t).sin()),
        );
        let noise = |from: usize, size: f64| {
            Vector3::from_fn(|i, _| size * jitter(700 + 31 * k + 3 * from + i))
        };
        let seen = z.inverse() * a * x;
        let b = Isometry3::from_parts(
            Translation3::from(seen.translation.vector + noise(0, 3e-4)),
            seen.rotation * UnitQuaternion::from_scaled_axis(noise(1, 1e-3)),
        );
        let seven = |p: &Isometry3<f64>| {
            let (t, q) = (p.translation.vector, p.rotation.coords);
            [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
        };
        let cells: Vec<String> = spoil(seven(&a))
            .iter()
            .chain(&seven(&b))
            .map(f64::to_string)
            .collect();
        table += &(cells.join(",") + "\n");
    }
    Scratch::new().file("pairs.csv", table)
}

/// The flange as a matrix and the board as a rotation vector give what quaternions give.
#[test]
fn hand_and_eye_are_read_in_other_notations() {
    let quaternions = hand_eye(|p| p);
    let text = quaternions.read("pairs.csv");
    let entries = (0..9).map(|k| format!("flange_r{}{}", k / 3 + 1, k % 3 + 1));
    let entries: Vec<String> = entries.collect();
    let mut table = format!(
        "flange_x,flange_y,flange_z,{},meas_x,meas_y,meas_z,meas_rvec_x,meas_rvec_y,meas_rvec_z\n",
        entries.join(",")
    );
    for row in text.lines().skip(1) {
        let cells: Vec<f64> = row
            .split(',')
            .map(|c| c.parse().expect("a number"))
            .collect();
        let turned = |q: &[f64]| {
            nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
                q[3], q[0], q[1], q[2],
            ))
        };
        let (a, b) = (turned(&cells[3..7]), turned(&cells[10..14]));
        let rows = a.to_rotation_matrix().transpose();
        let vector = b.scaled_axis();
        let numbers = cells[..3].iter().chain(rows.matrix().iter());
        let numbers = numbers.chain(&cells[7..10]).copied();
        let numbers = numbers.chain(vector.iter().copied());
        let numbers: Vec<String> = numbers.map(|x| x.to_string()).collect();
        table += &(numbers.join(",") + "\n");
    }
    let others = Scratch::new().file("pairs.csv", table);
    let fit = |dir: &Scratch| {
        dir.calib(["fit", "handeye", "pairs.csv", "--json"])
            .expect(0)
            .json()
    };
    let (one, other) = (fit(&quaternions), fit(&others));
    assert_eq!(one["verdict"], other["verdict"]);
    let numbers = |answer: &Value| -> Vec<f64> {
        let all = answer["covariance"].as_array().expect("a matrix");
        let rows = all.iter().flat_map(|row| row.as_array().expect("a row"));
        rows.filter_map(Value::as_f64).collect()
    };
    let (one, other) = (numbers(&one), numbers(&other));
    assert_eq!((one.len(), other.len()), (144, 144));
    let largest = one.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let off = one.iter().zip(&other).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-6 * largest);
    // What is missing is said of the first notation.
    let broken = Scratch::new().file("pairs.csv", text.replace("meas_qw", "meas_qv"));
    let ran = broken.calib(["fit", "handeye", "pairs.csv"]);
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    let words = ran.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        words.contains("meas_qw") && words.contains("_rvec_x"),
        "{words}"
    );
}

#[test]
fn hand_and_eye_are_judged() {
    let fit = |dir: &Scratch, code: i32| {
        dir.calib(["fit", "handeye", "pairs.csv", "--json"])
            .expect(code)
            .json()
    };
    let clean = fit(&hand_eye(|p| p), 0);
    assert_eq!(
        (&clean["verdict"], &clean["explanation"]),
        (&"ok".into(), &Value::Null)
    );
    assert_eq!(clean["covariance"].as_array().map(Vec::len), Some(12));
    let text = hand_eye(|p| p)
        .calib(["fit", "handeye", "pairs.csv"])
        .expect(0)
        .stdout;
    assert!(
        text.contains("sigma") && text.contains("degrees of freedom"),
        "{text}"
    );
    // Quaternions as w, x, y, z; millimeters; inverted poses.
    type Spoil = fn([f64; 7]) -> [f64; 7];
    let spoiled: [(&str, Spoil); 2] = [
        ("quaternions are stored as w, x, y, z", |p| {
            [p[0], p[1], p[2], p[6], p[3], p[4], p[5]]
        }),
        ("positions are in millimeters", |p| {
            [1e3 * p[0], 1e3 * p[1], 1e3 * p[2], p[3], p[4], p[5], p[6]]
        }),
    ];
    for (says, spoil) in spoiled {
        let dir = hand_eye(spoil);
        let found = fit(&dir, 4);
        assert_eq!(found["verdict"], "weak", "{found}");
        let reason = found["reason"].as_str().unwrap_or_default();
        assert!(reason.contains(says), "{reason}");
    }
}

/// A detector states the board in the camera: named without `--inverted`, right with it, and `--optical` turns the frame as REP 103 says.
#[test]
fn a_camera_s_own_direction_is_named_and_understood() {
    let camera = |arguments: &[&str], code: i32| {
        let dir = Scratch::new().file(
            "camera.csv",
            std::fs::read(crate::scratch::root().join("book/src/hand-eye/camera.csv"))
                .expect("the book's example"),
        );
        let command = ["fit", "handeye", "camera.csv", "--measured", "board"];
        dir.calib_with(&[&command[..], arguments].concat())
            .expect(code)
    };
    let wrong = camera(&[], 4).stdout;
    assert!(
        wrong.contains("poses are inverted") && wrong.contains("run it again with --inverted"),
        "{wrong}"
    );
    let found = camera(&["--inverted", "--optical", "--json"], 0).json();
    // Where the example's camera is.
    let truth = [0.042, -0.003, 0.081];
    for (k, truth) in truth.iter().enumerate() {
        let at = found["x"]["translation_m"][k].as_f64().expect("m");
        let variance = found["covariance"][3 + k][3 + k].as_f64().expect("m²");
        assert!((at - truth).abs() < 4.0 * variance.sqrt(), "{found}");
        let linked = found["camera_link_urdf"]["xyz_m"][k].as_f64().expect("m");
        assert!((at - linked).abs() < 1e-12, "{found}");
    }
    // The camera looks along its z axis: the x axis of its frame in a URDF.
    let rotation = |of: &Value| {
        let angle = |k: usize| of["rpy_rad"][k].as_f64().expect("rad");
        nalgebra::Rotation3::from_euler_angles(angle(0), angle(1), angle(2))
    };
    let view = rotation(&found["x_urdf"]) * nalgebra::Vector3::z();
    let forward = rotation(&found["camera_link_urdf"]) * nalgebra::Vector3::x();
    assert!((view - forward).norm() < 1e-9, "{found}");
    let down = rotation(&found["x_urdf"]) * nalgebra::Vector3::y();
    let up = rotation(&found["camera_link_urdf"]) * nalgebra::Vector3::z();
    assert!((down + up).norm() < 1e-9, "{found}");
}

#[test]
fn rows_with_gross_errors_are_named_as_in_the_file() {
    let table = hand_eye(|p| p).read("pairs.csv");
    let spoil = |lost: Option<usize>| {
        let rows: Vec<String> = table
            .lines()
            .enumerate()
            .map(|(line, text)| {
                let mut cells: Vec<String> = text.split(',').map(str::to_owned).collect();
                if line == 9 {
                    let x: f64 = cells[7].parse().expect("a number");
                    cells[7] = (x + 0.03).to_string();
                }
                if Some(line) == lost {
                    cells[7..].iter_mut().for_each(String::clear);
                }
                cells.join(",")
            })
            .collect();
        Scratch::new().file("pairs.csv", rows.join("\n") + "\n")
    };
    let fit = |dir: &Scratch| {
        let ran = dir.calib(["fit", "handeye", "pairs.csv", "--json"]);
        ran.expect(0).json()
    };
    let (all, fewer) = (fit(&spoil(None)), fit(&spoil(Some(4))));
    assert_eq!((&all["used"], &fewer["used"]), (&19.into(), &18.into()));
    assert_eq!(all["rejected"].as_array().map(Vec::len), Some(1), "{all}");
    // A lost pose before it does not change its number.
    assert_eq!(all["rejected"], fewer["rejected"], "{fewer}");
}

#[test]
fn frames_and_hand_eyes_go_the_road_of_all_estimators() {
    let dir = hand_eye(|p| p);
    for (what, known) in [("handeye", "handeye"), ("frame", "algorithm1")] {
        let list = dir
            .calib(["fit", what, "--list", "--json"])
            .expect(0)
            .json();
        let mut ids = list.as_array().expect("a list").iter();
        assert!(ids.any(|e| e["id"] == known), "{what}: {list}");
    }
    let all = dir
        .calib(["fit", "handeye", "pairs.csv", "--all", "--json"])
        .expect(0)
        .json();
    assert!(
        all.as_array()
            .is_some_and(|a| a.iter().all(|e| e["agrees"] == true)),
        "{all}"
    );
    let unknown = dir
        .calib(["fit", "handeye", "pairs.csv", "--estimator", "handeyes"])
        .expect(2);
    assert!(
        unknown.stderr.contains("did you mean `handeye`?"),
        "{}",
        unknown.stderr
    );
    let frame = pivot().calib([
        "fit",
        "frame",
        "pivot.csv",
        "--proximal",
        "z=a",
        "--distal",
        "x=b",
        "--all",
    ]);
    assert_eq!(frame.code, 0, "{}", frame.stderr);
}
