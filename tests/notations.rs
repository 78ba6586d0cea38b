//! Orientations in the notations of other programs: `calib init` reads them, the motion decides where names do not, and a run gives what it gives
//! for quaternions.

use crate::scratch;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;

/// σ of a position, m, and of an orientation, rad.
const NOISE: (f64, f64) = (2e-4, 5e-4);

/// The arm of the drawing.
fn arm() -> String {
    crate::computed::arm(0.0, 0)
}

/// A way to write a pose: the names of its columns, the numbers, and what the column map must say of it.
struct Way {
    names: &'static str,
    numbers: fn(&Isometry3<f64>) -> Vec<f64>,
    map: &'static str,
}

fn place(pose: &Isometry3<f64>, per_meter: f64) -> Vec<f64> {
    pose.translation
        .vector
        .iter()
        .map(|v| v * per_meter)
        .collect()
}

fn with(mut place: Vec<f64>, turn: impl IntoIterator<Item = f64>) -> Vec<f64> {
    place.extend(turn);
    place
}

fn degrees(angles: [f64; 3]) -> [f64; 3] {
    angles.map(f64::to_degrees)
}

/// Roll, pitch and yaw about fixed axes: by the formula of URDF's own definition.
fn fixed(pose: &Isometry3<f64>) -> [f64; 3] {
    let r = pose.rotation.to_rotation_matrix();
    [
        r[(2, 1)].atan2(r[(2, 2)]),
        (-r[(2, 0)]).asin(),
        r[(1, 0)].atan2(r[(0, 0)]),
    ]
}

/// Angles about x, the new y and the new z.
fn turning(pose: &Isometry3<f64>) -> [f64; 3] {
    let r = pose.rotation.to_rotation_matrix();
    [
        (-r[(1, 2)]).atan2(r[(2, 2)]),
        r[(0, 2)].asin(),
        (-r[(0, 1)]).atan2(r[(0, 0)]),
    ]
}

/// Angles about z, the new y and the new z.
fn zyz(pose: &Isometry3<f64>) -> [f64; 3] {
    let r = pose.rotation.to_rotation_matrix();
    [
        r[(1, 2)].atan2(r[(0, 2)]),
        r[(2, 2)].acos(),
        r[(2, 1)].atan2(-r[(2, 0)]),
    ]
}

fn vector(pose: &Isometry3<f64>) -> Vec<f64> {
    pose.rotation.scaled_axis().iter().copied().collect()
}

fn scalar_last(pose: &Isometry3<f64>) -> Vec<f64> {
    pose.rotation.coords.iter().copied().collect()
}

fn scalar_first(pose: &Isometry3<f64>) -> Vec<f64> {
    let Quaternion { coords } = *pose.rotation.quaternion();
    vec![coords.w, coords.x, coords.y, coords.z]
}

/// A matrix, column by column as it is stored.
fn columns(pose: &Isometry3<f64>) -> Vec<f64> {
    let matrix = pose.rotation.to_rotation_matrix();
    matrix.matrix().iter().copied().collect()
}

fn rows(pose: &Isometry3<f64>) -> Vec<f64> {
    let matrix = pose.rotation.to_rotation_matrix().transpose();
    matrix.matrix().iter().copied().collect()
}

fn about_axis(pose: &Isometry3<f64>) -> [f64; 4] {
    let (axis, angle) = pose.rotation.axis_angle().expect("turned");
    [axis.x, axis.y, axis.z, angle]
}

/// What cameras, controllers and loggers write.
const WAYS: [Way; 27] = [
    Way {
        names: "T_x,T_y,T_z,R_x,R_y,R_z",
        numbers: |p| with(place(p, 1.0), vector(p)),
        map: "rotation_vector: [R_x, R_y, R_z]",
    },
    Way {
        names: "Q0,Qx,Qy,Qz,Tx,Ty,Tz",
        numbers: |p| with(scalar_first(p), place(p, 1e3)),
        map: "quaternion_xyzw: [Qx, Qy, Qz, Q0]",
    },
    Way {
        names: "hand_x_mm,hand_y_mm,hand_z_mm,hand_rotx_deg,hand_roty_deg,hand_rotz_deg",
        numbers: |p| with(place(p, 1e3), degrees(turning(p))),
        map: "euler: {axes: xyz, columns: [hand_rotx_deg, hand_roty_deg, hand_rotz_deg]}",
    },
    Way {
        names: "x,y,z,alpha,beta,gamma",
        numbers: |p| with(place(p, 1.0), zyz(p)),
        map: "euler: {axes: zyz, columns: [alpha, beta, gamma]}",
    },
    Way {
        names: "x,y,z,omega,phi,kappa",
        numbers: |p| with(place(p, 1.0), degrees(turning(p))),
        map: "euler: {axes: xyz, columns: [omega, phi, kappa]}",
    },
    Way {
        names: "tvec_x,tvec_y,tvec_z,rvec_x,rvec_y,rvec_z",
        numbers: |p| with(place(p, 1.0), vector(p)),
        map: "rotation_vector: [rvec_x, rvec_y, rvec_z]",
    },
    Way {
        names: "tvec_0,tvec_1,tvec_2,rvec_0,rvec_1,rvec_2",
        numbers: |p| with(place(p, 1e3), vector(p)),
        map: "rotation_vector: [rvec_0, rvec_1, rvec_2]",
    },
    Way {
        names: "flange_x,flange_y,flange_z,flange_rx,flange_ry,flange_rz",
        numbers: |p| with(place(p, 1.0), vector(p)),
        map: "flange: {position: [flange_x, flange_y, flange_z], rotation_vector: [flange_rx, flange_ry, flange_rz]}",
    },
    Way {
        names: "flange.x,flange.y,flange.z,flange.rx,flange.ry,flange.rz",
        numbers: |p| with(place(p, 1.0), degrees(turning(p))),
        map: "euler: {axes: xyz, columns: [flange.rx, flange.ry, flange.rz]}",
    },
    Way {
        names: "Tx,Ty,Tz,Rx,Ry,Rz",
        numbers: |p| with(place(p, 1e3), degrees(fixed(p))),
        map: "fixed_xyz: [Rx, Ry, Rz]",
    },
    Way {
        names: "X [mm],Y [mm],Z [mm],Roll [deg],Pitch [deg],Yaw [deg]",
        numbers: |p| with(place(p, 1e3), degrees(fixed(p))),
        map: r#"fixed_xyz: ["Roll [deg]", "Pitch [deg]", "Yaw [deg]"]"#,
    },
    Way {
        names: "X,Y,Z,A,B,C",
        numbers: |p| {
            let [x, y, z] = degrees(fixed(p));
            with(place(p, 1e3), [z, y, x])
        },
        map: "euler: {axes: zyx, columns: [A, B, C]}",
    },
    Way {
        names: "X,Y,Z,O,A,T",
        numbers: |p| with(place(p, 1e3), degrees(zyz(p))),
        map: "euler: {axes: zyz, columns: [O, A, T]}",
    },
    Way {
        names: "hand_pos_x,hand_pos_y,hand_pos_z,hand_euler_x,hand_euler_y,hand_euler_z",
        numbers: |p| with(place(p, 1.0), turning(p)),
        map: "euler: {axes: xyz, columns: [hand_euler_x, hand_euler_y, hand_euler_z]}",
    },
    Way {
        names: "hand.x,hand.y,hand.z,hand.q0,hand.q1,hand.q2,hand.q3",
        numbers: |p| with(place(p, 1.0), scalar_first(p)),
        map: "quaternion_wxyz: [hand.q0, hand.q1, hand.q2, hand.q3]",
    },
    Way {
        names: "x,y,z,quat_0,quat_1,quat_2,quat_3",
        numbers: |p| with(place(p, 1.0), scalar_last(p)),
        map: "quaternion_xyzw: [quat_0, quat_1, quat_2, quat_3]",
    },
    Way {
        names: "/vrpn/hand/pose.position.x,/vrpn/hand/pose.position.y,/vrpn/hand/pose.position.z,/vrpn/hand/pose.orientation.x,/vrpn/hand/pose.orientation.y,/vrpn/hand/pose.orientation.z,/vrpn/hand/pose.orientation.w",
        numbers: |p| with(place(p, 1.0), scalar_last(p)),
        map: "vrpn_hand: {position:",
    },
    Way {
        names: "field.transform.translation.x,field.transform.translation.y,field.transform.translation.z,field.transform.rotation.x,field.transform.rotation.y,field.transform.rotation.z,field.transform.rotation.w",
        numbers: |p| with(place(p, 1.0), scalar_last(p)),
        map: "quaternion_xyzw: [field.transform.rotation.x, field.transform.rotation.y, field.transform.rotation.z, field.transform.rotation.w]",
    },
    Way {
        names: "x,y,z,r11,r12,r13,r21,r22,r23,r31,r32,r33",
        numbers: |p| with(place(p, 1.0), rows(p)),
        map: "rotation_matrix: [r11, r12, r13, r21, r22, r23, r31, r32, r33]",
    },
    Way {
        names: "hand_x_mm,hand_y_mm,hand_z_mm,hand_R_0_0,hand_R_0_1,hand_R_0_2,hand_R_1_0,hand_R_1_1,hand_R_1_2,hand_R_2_0,hand_R_2_1,hand_R_2_2",
        numbers: |p| with(place(p, 1e3), columns(p)),
        map: "rotation_matrix: [hand_R_0_0, hand_R_1_0, hand_R_2_0, hand_R_0_1,",
    },
    Way {
        names: "T00,T01,T02,T03,T10,T11,T12,T13,T20,T21,T22,T23,T30,T31,T32,T33",
        numbers: |p| p.to_homogeneous().transpose().iter().copied().collect(),
        map: "{position: [T03, T13, T23], rotation_matrix: [T00, T01, T02, T10, T11, T12, T20, T21, T22]}",
    },
    Way {
        names: "cam_pose_0,cam_pose_1,cam_pose_2,cam_pose_3,cam_pose_4,cam_pose_5,cam_pose_6,cam_pose_7,cam_pose_8,cam_pose_9,cam_pose_10,cam_pose_11,cam_pose_12,cam_pose_13,cam_pose_14,cam_pose_15",
        numbers: |p| p.to_homogeneous().iter().copied().collect(),
        map: "cam: {position: [cam_pose_12, cam_pose_13, cam_pose_14], rotation_matrix: [cam_pose_0, cam_pose_4, cam_pose_8,",
    },
    Way {
        names: "tx,ty,tz,r1,r2,r3,r4,r5,r6,r7,r8,r9",
        numbers: |p| with(place(p, 1e3), rows(p)),
        map: "rotation_matrix: [r1, r2, r3, r4, r5, r6, r7, r8, r9]",
    },
    Way {
        names: "nx,ny,nz,ox,oy,oz,ax,ay,az,px,py,pz",
        numbers: |p| with(columns(p), place(p, 1e3)),
        map: "rotation_matrix: [nx, ox, ax, ny, oy, ay, nz, oz, az]",
    },
    Way {
        names: "x,y,z,rxx,rxy,rxz,ryx,ryy,ryz,rzx,rzy,rzz",
        numbers: |p| with(place(p, 1.0), rows(p)),
        map: "rotation_matrix: [rxx, rxy, rxz, ryx, ryy, ryz, rzx, rzy, rzz]",
    },
    Way {
        names: "x,y,z,axis_x,axis_y,axis_z,angle",
        numbers: |p| with(place(p, 1.0), about_axis(p)),
        map: "axis_angle: [axis_x, axis_y, axis_z, angle]",
    },
    Way {
        names: "hand.x,hand.y,hand.z,hand.ux,hand.uy,hand.uz,hand.theta_deg",
        numbers: |p| {
            let [x, y, z, angle] = about_axis(p);
            with(place(p, 1.0), [x, y, z, angle.to_degrees()])
        },
        map: "axis_angle: [hand.ux, hand.uy, hand.uz, hand.theta_deg]",
    },
];

/// Postures of the arm in degrees, and the pose of a body on its last link that a tracker saw.
pub fn recorded(n: usize, one_joint_at_a_time: bool, seed: u64) -> Vec<(Vec<f64>, Isometry3<f64>)> {
    let model = RobotModel::from_urdf_text(&arm(), "arm").expect("an arm");
    let link = model.link_id("l6").expect("there");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let tracker_from_root = Isometry3::from_parts(
        Translation3::new(0.9, 0.3, 0.1),
        UnitQuaternion::from_euler_angles(0.4, -0.9, 0.7),
    );
    let link_from_body = Isometry3::from_parts(
        Translation3::new(0.03, -0.02, 0.08),
        UnitQuaternion::from_euler_angles(0.8, 0.3, -1.1),
    );
    let mut home = [0.0; 6].map(|_: f64| f64::from(rng.random_range(-60_000_i32..60_000)) / 1e3);
    let mut rows = Vec::new();
    for row in 0..n {
        if one_joint_at_a_time {
            home[row * 6 / n] = f64::from(rng.random_range(-80_000_i32..80_000)) / 1e3;
        } else {
            home = home.map(|_| f64::from(rng.random_range(-80_000_i32..80_000)) / 1e3);
        }
        let q: Vec<f64> = home.iter().map(|d| d.to_radians()).collect();
        let mut noise = |sigma: f64| {
            Vector3::from_fn(|_, _| {
                let n: f64 = StandardNormal.sample(&mut rng);
                sigma * n
            })
        };
        let off = Isometry3::new(noise(NOISE.0), noise(NOISE.1));
        let seen = tracker_from_root * model.root_from_link(&q, link) * link_from_body * off;
        rows.push((home.to_vec(), seen));
    }
    rows
}

fn table(way: &Way, rows: &[(Vec<f64>, Isometry3<f64>)]) -> String {
    let mut text = format!("j1,j2,j3,j4,j5,j6,{}\n", way.names);
    for (q, pose) in rows {
        let joints = q.iter().map(|d| format!("{d:.3}"));
        let numbers = (way.numbers)(pose).into_iter().map(|v| format!("{v:.7}"));
        let cells: Vec<String> = joints.chain(numbers).collect();
        text += &cells.join(",");
        text += "\n";
    }
    text
}

/// 27 notations, each with random postures and with one joint at a time: all are read as they were written, nothing is left to a guess, and the
/// calibrated robot is as good with each.
#[test]
fn orientations_are_read_in_the_notation_that_bodies_follow_the_robot_with() {
    for sweeps in [false, true] {
        let (poses, checks) = (recorded(36, sweeps, 5), recorded(12, false, 6));
        let mut of_all: Option<f64> = None;
        for way in &WAYS {
            let dir = Scratch::new()
                .file("arm.urdf", arm())
                .file("poses.csv", table(way, &poses))
                .file("checks.csv", table(way, &checks));
            let said = dir.calib([
                "init",
                "arm.urdf",
                "poses.csv",
                "checks.csv",
                "-o",
                "arm.yaml",
            ]);
            assert_eq!(said.code, 0, "{}{}", said.stdout, said.stderr);
            let profile = dir.read("arm.yaml");
            assert!(profile.contains(way.map), "{}: {profile}", way.names);
            let words = said.words();
            assert!(!words.contains("the motion does not show"), "{words}");
            let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
            assert!(ran.code < 2, "{}: {}{}", way.names, ran.stdout, ran.stderr);
            let report = dir.json("out/report.json");
            let error = report["verification"]["held_out"]["calibrated"]["rms_m"].as_f64();
            let error = error.expect("checked");
            assert!(error < 3.0 * NOISE.0, "{}: {error}", way.names);
            let same = *of_all.get_or_insert(error);
            assert!(
                (error - same).abs() < 2e-3 * same,
                "{}: {error} {same}",
                way.names
            );
        }
    }
}

/// A body that stands beside the robot shows no notation: it is read as the others are. Beside markers alone, the usual notation is marked as a guess.
#[test]
fn a_body_that_stands_still_is_read_as_the_others_are() {
    let way = &WAYS[8];
    let names = |of: &str| way.names.replace("flange", of);
    let still = Isometry3::from_parts(
        Translation3::new(0.5, 0.1, 0.2),
        UnitQuaternion::from_euler_angles(0.5, -0.4, 2.0),
    );
    let rows = recorded(30, false, 7);
    let write = |moving: bool| {
        let flange = match moving {
            true => names("flange"),
            false => "f1.x,f1.y,f1.z,f2.x,f2.y,f2.z,f3.x,f3.y,f3.z".to_owned(),
        };
        let mut text = format!("j1,j2,j3,j4,j5,j6,{},{flange}", names("base"));
        for (row, (q, pose)) in rows.iter().enumerate() {
            let jitter = Vector3::repeat(1e-4 * (row as f64).sin());
            let still = still * Translation3::from(jitter);
            let mut cells: Vec<String> = q.iter().map(|d| format!("{d:.3}")).collect();
            let markers = [Vector3::zeros(), 0.1 * Vector3::x(), 0.1 * Vector3::y()];
            let numbers = match moving {
                true => (way.numbers)(pose),
                false => {
                    let seen = markers.map(|at| pose * nalgebra::Point3::from(at));
                    seen.iter().flat_map(|p| p.coords.data.0[0]).collect()
                }
            };
            let numbers = (way.numbers)(&still).into_iter().chain(numbers);
            cells.extend(numbers.map(|v| format!("{v:.7}")));
            text += "\n";
            text += &cells.join(",");
        }
        text + "\n"
    };
    let asked = |moving: bool| {
        let dir = Scratch::new()
            .file("arm.urdf", arm())
            .file("poses.csv", write(moving));
        let said = dir.calib(["init", "arm.urdf", "poses.csv", "-o", "arm.yaml"]);
        assert_eq!(said.code, 0, "{}{}", said.stdout, said.stderr);
        (dir.read("arm.yaml"), said.words())
    };
    let (profile, words) = asked(true);
    let both = ["base", "flange"]
        .map(|of| format!("euler: {{axes: xyz, columns: [{of}.rx, {of}.ry, {of}.rz]}}"));
    assert!(both.iter().all(|map| profile.contains(map)), "{profile}");
    assert!(
        words.contains("as those of the other bodies are"),
        "{words}"
    );
    let (profile, words) = asked(false);
    assert!(
        profile.contains("fixed_xyz: [base.rx, base.ry, base.rz]"),
        "{profile}"
    );
    assert!(words.contains("the motion does not show"), "{words}");
}

/// Names that look like an orientation and are none: markers stay markers, joints stay joints.
#[test]
fn what_only_looks_like_an_orientation_is_none() {
    let rows = recorded(24, false, 8);
    let mut text = "j1,j2,j3,j4,j5,j6,L_x,L_y,L_z,R_x,R_y,R_z,q_x,q_y,q_z,q_w".to_owned();
    for (q, pose) in &rows {
        let mut cells: Vec<String> = q.iter().map(|d| format!("{d:.3}")).collect();
        for at in [Vector3::new(0.0, 0.1, 0.0), Vector3::new(0.0, -0.1, 0.0)] {
            let seen = pose * nalgebra::Point3::from(at);
            cells.extend(seen.iter().map(|v| format!("{v:.7}")));
        }
        // Weights of four cells, which have no length of one.
        cells.extend(["0.3", "0.2", "0.1", "0.9"].map(str::to_owned));
        text += "\n";
        text += &cells.join(",");
    }
    let dir = Scratch::new()
        .file("arm.urdf", arm())
        .file("poses.csv", text + "\n");
    let said = dir.calib(["init", "arm.urdf", "poses.csv", "-o", "arm.yaml"]);
    assert_eq!(said.code, 0, "{}{}", said.stdout, said.stderr);
    let profile = dir.read("arm.yaml");
    assert!(!profile.contains("pose: true"), "{profile}");
    assert!(profile.contains("L: [L_x, L_y, L_z]"), "{profile}");
}

/// Software of cameras often states where the camera is in the frame of the target: the profile says so, and the run is as good.
#[test]
fn poses_of_the_tracker_in_the_body_are_inverted() {
    let header =
        "j1,j2,j3,j4,j5,j6,target.x,target.y,target.z,target.qx,target.qy,target.qz,target.qw";
    let write = |rows: &[(Vec<f64>, Isometry3<f64>)]| {
        let inverse = |(q, pose): &(Vec<f64>, Isometry3<f64>)| (q.clone(), pose.inverse());
        let rows: Vec<_> = rows.iter().map(inverse).collect();
        let way = Way {
            names: header.split_once("j6,").expect("there").1,
            numbers: |p| with(place(p, 1.0), scalar_last(p)),
            map: "inverted: true",
        };
        table(&way, &rows)
    };
    let dir = Scratch::new()
        .file("arm.urdf", arm())
        .file("poses.csv", write(&recorded(36, false, 9)))
        .file("checks.csv", write(&recorded(12, false, 10)));
    let said = dir.calib([
        "init",
        "arm.urdf",
        "poses.csv",
        "checks.csv",
        "-o",
        "arm.yaml",
    ]);
    assert_eq!(said.code, 0, "{}{}", said.stdout, said.stderr);
    let profile = dir.read("arm.yaml");
    assert!(profile.contains("inverted: true"), "{profile}");
    assert!(
        said.words().contains("those of the tracker in the body"),
        "{}",
        said.words()
    );
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    assert!(ran.code < 2, "{}{}", ran.stdout, ran.stderr);
    let report = dir.json("out/report.json");
    let error = report["verification"]["held_out"]["calibrated"]["rms_m"].as_f64();
    assert!(error.expect("checked") < 3.0 * NOISE.0, "{error:?}");
}

/// The joints of a head are called as the angles of a body are: beside a position, and where other columns are those of the joints, they are the body's.
#[test]
fn angles_of_a_body_that_are_called_as_joints_are_no_joints() {
    let mut head = arm();
    for (joint, name) in [("j1", "yaw"), ("j2", "pitch"), ("j3", "roll")] {
        head = head.replace(&format!("\"{joint}\""), &format!("\"{name}\""));
    }
    let rows = recorded(20, false, 11);
    let write = |names: &str, of_body: &str| {
        let mut text = format!("{names},x,y,z,{of_body}");
        for (q, pose) in &rows {
            let cells = q.iter().map(|d| format!("{:.5}", d.to_radians()));
            let numbers = with(place(pose, 1.0), fixed(pose)).into_iter();
            let cells: Vec<String> = cells.chain(numbers.map(|v| format!("{v:.6}"))).collect();
            text += "\n";
            text += &cells.join(",");
        }
        text + "\n"
    };
    for (names, of_body, map) in [
        ("q1,q2,q3,q4,q5,q6", "roll,pitch,yaw", "yaw: q1"),
        (
            "yaw_actual,pitch_actual,roll_actual,j4,j5,j6",
            "roll,pitch,yaw",
            "yaw: yaw_actual",
        ),
        ("yaw,pitch,roll,j4,j5,j6", "rx,ry,rz", "joint_columns: ["),
    ] {
        let dir = Scratch::new()
            .file("arm.urdf", head.as_str())
            .file("poses.csv", write(names, of_body));
        let said = dir.calib(["init", "arm.urdf", "poses.csv", "-o", "arm.yaml"]);
        assert_eq!(said.code, 0, "{}{}", said.stdout, said.stderr);
        let profile = dir.read("arm.yaml");
        assert!(profile.contains(map), "{names}: {profile}");
        let angles = of_body.replace(',', ", ");
        assert!(profile.contains(&angles), "{names}: {profile}");
        assert!(profile.contains("pose: true"), "{names}: {profile}");
    }
}

/// The pose that a controller computed, in other letters beside that of the tracker, takes no place of it: it is left out.
#[test]
fn a_pose_in_capital_letters_beside_one_in_small_ones_is_another_body() {
    let nominal = RobotModel::from_urdf_text(&arm(), "arm").expect("an arm");
    let real = arm().replace("0.05 0.07 0.1", "0.053 0.068 0.103");
    let robot = RobotModel::from_urdf_text(&real, "arm").expect("an arm");
    let link = nominal.link_id("l6").expect("there");
    let names = ["x,y,z,qx,qy,qz,qw", "X,Y,Z,A,B,C"];
    let mut texts = [[0, 1], [1, 0]].map(|order| {
        let names = order.map(|k| names[k]).join(",");
        (order, format!("j1,j2,j3,j4,j5,j6,{names}"))
    });
    let tracker_from_root = Isometry3::from_parts(
        Translation3::new(0.9, 0.3, 0.1),
        UnitQuaternion::from_euler_angles(0.4, -0.9, 0.7),
    );
    for (row, (q, _)) in recorded(30, false, 12).iter().enumerate() {
        let angles: Vec<f64> = q.iter().map(|d| d.to_radians()).collect();
        let jitter = 2e-4 * Vector3::new((7.0 * row as f64).sin(), (3.0 * row as f64).cos(), 0.3);
        let seen =
            tracker_from_root * robot.root_from_link(&angles, link) * Translation3::from(jitter);
        let computed = nominal.root_from_link(&angles, link);
        let [x, y, z] = degrees(fixed(&computed));
        let numbers = [
            with(place(&seen, 1.0), scalar_last(&seen)),
            with(place(&computed, 1.0), [z, y, x]),
        ];
        for (order, text) in &mut texts {
            let joints = angles.iter().map(|a| format!("{a:.7}"));
            let numbers = order.iter().flat_map(|k| &numbers[*k]);
            let cells = joints.chain(numbers.map(|v| format!("{v:.7}")));
            *text += "\n";
            *text += &cells.collect::<Vec<String>>().join(",");
        }
    }
    for (_, text) in texts {
        let dir = Scratch::new()
            .file("arm.urdf", arm())
            .file("poses.csv", text + "\n");
        let said = dir.calib(["init", "arm.urdf", "poses.csv", "-o", "arm.yaml"]);
        let profile = dir.read("arm.yaml");
        assert!(
            profile.contains("quaternion_xyzw: [qx, qy, qz, qw]"),
            "{profile}"
        );
        assert!(!profile.contains("[A, B, C]"), "{profile}");
        assert!(
            said.words().contains("A controller computed them"),
            "{}",
            said.words()
        );
    }
}
