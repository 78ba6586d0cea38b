//! Random robots, designs, bodies and faults. The truth is the nominal robot with errors; the data are made from the truth.

use std::f64::consts::{FRAC_PI_2, PI};

use calib_checks::structural::*;
use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn vector(rng: &mut ChaCha8Rng, sigma: f64) -> Vector3<f64> {
    Vector3::new(normal(rng), normal(rng), normal(rng)) * sigma
}

pub fn rotation(rng: &mut ChaCha8Rng) -> UnitQuaternion<f64> {
    let q = nalgebra::Quaternion::new(normal(rng), normal(rng), normal(rng), normal(rng));
    UnitQuaternion::new_normalize(q)
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Plan {
    Poses(usize),
    Sweeps,
    Both,
    Stream,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BodyKind {
    Markers(usize),
    Pose,
}

/// Bodies of a study over designs.
pub const BODIES: [BodyKind; 4] = [
    BodyKind::Markers(1),
    BodyKind::Markers(2),
    BodyKind::Markers(4),
    BodyKind::Pose,
];

/// Errors of the nominal robot: angle offset (°), origin (mm), tilt (°).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors(pub f64, pub f64, pub f64);
pub const NO_ERRORS: Errors = Errors(0.0, 0.0, 0.0);
pub const SMALL: Errors = Errors(0.3, 1.0, 0.2);
pub const BIG: Errors = Errors(1.0, 5.0, 0.5);
pub const HUGE: Errors = Errors(3.0, 20.0, 2.0);

/// A robot with its readings; measurements are made of it as often as wanted.
#[derive(Clone)]
pub struct Setting {
    pub nominal: Chain,
    pub truth: Chain,
    pub readings: Vec<Vec<f64>>,
    pub recording: Vec<RecordingIndex>,
    pub kind: BodyKind,
    tracker_from_root: Isometry3<f64>,
    mount: Isometry3<f64>,
    markers: Vec<Point3<f64>>,
    seed: u64,
}

fn chain(rng: &mut ChaCha8Rng) -> Chain {
    let n = rng.random_range(4..=7_usize);
    let prismatic = if rng.random_bool(0.5) {
        Some(rng.random_range(0..n - 1))
    } else {
        None
    };
    let orthogonal = rng.random_bool(0.5);
    let joints = (0..n).map(|j| {
        let turn = if orthogonal {
            // a quarter turn about x or y: neighboring axes meet or cross at right angles, as in most arms
            let axis = if rng.random_bool(0.5) {
                Vector3::x_axis()
            } else {
                Vector3::y_axis()
            };
            UnitQuaternion::from_axis_angle(
                &axis,
                if rng.random_bool(0.5) {
                    FRAC_PI_2
                } else {
                    -FRAC_PI_2
                },
            )
        } else {
            rotation(rng)
        };
        let mut arm = Vector3::new(
            rng.random_range(-0.35..0.35),
            rng.random_range(-0.35..0.35),
            rng.random_range(0.05..0.4),
        );
        if j + 1 == n {
            arm = Vector3::zeros();
        }
        let axis = Vector3::z_axis();
        ChainJoint {
            parent: LinkIndex(j),
            child: LinkIndex(j + 1),
            parent_from_joint: Isometry3::from_parts(Translation3::from(arm), turn),
            motion: if prismatic == Some(j) {
                Motion::Prismatic(axis)
            } else {
                Motion::Revolute(axis)
            },
            law: vec![(JointIndex(j), 1.0)],
            offset: 0.0,
        }
    });
    Chain::new(n + 1, joints.collect()).unwrap()
}

fn disturbed(nominal: &Chain, errors: Errors, rng: &mut ChaCha8Rng) -> Chain {
    let joints = nominal.joints().iter().map(|joint| {
        let turn = Vector3::new(
            normal(rng) * errors.2.to_radians(),
            normal(rng) * errors.2.to_radians(),
            normal(rng) * errors.0.to_radians(),
        );
        let step = Isometry3::from_parts(
            Translation3::from(vector(rng, errors.1 * 1e-3)),
            UnitQuaternion::from_scaled_axis(turn),
        );
        ChainJoint {
            parent_from_joint: joint.parent_from_joint * step,
            ..joint.clone()
        }
    });
    Chain::new(nominal.links(), joints.collect()).unwrap()
}

fn limits(chain: &Chain, j: usize) -> (f64, f64) {
    match chain.joints()[j].motion {
        Motion::Prismatic(_) => (-0.2, 0.2),
        _ => (-1.9, 1.9),
    }
}

fn random_pose(chain: &Chain, rng: &mut ChaCha8Rng) -> Vec<f64> {
    (0..chain.joints().len())
        .map(|j| {
            let (low, high) = limits(chain, j);
            rng.random_range(low..high)
        })
        .collect()
}

fn readings(
    chain: &Chain,
    design: Plan,
    rng: &mut ChaCha8Rng,
) -> (Vec<Vec<f64>>, Vec<RecordingIndex>) {
    let n = chain.joints().len();
    let mut rows = Vec::new();
    let sweeps = |rows: &mut Vec<Vec<f64>>, rng: &mut ChaCha8Rng| {
        let home: Vec<f64> = random_pose(chain, rng).iter().map(|q| 0.5 * q).collect();
        for j in 0..n {
            let (low, high) = limits(chain, j);
            for k in 0..7 {
                let mut row = home.clone();
                row[j] = low + (high - low) * (k as f64 + 0.5 * rng.random::<f64>()) / 7.0;
                rows.push(row);
            }
        }
    };
    let mut second = usize::MAX;
    match design {
        Plan::Poses(count) => rows.extend((0..count).map(|_| random_pose(chain, rng))),
        Plan::Sweeps => sweeps(&mut rows, rng),
        Plan::Both => {
            rows.extend((0..20).map(|_| random_pose(chain, rng)));
            second = rows.len();
            sweeps(&mut rows, rng);
        }
        Plan::Stream => {
            let phase: Vec<(f64, f64)> = (0..n)
                .map(|_| (rng.random_range(0.4..1.3), rng.random_range(0.0..2.0 * PI)))
                .collect();
            for i in 0..150 {
                let t = i as f64 * 0.1;
                rows.push(
                    (0..n)
                        .map(|j| limits(chain, j).1 * 0.9 * (phase[j].0 * t + phase[j].1).sin())
                        .collect(),
                );
            }
        }
    }
    let recording = (0..rows.len())
        .map(|i| RecordingIndex(usize::from(i >= second)))
        .collect();
    (rows, recording)
}

impl Setting {
    pub fn new(seed: u64, design: Plan, kind: BodyKind, errors: Errors) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let nominal = chain(&mut rng);
        let truth = disturbed(&nominal, errors, &mut rng);
        let (readings, recording) = readings(&nominal, design, &mut rng);
        let count = if let BodyKind::Markers(count) = kind {
            count
        } else {
            0
        };
        let point = |rng: &mut ChaCha8Rng| {
            Point3::new(
                rng.random_range(-0.06..0.06),
                rng.random_range(-0.06..0.06),
                rng.random_range(-0.06..0.06),
            )
        };
        let markers = (0..count).map(|_| point(&mut rng)).collect();
        let side = rng.random_range(0.0..2.0 * PI);
        let off = rng.random_range(0.05..0.12);
        let along = rng.random_range(0.05..0.15);
        let mount = Translation3::new(off * side.cos(), off * side.sin(), along);
        Self {
            tracker_from_root: Isometry3::from_parts(
                Translation3::from(vector(&mut rng, 1.5)),
                rotation(&mut rng),
            ),
            mount: Isometry3::from_parts(mount, rotation(&mut rng)),
            nominal,
            truth,
            readings,
            recording,
            kind,
            markers,
            seed,
        }
    }

    fn tip(chain: &Chain, q: &[f64]) -> Isometry3<f64> {
        chain
            .joints()
            .iter()
            .zip(q)
            .fold(Isometry3::identity(), |pose, (joint, q)| {
                let motion = match joint.motion {
                    Motion::Fixed => Isometry3::identity(),
                    Motion::Revolute(axis) => Isometry3::from_parts(
                        Translation3::identity(),
                        UnitQuaternion::from_axis_angle(&axis, *q),
                    ),
                    Motion::Prismatic(axis) => Isometry3::from_parts(
                        Translation3::from(axis.into_inner() * *q),
                        UnitQuaternion::identity(),
                    ),
                };
                pose * joint.parent_from_joint * motion
            })
    }

    /// Correct data of the robot with errors and noise, or of the nominal robot without noise.
    /// The same with the tracker elsewhere.
    pub fn moved(&self, motion: &Isometry3<f64>) -> Self {
        Self {
            tracker_from_root: motion * self.tracker_from_root,
            ..self.clone()
        }
    }

    /// The same with the body elsewhere on its link.
    pub fn remounted(&self, motion: &Isometry3<f64>) -> Self {
        Self {
            mount: self.mount * motion,
            ..self.clone()
        }
    }

    pub fn data(&self, noisy: bool) -> Data {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 0x5eed);
        let sigma = 1e-4 * 10.0_f64.powf(rng.random::<f64>());
        let joint_noise = (0.03 * rng.random::<f64>()).to_radians();
        let on = if noisy { 1.0 } else { 0.0 };
        let chain = if noisy { &self.truth } else { &self.nominal };
        let tracker_from_body: Vec<Isometry3<f64>> = self
            .readings
            .iter()
            .map(|row| {
                let q: Vec<f64> = row
                    .iter()
                    .map(|q| q + on * joint_noise * normal(&mut rng))
                    .collect();
                self.tracker_from_root * Self::tip(chain, &q) * self.mount
            })
            .collect();
        let measured = match self.kind {
            BodyKind::Markers(_) => Measured::Markers(
                tracker_from_body
                    .iter()
                    .map(|pose| {
                        self.markers
                            .iter()
                            .map(|m| Some(pose * m + vector(&mut rng, on * sigma)))
                            .collect()
                    })
                    .collect(),
            ),
            BodyKind::Pose => Measured::Poses {
                tracker_from_body: tracker_from_body
                    .iter()
                    .map(|pose| {
                        let mut pose = *pose;
                        pose.translation.vector += vector(&mut rng, on * sigma);
                        let turn = vector(&mut rng, on * sigma / 0.3);
                        Some(pose * UnitQuaternion::from_scaled_axis(turn))
                    })
                    .collect(),
                sigma_position: 3e-4,
                sigma_orientation: 1e-3,
            },
        };
        let link = LinkIndex(self.nominal.links() - 1);
        Data {
            chain: self.nominal.clone(),
            readings: self
                .readings
                .iter()
                .map(|row| row.iter().copied().map(Some).collect())
                .collect(),
            recording: self.recording.clone(),
            rates: Vec::new(),
            bodies: vec![Body {
                link,
                measured,
                mounts: Vec::new(),
            }],
        }
    }
}

/// Moves a share of the samples by 10 to 100 mm.
pub fn with_outliers(mut data: Data, share: f64, seed: u64) -> Data {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xbad);
    let jump = |rng: &mut ChaCha8Rng| {
        let direction = Unit::new_normalize(vector(rng, 1.0));
        rng.random_bool(share)
            .then(|| direction.into_inner() * rng.random_range(0.01..0.1))
    };
    for body in &mut data.bodies {
        match &mut body.measured {
            Measured::Markers(rows) => {
                for p in rows.iter_mut().flatten().flatten() {
                    *p += jump(&mut rng).unwrap_or_default();
                }
            }
            Measured::Poses {
                tracker_from_body, ..
            } => {
                for pose in tracker_from_body.iter_mut().flatten() {
                    if let Some(jump) = jump(&mut rng) {
                        pose.translation.vector += jump;
                    }
                }
            }
        }
    }
    data
}

/// Loses a share of the markers.
pub fn with_losses(mut data: Data, share: f64, seed: u64) -> Data {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x1055);
    for body in &mut data.bodies {
        if let Measured::Markers(rows) = &mut body.measured {
            rows.iter_mut()
                .flatten()
                .filter(|_| rng.random_bool(share))
                .for_each(|p| *p = None);
        }
    }
    data
}

/// The families of discrete faults, drawn with equal probability.
pub fn fault(data: &Data, rng: &mut ChaCha8Rng) -> Scoped {
    let n = data.chain.joints().len();
    let joint = JointIndex(rng.random_range(0..n));
    let other = JointIndex((joint.0 + rng.random_range(1..n)) % n);
    let revolute = |j: JointIndex| matches!(data.chain.joints()[j.0].motion, Motion::Revolute(_));
    let two = data.recordings() > 1;
    let pose = matches!(data.bodies[0].measured, Measured::Poses { .. });
    loop {
        let part = if two && rng.random_bool(0.4) {
            Scope::Recording(RecordingIndex(rng.random_range(0..2)))
        } else {
            Scope::All
        };
        let hypothesis = match rng.random_range(0..12) {
            0 => Hypothesis::Sign { joint },
            1 => Hypothesis::Exchange {
                first: joint.min(other),
                second: joint.max(other),
            },
            2 => {
                let mistake = match (revolute(joint), rng.random_bool(0.5)) {
                    (true, true) => UnitMistake::DegreesReadAsRadians,
                    (true, false) => UnitMistake::RadiansReadAsDegrees,
                    (false, true) => UnitMistake::MILLIMETERS_READ_AS_METERS,
                    (false, false) => UnitMistake::METERS_READ_AS_MILLIMETERS,
                };
                Hypothesis::Unit { joint, mistake }
            }
            3 if revolute(joint) && revolute(other) => Hypothesis::Coupling {
                joint,
                source: other,
                factor: if rng.random_bool(0.5) { 1.0 } else { -1.0 },
            },
            4 if revolute(joint) => {
                let turns = [
                    QuarterTurns::Plus90,
                    QuarterTurns::Minus90,
                    QuarterTurns::Half,
                ];
                Hypothesis::Offset {
                    joint,
                    turns: turns[rng.random_range(0..3)],
                }
            }
            5 => Hypothesis::RowShift {
                rows: if rng.random_bool(0.5) { 1 } else { -1 },
            },
            // Truth: on this link, claimed on the last.
            6 if part == Scope::All => Hypothesis::WrongLink {
                body: BodyIndex(0),
                link: LinkIndex(n - rng.random_range(1..3)),
            },
            7 => {
                let (unit, read_as) = TRACKER_UNITS[rng.random_range(0..TRACKER_UNITS.len())];
                Hypothesis::TrackerUnit { unit, read_as }
            }
            8 => Hypothesis::Mirrored,
            9 if pose => Hypothesis::Poses {
                body: None,
                mistake: [
                    PoseMistake::ScalarFirstReadAsLast,
                    PoseMistake::ScalarLastReadAsFirst,
                    PoseMistake::Inverse,
                    PoseMistake::Transposed,
                ][rng.random_range(0..4)],
            },
            10 if part != Scope::All => Hypothesis::TrackerMoved,
            11 if part != Scope::All => Hypothesis::Remounted { body: BodyIndex(0) },
            _ => continue,
        };
        return Scoped {
            hypothesis,
            scope: part,
        };
    }
}

/// Data with the fault that the hypothesis corrects, from correct data.
pub fn with_fault(setting: &Setting, data: &Data, fault: &Scoped) -> Data {
    let undo = |hypothesis| {
        apply(
            &Scoped {
                hypothesis,
                scope: fault.scope,
            },
            data,
        )
    };
    match fault.hypothesis {
        Hypothesis::Unit { joint, mistake } => {
            let mistake = match mistake {
                UnitMistake::DegreesReadAsRadians => UnitMistake::RadiansReadAsDegrees,
                UnitMistake::RadiansReadAsDegrees => UnitMistake::DegreesReadAsRadians,
                UnitMistake::Length { unit, read_as } => UnitMistake::Length {
                    unit: read_as,
                    read_as: unit,
                },
            };
            undo(Hypothesis::Unit { joint, mistake })
        }
        Hypothesis::TrackerUnit { unit, read_as } => undo(Hypothesis::TrackerUnit {
            unit: read_as,
            read_as: unit,
        }),
        Hypothesis::Coupling {
            joint,
            source,
            factor,
        } => undo(Hypothesis::Coupling {
            joint,
            source,
            factor: -factor,
        }),
        Hypothesis::Gain { joint, factor } => undo(Hypothesis::Gain {
            joint,
            factor: 1.0 / factor,
        }),
        Hypothesis::Offset { joint, turns } => undo(Hypothesis::Offset {
            joint,
            turns: match turns {
                QuarterTurns::Plus90 => QuarterTurns::Minus90,
                QuarterTurns::Minus90 => QuarterTurns::Plus90,
                QuarterTurns::Half => QuarterTurns::Half,
            },
        }),
        Hypothesis::Poses { body, mistake } => undo(Hypothesis::Poses {
            body,
            mistake: match mistake {
                PoseMistake::ScalarFirstReadAsLast => PoseMistake::ScalarLastReadAsFirst,
                PoseMistake::ScalarLastReadAsFirst => PoseMistake::ScalarFirstReadAsLast,
                other => other,
            },
        }),
        Hypothesis::RowShift { rows } => {
            let mut shifted = undo(Hypothesis::RowShift { rows: -rows });
            for (new, old) in shifted.readings.iter_mut().zip(&data.readings) {
                if new.iter().all(Option::is_none) {
                    new.clone_from(old);
                }
            }
            shifted
        }
        Hypothesis::WrongLink { link, .. } => on_link(setting, data, link),
        Hypothesis::TrackerMoved => {
            let motion = Isometry3::new(
                Vector3::new(0.21, -0.13, 0.08),
                Vector3::new(0.05, -0.11, 0.2),
            );
            moved(data, fault.scope, &motion, &Isometry3::identity())
        }
        Hypothesis::Remounted { .. } => {
            let motion = Isometry3::new(
                Vector3::new(0.031, -0.013, 0.022),
                Vector3::new(0.5, 0.8, -0.6),
            );
            remounted(setting, data, fault.scope, &motion)
        }
        same => undo(same),
    }
}

/// The body really hangs on a link nearer to the base.
fn on_link(setting: &Setting, data: &Data, link: LinkIndex) -> Data {
    let noisy = registration_residual(data).unwrap() > 1e-5;
    let mut still = Setting {
        readings: setting.readings.clone(),
        ..copy(setting)
    };
    for row in &mut still.readings {
        row[link.0..].iter_mut().for_each(|q| *q = 0.0);
    }
    Data {
        readings: data.readings.clone(),
        ..still.data(noisy)
    }
}

fn copy(setting: &Setting) -> Setting {
    Setting {
        nominal: setting.nominal.clone(),
        truth: setting.truth.clone(),
        readings: Vec::new(),
        recording: setting.recording.clone(),
        kind: setting.kind,
        tracker_from_root: setting.tracker_from_root,
        mount: setting.mount,
        markers: setting.markers.clone(),
        seed: setting.seed,
    }
}

fn remounted(setting: &Setting, data: &Data, scope: Scope, motion: &Isometry3<f64>) -> Data {
    let noisy = registration_residual(data).unwrap() > 1e-5;
    let mut other = Setting {
        readings: setting.readings.clone(),
        ..copy(setting)
    };
    other.mount *= motion;
    let other = other.data(noisy);
    let mut both = data.clone();
    for i in (0..data.recording.len()).filter(|&i| scope.contains(data.recording[i])) {
        match (&mut both.bodies[0].measured, &other.bodies[0].measured) {
            (Measured::Markers(a), Measured::Markers(b)) => a[i].clone_from(&b[i]),
            (
                Measured::Poses {
                    tracker_from_body: a,
                    ..
                },
                Measured::Poses {
                    tracker_from_body: b,
                    ..
                },
            ) => a[i] = b[i],
            _ => {}
        }
    }
    both
}

/// Measurements of a scope moved in the tracker frame and in the body frame.
fn moved(data: &Data, scope: Scope, left: &Isometry3<f64>, right: &Isometry3<f64>) -> Data {
    let mut data = data.clone();
    for i in (0..data.recording.len()).filter(|&i| scope.contains(data.recording[i])) {
        match &mut data.bodies[0].measured {
            Measured::Markers(rows) => rows[i].iter_mut().flatten().for_each(|p| *p = left * *p),
            Measured::Poses {
                tracker_from_body, ..
            } => {
                if let Some(pose) = &mut tracker_from_body[i] {
                    *pose = left * *pose * right;
                }
            }
        }
    }
    data
}
