//! `predict` and `correct` on tables.

use std::path::PathBuf;

use calib_export::{CorrectOptions, ExportError, Frame, PredictOptions, Robot, correct, predict};
use calib_model::{Approach, Under};

const ARM: &str = include_str!("../../../calib-model/tests/it/arm.model.json");

fn arm() -> Robot {
    Robot::from_json(ARM.as_bytes()).expect("a model")
}

fn table(folder: &tempfile::TempDir, text: &str) -> PathBuf {
    let path = folder.path().join("program.csv");
    std::fs::write(&path, text).expect("written");
    path
}

/// Cells of a CSV by column and row.
fn cells(csv: &str) -> Vec<Vec<&str>> {
    csv.lines().map(|l| l.split(',').collect()).collect()
}

#[test]
fn rows_are_predicted_in_their_order_with_their_lines() {
    let robot = arm();
    let folder = tempfile::tempdir().expect("a folder");
    let text = "# a program\nshoulder_deg,elbow_deg\n10,20\n10,-20\n,5\n100,130\n";
    let path = table(&folder, text);
    let options = PredictOptions {
        frame: Frame::Tracker,
        ..PredictOptions::default()
    };
    let done = predict(&robot, &path, &options).expect("predicted");
    let rows = cells(&done.csv);
    assert_eq!(
        rows[0][..5],
        [
            "line",
            "scope",
            "marker_plate.x_m",
            "marker_plate.y_m",
            "marker_plate.z_m"
        ]
    );
    let at = |name: &str| rows[0].iter().position(|c| *c == name).expect("a column");
    assert_eq!((done.rows, done.outside), (3, 1));
    let column: Vec<&str> = rows[1..].iter().map(|r| r[0]).collect();
    assert_eq!(column, ["3", "4", "5", "6"]);
    let scopes: Vec<&str> = rows[1..].iter().map(|r| r[1]).collect();
    assert_eq!(scopes, ["inside", "inside", "lost", "outside:shoulder"]);
    assert!(rows.iter().all(|r| r.len() == rows[0].len()));
    // The library, with the memory of the rows before.
    let mut work = robot.model.work();
    let mut approach = Approach::new(&robot.model);
    for (row, deg) in [(1, [10.0, 20.0]), (2, [10.0, -20.0_f64])] {
        let q = deg.map(f64::to_radians);
        approach.update(&robot.model, &q).expect("finite");
        let under = Under {
            approach: approach.directions(),
            held: None,
            temperature_c: &[],
        };
        robot.model.forward(&q, &under, &mut work).expect("poses");
        let body = robot.model.place("marker_plate").expect("a body");
        let pose = robot.model.tracker_from(body, &work).expect("a place");
        for (k, name) in ["marker_plate.x_m", "marker_plate.y_m", "marker_plate.z_m"]
            .iter()
            .enumerate()
        {
            let seen: f64 = rows[row][at(name)].parse().expect("a number");
            assert!((seen - pose.t[k]).abs() < 1e-9);
        }
        let sigma: f64 = rows[row][at("tip.sigma_x_m")].parse().expect("a number");
        assert!(sigma > 1e-5 && sigma < 1e-2);
    }
    assert_eq!(approach.directions(), [0.0, -1.0]);
}

#[test]
fn columns_that_are_not_the_robots_are_refused() {
    let robot = arm();
    let folder = tempfile::tempdir().expect("a folder");
    let of = |text: &str| {
        let error = predict(&robot, &table(&folder, text), &PredictOptions::default());
        error.expect_err(text).to_string()
    };
    assert!(of("wrist_deg\n1\n").contains("wrist is not a joint that this robot moves"));
    assert!(of("elbow_mm\n1\n").contains("elbow is a length in the table"));
    let named = PredictOptions {
        of: vec!["hand".to_owned()],
        ..PredictOptions::default()
    };
    let path = table(&folder, "elbow_deg\n1\n");
    let error = predict(&robot, &path, &named).expect_err("no hand");
    assert!(matches!(error, ExportError::Name { .. }), "{error}");
    // A joint without a column counts as 0, and that is said.
    let done = predict(&robot, &path, &PredictOptions::default()).expect("predicted");
    assert_eq!(done.absent, ["shoulder"]);
    let without = PredictOptions {
        torques: true,
        ..PredictOptions::default()
    };
    assert!(predict(&robot, &path, &without).is_err());
}

#[test]
fn a_corrected_program_brings_the_tool_to_where_the_nominal_model_has_it() {
    corrected(None);
}

#[test]
fn a_point_is_corrected_as_a_link_is() {
    corrected(Some("tip"));
}

fn corrected(named: Option<&str>) {
    let options = CorrectOptions {
        tool: named.map(str::to_owned),
        ..CorrectOptions::default()
    };
    let name = named.unwrap_or("link_6");
    let mut r = crate::common::rng(5);
    let file = crate::common::robot(&mut r, 6, false, crate::common::Effects::All);
    let robot = Robot {
        model: calib_model::Model::new(&file).expect("a model"),
        file,
    };
    let folder = tempfile::tempdir().expect("a folder");
    let names: Vec<String> = (0..6).map(|i| format!("joint_{i}_deg")).collect();
    let mut text = names.join(",") + "\n";
    let mut rows = Vec::new();
    for _ in 0..20 {
        let q = crate::common::posture(&mut r, 6);
        let deg: Vec<String> = q.iter().map(|q| q.to_degrees().to_string()).collect();
        text += &(deg.join(",") + "\n");
        rows.push(q);
    }
    let path = table(&folder, &text);
    let done = correct(&robot, &path, &options).expect("corrected");
    assert_eq!(done.rows, 20);
    assert!(
        done.reached >= 17 && done.reached + done.nearer + done.refused == 20,
        "{done:?}"
    );
    assert!(done.before_m[0] > 1e-3);
    let cells = cells(&done.csv);
    let mut work = robot.model.work();
    let mut approach = Approach::new(&robot.model);
    let tool = robot.model.place(name).expect("a link or point");
    for (row, q) in cells[1..].iter().zip(&rows) {
        let command: Vec<f64> = row[1..7]
            .iter()
            .map(|c| c.parse::<f64>().expect("a number").to_radians())
            .collect();
        approach.update(&robot.model, &command).expect("finite");
        if row[7] != "reached" {
            continue;
        }
        robot.model.forward_nominal(q, &mut work).expect("poses");
        let wanted = robot.model.root_from(tool, &work).expect("a place");
        let there = after(&robot, &approach, &command, tool);
        assert!(
            (wanted.t - there.t).norm() < 2e-9,
            "{}",
            (wanted.t - there.t).norm()
        );
    }
    // Targets in space: the same poses as a table of them, from the uncorrected joints.
    let mut text = format!(
        "{},{name}.x_m,{name}.y_m,{name}.z_m,{name}.qx,{name}.qy,{name}.qz,{name}.qw\n",
        names.join(",")
    );
    for q in &rows {
        robot.model.forward_nominal(q, &mut work).expect("poses");
        let pose = robot
            .model
            .root_from(tool, &work)
            .expect("a place")
            .isometry();
        let q: Vec<f64> = q.iter().map(|q| q.to_degrees()).collect();
        let (t, w) = (pose.translation.vector, pose.rotation.coords);
        let numbers: Vec<String> = q
            .iter()
            .chain(t.iter())
            .chain(w.iter())
            .map(f64::to_string)
            .collect();
        text += &(numbers.join(",") + "\n");
    }
    let done = correct(&robot, &table(&folder, &text), &options).expect("corrected");
    assert!(done.cartesian && done.reached >= 17, "{done:?}");
}

/// A body that is called as a link is: its poses are its own, under the name of the scene, and that is said.
#[test]
fn a_body_with_the_name_of_a_link_is_distinguished() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = table(&folder, "shoulder_deg,elbow_deg\n10,20\n-40,35\n");
    let options = PredictOptions::default();
    let own = predict(&arm(), &path, &options).expect("predicted");
    assert!(own.renamed.is_empty());
    let renamed = ARM.replace("\"marker_plate\"", "\"tool\"");
    // The link keeps its name.
    let robot = Robot::from_json(renamed.as_bytes()).expect("a model");
    let done = predict(&robot, &path, &options).expect("predicted");
    assert_eq!(done.renamed, [("tool".to_owned(), "tool_body".to_owned())]);
    assert_eq!(done.csv.replace("tool_body.", "marker_plate."), own.csv);
    let of = |name: &str| {
        let of = vec![name.to_owned()];
        predict(
            &robot,
            &path,
            &PredictOptions {
                of,
                ..options.clone()
            },
        )
        .expect("predicted")
    };
    let (link, body) = (of("tool"), of("tool_body"));
    assert_eq!((link.renamed.len(), body.renamed.len()), (1, 1));
    let body = body.csv.replace("tool_body.", "tool.");
    assert!(link.csv != body, "the body is not where the link is");
    assert_eq!(of("upper").renamed, []);
}

/// Poses of the tool in any order, far from each other: each is reached, whatever the row before it was.
#[test]
fn poses_without_joints_are_reached_from_anywhere() {
    let robot = arm();
    let model = &robot.model;
    let folder = tempfile::tempdir().expect("a folder");
    let tool = model.last_link();
    let name = &model.links()[tool.index()];
    let mut text =
        format!("{name}.x_m,{name}.y_m,{name}.z_m,{name}.qx,{name}.qy,{name}.qz,{name}.qw\n");
    let mut work = model.work();
    let rows = 80;
    for k in 0..rows {
        let q: Vec<f64> = model
            .joints()
            .iter()
            .enumerate()
            .map(|(j, joint)| {
                let [low, high] = joint.fitted_range.or(joint.limits).expect("a range");
                let part = (0.37 + (k as f64) * [0.618_034, 0.754_878][j % 2]).fract();
                low + (high - low) * part
            })
            .collect();
        model
            .forward(&q, &Under::default(), &mut work)
            .expect("finite");
        let pose = model
            .root_from(tool.into(), &work)
            .expect("a link")
            .isometry();
        let (p, r) = (pose.translation.vector, pose.rotation.coords);
        text += &format!(
            "{:.12},{:.12},{:.12},{:.12},{:.12},{:.12},{:.12}\n",
            p.x, p.y, p.z, r.x, r.y, r.z, r.w
        );
    }
    let path = table(&folder, &text);
    let options = CorrectOptions {
        tool: Some(name.clone()),
        ..CorrectOptions::default()
    };
    let done = correct(&robot, &path, &options).expect("corrected");
    assert_eq!((done.rows, done.reached), (rows, rows));
    assert!(done.elsewhere > 0 && done.after_m[1] < 1e-8, "{done:?}");
    // Who bounds the motion of a joint wants no other posture.
    let bounded = CorrectOptions {
        largest_rad: Some(0.2),
        ..options
    };
    let done = correct(&robot, &path, &bounded).expect("corrected");
    assert!(done.elsewhere == 0 && done.reached < rows, "{done:?}");
}

/// Poses just beyond the reach of the stretched arm: the commands stand where the arm comes nearest, from wherever the row before it was. Poses that the
/// arm comes nowhere near are refused.
#[test]
fn poses_that_are_just_missed_are_approached_and_far_ones_are_refused() {
    let robot = arm();
    let model = &robot.model;
    let folder = tempfile::tempdir().expect("a folder");
    let tool = model.last_link();
    let name = &model.links()[tool.index()];
    let mut work = model.work();
    let mut pose = |k: usize| {
        let joints = model.joints().iter().enumerate();
        let q: Vec<f64> = joints
            .map(|(j, joint)| {
                let [low, high] = joint.fitted_range.or(joint.limits).expect("a range");
                let step = [0.618_034, 0.754_878, 0.569_840][j % 3];
                low + (high - low) * (0.11 * j as f64 + k as f64 * step).fract()
            })
            .collect();
        model
            .forward(&q, &Under::default(), &mut work)
            .expect("finite");
        let pose = model.root_from(tool.into(), &work).expect("a link");
        pose.isometry()
    };
    let mut all: Vec<_> = (0..4000).map(&mut pose).collect();
    all.sort_by(|a, b| {
        let far = |p: &nalgebra::Isometry3<f64>| p.translation.vector.norm();
        far(b).total_cmp(&far(a))
    });
    // Rows that are far from each other stand between them.
    let between: Vec<_> = (0..12).map(|k| pose(7 * k + 3)).collect();
    let text = |beyond: f64| {
        let header =
            format!("{name}.x_m,{name}.y_m,{name}.z_m,{name}.qx,{name}.qy,{name}.qz,{name}.qw\n");
        let rows = all.iter().take(12).zip(&between).flat_map(|(far, other)| {
            let mut far = *far;
            let out = far.translation.vector.normalize() * beyond;
            far.translation.vector += out;
            [*other, far]
        });
        let row = |p: nalgebra::Isometry3<f64>| {
            let numbers = p.translation.vector.iter().chain(p.rotation.coords.iter());
            let cells: Vec<String> = numbers.map(|v| format!("{v:.12}")).collect();
            cells.join(",") + "\n"
        };
        header + &rows.map(row).collect::<String>()
    };
    let options = CorrectOptions {
        tool: Some(name.clone()),
        ..CorrectOptions::default()
    };
    let missed = correct(&robot, &table(&folder, &text(2e-3)), &options).expect("corrected");
    assert_eq!((missed.rows, missed.refused), (24, 0), "{missed:?}");
    assert!(missed.after_m[1] < 5e-3, "{missed:?}");
    let far = correct(&robot, &table(&folder, &text(3.0)), &options).expect("corrected");
    assert_eq!(
        (far.reached, far.nearer, far.refused),
        (12, 0, 12),
        "{far:?}"
    );
}

/// What is stated of a command is what the model has of the sequence of commands, however small its steps: backlash takes the side from
/// which the joint really comes.
#[test]
fn what_is_stated_holds_for_the_commands_one_after_the_other() {
    let mut r = crate::common::rng(31);
    let (mut reached, mut between) = (0, 0);
    for seed in 0..6 {
        let mut file = crate::common::robot(
            &mut crate::common::rng(seed),
            6,
            false,
            crate::common::Effects::All,
        );
        for effect in file.joints.iter_mut().flat_map(|j| &mut j.effects) {
            // 0.2°: millimeters at the tool.
            if effect.kind == "backlash" {
                effect.value = 3.5e-3;
            }
        }
        let robot = Robot {
            model: calib_model::Model::new(&file).expect("a model"),
            file,
        };
        let mut q = crate::common::posture(&mut r, 6);
        let mut text = (0..6)
            .map(|i| format!("joint_{i}_deg"))
            .collect::<Vec<_>>()
            .join(",")
            + "\n";
        for _ in 0..60 {
            let deg: Vec<String> = q.iter().map(|q| q.to_degrees().to_string()).collect();
            text += &(deg.join(",") + "\n");
            q.iter_mut()
                .for_each(|q| *q += crate::common::within(&mut r, 6e-3));
        }
        let folder = tempfile::tempdir().expect("a folder");
        let done =
            correct(&robot, &table(&folder, &text), &CorrectOptions::default()).expect("corrected");
        let cells = cells(&done.csv);
        let column = |name: &str| cells[0].iter().position(|c| *c == name).expect("a column");
        let (mut work, mut approach) = (robot.model.work(), Approach::new(&robot.model));
        let tool = calib_model::Place::from(robot.model.last_link());
        let wanted: Vec<Vec<f64>> = text.lines().skip(1).map(numbers).collect();
        for (row, wanted) in cells[1..].iter().zip(&wanted) {
            let command = numbers(&row[1..7].join(","));
            approach.update(&robot.model, &command).expect("finite");
            robot
                .model
                .forward_nominal(wanted, &mut work)
                .expect("poses");
            let wanted = robot.model.root_from(tool, &work).expect("a place");
            let there = after(&robot, &approach, &command, tool);
            let stated: f64 = row[column("after_mm")].parse().expect("a number");
            let off = 1e3 * (wanted.t - there.t).norm();
            assert!(
                (stated - off).abs() < 2e-5,
                "seed {seed}: {stated} mm stated, {off} mm"
            );
            between += usize::from(row[column("outcome")].starts_with("nearer"));
        }
        reached += done.reached;
    }
    println!("{reached} of 360 rows reached, {between} nearer only");
    assert!(reached > 180, "{reached}");
}

/// Where the tool stands at a command to which the joints came so.
fn after(
    robot: &Robot,
    approach: &Approach,
    command: &[f64],
    tool: calib_model::Place,
) -> calib_model::Pose {
    let under = Under {
        approach: approach.directions(),
        held: None,
        temperature_c: &[],
    };
    let mut work = robot.model.work();
    robot
        .model
        .forward(command, &under, &mut work)
        .expect("poses");
    robot.model.root_from(tool, &work).expect("a place")
}

/// Degrees of a row as radians.
fn numbers(row: &str) -> Vec<f64> {
    row.split(',')
        .map(|c| c.parse::<f64>().expect("a number").to_radians())
        .collect()
}

/// Positions without an orientation are reached where they alone are wanted, and otherwise refused; a name that is not the tool is no target.
#[test]
fn what_a_table_wants_of_the_tool_is_reached_or_said() {
    let robot = arm();
    let folder = tempfile::tempdir().expect("a folder");
    let position_only = CorrectOptions {
        position_only: true,
        ..CorrectOptions::default()
    };
    let (mut work, last) = (robot.model.work(), robot.model.last_link());
    let tool = robot.model.links()[last.index()].clone();
    let q = [0.2, 0.4];
    robot
        .model
        .forward(&q, &Under::default(), &mut work)
        .expect("poses");
    let at = robot
        .model
        .root_from(last.into(), &work)
        .expect("a place")
        .t;
    let columns = format!("{tool}.x_m,{tool}.y_m,{tool}.z_m");
    let place = format!("{},{},{}", at.x, at.y, at.z);
    let with = format!("shoulder_deg,elbow_deg,{columns}\n8,20,{place}\n");
    let without = format!("{columns}\n{place}\n");
    for text in [&with, &without] {
        let done = correct(&robot, &table(&folder, text), &position_only).expect("corrected");
        let cells = cells(&done.csv);
        let command = numbers(&cells[1][1..3].join(","));
        let under = Under::default();
        robot
            .model
            .forward(&command, &under, &mut work)
            .expect("poses");
        let there = robot
            .model
            .root_from(last.into(), &work)
            .expect("a place")
            .t;
        assert!((there - at).norm() < 1e-6, "{}", done.csv);
        // How it is turned is not known of these.
        let end = cells[1].len();
        assert_eq!(cells[1][end - 2..], ["", ""], "{}", done.csv);
        let refused = correct(&robot, &table(&folder, text), &CorrectOptions::default());
        let said = refused.expect_err("refused").to_string();
        assert!(
            said.contains("without its orientation") && said.contains("--position-only"),
            "{said}"
        );
    }
    // Of joint positions the nominal orientation is known, and its error stated.
    let rows = table(&folder, "shoulder_deg,elbow_deg\n8,20\n");
    let done = correct(&robot, &rows, &position_only).expect("corrected");
    let row = &cells(&done.csv)[1];
    assert!(
        row[row.len() - 2].parse::<f64>().expect("a number") > 1e-6,
        "{}",
        done.csv
    );

    let other = "claw.x_m,claw.y_m,claw.z_m,claw.qx,claw.qy,claw.qz,claw.qw";
    let pose = format!("{place},0,0,0,1");
    let text = format!("shoulder_deg,elbow_deg,{other}\n8,20,{pose}\n");
    let done =
        correct(&robot, &table(&folder, &text), &CorrectOptions::default()).expect("corrected");
    assert_eq!(done.unused, ["claw"]);
    let alone = correct(
        &robot,
        &table(&folder, &format!("{other}\n{pose}\n")),
        &CorrectOptions::default(),
    );
    let said = alone.expect_err("refused").to_string();
    assert!(said.contains("`claw` is no link or point"), "{said}");
    let link = &robot.model.links()[1];
    let text = format!(
        "shoulder_deg,elbow_deg,{}\n8,20,{pose}\n",
        other.replace("claw", link)
    );
    let of_link = correct(&robot, &table(&folder, &text), &CorrectOptions::default());
    let said = of_link.expect_err("refused").to_string();
    assert!(said.contains(&format!("--tool {link}")), "{said}");
}
