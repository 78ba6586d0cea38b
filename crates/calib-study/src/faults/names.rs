//! Whether a finding names the cause of a case, or what the data cannot distinguish from it.

use calib_finding::{Fact, Finding, Severity};

use super::case::Case;
use super::fault::Fault;

/// What a finding must say to name a fault: its id with one of the joints, or a code among what is as good.
struct Expected {
    ids: Vec<&'static str>,
    /// Joints that the finding must be about; empty: any.
    joints: Vec<String>,
    /// How the codes of its hypotheses may begin.
    codes: Vec<String>,
}

/// A warning or an error that names one of the faults of the case.
pub(crate) fn names_the_cause(case: &Case, finding: &Finding) -> bool {
    finding.severity >= Severity::Warning
        && case
            .disturbance
            .faults
            .iter()
            .any(|fault| fits(&expected(case, *fault), finding))
}

fn fits(expected: &Expected, finding: &Finding) -> bool {
    let text = |fact: &Fact| match fact {
        Fact::Names(names) => names.clone(),
        Fact::Name(name) => vec![name.to_string()],
        _ => Vec::new(),
    };
    let of = |name: &str| finding.facts.get(name).map_or_else(Vec::new, text);
    let joints: Vec<String> = ["joint", "other"].iter().flat_map(|n| of(n)).collect();
    let id = finding.id.to_string();
    let direct = expected.ids.contains(&id.as_str())
        && (expected.joints.is_empty() || expected.joints.iter().any(|j| joints.contains(j)));
    let alike = [
        "parameter",
        "equivalent",
        "alternatives",
        "leading",
        "other_correction",
        "rivals",
    ];
    direct
        || alike.iter().flat_map(|n| of(n)).any(|code| {
            let parts = code.split(" + ");
            parts
                .into_iter()
                .any(|part| expected.codes.iter().any(|c| part.starts_with(c.as_str())))
        })
}

fn expected(case: &Case, fault: Fault) -> Expected {
    let d = &case.disturbance;
    let (joint, other) = (format!("j{}", d.joint + 1), format!("j{}", d.other + 1));
    let turning = d.transmission.offset.or(d.transmission.eccentricity);
    let turning = turning.map_or_else(|| joint.clone(), |(j, _)| format!("j{}", j + 1));
    let one = |ids: &[&'static str], joint: &str, codes: Vec<String>| Expected {
        ids: ids.to_vec(),
        joints: vec![joint.to_owned()],
        codes,
    };
    let any = |ids: &[&'static str], codes: &[&str]| Expected {
        ids: ids.to_vec(),
        joints: Vec::new(),
        codes: codes.iter().map(|c| (*c).to_owned()).collect(),
    };
    match fault {
        Fault::Sign | Fault::SignInOne => {
            one(&["joint-sign"], &joint, vec![format!("sign({joint})")])
        }
        Fault::Exchange | Fault::ExchangeInOne => one(
            &["joint-order"],
            &joint,
            vec![
                format!("exchange({joint}, {other})"),
                format!("exchange({other}, {joint})"),
            ],
        ),
        Fault::JointUnit => one(
            &["unit-mismatch"],
            &joint,
            vec![format!("unit({joint},"), "unit(all".to_owned()],
        ),
        Fault::Coupling | Fault::Crosstalk => one(
            &["joint-coupling"],
            &joint,
            vec![
                format!("coupling({joint}, {other}"),
                format!("{joint}.coupling.{other}"),
            ],
        ),
        Fault::QuarterTurn => one(
            &["joint-offset"],
            &turning,
            vec![format!("offset({turning},")],
        ),
        Fault::RowShift => any(&["clock-lag"], &["rows("]),
        Fault::MissingColumn => one(
            &["joint-column-missing"],
            &joint,
            vec![format!("column({joint})")],
        ),
        Fault::WrongLink => any(&["wrong-mount"], &["link("]),
        Fault::TrackerUnit | Fault::TrackerUnitInOne => any(&["unit-mismatch"], &["unit(tracker"]),
        Fault::Mirrored => any(&["mirrored"], &["mirrored("]),
        Fault::QuaternionOrder => any(&["quaternion-order"], &["poses("]),
        Fault::InversePoses => any(&["pose-convention"], &["poses("]),
        Fault::TrackerMoved => any(&["tracker-moved"], &["moved(tracker)"]),
        Fault::Remounted => any(&["body-remounted"], &["remounted("]),
        Fault::Gain => one(
            &["joint-gain"],
            &joint,
            vec![format!("gain({joint}"), format!("{joint}.gain")],
        ),
        Fault::Eccentricity | Fault::Compliance => any(&["missing-physics"], &[]),
        Fault::Slip | Fault::SmallSlip | Fault::Bump | Fault::Drift | Fault::OffsetStep => any(
            &["changed-while-recording", "body-remounted", "tracker-moved"],
            &[],
        ),
        Fault::RepeatedFrames | Fault::CopiedRows | Fault::Memory => {
            any(&["rows-repeated", "frames-merged", "noise-has-memory"], &[])
        }
        Fault::HeldOutCopies => any(&["held-out-in-training"], &[]),
        Fault::None | Fault::Outliers | Fault::Pair => any(&[], &[]),
    }
}
