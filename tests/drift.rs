//! Two calibrations of one arm: the same again, and with a longer forearm.

use crate::scratch;

use scratch::Scratch;
use serde_json::Value;

/// What changed of the robot since the first recording.
#[derive(Clone, Copy, Default)]
pub(crate) struct Since {
    /// The forearm grew.
    pub(crate) longer_mm: f64,
    /// The zero of this joint's encoder moved.
    pub(crate) zero_deg: Option<(&'static str, f64)>,
}

/// The robot as it really is: the nominal URDF with errors of a real arm's size.
pub(crate) fn true_robot(urdf: &str, since: Since) -> String {
    let moved = |text: &str, joint: &str, from: &str, to: String| {
        let at = text
            .find(&format!("<joint name=\"{joint}\""))
            .expect("the joint");
        let (head, tail) = text.split_at(at);
        assert!(tail.contains(from), "{joint}: {from}");
        head.to_owned() + &tail.replacen(from, &to, 1)
    };
    let zero = |joint: &str| match since.zero_deg {
        Some((moved, deg)) if moved == joint => deg.to_radians(),
        _ => 0.0,
    };
    let forearm = 0.3746 + since.longer_mm * 1e-3;
    let (elbow, pitch) = (zero("elbow"), 0.002 + zero("wrist_pitch"));
    // Joint, its origin by design, and what it really is.
    let origins = [
        (
            "waist",
            "0 0 0.033268",
            format!("xyz=\"0 0 0.033268\" rpy=\"0 0 {}\"", zero("waist")),
        ),
        (
            "shoulder",
            "0 0 0.321732",
            format!("xyz=\"0 0 0.321732\" rpy=\"0 {} 0\"", zero("shoulder")),
        ),
        (
            "elbow",
            "0.375 0 0",
            format!("xyz=\"0.3756 0 0.0003\" rpy=\"0.001 {elbow} -0.002\""),
        ),
        (
            "wrist_pitch",
            "0.375 0 0",
            format!("xyz=\"{forearm} 0 -0.0002\" rpy=\"-0.001 {pitch} 0.001\""),
        ),
        (
            "wrist_roll",
            "0.042405 0 0",
            format!("xyz=\"0.042405 0 0\" rpy=\"{} 0 0\"", zero("wrist_roll")),
        ),
    ];
    let origins = origins.into_iter();
    origins.fold(urdf.to_owned(), |text, (joint, design, real)| {
        moved(
            &text,
            joint,
            &format!("xyz=\"{design}\" rpy=\"0 0 0\""),
            real,
        )
    })
}

/// Records the true robot again (other noise, other poses, bodies mounted elsewhere) and calibrates it.
pub(crate) fn session(dir: Scratch, name: &str, seed: u32, since: Since) -> Scratch {
    let profile = dir.read("robots/ripley.yaml");
    let truth = true_robot(
        &Scratch::new()
            .brief("ripley")
            .read("robots/ripley/r17.urdf"),
        since,
    );
    let (before, rest) = profile
        .split_once("    joint_offset_deg: 0.3\n")
        .expect("errors");
    let after = rest
        .find("    mount_mm")
        .map(|at| &rest[at..])
        .expect("mounts");
    let fixed = after.find("    fixed:").expect("a fixed error");
    let noise = after.find("  noise:").expect("noise");
    let simulated = format!(
        "{before}    joint_offset_deg: 0\n    axis_mm: 0\n    axis_deg: 0\n{}{}",
        &after[..fixed],
        &after[noise..]
    )
    .replace("urdf: ripley/r17.urdf", "urdf: ripley/true.urdf");
    let dir = dir
        .file("robots/ripley/true.urdf", truth)
        .file("robots/simulated.yaml", simulated);
    let recorded = format!("recorded_{name}");
    let seed = seed.to_string();
    let arguments = [
        "simulate",
        "robots/simulated.yaml",
        "--seed",
        &seed,
        "--out",
        &recorded,
    ];
    dir.calib_with(&arguments).expect(0);
    let mut dir = dir;
    for (file, bytes) in dir.files(&recorded) {
        if file.ends_with(".csv") {
            dir = dir.file(&format!("robots/ripley/{file}"), bytes);
        }
    }
    let ran = dir.calib_with(&["run", "robots/ripley.yaml", "--out", name, "-q"]);
    assert!(ran.code < 2, "{}", ran.stderr);
    dir
}

pub(crate) fn number<'a>(drift: &'a Value, name: &str) -> &'a Value {
    let numbers = drift["numbers"].as_array().expect("numbers");
    let found = numbers.iter().find(|n| n["name"] == name);
    found.unwrap_or_else(|| panic!("{name} is not among {numbers:?}"))
}

#[test]
fn a_longer_forearm_is_found_and_the_rest_is_not() {
    if !skipped_tests::thorough() {
        return;
    }
    let dir = Scratch::new().brief("ripley");
    let dir = session(dir, "old", 1, Since::default());
    let dir = session(dir, "same", 2, Since::default());
    let dir = session(
        dir,
        "longer",
        3,
        Since {
            longer_mm: 1.0,
            ..Since::default()
        },
    );
    let same = dir.calib(["drift", "old", "same"]).expect(0);
    assert!(
        same.stdout.contains("NO SIGNIFICANT CHANGE"),
        "{}",
        same.stdout
    );
    let found = dir.calib(["drift", "old", "longer/report.json"]).expect(1);
    insta::with_settings!({filters => [(r"\d+\.\d+", "#"), (r"p [=<] [\de #-]+ \(", "p # ("), (r" +# σ", " # σ")]}, {
        insta::assert_snapshot!("longer", found.stdout);
    });
    assert!(
        found.stdout.lines().all(|l| l.chars().count() <= 80),
        "{}",
        found.stdout
    );
    let json = dir
        .calib(["drift", "old", "longer", "--json"])
        .expect(1)
        .json();
    let forearm = number(&json, "distance.elbow.wrist_pitch");
    assert_eq!(forearm["significant"], true, "{forearm}");
    let (change, sigma) = (
        forearm["change"].as_f64().expect("a number"),
        forearm["sigma"].as_f64().expect("a number"),
    );
    assert!((change - 1e-3).abs() < 4.0 * sigma, "{change} ± {sigma}");
    let upper = number(&json, "distance.shoulder.elbow");
    assert_eq!(upper["significant"], false, "{upper}");
    // Back and forth is the same change.
    let back = dir
        .calib(["drift", "longer", "old", "--json"])
        .expect(1)
        .json();
    let (there, here) = (&back["joint"]["statistic"], &json["joint"]["statistic"]);
    let gap = there.as_f64().expect("a number") - here.as_f64().expect("a number");
    assert!(
        gap.abs() < 1e-6 * here.as_f64().expect("a number"),
        "{there} {here}"
    );
    let itself = dir
        .calib(["drift", "old", "old", "--json"])
        .expect(0)
        .json();
    assert!(itself["joint"]["statistic"].as_f64().expect("a number") < 1e-9);
    // Beside an effect that a model lacks the change may be that effect.
    let mut report = dir.json("longer/report.json");
    let lacks = serde_json::json!({
        "id": "missing-physics", "severity": "warning", "subject": "fit", "rows": [], "text": "", "remedy": "", "about": {"kind": "fit"},
        "facts": {"kind": "effect", "parameter": "elbow.gain"},
    });
    let findings = report["findings"].as_array_mut().expect("a list");
    findings.push(lacks);
    let dir = dir.file("lacking/report.json", report.to_string());
    let said = dir.calib(["drift", "old", "lacking"]).expect(1);
    let words = said.words();
    assert!(
        words.contains("CHANGED, OR AN EFFECT THAT THE MODEL LACKS"),
        "{words}"
    );
    assert!(
        words.contains("its model lacks (elbow.gain)") && words.contains("lacking/report.json"),
        "{words}"
    );
}

#[test]
fn reports_that_cannot_be_compared() {
    let ripley = &scratch::finished("ripley", "ml").dir;
    let paper = &scratch::finished("ripley", "paper").dir;
    let justin = &scratch::finished("justin", "ml").dir;
    let dir = Scratch::new()
        .file("ripley/report.json", ripley.read("out/report.json"))
        .file("paper/report.json", paper.read("out/report.json"))
        .file("justin/report.json", justin.read("out/report.json"))
        .file("none/report.json", "{}");
    let mut said = String::new();
    for (other, code) in [("paper", 3), ("justin", 4), ("none", 3), ("missing", 3)] {
        let ran = dir.calib(["drift", "ripley", other]).expect(code);
        said += &format!("--- {other}\n{}", ran.stderr);
    }
    insta::assert_snapshot!("refused", said);
}

/// A month: calibrated, applied, calibrated again from the changed URDF, twice, the second time with an encoder's zero moved.
#[test]
fn months_from_the_applied_urdf() {
    if !skipped_tests::thorough() {
        return;
    }
    let urdf = "robots/ripley/r17.urdf";
    let dir = Scratch::new().brief("ripley");
    let nominal = dir.read(urdf);
    let dir = session(dir, "march", 1, Since::default());
    dir.calib(["apply", "march", urdf, "--in-place"]).expect(0);
    let dir = dated(
        session(dir, "april", 2, Since::default()),
        "april",
        "2026-04-01",
    );
    // Another month without a change: nothing is found, although parameters are displacements from another URDF.
    let same = dir.calib(["drift", "march", "april"]).expect(0);
    assert!(
        same.stdout.contains("different nominal URDFs"),
        "{}",
        same.stdout
    );
    dir.calib(["apply", "april", urdf, "--in-place", "--force"])
        .expect(0);
    let moved = Since {
        zero_deg: Some(("elbow", 0.1)),
        ..Since::default()
    };
    let dir = dated(session(dir, "may", 3, moved), "may", "2026-05-01");
    let dir = dated(dir, "march", "2026-03-01");
    let drift = dir
        .calib(["drift", "april", "may", "--json"])
        .expect(1)
        .json();
    let zero = number(&drift, "zero.elbow");
    let (change, sigma) = (
        zero["change"].as_f64().expect("a number"),
        zero["sigma"].as_f64().expect("a number"),
    );
    assert_eq!(zero["significant"], true, "{zero}");
    assert!(
        (change.abs() - 0.1_f64.to_radians()).abs() < 3.0 * sigma,
        "{zero}"
    );
    // By date, whatever the order of the arguments.
    let history = dir
        .calib(["history", "may", "march", "april", "-o", "history.html"])
        .expect(0);
    let lines: Vec<&str> = history.stdout.lines().collect();
    assert!(
        lines[1].starts_with("1  2026-03-01  march"),
        "{}",
        history.stdout
    );
    assert!(
        lines[2].ends_with("no significant change"),
        "{}",
        history.stdout
    );
    assert!(
        history.stdout.contains("CHANGED: zero angle of elbow"),
        "{}",
        history.stdout
    );
    assert!(
        history.stdout.lines().all(|l| l.chars().count() <= 80),
        "{}",
        history.stdout
    );
    assert_eq!(
        dir.read("history.html").matches("<svg").count(),
        lines.iter().filter(|l| l.is_empty()).count()
    );
    // Two changes, one revert, the first original.
    dir.calib(["revert", urdf, "--in-place"]).expect(0);
    assert_eq!(dir.read(urdf), nominal);
}

/// The report as it is with the date in the profile.
fn dated(dir: Scratch, name: &str, date: &str) -> Scratch {
    let file = format!("{name}/report.json");
    let mut report: Value = serde_json::from_str(&dir.read(&file)).expect("JSON");
    report["identification"]["date"] = date.into();
    dir.file(&file, report.to_string())
}

/// A joint that carries two others: the angles of its zero to each are two numbers, and none is compared with the other one.
#[test]
fn branches_of_an_unchanged_robot_are_not_mixed_up() {
    const URDF: &str = r#"<robot name="torso">
  <link name="base"/><link name="column"/><link name="chest"/><link name="left"/><link name="right"/><link name="hand"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="column"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="bend" type="revolute"><parent link="column"/><child link="chest"/>
    <origin xyz="0.05 0 0.2"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="side" type="revolute"><parent link="chest"/><child link="left"/>
    <origin xyz="0 0.2 0.3"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="roll" type="revolute"><parent link="chest"/><child link="right"/>
    <origin xyz="0.1 -0.2 0.35"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="nod" type="revolute"><parent link="right"/><child link="hand"/>
    <origin xyz="0.2 0 0.1"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>
"#;
    const PROFILE: &str = "calib: 1
robot: {name: torso, urdf: torso.urdf}
tracker: {frame: lab, body_sigma_mm: 0.2, body_sigma_deg: 0.05}
bodies:
  upper: {link: left, pose: true}
  lower: {link: hand, pose: true}
recordings:
  poses: {file: poses.csv, use: static}
solve:
  free: [bodies, tracker, joint_offsets, joint_axes]
  limits: {held_out_rms_mm: 2}
simulate:
  seed: 1
  tracker_from_root: {xyz_mm: [900, 120, -300], rpy_deg: [0, 0, 40]}
  mounts:
    upper: {xyz_mm: [40, 10, 30]}
    lower: {xyz_mm: [20, 10, 60]}
  errors: {joint_offset_deg: 0.2, axis_mm: 0.3, axis_deg: 0.05}
  noise: {body_mm: 0.2, body_deg: 0.05, joint_deg: 0.005}
  recordings:
    poses:
      random: {turn_deg: [-100, 100], bend_deg: [-50, 50], side_deg: [-50, 50], roll_deg: [-50, 50], nod_deg: [-50, 50]}
      poses: 40
";
    let dir = Scratch::new()
        .file("torso.urdf", URDF)
        .file("torso.yaml", PROFILE);
    dir.calib(["simulate", "torso.yaml", "--out", "."])
        .expect(0);
    dir.calib(["run", "torso.yaml", "--out", "res"]);
    let names: Vec<String> = (dir.json("res/report.json")["data_information"]["quantities"]
        .as_array())
    .expect("a list")
    .iter()
    .map(|change| change["name"].to_string())
    .collect();
    let mut once = names.clone();
    once.sort();
    once.dedup();
    assert_eq!(once.len(), names.len(), "{names:?}");
    assert!(
        names.iter().any(|name| name.contains("zero.bend.")),
        "{names:?}"
    );
    let same = dir.calib(["drift", "res", "res"]).expect(0);
    assert!(
        same.stdout.contains("NO SIGNIFICANT CHANGE"),
        "{}",
        same.stdout
    );
}
