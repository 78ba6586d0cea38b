//! One offer of any kind, called with any input.

use std::collections::BTreeMap;

use crate::{
    answer::{Answer, AorFit, CorFit},
    effect::{DependsOn, EffectTerm, JointStates},
    host::{Control, LoadedPlugin, PluginError},
    kinds::{Aor, Cor, JointEffect, Reader, ReportWriter},
    motion::MotionData,
    offer::{Offer, Value},
    registry::Bound,
    streams::{ReportFile, ReportInput, Source, Streams},
};

#[derive(Debug, Clone)]
pub(super) enum Input {
    Motion(Box<MotionData>),
    Bytes(Vec<u8>),
    /// Readings of a turning joint, rad; all else follows from them.
    Readings(Vec<f64>),
    /// The same, with one load and from one side.
    Held(Vec<f64>),
    /// The same as [`Self::Readings`], in a call for each.
    OneByOne(Vec<f64>),
}

#[derive(Debug)]
pub(super) enum Reply {
    Cor(Box<Answer<CorFit>>),
    Aor(Box<Answer<AorFit>>),
    Streams(Streams),
    Files(Vec<ReportFile>),
    Regressors(Vec<f64>),
    /// Refused, with a reason.
    Refused(String),
}

/// What came instead of what was expected.
pub(super) fn text(reply: &Reply) -> String {
    let none = match reply {
        Reply::Refused(reason) => return format!("refused: {reason}"),
        Reply::Cor(answer) => match &**answer {
            Answer::NotObservable(reason) => Some(reason),
            Answer::Found(_) => None,
        },
        Reply::Aor(answer) => match &**answer {
            Answer::NotObservable(reason) => Some(reason),
            Answer::Found(_) => None,
        },
        _ => None,
    };
    none.map_or_else(
        || format!("answered {reply:?}"),
        |reason| format!("not observable: {reason}"),
    )
}

enum Callable {
    Cor(Bound<dyn Cor>),
    Aor(Bound<dyn Aor>),
    Reader(Bound<dyn Reader>),
    Report(Bound<dyn ReportWriter>),
    Effect(Bound<dyn JointEffect>),
}

pub(super) struct Subject {
    pub title: String,
    pub offer: Offer,
    callable: Callable,
}

/// Values for required parameters: their examples.
fn examples(offer: &Offer) -> BTreeMap<String, Value> {
    let required = offer.parameters.iter().filter(|p| p.required);
    required
        .map(|p| (p.name.clone(), p.value.clone()))
        .collect()
}

impl Subject {
    /// Everything that a plugin offers. Defaults and examples were checked when it was loaded.
    pub(super) fn all(plugin: &LoadedPlugin) -> Vec<Self> {
        let mut out = Vec::new();
        let mut push = |offer: &Offer, callable: Result<Callable, PluginError>| {
            if let Ok(callable) = callable {
                out.push(Self {
                    title: format!("{} {}", offer.kind.id(), offer.name),
                    offer: offer.clone(),
                    callable,
                });
            }
        };
        for entry in plugin.cors() {
            push(
                entry.offer(),
                entry.with(&examples(entry.offer())).map(Callable::Cor),
            );
        }
        for entry in plugin.aors() {
            push(
                entry.offer(),
                entry.with(&examples(entry.offer())).map(Callable::Aor),
            );
        }
        for entry in plugin.readers() {
            push(
                entry.offer(),
                entry.with(&examples(entry.offer())).map(Callable::Reader),
            );
        }
        for entry in plugin.reports() {
            push(
                entry.offer(),
                entry.with(&examples(entry.offer())).map(Callable::Report),
            );
        }
        for entry in plugin.effects() {
            push(
                entry.offer(),
                entry.with(&examples(entry.offer())).map(Callable::Effect),
            );
        }
        out
    }

    pub(super) fn call(&self, input: &Input, control: &Control<'_>) -> Result<Reply, PluginError> {
        let nothing = MotionData::points(&[]);
        let (motion, bytes, readings): (&MotionData, &[u8], &[f64]) = match input {
            Input::Motion(motion) => (motion, &[], &[]),
            Input::Bytes(bytes) => (&nothing, bytes, &[]),
            Input::Readings(readings) | Input::Held(readings) | Input::OneByOne(readings) => {
                (&nothing, &[], readings)
            }
        };
        Ok(match &self.callable {
            Callable::Cor(it) => Reply::Cor(Box::new(it.fit(&motion.view(), control)?)),
            Callable::Effect(it) => Reply::Regressors(match input {
                Input::OneByOne(_) => {
                    let one = |q: &f64| regressors(it, &[*q], false, control);
                    let all: Result<Vec<_>, _> = readings.iter().map(one).collect();
                    all?.concat()
                }
                _ => regressors(it, readings, matches!(input, Input::Held(_)), control)?,
            }),
            Callable::Aor(it) => Reply::Aor(Box::new(it.fit(&motion.view(), control)?)),
            Callable::Reader(it) => {
                // Its own business: here it must only return.
                let _ = it.entry().recognizes(bytes);
                Reply::Streams(it.read(
                    &Source {
                        name: "check",
                        bytes,
                    },
                    control,
                )?)
            }
            Callable::Report(it) => Reply::Files(it.write(
                &ReportInput {
                    report_json: bytes,
                    scene_json: None,
                },
                control,
            )?),
        })
    }
}

/// Turns of the motor per turn of the joint, and the largest load of gravity, N·m: those of an ordinary joint.
const MOTOR: (f64, f64) = (100.0, 20.0);

/// The regressors at these readings, with a motor, and with a load and a direction of approach that follow from them or are `held`.
fn regressors(
    it: &Bound<dyn JointEffect>,
    readings: &[f64],
    held: bool,
    control: &Control<'_>,
) -> Result<Vec<f64>, PluginError> {
    let EffectTerm { depends_on, .. } = it.entry().term();
    let of = |on: DependsOn, f: &dyn Fn(f64) -> f64| -> Vec<f64> {
        let wanted = readings.iter().filter(|_| depends_on == on);
        wanted.map(|q| f(*q)).collect()
    };
    let motor_rad = of(DependsOn::Motor, &|q| MOTOR.0 * q);
    let loads = of(DependsOn::Load, &|q| match held {
        true => MOTOR.1,
        false => MOTOR.1 * q.cos(),
    });
    let approaches = of(DependsOn::Approach, &|q| match q.rem_euclid(0.3) {
        _ if held => 1.0,
        x if x < 0.1 => 0.0,
        x if x < 0.2 => 1.0,
        _ => -1.0,
    });
    let states = JointStates {
        motor_rad: &motor_rad,
        loads: &loads,
        approaches: &approaches,
        ..JointStates::of_readings(readings)
    };
    it.regressors(&states, control)
}
