//! Noise and weights of samples, rows and markers.

use crate::fit::{assert_near, dot, jitter, minus, numbers, pivot, unit};
use crate::scratch::Scratch;
use serde_json::Value;

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
