//! One mistake, one finding: what the checks of single recordings say of it goes where a hypothesis explains it.

use calib_finding::{About, Fact, Finding, Id, Severity, catalog};

/// Ids of the recordings' checks that a wrong reading of a joint raises.
const OF_READINGS: [Id; 4] = [
    catalog::UNIT_MISMATCH,
    catalog::JOINT_OUTSIDE_LIMITS,
    catalog::COVERAGE,
    catalog::JOINT_NEVER_MOVED,
];

/// Removes from the findings of recordings those that a mistake explains which was named over the `fitted` recordings.
pub fn keep_unexplained(
    of_recordings: &mut Vec<Finding>,
    of_model: &[Finding],
    fitted: &[&String],
) {
    // What the fit estimates is a warning, and explains as much. Small errors that a score test finds leave no residual of their own.
    let is_named = |f: &&Finding| f.severity == Severity::Error || f.facts.get("best").is_some();
    let named = || of_model.iter().filter(is_named);
    of_recordings.retain(|finding| !named().any(|named| explains(named, finding, fitted)));
}

fn explains(named: &Finding, finding: &Finding, fitted: &[&String]) -> bool {
    // What is wrong in all fitted recordings is wrong in those of the validation, which no hypothesis was tried on.
    let inside = fitted.iter().all(|name| named.subject.is_in(name))
        || finding
            .subject
            .recordings
            .iter()
            .all(|name| named.subject.is_in(name));
    let of_readings = OF_READINGS.contains(&finding.id);
    match named.id {
        id if id == catalog::UNIT_MISMATCH && named.subject.about == About::Recording => {
            of_readings && matches!(finding.subject.about, About::Joint(_))
        }
        id if id == catalog::UNIT_MISMATCH && named.subject.about == About::Lengths => {
            finding.id == catalog::UNIT_MISMATCH
                && !matches!(finding.subject.about, About::Joint(_))
        }
        id if id == catalog::MIRRORED => finding.id == catalog::MIRRORED,
        id if of_joints(id) => {
            let about = |key: &str| {
                let joint = named.facts.get(key).and_then(Fact::word);
                matches!(&finding.subject.about, About::Joint(name) if Some(name.as_str()) == joint)
            };
            // Several columns in another order: any of them.
            let several = named.facts.get("entries").is_some();
            let any = several && matches!(finding.subject.about, About::Joint(_));
            inside && of_readings && (any || about("joint") || about("other"))
        }
        _ => false,
    }
}

/// Mistakes about the readings of one joint, or of two.
fn of_joints(id: Id) -> bool {
    [
        catalog::JOINT_SIGN,
        catalog::JOINT_AXIS,
        catalog::JOINT_ORDER,
        catalog::JOINT_OFFSET,
        catalog::JOINT_GAIN,
        catalog::JOINT_COUPLING,
        catalog::JOINT_COLUMN_MISSING,
        catalog::UNIT_MISMATCH,
    ]
    .contains(&id)
}
