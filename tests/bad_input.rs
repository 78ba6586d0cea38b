//! What a robot engineer is told who gives something wrong: the words, the exit code, and nothing written.

use crate::scratch;

use std::fmt::Write as _;

use scratch::Scratch;

const PROFILE: &str = "robots/ripley.yaml";
const SWEEP: &str = "robots/ripley/base_sweep.csv";
const CHECKS: &str = "robots/ripley/checks.csv";
const URDF: &str = "robots/ripley/r17.urdf";

fn ripley() -> Scratch {
    Scratch::new().robot("ripley")
}

/// One refusal as it is read, after a look that nothing was written.
struct Refusals {
    text: String,
    wrong: Vec<String>,
}

impl Refusals {
    fn of(title: &str) -> Self {
        Self {
            text: format!("{title}\n"),
            wrong: Vec::new(),
        }
    }

    fn case<const N: usize>(&mut self, case: &str, dir: &Scratch, arguments: [&str; N], code: i32) {
        let before = dir.files("");
        let ran = dir.calib(arguments);
        let said = if ran.stderr.is_empty() {
            &ran.stdout
        } else {
            &ran.stderr
        };
        let _ = write!(
            self.text,
            "\n## {case}\n$ calib {}\n{}[exit {}]\n",
            arguments.join(" "),
            dir.shown(said),
            ran.code
        );
        let faults = [
            (
                ran.code != code,
                format!("exit {} instead of {code}", ran.code),
            ),
            (dir.files("") != before, "something was written".to_owned()),
            (ran.stderr.contains("panicked"), "panicked".to_owned()),
            (said.is_empty(), "no word of explanation".to_owned()),
            (
                // A result with a reason is no error.
                ran.stderr.contains("error: ")
                    && !(said.contains("  help: ") || said.contains("try '--help'")),
                "no remedy".to_owned(),
            ),
        ];
        let faults = faults.into_iter().filter(|(is, _)| *is);
        self.wrong
            .extend(faults.map(|(_, what)| format!("{case}: {what}")));
    }

    /// What was said, for the snapshot.
    #[track_caller]
    fn said(self) -> String {
        assert!(
            self.wrong.is_empty(),
            "{}\n{}",
            self.text,
            self.wrong.join("\n")
        );
        self.text
    }

    fn run(&mut self, case: &str, dir: &Scratch, code: i32) {
        self.case(case, dir, ["run", PROFILE, "--out", "out"], code);
    }
}

#[test]
fn profiles() {
    let mut said = Refusals::of("profiles");
    let edited = |from: &str, to: &str| ripley().edit(PROFILE, from, to);
    said.run("missing", &Scratch::new(), 2);
    said.run(
        "a folder",
        &Scratch::new().file("robots/ripley.yaml/x", ""),
        2,
    );
    said.run("empty", &ripley().file(PROFILE, ""), 2);
    said.run(
        "not UTF-8",
        &ripley().file(PROFILE, b"calib: 1\nrobot: {name: \xff\xfe}\n"),
        2,
    );
    said.run(
        "a recording instead",
        &ripley().file(PROFILE, ripley().read(CHECKS)),
        2,
    );
    said.run(
        "unknown key",
        &edited("marker_sigma_mm: 0.3", "marker_sigma_m: 0.3"),
        2,
    );
    said.run(
        "key twice",
        &edited("calib: 1\n", "calib: 1\ncalib: 1\n"),
        2,
    );
    said.run("another version", &edited("calib: 1\n", "calib: 7\n"), 2);
    said.run(
        "a word where a number belongs",
        &edited("marker_sigma_mm: 0.3", "marker_sigma_mm: small"),
        2,
    );
    said.run(
        "negative noise",
        &edited("marker_sigma_mm: 0.3", "marker_sigma_mm: -0.3"),
        2,
    );
    said.run(
        "not a number",
        &edited("marker_sigma_mm: 0.3", "marker_sigma_mm: .nan"),
        2,
    );
    said.run(
        "unknown joint",
        &edited("joint: shoulder", "joint: sholder"),
        2,
    );
    said.run(
        "unknown joint in a sweep",
        &edited(
            "wrist_roll_deg: [-100, 100]}\n  arm",
            "wrist_rol_deg: [-100, 100]}\n  arm",
        ),
        2,
    );
    said.run(
        "unknown link",
        &edited("link: upper_arm", "link: upperarm"),
        2,
    );
    said.run("unknown body", &edited("body: gripM", "body: gripN"), 2);
    said.run(
        "unknown recording",
        &edited("sweep: wrist_sweep", "sweep: wrist"),
        2,
    );
    said.run(
        "unknown axis estimator",
        &edited(
            "axes: {x: wrist_roll}",
            "axes: {x: wrist_roll}\n    axis: planar_radail",
        ),
        2,
    );
    said.run(
        "unknown estimator",
        &edited("center: sfe", "center: sfee"),
        2,
    );
    said.run(
        "unknown effect to free",
        &edited("joint_offsets, joint_axes", "joint_offset, joint_axes"),
        2,
    );
    said.run(
        "joint asked beyond its limits",
        &edited("[-140, 160]", "[-140, 190]"),
        2,
    );
    said.run(
        "radians in a column of degrees",
        &edited("waist_deg: [-70, 180]", "waist_rad: [-70, 180]"),
        2,
    );
    said.run(
        "a marker in two bodies",
        &edited("gripM_1, gripM_2", "linkM_1, gripM_2"),
        2,
    );
    said.run(
        "two markers",
        &edited("[linkM_1, linkM_2, linkM_3, linkM_4]", "[linkM_1, linkM_2]"),
        2,
    );
    said.run(
        "an output outside the folder",
        &edited("urdf: ripley.calibrated.urdf", "urdf: ../ripley.urdf"),
        2,
    );
    said.run(
        "two outputs of one name",
        &edited("scene: ripley.scene.json", "scene: ripley.calibrated.urdf"),
        2,
    );
    insta::assert_snapshot!(said.said());
}

#[test]
fn recordings() {
    let mut said = Refusals::of("recordings");
    let cells = |change: fn(usize, &str, &str) -> String| ripley().cells(SWEEP, change);
    let edited = |from: &str, to: &str| ripley().edit(SWEEP, from, to);
    said.run("missing", &ripley().without(SWEEP), 3);
    said.run(
        "misspelled in the profile",
        &ripley().edit(PROFILE, "ripley/base_sweep.csv", "ripley/base_swep.csv"),
        3,
    );
    // Without a `simulate` section the recordings alone know the marker: said once for all of them.
    let profile = ripley().read(PROFILE);
    let profile = profile.split("\nsimulate:").next().unwrap_or_default();
    said.run(
        "a misspelled marker",
        &ripley().file(PROFILE, profile.replace("[gripM_1", "[gripM_l")),
        3,
    );
    said.run("empty", &ripley().file(SWEEP, ""), 3);
    said.run(
        "a header and no rows",
        &ripley().file(
            SWEEP,
            "pose,waist_deg,linkM_1.x_m,linkM_1.y_m,linkM_1.z_m\n",
        ),
        3,
    );
    said.run(
        "not UTF-8",
        &ripley().file(SWEEP, b"pose,waist_deg\n1,\xff\xfe\n"),
        3,
    );
    said.run(
        "binary",
        &ripley().file(SWEEP, [0_u8, 1, 2, 3, 0, 255, 254]),
        3,
    );
    said.run(
        "a row too short",
        &ripley().file(
            SWEEP,
            "pose,waist_deg,linkM_1.x_m,linkM_1.y_m,linkM_1.z_m\n0,1,2,3,4\n1,2\n",
        ),
        3,
    );
    said.run(
        "a word in a cell",
        &cells(|r, n, c| {
            if r == 4 && n == "linkM_2.y_m" {
                "high".into()
            } else {
                c.into()
            }
        }),
        3,
    );
    said.run(
        "infinite",
        &cells(|r, n, c| {
            if r == 4 && n == "linkM_2.y_m" {
                "inf".into()
            } else {
                c.into()
            }
        }),
        3,
    );
    said.run(
        "a joint that the robot does not have",
        &edited("waist_deg", "wast_deg"),
        3,
    );
    said.run(
        "an angle called a length",
        &edited("waist_deg", "waist_mm"),
        3,
    );
    said.run("no unit", &edited("waist_deg", "waist"), 3);
    said.run("a column twice", &edited("elbow_deg", "waist_deg"), 3);
    said.run(
        "a marker without its z",
        &edited("linkM_1.z_m", "linkM_1.w_m"),
        3,
    );
    said.run(
        "millimeters called meters",
        &cells(|_, n, c| {
            if n.ends_with("_m") {
                c.parse::<f64>()
                    .map_or(c.into(), |v| format!("{}", v * 1e3))
            } else {
                c.into()
            }
        }),
        3,
    );
    said.run(
        "degrees called radians",
        &edited("waist_deg", "waist_rad").edit(SWEEP, "shoulder_deg", "shoulder_rad"),
        3,
    );
    said.run(
        "a body that bends",
        &cells(|r, n, c| {
            if n == "linkM_2.x_m" {
                c.parse::<f64>().map_or(c.into(), |v| {
                    format!("{}", v + 0.02 * (r as f64 * 0.3).sin())
                })
            } else {
                c.into()
            }
        }),
        3,
    );
    said.run(
        "the sweep's joint never moved",
        &cells(|_, n, c| {
            if n == "waist_deg" || n == "shoulder_deg" {
                "10".into()
            } else {
                c.into()
            }
        }),
        3,
    );
    insta::assert_snapshot!(said.said());
}

/// What `calib check` says of data that can be read.
#[test]
fn suspicious_recordings() {
    let mut said = Refusals::of("suspicious recordings");
    let cells = |change: fn(usize, &str, &str) -> String| ripley().cells(SWEEP, change);
    let mut check =
        |case: &str, dir: &Scratch, code: i32| said.case(case, dir, ["check", PROFILE], code);
    check(
        "NaN is a lost sample",
        &cells(|r, n, c| {
            if r == 4 && n.starts_with("linkM_2") {
                "NaN".into()
            } else {
                c.into()
            }
        }),
        0,
    );
    check(
        "all-zero is a lost sample",
        &cells(|r, n, c| {
            if r < 6 && n.starts_with("linkM_2") {
                "0".into()
            } else {
                c.into()
            }
        }),
        0,
    );
    check(
        "joint outside its limits",
        &cells(|r, n, c| {
            if r == 9 && n == "waist_deg" {
                "200".into()
            } else {
                c.into()
            }
        }),
        3,
    );
    check(
        "time runs backwards",
        &ripley()
            .edit(SWEEP, "pose,", "t_s,")
            .cells(SWEEP, |r, n, c| {
                if n == "t_s" {
                    format!("{}", if r == 20 { 3 } else { r })
                } else {
                    c.into()
                }
            }),
        3,
    );
    insta::assert_snapshot!(said.said());
}

#[test]
fn robot_descriptions() {
    let mut said = Refusals::of("URDF");
    let edited = |from: &str, to: &str| ripley().edit(URDF, from, to);
    said.run("missing", &ripley().without(URDF), 2);
    said.run("empty", &ripley().file(URDF, ""), 2);
    said.run(
        "not UTF-8",
        &ripley().file(URDF, b"<robot name='\xff'/>"),
        2,
    );
    said.run("not XML", &edited("</robot>", ""), 2);
    said.run(
        "a cycle",
        &edited(
            r#"<child link="upper_arm"/>"#,
            r#"<child link="base_link"/>"#,
        ),
        2,
    );
    said.run(
        "two roots",
        &edited(
            r#"<link name="gripper_tip"/>"#,
            r#"<link name="gripper_tip"/><link name="island"/>"#,
        ),
        2,
    );
    said.run(
        "a link that is not there",
        &edited(r#"<parent link="hand"/>"#, r#"<parent link="hnad"/>"#),
        2,
    );
    said.run(
        "an axis of zero length",
        &edited(r#"<axis xyz="0 1 0"/>"#, r#"<axis xyz="0 0 0"/>"#),
        2,
    );
    said.run(
        "a comma as decimal sign",
        &edited(
            r#"<origin xyz="0.375 0 0" rpy="0 0 0"/>"#,
            r#"<origin xyz="0,375 0 0" rpy="0 0 0"/>"#,
        ),
        2,
    );
    said.run("xacro", &edited("<robot name=\"ripley\">", "<robot name=\"ripley\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\"><xacro:property name=\"l\" value=\"0.375\"/>"), 2);
    insta::assert_snapshot!(said.said());
}

#[test]
fn mesh_paths_are_kept_and_not_opened() {
    let mesh =
        r#"<visual><geometry><mesh filename="package://not_here/arm.dae"/></geometry></visual>"#;
    let dir = ripley().edit(
        URDF,
        r#"<link name="forearm">"#,
        &format!(r#"<link name="forearm">{mesh}"#),
    );
    dir.calib(["run", PROFILE, "--out", "out"]).expect(0);
    assert!(dir.read("out/ripley.calibrated.urdf").contains(mesh));
}

#[test]
fn one_axis_has_no_center() {
    let mut said = Refusals::of("one axis has no center");
    let single = "axes: {x: wrist_roll}\n    orientation: {from: table}\n    # One axis: only a line can be seen. The point on it is the URDF's, counted from the base.\n    point: {nominal_distance_from: base}";
    let dir = ripley().edit(
        PROFILE,
        single,
        "center: sfe\n    orientation: {from: table}",
    );
    let ran = dir
        .calib(["run", PROFILE, "--method", "paper", "--out", "out"])
        .expect(4);
    let report = dir.json("out/report.json");
    let transforms = report["transforms"].as_array().expect("transforms");
    let reason = report["findings"].to_string();
    assert!(
        reason.contains("origin-not-observable"),
        "{reason} {}",
        ran.stdout
    );
    assert!(
        transforms
            .iter()
            .all(|t| t["name"] != "gripM_from_endJ" || t["observable"] == false),
        "{transforms:?}"
    );
    said.case(
        "table",
        &one_axis_table(),
        ["fit", "cor", "hinge.csv", "--estimator", "sfe"],
        4,
    );
    said.case(
        "hot spot",
        &one_axis_table(),
        [
            "fit",
            "cor",
            "hinge.csv",
            "--estimator",
            "hotspot_ml",
            "--json",
        ],
        4,
    );
    insta::assert_snapshot!(said.said());
}

/// One body on a hinge about z through (0.1, 0.2): poses of half a turn.
fn one_axis_table() -> Scratch {
    let mut table = String::from("x_m,y_m,z_m,qx,qy,qz,qw\n");
    for i in 0..24 {
        let angle = f64::from(i) * 0.13;
        let (s, c) = (0.5 * angle).sin_cos();
        let _ = writeln!(
            table,
            "{},{},0.3,0,0,{s},{c}",
            0.1 + 0.4 * angle.cos(),
            0.2 + 0.4 * angle.sin()
        );
    }
    Scratch::new().file("hinge.csv", table)
}

#[test]
fn commands() {
    let mut said = Refusals::of("commands");
    let table = one_axis_table();
    said.case("no such file", &Scratch::new(), ["fit", "cor", "no.csv"], 3);
    said.case(
        "no such estimator",
        &table,
        ["fit", "cor", "hinge.csv", "--estimator", "sphere"],
        2,
    );
    said.case(
        "no such axis estimator",
        &table,
        ["fit", "aor", "hinge.csv", "--estimator", "saar"],
        2,
    );
    said.case(
        "no such marker",
        &table,
        ["fit", "cor", "hinge.csv", "--use-only", "tip"],
        3,
    );
    said.case(
        "one side of two",
        &table,
        ["fit", "aor", "hinge.csv", "--parent", "up1"],
        2,
    );
    said.case(
        "a frame without its joints",
        &table,
        [
            "fit",
            "frame",
            "hinge.csv",
            "--proximal",
            "z=pan",
            "--distal",
            "x=tilt",
        ],
        3,
    );
    said.case(
        "a frame of a wrong axis",
        &table,
        [
            "fit",
            "frame",
            "hinge.csv",
            "--proximal",
            "w=pan",
            "--distal",
            "x=tilt",
        ],
        2,
    );
    said.case(
        "hand-eye of one body",
        &table,
        ["fit", "handeye", "hinge.csv"],
        3,
    );
    said.case(
        "nothing to revert",
        &ripley(),
        ["revert", URDF, "--out", "original.urdf"],
        3,
    );
    said.case(
        "nothing to simulate",
        &ripley().edit(PROFILE, "simulate:", "simulation:"),
        ["simulate", PROFILE, "--out", "sim"],
        2,
    );
    said.case(
        "diff with nothing",
        &ripley(),
        ["diff", URDF, "robots/ripley/none.urdf"],
        2,
    );
    said.case("an unknown command", &Scratch::new(), ["calibrate"], 2);
    said.case(
        "an unknown method",
        &ripley(),
        ["run", PROFILE, "--method", "mll"],
        2,
    );
    insta::assert_snapshot!(said.said());
}

/// A profile that is larger than any profile is refused before it is read.
#[test]
fn huge_profiles_are_not_read() {
    let dir = ripley();
    std::fs::File::options()
        .write(true)
        .open(dir.path(PROFILE))
        .and_then(|f| f.set_len(65 << 20))
        .expect("a sparse file");
    let ran = dir.calib(["run", PROFILE, "--out", "out"]).expect(2);
    assert!(
        ran.stderr.contains("too many for a profile"),
        "{}",
        ran.stderr
    );
}

/// A folder where a file belongs, and arguments in the wrong order, are called that.
#[test]
fn folders_and_exchanged_arguments() {
    let dir = ripley()
        .file("res/report.json", "{}")
        .file("res/arm.calibrated.model.json", "{}");
    let folder = "it is a folder, not a file";
    let cases: [(&[&str], &str, &str); 8] = [
        (
            &["predict", "res", CHECKS],
            folder,
            "give the model file in this folder: `res/arm.calibrated.model.json`",
        ),
        (
            &["predict", "robots", CHECKS],
            folder,
            "give the `<robot>.calibrated.model.json` that `calib run` wrote",
        ),
        (&["diff", "robots", URDF], folder, "name a file in it"),
        (&["fit", "cor", "robots"], folder, "name a file in it"),
        (
            &["init", "robots", "--out", "new.yaml"],
            folder,
            "name a file in it",
        ),
        (
            &["init", PROFILE, "--out", "new.yaml"],
            "this is a profile of calib, not a URDF",
            "calib init --edit robots/ripley.yaml RECORDING...",
        ),
        (
            &["apply", URDF, "res", "--diff"],
            "they are exchanged",
            "calib apply res robots/ripley/r17.urdf",
        ),
        (
            &["apply", URDF, "res/report.json", "--diff"],
            "they are exchanged",
            "calib apply res/report.json robots/ripley/r17.urdf",
        ),
    ];
    for (arguments, finding, remedy) in cases {
        let ran = dir.calib_with(arguments);
        let said = &ran.stderr;
        assert!(ran.code > 0, "{arguments:?}: {said}");
        assert!(said.contains(finding), "{arguments:?}: {said}");
        assert!(said.contains(remedy), "{arguments:?}: {said}");
        assert!(!said.contains("os error"), "{arguments:?}: {said}");
    }
}

/// What an editor of Windows writes: a backslash in double quotes, and tabs.
#[test]
fn backslashes_and_tabs_in_a_profile() {
    let cases = [
        (
            "file: \"ripley\\base_sweep.csv\"",
            "`\\` begins an escape",
            "`ripley/base_sweep.csv`",
        ),
        (
            "file: \"D:\\data\\base_sweep.csv\"",
            "`\\` begins an escape",
            "`D:/data/base_sweep.csv`",
        ),
        (
            "file: \"ripley\\table.csv\"",
            "`\\` begins an escape",
            "`ripley/table.csv`",
        ),
        (
            "\tfile: ripley/base_sweep.csv",
            "indented with a tab",
            "indent with spaces",
        ),
    ];
    for (written, finding, remedy) in cases {
        let from = match written.starts_with('\t') {
            true => "    file: ripley/base_sweep.csv",
            false => "file: ripley/base_sweep.csv",
        };
        let ran = ripley()
            .edit(PROFILE, from, written)
            .calib(["check", PROFILE]);
        let said = &ran.stderr;
        assert_eq!(ran.code, 2, "{said}");
        assert!(said.contains(finding), "{written}: {said}");
        assert!(said.contains(remedy), "{written}: {said}");
    }
}
