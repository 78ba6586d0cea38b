//! `plugins/column-reader-c`: read tables, refuse others with line and column, and pass the conformance check.

use std::{collections::BTreeMap, path::PathBuf};

use calib_plugin::{
    Control, Host, JointUnit, MarkerSample, SearchPath, Source, Streams, Value,
    check::{Limits, check},
};

use crate::bed::Bed;

const SOURCE: &str = "../../plugins/column-reader-c/column_reader.c";

fn built(bed: &Bed) -> Option<PathBuf> {
    bed.build(SOURCE, "column_reader", &[])
}

fn read(bed: &Bed, parameters: &[(&str, &str)], text: &str) -> Result<Streams, String> {
    let given: BTreeMap<String, Value> = parameters
        .iter()
        .map(|(name, value)| {
            let value = match value.parse() {
                Ok(integer) if *name == "skip_lines" => Value::Integer(integer),
                _ => Value::Text(value.to_string()),
            };
            (name.to_string(), value)
        })
        .collect();
    let plugin = bed.load("column_reader").map_err(|e| e.to_string())?;
    let reader = plugin
        .reader("columns")
        .and_then(|r| r.with(&given))
        .map_err(|e| e.to_string())?;
    let source = Source {
        name: "table.txt",
        bytes: text.as_bytes(),
    };
    reader.read(&source, &Control::default()).map_err(|e| {
        e.to_string()
            .replace("plugin `column-reader`, reader `columns`: ", "")
    })
}

#[test]
fn markers_bodies_and_joints_come_out_in_si() {
    let bed = Bed::new();
    if built(&bed).is_none() {
        return;
    }
    let columns = "t_ms, tip.x_mm, tip.y_mm, tip.z_mm, arm.x_m, arm.y_m, arm.z_m, arm.qx, arm.qy, arm.qz, arm.qw, \
                   -, elbow_deg, slide_mm";
    let text = "a heading\r\n# a comment\n\
                0;1;2;3;0.1;0.2;0.3;0;0;1;0;x;180;5\r\n\
                \n\
                10;-9;-9;-9;0.1;0.2;;0;0;0;1;;nan;1e1";
    let parameters = [
        ("columns", columns),
        ("separator", "semicolon"),
        ("skip_lines", "1"),
        ("lost", "-9"),
    ];
    let streams = read(&bed, &parameters, text).unwrap();
    let timeline = &streams.timelines[0];
    assert_eq!(
        (timeline.rows.as_slice(), timeline.t_s.as_deref()),
        (&[3, 5][..], Some(&[0.0, 0.01][..]))
    );
    assert_eq!(
        streams.markers[0].samples,
        [
            MarkerSample::Measured([0.001, 0.002, 0.003]),
            MarkerSample::Lost
        ]
    );
    let pose = streams.bodies[0].samples[0].unwrap();
    // Half a turn about z.
    assert_eq!(
        pose.rotation,
        [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
    );
    assert_eq!(pose.translation_m, [0.1, 0.2, 0.3]);
    assert_eq!(streams.bodies[0].samples[1], None);
    assert_eq!(
        streams.joints[0].samples,
        [Some(std::f64::consts::PI), None]
    );
    assert_eq!(
        (streams.joints[1].unit, streams.joints[1].samples[1]),
        (JointUnit::Length, Some(0.01))
    );
    assert_eq!(
        streams.notes,
        ["Column 12 is left out, as the layout says."]
    );
}

#[test]
fn runs_of_blanks_separate_and_static_poses_have_no_time() {
    let bed = Bed::new();
    if built(&bed).is_none() {
        return;
    }
    let parameters = [("columns", "a_rad,b_m"), ("separator", "space")];
    let streams = read(&bed, &parameters, "  1.5 \t 2\n+3 -4e-1  \n").unwrap();
    assert_eq!(streams.timelines[0].t_s, None);
    assert_eq!(streams.joints[0].samples, [Some(1.5), Some(3.0)]);
    assert_eq!(streams.joints[1].samples, [Some(2.0), Some(-0.4)]);
}

#[test]
fn wrong_tables_are_refused_with_line_and_column() {
    let bed = Bed::new();
    if built(&bed).is_none() {
        return;
    }
    let body = "b.x_m,b.y_m,b.z_m,b.qx,b.qy,b.qz,b.qw";
    let messages: Vec<String> = [
        ("a_rad,b_rad", ""),
        ("a_rad,b_rad", "# only a comment\n"),
        ("a_rad,b_rad", "1,2\n1\n"),
        ("a_rad,b_rad", "1,2,3\n"),
        ("a_rad,b_rad", "1,two\n"),
        ("a_rad,b_rad", "1,0x10\n"),
        ("a_rad,b_rad", "1,1e999\n"),
        ("t_s,a_rad", "1,0\n0.5,0\n"),
        ("t_s,a_rad", ",0\n"),
        (body, "0,0,0,0,0,0,2\n"),
        ("a.x_m,a.y_m", "1,2\n"),
        ("a_inch", "1\n"),
        ("a_rad,a_rad", "1,1\n"),
        ("t_s,t_ms,a_m", "1,1,1\n"),
        ("-", "1\n"),
        ("", "1\n"),
    ]
    .iter()
    .map(|(columns, text)| read(&bed, &[("columns", columns)], text).unwrap_err())
    .collect();
    insta::assert_snapshot!(messages.join("\n"));
}

#[test]
fn it_passes_the_conformance_check() {
    let bed = Bed::new();
    if built(&bed).is_none() {
        return;
    }
    let search = SearchPath {
        environment: vec![bed.path().to_path_buf()],
        ..SearchPath::default()
    };
    let limits = Limits {
        huge: 20_000,
        ..Limits::default()
    };
    let table = check(&Host::new(search, true), "column-reader", &limits);
    insta::assert_snapshot!(table);
    assert!(table.passed());
}
