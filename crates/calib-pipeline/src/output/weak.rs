//! Which combinations of parameters the data leave open, in millimeters over the joint ranges: the priors hold them, and no
//! held-out pose of the same kind can tell.
//!
//! The postures are spread evenly over the box of the recorded joint ranges, joints combined freely: single-joint sweeps
//! record few of them. The point is the tool that was measured: a body, a marker, or a touching point.

use calib_core::{LinearPoint, Placement, SpreadDirection, Target};
use calib_finding::{About, Fact, Finding, catalog};
use calib_profile::Usage;
use calib_report::{HeldOut, OpenDirection, RobotSize, WeakDirections, WeakTerm};
use calib_urdf::{JointId, LinkId};
use nalgebra::{Point3, Vector3};

use crate::formulate::formulation::MlFit;
use crate::formulate::priors::judged;
use crate::output::of_fit::unit;
use crate::prepare::inputs::Inputs;
use crate::verify::accuracy::configuration;

/// Postures over the joint ranges: the rms over them is known to about 5 %.
const POSTURES: usize = 96;

/// Recorded postures that they are compared with, at most.
const RECORDED: usize = 60;

/// Directions that the report lists.
const LISTED: usize = 4;

/// What the data leave open at the tool; `None` where nothing was measured at its end.
#[must_use]
pub fn weak_directions(inputs: &Inputs, fit: &MlFit) -> Option<WeakDirections> {
    let (name, target) = tool(inputs, fit)?;
    let solution = judged(fit);
    // Without a body in the tracker's sight, where the robot stands is a convention of what was touched.
    let placement = if inputs.robot.profile.bodies.is_empty() {
        Placement::Free
    } else {
        Placement::Counts
    };
    let fitted = fitted_rows(inputs);
    let box_of = postures(inputs, &fitted);
    let at = |rows: &[Vec<f64>]| -> Option<Vec<LinearPoint>> {
        let see = |q: &Vec<f64>| {
            let at = configuration(inputs, fit, q);
            let seen = solution.linear_point(fit.formulation.tracker, target, &at);
            seen.ok()
        };
        rows.iter().map(see).collect()
    };
    let points = at(&box_of)?;
    let spread = solution.spread(&points, placement)?;
    let step = fitted.len().div_ceil(RECORDED).max(1);
    let recorded: Vec<Vec<f64>> = fitted.iter().step_by(step).map(|q| q.to_vec()).collect();
    let recorded = at(&recorded).and_then(|points| solution.spread_rms(&points, placement));
    let base = fit.calibration.tracker_from_root.translation.vector;
    let reach = points
        .iter()
        .map(|p| (p.position.coords - base).norm())
        .fold(0.0, f64::max);
    let parameters = &fit.solution.parameters;
    let direction = |d: &SpreadDirection| OpenDirection {
        rms_m: d.rms,
        max_m: d.max,
        prior_share: d.prior_share,
        terms: d
            .terms
            .iter()
            .map(|(id, change)| WeakTerm {
                parameter: parameters[id.index()].name.clone(),
                change: *change,
                unit: unit(parameters[id.index()].unit),
            })
            .collect(),
    };
    let size = spread.size.map(|size| RobotSize {
        sigma: size.sigma,
        reach_m: reach,
        prior_share: size.prior_share,
        change: size_change(inputs, &name, &box_of, &points),
    });
    Some(WeakDirections {
        point: name,
        placed: placement == Placement::Counts,
        postures: points.len(),
        rms_sigma_m: spread.rms,
        max_sigma_m: spread.sigma.iter().copied().fold(0.0, f64::max),
        recorded_rms_sigma_m: recorded,
        prior_share: spread.prior_share,
        unbounded: spread.unbounded,
        size,
        directions: spread
            .directions
            .iter()
            .take(LISTED)
            .map(direction)
            .collect(),
    })
}

/// What the data leave open that a verdict on them must not pass over: the size of the robot, or more than the limit of the profile.
#[must_use]
pub(crate) fn findings(
    inputs: &Inputs,
    weak: Option<&WeakDirections>,
    held_out: Option<&HeldOut>,
) -> Vec<Finding> {
    let Some(weak) = weak else {
        return Vec::new();
    };
    let form = if weak.placed { "tracked" } else { "contacts" };
    let measured = held_out.and_then(|h| h.calibrated).map(|c| c.rms_m);
    // What is smaller than the errors that were measured cannot be a surprise.
    let matters = |size: &RobotSize| measured.is_none_or(|rms| size.at_reach_m() > rms);
    if let Some(size) = weak.size.filter(|s| s.is_unseen() && matters(s)) {
        return vec![
            Finding::of_kind(catalog::SIZE_NOT_SEEN, form, About::Fit)
                .with("sigma", Fact::ratio(size.sigma))
                .with("at_reach", Fact::meters(size.at_reach_m()))
                .with("reach", Fact::meters(size.reach_m))
                .with("prior_share", Fact::ratio(size.prior_share))
                .with_some("change", size.change.map(Fact::ratio)),
        ];
    }
    if weak.unbounded {
        let form = if weak.placed {
            "open_tracked"
        } else {
            "open_contacts"
        };
        return vec![Finding::of_kind(catalog::HELD_BY_PRIORS, form, About::Fit)];
    }
    let limit = inputs.robot.profile.solve.limits.held_out_rms;
    let beyond = limit.filter(|limit| weak.held_by_prior_m() > *limit);
    let finding = |limit: f64| {
        Finding::of_kind(catalog::HELD_BY_PRIORS, form, About::Fit)
            .with("held", Fact::meters(weak.held_by_prior_m()))
            .with("limit", Fact::meters(limit))
    };
    beyond.map(finding).into_iter().collect()
}

/// How much larger the touching point's places lie around their center than on the nominal robot; `None` for a body, whose
/// mount has no nominal value.
fn size_change(
    inputs: &Inputs,
    name: &str,
    postures: &[Vec<f64>],
    found: &[LinearPoint],
) -> Option<f64> {
    let tip = inputs.robot.profile.points.get(name)?;
    let model = &inputs.robot.model;
    let nominal = postures
        .iter()
        .map(|q| model.root_from_link(q, tip.link) * tip.at);
    let nominal = spread_of(&nominal.collect::<Vec<_>>());
    let found = spread_of(&found.iter().map(|p| p.position).collect::<Vec<_>>());
    (nominal > 0.0).then(|| (found / nominal).sqrt() - 1.0)
}

/// Σ|p − p̄|², m²
fn spread_of(points: &[Point3<f64>]) -> f64 {
    let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
    let center = sum / points.len().max(1) as f64;
    let off = points.iter().map(|p| (p.coords - center).norm_squared());
    off.sum()
}

/// The measured point that most moving joints carry: a body's frame, a marker, or a touching point.
pub(crate) fn tool(inputs: &Inputs, fit: &MlFit) -> Option<(String, Target)> {
    let model = &inputs.robot.model;
    let profile = &inputs.robot.profile;
    let formulation = &fit.formulation;
    let carried = |link: LinkId| {
        let chain = model.chain(model.root(), link);
        chain
            .iter()
            .filter(|step| model.joint(step.joint).kind.axis().is_some())
            .count()
    };
    let mut candidates = Vec::new();
    for (name, body) in &profile.bodies {
        let frame = formulation.bodies.get(name).copied().map(Target::Frame);
        let points = formulation.points.get(name);
        let point = points.and_then(|p| p.values().next().copied().map(Target::Point));
        candidates.extend(frame.or(point).map(|t| (carried(body.link), name, t)));
    }
    for (name, tip) in &profile.points {
        let point = formulation.contact_points.get(name).copied();
        candidates.extend(point.map(|p| (carried(tip.link), name, Target::Point(p))));
    }
    // The first of those that are carried farthest.
    let best = candidates
        .into_iter()
        .reduce(|best, next| if next.0 > best.0 { next } else { best })?;
    Some((best.1.clone(), best.2))
}

/// Joint positions of all rows that were fitted.
fn fitted_rows(inputs: &Inputs) -> Vec<&Vec<f64>> {
    let fitted = inputs.recordings.values();
    let fitted = fitted.filter(|r| r.spec.usage != Usage::Validation);
    fitted.flat_map(|r| r.q.iter().flatten()).collect()
}

/// Postures spread evenly over the box of the recorded ranges.
pub(crate) fn postures(inputs: &Inputs, rows: &[&Vec<f64>]) -> Vec<Vec<f64>> {
    let Some(first) = rows.first() else {
        return Vec::new();
    };
    let range = |joint: JointId| {
        let values = rows.iter().map(|q| q[joint.index()]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        })
    };
    let moved: Vec<(usize, (f64, f64))> = inputs
        .robot
        .model
        .independent_joints()
        .map(|joint| (joint.index(), range(joint)))
        .filter(|(_, (low, high))| high > low)
        .collect();
    let steps = even_steps(moved.len());
    (0..POSTURES)
        .map(|i| {
            let mut q = (*first).clone();
            for ((joint, (low, high)), step) in moved.iter().zip(&steps) {
                let part = (0.5 + (i + 1) as f64 * step).fract();
                q[*joint] = low + part * (high - low);
            }
            q
        })
        .collect()
}

/// Steps of an additive recurrence that fills a box of `d` dimensions evenly: powers of 1/φ, φ^(d+1) = φ + 1
/// (Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
fn even_steps(d: usize) -> Vec<f64> {
    let power = d as f64 + 1.0;
    let mut phi: f64 = 2.0;
    // x ← (1 + x)^(1/(d+1)) contracts: 64 steps are below rounding.
    for _ in 0..64 {
        phi = (1.0 + phi).powf(1.0 / power);
    }
    (1..=d).map(|k| phi.powi(-(k as i32))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_recurrence_fills_the_box() {
        // Each half of each axis, and each quadrant of each pair, has its share of the postures, within an eighth of all.
        for d in [1, 2, 6, 9] {
            let steps = even_steps(d);
            assert_eq!(steps.len(), d);
            let at = |i: usize, k: usize| (0.5 + (i + 1) as f64 * steps[k]).fract();
            for j in 0..d {
                for k in 0..=j {
                    let inside = (0..POSTURES).filter(|&i| at(i, j) < 0.5 && at(i, k) < 0.5);
                    let expected = POSTURES as f64 * if j == k { 0.5 } else { 0.25 };
                    let found = inside.count() as f64;
                    assert!(
                        (found - expected).abs() <= 0.125 * POSTURES as f64,
                        "{d} {j} {k} {found}"
                    );
                }
            }
        }
    }
}
