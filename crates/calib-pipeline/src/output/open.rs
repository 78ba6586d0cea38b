//! How far predictions over the joint ranges can be off, given fitted and held-out data: by the parameters alone, and with
//! one effect that the model does not have and that the data do not exclude.
//!
//! What the effects are, and how large in robots that are said to be in order:
//!
//! | effect | size | why |
//! |---|---|---|
//! | gain of a joint | 0.5 % | a wrong tooth in a belt of two hundred; encoders themselves are better |
//! | share of another joint's motion | 1 % | the prior of couplings in a profile |
//! | the same of a turning joint in a sliding one's | 0.02 rad per m | a rail that is twisted by 1° over a meter |
//! | the same of a sliding joint in a turning one's | 0.3 mm per rad | a spline beside the screw of a quill that is off by 2 mm per turn |
//! | eccentricity | 0.2° | an encoder disk off its axis by 0.1 mm at 30 mm |
//! | yield under gravity | 0.2° at the largest load | strain-wave gears under their rated torque |
//! | zero of a joint, a step | 0.2° | a tooth of a belt, a slipped coupling |
//! | drift of the tracker | 1 mm along each axis | a stand that warms or settles in an hour |
//! | step of the tracker or of a body | 1 mm along each axis | a touch that nobody noticed |
//! | a change that was found and not split | as found | it is in the data |

use calib_core::{
    Change, EffectKind, FrameId, JointState, Moved, MovedPoint, Moves, OpenCause, OpenError,
    Target, UntestedEffect,
};
use calib_profile::Usage;
use calib_report::{HeldOut, Predicted, Prediction, Untested, UntestedKind};
use calib_urdf::{JointId, RobotModel};

use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::joint_state;
use crate::output::weak::{postures, tool};
use crate::prepare::conditions::Conditions;
use crate::prepare::inputs::Inputs;
use crate::prepare::loads::Loads;
use crate::verify::accuracy::configuration;
use crate::verify::agreement::screened;
use crate::verify::changes::name_of;

/// Samples that the design is taken from, at most: more change nothing but the time.
const DESIGN: usize = 300;

const GAIN: f64 = 0.005;
const CROSSTALK: f64 = 0.01;
/// A turning joint that follows a sliding one, rad/m.
const TURNED: f64 = 0.02;
/// A sliding joint that follows a turning one, m/rad.
const SHIFTED: f64 = 3e-4;
const DEGREE: f64 = std::f64::consts::PI / 180.0;
const ECCENTRICITY: f64 = 0.2 * DEGREE;
/// At the largest load.
const YIELD: f64 = 0.2 * DEGREE;
const STEP: f64 = 0.2 * DEGREE;
const MOVED: f64 = 1e-3;

/// Over the joint ranges of all recordings, with what `changed` while they were made; `None` where no body was in the tracker's
/// sight.
pub(crate) fn prediction(
    inputs: &Inputs,
    fit: &MlFit,
    held_out: Option<&HeldOut>,
    changed: Option<&Change>,
) -> Option<Prediction> {
    // Where a robot stands that only touched something is a convention.
    if inputs.robot.profile.bodies.is_empty() {
        return None;
    }
    let (name, target) = tool(inputs, fit)?;
    let recordings = inputs.recordings.values();
    let rows: Vec<&Vec<f64>> = recordings.flat_map(|r| r.q.iter().flatten()).collect();
    let box_of = postures(inputs, &rows);
    let see = |q: &Vec<f64>| {
        let at = configuration(inputs, fit, q);
        let tracker = fit.formulation.tracker;
        fit.solution.moved_point(tracker, target, &at).ok()
    };
    let points: Vec<MovedPoint> = box_of.iter().map(see).collect::<Option<_>>()?;
    // All of them: at the minimum the residuals of all have no part along the parameters, those of a share have.
    let looked_at = kept(inputs, fit, held_out);
    let at = Places::new(inputs, fit, &looked_at, &box_of)?;
    let effects = at
        .of_joints()
        .into_iter()
        .chain(at.of_places(&name, target));
    let effects = effects.map(|(what, effects)| (what, OpenCause::Effects(effects)));
    let found = changed.and_then(|change| of_change(inputs, fit, target, change));
    let (names, causes): (Vec<Untested>, Vec<OpenCause<'_>>) = effects.chain(found).unzip();
    let found = fit
        .solution
        .open_errors(&looked_at, DESIGN, &causes, &points)?;
    let worst = names
        .into_iter()
        .zip(&found.with)
        .max_by(|a, b| a.1.upper.total_cmp(&b.1.upper));
    Some(Prediction {
        stated: found.stated,
        joints: found.joints,
        alone: predicted(&found.alone),
        with: worst.map(|(name, with)| (name, predicted(with))),
    })
}

/// A change that the scan found, where a prediction can be wrong by it.
fn of_change<'a>(
    inputs: &Inputs,
    fit: &MlFit,
    target: Target,
    change: &'a Change,
) -> Option<(Untested, OpenCause<'a>)> {
    let kind = match change.moved {
        Moved::Body(_) => UntestedKind::Slip,
        Moved::Reference(_) => UntestedKind::Bump,
        Moved::Joint(_) | Moved::Zeros => UntestedKind::Step,
        Moved::Drift(_) | Moved::Settling(_) => UntestedKind::Drift,
        // What is predicted is seen by the same tracker.
        _ => return None,
    };
    let name = name_of(inputs, fit, change)?;
    let carries = matches!(change.moved, Moved::Body(body) if frame_of(fit, target) == Some(body));
    Some((untested(kind, &name), OpenCause::Found { change, carries }))
}

/// The frame that a target lies in.
fn frame_of(fit: &MlFit, target: Target) -> Option<FrameId> {
    match target {
        Target::Frame(frame) => Some(frame),
        Target::Point(point) => Some(fit.formulation.problem.points()[point.index()].frame),
        _ => None,
    }
}

fn predicted(error: &OpenError) -> Predicted {
    Predicted {
        rms: error.rms,
        upper: error.upper,
    }
}

/// All samples but those: fitted ones first, each in the order of the recording.
fn kept(inputs: &Inputs, fit: &MlFit, held_out: Option<&HeldOut>) -> Vec<usize> {
    let screened = screened(inputs, fit, held_out);
    let samples = &fit.formulation.samples;
    let validation = |s: &usize| inputs.recordings[&samples[*s].0].spec.usage == Usage::Validation;
    let (after, before): (Vec<usize>, Vec<usize>) = (0..samples.len())
        .filter(|s| !screened.contains(s))
        .partition(validation);
    before.into_iter().chain(after).collect()
}

/// Rows with the torques that they load the joints with.
type Rows<'a> = Vec<(&'a Vec<f64>, Loads)>;

/// Where regressors are needed.
struct Places<'a> {
    inputs: &'a Inputs,
    fit: &'a MlFit,
    samples: Rows<'a>,
    postures: Rows<'a>,
    /// 0 at the first sample, 1 at the last.
    share: Vec<f64>,
    looked_at: Vec<usize>,
    /// Which of them were fitted.
    fitted: Vec<bool>,
}

impl<'a> Places<'a> {
    fn new(
        inputs: &'a Inputs,
        fit: &'a MlFit,
        looked_at: &[usize],
        postures: &'a [Vec<f64>],
    ) -> Option<Self> {
        let with_loads = |q: &'a Vec<f64>| (q, inputs.robot.masses.at(q));
        let all = &fit.formulation.samples;
        let row = |s: &usize| inputs.recordings[&all[*s].0].q[all[*s].1].as_ref();
        let rows: Vec<&Vec<f64>> = looked_at.iter().map(row).collect::<Option<_>>()?;
        let fitted = |s: &usize| inputs.recordings[&all[*s].0].spec.usage != Usage::Validation;
        let last = looked_at.len().max(2) - 1;
        Some(Self {
            inputs,
            fit,
            samples: rows.into_iter().map(with_loads).collect(),
            postures: postures.iter().map(with_loads).collect(),
            share: (0..looked_at.len())
                .map(|i| i as f64 / last as f64)
                .collect(),
            looked_at: looked_at.to_vec(),
            fitted: looked_at.iter().map(fitted).collect(),
        })
    }

    fn of_joints(&self) -> Vec<(Untested, Vec<UntestedEffect>)> {
        let model = &self.inputs.robot.model;
        let mut out = Vec::new();
        let used = |j: &JointId| self.fit.formulation.joints[j.index()].is_some();
        let joints: Vec<JointId> = model.independent_joints().filter(used).collect();
        for &joint in &joints {
            let Some(edge) = self.fit.formulation.joints[joint.index()] else {
                continue;
            };
            let named = model.joint(joint);
            let turns = named.kind.turns();
            let known = |kind: EffectKind| {
                let edges = self.fit.formulation.problem.edges();
                matches!(&edges[edge.index()].kind, calib_core::EdgeKind::Joint(j)
                    if j.effects.iter().any(|e| e.kind == kind))
            };
            let effect = |kind: EffectKind, sigma: f64, other: Option<JointId>| {
                let at_postures = regressors(model, (joint, other), kind, &self.postures);
                let largest = at_postures.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
                let sigma = match kind {
                    EffectKind::TorqueCompliance if largest > 0.0 => sigma / largest,
                    EffectKind::TorqueCompliance => return None,
                    _ => sigma,
                };
                (!known(kind)).then(|| UntestedEffect {
                    moves: Moves::Joint(edge),
                    sigma,
                    at_samples: regressors(model, (joint, other), kind, &self.samples),
                    at_postures,
                })
            };
            let mut add = |what: Untested, effects: Vec<Option<UntestedEffect>>| {
                let effects: Vec<UntestedEffect> = effects.into_iter().flatten().collect();
                if !effects.is_empty() {
                    out.push((what, effects));
                }
            };
            let of = |kind| untested(kind, &named.name);
            let gain = effect(EffectKind::Gain, GAIN, None);
            add(of(UntestedKind::Gain), vec![gain]);
            if turns {
                let harmonics = [EffectKind::EccentricityCos, EffectKind::EccentricitySin];
                let harmonics = harmonics.map(|kind| effect(kind, ECCENTRICITY, None));
                add(of(UntestedKind::Eccentricity), harmonics.into());
                let yields = effect(EffectKind::TorqueCompliance, YIELD, None);
                add(of(UntestedKind::Compliance), vec![yields]);
                let step = self.since(Moves::Joint(edge), STEP, &self.late(Moves::Joint(edge)));
                add(of(UntestedKind::Step), vec![Some(step)]);
            }
            for &other in joints.iter().filter(|o| **o != joint) {
                let coupled = Untested {
                    other: Some(model.joint(other).name.clone()),
                    ..of(UntestedKind::Coupling)
                };
                let sigma = match (turns, model.joint(other).kind.turns()) {
                    (true, false) => TURNED,
                    (false, true) => SHIFTED,
                    _ => CROSSTALK,
                };
                let share = effect(EffectKind::Coupling, sigma, Some(other));
                add(coupled, vec![share]);
            }
        }
        out
    }

    fn of_places(&self, name: &str, target: Target) -> Vec<(Untested, Vec<UntestedEffect>)> {
        let Some(body) = frame_of(self.fit, target) else {
            return Vec::new();
        };
        let tracker = self.fit.formulation.tracker;
        let frame = &self.inputs.robot.profile.tracker.frame;
        let along = |moves: &dyn Fn(usize) -> Moves, values: &[f64]| {
            let axes = 0..3;
            axes.map(|axis| self.since(moves(axis), MOVED, values))
                .collect()
        };
        let reference = |axis| Moves::Reference(tracker, axis);
        let mount = |axis| Moves::Body(body, axis);
        let of = untested;
        vec![
            (
                of(UntestedKind::Drift, frame),
                along(&reference, &self.share),
            ),
            (
                of(UntestedKind::Bump, frame),
                along(&reference, &self.late(reference(0))),
            ),
            (
                of(UntestedKind::Slip, name),
                along(&mount, &self.late(mount(0))),
            ),
        ]
    }

    /// 1 from the middle of the fitted samples that would show it on: what happens before or after all of them is in nothing that was
    /// found.
    fn late(&self, moves: Moves) -> Vec<f64> {
        let seen = self.fit.solution.moved_in(moves, &self.looked_at);
        let shows: Vec<usize> = (0..seen.len())
            .filter(|&i| seen[i] && self.fitted[i])
            .collect();
        let middle = shows.get(shows.len() / 2).copied().unwrap_or(0);
        let is_late = |i: usize| f64::from(u8::from(i >= middle));
        (0..seen.len()).map(is_late).collect()
    }

    /// What is as at the end of the recordings when the robot is used.
    fn since(&self, moves: Moves, sigma: f64, at_samples: &[f64]) -> UntestedEffect {
        UntestedEffect {
            moves,
            sigma,
            at_samples: at_samples.to_vec(),
            at_postures: vec![1.0; self.postures.len()],
        }
    }
}

fn untested(effect: UntestedKind, of: &str) -> Untested {
    Untested {
        effect,
        of: of.to_owned(),
        other: None,
    }
}

fn regressors(
    model: &RobotModel,
    (joint, other): (JointId, Option<JointId>),
    kind: EffectKind,
    rows: &Rows<'_>,
) -> Vec<f64> {
    let unknown = Conditions::default();
    let state = |(q, loads): &(&Vec<f64>, Loads)| JointState {
        other: other.map_or(0.0, |o| model.position(q, o)),
        ..joint_state(model, joint, q, loads, &unknown)
    };
    let states: Vec<JointState> = rows.iter().map(state).collect();
    kind.regressors(&states).unwrap_or_default()
}
