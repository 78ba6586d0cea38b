//! Tables in dialects of spreadsheets and loggers: a row of units, a stated separator, UTF-16, quaternions in another order than their names say.

use calib_init::mistake::Mistake;
use calib_init::{About, File, Proposal, write};
use calib_recording::LengthUnit;

use crate::lab::{
    Design, Kind, arm, file, link_of, proposed, recordings, text, with_cells, with_names,
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

fn is_right(proposal: &Proposal, what: &str) {
    let sigma = proposal.noise.marker.expect("a scatter");
    assert!((1e-4..4e-4).contains(&sigma), "{what}: {sigma}");
    assert_eq!(link_of(proposal, "hand"), "link_6", "{what}");
    let agrees = |f: &calib_init::Fact| matches!(f.about, About::Agrees { rms, .. } if rms < 8e-3);
    assert!(
        proposal.facts.iter().any(agrees),
        "{what}: {:?}",
        proposal.facts
    );
}

fn corrected(proposal: &Proposal) -> Vec<&Mistake> {
    let of = proposal.facts.iter().filter_map(|fact| match &fact.about {
        About::Corrected { mistake, .. } => Some(mistake),
        _ => None,
    });
    of.collect()
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
        is_right(&proposal, what);
        assert!(corrected(&proposal).is_empty(), "{what}");
    }
    // The row states the wrong unit.
    let proposal = proposed(&[file("poses", with_unit_row(&table, own, "rad"))]);
    is_right(&proposal, "rad");
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
        is_right(&proposed(&[given]), "spreadsheet");
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
