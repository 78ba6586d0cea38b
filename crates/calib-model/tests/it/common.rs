//! Robots by chance, as files.

use calib_model::axis::Axis;
use calib_model::effect::{Drives, EFFECTS, EffectKind, Source};
use calib_model::file::{
    ModelBody, ModelEffect, ModelJoint, ModelLink, ModelMimic, ModelMotion, ModelNumber,
    ModelPoint, ModelPose, ModelUncertainty, RobotModelFile,
};
use calib_model::nalgebra::{Isometry3, Unit, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// A generator with a fixed seed.
pub fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// A number between −size and size.
pub fn within(r: &mut ChaCha8Rng, size: f64) -> f64 {
    r.random_range(-size..size)
}

/// A vector with coordinates between −size and size.
pub fn vector(r: &mut ChaCha8Rng, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| within(r, size))
}

/// A pose in the file's form.
pub fn pose(of: &Isometry3<f64>) -> ModelPose {
    let q = of.rotation.coords;
    ModelPose {
        xyz_m: of.translation.vector.into(),
        quat_xyzw: [q.x, q.y, q.z, q.w],
    }
}

/// Which effects a robot has.
#[derive(Clone, Copy, PartialEq)]
pub enum Effects {
    /// All that a joint can have.
    All,
    /// Those without jumps and direction of approach.
    Smooth,
}

/// A chain of `n` joints with effects of realistic size; `mixed`: sliding, fixed and mimicking ones too, and a branch.
pub fn robot(r: &mut ChaCha8Rng, n: usize, mixed: bool, which: Effects) -> RobotModelFile {
    let mut file = RobotModelFile {
        robot: "robot".to_owned(),
        root: "link_0".to_owned(),
        gravity_m_s2: [0.0, 0.0, -9.81],
        approach_threshold: 1e-5,
        tracker: "tracker".to_owned(),
        tracker_from_root: pose(&Isometry3::new(vector(r, 1.0), vector(r, 1.0))),
        ..RobotModelFile::default()
    };
    file.links.push(link("link_0", r));
    for i in 0..n {
        let kind = if mixed { r.random_range(0..8) } else { 7 };
        let own = |j: &ModelJoint| j.mimic.is_none() && j.motion != ModelMotion::Fixed;
        let before: Vec<String> = file
            .joints
            .iter()
            .filter(|j| own(j))
            .map(|j| j.name.clone())
            .collect();
        let motion = match kind {
            0 => ModelMotion::Fixed,
            1 => ModelMotion::Prismatic,
            _ => ModelMotion::Revolute,
        };
        let nominal = Isometry3::new(vector(r, 0.4), vector(r, 1.0));
        let found = nominal * Isometry3::new(vector(r, 2e-3), vector(r, 5e-3));
        let axis = Unit::new_normalize(vector(r, 1.0) + Vector3::new(0.0, 0.0, 1e-3));
        // A branch where the last but one is taken as parent.
        let parent = if mixed && i > 1 && r.random_bool(0.2) {
            i - 1
        } else {
            i
        };
        let mut joint = ModelJoint {
            name: format!("joint_{i}"),
            parent: format!("link_{parent}"),
            child: format!("link_{}", i + 1),
            motion,
            parent_from_joint: pose(&found),
            load_origin: pose(&nominal),
            axis: (motion != ModelMotion::Fixed).then(|| axis.into_inner().into()),
            limits: Some([-3.0, 3.0]),
            fitted_range: Some([-2.5, 2.5]),
            mimic: (kind == 2 && !before.is_empty()).then(|| ModelMimic {
                joint: before[0].clone(),
                multiplier: -0.5,
                offset: 0.1,
            }),
            ..ModelJoint::default()
        };
        joint.effects = effects(r, &joint, &before, which);
        file.links.push(link(&joint.child, r));
        file.joints.push(joint);
    }
    grow(&mut file);
    let end = format!("link_{n}");
    let mount = Some(pose(&Isometry3::new(vector(r, 0.1), vector(r, 1.0))));
    file.bodies.insert(
        "body".to_owned(),
        ModelBody {
            link: end.clone(),
            link_from_body: mount,
            ..ModelBody::default()
        },
    );
    let xyz_m = vector(r, 0.2).into();
    file.points
        .insert("tip".to_owned(), ModelPoint { link: end, xyz_m });
    file
}

/// °C of links: for robots of up to ten joints.
pub const WARM: [f64; 10] = [31.0, 27.5, 35.0, 12.0, 20.0, 41.0, 8.0, 25.0, 22.0, 30.0];

/// What grows is the length from the joint before that moves, nominal, in the axes of the joint.
fn grow(file: &mut RobotModelFile) {
    let at = |p: &ModelPose| {
        let [x, y, z, w] = p.quat_xyzw;
        let rotation =
            nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z));
        Isometry3::from_parts(Vector3::from(p.xyz_m).into(), rotation)
    };
    for i in 0..file.joints.len() {
        let mut joint = &file.joints[i];
        let mut reach = at(&joint.load_origin);
        while let Some(before) = file.joints.iter().find(|j| j.child == joint.parent) {
            if before.motion != ModelMotion::Fixed {
                break;
            }
            reach = at(&before.load_origin) * reach;
            joint = before;
        }
        let reach = reach.rotation.inverse() * reach.translation.vector;
        for effect in &mut file.joints[i].effects {
            if let Some(along) = &mut effect.along {
                *along = reach.into();
            }
        }
    }
}

fn link(name: &str, r: &mut ChaCha8Rng) -> ModelLink {
    let mass_kg = r.random_range(0.5..5.0);
    ModelLink {
        name: name.to_owned(),
        mass_kg,
        first_moment_kg_m: (vector(r, 0.2) * mass_kg).into(),
    }
}

fn effects(
    r: &mut ChaCha8Rng,
    joint: &ModelJoint,
    before: &[String],
    which: Effects,
) -> Vec<ModelEffect> {
    let Some(axis) = joint.axis else {
        return Vec::new();
    };
    let axis = Unit::new_normalize(Vector3::from(axis));
    let axis = match joint.motion {
        ModelMotion::Prismatic => Axis::Prismatic(axis),
        _ => Axis::Revolute(axis),
    };
    let mut out = Vec::new();
    for effect in EFFECTS.iter().filter(|e| e.applies_to(&axis)) {
        for term in effect.terms {
            let by_side = matches!(term.source, Source::Approach | Source::Friction);
            let absent = matches!(term.source, Source::Velocity | Source::Caller)
                || (by_side && which == Effects::Smooth)
                || (term.kind == EffectKind::Coupling && before.is_empty());
            if absent {
                continue;
            }
            let size = match term.source {
                Source::Load => 1e-4,
                Source::OtherJoint => 5e-3,
                Source::Motor => 1e-4,
                _ if effect.id == "friction" => 1e-5,
                _ => 1e-3,
            };
            out.push(ModelEffect {
                kind: term.name.to_owned(),
                formula: term.formula.to_owned(),
                value: match term.source {
                    // Aluminium.
                    Source::Temperature => 2.3e-5,
                    _ => within(r, size),
                },
                unit: String::new(),
                about: match term.drives {
                    Drives::Across(k) => Some(axis.across()[k].into()),
                    _ => None,
                },
                // Known when all joints are there.
                along: (term.drives == Drives::Along).then_some([0.0; 3]),
                other: (term.kind == EffectKind::Coupling)
                    .then(|| before[before.len() - 1].clone()),
                gear_ratio: (term.source == Source::Motor).then_some(50.0),
                friction: (term.source == Source::Friction).then_some(3.0),
                plugin: None,
            });
        }
    }
    out
}

/// Every number of a robot that can be uncertain, each with a σ of its own, correlated at random.
pub fn with_uncertainty(mut file: RobotModelFile, r: &mut ChaCha8Rng) -> RobotModelFile {
    const COLUMNS: usize = 5;
    let mut numbers = Vec::new();
    let mut push = |of: &str, name: &str, number: &str| {
        numbers.push(ModelNumber {
            of: of.to_owned(),
            name: name.to_owned(),
            number: number.to_owned(),
        });
    };
    let coordinates = ["rx", "ry", "rz", "x", "y", "z"];
    coordinates.iter().for_each(|c| push("tracker", "", c));
    for joint in &file.joints {
        coordinates
            .iter()
            .for_each(|c| push("joint", &joint.name, c));
        for effect in &joint.effects {
            let number = match &effect.other {
                Some(other) => format!("coupling:{other}"),
                None => effect.kind.clone(),
            };
            push("joint", &joint.name, &number);
        }
    }
    coordinates.iter().for_each(|c| push("body", "body", c));
    coordinates[3..]
        .iter()
        .for_each(|c| push("point", "tip", c));
    for link in &file.links {
        coordinates[3..]
            .iter()
            .for_each(|c| push("link", &link.name, c));
    }
    let root = numbers
        .iter()
        .map(|_| (0..COLUMNS).map(|_| within(r, 1e-4)).collect());
    let root = root.collect();
    file.uncertainty = Some(ModelUncertainty { numbers, root });
    file
}

/// Readings of all joints that move by themselves.
pub fn posture(r: &mut ChaCha8Rng, n: usize) -> Vec<f64> {
    (0..n).map(|_| within(r, 2.0)).collect()
}
