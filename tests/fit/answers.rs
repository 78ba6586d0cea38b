//! The forms of answers: keys, exit codes, lists, and when a table is taken for one body.

use crate::fit::{assert_near, jitter, numbers, pivot};
use crate::scratch::{Scratch, root};
use serde_json::Value;

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
    assert_eq!(cor["covariance_of"].as_array().expect("names").len(), 3);
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
    // Along itself a direction does not vary.
    let of = axis["covariance_of"].as_array().expect("names");
    let along = of.iter().position(|name| name == "direction_z");
    let along = &axis["covariance"][along.expect("named")];
    assert!(numbers(along).iter().all(|c| c.abs() < 1e-9), "{axis}");
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
