//! What was checked of recordings, and what could not be.

use super::prose::counted;
use crate::{CheckOutcome, CheckedRecording, DataCheck, DataChecks, JointCoverage, Unit, number};

impl DataCheck {
    /// What is in order where it passed.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Units => "units and conventions",
            Self::JointLimits => "joint readings within their limits",
            Self::JointMotion => "joints of the sweeps move",
            Self::Markers => "markers measured, none frozen or written twice",
            Self::RigidBodies => "bodies rigid, markers not swapped",
            Self::Rows => "rows at rest, in order, none repeated",
            Self::Validation => "validation poses differ from the fitted ones",
            Self::Structure => "bodies move as the nominal robot: signs, order, zeros, mounts",
            Self::Clocks => "clocks",
        }
    }
}

impl CheckOutcome {
    /// Why it was not checked; `None` where it was.
    pub(crate) fn because(self) -> Option<&'static str> {
        match self {
            Self::Passed | Self::Found => None,
            Self::NoJointLimits => Some("the URDF states no limits"),
            Self::NoRigidBody => Some("no body has three markers"),
            Self::NoValidation => Some("no recording is for validation"),
            Self::AfterErrors => Some("errors of the data come first"),
            Self::OneTable => {
                Some("not needed, each row holds joints and tracker data of one pose")
            }
        }
    }
}

/// `arm_poses: static poses, 40 rows, 12 markers, 50 Hz, 9 of 480 samples lost`
pub(crate) fn recording(of: &CheckedRecording) -> String {
    let counts = [
        (of.joints, "joint"),
        (of.markers, "marker"),
        (of.bodies, "measured pose"),
    ];
    let counts = counts.into_iter().filter(|(n, _)| *n > 0);
    let mut parts = vec![of.used_for.word().to_owned(), counted(of.rows, "row")];
    parts.extend(counts.map(|(n, what)| counted(n, what)));
    if let Some(rate) = of.rate_hz {
        parts.push(format!("{} Hz", number::bare(rate, Unit::One)));
    }
    let lost: usize = of.lost.iter().map(|lost| lost.lost).sum();
    let all = of.rows * (of.markers + of.bodies);
    parts.push(match lost {
        0 => "no sample lost".to_owned(),
        _ => format!("{lost} of {all} samples lost"),
    });
    format!("{}: {}", of.name, parts.join(", "))
}

/// Samples over the range of a joint: empty, few, many.
pub(crate) fn bar(of: &JointCoverage) -> String {
    const SHADES: [char; 4] = ['·', '░', '▒', '█'];
    let most = of.bins.iter().copied().max().unwrap_or(0).max(1);
    let shade = |n: &u64| match n {
        0 => SHADES[0],
        n if 3 * n <= most => SHADES[1],
        n if 3 * n <= 2 * most => SHADES[2],
        _ => SHADES[3],
    };
    of.bins.iter().map(shade).collect()
}

/// `Noise floor: gripM 0.31 mm, linkM 0.30 mm (σ of a marker coordinate about the rigid body).`
pub(crate) fn noise(of: &DataChecks) -> Option<String> {
    let known = of.noise.iter().filter_map(|n| {
        let sigma = number::sigma(Some(n.sigma_m?), Unit::Meter);
        Some(format!("{} {sigma}", n.body))
    });
    let known: Vec<String> = known.collect();
    let stated = of.noise.iter().find_map(|n| n.stated_m);
    let stated = stated.map_or(String::new(), |stated| {
        let stated = number::sigma(Some(stated), Unit::Meter);
        format!("; stated: {stated}")
    });
    (!known.is_empty()).then(|| {
        format!(
            "Noise floor: {} (σ of a marker coordinate about the rigid body{stated}).",
            known.join(", ")
        )
    })
}

/// Bodies without a noise floor, and why.
pub(crate) fn without_noise(of: &DataChecks) -> Option<String> {
    let open = of.noise.iter().filter(|n| n.sigma_m.is_none());
    let open: Vec<&str> = open.map(|n| n.body.as_str()).collect();
    (!open.is_empty()).then(|| {
        format!(
            "noise floor of {} (recorded as poses, or fewer than three markers)",
            open.join(", ")
        )
    })
}
