//! Tables in dialects of spreadsheets and loggers: a row of units, a stated separator, UTF-16, quaternions in another order than their names say.

use calib_init::mistake::Mistake;
use calib_init::{About, File, write};
use calib_recording::LengthUnit;
use calib_sim::Motion;

use crate::lab::{
    Design, Kind, arm, assert_read, corrected, file, link_of, proposed, recordings, request,
    streams, text, with_cells, with_names,
};

/// The robot stops again and again.
const HOLDS: Motion = Motion::StopAndGo {
    hold: 1.6,
    travel: 1.2,
};
const HAND: [(&str, &str, Kind); 1] = [("hand", "flange", Kind::Markers(4))];

/// The names of a table without their units, and a row of these units; places in millimeters.
fn with_unit_row(table: &str, name: impl Fn(&str) -> String, angle: &str) -> String {
    let scaled = |column: &str, cell: &str| match (column.ends_with("_m"), cell.parse::<f64>()) {
        (true, Ok(meters)) => (meters * LengthUnit::Mm.per_meter()).to_string(),
        _ => cell.to_owned(),
    };
    let table = with_cells(table, scaled);
    let (names, rows) = table.split_once('\n').expect("a header");
    let unit = |name: &str| match name.rsplit_once('_') {
        Some((_, "deg")) => angle.to_owned(),
        Some((_, "m")) => "[mm]".to_owned(),
        _ => String::new(),
    };
    let units: Vec<String> = names.split(',').map(unit).collect();
    let bare = |column: &str| {
        let stem = column.strip_suffix("_deg").or(column.strip_suffix("_m"));
        name(stem.unwrap_or(column))
    };
    let names: Vec<String> = names.split(',').map(bare).collect();
    format!("{}\n{}\n{rows}", names.join(","), units.join(","))
}

#[test]
fn a_row_of_units_is_read_and_corrected() {
    let good = recordings(&HAND, Design::Random, 81);
    let table = text(&good["poses"]);
    let own = |name: &str| name.to_owned();
    let other = |name: &str| match name.strip_prefix("joint_") {
        Some(number) => format!("A{number}"),
        None => name.replace('.', " ").to_uppercase(),
    };
    for (what, given) in [
        ("own names", with_unit_row(&table, own, "deg")),
        (
            "other names",
            with_unit_row(&table, other, "[°]").replace("HAND_", "hand_"),
        ),
    ] {
        let proposal = proposed(&[file("poses", given)]);
        assert_read(&proposal, what);
        assert!(corrected(&proposal).is_empty(), "{what}");
    }
    // The row states the wrong unit.
    let proposal = proposed(&[file("poses", with_unit_row(&table, own, "rad"))]);
    assert_read(&proposal, "rad");
    let units = [&Mistake::Unit {
        joint: None,
        unit: "deg",
    }];
    assert_eq!(corrected(&proposal), units);
}

#[test]
fn a_stated_separator_and_utf_16_are_read() {
    let good = recordings(&HAND, Design::Random, 82);
    let table = text(&good["poses"]);
    let table: String = with_names(&table, str::to_owned).replace('.', ";");
    let table = table
        .replace(',', "\u{1}")
        .replace(';', ",")
        .replace('\u{1}', ";");
    // The dots of names and numbers are commas now: names with dots as before.
    let (names, rows) = table.split_once('\n').expect("a header");
    let table = format!("sep=;\n{}\n{rows}", names.replace(',', "."));
    let units = || table.encode_utf16();
    let little = [
        vec![0xff, 0xfe],
        units().flat_map(u16::to_le_bytes).collect(),
    ]
    .concat();
    let big = [
        vec![0xfe, 0xff],
        units().flat_map(u16::to_be_bytes).collect(),
    ]
    .concat();
    for bytes in [table.clone().into_bytes(), little, big] {
        let given = File {
            bytes,
            ..file("poses", "")
        };
        assert_read(&proposed(&[given]), "spreadsheet");
    }
}

#[test]
fn quaternions_in_another_order_than_their_names_are_listed_in_the_map() {
    let body = [("hand", "flange", Kind::Pose)];
    let good = recordings(&body, Design::Random, 83);
    // The columns are called x, y, z, w and hold w, x, y, z.
    let wrong = |table: &str| {
        let mut row = Vec::new();
        with_cells(table, |column, cell| {
            let place = ["hand.qx", "hand.qy", "hand.qz", "hand.qw"];
            if place.contains(&column) {
                row.push(cell.to_owned());
            }
            cell.to_owned()
        });
        let mut rows = row.chunks(4).flat_map(|q| [&q[3], &q[0], &q[1], &q[2]]);
        with_cells(table, |column, cell| match column.starts_with("hand.q") {
            true => rows.next().expect("a cell").clone(),
            false => cell.to_owned(),
        })
    };
    let files: Vec<File> = good
        .iter()
        .map(|(name, poses)| file(name, wrong(&text(poses))))
        .collect();
    let proposal = proposed(&files);
    assert_eq!(
        corrected(&proposal),
        [&Mistake::Quaternions { first: true }],
        "{:?}",
        proposal.facts
    );
    assert_eq!(link_of(&proposal, "hand"), "link_6");
    let profile = write::profile(&arm(), &proposal);
    assert!(
        profile.contains("quaternion_wxyz: [hand.qx, hand.qy, hand.qz, hand.qw]"),
        "{profile}"
    );
}

/// Tracker and robot with clocks that start at different times of a day, as dates.
fn dated(table: &str, start: f64, zone: &str) -> String {
    let table = with_names(table, |name| match name {
        "t_s" => "timestamp".to_owned(),
        other => other.to_owned(),
    });
    with_cells(&table, |column, cell| {
        if column != "timestamp" {
            return cell.to_owned();
        }
        let t = start + cell.parse::<f64>().expect("a time");
        let (minutes, seconds) = ((t / 60.0).floor(), t.rem_euclid(60.0));
        format!(
            "2024-05-01T{:02}:{:02}:{seconds:09.6}{zone}",
            (minutes / 60.0).floor(),
            minutes % 60.0
        )
    })
}

#[test]
fn dates_of_two_files_are_times_of_one_clock() {
    let two = streams(&HAND, HOLDS, 1.7, 84);
    for (robot_starts, zone) in [(12.0 * 3600.0, "Z"), (14.0 * 3600.0, "+02:00")] {
        let given = [
            file(
                "run_tracker",
                dated(&text(&two.tracker), 12.0 * 3600.0, "Z"),
            ),
            file("run_robot", dated(&text(&two.robot), robot_starts, zone)),
        ];
        let proposal = proposed(&given);
        assert_eq!(proposal.recordings.len(), 1);
        assert!(proposal.recordings[0].stream.is_some() && proposal.recordings[0].log.is_some());
        assert_read(&proposal, zone);
        assert!(
            !proposal
                .facts
                .iter()
                .any(|f| matches!(f.about, About::FarClocks { .. })),
            "{zone}"
        );
    }
}

#[test]
fn rostopic_names_its_joints_in_cells() {
    let two = streams(&HAND, HOLDS, 1.7, 85);
    let robot = text(&two.robot);
    let rows: Vec<Vec<&str>> = robot
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split(',').collect())
        .collect();
    let place = |name: &str| rows[0].iter().position(|n| *n == name).expect("a column");
    // The message has the joints in another order, and one that the robot does not have.
    let order = [4, 2, 6, 1, 5, 3];
    let mut table = String::from("%time,field.header.stamp,field.name0");
    (1..=6).for_each(|k| table += &format!(",field.name{k}"));
    (0..=6).for_each(|k| table += &format!(",field.position{k}"));
    (0..=6).for_each(|k| table += &format!(",field.velocity{k}"));
    for row in &rows[1..] {
        let t: f64 = row[place("t_s")].parse().expect("a time");
        let ns = 1_714_564_800_000_000_000_i64 + (t * 1e9) as i64;
        table += &format!("\n{},{ns},gripper", ns + 3_000_000_000);
        order.iter().for_each(|j| table += &format!(",joint_{j}"));
        table += ",0.01";
        for j in order {
            let degrees: f64 = row[place(&format!("joint_{j}_deg"))]
                .parse()
                .expect("an angle");
            table += &format!(",{}", degrees.to_radians());
        }
        table += &",0".repeat(7);
    }
    table.push('\n');
    let proposal = proposed(&[
        file("run_tracker", text(&two.tracker)),
        file("run_robot", table),
    ]);
    assert_read(&proposal, "rostopic");
    assert!(corrected(&proposal).is_empty(), "{:?}", proposal.facts);
    let profile = write::profile(&arm(), &proposal);
    assert!(profile.contains("joint_4: field.position1"), "{profile}");
    assert!(
        profile.contains("time: {column: field.header.stamp, unit: ns}"),
        "{profile}"
    );
}

#[test]
fn times_that_are_not_read_are_said_with_what_to_do() {
    let two = streams(&HAND, HOLDS, 0.0, 86);
    let tracker = text(&two.tracker);
    let said = |table: String| {
        let proposal = calib_init::propose(
            &arm(),
            &request(),
            &[file("run", table), file("log", text(&two.robot))],
        );
        match proposal {
            Ok(proposal) => write::profile(&arm(), &proposal),
            Err(error) => error.to_string(),
        }
    };
    let names = |name: &str| match name {
        "t_s" => "stamp.sec,stamp.nanosec".to_owned(),
        other => other.to_owned(),
    };
    let parts = with_cells(&tracker, |column, cell| match column {
        "t_s" => {
            let t: f64 = cell.parse().expect("a time");
            format!("{},{}", t.floor(), (t.fract() * 1e9).round())
        }
        _ => cell.to_owned(),
    });
    // Two files of different length need times; rows of the same number are paired, and the columns marked.
    let message = said(with_names(&parts, names));
    assert!(
        message.contains("its times are not read (`stamp.sec`, `stamp.nanosec`)"),
        "{message}"
    );
    let clock = with_cells(&tracker, |column, cell| match column {
        "t_s" => {
            let t: f64 = cell.parse().expect("a time");
            format!("01.05.2024 12:{:02}:{:06.3}", (t / 60.0).floor(), t % 60.0)
        }
        _ => cell.to_owned(),
    });
    let message = said(with_names(&clock, |name| name.replace("t_s", "zeit")));
    assert!(
        message.contains("its times are not read (`zeit`)"),
        "{message}"
    );
    let good = recordings(&HAND, Design::Random, 87);
    let mut row = 0;
    let poses = with_cells(&text(&good["poses"]), |column, cell| match column {
        "pose" => {
            row += 1;
            format!("{row},5")
        }
        _ => cell.to_owned(),
    });
    let poses = with_names(&poses, |name| {
        name.replace("pose", "stamp.sec,stamp.nanosec")
    });
    let proposal = proposed(&[file("poses", poses)]);
    let profile = write::profile(&arm(), &proposal);
    assert!(profile.contains("are the parts of one time"), "{profile}");
    assert!(
        proposal
            .to_check()
            .any(|f| matches!(f.about, About::Ignored { .. }))
    );
}

#[test]
fn a_column_that_states_its_unit_is_not_corrected_by_another_name() {
    let good = recordings(&HAND, Design::Random, 88);
    let twice = |column: &str, cell: &str| match (column, cell.parse::<f64>()) {
        ("joint_3_deg", Ok(degrees)) => degrees.to_degrees().to_string(),
        _ => cell.to_owned(),
    };
    let files: Vec<File> = good
        .iter()
        .map(|(name, poses)| file(name, with_cells(&text(poses), twice)))
        .collect();
    let proposal = proposed(&files);
    let unit = Mistake::Unit {
        joint: Some("joint_3".to_owned()),
        unit: "deg",
    };
    let is_said =
        |about: &About| matches!(about, About::NotCorrected { mistake, .. } if *mistake == unit);
    assert!(
        proposal.facts.iter().any(|f| is_said(&f.about)),
        "{:?}",
        proposal.facts
    );
    assert!(corrected(&proposal).is_empty());
}

/// A force, a velocity and an acceleration beside the markers are no markers, unless the markers have letters for names.
#[test]
fn letters_of_forces_and_velocities_are_no_markers() {
    let good = recordings(&HAND, Design::Random, 89);
    let with = |name: &str, letters: &[&str]| {
        let table = text(&good[name]);
        let lines = table.lines().enumerate().map(|(row, line)| {
            let cell = |letter: &str, axis: usize| match row {
                0 => format!(",{letter}_{}", ["x", "y", "z"][axis]),
                _ => format!(",{:.3}", (row as f64 * (1.3 + axis as f64)).sin() * 7.0),
            };
            let all = letters
                .iter()
                .flat_map(|letter| (0..3).map(move |axis| cell(letter, axis)));
            format!("{line}{}\n", all.collect::<String>())
        });
        let lines: Vec<String> = lines.collect();
        file(name, lines.concat())
    };
    let markers = |letters: &[&str]| -> usize {
        let files: Vec<File> = good.keys().map(|name| with(name, letters)).collect();
        let proposal = proposed(&files);
        let of = |body: &calib_init::proposal::Body| body.markers.len();
        proposal.bodies.iter().map(of).sum()
    };
    let none = markers(&[]);
    assert!(none > 0);
    assert_eq!(markers(&["F", "M", "v", "a"]), none);
    assert_eq!(markers(&["omega"]), none);
    assert!(markers(&["B", "F"]) > none);
}
