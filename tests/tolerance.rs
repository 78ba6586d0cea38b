//! Robots and tables as they are: what does not bear on the calibration is a warning, and no reason to refuse.

use crate::scratch;

use scratch::{Ran, Scratch};

/// An arm of three parallel axes; the third may be a prismatic joint, as a SCARA has it.
fn planar(third: &str) -> String {
    let joint = |name: &str, kind: &str, links: [&str; 2], xyz: &str| {
        format!(
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{}\"/><child link=\"{}\"/><origin xyz=\"{xyz}\"/>\
             <axis xyz=\"0 0 1\"/><limit lower=\"-2.5\" upper=\"2.5\" effort=\"1\" velocity=\"1\"/></joint>\n",
            links[0], links[1]
        )
    };
    ["base", "l1", "l2", "tip"]
        .map(|link| format!("<link name=\"{link}\"/>\n"))
        .concat()
        + &joint("j1", "revolute", ["base", "l1"], "0 0 0.2")
        + &joint("j2", "revolute", ["l1", "l2"], "0.4 0 0")
        + &joint("j3", third, ["l2", "tip"], "0.3 0 0.05")
}

fn profile(body: &str, markers: &str, third: &str, seed: u32) -> String {
    let poses = format!("j1_deg: [-120, 120], j2_deg: [-120, 120], {third}");
    format!(
        "calib: 1
robot: {{name: planar, urdf: planar.urdf}}
tracker: {{frame: cam, marker_sigma_mm: 0.1}}
bodies:
  hand: {{link: tip, {body}}}
recordings:
  poses: {{file: data/poses.csv, use: static}}
  checks: {{file: data/checks.csv, use: validation}}
solve:
  free: [bodies, tracker, joint_offsets, joint_axes]
  limits: {{held_out_rms_mm: 1.5}}
simulate:
  seed: {seed}
  tracker_from_root: {{xyz_mm: [100, 200, 300], rpy_deg: [10, 20, 30]}}
  mounts: {{hand: {{xyz_mm: [20, 10, 30]{markers}}}}}
  errors: {{joint_offset_deg: 0.5, axis_mm: 1, axis_deg: 0.2}}
  noise: {{marker_mm: 0.1, joint_deg: 0.005}}
  recordings:
    poses: {{random: {{{poses}}}, poses: 40}}
    checks: {{random: {{{poses}}}, poses: 12}}
"
    )
}

fn calibrated(dir: &Scratch) -> Ran {
    dir.calib(["simulate", "p.yaml", "--out", "data"]).expect(0);
    dir.calib(["run", "p.yaml", "--out", "out", "-q"])
}

#[test]
fn arms_of_parallel_axes_converge() {
    let four = ", markers_mm: {h1: [0, 0, 0], h2: [60, 0, 0], h3: [0, 60, 0], h4: [20, 20, 40]}";
    let two = ", markers_mm: {h1: [0, 0, 0], h2: [60, 0, 0]}";
    let arms = [
        ("revolute", "j3_deg: [-120, 120]"),
        ("prismatic", "j3_mm: [0, 150]"),
    ];
    let bodies = [
        ("markers: [h1, h2, h3, h4]", four),
        ("markers: [h1, h2]", two),
        ("pose: true", ""),
    ];
    for (k, (third, range)) in arms.into_iter().enumerate() {
        for (body, markers) in bodies {
            let dir = Scratch::new()
                .file(
                    "planar.urdf",
                    format!("<robot name=\"planar\">{}</robot>", planar(third)),
                )
                .file("p.yaml", profile(body, markers, range, 3 + k as u32));
            let ran = calibrated(&dir);
            let case = format!("{third}, {body}: {} {}", ran.stdout, ran.stderr);
            assert!(ran.code < 2, "{case}");
            let report = dir.json("out/report.json");
            assert_eq!(report["fit"]["converged"], true, "{case}");
            let iterations = report["fit"]["iterations"].as_u64().expect("a number");
            assert!(iterations <= 500, "{case}: {iterations}");
            let rms = report["verification"]["held_out"]["calibrated"]["rms_m"].as_f64();
            assert!(rms.is_some_and(|rms| rms < 4e-4), "{case}: {rms:?}");
        }
    }
}

/// A palletizer: two parallelograms hold the hand level, so that three axes are parallel in every posture. Few poses leave long curved valleys.
fn palletizer() -> String {
    let joint = |name: &str,
                 links: [&str; 2],
                 xyz: &str,
                 axis: &str,
                 limits: [f64; 2],
                 of: &str| {
        let mimic = match of {
            "" => String::new(),
            of => format!("<mimic joint=\"{of}\" multiplier=\"-1\"/>"),
        };
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><parent link=\"{}\"/><child link=\"{}\"/><origin xyz=\"{xyz}\"/>\
             <axis xyz=\"{axis}\"/><limit lower=\"{}\" upper=\"{}\" effort=\"1\" velocity=\"1\"/>{mimic}</joint>\n",
            links[0], links[1], limits[0], limits[1]
        )
    };
    let links = ["base", "column", "lower", "knee", "upper", "level", "wrist"];
    let up = "0 1 0";
    let joints = [
        joint(
            "turn",
            ["base", "column"],
            "0 0 0.4",
            "0 0 1",
            [-3.0, 3.0],
            "",
        ),
        joint(
            "shoulder",
            ["column", "lower"],
            "0.15 0 0.3",
            up,
            [-0.7, 1.4],
            "",
        ),
        joint(
            "rod1",
            ["lower", "knee"],
            "0 0 0.8",
            up,
            [-1.4, 0.7],
            "shoulder",
        ),
        joint("elbow", ["knee", "upper"], "0 0 0", up, [-0.4, 1.6], ""),
        joint(
            "rod2",
            ["upper", "level"],
            "0.9 0 0",
            up,
            [-1.6, 0.4],
            "elbow",
        ),
        joint(
            "hand",
            ["level", "wrist"],
            "0.1 0 0",
            "0 0 -1",
            [-3.1, 3.1],
            "",
        ),
    ];
    let links = links.map(|link| format!("<link name=\"{link}\"/>\n"));
    format!(
        "<robot name=\"palletizer\">{}{}</robot>",
        links.concat(),
        joints.concat()
    )
}

#[test]
fn palletizers_converge_from_few_poses() {
    let poses = "turn_deg: [-150, 150], shoulder_deg: [-35, 70], elbow_deg: [-20, 80], hand_deg: [-170, 170]";
    // Where the steps crept along a valley: one ended at the limit of iterations, the others after 130 to 157.
    for seed in [25, 28, 29, 35] {
        let profile = format!(
            "calib: 1
robot: {{name: palletizer, urdf: palletizer.urdf}}
tracker: {{frame: cam, marker_sigma_mm: 0.2}}
bodies: {{tool: {{link: wrist, markers: [t1, t2, t3, t4]}}}}
recordings: {{poses: {{file: data/poses.csv, use: static}}, checks: {{file: data/checks.csv, use: validation}}}}
solve: {{free: [bodies, tracker, joint_offsets, joint_axes]}}
simulate:
  seed: {seed}
  tracker_from_root: {{xyz_mm: [100, 200, 300], rpy_deg: [10, 20, 30]}}
  mounts: {{tool: {{xyz_mm: [20, 10, -130], markers_mm: {{t1: [0, 0, 0], t2: [60, 0, 0], t3: [0, 60, 0], t4: [20, 20, 40]}}}}}}
  errors: {{joint_offset_deg: 0.3, axis_mm: 1, axis_deg: 0.2}}
  noise: {{marker_mm: 0.2, joint_deg: 0.01}}
  recordings:
    poses: {{random: {{{poses}}}, poses: 24}}
    checks: {{random: {{{poses}}}, poses: 12}}
"
        );
        let dir = Scratch::new()
            .file("palletizer.urdf", palletizer())
            .file("p.yaml", profile);
        let ran = calibrated(&dir);
        let case = format!("seed {seed}: {} {}", ran.stdout, ran.stderr);
        let report = dir.json("out/report.json");
        assert_eq!(report["fit"]["converged"], true, "{case}");
        let iterations = report["fit"]["iterations"].as_u64().expect("a number");
        assert!(iterations <= 100, "{case}: {iterations}");
    }
}

#[test]
fn a_mimic_of_a_fixed_joint_and_limits_of_an_idle_joint_are_warnings() {
    let extra = "<link name=\"f1\"/><link name=\"f2\"/>\
        <joint name=\"still\" type=\"fixed\"><parent link=\"base\"/><child link=\"f1\"/></joint>\
        <joint name=\"finger\" type=\"prismatic\"><parent link=\"f1\"/><child link=\"f2\"/><axis xyz=\"0 0 1\"/>\
        <limit lower=\"0.1\" upper=\"-0.1\" effort=\"1\" velocity=\"1\"/><mimic joint=\"still\" multiplier=\"2\" offset=\"0.01\"/></joint>";
    let urdf = format!(
        "<robot name=\"planar\">{}{extra}</robot>",
        planar("revolute")
    );
    let dir = Scratch::new().file("planar.urdf", &urdf).file(
        "p.yaml",
        profile("pose: true", "", "j3_deg: [-120, 120]", 3),
    );
    let ran = calibrated(&dir);
    assert!(ran.code < 2, "{} {}", ran.stdout, ran.stderr);
    let report = dir.json("out/report.json");
    let findings = report["findings"].as_array().expect("findings");
    let found: Vec<&str> = findings
        .iter()
        .filter(|f| f["id"] == "urdf-inconsistent" && f["severity"] == "warning")
        .filter_map(|f| f["text"].as_str())
        .collect();
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        found
            .iter()
            .any(|t| t.contains("mimics the fixed joint `still`")),
        "{found:?}"
    );
    assert!(
        found
            .iter()
            .any(|t| t.contains("wrong order, 0.1 and -0.1")),
        "{found:?}"
    );
    // The limits of a joint that a recording moves are looked at: there it is an error, with its place.
    let dir = dir
        .edit(
            "planar.urdf",
            "lower=\"-2.5\" upper=\"2.5\"",
            "lower=\"2.5\" upper=\"-2.5\"",
        )
        .edit(
            "p.yaml",
            "use: static}",
            "use: static, joints: {j1_deg: [-120, 120]}}",
        );
    let ran = dir.calib(["check", "p.yaml"]).expect(2);
    assert!(
        ran.stderr.contains("planar.urdf:") && ran.stderr.contains("`j1`"),
        "{}",
        ran.stderr
    );
}

#[test]
fn quoted_names_are_read_and_written() {
    let table = "pose,\"joint \"\"a\"\"_rad\",\"\",\"-m.x_m\",\"-m.y_m\",\"-m.z_m\",trial\n0,1,,1,2,3,=1+1\n1,2,,1,2,3,\"say \"\"so\"\"\"\n";
    let dir = Scratch::new().file("a.csv", table);
    dir.calib(["convert", "a.csv", "b.csv"]).expect(0);
    let written = dir.read("b.csv");
    assert_eq!(
        written.lines().next(),
        Some("pose,trial,\"joint \"\"a\"\"_rad\",'-m.x_m,'-m.y_m,'-m.z_m")
    );
    let formula = |cell: &str| cell.starts_with(['=', '+', '@']);
    assert!(
        !written.lines().any(|line| line.split(',').any(formula)),
        "{written}"
    );
    // Written again, nothing changes: what was read is what was meant.
    dir.calib(["convert", "b.csv", "c.csv"]).expect(0);
    assert_eq!(dir.read("c.csv"), written);
}

#[test]
fn a_nonsense_profile_ends_soon_and_says_why() {
    // Each body on the link of another, and every joint's reading under another name.
    let four = ", markers_mm: {h1: [0, 0, 0], h2: [60, 0, 0], h3: [0, 60, 0], h4: [20, 20, 40]}";
    let body = "markers: [h1, h2, h3, h4]";
    let dir = Scratch::new()
        .file(
            "planar.urdf",
            format!("<robot name=\"planar\">{}</robot>", planar("revolute")),
        )
        .file("p.yaml", profile(body, four, "j3_deg: [-120, 120]", 5));
    dir.calib(["simulate", "p.yaml", "--out", "data"]).expect(0);
    let wrong = ["poses", "checks"].map(|name| format!("data/{name}.csv"));
    for file in &wrong {
        let text = dir
            .read(file)
            .replace("j1_deg", "jx_deg")
            .replace("j3_deg", "j1_deg")
            .replace("jx_deg", "j3_deg");
        std::fs::write(dir.path(file), text).expect("a file");
    }
    let dir = dir.edit("p.yaml", "link: tip", "link: l1");
    let ran = dir.calib(["run", "p.yaml", "--out", "out", "--force", "-q"]);
    assert!(
        [1, 4, 5].contains(&ran.code),
        "{} {}",
        ran.stdout,
        ran.stderr
    );
    let report = dir.json("out/report.json");
    let iterations = report["fit"]["iterations"].as_u64().expect("a number");
    assert!(iterations <= 500, "{iterations}");
    assert!(!report["reasons"].as_array().expect("reasons").is_empty());
}
