//! The file of the calibrated robot, evaluated by its own formulas: what the program predicts, and how uncertain that is.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;

use calib_core::Configuration;
use calib_model::file::{ModelMotion, ModelNumber, ModelPose, RobotModelFile};
use calib_pipeline::formulate::kinematics::joint_state;
use calib_pipeline::options::Plugins;
use calib_pipeline::prepare::conditions::Conditions;
use calib_pipeline::prepare::load::load_recordings;
use calib_pipeline::prepare::load::load_robot;
use calib_pipeline::run::{RunOptions, RunOutput, run_on};
use nalgebra::{DMatrix, Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};

fn isometry(pose: &ModelPose) -> Isometry3<f64> {
    let [x, y, z, w] = pose.quat_xyzw;
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(Vector3::from(pose.xyz_m)), turn)
}

fn turned(by: Vector3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::identity(),
        UnitQuaternion::from_scaled_axis(by),
    )
}

/// Poses of all links in the root's frame by equations (1) to (3) of the format, with every joint in the middle of its backlash.
fn links(file: &RobotModelFile, q: &BTreeMap<&str, f64>) -> BTreeMap<String, Isometry3<f64>> {
    let reading = |name: &str| -> f64 {
        let joint = file.joints.iter().find(|j| j.name == name).expect("known");
        match &joint.mimic {
            Some(m) => m.multiplier * q[m.joint.as_str()] + m.offset,
            None => q.get(name).copied().unwrap_or(0.0),
        }
    };
    let walk = |loads: Option<&BTreeMap<&str, Vector3<f64>>>| {
        let mut at = BTreeMap::from([(file.root.clone(), Isometry3::identity())]);
        for joint in &file.joints {
            let origin = match loads {
                None => &joint.load_origin,
                Some(_) => &joint.parent_from_joint,
            };
            let mut pose = at[&joint.parent] * isometry(origin);
            if let Some(axis) = joint.axis.map(Vector3::from) {
                let r = reading(&joint.name);
                let (mut phi, mut theta) = (r, Vector3::zeros());
                for effect in joint.effects.iter().filter(|_| loads.is_some()) {
                    let load = loads.map_or_else(Vector3::zeros, |l| l[joint.name.as_str()]);
                    // The axes across turn with the joint.
                    let in_child = UnitQuaternion::from_scaled_axis(axis * r).inverse() * load;
                    let factor = match effect.kind.as_str() {
                        "offset" => 1.0,
                        "gain" => r,
                        "eccentricity_cos" => r.cos() - 1.0,
                        "eccentricity_sin" => r.sin(),
                        "compliance" => load.dot(&axis),
                        "lateral_1" | "lateral_2" => {
                            in_child.dot(&Vector3::from(effect.about.expect("across")))
                        }
                        "backlash" => 0.0,
                        other => panic!("{other}"),
                    };
                    match effect.about {
                        Some(about) => theta += Vector3::from(about) * factor * effect.value,
                        None => phi += factor * effect.value,
                    }
                }
                pose *= match joint.motion {
                    ModelMotion::Prismatic => Isometry3::from(Translation3::from(axis * phi)),
                    _ => turned(axis * phi),
                };
                pose *= turned(theta);
            }
            at.insert(joint.child.clone(), pose);
        }
        at
    };
    let nominal = walk(None);
    let mut loads = BTreeMap::new();
    for joint in &file.joints {
        let frame = nominal[&joint.parent] * isometry(&joint.load_origin);
        let (mut mass, mut moment) = (0.0, Vector3::zeros());
        for link in &file.links {
            let mut above = Some(&link.name);
            let carried = loop {
                let Some(name) = above else { break false };
                let Some(by) = file.joints.iter().find(|j| j.child == *name) else {
                    break false;
                };
                if by.name == joint.name {
                    break true;
                }
                above = Some(&by.parent);
            };
            if carried {
                let pose = &nominal[&link.name];
                mass += link.mass_kg;
                moment += pose.rotation * Vector3::from(link.first_moment_kg_m)
                    + pose.translation.vector * link.mass_kg;
            }
        }
        let about = moment - frame.translation.vector * mass;
        let torque = about.cross(&Vector3::from(file.gravity_m_s2));
        loads.insert(joint.name.as_str(), frame.rotation.inverse() * torque);
    }
    walk(Some(&loads))
}

fn body(file: &RobotModelFile, body: &str, q: &BTreeMap<&str, f64>) -> Isometry3<f64> {
    let of = &file.bodies[body];
    let mount = of.link_from_body.as_ref().expect("a frame");
    isometry(&file.tracker_from_root) * links(file, q)[&of.link] * isometry(mount)
}

/// The file with one of its uncertain numbers changed.
fn moved(file: &RobotModelFile, number: &ModelNumber, by: f64) -> RobotModelFile {
    let mut out = file.clone();
    let axis = ["rx", "ry", "rz", "x", "y", "z"]
        .iter()
        .position(|n| *n == number.number);
    let turn = |pose: &mut ModelPose| {
        let k = axis.expect("of a pose");
        let v = Vector3::ith(k % 3, by);
        let change = match k {
            0..3 => turned(v),
            _ => Isometry3::from(Translation3::from(v)),
        };
        let new = isometry(pose) * change;
        let r = new.rotation.coords;
        *pose = ModelPose {
            xyz_m: new.translation.vector.into(),
            quat_xyzw: [r.x, r.y, r.z, r.w],
        };
    };
    match (number.of.as_str(), axis) {
        ("tracker", _) => turn(&mut out.tracker_from_root),
        ("body", _) => {
            let body = out.bodies.get_mut(&number.name).expect("known");
            turn(body.link_from_body.as_mut().expect("a frame"));
        }
        ("joint", place) => {
            let joint = out.joints.iter_mut().find(|j| j.name == number.name);
            let joint = joint.expect("known");
            match place {
                Some(_) => turn(&mut joint.parent_from_joint),
                None => {
                    let mut effects = joint.effects.iter_mut();
                    let effect = effects.find(|e| e.kind == number.number);
                    effect.expect("an effect").value += by;
                }
            }
        }
        ("link", Some(k)) => {
            let link = out.links.iter_mut().find(|l| l.name == number.name);
            link.expect("known").first_moment_kg_m[k - 3] += by;
        }
        _ => {}
    }
    out
}

type Ran = (RunOutput, calib_pipeline::prepare::inputs::Inputs);

/// A run of a shipped robot, made once.
fn ran(robot: &str) -> &'static Ran {
    static RIPLEY: OnceLock<Ran> = OnceLock::new();
    static JUSTIN: OnceLock<Ran> = OnceLock::new();
    match robot {
        "ripley" => RIPLEY.get_or_init(|| run_of(robot)),
        _ => JUSTIN.get_or_init(|| run_of(robot)),
    }
}

fn run_of(robot: &str) -> Ran {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../robots/{robot}.yaml"));
    let profile = load_robot(&path).expect("shipped");
    let inputs = load_recordings(profile, Plugins::Refused).expect("shipped");
    let output = run_on(inputs.clone(), &RunOptions::default(), &mut |_| {}).expect("a result");
    (output, inputs)
}

fn file(output: &RunOutput) -> RobotModelFile {
    let mut files = output.files.iter();
    let file = files.find(|f| f.name.ends_with(".model.json"));
    let file = file.expect("written");
    let value: serde_json::Value = serde_json::from_slice(&file.bytes).expect("JSON");
    let validator = jsonschema::validator_for(&calib_report::model_schema()).expect("a schema");
    assert!(validator.is_valid(&value));
    serde_json::from_value(value).expect("a model")
}

#[test]
fn the_file_predicts_what_the_program_predicts() {
    /// Rounding of a chain of a dozen rotations.
    const SAME: f64 = 1e-12;
    for robot in ["ripley", "justin"] {
        let (output, inputs) = ran(robot);
        let file = file(output);
        let found = &output.solved.robot;
        let effects: usize = file.joints.iter().map(|j| j.effects.len()).sum();
        assert!(effects > 0, "{robot}");
        for loaded in inputs.recordings.values() {
            for q in loaded.q.iter().flatten().step_by(17) {
                let named = found
                    .model
                    .joint_ids()
                    .map(|j| (found.model.joint(j).name.as_str(), q[j.index()]));
                let here = links(&file, &named.collect());
                let there = found.root_from_link(q);
                for link in found.model.link_ids() {
                    let off = here[&found.model.link(link).name].inverse() * there[link.index()];
                    let off = off.translation.vector.norm() + off.rotation.angle();
                    assert!(off < SAME, "{robot}: {off:e}");
                }
            }
        }
    }
}

#[test]
fn its_uncertainty_is_that_of_the_fit() {
    /// Differences, and the noise's memory that the fit's own covariance has too.
    const SAME: f64 = 1e-3;
    for robot in ["ripley", "justin"] {
        let (output, inputs) = ran(robot);
        let file = file(output);
        let fit = output.solved.fit.as_ref().expect("by likelihood");
        let model = &inputs.robot.model;
        let uncertainty = file.uncertainty.as_ref().expect("stated");
        let columns = uncertainty.root[0].len();
        let rows = uncertainty.root.iter().flatten().copied();
        let root = DMatrix::from_row_iterator(uncertainty.numbers.len(), columns, rows);
        let loaded = inputs.recordings.values().next().expect("a recording");
        let q = loaded.q[loaded.q.len() / 3].as_ref().expect("recorded");
        let loads = output.solved.robot.masses.at(q);
        let mut at = Configuration::zero();
        for joint in model.joint_ids() {
            if let Some(edge) = fit.formulation.joints[joint.index()] {
                let state = joint_state(model, joint, q, &loads, &Conditions::default());
                at = at.at(edge, &state);
            }
        }
        let named: BTreeMap<&str, f64> = model
            .joint_ids()
            .map(|j| (model.joint(j).name.as_str(), q[j.index()]))
            .collect();
        for (name, frame) in &fit.formulation.bodies {
            let stated = fit
                .solution
                .relative_pose(fit.formulation.tracker, *frame, &at);
            let stated = stated.expect("a pose");
            let Some(covariance) = stated.covariance else {
                continue;
            };
            let base = body(&file, name, &named);
            let mut jacobian = DMatrix::zeros(3, uncertainty.numbers.len());
            for (column, number) in uncertainty.numbers.iter().enumerate() {
                const STEP: f64 = 1e-6;
                let place = |by: f64| {
                    let pose = body(&moved(&file, number, by), name, &named);
                    (base.inverse() * pose).translation.vector
                };
                let slope = (place(STEP) - place(-STEP)) / (2.0 * STEP);
                jacobian.set_column(column, &slope);
            }
            let spread = &jacobian * &root;
            let own: Matrix3<f64> = (&spread * spread.transpose())
                .fixed_view::<3, 3>(0, 0)
                .into();
            let expected = covariance.fixed_view::<3, 3>(3, 3);
            let off = (own - expected).norm() / expected.norm();
            assert!(off < SAME, "{robot} {name}: {off:e}\n{own}\n{expected}");
        }
    }
}
