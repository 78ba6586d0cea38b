//! What a table says in a way of its own: numbers for hidden markers, two reversed joints, clocks far apart, bodies named like links.

use std::collections::BTreeMap;

use calib_init::mistake::Mistake;
use calib_init::session::Others;
use calib_init::source::Source;
use calib_init::{About, Fact, propose, session, tables, words};
use calib_sim::Motion;
use calib_urdf::RobotModel;

use crate::lab::{
    Design, Kind, URDF, arm, file, files, proposed, recordings, request, streams, text, with_cells,
    with_names,
};

const HAND: [(&str, &str, Kind); 1] = [("hand", "flange", Kind::Markers(4))];

fn said(facts: &[Fact]) -> String {
    let all = facts.iter().filter(|f| f.check);
    let all: Vec<String> = all.map(|f| words::sentence(&f.about)).collect();
    all.join("\n")
}

/// Positions in mm, and in some rows of each marker a number in place of all three.
#[test]
fn any_number_that_stands_for_a_hidden_marker_is_taken_as_lost() {
    let good = recordings(&HAND, Design::Random, 81);
    for code in ["-1000", "-1", "-500.0000", "-2000", "65535"] {
        let mut row = 0;
        let (mut cells, mut hidden) = (0, 0);
        let table = with_cells(&text(&good["poses"]), |column, cell| {
            let marker = column.starts_with("hand");
            if column == "joint_1_deg" {
                row += 1;
            }
            if !marker || cell.is_empty() {
                return cell.to_owned();
            }
            cells += 1;
            let number = column.bytes().find(u8::is_ascii_digit).unwrap_or(0);
            if (row + usize::from(number)) % 5 == 0 {
                hidden += 1;
                return code.to_owned();
            }
            let meters: f64 = cell.parse().expect("a number");
            format!("{:.4}", meters * 1e3)
        });
        assert!(hidden > 20 && hidden < cells / 2);
        let table = with_names(&table, |n| match n.starts_with("hand") {
            true => n.replace("_m", "_mm"),
            false => n.to_owned(),
        });
        let proposal = proposed(&[file("poses", table)]);
        let bodies: Vec<usize> = proposal.bodies.iter().map(|b| b.markers.len()).collect();
        assert_eq!(bodies, [4], "{code}: {:?}", proposal.facts);
        let sigma = proposal.noise.marker.expect("three markers");
        assert!(sigma < 1e-3, "{code}: {sigma}");
        let said = said(&proposal.facts);
        assert!(said.contains("taken as lost"), "{code}: {said}");
        assert!(
            said.contains(&format!("{} samples", hidden / 3)),
            "{code}: {said}"
        );
    }
}

/// Where the robot stands still, or a marker does, equal numbers are measurements.
#[test]
fn a_marker_that_is_where_its_coordinates_are_equal_is_measured() {
    let good = recordings(&HAND, Design::Random, 82);
    let table = with_cells(&text(&good["poses"]), |column, cell| {
        match column.starts_with("hand") {
            // A body beside the robot, to a tenth of a millimeter.
            true => "0.5".to_owned(),
            false => cell.to_owned(),
        }
    });
    let lost = calib_recording::read_bytes(
        "poses.csv",
        table.as_bytes(),
        &calib_recording::ReadOptions::default(),
    );
    let findings = lost.expect("a table").meta.findings;
    assert!(findings.is_empty(), "{findings:?}");
}

#[test]
fn two_reversed_joints_are_found_and_not_taken_for_a_third() {
    for (seed, first, second) in [(83, "joint_2", "joint_5"), (84, "joint_2", "joint_3")] {
        let good = recordings(&HAND, Design::Random, seed);
        let reversed = |column: &str, cell: &str| {
            let of = [first, second].iter().any(|j| column.starts_with(j));
            match of {
                true => (-cell.parse::<f64>().expect("a number")).to_string(),
                false => cell.to_owned(),
            }
        };
        let tables: Vec<_> = files(&good)
            .iter()
            .map(|f| {
                let table = String::from_utf8(f.bytes.clone()).expect("text");
                file(
                    f.shown.trim_end_matches(".csv"),
                    with_cells(&table, reversed),
                )
            })
            .collect();
        let proposal = proposed(&tables);
        let mut found: Vec<&str> = proposal
            .facts
            .iter()
            .filter_map(|fact| match &fact.about {
                About::Corrected {
                    mistake: Mistake::Sign { joint },
                    ..
                } => Some(joint.as_str()),
                _ => None,
            })
            .collect();
        found.sort_unstable();
        assert_eq!(found, [first, second], "{:?}", proposal.facts);
    }
}

#[test]
fn clocks_far_apart_are_brought_together_and_the_profile_says_how_far() {
    let hand = [("hand", "flange", Kind::Markers(4))];
    for offset in [47.0, 1_735_000_002.3] {
        let both = streams(&hand, Motion::Continuous, offset, 85);
        let given = [
            file("run_tracker", text(&both.tracker)),
            file("run_robot", text(&both.robot)),
        ];
        let proposal = proposed(&given);
        let far = proposal.recordings[0]
            .max_offset
            .expect("further than 10 s");
        assert!(far > offset && far < offset + 30.0, "{far}");
        let said = said(&proposal.facts);
        assert!(said.contains("max_offset_s"), "{said}");
        let written = calib_init::write::profile(&arm(), &proposal);
        assert!(
            written.contains(&format!("max_offset_s: {far:.0}")),
            "{written}"
        );
    }
    // Without it, the message has the offsets at which they overlap.
    let both = streams(&hand, Motion::Continuous, 47.0, 85);
    let given = [
        file("run_tracker", text(&both.tracker)),
        file("run_robot", text(&both.robot)),
    ];
    let sources = given
        .iter()
        .map(|f| Source::read(&arm(), f, &BTreeMap::new()));
    let sources: Vec<Source> = sources.collect::<Result<_, _>>().expect("tables");
    let (drafts, _) = session::drafts(&arm(), &sources, &Others::default()).expect("recordings");
    let mut without = proposed(&given);
    without.recordings[0].max_offset = None;
    let error = tables::tables(&arm(), &without, &drafts, &sources, &[]).expect_err("too far");
    let said = error.to_string();
    assert!(
        said.contains("offsets of up to 10 s are looked for"),
        "{said}"
    );
    let both = streams(&hand, Motion::Continuous, 2.0, 85);
    let near = proposed(&[
        file("run_tracker", text(&both.tracker)),
        file("run_robot", text(&both.robot)),
    ]);
    assert_eq!(near.recordings[0].max_offset, None);
}

#[test]
fn a_body_is_not_named_like_a_link() {
    let text_of = |link: &str| URDF.replace("\"flange\"", &format!("\"{link}\""));
    let model = |link| RobotModel::from_urdf_text(&text_of(link), "arm.urdf").expect("a robot");
    let none = propose(&model("tool"), &request(), &[]).expect("a profile");
    assert_eq!(none.bodies[0].name, "tool_markers");
    assert!(
        none.facts
            .iter()
            .any(|f| words::place(&f.place) == "bodies.tool_markers")
    );
    let good = recordings(&HAND, Design::Random, 86);
    let with = propose(&model("hand"), &request(), &files(&good)).expect("a profile");
    assert_eq!(with.bodies[0].name, "hand_markers");
    assert_eq!(proposed(&files(&good)).bodies[0].name, "hand");
}

/// Joints that are called like the coordinates of a marker.
#[test]
fn joints_named_like_coordinates_have_their_columns() {
    let joint = |name: &str, parent: &str, kind: &str| {
        format!(
            "<link name=\"{name}_l\"/><joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{name}_l\"/>\
             <axis xyz=\"1 0 0\"/><limit lower=\"-1\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>"
        )
    };
    let urdf = [
        "<robot name=\"gantry\"><link name=\"base\"/>".to_owned(),
        joint("x", "base", "prismatic"),
        joint("y", "x_l", "prismatic"),
        joint("z", "y_l", "prismatic"),
        joint("c", "z_l", "revolute"),
        "</robot>".to_owned(),
    ]
    .concat();
    let model = RobotModel::from_urdf_text(&urdf, "gantry.urdf").expect("a robot");
    let rows = "1,2,3,4,5,6,7\n2,3,4,5,6,7,9\n3,5,4,6,7,8,9\n";
    let guessed = |names: &str| {
        let table = format!("{names}\n{rows}");
        let header = calib_init::header::header(table.as_bytes()).expect("a table");
        calib_init::columns::guess(&model, &header)
    };
    let keys = |guess: &calib_init::guess::Guess| -> Vec<String> {
        guess
            .map
            .prismatic
            .keys()
            .chain(guess.map.markers.keys())
            .cloned()
            .collect()
    };
    for before in ["joint:", ""] {
        let guess = guessed(&format!(
            "{before}x_mm,{before}y_mm,{before}z_mm,c_deg,M1_x,M1_y,M1_z"
        ));
        assert_eq!(keys(&guess), ["x", "y", "z", "M1"], "{guess:?}");
        assert_eq!(guess.map.prismatic["x"], format!("{before}x_mm"));
    }
    // Without another marker they are one.
    let guess = guessed("x_mm,y_mm,z_mm,c_deg,u,v,w");
    assert!(
        guess.map.prismatic.is_empty() && guess.map.markers.len() == 1,
        "{guess:?}"
    );
}
