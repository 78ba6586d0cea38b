//! What is refused, and with what remedy; and what the URDF alone gives.

use calib_init::{InitError, Request, propose, tables, write};
use calib_urdf::RobotModel;

use crate::lab::{
    Design, Kind, URDF, arm, file, files, recordings, request, text, with_cells, with_names,
};

fn refused(given: &[calib_init::File]) -> String {
    let refused = propose(&arm(), &request(), given);
    let text = refused
        .err()
        .map_or_else(|| "nothing".to_owned(), |e| e.to_string());
    assert!(text.contains("help:") || text.contains("line"), "{text}");
    text
}

#[test]
fn bad_input_is_named_with_a_remedy() {
    let hand = [("hand", "flange", Kind::Markers(3))];
    let good = recordings(&hand, Design::Random, 1);
    let table = text(&good["poses"]);
    // Columns that are joints of no robot here.
    let other = ["pump", "fan", "lamp", "door", "bell", "horn"];
    let other = with_names(&table, |name| match name.strip_prefix("joint_") {
        Some(number) => other[number[..1].parse::<usize>().expect("a number") - 1].to_owned(),
        None => name.to_owned(),
    });
    let said = refused(&[file("other", other)]);
    assert!(said.contains("no column is a joint"), "{said}");
    // One recording in which nothing moves.
    let still = with_cells(&table, |name, cell| match name.starts_with("joint") {
        true => "10".to_owned(),
        false => cell.to_owned(),
    });
    let said = refused(&[file("still", still.clone())]);
    assert!(
        said.contains("no joint moves") && said.contains("--markers-on link_6"),
        "{said}"
    );
    // The caller knows: no refusal.
    let stated = Request {
        markers_on: Some("flange".to_owned()),
        ..request()
    };
    assert!(propose(&arm(), &stated, &[file("still", still)]).is_ok());
    let two = text(&good["poses"].select(&[0, 1]));
    assert!(refused(&[file("two", two)]).contains("four poses or more"));
    // Joints alone, and the same file twice.
    let joints = "pose,joint_1_deg,joint_2_deg\n0,1,2\n1,3,4\n";
    assert!(refused(&[file("joints", joints)]).contains("nothing was tracked"));
    let twice = files(&good);
    assert!(refused(&[twice[0].clone(), twice[0].clone()]).contains("twice"));
    assert!(propose(&arm(), &request(), &[file("empty", "")]).is_err());
    // A link that is none.
    let wrong = Request {
        markers_on: Some("flansh".to_owned()),
        ..request()
    };
    let said = propose(&arm(), &wrong, &[])
        .err()
        .map(|e| e.to_string())
        .unwrap_or_default();
    assert!(
        said.contains("did you mean `flange`?\n  help: write `--markers-on flange`, or "),
        "{said}"
    );
    assert!(said.ends_with("the chains end at `link_6`"), "{said}");
    // A joint in place of its link.
    let joint = Request {
        markers_on: Some("joint_3".to_owned()),
        ..request()
    };
    let said = propose(&arm(), &joint, &[])
        .expect_err("a joint")
        .to_string();
    assert!(
        said.starts_with("`joint_3` is a joint; its link is `link_3`\n  help: "),
        "{said}"
    );
    // A robot and a profile in place of recordings.
    let said = refused(&[files(&good)[0].clone(), file("second", URDF)]);
    assert!(said.contains("this is a URDF, not a recording"), "{said}");
    let profile = "# Made by `calib init`.\ncalib: 1\nrobot: {name: a, urdf: a.urdf}\n";
    let said = refused(&[file("profile", profile)]);
    assert!(
        said.contains("this is a profile of calib, not a recording"),
        "{said}"
    );
    assert!(said.contains("calib init --edit "), "{said}");
    // Nothing to calibrate.
    let fixed = RobotModel::from_urdf_text(
        "<robot name=\"stone\"><link name=\"a\"/></robot>",
        "stone.urdf",
    )
    .expect("a tree");
    assert!(matches!(
        propose(&fixed, &request(), &[]),
        Err(InitError::NothingMoves { .. })
    ));
}

#[test]
fn flange_poses_without_joints_are_a_hand_eye_problem() {
    let table = "flange_x,flange_y,flange_z,flange_qx,flange_qy,flange_qz,flange_qw,meas_x,meas_y,meas_z,meas_qx,meas_qy,meas_qz,meas_qw
1,2,3,0,0,0,1,1,2,3,0,0,0,1
1.1,2,3,0,0,0,1,1,2.1,3,0,0,0,1
";
    let said = refused(&[file("pairs", table)]);
    assert!(
        said.contains("calib fit handeye pairs.csv --robot flange --measured meas"),
        "{said}"
    );
}

#[test]
fn from_the_urdf_alone_the_profile_can_be_simulated() {
    let model = arm();
    for stated in [None, Some("link_4".to_owned())] {
        let asked = Request {
            markers_on: stated.clone(),
            ..request()
        };
        let proposal = propose(&model, &asked, &[]).unwrap_or_else(|e| panic!("{e}"));
        let text = write::profile(&model, &proposal);
        let link = stated.as_deref().unwrap_or("link_6");
        assert!(text.contains(&format!("link: {link},")), "{text}");
        assert_eq!(
            text.contains("CHECK: `link_6` is the end"),
            stated.is_none(),
            "{text}"
        );
        let robot =
            tables::robot_profile(&model, &proposal).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let simulated = calib_sim::simulate(&robot.profile, &model, None).expect("a section");
        let names: Vec<&String> = simulated.recordings.keys().collect();
        assert_eq!(names, ["checks", "poses", "sweep"]);
        assert_eq!(simulated.recordings["poses"].len(), 40);
    }
}

/// A robot of joints one after the other: type, and its limits.
fn chain(joints: &[(&str, &str)]) -> RobotModel {
    let mut text = "<robot name=\"chain\"><link name=\"l0\"/>".to_owned();
    for (i, (kind, limits)) in joints.iter().enumerate() {
        let axis = ["0 0 1", "0 1 0", "1 0 0"][i % 3];
        let k = i + 1;
        text += &format!(
            "<link name=\"l{k}\"/><joint name=\"j{k}\" type=\"{kind}\"><parent link=\"l{i}\"/><child link=\"l{k}\"/>\
             <origin xyz=\"0.2 0 0.1\"/><axis xyz=\"{axis}\"/>{limits}</joint>"
        );
    }
    RobotModel::from_urdf_text(&(text + "</robot>"), "chain.urdf").expect("a chain")
}

const TURN: &str = "<limit lower=\"-2\" upper=\"2\" effort=\"1\" velocity=\"1\"/>";
const SLIDE: &str = "<limit lower=\"0\" upper=\"0.5\" effort=\"1\" velocity=\"1\"/>";
const NONE: &str = "<limit lower=\"0\" upper=\"0\" effort=\"1\" velocity=\"1\"/>";

#[test]
fn robots_that_only_slide_turn_without_end_or_have_no_range_get_a_profile_that_is_valid() {
    // Replacements, what is asked for, what is said.
    type Case<'a> = (&'a [(&'a str, &'a str)], &'a str, &'a [&'a str]);
    let cases: [Case<'_>; 3] = [
        (
            &[
                ("prismatic", SLIDE),
                ("prismatic", SLIDE),
                ("prismatic", SLIDE),
            ],
            "all with limits",
            &["checks", "poses"],
        ),
        (
            &[("continuous", ""), ("revolute", TURN), ("revolute", TURN)],
            "`j1` turns without limits",
            &["checks", "poses", "sweep"],
        ),
        (
            &[("revolute", TURN), ("revolute", NONE), ("revolute", TURN)],
            "CHECK: The URDF has 3 moving joints. The limits of `j2` leave no range",
            &["checks", "poses", "sweep"],
        ),
    ];
    for (joints, said, recordings) in cases {
        let model = chain(joints);
        let proposal = propose(&model, &request(), &[]).unwrap_or_else(|e| panic!("{e}"));
        let text = write::profile(&model, &proposal);
        let lines: Vec<&str> = text
            .lines()
            .map(|l| l.trim_start_matches(['#', ' ']))
            .collect();
        assert!(lines.join(" ").contains(said), "{text}");
        let robot =
            tables::robot_profile(&model, &proposal).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let simulated = calib_sim::simulate(&robot.profile, &model, None).expect("a section");
        let names: Vec<&String> = simulated.recordings.keys().collect();
        assert_eq!(names, recordings, "{text}");
    }
    // Without any range there is nothing to record.
    let still = chain(&[("revolute", NONE), ("prismatic", NONE)]);
    let refused = propose(&still, &request(), &[])
        .err()
        .map(|e| e.to_string());
    let refused = refused.unwrap_or_default();
    assert!(
        refused.contains("no range to `j1`, `j2`") && refused.contains("help:"),
        "{refused}"
    );
}

#[test]
fn a_column_that_is_missing_is_named() {
    let hand = [("hand", "flange", Kind::Markers(3))];
    let table = text(&recordings(&hand, Design::Random, 1)["poses"]);
    // The tutorial's arm with five of its six columns.
    let without = with_names(&table, |name| match name.starts_with("joint_3") {
        true => "spare".to_owned(),
        false => name.to_owned(),
    });
    let proposal = propose(&arm(), &request(), &[file("poses", without)]);
    let proposal = proposal.unwrap_or_else(|e| panic!("{e}"));
    let facts: Vec<String> = proposal
        .facts
        .iter()
        .map(|fact| calib_init::words::sentence(&fact.about))
        .collect();
    let said = "Joint `joint_3` moved, and no column has its readings.";
    assert!(facts.iter().any(|fact| fact.contains(said)), "{facts:#?}");
}

/// A lift under the arm, without a column and with a range that does not contain 0.
#[test]
fn a_joint_without_a_column_is_held_within_its_limits() {
    let lift = "<link name=\"floor\"/><joint name=\"lift\" type=\"prismatic\"><parent link=\"floor\"/><child link=\"ROOT\"/>\
        <axis xyz=\"0 0 1\"/><limit lower=\"0.21234\" upper=\"0.5\" effort=\"1\" velocity=\"1\"/></joint></robot>";
    let arm = arm();
    let root = &arm.link(arm.root()).name;
    let urdf = URDF.replace("</robot>", &lift.replace("ROOT", root));
    let model = RobotModel::from_urdf_text(&urdf, "arm.urdf").expect("a robot");
    let hand = [("hand", "flange", Kind::Markers(3))];
    let table = text(&recordings(&hand, Design::Random, 1)["poses"]);
    let proposal = propose(&model, &request(), &[file("poses", table)]);
    let proposal = proposal.unwrap_or_else(|e| panic!("{e}"));
    let written = write::profile(&model, &proposal);
    assert!(written.contains("hold: {lift_mm: 212.4}"), "{written}");
    let said = "`lift` has no column and cannot stand at 0";
    assert!(written.contains(said), "{written}");
    let raw = calib_profile::parse(&written, "arm.yaml").unwrap_or_else(|e| panic!("{e}"));
    let checked = calib_profile::check(&raw, &written, "arm.yaml", &model);
    checked.unwrap_or_else(|e| panic!("{e}"));
}
