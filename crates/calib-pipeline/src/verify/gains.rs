//! The gain of a joint that held-out poses show and fitted ones hide.
//!
//! Where one joint moves at a time, or few joints carry a body, the geometry takes up the gain of a joint nearly whole: the fit is as good as
//! that of a robot in order, and its σ does not know that the links are off. Poses in which the joints move together contradict it. The test
//! takes fitted and held-out samples together:
//!
//! ```text
//! z² = ĉ² / v,   ĉ and v of a gain as of `calib_core::Solution::open_errors`, divided by the χ² per degree of freedom of the held-out errors
//! ```
//!
//! A gain is named where it is clear by all samples, and where the fit of corrected readings predicts the held-out ones better, beyond chance.

use calib_core::{
    EdgeKind, EffectKind, FrameId, MovedPoint, Moves, OpenCause, Target, UntestedEffect,
};
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::Usage;
use calib_report::HeldOut;
use calib_urdf::{JointId, JointKind};

use crate::formulate::checked::Checked;
use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::Calibration;
use crate::formulate::parts::open_joints;
use crate::prepare::effects::free_with_gain;
use crate::prepare::inputs::Inputs;
use crate::verify::Verified;
use crate::verify::accuracy::configuration;
use crate::verify::agreement::{agreement, screened};
use crate::verify::applied::again;
use crate::verify::deviations::deviations;

/// z² from which a gain is clear: 4.5 σ. Of the nine joints of a hand in order the largest z² was below 10 in 120 sessions.
const CLEAR: f64 = 20.0;
/// Fall of z² from the best within which the gain of another joint explains the data as well (log-likelihood difference 3).
const AS_GOOD: f64 = 6.0;
/// By how much χ² of the held-out errors falls at least once the readings are corrected: 3 σ by these alone.
const FALLS: f64 = 9.0;
/// How large gains are that are asked: no prior.
const ANY: f64 = 1.0;
/// Samples that the design is taken from, at most.
const DESIGN: usize = 300;

/// A gain with its size by all samples.
struct Shown {
    joint: JointId,
    excess: f64,
    sigma: f64,
    /// Test above.
    z2: f64,
}

/// The gain that the held-out errors are the trace of, where nothing else was found to be.
pub(super) fn of_held_out(
    inputs: &Inputs,
    checked: &Checked,
    fit: &MlFit,
    verified: &Verified,
) -> Option<Finding> {
    let held_out = verified.held_out.as_ref().filter(|h| !h.left_out)?;
    let goodness = verified.causes.goodness.as_ref()?;
    let explained = !goodness.missing.is_empty()
        || verified.causes.change.is_some()
        || !verified.findings.is_empty()
        || checked.findings.iter().any(|f| f.id == catalog::JOINT_GAIN);
    if explained {
        return None;
    }
    let (before, rows) = agreement(inputs, fit, Some(held_out))?;
    let mut shown = shown(inputs, fit, held_out, before.value.max(1.0))?;
    shown.sort_by(|a, b| b.z2.total_cmp(&a.z2));
    let (best, others) = shown.split_first()?;
    if best.z2 < CLEAR {
        return None;
    }
    let (corrected, with) = again(corrected(inputs, best), checked)?;
    let (after, _) = agreement(&corrected, &with, Some(held_out))?;
    let errors = |inputs: &Inputs, robot: &Calibration| squares(inputs, checked, robot, held_out);
    let none = errors(inputs, &fit.calibration)?;
    let left = errors(&corrected, &with.calibration)?;
    let falls = rows as f64 * (before.value - after.value);
    if falls < FALLS || left >= none || after.value > after.high {
        return None;
    }
    let name = |joint: JointId| &inputs.robot.model.joint(joint).name;
    let as_good = others.iter().take_while(|o| best.z2 - o.z2 < AS_GOOD);
    let as_good: Vec<String> = as_good.map(|o| format!("{}.gain", name(o.joint))).collect();
    let finding = Finding::of_kind(
        catalog::JOINT_GAIN,
        "held_out",
        Subject::joint(name(best.joint)),
    );
    Some(
        finding
            .with("joint", Fact::name(name(best.joint)))
            .with("excess", Fact::ratio(best.excess))
            .with_some("free", free_with_gain(inputs, name(best.joint)))
            .with("sigma", Fact::ratio(best.sigma))
            .with("none", Fact::meters(none.sqrt()))
            .with("best", Fact::meters(left.sqrt()))
            .with_some(
                "alternatives",
                (!as_good.is_empty()).then(|| Fact::names(as_good)),
            ),
    )
}

/// The gains of the joints that the profile does not hold, by all samples; `above`: χ² per degree of freedom of the held-out ones, or 1.
fn shown(inputs: &Inputs, fit: &MlFit, held_out: &HeldOut, above: f64) -> Option<Vec<Shown>> {
    let model = &inputs.robot.model;
    let without = screened(inputs, fit, Some(held_out));
    let of = &fit.formulation.samples;
    let samples: Vec<usize> = (0..of.len()).filter(|s| !without.contains(s)).collect();
    let row = |s: &usize| inputs.recordings[&of[*s].0].q[of[*s].1].as_ref();
    let rows: Vec<&Vec<f64>> = samples.iter().map(row).collect::<Option<_>>()?;
    let edges = fit.formulation.problem.edges();
    let gain = |joint: JointId| {
        let edge = fit.formulation.joints[joint.index()]?;
        let modeled = match &edges[edge.index()].kind {
            EdgeKind::Joint(j) => j.effects.iter().any(|e| e.kind == EffectKind::Gain),
            _ => true,
        };
        let effect = UntestedEffect {
            moves: Moves::Joint(edge),
            sigma: ANY,
            at_samples: rows.iter().map(|q| model.position(q, joint)).collect(),
            at_postures: vec![0.0],
        };
        (!modeled).then(|| (joint, OpenCause::Effects(vec![effect])))
    };
    let joints = open_joints(inputs, &fit.formulation).into_iter();
    // With a joint that others follow, these move as well: the size by its own motion would be another one.
    let leads = |joint: &JointId| {
        let mut mimics = model.joints().iter().filter_map(|j| j.mimic.as_ref());
        mimics.any(|mimic| mimic.joint == *joint)
    };
    let joints = joints.filter(|j| model.joint(*j).kind != JointKind::Fixed && !leads(j));
    let (joints, causes): (Vec<JointId>, Vec<OpenCause<'_>>) = joints.filter_map(gain).unzip();
    let point = vec![any_point(inputs, fit, rows.first()?)?];
    let found = fit
        .solution
        .open_errors(&samples, DESIGN, &causes, &point)?;
    let of_joint = |(joint, sizes): (JointId, Vec<(f64, f64)>)| {
        let (excess, sigma) = *sizes.first()?;
        // A joint that moves nothing has the size of the prior.
        let z2 = (excess / sigma).powi(2) / above;
        (z2.is_finite() && sigma < 0.5 * ANY).then_some(Shown {
            joint,
            excess,
            sigma: sigma * above.sqrt(),
            z2,
        })
    };
    let all = joints.into_iter().zip(found.sizes);
    Some(all.filter_map(of_joint).collect())
}

/// The inputs as they would be if the joint moved as its readings say.
fn corrected(inputs: &Inputs, gain: &Shown) -> Inputs {
    let mut inputs = inputs.clone();
    for loaded in inputs.recordings.values_mut() {
        for q in loaded.q.iter_mut().flatten() {
            q[gain.joint.index()] *= 1.0 + gain.excess;
        }
    }
    inputs
}

/// Sizes do not depend on what is predicted: any body will do.
fn any_point(inputs: &Inputs, fit: &MlFit, q: &[f64]) -> Option<MovedPoint> {
    let formulation = &fit.formulation;
    let frame = |frame: &FrameId| Target::Frame(*frame);
    let frames = formulation.bodies.values().map(frame);
    let points = formulation
        .points
        .values()
        .flat_map(|points| points.values());
    let target = frames.chain(points.copied().map(Target::Point)).next()?;
    let at = configuration(inputs, fit, q);
    let seen = fit.solution.moved_point(formulation.tracker, target, &at);
    seen.ok()
}

/// Mean square of the held-out errors of a robot, those left out that were screened, m².
fn squares(
    inputs: &Inputs,
    checked: &Checked,
    robot: &Calibration,
    held_out: &HeldOut,
) -> Option<f64> {
    let validation = |usage| usage == Usage::Validation;
    let errors = deviations(inputs, &checked.tracks, robot, validation);
    let kept = errors
        .iter()
        .zip(&held_out.poses)
        .filter(|(_, p)| !p.screened);
    let squares: Vec<f64> = kept.map(|(d, _)| d.vector.norm_squared()).collect();
    let same = errors.len() == held_out.poses.len() && !squares.is_empty();
    same.then(|| squares.iter().sum::<f64>() / squares.len() as f64)
}
