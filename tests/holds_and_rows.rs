//! Means of holds beside single rows, and recordings in which the tracker sees worse: both in the fit, or the one fitted and the other held out.
//! They have different noise, which is no fault of robot or body.

use crate::scratch;

use scratch::Scratch;
use serde_json::Value;

/// Noise of a marker coordinate in a row, mm.
const ROW_MM: f64 = 0.1;

/// Recordings of one use: poses, and whether the robot is recorded all the time.
type Recordings = &'static [(usize, bool)];

/// Fitted and held-out recordings.
const DESIGNS: [(&str, Recordings, Recordings); 4] = [
    ("rows held out", &[(50, true)], &[(12, false)]),
    ("holds held out", &[(50, false)], &[(14, true)]),
    ("two rows", &[(50, true), (2, false)], &[(12, false)]),
    (
        "both",
        &[(40, true), (20, false)],
        &[(10, true), (12, false)],
    ),
];

fn urdf() -> String {
    let joints = [
        ("0 0 0.2", "0 0 1"),
        ("0.1 0.01 0.08", "0 1 0"),
        ("0.3 0.01 0.08", "0 1 0"),
        ("0.1 0.02 0.1", "1 0 0"),
        ("0.12 0 0.05", "0 1 0"),
    ];
    let mut text = "<robot name=\"five\"><link name=\"l0\"/>".to_owned();
    for (k, (xyz, axis)) in joints.iter().enumerate() {
        let child = k + 1;
        text += &format!(
            "<link name=\"l{child}\"/><joint name=\"j{k}\" type=\"revolute\"><parent link=\"l{k}\"/><child link=\"l{child}\"/>\
             <origin xyz=\"{xyz}\"/><axis xyz=\"{axis}\"/><limit lower=\"-3\" upper=\"3\" effort=\"9\" velocity=\"2\"/></joint>"
        );
    }
    text + "</robot>"
}

/// A robot with a body of so many markers on its base and one on its end; none for poses that are measured as such.
fn robot(markers: usize, fitted: Recordings, held_out: Recordings) -> Scratch {
    robot_seen(markers, fitted, held_out, &[])
}

/// The same where the tracker's noise is some times as high in some recordings.
fn robot_seen(
    markers: usize,
    fitted: Recordings,
    held_out: Recordings,
    worse: &[(&str, u32)],
) -> Scratch {
    let corners = [
        [0.0; 3],
        [80.0, 0.0, 0.0],
        [20.0, 70.0, 0.0],
        [15.0, 25.0, 60.0],
    ];
    let body = |name: &str| {
        let names: Vec<String> = (0..markers).map(|k| format!("{name}_{k}")).collect();
        let places = names.iter().zip(corners);
        let places = places.map(|(name, at)| format!("{name}: {at:?}"));
        let places: Vec<String> = places.collect();
        (names.join(", "), places.join(", "))
    };
    let ((foot, foot_mm), (tip, tip_mm)) = (body("foot"), body("tip"));
    let mount = "xyz_mm: [30, 20, 40], rpy_deg: [5, -7, 12]";
    let (bodies, mounts) = if markers == 0 {
        (
            format!(
                "foot: {{link: l0, pose: true, mount: {{{mount}}}}}\n  tip: {{link: l5, pose: true}}"
            ),
            format!("foot: {{{mount}}}\n    tip: {{{mount}}}"),
        )
    } else {
        (
            format!(
                "foot: {{link: l0, markers: [{foot}], mount: {{{mount}}}, template_mm: {{{foot_mm}}}}}\n  tip: {{link: l5, markers: [{tip}]}}"
            ),
            format!(
                "foot: {{{mount}, markers_mm: {{{foot_mm}}}}}\n    tip: {{{mount}, markers_mm: {{{tip_mm}}}}}"
            ),
        )
    };
    let (mut recordings, mut protocols) = (String::new(), String::new());
    for (usage, all) in [("static", fitted), ("validation", held_out)] {
        for (k, (poses, stream)) in all.iter().enumerate() {
            let timing = if *stream {
                ", timing: {clock: shared}"
            } else {
                ""
            };
            recordings +=
                &format!("  {usage}_{k}: {{file: {usage}_{k}.csv, use: {usage}{timing}}}\n");
            let name = format!("{usage}_{k}");
            let worse = worse.iter().find(|(recording, _)| *recording == name);
            let worse = worse.map_or_else(String::new, |(_, times)| {
                format!(", tracker_noise_times: {times}")
            });
            protocols += &format!(
                "    {usage}_{k}: {{random: {{j0_deg: [-80, 80], j1_deg: [-80, 80], j2_deg: [-80, 80], j3_deg: [-80, 80], j4_deg: [-80, 80]}}, poses: {poses}{worse}}}\n"
            );
        }
    }
    let profile = format!(
        "calib: 1
robot: {{name: five, urdf: five.urdf}}
tracker: {{frame: lab, marker_sigma_mm: {ROW_MM}, body_sigma_mm: {ROW_MM}, body_sigma_deg: 0.05}}
bodies:
  {bodies}
recordings:
{recordings}solve: {{free: [bodies, tracker, joint_offsets, joint_axes], limits: {{held_out_rms_mm: 1}}}}
simulate:
  seed: {}
  tracker_from_root: {{xyz_mm: [300, -200, 100], rpy_deg: [3, 2, 40]}}
  mounts:
    {mounts}
  errors: {{joint_offset_deg: 0.2, axis_mm: 0.5, axis_deg: 0.1}}
  noise: {{marker_mm: {ROW_MM}, body_mm: {ROW_MM}, body_deg: 0.05}}
  recordings:
{protocols}",
        40 + markers
    );
    let dir = Scratch::new()
        .file("five.urdf", urdf())
        .file("five.yaml", profile);
    let done = dir.calib(["simulate", "five.yaml", "--out", "."]);
    assert_eq!(done.code, 0, "{}", done.stderr);
    dir
}

/// σ of the position of markers or bodies by the name of its level, mm.
fn levels(report: &Value) -> Vec<(String, f64)> {
    let noise = report["noise"].as_array().expect("levels");
    let of_positions = noise.iter().filter(|n| n["kind"] == "position");
    let level = of_positions.map(|n| {
        let name = n["group"].as_str().expect("a name");
        (
            name.to_owned(),
            n["sigma"].as_f64().expect("a number") * 1e3,
        )
    });
    level.collect()
}

#[test]
fn means_and_single_rows_are_accepted_together() {
    for markers in [0, 2, 4] {
        for (name, fitted, held_out) in DESIGNS {
            let dir = robot(markers, fitted, held_out);
            let done = dir.calib(["run", "five.yaml", "--out", "out"]);
            let said = format!("{markers} markers, {name}: {}{}", done.stdout, done.stderr);
            assert_eq!(done.code, 0, "{said}");
            let report = dir.json("out/report.json");
            // Two markers give no orientation, which is the one thing to warn of.
            let expected = if markers == 2 {
                "accepted_with_warnings"
            } else {
                "accepted"
            };
            assert_eq!(report["verdict"], expected, "{said}");
            let levels = levels(&report);
            for (level, sigma) in &levels {
                let of_rows = !level.contains("in holds");
                // Where all that is fitted are means, their level has the plain name.
                let of_means = !of_rows || fitted.iter().all(|(_, stream)| *stream);
                assert_eq!(*sigma < 0.5 * ROW_MM, of_means, "{level}: {sigma}\n{said}");
            }
            let expected = if fitted.len() == 2 { 2 } else { 1 };
            assert_eq!(levels.len(), expected, "{levels:?}\n{said}");
        }
    }
}

#[test]
fn the_noise_of_rows_is_the_trackers_share_of_their_error() {
    let dir = robot(4, &[(50, true)], &[(12, false)]);
    assert_eq!(dir.calib(["run", "five.yaml", "--out", "out"]).code, 0);
    let report = dir.json("out/report.json");
    let limits = report["accuracy_limits"].as_array();
    let of_tracker = limits.expect("a list").iter();
    let mut of_tracker = of_tracker.filter(|l| l["kind"] == "tracker_noise");
    let tracker = of_tracker.next().expect("the tracker")["sigma_m"].as_f64();
    let (tracker, true_m) = (tracker.expect("a number"), 3.0_f64.sqrt() * ROW_MM * 1e-3);
    // A row's noise, and the little that a mean has of it.
    assert!((0.95..1.1).contains(&(tracker / true_m)), "{tracker}");
}

#[test]
fn a_zero_that_jumps_in_single_rows_is_named_beside_holds() {
    for markers in [0, 4] {
        let dir = robot(markers, &[(50, true), (40, false)], &[(12, false)]);
        let path = dir.path("static_1.csv");
        let table = std::fs::read_to_string(&path).expect("a table");
        let mut lines = table.lines().map(str::to_owned).collect::<Vec<_>>();
        let names = lines
            .iter()
            .position(|line| line.starts_with("pose,"))
            .expect("names");
        let column = lines[names].split(',').position(|name| name == "j2_deg");
        let column = column.expect("the joint");
        for line in &mut lines[names + 21..] {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            let indicated: f64 = cells[column].parse().expect("a number");
            cells[column] = format!("{}", indicated + 0.3);
            *line = cells.join(",");
        }
        std::fs::write(&path, lines.join("\n") + "\n").expect("written");
        let done = dir.calib(["run", "five.yaml", "--out", "out"]);
        assert_ne!(done.code, 0, "{}", done.stdout);
        let said = done.stdout.replace("\n  ", " ");
        assert!(said.contains("static_1") && said.contains("j2"), "{said}");
    }
}

/// The recordings that `recording-noise` names.
fn noisy(report: &Value) -> Vec<&str> {
    let findings = report["findings"].as_array().expect("a list");
    let named = findings.iter().filter(|f| f["id"] == "recording-noise");
    named
        .map(|f| f["subject"].as_str().expect("a name"))
        .collect()
}

#[test]
fn a_recording_in_which_the_tracker_sees_worse_has_its_own_level() {
    for markers in [0, 2, 4] {
        for (times, second) in [(2, 40), (4, 40), (4, 10), (10, 10)] {
            let fitted: Recordings = if second == 40 {
                &[(40, false), (40, false)]
            } else {
                &[(50, false), (10, false)]
            };
            // A body whose pose is measured tells its noise only where nothing moves it: of ten rows, twice is not certain.
            let dir = robot_seen(markers, fitted, &[(12, false)], &[("static_1", times)]);
            let done = dir.calib(["run", "five.yaml", "--out", "out"]);
            let said = format!(
                "{markers} markers, {times} times: {}{}",
                done.stdout, done.stderr
            );
            assert_eq!(done.code, 0, "{said}");
            assert!(!said.contains("moved"), "{said}");
            let report = dir.json("out/report.json");
            assert_eq!(noisy(&report), ["static_1"], "{said}");
            let found = levels(&report);
            let level = |of_second: bool| {
                let mut of = found
                    .iter()
                    .filter(|(name, _)| name.contains(" in static_1") == of_second);
                of.next().map_or(f64::NAN, |(_, sigma)| sigma / ROW_MM)
            };
            // Ten rows tell σ to some 10 %.
            assert!((level(false) - 1.0).abs() < 0.2, "{found:?}");
            assert!(
                (level(true) / f64::from(times) - 1.0).abs() < 0.35,
                "{found:?}"
            );
        }
    }
}

#[test]
fn a_held_out_recording_is_judged_by_its_own_noise() {
    for markers in [0, 2, 4] {
        let dir = robot_seen(
            markers,
            &[(50, false)],
            &[(14, false)],
            &[("validation_0", 3)],
        );
        let done = dir.calib(["run", "five.yaml", "--out", "out"]);
        // Noisy rows may leave something open, but nothing is wrong with what the fit states.
        assert!(
            done.code < 2 && !done.stdout.contains("REJECTED"),
            "{}",
            done.stdout
        );
        let report = dir.json("out/report.json");
        assert_eq!(noisy(&report), ["validation_0"]);
        assert!(
            !done.stdout.contains("χ²/dof of the held-out"),
            "{}",
            done.stdout
        );
    }
}

#[test]
fn recordings_with_the_same_noise_share_a_level() {
    for markers in [0, 1, 2, 4] {
        let dir = robot(
            markers,
            &[(20, false), (20, false), (9, false)],
            &[(12, false)],
        );
        dir.calib(["run", "five.yaml", "--out", "out"]);
        let report = dir.json("out/report.json");
        assert!(noisy(&report).is_empty(), "{markers}");
        assert!(
            levels(&report)
                .iter()
                .all(|(name, _)| !name.contains(" in "))
        );
    }
}
