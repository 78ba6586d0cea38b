//! Residuals as CSV: one row per observation, lengths in m, angles in rad, empty = unknown.

use crate::{JointValue, ReportError, ResidualRow, Unit, number};
use calib_finding::cell as safe;
use std::collections::BTreeMap;
use std::sync::Arc;

/// `recording,row,t_s,subject,x_m,y_m,z_m,norm_m,rotation_rad,normalised,used,<joint>_rad|_m…`; predicted − observed in the tracker frame.
///
/// # Errors
/// [`ReportError::Csv`] when the writer fails.
pub fn residuals_csv(rows: &[ResidualRow]) -> Result<String, ReportError> {
    let failed = |source: ::csv::Error| ReportError::Csv(source.to_string());
    // Every joint of any row has a column, in order of its name.
    let mut columns: BTreeMap<&str, &str> = BTreeMap::new();
    for joint in rows.iter().flat_map(|row| row.joints.iter()) {
        columns.insert(
            &joint.joint,
            if joint.unit == Unit::Meter {
                "m"
            } else {
                "rad"
            },
        );
    }
    let mut writer = ::csv::WriterBuilder::new()
        .terminator(::csv::Terminator::Any(b'\n'))
        .from_writer(Vec::new());
    let fixed = [
        "recording",
        "row",
        "t_s",
        "subject",
        "x_m",
        "y_m",
        "z_m",
        "norm_m",
        "rotation_rad",
        "normalised",
        "used",
    ];
    let header = fixed.iter().map(ToString::to_string).chain(
        columns
            .iter()
            .map(|(joint, unit)| safe(&format!("{joint}_{unit}")).into_owned()),
    );
    writer.write_record(header).map_err(failed)?;
    // All markers of a row share its joint values.
    let mut of_joints: Vec<String> = Vec::new();
    let mut joints: Option<&Arc<[JointValue]>> = None;
    for row in rows {
        if joints.is_none_or(|joints| !Arc::ptr_eq(joints, &row.joints)) {
            joints = Some(&row.joints);
            let of = |joint: &&str| row.joints.iter().find(|value| value.joint == *joint);
            let text = |joint| of(joint).map_or_else(String::new, |value| cell(value.value));
            of_joints = columns.keys().map(text).collect();
        }
        let [x, y, z] = row.residual_m;
        let mut cells = vec![
            safe(&row.recording).into_owned(),
            row.row.to_string(),
            row.time_s.map_or_else(String::new, cell),
            safe(&row.subject).into_owned(),
            cell(x),
            cell(y),
            cell(z),
            cell(row.length_m()),
            row.rotation_rad.map_or_else(String::new, cell),
            row.normalized.map_or_else(String::new, cell),
            row.used.to_string(),
        ];
        cells.extend_from_slice(&of_joints);
        writer.write_record(&cells).map_err(failed)?;
    }
    let bytes = writer
        .into_inner()
        .map_err(|source| ReportError::Csv(source.to_string()))?;
    String::from_utf8(bytes).map_err(|source| ReportError::Csv(source.to_string()))
}

/// Nine significant digits: a nanometer in a meter is enough for a residual.
fn cell(x: f64) -> String {
    if !x.is_finite() {
        return String::new();
    }
    number::round_trip(format!("{x:.8e}").parse().unwrap_or(x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_is_empty_and_names_are_quoted() {
        let rows = [
            ResidualRow {
                recording: "a, b".into(),
                row: 3,
                subject: "m1".into(),
                residual_m: [0.1 + 0.2, -0.0, 0.0],
                used: true,
                joints: [JointValue::radians("q", 0.5)].into(),
                ..ResidualRow::default()
            },
            ResidualRow {
                row: 4,
                time_s: Some(0.25),
                residual_m: [f64::NAN, 0.0, 0.0],
                joints: [JointValue::meters("slide", 0.1)].into(),
                ..ResidualRow::default()
            },
        ];
        let expected = "recording,row,t_s,subject,x_m,y_m,z_m,norm_m,rotation_rad,normalised,used,q_rad,slide_m\n\
                        \"a, b\",3,,m1,0.3,0,0,0.3,,,true,0.5,\n\
                        ,4,0.25,,,0,0,,,,false,,0.1\n";
        assert_eq!(residuals_csv(&rows).expect("rows"), expected);
    }
}
