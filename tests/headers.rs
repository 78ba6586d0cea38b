//! Tables whose header is not their first line, and poses of which a half is missing: what loggers, spreadsheets and numerical programs write.

use crate::notations::recorded;
use crate::scratch::Scratch;
use nalgebra::Isometry3;

/// A way to write a table: from the names and the rows of cells.
struct Form {
    name: &'static str,
    write: fn(&[&str], &[Vec<String>]) -> String,
    map: &'static [&'static str],
}

const NAMES: [&str; 13] = [
    "j1", "j2", "j3", "j4", "j5", "j6", "x", "y", "z", "qx", "qy", "qz", "qw",
];

fn lines(above: &str, sign: &str, names: &[&str], by: &str, rows: &[Vec<String>]) -> String {
    let rows = rows.iter().map(|row| row.join(by) + "\n");
    format!(
        "{above}{sign}{}\n{}",
        names.join(by),
        rows.collect::<String>()
    )
}

const FORMS: [Form; 9] = [
    Form {
        name: "plain",
        write: |names, rows| lines("", "", names, ",", rows),
        map: &[],
    },
    Form {
        name: "a title, padded by a spreadsheet",
        write: |names, rows| {
            lines(
                &format!("Measurement 3 of robot R12{}\n\n", ";".repeat(12)),
                "",
                names,
                ";",
                rows,
            )
        },
        map: &["skip_lines: 2", "delimiter: semicolon"],
    },
    Form {
        name: "a title in words",
        write: |names, rows| lines("Log of robot R12, cell 4\n", "", names, ",", rows),
        map: &["skip_lines: 1"],
    },
    Form {
        name: "one word",
        write: |names, rows| lines("Recording\n\n\n", "", names, "\t", rows),
        map: &["skip_lines: 3", "delimiter: tab"],
    },
    Form {
        name: "keys and values",
        write: |names, rows| {
            lines(
                "Robot,R12\nDate,2024-05-01\nRate,100\n",
                "",
                names,
                ",",
                rows,
            )
        },
        map: &["skip_lines: 3"],
    },
    Form {
        name: "numpy.savetxt",
        write: |names, rows| lines("", "# ", names, " ", rows),
        map: &["skip_lines: 1", "names: [j1"],
    },
    Form {
        name: "numpy.savetxt with commas and a note",
        write: |names, rows| lines("# robot R12\n", "# ", names, ",", rows),
        map: &["skip_lines: 2", "names: [j1"],
    },
    Form {
        name: "a comment of MATLAB",
        write: |names, rows| lines("% robot R12, 2024\n", "% ", names, ", ", rows),
        map: &["skip_lines: 2", "names: [j1"],
    },
    Form {
        name: "a commented header over a table of blanks, with commas",
        write: |names, rows| {
            let header = format!("# {}\n", names.join(", "));
            let rows = rows.iter().map(|row| row.join("  ") + "\n");
            header + &rows.collect::<String>()
        },
        map: &["skip_lines: 1", "names: [j1"],
    },
];

fn cells(rows: &[(Vec<f64>, Isometry3<f64>)]) -> Vec<Vec<String>> {
    let of = |(q, pose): &(Vec<f64>, Isometry3<f64>)| {
        let joints = q.iter().map(|d| format!("{d:.3}"));
        let place = pose
            .translation
            .vector
            .iter()
            .chain(pose.rotation.coords.iter());
        joints.chain(place.map(|v| format!("{v:.7}"))).collect()
    };
    rows.iter().map(of).collect()
}

/// What `calib init` writes and says of such tables, and the error on held-out poses, m.
fn calibrated(poses: &str, checks: &str) -> (String, String, f64) {
    let dir = Scratch::new()
        .file("arm.urdf", crate::computed::arm(0.0, 0))
        .file("poses.csv", poses)
        .file("checks.csv", checks);
    let said = dir.calib([
        "init",
        "arm.urdf",
        "poses.csv",
        "checks.csv",
        "-o",
        "arm.yaml",
    ]);
    assert_eq!(said.code, 0, "{}{}", said.stdout, said.stderr);
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    assert!(ran.code < 2, "{}{}", ran.stdout, ran.stderr);
    let report = dir.json("out/report.json");
    let error = report["verification"]["held_out"]["calibrated"]["rms_m"].as_f64();
    (dir.read("arm.yaml"), ran.words(), error.expect("checked"))
}

#[test]
fn a_header_is_found_wherever_it_stands() {
    let (poses, checks) = (
        cells(&recorded(36, false, 5)),
        cells(&recorded(12, false, 6)),
    );
    let mut of_plain = None;
    for form in &FORMS {
        let (profile, _, error) = calibrated(
            &(form.write)(&NAMES, &poses),
            &(form.write)(&NAMES, &checks),
        );
        for key in form.map {
            assert!(profile.contains(key), "{}: {key}: {profile}", form.name);
        }
        let same = *of_plain.get_or_insert(error);
        assert!(error == same, "{}: {error} {same}", form.name);
    }
}

/// A third of the poses has no position, and the orientation of a frame that nobody turned; or a position alone.
#[test]
fn half_a_pose_is_a_lost_one() {
    let (poses, checks) = (
        cells(&recorded(45, false, 5)),
        cells(&recorded(15, false, 6)),
    );
    for (missing, put) in [
        (6..9, [(9, "0"), (10, "0"), (11, "0"), (12, "1")].as_slice()),
        (6..9, &[]),
        (9..13, &[]),
    ] {
        let halved = |rows: &[Vec<String>], word: &str| {
            let mut rows = rows.to_vec();
            for row in rows.iter_mut().step_by(3) {
                for i in missing.clone() {
                    row[i] = word.to_owned();
                }
                for (i, cell) in put {
                    row[*i] = (*cell).to_owned();
                }
            }
            lines("", "", &NAMES, ",", &rows)
        };
        let without = |rows: &[Vec<String>]| {
            let kept = rows.iter().enumerate().filter(|(i, _)| i % 3 != 0);
            let kept: Vec<Vec<String>> = kept.map(|(_, row)| row.clone()).collect();
            lines("", "", &NAMES, ",", &kept)
        };
        let (_, _, expected) = calibrated(&without(&poses), &without(&checks));
        for word in ["", "NaN"] {
            let (_, words, error) = calibrated(&halved(&poses, word), &halved(&checks, word));
            assert!(
                (error - expected).abs() < 1e-9,
                "{word}: {error} {expected}"
            );
            assert!(words.contains("taken as lost"), "{words}");
        }
    }
}
