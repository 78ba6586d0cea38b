//! What other instruments measure: points of a laser tracker, touches of known points, named spots, a measured base.
//!
//! One arm with random zero offsets each time; what the program finds is compared with the truth in units of its own σ.

use crate::contacts::{ORIGINS, TOUCH, TRUE_TIP, Thing, normal, parameter, touches, urdf, z};
use crate::scratch::Scratch;

use std::fmt::Write as _;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

/// Noise of a coordinate of a laser tracker's point, m.
const SMR: f64 = 3e-5;
/// Standard deviation of the true zero offsets, rad.
const OFFSET: f64 = 0.004;

/// Reflectors: name, link and place on it, m.
const REFLECTORS: [(&str, &str, [f64; 3]); 3] = [
    ("smr1", "l6", [0.09, 0.03, 0.02]),
    ("smr2", "l6", [0.05, -0.04, 0.06]),
    ("smr3", "l4", [0.1, 0.02, 0.07]),
];

struct Arm {
    robot: RobotModel,
    offsets: [f64; 6],
    rng: ChaCha8Rng,
}

impl Arm {
    fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let offsets = [0; 6].map(|_| OFFSET * normal(&mut rng));
        let robot = RobotModel::from_urdf_text(&urdf(&ORIGINS, &offsets), "true").expect("a robot");
        Self {
            robot,
            offsets,
            rng,
        }
    }

    fn posture(&mut self) -> Vec<f64> {
        (0..6).map(|_| self.rng.random_range(-1.2..1.2)).collect()
    }

    fn noise(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sigma * normal(&mut self.rng))
    }

    /// Where a point of a link is in the root, m.
    fn point(&self, q: &[f64], link: &str, at: [f64; 3]) -> Vector3<f64> {
        let link = self.robot.link_id(link).expect("a link");
        (self.robot.root_from_link(q, link) * Point3::from(Vector3::from(at))).coords
    }

    /// A pose within 2 m and any orientation.
    fn somewhere(&mut self) -> Isometry3<f64> {
        let at = self.noise(0.7);
        let turn = self.noise(1.0);
        Isometry3::from_parts(
            Translation3::from(at),
            UnitQuaternion::from_scaled_axis(turn),
        )
    }

    /// Rows `pose,j1_deg…,point,x_mm,y_mm,z_mm` of some postures in which a tracker sees `seen` of the reflectors.
    fn points(
        &mut self,
        poses: usize,
        first: usize,
        tracker: &Isometry3<f64>,
        seen: &[usize],
    ) -> String {
        self.table(first..first + poses, tracker, seen, <[f64]>::to_vec)
    }

    /// The same for all reflectors; `actual` says where the joints are at their readings.
    fn points_of(
        &mut self,
        poses: usize,
        tracker: &Isometry3<f64>,
        actual: impl Fn(&[f64]) -> Vec<f64>,
    ) -> String {
        self.table(1..poses + 1, tracker, &[0, 1, 2], actual)
    }

    fn table(
        &mut self,
        poses: std::ops::Range<usize>,
        tracker: &Isometry3<f64>,
        seen: &[usize],
        actual: impl Fn(&[f64]) -> Vec<f64>,
    ) -> String {
        let mut table =
            String::from("pose,j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg,point,x_mm,y_mm,z_mm\n");
        for pose in poses {
            let q = self.posture();
            let there = actual(&q);
            for (k, (name, link, at)) in REFLECTORS.iter().enumerate() {
                // Every fifth is hidden.
                if !seen.contains(&k) || (pose + k).is_multiple_of(5) {
                    continue;
                }
                let p = tracker * Point3::from(self.point(&there, link, *at) + self.noise(SMR));
                let q: Vec<String> = q.iter().map(|q| format!("{:.6}", q.to_degrees())).collect();
                let p = p * 1e3;
                let _ = writeln!(
                    table,
                    "P{pose},{},{name},{:.4},{:.4},{:.4}",
                    q.join(","),
                    p.x,
                    p.y,
                    p.z
                );
            }
        }
        table
    }
}

fn folder(profile: &str) -> Scratch {
    Scratch::new()
        .file("arm/arm.urdf", urdf(&ORIGINS, &[0.0; 6]))
        .file("arm.yaml", profile)
}

fn run(dir: &Scratch) -> Value {
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    // Without limits nothing is decided, and that is not what is tested here.
    assert!(
        ran.stdout.contains("report: out/report.html"),
        "{}\n{}",
        ran.stdout,
        ran.stderr
    );
    dir.json("out/report.json")
}

/// (value − truth)/σ of the zero offsets of these joints, from 1.
fn offsets(report: &Value, arm: &Arm, joints: &[usize]) -> Vec<f64> {
    let joints = joints.iter();
    joints
        .map(|j| z(report, &format!("j{j}.offset"), arm.offsets[j - 1]))
        .collect()
}

/// 95 % of what is found lies within 1.96 σ; `slack` is three binomial standard deviations and a half count.
fn covered(what: &str, z: &[f64]) {
    let n = z.len() as f64;
    let inside = z.iter().filter(|z| z.abs() < 1.96).count() as f64;
    let rms = (z.iter().map(|z| z * z).sum::<f64>() / n).sqrt();
    println!("{what}: {inside} of {n} within 1.96 σ, rms {rms:.2} σ");
    let slack = 3.0 * (0.95 * 0.05 * n).sqrt() + 0.5;
    assert!(
        (inside - 0.95 * n).abs() < slack,
        "{what}: {inside} of {n}: {z:?}"
    );
}

const TRACKED: &str = r#"calib: 1
robot: {name: arm, urdf: arm/arm.urdf}
tracker: {frame: lt}
bodies:
  smr1: {link: l6, markers: [smr1]}
  smr2: {link: l6, markers: [smr2]}
  smr3: {link: l4, markers: [smr3]}
recordings:
  points: {file: arm/points.csv, use: static}
solve:
  free: [bodies, tracker, joint_offsets]
  noise: {joint_deg: 0}
outputs: {add_bodies: [smr1, smr3]}
"#;

#[test]
fn points_of_a_laser_tracker_calibrate_an_arm() {
    let mut z = Vec::new();
    for seed in 0..16 {
        let mut arm = Arm::new(seed);
        let tracker = arm.somewhere();
        let dir = folder(TRACKED).file("arm/points.csv", arm.points(30, 1, &tracker, &[0, 1, 2]));
        let report = run(&dir);
        // The first offset turns the base, and the last one the reflectors of the last link.
        z.extend(offsets(&report, &arm, &[2, 3, 4, 5]));
        let text = dir.read("out/arm.calibrated.urdf");
        let found = RobotModel::from_urdf_text(&text, "found").expect("a robot");
        let joint = found.joint(found.joint_id("smr3_mount").expect("added"));
        let off = joint.parent_link_from_joint.translation.vector - Vector3::from(REFLECTORS[2].2);
        assert!(
            off.norm() < 5e-3 && found.link_id("smr1").is_ok(),
            "{seed}: {off}"
        );
        let scene = dir.json("out/arm.scene.json");
        let frames = scene["frames"].as_array().expect("frames");
        for (name, _, _) in REFLECTORS {
            assert!(frames.iter().any(|f| f["name"] == name), "{name}");
        }
    }
    covered("laser tracker", &z);
}

#[test]
fn recordings_of_one_row_and_points_seen_in_one_of_them_are_used() {
    let mut arm = Arm::new(40);
    let tracker = arm.somewhere();
    let mut profile = TRACKED.to_owned();
    let mut dir = folder("").file("arm/points.csv", arm.points(20, 1, &tracker, &[0, 1]));
    for k in 0..8 {
        let row = arm.points(1, 101 + 5 * k, &tracker, &[0, 2]);
        dir = dir.file(&format!("arm/one{k}.csv"), row);
        let entry = format!("recordings:\n  one{k}: {{file: arm/one{k}.csv, use: static}}\n");
        profile = profile.replacen("recordings:\n", &entry, 1);
    }
    let dir = dir.file("arm.yaml", &profile);
    dir.calib(["check", "arm.yaml"]).expect(0);
    let report = run(&dir);
    assert!(
        offsets(&report, &arm, &[2, 3, 4, 5])
            .iter()
            .all(|z| z.abs() < 4.0)
    );
    // Seen in eight recordings of one row, and in none of the others.
    let sigma = parameter(&report, "smr3.x")["sigma"]
        .as_f64()
        .expect("a number");
    assert!(sigma < 1e-3, "{sigma}");
}

#[test]
fn tables_of_points_that_cannot_be_meant_are_refused_with_their_place() {
    let mut arm = Arm::new(41);
    let tracker = arm.somewhere();
    let table = arm.points(12, 1, &tracker, &[0, 1, 2]);
    let says = |table: &str, profile: &str, expected: &str| {
        let dir = folder(profile).file("arm/points.csv", table);
        let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
        let all = format!("{}{}", ran.stdout, ran.stderr);
        assert!(
            ran.code != 0 && all.contains(expected),
            "{expected}:\n{all}"
        );
    };
    // Two poses of one name.
    says(
        &table.replace("P2,", "P1,"),
        TRACKED,
        "two poses have one name",
    );
    // A point that the profile does not know by this name.
    says(&table.replace("smr3", "SMR-3"), TRACKED, "smr3");
    // Millimeters taken for meters.
    let meters = table
        .replace("x_mm", "x_m")
        .replace("y_mm", "y_m")
        .replace("z_mm", "z_m");
    says(&meters, TRACKED, "unit-mismatch");
    // A joint that the robot does not have.
    says(&table.replace("j3_deg", "j7_deg"), TRACKED, "`j7`");
    // One row for an arm.
    let one: Vec<&str> = table.lines().take(2).collect();
    says(&(one.join("\n") + "\n"), TRACKED, "too-few-poses");
}

/// Touches of points whose coordinates in the root somebody measured, one row each.
const LISTED: &str = r#"calib: 1
robot: {name: arm, urdf: arm/arm.urdf}
tracker: {frame: lab}
bodies: {}
recordings:
  touches: {file: arm/touches.csv, use: static}
points:
  tip: {link: l6, at_mm: [91.2, -0.7, 19.5]}
contacts:
  cmm: {recordings: [touches], point: tip, touches: {coordinates: {columns: target}}, sigma_mm: 0.05}
solve:
  free: [joint_offsets]
  noise: {joint_deg: 0}
"#;

fn listed(arm: &mut Arm, n: usize, target_from_root: &Isometry3<f64>) -> String {
    let mut table = String::from(
        "j1_rad,j2_rad,j3_rad,j4_rad,j5_rad,j6_rad,target.x_mm,target.y_mm,target.z_mm\n",
    );
    for _ in 0..n {
        let q = arm.posture();
        let tip = arm.point(&q, "l6", TRUE_TIP) + arm.noise(TOUCH);
        let p = (target_from_root * Point3::from(tip)) * 1e3;
        let q: Vec<String> = q.iter().map(|q| format!("{q:.9}")).collect();
        let _ = writeln!(table, "{},{:.5},{:.5},{:.5}", q.join(","), p.x, p.y, p.z);
    }
    table
}

#[test]
fn touches_of_points_with_known_coordinates_find_every_offset() {
    let (mut here, mut anywhere) = (Vec::new(), Vec::new());
    for seed in 0..12 {
        let mut arm = Arm::new(100 + seed);
        let table = listed(&mut arm, 61, &Isometry3::identity());
        let report = run(&folder(LISTED).file("arm/touches.csv", table));
        here.extend(offsets(&report, &arm, &[1, 2, 3, 4, 5, 6]));
        // The same in the frame of an artifact that lies anywhere.
        let artifact = arm.somewhere();
        let table = listed(&mut arm, 61, &artifact);
        let free = "place_sigma_mm: 2000, place_sigma_deg: 180, sigma_mm";
        let profile = LISTED.replace("sigma_mm", free);
        let report = run(&folder(&profile).file("arm/touches.csv", table));
        anywhere.extend(offsets(&report, &arm, &[2, 3, 4, 5, 6]));
    }
    covered("coordinates in the root", &here);
    covered("coordinates in an artifact", &anywhere);
}

/// Spots of an artifact in its own frame, mm.
const SPOTS: [(&str, [f64; 3]); 5] = [
    ("A", [0.0, 0.0, 0.0]),
    ("B", [100.0, 0.0, 0.0]),
    ("C", [0.0, 120.0, 0.0]),
    ("D", [60.0, 80.0, 40.0]),
    ("E", [90.0, 20.0, 70.0]),
];

/// Every spot touched `n` times; the true spots are off by `sigma`.
fn spots(arm: &mut Arm, n: usize, sigma: f64) -> String {
    let root_from_artifact = Isometry3::from_parts(
        Translation3::new(0.45, 0.1, 0.2),
        UnitQuaternion::from_euler_angles(0.2, -0.1, 2.1),
    );
    let mut table = String::from("spot,j1_rad,j2_rad,j3_rad,j4_rad,j5_rad,j6_rad\n");
    for (name, at) in SPOTS {
        let at = Vector3::from(at) * 1e-3 + arm.noise(sigma);
        let at = root_from_artifact * Point3::from(at);
        let rows = touches(&arm.robot, Thing::Point(at.coords), n, &mut arm.rng);
        for row in rows.lines().skip(1) {
            let _ = writeln!(table, "{name},{row}");
        }
    }
    table
}

fn of_spots(touches: &str, keys: &str) -> String {
    let profile = LISTED.replace("{coordinates: {columns: target}}", touches);
    profile.replace("sigma_mm: 0.05", &format!("{keys}sigma_mm: 0.05"))
}

fn measured_spots(sigma: &str) -> String {
    let at = SPOTS.map(|(name, [x, y, z])| format!("{name}: [{x}, {y}, {z}]"));
    format!(
        "{{spots: {{named_in: spot, at_mm: {{{}}}{sigma}}}}}",
        at.join(", ")
    )
}

#[test]
fn spots_of_an_artifact_and_spots_of_which_nothing_is_known_find_offsets() {
    let (mut measured, mut unknown) = (Vec::new(), Vec::new());
    let artifact = of_spots(
        &measured_spots(", sigma_mm: 0.2"),
        "place_sigma_mm: 2000, place_sigma_deg: 180, ",
    );
    let nothing = of_spots("{spots: {named_in: spot}}", "");
    for seed in 0..10 {
        let mut arm = Arm::new(200 + seed);
        let table = spots(&mut arm, 9, 2e-4);
        let dir = folder(&artifact).file("arm/touches.csv", &table);
        measured.extend(offsets(&run(&dir), &arm, &[2, 3, 4, 5, 6]));
        let dir = dir.file("arm.yaml", &nothing);
        unknown.extend(offsets(&run(&dir), &arm, &[2, 3, 4, 5, 6]));
    }
    covered("spots of an artifact", &measured);
    covered("spots of which nothing is known", &unknown);
}

#[test]
fn contacts_by_row_that_cannot_be_meant_are_refused_with_their_place() {
    let mut arm = Arm::new(300);
    let table = spots(&mut arm, 2, 0.0);
    let known = of_spots(&measured_spots(""), "");
    let says = |profile: &str, table: &str, expected: &str| {
        let ran = folder(profile)
            .file("arm/touches.csv", table)
            .calib(["run", "arm.yaml"]);
        assert!(
            ran.code != 0 && ran.stderr.contains(expected),
            "{expected}:\n{}",
            ran.stderr
        );
    };
    says(&known, &table.replace("\nB,", "\nBB,"), "has no spot `BB`");
    says(&known, &table.replace("spot,", "spott,"), "did you mean");
    let rows = table.lines().filter_map(|row| Some(row.split_once(',')?.1));
    let unnamed = rows.collect::<Vec<_>>().join("\n");
    says(LISTED, &unnamed, "name the columns `target.x_mm`");
    let listed = listed(&mut arm, 20, &Isometry3::identity());
    says(
        LISTED,
        &listed.replace("target.", "targt."),
        "did you mean `targt`",
    );
    let sigma = of_spots("{spots: {named_in: spot, sigma_mm: 1}}", "");
    says(&sigma, &table, "no coordinates are stated");
    let place = of_spots("{spots: {named_in: spot}}", "place_sigma_mm: 3, ");
    says(&place, &table, "each is unknown already");
    let point = of_spots(
        "{point: {at_mm: [500, 0, 0]}}",
        "place: {xyz_mm: [1, 2, 3]}, ",
    );
    says(&point, &table, "states where the thing is already");
}

#[test]
fn a_measured_base_determines_what_it_fixes() {
    let mut first = Vec::new();
    for seed in 0..16 {
        let mut arm = Arm::new(400 + seed);
        let tracker = arm.somewhere();
        let table = arm.points(30, 1, &tracker, &[0, 1, 2]);
        // Measured to 0.05 mm and 0.02° about each axis.
        let off = (arm.noise(5e-5), arm.noise(0.02_f64.to_radians()));
        let measured =
            tracker * Isometry3::from_parts(off.0.into(), UnitQuaternion::from_scaled_axis(off.1));
        let at = measured.translation.vector * 1e3;
        let (roll, pitch, yaw) = measured.rotation.euler_angles();
        let rpy = [roll, pitch, yaw].map(f64::to_degrees);
        let from_root = format!(
            "frame: lt, from_root: {{xyz_mm: [{}, {}, {}], rpy_deg: {rpy:?}, sigma_mm: 0.05, sigma_deg: 0.02}}",
            at.x, at.y, at.z
        );
        let profile = TRACKED.replace("frame: lt", &from_root);
        let report = run(&folder(&profile).file("arm/points.csv", table));
        let sigma = parameter(&report, "j1.offset")["sigma"]
            .as_f64()
            .expect("a number");
        assert!((2e-4..4.5e-4).contains(&sigma), "{sigma}");
        first.extend(offsets(&report, &arm, &[1]));
    }
    covered("first offset of a measured base", &first);
    let bad = TRACKED.replace(
        "frame: lt",
        "frame: lt, from_root: {sigma_mm: 0, sigma_deg: 1}",
    );
    let ran = folder(&bad).calib(["run", "arm.yaml"]).expect(2);
    assert!(ran.stderr.contains("sigma_mm"), "{}", ran.stderr);
}

#[test]
fn joints_that_no_recording_moves_are_named() {
    let mut arm = Arm::new(500);
    let tracker = arm.somewhere();
    let table = arm.points(20, 1, &tracker, &[0, 1, 2]);
    // The third joint's column says 0 throughout, and the table is that of an arm that stands so.
    let dir = folder(TRACKED).file("arm/points.csv", &table);
    let dir = dir.cells("arm/points.csv", |_, column, cell| match column {
        "j3_deg" => "0".to_owned(),
        _ => cell.to_owned(),
    });
    let ran = dir.calib(["check", "arm.yaml"]);
    assert!(ran.stdout.contains("joints-stood-still"), "{}", ran.stdout);
    let dir = dir.edit(
        "arm.yaml",
        "solve:\n",
        "solve:\n  joints: {j3: {free: []}}\n",
    );
    let ran = dir.calib(["check", "arm.yaml"]);
    assert!(!ran.stdout.contains("joints-stood-still"), "{}", ran.stdout);
    let dir = folder(TRACKED).file("arm/points.csv", &table);
    let ran = dir.calib(["check", "arm.yaml"]);
    assert!(!ran.stdout.contains("joints-stood-still"), "{}", ran.stdout);
}

/// Drives err in what the profile states of them: harmonics of the motor, and backlash on the loaded flank.
#[test]
fn effects_of_a_drive_are_found_where_its_gear_ratio_is_stated() {
    const RATIO: f64 = 81.0;
    const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
    let (mut z, mut flanks) = (Vec::new(), Vec::new());
    for seed in 0..10 {
        let mut arm = Arm::new(600 + seed);
        let tracker = arm.somewhere();
        let [cos, sin, flank] = [3e-4, -5e-4, 8e-4].map(|c| c * (1.0 + 0.2 * normal(&mut arm.rng)));
        // The loads of a robot without masses are those of rods along its links.
        let rods = RobotModel::from_urdf_text(&urdf(&ORIGINS, &[0.0; 6]), "rods");
        let rods = rods.expect("a robot").with_rods(15.0);
        let (j2, j3) = (1, 2);
        let table = arm.points_of(60, &tracker, |q| {
            let load = -rods.gravity_torques(q, &GRAVITY)[j3];
            let mut moved = q.to_vec();
            moved[j2] += cos * ((RATIO * q[j2]).cos() - 1.0) + sin * (RATIO * q[j2]).sin();
            moved[j3] += flank * load.signum();
            moved
        });
        let profile = TRACKED
            .replace("arm.urdf}", "arm.urdf, gear_ratio: {j2: 81}}")
            .replace(
                "solve:\n",
                "solve:\n  joints: {j2: {free: [offset, motor_eccentricity]}, j3: {free: [offset, flank_backlash]}}\n",
            );
        let report = run(&folder(&profile).file("arm/points.csv", table));
        z.push(crate::contacts::z(
            &report,
            "j2.motor_eccentricity_cos",
            cos,
        ));
        z.push(crate::contacts::z(
            &report,
            "j2.motor_eccentricity_sin",
            sin,
        ));
        flanks.push(crate::contacts::z(&report, "j3.flank_backlash", flank));
    }
    covered("motor eccentricity", &z);
    covered("flank backlash", &flanks);
    let bad = TRACKED.replace("joint_offsets]", "joint_offsets, motor_eccentricity]");
    let ran = folder(&bad).calib(["run", "arm.yaml"]).expect(2);
    assert!(ran.stderr.contains("gear_ratio"), "{}", ran.stderr);
}
