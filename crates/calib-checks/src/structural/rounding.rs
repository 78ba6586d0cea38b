//! What rounding to the decimals of a file leaves of a body whose coordinates were computed from the readings, and of nothing else.
//!
//! A value that was rounded to a step s scatters by s²/12. With positions of step s, and readings of steps s_j that move the body by D_j,
//!
//! ```text
//! rounding² = 3 s²/12 + mean over the rows of Σ_j |D_j|² s_j²/12,   arm² = mean over the rows of Σ_j |D_j|²
//! ```
//!
//! D_j is taken at the origin of the link, so that of the last joints is too small.

use super::candidates::span;
use super::chain::{Pose, Walk};
use super::data::{Data, Measured};
use super::decide::registration_residual;
use super::ids::{BodyIndex, JointIndex};
use super::thinning::thin;
use crate::statistics::{step_of, written_step};

/// Rows that are looked at: an average needs no more.
const MOST_ROWS: usize = 200;
/// Standard deviations by which what is left may exceed what rounding leaves on average.
const BY_CHANCE: f64 = 2.0;
/// Unknowns of the registration of one point.
const UNKNOWNS: usize = 9;
/// Joints that move the body: on fewer, any robot is as close to its drawing.
const JOINTS: usize = 3;
/// Change of a reading that gives D_j, rad or m.
const STEP: f64 = 1e-6;

/// What the decimals of a file make of the position of a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rounding {
    /// Step of the body's coordinates, m; 0 where none shows.
    pub step: f64,
    /// What rounding leaves, rms, m: of the coordinates and of the readings.
    pub left: f64,
    /// What readings that scatter by 1 rad, each by itself, make of the body's place, rms, m; slides leave it as they scatter little.
    pub arm: f64,
}

/// What rounding leaves of a body that the readings move; `None` where they do not.
///
/// # Panics
/// With a body that the data do not have, and with data that contradict themselves.
#[must_use]
pub fn rounding(data: &Data, body: BodyIndex) -> Option<Rounding> {
    let body = &data.bodies[body.0];
    let step = match &body.measured {
        Measured::Markers(rows) => {
            let points = rows.iter().flatten().flatten();
            written_step(points.flat_map(|p| p.iter().copied()))
        }
        Measured::Poses {
            tracker_from_body, ..
        } => {
            let places = tracker_from_body.iter().flatten();
            written_step(
                places.flat_map(|p| p.translation.vector.iter().copied().collect::<Vec<_>>()),
            )
        }
    };
    let joints = data.chain.readings_of(body.link);
    let moving: Vec<JointIndex> = joints
        .into_iter()
        .filter(|j| span(data, *j) > 0.0)
        .collect();
    if moving.is_empty() {
        return None;
    }
    let steps: Vec<f64> = moving.iter().map(|j| step_of_readings(data, *j)).collect();
    let mut walk = Walk::new(&data.chain, &[body.link]);
    let mut place = |readings: &[f64]| {
        walk.go(&data.chain, readings);
        let Pose { t, .. } = walk.root_from_link[body.link.0];
        t
    };
    let (mut rows, mut of_readings, mut arm) = (0.0, 0.0, 0.0);
    let thinned = thin(data, MOST_ROWS);
    for readings in &thinned.readings {
        let mut readings: Vec<f64> = readings.iter().map(|q| q.unwrap_or(0.0)).collect();
        let at = place(&readings);
        rows += 1.0;
        for (joint, step) in moving.iter().zip(&steps) {
            let before = readings[joint.0];
            readings[joint.0] += STEP;
            let moved = ((place(&readings) - at) / STEP).norm_squared();
            readings[joint.0] = before;
            of_readings += moved * step * step / 12.0;
            if data.chain.turns(joint.0) == Some(true) {
                arm += moved;
            }
        }
    }
    Some(Rounding {
        step,
        left: (step * step / 4.0 + of_readings / rows).sqrt(),
        arm: (arm / rows).sqrt(),
    })
}

/// The step of a joint's readings, in the unit that they are read in: decimals of a degree, or of a radian or meter.
fn step_of_readings(data: &Data, joint: JointIndex) -> f64 {
    let values = data.readings.iter().filter_map(|row| row[joint.0]);
    let plain = step_of(values.clone(), 1..=5);
    if data.chain.turns(joint.0) != Some(true) {
        return plain;
    }
    let degrees = step_of(values.map(f64::to_degrees), 0..=4).to_radians();
    plain.max(degrees)
}

/// What the registration leaves of the body's positions, rms, m, if rounding explains all of it.
///
/// # Panics
/// With a body that the data do not have, and with data that contradict themselves.
#[must_use]
pub fn by_rounding_alone(data: &Data, body: BodyIndex) -> Option<f64> {
    let (on, measured) = (data.bodies[body.0].link, &data.bodies[body.0].measured);
    let joints = data.chain.readings_of(on).into_iter();
    if joints.filter(|joint| span(data, *joint) > 0.0).count() < JOINTS {
        return None;
    }
    let rounded = rounding(data, body).filter(|rounded| rounded.step > 0.0)?;
    let left = positions_alone(data, body)?;
    let rows = (0..data.readings.len()).filter(|row| measured.seen(*row));
    let freedom = (3 * rows.count()).saturating_sub(UNKNOWNS);
    let limit = rounded.left * (1.0 + BY_CHANCE / (2.0 * freedom as f64).sqrt());
    (freedom > 0 && left < limit).then_some(left)
}

/// What the registration leaves of the positions of one body alone, rms, m, whatever its orientations: the controller of a robot rounds
/// those to a step of their own.
fn positions_alone(data: &Data, body: BodyIndex) -> Option<f64> {
    let mut alone = data.clone();
    alone.bodies = vec![data.bodies[body.0].clone()];
    if let Measured::Poses {
        tracker_from_body, ..
    } = &alone.bodies[0].measured
    {
        let place = |pose: &Option<nalgebra::Isometry3<f64>>| {
            vec![pose.map(|pose| pose.translation.vector.into())]
        };
        alone.bodies[0].measured = Measured::Markers(tracker_from_body.iter().map(place).collect());
    }
    registration_residual(&alone).ok()
}
