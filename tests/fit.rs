//! `calib fit` on other laboratories' measurements, and the forms of its answers.
//!
//! The measurements are not part of the project: `CALIB_REAL_DATA` points at them, or they lie in `../shared/data`.

mod scratch;

use scratch::{Scratch, root};
use serde_json::Value;

/// A file or folder of real measurements; `None`, counted as skipped, where it is not there.
fn real(file: &str) -> Option<String> {
    Some(skipped_tests::real_data(file)?.display().to_string())
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .expect("numbers")
        .iter()
        .map(|v| v.as_f64().expect("a number"))
        .collect()
}

#[track_caller]
fn assert_near(what: &str, found: &Value, expected_mm: [f64; 3], within_mm: f64) {
    let off: Vec<f64> = numbers(found)
        .iter()
        .zip(expected_mm)
        .map(|(f, e)| (f * 1e3 - e).abs())
        .collect();
    let worst = off.iter().copied().fold(0.0, f64::max);
    println!("{what}: {worst:.4} mm off, {within_mm} allowed");
    assert!(
        worst <= within_mm,
        "{what}: {found} m, expected {expected_mm:?} mm"
    );
}

#[test]
fn a_pivoted_probe() {
    let Some(file) = real("pivot/pivot_clean.csv") else {
        return;
    };
    let fit = Scratch::new()
        .calib(["fit", "cor", &file, "--json"])
        .expect(0)
        .json();
    assert_near(
        "post",
        &fit["center_m"],
        [146.901, -62.9689, -1042.14],
        0.01,
    );
    assert_near("tip", &fit["offset_m"], [-17.7799, 1.1113, -156.865], 0.01);
}

#[test]
fn a_pivoted_probe_with_outliers() {
    let Some(file) = real("pivot/pivot_outliers.csv") else {
        return;
    };
    // Nobody says that there are outliers.
    let fit = Scratch::new()
        .calib(["fit", "cor", &file, "--json"])
        .expect(0)
        .json();
    assert_eq!(fit["estimator"], "consensus");
    // Plain least squares is 30 mm off, and least squares on the good rows alone 0.364 mm: two recordings of one probe differ by as much.
    // In each coordinate that is within 0.30 mm.
    assert_near("tip", &fit["offset_m"], [-17.7799, 1.1113, -156.865], 0.30);
    let d = numbers(&fit["offset_m"]);
    let d = minus(
        [d[0] * 1e3, d[1] * 1e3, d[2] * 1e3],
        [-17.7799, 1.1113, -156.865],
    );
    assert!(dot(d, d).sqrt() < 0.37, "{d:?} mm");
    assert!(
        fit["rejected"]
            .as_array()
            .is_some_and(|rows| rows.len() > 100),
        "{}",
        fit["rejected"]
    );
}

/// Both pivots of each set against the posts that the data list for least squares.
#[test]
fn simulated_pivots_of_a_course() {
    let Some(answers) = real("cis/answers.csv") else {
        return;
    };
    let text = std::fs::read_to_string(&answers).expect("answers");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let mut sets = 0;
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let post = |name: &str| {
            ["x", "y", "z"].map(|axis| {
                let at = header
                    .iter()
                    .position(|h| *h == format!("{name}_{axis}"))
                    .expect("a column");
                cells[at].parse::<f64>().expect("a number")
            })
        };
        for (markers, answer) in [("em_markers", "em_est"), ("opt_probe_in_base", "opt_est")] {
            let file = format!("cis/{}/{markers}.csv", cells[0]);
            let Some(file) = real(&file) else { continue };
            let fit = Scratch::new()
                .calib(["fit", "cor", &file, "--json"])
                .expect(0)
                .json();
            assert_near(
                &format!("{} {answer}", cells[0]),
                &fit["center_m"],
                post(answer),
                0.03,
            );
            sets += 1;
        }
    }
    assert!(sets >= 8, "only {sets} sets");
}

type V = [f64; 3];

fn minus(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn scaled(a: V, s: f64) -> V {
    [a[0] * s, a[1] * s, a[2] * s]
}

fn unit(a: V) -> V {
    scaled(a, 1.0 / dot(a, a).sqrt())
}

fn cross(a: V, b: V) -> V {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Direction and middle of the pin's two markers in the frame of up1, up2, up3, over all rows.
fn pin_in_parent(table: &str) -> (V, V) {
    let mut lines = table.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let (mut direction, mut middle, mut n) = ([0.0; 3], [0.0; 3], 0.0);
    for line in lines {
        let cells: Vec<Option<f64>> = line.split(',').map(|c| c.parse().ok()).collect();
        let point = |name: &str| -> Option<V> {
            let at = header.iter().position(|h| *h == format!("{name}_x_m"))?;
            Some([cells[at]?, cells[at + 1]?, cells[at + 2]?])
        };
        let (Some(a), Some(b), Some(c), Some(p), Some(q)) = (
            point("up1"),
            point("up2"),
            point("up3"),
            point("ax1"),
            point("ax2"),
        ) else {
            continue;
        };
        let x = unit(minus(b, a));
        let y = minus(c, a);
        let y = unit(minus(y, scaled(x, dot(x, y))));
        let z = cross(x, y);
        let inside = |v: V| [dot(v, x), dot(v, y), dot(v, z)];
        let along = inside(unit(minus(q, p)));
        let mid = inside(minus(
            scaled([p[0] + q[0], p[1] + q[1], p[2] + q[2]], 0.5),
            a,
        ));
        for k in 0..3 {
            direction[k] += along[k];
            middle[k] += mid[k];
        }
        n += 1.0;
    }
    (unit(direction), scaled(middle, 1.0 / n))
}

#[test]
fn a_mechanical_hinge() {
    let Some(file) = real("hinge/hinge_markers.csv") else {
        return;
    };
    let fit = Scratch::new()
        .calib([
            "fit",
            "aor",
            &file,
            "--estimator",
            "sara",
            "--parent",
            "up1,up2,up3,up4,up5",
            "--child",
            "dw1,dw2,dw3,dw4,dw5",
            "--json",
        ])
        .expect(0)
        .json();
    let (pin, middle) = pin_in_parent(&std::fs::read_to_string(&file).expect("the table"));
    let (d, p) = (numbers(&fit["direction"]), numbers(&fit["point_m"]));
    let (d, p) = ([d[0], d[1], d[2]], [p[0], p[1], p[2]]);
    let c = cross(d, pin);
    let angle = dot(c, c).sqrt().atan2(dot(d, pin).abs()).to_degrees();
    let gap = cross(minus(middle, p), d);
    let gap = dot(gap, gap).sqrt() * 1e3;
    println!("{angle:.3} deg and {gap:.3} mm from the pin");
    // The data's README: SARA is 0.303 deg and 0.49 mm from the pin's markers.
    assert!(angle <= 0.31, "{angle} deg");
    assert!(gap <= 0.55, "{gap} mm");
}

/// Without two bodies a table of many markers still ends with an answer or a reason.
#[test]
fn a_hinge_without_sides() {
    let Some(file) = real("hinge/hinge_markers.csv") else {
        return;
    };
    let ran = Scratch::new().calib(["fit", "aor", &file, "--use-only", "dw1,dw2,dw3,dw4,dw5"]);
    assert!(
        ran.code == 0 || ran.code == 4 && ran.stdout.contains("not observable"),
        "{} {}",
        ran.stdout,
        ran.stderr
    );
}

#[test]
fn hand_and_eye_of_an_industrial_arm() {
    let Some(file) = real("ur10_handeye/ur10_axzb.csv") else {
        return;
    };
    let fit = Scratch::new()
        .calib(["fit", "handeye", &file, "--json"])
        .expect(0)
        .json();
    let (rms, gap) = (
        fit["rms_m"].as_f64().expect("rms"),
        fit["gap"].as_f64().expect("a gap"),
    );
    println!("rms {:.4} mm, gap {gap:.1e}", rms * 1e3);
    assert!(rms <= 3.85e-3, "{rms}");
    assert!(gap <= 1e-9 && fit["certified"] == true, "{gap}");
}

/// A pivot about (0.1, 0.2, 0.3) with the tip 0.15 m below the body, in two directions.
fn pivot() -> Scratch {
    let mut table =
        String::from("tool.x_m,tool.y_m,tool.z_m,tool.qx,tool.qy,tool.qz,tool.qw,a_deg,b_deg\n");
    for i in -3..=3 {
        for j in -3..=3 {
            let (a, b) = (f64::from(i) * 0.15, f64::from(j) * 0.15);
            let ((sa, ca), (sb, cb)) = ((0.5 * a).sin_cos(), (0.5 * b).sin_cos());
            // q = q_z(a) · q_x(b);  origin = center + R · [0, 0.15, 0]
            let q = [ca * sb, sa * sb, sa * cb, ca * cb];
            let up = [
                -a.sin() * b.cos() * 0.15,
                a.cos() * b.cos() * 0.15,
                b.sin() * 0.15,
            ];
            table += &format!(
                "{},{},{},{},{},{},{},{},{}\n",
                0.1 + up[0],
                0.2 + up[1],
                0.3 + up[2],
                q[0],
                q[1],
                q[2],
                q[3],
                a.to_degrees(),
                b.to_degrees()
            );
        }
    }
    Scratch::new().file("pivot.csv", table)
}

fn keys(value: &Value) -> Vec<&str> {
    value
        .as_object()
        .expect("an object")
        .keys()
        .map(String::as_str)
        .collect()
}

#[test]
fn answers_have_their_keys() {
    let dir = pivot();
    let cor = dir
        .calib(["fit", "cor", "pivot.csv", "--json"])
        .expect(0)
        .json();
    for key in [
        "estimator",
        "observable",
        "reason",
        "center_m",
        "offset_m",
        "covariance",
        "rms_m",
        "used",
        "rejected",
    ] {
        assert!(keys(&cor).contains(&key), "cor has no {key}");
    }
    assert_near("center", &cor["center_m"], [100.0, 200.0, 300.0], 1e-6);
    let sphere = dir
        .calib(["fit", "cor", "pivot.csv", "--estimator", "sfe", "--json"])
        .expect(0)
        .json();
    assert!(
        (sphere["radius_m"].as_f64().expect("a radius") - 0.15).abs() < 1e-9,
        "{sphere}"
    );
    let frame = dir
        .calib([
            "fit",
            "frame",
            "pivot.csv",
            "--proximal",
            "z=a",
            "--distal",
            "x=b",
            "--json",
        ])
        .expect(0)
        .json();
    assert_near(
        "frame",
        &frame["body_from_joint"]["translation_m"],
        [0.0, -150.0, 0.0],
        1e-6,
    );
}

#[test]
fn what_cannot_be_observed_ends_with_four() {
    let table = pivot().read("pivot.csv");
    // One of the two joints alone.
    let rows: Vec<&str> = table
        .lines()
        .enumerate()
        .filter(|(i, _)| *i == 0 || (i - 1) % 7 == 3)
        .map(|(_, line)| line)
        .collect();
    let dir = Scratch::new().file("hinge.csv", rows.join("\n") + "\n");
    let fit = dir
        .calib(["fit", "cor", "hinge.csv", "--json"])
        .expect(4)
        .json();
    assert_eq!(fit["observable"], false);
    assert!(
        fit["reason"].as_str().is_some_and(|r| r.contains("axis")),
        "{fit}"
    );
    let axis = dir
        .calib(["fit", "aor", "hinge.csv", "--json"])
        .expect(0)
        .json();
    for key in [
        "estimator",
        "observable",
        "reason",
        "point_m",
        "direction",
        "covariance",
        "rms_m",
        "used",
        "rejected",
    ] {
        assert!(keys(&axis).contains(&key), "aor has no {key}");
    }
    assert!(
        (numbers(&axis["direction"])[2].abs() - 1.0).abs() < 1e-9,
        "{axis}"
    );
}

#[test]
fn axes_and_frames_take_weights() {
    let weights = |rows: usize, of: &dyn Fn(usize) -> u8| {
        let lines: Vec<String> = (0..rows).map(|k| of(k).to_string()).collect();
        format!("weight\n{}\n", lines.join("\n"))
    };
    let dir = pivot()
        .file("four.csv", weights(49, &|_| 4))
        .file("zero.csv", weights(49, &|k| u8::from(k >= 7)));
    let frame = |more: &[&str]| {
        let mut arguments = vec!["fit", "frame", "pivot.csv", "--proximal", "z=a", "--distal"];
        arguments.extend(["x=b", "--json"]);
        arguments.extend(more);
        dir.calib_with(&arguments).expect(0).json()
    };
    for estimator in ["algorithm1", "frame_ml"] {
        let all = frame(&["--estimator", estimator, "--weights", "four.csv"]);
        let fewer = frame(&["--estimator", estimator, "--weights", "zero.csv"]);
        let pose = &all["body_from_joint"]["translation_m"];
        assert_near("frame", pose, [0.0, -150.0, 0.0], 1e-6);
        assert_eq!((&all["used"], &fewer["used"]), (&49.into(), &42.into()));
    }
    let fit = dir.calib([
        "fit",
        "aor",
        "pivot.csv",
        "--weights",
        "zero.csv",
        "--all",
        "--json",
    ]);
    assert!(matches!(fit.code, 0 | 4), "{}", fit.stderr);
    // Rows without an angle leave with their weights.
    let one = dir.calib([
        "fit",
        "aor",
        "pivot.csv",
        "--weights",
        "four.csv",
        "--joint",
        "a",
    ]);
    assert!(matches!(one.code, 0 | 4), "{}", one.stderr);
}

/// A weak answer is shown, with its doubt, and does not pass for a good one.
#[test]
fn a_weak_answer_says_so() {
    let mut table = String::from("m.x_m,m.y_m,m.z_m\n");
    for k in 0..40 {
        // A cap of 12 degrees on a radius of 150 mm, to 1 mm.
        let (a, b) = (2.4 * k as f64, 0.2 * (k as f64 / 40.0).sqrt());
        let x = [
            0.15 * b.sin() * a.cos(),
            0.15 * b.sin() * a.sin(),
            0.15 * b.cos(),
        ];
        let at = |i: usize| x[i] + 1e-3 * jitter(3 * k + i);
        table += &format!("{},{},{}\n", at(0), at(1), at(2));
    }
    let dir = Scratch::new().file("cap.csv", table);
    let ran = dir
        .calib(["fit", "cor", "cap.csv", "--json"])
        .expect(4)
        .json();
    assert_eq!(
        (&ran["observable"], &ran["verdict"]),
        (&false.into(), &"weak".into())
    );
    assert_eq!(numbers(&ran["center_m"]).len(), 3);
    let text = dir.calib(["fit", "cor", "cap.csv"]).expect(4).stdout;
    assert!(text.contains("weak: σ = "), "{text}");
}

#[test]
fn estimators_are_listed() {
    for (what, known) in [
        ("cor", ["hse", "hsa", "sfe", "sfa"]),
        ("aor", ["plane", "planar_radial", "sara", "hinge_bundle"]),
    ] {
        let list = Scratch::new()
            .calib(["fit", what, "--list", "--json"])
            .expect(0)
            .json();
        let ids: Vec<&str> = list
            .as_array()
            .expect("a list")
            .iter()
            .filter_map(|e| e["id"].as_str())
            .collect();
        for id in known {
            assert!(ids.contains(&id), "{what}: no {id} in {ids:?}");
        }
    }
}

/// Ripley's wrist turns about one axis; the gripper's markers among those of the link and the table look like a body that turns about
/// more than one.
#[test]
fn markers_of_several_bodies_are_not_taken_for_one() {
    let sweep = root().join("robots/ripley/wrist_sweep.csv");
    let sweep = sweep.to_str().expect("UTF-8");
    for more in [vec![], vec!["--all"], vec!["--estimator", "hse"]] {
        let mut arguments = vec!["fit", "cor", sweep];
        arguments.extend(more);
        let ran = Scratch::new().calib_with(&arguments).expect(3);
        assert!(
            ran.stderr
                .contains("in 2 groups: {gripM_1,gripM_2,gripM_3,gripM_4}"),
            "{}",
            ran.stderr
        );
        assert!(
            ran.stderr
                .contains("--use-only gripM_1,gripM_2,gripM_3,gripM_4 moves most"),
            "{}",
            ran.stderr
        );
    }
    // Chosen by name, they are no body: estimators of one body say so instead of an answer.
    let chosen = "gripM_1,gripM_2,gripM_3,gripM_4,table_1,table_2,table_3";
    Scratch::new()
        .calib([
            "fit",
            "cor",
            sweep,
            "--use-only",
            chosen,
            "--estimator",
            "hse",
        ])
        .expect(3);
    let ran = Scratch::new()
        .calib([
            "fit",
            "cor",
            sweep,
            "--use-only",
            "gripM_1,gripM_2,gripM_3,gripM_4",
        ])
        .expect(4);
    assert!(ran.stdout.contains("single_axis"), "{}", ran.stdout);
}

/// Even noise without a random number generator: −1 to 1.
fn jitter(k: usize) -> f64 {
    let x = (k as f64 * 12.9898 + 4.1).sin() * 43_758.545_3;
    2.0 * (x - x.floor()) - 1.0
}

/// A marker on a sphere about (0.1, −0.2, 2), seen from the origin with noise along the sight; and its covariances.
fn seen_from_afar() -> Scratch {
    let mut table = String::from("m.x_m,m.y_m,m.z_m\n");
    let mut covariances = String::from("m.xx_mm2,m.xy_mm2,m.xz_mm2,m.yy_mm2,m.yz_mm2,m.zz_mm2\n");
    for k in 0..60 {
        let (a, b) = (0.21 * k as f64, 0.4 + 0.02 * k as f64);
        let x = [
            0.1 + 0.15 * b.sin() * a.cos(),
            -0.2 + 0.15 * b.sin() * a.sin(),
            2.0 - 0.15 * b.cos(),
        ];
        let u = unit(x);
        let e = 0.003 * jitter(k);
        let seen: Vec<f64> = (0..3)
            .map(|i| x[i] + e * u[i] + 2e-4 * jitter(100 + 3 * k + i))
            .collect();
        let u = unit([seen[0], seen[1], seen[2]]);
        table += &format!("{},{},{}\n", seen[0], seen[1], seen[2]);
        let entry =
            |i: usize, j: usize| f64::from(u8::from(i == j)) * 0.04 + u[i] * u[j] * (4.0 - 0.04);
        covariances += &format!(
            "{},{},{},{},{},{}\n",
            entry(0, 0),
            entry(0, 1),
            entry(0, 2),
            entry(1, 1),
            entry(1, 2),
            entry(2, 2)
        );
    }
    Scratch::new()
        .file("ball.csv", table)
        .file("noise.csv", covariances)
}

/// The sum of the variances of the center, m².
fn trace(fit: &Value) -> f64 {
    (0..3).map(|k| numbers(&fit["covariance"][k])[k]).sum()
}

#[test]
fn samples_are_weighed_by_their_noise() {
    let dir = seen_from_afar();
    let plain = dir
        .calib(["fit", "cor", "ball.csv", "--json"])
        .expect(0)
        .json();
    let sight = ["--sigma-mm", "0.2", "--sigma-sight-mm", "2"];
    let mut arguments = vec!["fit", "cor", "ball.csv", "--json"];
    arguments.extend(sight);
    let weighed = dir.calib_with(&arguments).expect(0).json();
    assert_eq!(weighed["estimator"], "sphere_eiv");
    let off = |fit: &Value| {
        let c = numbers(&fit["center_m"]);
        minus([c[0], c[1], c[2]], [0.1, -0.2, 2.0])
    };
    let (far, near) = (off(&plain), off(&weighed));
    assert!(
        dot(near, near) < dot(far, far) && trace(&weighed) < trace(&plain),
        "{near:?} {far:?}"
    );
    // The same covariances from a file.
    let stated = dir
        .calib([
            "fit",
            "cor",
            "ball.csv",
            "--covariances",
            "noise.csv",
            "--json",
        ])
        .expect(0)
        .json();
    for (a, b) in numbers(&stated["center_m"])
        .iter()
        .zip(numbers(&weighed["center_m"]))
    {
        assert!((a - b).abs() < 1e-9, "{stated} {weighed}");
    }
    // Another camera, other lines of sight.
    arguments.extend(["--camera-m", "-3,0,2"]);
    let aside = dir.calib_with(&arguments).expect(0).json();
    let d = minus(off(&aside), near);
    assert!(dot(d, d).sqrt() > 1e-5, "{aside}");
}

#[test]
fn noise_that_cannot_be_used_is_an_error_with_a_remedy() {
    let dir = seen_from_afar()
        .file(
            "short.csv",
            "m.xx_mm2,m.xy_mm2,m.xz_mm2,m.yy_mm2,m.yz_mm2,m.zz_mm2\n1,0,0,1,0,1\n",
        )
        .file("narrow.csv", "m.xx_mm2,m.xy_mm2\n1,0\n");
    for (more, code, says) in [
        (vec!["--sigma-sight-mm", "2"], 2, "--sigma-mm"),
        (
            vec!["--sigma-sight-mm", "2", "--sigma-mm", "0"],
            2,
            "above zero",
        ),
        (
            vec![
                "--sigma-sight-mm",
                "2",
                "--sigma-mm",
                "0.2",
                "--covariances",
                "noise.csv",
            ],
            2,
            "give one of them",
        ),
        (
            vec!["--covariances", "noise.csv", "--estimator", "sfe"],
            2,
            "--estimator ml_sphere, sphere_eiv",
        ),
        (vec!["--covariances", "short.csv"], 3, "60 rows"),
        (vec!["--covariances", "narrow.csv"], 3, "`m.xz_mm2`"),
        (vec!["--covariances", "none.csv"], 3, "none.csv"),
        (vec!["--towards", "0,0,1"], 2, "calib fit aor"),
        (vec!["--camera-m", "1,2"], 2, "three numbers"),
        (
            vec!["--estimator", "sphere_eve"],
            2,
            "did you mean `sphere_eiv`?",
        ),
    ] {
        let mut arguments = vec!["fit", "cor", "ball.csv"];
        arguments.extend(&more);
        let ran = dir.calib_with(&arguments).expect(code);
        assert!(ran.stderr.contains(says), "{more:?}: {}", ran.stderr);
    }
}

#[test]
fn rows_have_weights() {
    let rows = 60;
    let column = |of: &dyn Fn(usize) -> f64| {
        let lines: Vec<String> = (0..rows).map(|k| of(k).to_string()).collect();
        format!("weight\n{}\n", lines.join("\n"))
    };
    let dir = seen_from_afar()
        .file("equal.csv", column(&|_| 4.0))
        .file("zero.csv", column(&|k| f64::from(u8::from(k >= 10))))
        .file("bad.csv", column(&|k| if k == 3 { -1.0 } else { 1.0 }))
        .file("short.csv", "weight\n1\n");
    let fit = |more: &[&str]| {
        let mut arguments = vec!["fit", "cor", "ball.csv", "--json"];
        arguments.extend(more);
        dir.calib_with(&arguments).expect(0).json()
    };
    let (plain, equal, zero) = (
        fit(&[]),
        fit(&["--weights", "equal.csv"]),
        fit(&["--weights", "zero.csv"]),
    );
    for (a, b) in numbers(&plain["center_m"])
        .iter()
        .zip(numbers(&equal["center_m"]))
    {
        assert!((a - b).abs() < 1e-9, "{plain} {equal}");
    }
    assert_eq!((&plain["used"], &zero["used"]), (&60.into(), &50.into()));
    for (file, says) in [
        ("bad.csv", "line 5: the weight is `-1`"),
        ("short.csv", "has 1 lines, the table 60 rows"),
        ("noise.csv", "has no column `weight`"),
    ] {
        let ran = dir
            .calib(["fit", "cor", "ball.csv", "--weights", file])
            .expect(3);
        assert!(ran.stderr.contains(says), "{}", ran.stderr);
    }
}

#[test]
fn every_marker_may_have_its_own_noise() {
    let mut table = String::from("a.x_m,a.y_m,a.z_m,b.x_m,b.y_m,b.z_m\n");
    for k in 0..60 {
        let (a, b) = (0.21 * k as f64, 0.3 + 0.02 * k as f64);
        let at = |r: f64, noise: f64, from: usize| {
            let d = [b.sin() * a.cos(), b.sin() * a.sin(), b.cos()];
            (0..3)
                .map(|i| format!("{}", 0.5 + r * d[i] + noise * jitter(from + 3 * k + i)))
                .collect::<Vec<_>>()
                .join(",")
        };
        table += &format!("{},{}\n", at(0.2, 1e-4, 0), at(0.3, 5e-3, 999));
    }
    let dir = Scratch::new().file("two.csv", table);
    let fit = |more: &[&str]| {
        let mut arguments = vec![
            "fit",
            "cor",
            "two.csv",
            "--estimator",
            "ml_sphere",
            "--json",
        ];
        arguments.extend(more);
        dir.calib_with(&arguments).expect(0).json()
    };
    let (common, own) = (fit(&[]), fit(&["--noise-per-marker"]));
    // One marker is fifty times better than the other; together they are as good as the worse.
    assert!(trace(&own) < 0.1 * trace(&common), "{own} {common}");
    for x in numbers(&own["center_m"]) {
        assert!((x - 0.5).abs() < 1e-3, "{own}");
    }
}

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

/// The paper's own noise is 1 to 5 mm: markers of a body that scatter by as much are one body.
#[test]
fn noise_of_millimeters_does_not_split_a_body() {
    let layout = [
        [0.1, 0.02, 0.0],
        [0.07, -0.06, 0.05],
        [0.09, 0.05, -0.05],
        [0.05, 0.0, 0.09],
    ];
    for sigma in [1e-3, 2.5e-3, 5e-3] {
        let names: Vec<String> = (0..4)
            .flat_map(|m| ["x", "y", "z"].map(|a| format!("m{m}.{a}_m")))
            .collect();
        let mut table = names.join(",") + "\n";
        for k in 0..36_usize {
            let (a, b) = (0.5 * (k % 6) as f64 - 1.2, 0.4 * (k / 6) as f64 - 1.0);
            let turn = nalgebra::UnitQuaternion::from_euler_angles(a, b, 0.3 * (a + b));
            let cells: Vec<String> = layout
                .iter()
                .enumerate()
                .flat_map(|(m, p)| {
                    let x = turn * nalgebra::Vector3::from(*p);
                    // Four even numbers are nearly a normal one of variance 4/3.
                    let noise = |i: usize| -> f64 {
                        let at = 4 * (12 * k + 3 * m + i);
                        (0..4).map(|j| jitter(at + j)).sum::<f64>() * sigma * 0.866
                    };
                    [0, 1, 2].map(|i| format!("{}", x[i] + noise(i) + 0.5))
                })
                .collect();
            table += &(cells.join(",") + "\n");
        }
        let dir = Scratch::new().file("body.csv", table);
        let ran = dir.calib(["fit", "cor", "body.csv", "--json"]);
        assert!(matches!(ran.code, 0 | 4), "{sigma}: {}", ran.stderr);
        let mm = format!("{}", sigma * 1e3);
        let stated = dir.calib([
            "fit",
            "cor",
            "body.csv",
            "--estimator",
            "sfe",
            "--sigma-mm",
            &mm,
            "--json",
        ]);
        let center = numbers(&stated.expect(0).json()["center_m"]);
        assert!(
            center.iter().all(|x| (x - 0.5).abs() < 4.0 * sigma),
            "{sigma}: {center:?}"
        );
    }
}
