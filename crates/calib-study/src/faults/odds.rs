//! What the recordings of a case show of a discrete fault.
//!
//! A fault moves the registration of the nominal robot's own noise-free data by its residual (1). What nobody can name is found by the
//! likelihood of the noisy data, noise and priors known (only the robot's own errors, tracker and body are not): a name is
//! *undecidable* where some other hypothesis, or none, is not a million times less likely than those that are the true one,
//!
//! ```text
//! max over h ~ true of L_h − max over h ≁ true of (L_h, L_none) < ln 10⁶                              (2)
//! ```
//!
//! where h ~ true makes the noise-free data exact. Hundreds of hypotheses are tried: with less than a million, one clean recording in a thousand
//! would be given a name. One counterexample suffices, so that the true ones and the twenty hypotheses with the smallest residuals are asked.

use std::collections::BTreeMap;

use calib_checks::structural::{
    Body, Chain, Data, JointIndex, KnownNoise, LinkIndex, Measured, Options, RecordingIndex,
    Scoped, apply, log_odds, registration_residual,
};
use calib_recording::Poses;
use calib_urdf::RobotModel;

use super::case::{Case, LAST, SIGMA, SIGMA_JOINT, SIGMA_ORIENTATION};

/// A correction of noise-free data of the nominal robot that leaves less (m) is the true one.
const EXACT: f64 = 2e-5;
/// Hypotheses that are asked.
const LEADERS: usize = 20;

/// Equation (1); with the held-out recording, where a fault may be in it alone.
pub(super) fn moved(case: &Case, held_out: bool) -> Option<f64> {
    registration_residual(&data(case, &case.twin(), held_out)?).ok()
}

/// The left side of equation (2), with all recordings; `None` where no hypothesis is the true one.
pub(super) fn odds(case: &Case, tables: &BTreeMap<String, Poses>) -> Option<f64> {
    let ideal = data(case, &case.twin(), true)?;
    let prior = case.prior();
    let mut options = Options::default();
    options.prior_angle = prior.tilt_deg.to_radians();
    options.prior_length = prior.origin_mm * 1e-3;
    let noise = KnownNoise {
        sigma: SIGMA,
        joint: SIGMA_JOINT,
    };
    let exact = |s: &Scoped| registration_residual(&apply(s, &ideal)).is_ok_and(|rms| rms < EXACT);
    let noisy = data(case, tables, true)?;
    let all = log_odds(&noisy, noise, LEADERS, &exact, &options).ok()?;
    let (mut of_true, mut of_others) = (None, 0.0_f64);
    for (scoped, odds) in &all {
        if exact(scoped) {
            of_true = Some(of_true.map_or(*odds, |o: f64| o.max(*odds)));
        } else {
            of_others = of_others.max(*odds);
        }
    }
    Some(of_true? - of_others)
}

/// Tables as the structural hypotheses are given them.
fn data(case: &Case, tables: &BTreeMap<String, Poses>, held_out: bool) -> Option<Data> {
    let model = RobotModel::from_urdf_text(&case.robot.urdf(), "arm.urdf").ok()?;
    let n = case.robot.joints.len();
    let link = n - usize::from(case.wrong_link());
    let link = LinkIndex::from(model.link_id(&format!("l{link}")).ok()?);
    let mut data = Data {
        chain: Chain::from_model(&model).ok()?,
        readings: Vec::new(),
        recording: Vec::new(),
        rates: Vec::new(),
        bodies: Vec::new(),
    };
    let (mut markers, mut poses) = (Vec::new(), Vec::new());
    let recordings = case.readings.iter().map(|(name, _)| *name);
    let counted = recordings.filter(|name| held_out || *name != LAST);
    for (r, name) in counted.enumerate() {
        let table = &tables[name];
        for row in 0..table.rows.len() {
            let mut q = vec![None; model.joints().len()];
            for (joint, column) in &table.joints {
                q[JointIndex::from(model.joint_id(joint).ok()?).0] = column[row];
            }
            data.readings.push(q);
            data.recording.push(RecordingIndex(r));
            markers.push(table.markers.values().map(|column| column[row]).collect());
            poses.push(table.bodies.values().next().and_then(|column| column[row]));
        }
    }
    let measured = if case.markers.is_empty() {
        Measured::Poses {
            tracker_from_body: poses,
            sigma_position: SIGMA,
            sigma_orientation: SIGMA_ORIENTATION,
        }
    } else {
        Measured::Markers(markers)
    };
    data.bodies.push(Body {
        link,
        measured,
        mounts: Vec::new(),
    });
    Some(data)
}
