//! Everything that can be wrong with a problem before paths are known: lengths, finite numbers, positive
//! noise, unique names, frames of points.

use std::collections::BTreeSet;

use nalgebra::Isometry3;

use crate::graph::edge::{Edge, EdgeKind, Joint};
use crate::graph::error::Error;
use crate::graph::ids::PointId;
use crate::graph::measurement::{Input, Measurement};
use crate::graph::parameter::Parameter;
use crate::graph::problem::Problem;
use crate::model::values::covariance_directions;

/// Everything that can be wrong before paths are known.
pub(crate) fn check(problem: &Problem) -> Result<(), Error> {
    if let Some(fault) = problem.faults.first() {
        return Err(fault.clone());
    }
    let mut frames = BTreeSet::new();
    if let Some(name) = problem.frames.iter().find(|name| !frames.insert(*name)) {
        let name = name.clone();
        return Err(Error::DuplicateFrame { name });
    }
    for edge in &problem.edges {
        check_edge(edge, problem.samples)?;
    }
    let mut names = BTreeSet::new();
    for p in &problem.parameters {
        if !names.insert(p.name.as_str()) {
            return Err(Error::DuplicateName {
                name: p.name.clone(),
            });
        }
        check_parameter(p)?;
    }
    for g in &problem.groups {
        positive(&g.name, g.sigma)?;
    }
    if let Some(t) = &problem.times {
        series("times", t, problem.samples)?;
    }
    problem
        .measurements
        .iter()
        .try_for_each(|m| check_measurement(problem, m))
}

fn check_edge(edge: &Edge, samples: usize) -> Result<(), Error> {
    let name = edge.name.as_str();
    match &edge.kind {
        EdgeKind::Known(x) => pose(name, 0, x),
        EdgeKind::Unknown(u) => pose(name, 0, &u.nominal),
        EdgeKind::Measured { poses, covariance } => {
            length(name, poses.len(), samples)?;
            for (s, x) in poses.iter().enumerate() {
                if let Some(x) = x {
                    pose(name, s, x)?;
                }
            }
            match covariance {
                Some(c) if covariance_directions(c).is_none() => Err(Error::NotPositive {
                    what: format!("{name} covariance"),
                    value: c.determinant(),
                }),
                _ => Ok(()),
            }
        }
        EdgeKind::Joint(joint) => check_joint(name, joint, samples),
        EdgeKind::Random { directions, .. } => directions
            .iter()
            .try_for_each(|d| finite(name, d.as_slice())),
    }
}

fn check_joint(name: &str, joint: &Joint, samples: usize) -> Result<(), Error> {
    series(name, &joint.q, samples)?;
    for f in &joint.effects {
        if let Some(v) = &f.values {
            series(&format!("{name}.{}", f.kind.label()), v, samples)?;
        }
        for share in &f.shares {
            let label = f.kind.label();
            series(
                &format!("{name}.{label} by a share"),
                &share.values,
                samples,
            )?;
        }
    }
    joint
        .candidates
        .iter()
        .try_for_each(|c| series(&c.name, &c.values, samples))
}

fn check_parameter(p: &Parameter) -> Result<(), Error> {
    finite(&p.name, &[p.nominal, p.start])?;
    if let Some(sigma) = p.prior_sigma {
        positive(&format!("{} prior", p.name), sigma)?;
    }
    match p.bounds {
        Some(_) if !cfg!(feature = "clarabel") => Err(Error::BoundsNotBuilt {
            name: p.name.clone(),
        }),
        Some((lower, upper)) if !(lower <= p.start && p.start <= upper) => {
            Err(Error::OutOfBounds {
                name: p.name.clone(),
                start: p.start,
                lower,
                upper,
            })
        }
        _ => Ok(()),
    }
}

fn check_measurement(problem: &Problem, measurement: &Measurement) -> Result<(), Error> {
    let kind = measurement.kind.of();
    for sample in kind.samples() {
        if sample >= problem.samples {
            return Err(Error::NoSuchSample {
                what: measurement.name.clone(),
                sample,
                samples: problem.samples,
            });
        }
    }
    let at_frame = |point: PointId| {
        let p = &problem.points[point.index()];
        if p.frame == measurement.to {
            Ok(())
        } else {
            Err(Error::PointFrame {
                measurement: measurement.name.clone(),
                point: p.name.clone(),
                found: problem.frame_name(p.frame).to_owned(),
                expected: problem.frame_name(measurement.to).to_owned(),
            })
        }
    };
    kind.check(&Input {
        name: &measurement.name,
        at_frame: &at_frame,
    })
}

/// One finite number per sample.
fn series(what: &str, values: &[f64], samples: usize) -> Result<(), Error> {
    length(what, values.len(), samples)?;
    finite(what, values)
}

fn length(what: &str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected {
        Ok(())
    } else {
        Err(Error::Length {
            what: what.to_owned(),
            found,
            expected,
        })
    }
}

fn finite(what: &str, values: &[f64]) -> Result<(), Error> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(sample) => Err(Error::NotFinite {
            what: what.to_owned(),
            sample,
        }),
        None => Ok(()),
    }
}

fn pose(what: &str, sample: usize, x: &Isometry3<f64>) -> Result<(), Error> {
    Input {
        name: what,
        at_frame: &|_| Ok(()),
    }
    .pose(sample, x)
}

fn positive(what: &str, value: f64) -> Result<(), Error> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(Error::NotPositive {
            what: what.to_owned(),
            value,
        })
    }
}
