//! `calib init --edit`: from a profile without recordings to one that runs, month after month, with every line of its author.

use crate::scratch;

use scratch::{Scratch, root};

/// The tutorial's arm, its profile before anything was recorded with a line of its author, and recordings elsewhere with the names of another laboratory.
fn recorded() -> Scratch {
    let urdf = std::fs::read(root().join("book/src/tutorial/arm.urdf")).expect("committed");
    let dir = Scratch::new().file("arm.urdf", urdf);
    dir.calib(["init", "arm.urdf", "--out", "robots/arm.yaml"])
        .expect(0);
    dir.calib(["simulate", "robots/arm.yaml", "--out", "all"])
        .expect(0);
    let mut dir = dir.edit(
        "robots/arm.yaml",
        "# limits: {held_out_rms_mm: 1}",
        "limits: {held_out_rms_mm: 2} # as agreed",
    );
    // One half of the postures on each of two days.
    for name in ["sweep", "poses", "checks"] {
        let table = dir.read(&format!("all/{name}.csv"));
        let table: Vec<&str> = table.lines().filter(|l| !l.starts_with('#')).collect();
        let header = table[0].replace("joint_", "A").replace("_deg", "");
        for day in [0, 1] {
            let rows = table[1..].iter().skip(day).step_by(2);
            let rows: Vec<&str> = rows.copied().collect();
            let text = format!("{header}\n{}\n", rows.join("\n"));
            dir = dir.file(&format!("day{}/{name}.csv", day + 1), text);
        }
    }
    dir
}

#[test]
fn a_profile_grows_with_its_recordings_and_keeps_what_its_author_wrote() {
    let dir = recorded();
    let edit = |day: &str| {
        let files = ["sweep", "poses", "checks"].map(|name| format!("{day}/{name}.csv"));
        let [sweep, poses, checks] = files.each_ref().map(String::as_str);
        dir.calib(["init", "--edit", "robots/arm.yaml", sweep, poses, checks])
            .expect(0)
    };
    let before = dir.read("robots/arm.yaml");
    let said = edit("day1").words();
    assert!(
        said.contains("completed recordings `sweep`, `poses` and `checks`"),
        "{said}"
    );
    let first = dir.read("robots/arm.yaml");
    let is_kept = |line: &&str| first.contains(*line) || line.trim_start().starts_with("file:");
    assert!(before.lines().all(|line| is_kept(&line)), "{first}");
    dir.calib(["run", "robots/arm.yaml", "--out", "out"])
        .expect(0);
    // Another day, recordings of the same names: beside the first ones, and the day after nothing is new.
    let said = edit("day2").words();
    assert!(said.contains("added recordings"), "{said}");
    let second = dir.read("robots/arm.yaml");
    let mut rest = second.lines();
    assert!(
        first.lines().all(|line| rest.any(|other| other == line)),
        "{second}"
    );
    assert_eq!(second.matches("# as agreed").count(), 1);
    dir.calib(["run", "robots/arm.yaml", "--out", "out"])
        .expect(0);
    let report = dir.json("out/report.json");
    let held = &report["verification"]["held_out"]["calibrated"]["rms_m"];
    assert!(held.as_f64().is_some_and(|rms| rms < 1e-3), "{held}");
    let said = edit("day2").words();
    assert!(said.contains("Nothing is to be added"), "{said}");
    assert_eq!(dir.read("robots/arm.yaml"), second);
    // For programs.
    let ran = dir.calib([
        "init",
        "--edit",
        "robots/arm.yaml",
        "day2/poses.csv",
        "--json",
    ]);
    let json = ran.expect(0).json();
    assert_eq!(json["added"]["recordings"], serde_json::json!([]));
    assert_eq!(json["profile"], "robots/arm.yaml");
}

/// The profile is written when its check stops: what was written is said as well.
#[test]
fn an_error_of_the_check_stands_beside_what_was_added() {
    let dir = recorded().file("day1/old.csv", "no table\n").edit(
        "robots/arm.yaml",
        "  sweep:\n    file: arm/sweep.csv",
        "  old: {file: ../day1/old.csv, use: static}\n  sweep:\n    file: arm/sweep.csv",
    );
    let files = ["day1/sweep.csv", "day1/poses.csv", "day1/checks.csv"];
    let call = [&["init", "--edit", "robots/arm.yaml"], &files[..]].concat();
    let ran = dir.calib_with(&call).expect(3);
    let said = ran.words();
    for words in [
        "Edited robots/arm.yaml",
        "Errors that `calib check` finds",
        "old.csv",
    ] {
        assert!(said.contains(words), "{said}");
    }
    let ran = dir.calib_with(&[&call[..], &["--json"]].concat()).expect(3);
    let errors = ran.json()["errors"].clone();
    assert!(
        errors[0]["text"]
            .as_str()
            .is_some_and(|text| text.contains("old.csv")),
        "{errors}"
    );
}

#[test]
fn a_protected_profile_is_not_replaced() {
    let dir = recorded();
    let path = dir.path("robots/arm.yaml");
    let mut permissions = path.metadata().expect("there").permissions();
    permissions.set_readonly(true);
    std::fs::set_permissions(&path, permissions).expect("own file");
    let before = dir.read("robots/arm.yaml");
    let ran = dir.calib(["init", "--edit", "robots/arm.yaml", "day1/poses.csv"]);
    assert_eq!(ran.code, 7, "{}", ran.stderr);
    assert!(ran.stderr.contains("write-protected"), "{}", ran.stderr);
    assert_eq!(dir.read("robots/arm.yaml"), before);
}

#[test]
fn recordings_that_are_not_there_are_named_with_what_to_do() {
    let dir = recorded();
    let ran = dir.calib(["init", "--edit", "robots/arm.yaml", "day1/poses.csv"]);
    let said = ran.expect(0).words();
    for words in [
        "recordings.sweep: Its file `arm/sweep.csv` does not exist: record it, or delete the entry.",
        "Next: record what is missing, or delete its entries",
    ] {
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn calls_that_cannot_edit_are_refused_and_the_profile_stays() {
    let dir = recorded()
        .file("other.urdf", "<robot name=\"b\"><link name=\"c\"/></robot>")
        .file(
            "broken.yaml",
            "calib: 1\nrobot: {name: a, urdf: arm.urdf}\n",
        )
        .file("joints.csv", "pose,joint_1_deg\n0,1\n1,2\n");
    let before = dir.read("robots/arm.yaml");
    for (call, code, said) in [
        (
            ["--edit", "robots/arm.yaml"].as_slice(),
            2,
            "no recording was given",
        ),
        (
            &["--edit", "robots/arm.yaml", "arm.urdf"],
            2,
            "no recording was given",
        ),
        (
            &["--edit", "robots/arm.yaml", "other.urdf", "day1/poses.csv"],
            2,
            "the profile has its own (`robot.urdf: ../arm.urdf`)",
        ),
        (&["--edit", "no.yaml", "day1/poses.csv"], 2, "no.yaml"),
        (&["--edit", "broken.yaml", "day1/poses.csv"], 2, "tracker"),
        (
            &["--edit", "day1/poses.csv", "day1/poses.csv"],
            2,
            "a profile is YAML",
        ),
        (
            &["--edit", "robots/arm.yaml", "joints.csv"],
            3,
            "nothing was tracked",
        ),
        (
            &[
                "--edit",
                "robots/arm.yaml",
                "day1/poses.csv",
                "--out",
                "x.yaml",
            ],
            2,
            "cannot be used with",
        ),
        (
            &[
                "--edit",
                "robots/arm.yaml",
                "day1/poses.csv",
                "day1/poses.csv",
            ],
            2,
            "given twice",
        ),
    ] {
        let call: Vec<&str> = std::iter::once("init")
            .chain(call.iter().copied())
            .collect();
        let ran = dir.calib_with(&call);
        assert_eq!(ran.code, code, "{call:?}: {}", ran.stderr);
        assert!(ran.stderr.contains(said), "{call:?}: {}", ran.stderr);
    }
    assert_eq!(dir.read("robots/arm.yaml"), before);
}
