//! `calib fit` on other laboratories' measurements, and the forms of its answers.
//!
//! The measurements are not part of the project: `CALIB_REAL_DATA` points at them, or they lie in `../shared/data`.

mod scratch;

use std::path::PathBuf;

use scratch::{Scratch, root};
use serde_json::Value;

/// The folder of real measurements; says so when there is none.
fn real(file: &str) -> Option<String> {
    let folder = std::env::var_os("CALIB_REAL_DATA")
        .map_or_else(|| root().join("../shared/data"), PathBuf::from);
    let path = folder.join(file);
    if !path.exists() {
        println!("skipped: no {file} (set CALIB_REAL_DATA)");
        return None;
    }
    Some(path.display().to_string())
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
    // In each coordinate; plain least squares is 30 mm off.
    assert_near("tip", &fit["offset_m"], [-17.7799, 1.1113, -156.865], 0.30);
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
