//! Units of length however they are stated, URDFs in other units, and two files with one row for every posture.

use calib_init::mistake::Mistake;
use calib_init::{About, File, InitError, Proposal, Request, propose, tables};
use calib_recording::LengthUnit;
use calib_urdf::RobotModel;

use crate::lab::{
    Design, Kind, URDF, arm, assert_read, corrected, file, proposed, recordings, request, text,
    with_cells, with_names,
};

const HAND: [(&str, &str, Kind); 1] = [("hand", "flange", Kind::Markers(4))];

/// What a column of a place is called.
type Naming<'a> = &'a dyn Fn(&str) -> String;

/// A table whose places are in a unit, and whose joints' columns have no unit.
fn in_unit(table: &str, unit: LengthUnit, name: impl Fn(&str) -> String) -> String {
    let is_place = |name: &str| name.starts_with("hand");
    let scaled = |column: &str, cell: &str| match (is_place(column), cell.parse::<f64>()) {
        (true, Ok(meters)) => (meters * unit.per_meter()).to_string(),
        _ => cell.to_owned(),
    };
    with_names(&with_cells(table, scaled), |column| {
        let bare = column.strip_suffix("_deg").unwrap_or(column);
        match is_place(column) {
            true => name(bare.strip_suffix("_m").unwrap_or(bare)),
            false => bare.to_owned(),
        }
    })
}

#[test]
fn every_unit_of_length_is_read_however_its_columns_state_it() {
    let good = recordings(&HAND, Design::Random, 71);
    let table = text(&good["poses"]);
    for unit in LengthUnit::ALL {
        let short = unit.name();
        let long = match unit {
            LengthUnit::M => "meters",
            LengthUnit::Cm => "centimeters",
            LengthUnit::Mm => "millimeters",
            LengthUnit::Um => "micrometers",
            LengthUnit::In => "inches",
            LengthUnit::Ft => "feet",
        };
        let ways: [(&str, Naming<'_>); 4] = [
            ("dotted", &|n| format!("{n}_{short}")),
            ("joined", &|n| format!("{}_{short}", n.replace('.', "_"))),
            ("bracket", &|n| format!("{} [{short}]", n.replace('.', "_"))),
            ("long", &|n| format!("{}_{long}", n.replace('.', "_"))),
        ];
        for (way, name) in ways {
            let what = format!("{short} {way}");
            let proposal = proposed(&[file("poses", in_unit(&table, unit, name))]);
            assert_read(&proposal, &what);
            assert!(corrected(&proposal).is_empty(), "{what}");
        }
    }
}

#[test]
fn a_unit_of_length_that_no_column_states_is_told_by_the_motion() {
    let good = recordings(&HAND, Design::Random, 72);
    let table = text(&good["poses"]);
    for unit in LengthUnit::ALL {
        let bare = in_unit(&table, unit, |n| n.replace('.', "_"));
        let proposal = proposed(&[file("poses", bare)]);
        assert_read(&proposal, unit.name());
        let map = proposal.recordings[0].table.columns.as_ref();
        assert_eq!(map.expect("a map").lengths, unit);
        // What the motion corrects is not said twice.
        let guesses = |f: &&calib_init::Fact| matches!(f.about, About::Lengths { .. });
        let said = proposal.facts.iter().filter(guesses).count();
        assert_eq!(said + corrected(&proposal).len(), 1, "{unit:?}");
    }
}

#[test]
fn a_unit_that_the_names_state_wrongly_is_another_one() {
    let good = recordings(&HAND, Design::Random, 73);
    let table = text(&good["poses"]);
    for (really, stated) in [("cm", "mm"), ("in", "mm"), ("cm", "m"), ("mm", "cm")] {
        let unit = LengthUnit::from_name(really).expect("a unit");
        let wrong = in_unit(&table, unit, |n| format!("{n}_{stated}"));
        let proposal = proposed(&[file("poses", wrong)]);
        assert_read(&proposal, really);
        let wanted = Mistake::TrackerUnit { unit: unit.name() };
        assert_eq!(corrected(&proposal), [&wanted]);
    }
}

/// The arm with other numbers: `change(attribute, numbers)`.
fn changed(attributes: &[&str], factor: f64) -> RobotModel {
    let mut text = include_str!("../../../../book/src/tutorial/arm.urdf").to_owned();
    for attribute in attributes {
        let key = format!(" {attribute}=\"");
        let mut out = String::new();
        let mut rest = text.as_str();
        while let Some((before, behind)) = rest.split_once(&key) {
            let (numbers, after) = behind.split_once('"').expect("a closing quote");
            let scaled = numbers
                .split_whitespace()
                .map(|n| (n.parse::<f64>().expect("a number") * factor).to_string());
            let scaled: Vec<String> = scaled.collect();
            out += &format!("{before}{key}{}\"", scaled.join(" "));
            rest = after;
        }
        text = out + rest;
    }
    RobotModel::from_urdf_text(&text, "arm.urdf").expect("a robot")
}

#[test]
fn a_urdf_in_millimeters_is_refused_with_recordings_and_named_without() {
    let model = changed(&["xyz"], 1000.0);
    let good = recordings(&HAND, Design::Random, 74);
    for given in ["_m", "_mm"] {
        let unit = LengthUnit::from_name(&given[1..]).expect("a unit");
        let table = in_unit(&text(&good["poses"]), unit, |n| format!("{n}{given}"));
        match propose(&model, &request(), &[file("poses", table)]) {
            Err(InitError::RobotTooLarge { ratio, rms, .. }) => {
                assert!((ratio - 1000.0).abs() < 1e-6);
                assert!(rms.1 / ratio < 8e-3);
            }
            other => panic!("{given}: {other:?}"),
        }
    }
    let proposal = propose(&model, &request(), &[]).expect("a profile");
    let said = |about: &About| matches!(about, About::TooLarge { reach } if *reach > 500.0);
    assert!(proposal.to_check().any(|f| said(&f.about)));
}

#[test]
fn limits_in_degrees_are_named_and_read_as_degrees() {
    let model = changed(&["lower", "upper"], 180.0 / std::f64::consts::PI);
    let proposal = propose(&model, &request(), &[]).expect("a profile");
    let named = proposal.facts.iter().find_map(|f| match &f.about {
        About::Joints { in_degrees, .. } => Some(in_degrees.len()),
        _ => None,
    });
    assert_eq!(named, Some(6));
    let skeleton = proposal.skeleton.as_ref().expect("postures");
    for (joint, (low, high)) in &skeleton.random {
        let (least, most) = arm().joint(*joint).limits.range().expect("limits");
        assert!(*low >= least - 1e-9 && *high <= most + 1e-9);
    }
    // Nothing is said of the arm as it is.
    let arm = propose(&arm(), &request(), &[]).expect("a profile");
    let none = arm.facts.iter().find_map(|f| match &f.about {
        About::Joints { in_degrees, .. } => Some(in_degrees.is_empty()),
        _ => None,
    });
    assert_eq!(none, Some(true));
}

/// The tracker's columns and the joints' columns of a table, each with the columns that `with` names.
fn two_files(table: &str, with: &str) -> [File; 2] {
    let body: Vec<&str> = table.lines().filter(|l| !l.starts_with('#')).collect();
    let names: Vec<&str> = body[0].split(',').collect();
    let part = |keep: &dyn Fn(&str) -> bool| -> String {
        let cells = |line: &&str| {
            let of = line.split(',').zip(&names).filter(|(_, n)| keep(n));
            of.map(|(c, _)| c.to_owned()).collect::<Vec<_>>().join(",")
        };
        body.iter().map(|line| cells(line) + "\n").collect()
    };
    let tracked = part(&|n| n.starts_with("hand") || n == with);
    let joints = part(&|n| n.starts_with("joint") || n == with);
    [file("tracker", tracked), file("robot", joints)]
}

#[test]
fn two_files_with_one_row_for_every_posture_are_paired_by_their_rows() {
    let good = recordings(&HAND, Design::Random, 75);
    let table = text(&good["poses"]);
    // With a label, without one, and with times that are no streams.
    let labeled = with_cells(
        &table.replacen("joint_1_deg", "trial,joint_1_deg", 1),
        |_, cell| cell.to_owned(),
    );
    let rows = labeled.lines().filter(|l| !l.starts_with('#'));
    let labeled: Vec<String> = rows
        .enumerate()
        .map(|(i, line)| match i {
            0 => line.to_owned(),
            _ => {
                let at = line.find(',').expect("cells") + 1;
                format!("{}a{i},{}", &line[..at], &line[at..])
            }
        })
        .collect();
    let labeled = labeled.join("\n") + "\n";
    let timed = labeled.replacen("trial", "t_s", 1).replace(",a", ",");
    for (what, table, with) in [
        ("bare", &table, ""),
        ("label", &labeled, "trial"),
        ("time", &timed, "t_s"),
    ] {
        let given = two_files(table, with);
        let proposal =
            propose(&arm(), &request(), &given).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_read(&proposal, what);
        let rows = proposal.facts.iter().find_map(|f| match &f.about {
            About::Log { rows, .. } => *rows,
            _ => None,
        });
        assert_eq!(rows, Some(24), "{what}");
        tables::robot_profile(&arm(), &proposal).expect("a profile that the program takes");
    }
    // A row less.
    let mut given = two_files(&table, "");
    let short = String::from_utf8(given[1].bytes.clone()).expect("text");
    let short: Vec<&str> = short.lines().collect();
    given[1].bytes = (short[..short.len() - 1].join("\n") + "\n").into_bytes();
    let refused = propose(&arm(), &request(), &given);
    assert!(
        matches!(refused, Err(InitError::RowsDiffer { rows: (24, 23), .. })),
        "{refused:?}"
    );
    // Labels that disagree.
    let mut given = two_files(&labeled, "trial");
    let other = String::from_utf8(given[1].bytes.clone()).expect("text");
    given[1].bytes = other.replacen("a3,", "b3,", 1).into_bytes();
    let refused = propose(&arm(), &request(), &given);
    let said = refused.expect_err("two orders").to_string();
    assert!(said.contains("`trial` is `a3`"), "{said}");
}

#[test]
fn markers_on_a_link_that_nothing_moves_are_refused() {
    let still = Request {
        markers_on: Some("base_link".to_owned()),
        ..request()
    };
    match propose(&arm(), &still, &[]) {
        Err(InitError::StillLink { link, tips }) => {
            assert_eq!(link, "base_link");
            assert!(!tips.is_empty());
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_agrees_only_after_a_correction_says_so() {
    let good = recordings(&HAND, Design::Random, 76);
    let table = text(&good["poses"]);
    let swap = |name: &str| match name {
        "joint_2_deg" => "joint_3_deg".to_owned(),
        "joint_3_deg" => "joint_2_deg".to_owned(),
        other => other.to_owned(),
    };
    let after = |proposal: &Proposal| {
        proposal.facts.iter().find_map(|f| match f.about {
            About::Agrees { corrected, .. } => Some(corrected),
            _ => None,
        })
    };
    let swapped = proposed(&[file("poses", with_names(&table, swap))]);
    assert_eq!(corrected(&swapped).len(), 1);
    assert_eq!(after(&swapped), Some(true));
    let right = proposed(&[file("poses", table)]);
    assert_eq!(after(&right), Some(false));
}

/// The arm with `joint_2` followed by `joint_3` within ±0.2 rad, and `joint_5` with exchanged limits.
#[test]
fn limits_of_followers_and_exchanged_limits_count() {
    let mut text = URDF.to_owned();
    let limit_of = |text: &str, joint: &str| {
        let from = text.find(&format!("name=\"{joint}\"")).expect("a joint");
        let at = from + text[from..].find("<limit").expect("a limit");
        (at, at + text[at..].find("/>").expect("its end") + 2)
    };
    let (from, to) = limit_of(&text, "joint_3");
    let follower = "<limit lower=\"-0.2\" upper=\"0.2\" effort=\"1\" velocity=\"1\"/><mimic joint=\"joint_2\" multiplier=\"-1\"/>";
    text.replace_range(from..to, follower);
    let (from, to) = limit_of(&text, "joint_5");
    let exchanged = "<limit lower=\"2.0\" upper=\"-1.7\" effort=\"1\" velocity=\"1\"/>";
    text.replace_range(from..to, exchanged);
    let model = RobotModel::from_urdf_text(&text, "arm.urdf").expect("a robot");
    let proposal = propose(&model, &request(), &[]).expect("a profile");
    let skeleton = proposal.skeleton.as_ref().expect("postures");
    let second = model.joint_id("joint_2").expect("a joint");
    let range = skeleton.random.iter().find(|(joint, _)| *joint == second);
    let (low, high) = range.expect("it moves").1;
    assert!(low >= -0.2 && high <= 0.2, "{low} {high}");
    let said: Vec<String> = proposal
        .to_check()
        .map(|f| calib_init::words::sentence(&f.about))
        .collect();
    let said = said.join("\n");
    assert!(said.contains("lower limit of `joint_5` is above"), "{said}");
    assert!(!said.contains("No limits are given"), "{said}");
}
