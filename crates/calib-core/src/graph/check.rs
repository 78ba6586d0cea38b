//! Everything that can be wrong with a problem before paths are known: lengths, finite numbers, positive
//! noise, unique names, frames of points.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Unit, Vector3};

use crate::graph::edge::EdgeKind;
use crate::graph::error::Error;
use crate::graph::measurement::{MeasurementKind, PoseNoise};
use crate::graph::problem::Problem;
use crate::model::values::covariance_directions;

/// Everything that can be wrong before paths are known.
pub(crate) fn check(problem: &Problem) -> Result<(), Error> {
    if let Some(fault) = problem.faults.first() {
        return Err(fault.clone());
    }
    let length = |what: &str, found: usize| {
        if found == problem.samples {
            Ok(())
        } else {
            Err(Error::Length {
                what: what.to_owned(),
                found,
                expected: problem.samples,
            })
        }
    };
    let finite = |what: &str, values: &[f64]| match values.iter().position(|v| !v.is_finite()) {
        Some(sample) => Err(Error::NotFinite {
            what: what.to_owned(),
            sample,
        }),
        None => Ok(()),
    };
    let pose = |what: &str, sample: usize, x: &Isometry3<f64>| {
        if x.translation.vector.iter().all(|v| v.is_finite())
            && x.rotation.coords.iter().all(|v| v.is_finite())
        {
            Ok(())
        } else {
            Err(Error::NotFinite {
                what: what.to_owned(),
                sample,
            })
        }
    };
    for edge in &problem.edges {
        match &edge.kind {
            EdgeKind::Known(x) => pose(&edge.name, 0, x)?,
            EdgeKind::Unknown(u) => pose(&edge.name, 0, &u.nominal)?,
            EdgeKind::Measured { poses, covariance } => {
                length(&edge.name, poses.len())?;
                for (s, x) in poses.iter().enumerate() {
                    if let Some(x) = x {
                        pose(&edge.name, s, x)?;
                    }
                }
                if let Some(c) = covariance
                    && covariance_directions(c).is_none()
                {
                    return Err(Error::NotPositive {
                        what: format!("{} covariance", edge.name),
                        value: c.determinant(),
                    });
                }
            }
            EdgeKind::Joint(joint) => {
                length(&edge.name, joint.q.len())?;
                finite(&edge.name, &joint.q)?;
                for f in &joint.effects {
                    if let Some(v) = &f.values {
                        let what = format!("{}.{}", edge.name, f.kind.label());
                        length(&what, v.len())?;
                        finite(&what, v)?;
                    }
                }
                for c in &joint.candidates {
                    length(&c.name, c.values.len())?;
                    finite(&c.name, &c.values)?;
                }
            }
            EdgeKind::Random { directions, .. } => {
                for d in directions {
                    finite(&edge.name, d.as_slice())?;
                }
            }
        }
    }
    let mut names = BTreeSet::new();
    for p in &problem.parameters {
        if !names.insert(p.name.as_str()) {
            return Err(Error::DuplicateName {
                name: p.name.clone(),
            });
        }
        finite(&p.name, &[p.nominal, p.start])?;
        if let Some(sigma) = p.prior_sigma {
            positive(&format!("{} prior", p.name), sigma)?;
        }
        if let Some((lower, upper)) = p.bounds
            && !(lower <= p.start && p.start <= upper)
        {
            return Err(Error::OutOfBounds {
                name: p.name.clone(),
                start: p.start,
                lower,
                upper,
            });
        }
    }
    for g in &problem.groups {
        positive(&g.name, g.sigma)?;
    }
    if let Some(t) = &problem.times {
        length("times", t.len())?;
        finite("times", t)?;
    }
    for measurement in &problem.measurements {
        for sample in measurement.kind.samples() {
            if sample >= problem.samples {
                return Err(Error::NoSuchSample {
                    what: measurement.name.clone(),
                    sample,
                    samples: problem.samples,
                });
            }
        }
        let at_frame = |point: crate::graph::ids::PointId| {
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
        match &measurement.kind {
            MeasurementKind::Markers { observations, .. } => {
                for o in observations {
                    at_frame(o.point)?;
                    if !o.position.iter().all(|v| v.is_finite()) {
                        return Err(Error::NotFinite {
                            what: measurement.name.clone(),
                            sample: o.sample,
                        });
                    }
                    if let Some(shape) = o.shape
                        && nalgebra::Cholesky::new(shape).is_none()
                    {
                        return Err(Error::NotPositive {
                            what: format!("{} covariance", measurement.name),
                            value: shape.determinant(),
                        });
                    }
                }
            }
            MeasurementKind::Poses {
                observations,
                noise,
            } => {
                for o in observations {
                    pose(&measurement.name, o.sample, &o.pose)?;
                }
                check_noise(&measurement.name, noise)?;
            }
            MeasurementKind::Loop { noise, .. } => check_noise(&measurement.name, noise)?,
            MeasurementKind::Plane {
                point,
                normal,
                observations,
                ..
            } => {
                at_frame(*point)?;
                unit_vector(&measurement.name, 0, normal)?;
                for &(s, h) in observations {
                    finite(&measurement.name, &[h]).map_err(|_| Error::NotFinite {
                        what: measurement.name.clone(),
                        sample: s,
                    })?;
                }
            }
            MeasurementKind::Distance {
                point,
                anchor,
                observations,
                ..
            } => {
                at_frame(*point)?;
                finite(&measurement.name, anchor.coords.as_slice())?;
                for &(s, h) in observations {
                    if !h.is_finite() {
                        return Err(Error::NotFinite {
                            what: measurement.name.clone(),
                            sample: s,
                        });
                    }
                }
            }
            MeasurementKind::Line {
                point,
                through,
                direction,
                ..
            } => {
                at_frame(*point)?;
                finite(&measurement.name, through.coords.as_slice())?;
                unit_vector(&measurement.name, 0, direction)?;
            }
            MeasurementKind::Directions {
                direction,
                observations,
                ..
            } => {
                unit_vector(&measurement.name, 0, direction)?;
                for o in observations {
                    unit_vector(&measurement.name, o.sample, &o.direction)?;
                }
            }
        }
    }
    Ok(())
}

/// A direction must be finite and of length 1: `Unit::new_normalize` of a zero vector is neither.
fn unit_vector(what: &str, sample: usize, d: &Unit<Vector3<f64>>) -> Result<(), Error> {
    /// Rounding of a normalization, and of numbers read from text with six digits.
    const LENGTH: f64 = 1e-5;
    // NaN compares false.
    if (d.norm() - 1.0).abs() < LENGTH {
        Ok(())
    } else {
        Err(Error::NotFinite {
            what: what.to_owned(),
            sample,
        })
    }
}

fn check_noise(measurement: &str, noise: &PoseNoise) -> Result<(), Error> {
    if let PoseNoise::Full { shape, .. } = noise
        && nalgebra::Cholesky::new(*shape).is_none()
    {
        return Err(Error::NotPositive {
            what: format!("{measurement} covariance"),
            value: shape.determinant(),
        });
    }
    Ok(())
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
