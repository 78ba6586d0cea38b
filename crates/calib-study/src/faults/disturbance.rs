//! What goes wrong in a case: joints, sizes and moments of its faults, drawn once.

use nalgebra::{Isometry3, Translation3};

use super::design::Design;
use super::fault::Fault;
use super::robot::{Robot, Transmission};
use crate::noise::Noise;

/// What changes on the table, in the workcell or in the file: drawn once per case.
#[derive(Debug, Clone)]
pub(crate) struct Disturbance {
    pub faults: Vec<Fault>,
    /// The joint that is concerned, and another one.
    pub joint: usize,
    pub other: usize,
    pub transmission: Transmission,
    /// A step of a pose: 2 mm for slips and bumps, two and one tracker σ for small slips.
    pub step: Isometry3<f64>,
    /// Pose by which a body was mounted again, or the tracker moved.
    pub moved: Isometry3<f64>,
    /// Row from which a change holds, as a share of the first recording.
    pub from: f64,
    /// Rows by which joints lag: ±1.
    pub lag: isize,
    /// Share of samples that are far off.
    pub outliers: f64,
    /// Degrees as rad rather than rad as degrees; mm as m rather than m as mm.
    pub up: bool,
}

impl Disturbance {
    pub fn draw(fault: Fault, design: Design, robot: &Robot, noise: &mut Noise) -> Self {
        let n = robot.joints.len();
        let joint = noise.below(n);
        // Exchanged columns are of one unit.
        let alike: Vec<usize> = (0..n)
            .filter(|k| *k != joint && robot.joints[*k].prismatic == robot.joints[joint].prismatic)
            .collect();
        let revolute: Vec<usize> = (0..n).filter(|k| !robot.joints[*k].prismatic).collect();
        let (joint, other) = match alike.get(noise.below(alike.len().max(1))) {
            Some(other) => (joint, *other),
            None => (revolute[0], revolute[1]),
        };
        let side = if noise.uniform() < 0.5 { 1.0 } else { -1.0 };
        let step = |mm: f64, noise: &mut Noise| {
            Isometry3::from_parts(
                Translation3::from(noise.direction() * mm * 1e-3),
                noise.turn(mm * 2e-3),
            )
        };
        let pairs = [
            Fault::Sign,
            Fault::Exchange,
            Fault::JointUnit,
            Fault::RowShift,
            Fault::WrongLink,
            Fault::Coupling,
        ];
        let faults = if fault == Fault::Pair {
            let first = noise.below(pairs.len());
            let second = (first + 1 + noise.below(pairs.len() - 1)) % pairs.len();
            vec![pairs[first], pairs[second]]
        } else {
            vec![fault]
        };
        let mut transmission = Transmission::default();
        let turning = if robot.joints[joint].prismatic {
            revolute[0]
        } else {
            joint
        };
        for fault in &faults {
            match fault {
                Fault::Gain => transmission.gain = Some((joint, 0.01 * side)),
                Fault::Coupling => transmission.coupling = Some((joint, other, side)),
                Fault::Crosstalk => transmission.coupling = Some((joint, other, 0.02 * side)),
                Fault::Eccentricity => {
                    transmission.eccentricity = Some((turning, 0.5_f64.to_radians() * side))
                }
                Fault::QuarterTurn => {
                    let quarter = std::f64::consts::FRAC_PI_2;
                    let by = [quarter, -quarter, 2.0 * quarter][noise.below(3)];
                    transmission.offset = Some((turning, by));
                }
                _ => {}
            }
        }
        let joint = match fault {
            Fault::JointUnit | Fault::OffsetStep | Fault::Pair => turning,
            _ => joint,
        };
        let other = if other == joint {
            revolute
                .iter()
                .copied()
                .find(|k| *k != joint)
                .unwrap_or(other)
        } else {
            other
        };
        Self {
            faults,
            joint,
            other,
            transmission,
            step: step(
                match (fault, design) {
                    (Fault::SmallSlip, Design::Stream) => 0.3,
                    (Fault::SmallSlip, _) => 0.6,
                    _ => 2.0,
                },
                noise,
            ),
            moved: step(40.0, noise),
            from: noise.between(0.3, 0.7),
            lag: if noise.uniform() < 0.5 { 1 } else { -1 },
            up: noise.uniform() < 0.5,
            outliers: noise.log_between(0.005, 0.05),
        }
    }
}
