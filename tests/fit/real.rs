//! Measurements of other laboratories. They are not part of the project: `CALIB_REAL_DATA` points at them, or they lie in `../shared/data`.

use crate::fit::{V, assert_near, cross, dot, minus, numbers, scaled, unit};
use crate::scratch::Scratch;

/// A file or folder of real measurements; `None`, counted as skipped, where it is not there.
fn real(file: &str) -> Option<String> {
    Some(skipped_tests::real_data(file)?.display().to_string())
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
