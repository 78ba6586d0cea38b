//! Poses: against numbers of another program, and what a posture may be.

use calib_model::file::RobotModelFile;
use calib_model::{Model, ModelError, Place, Scope, Under};

use crate::common::{Effects, posture, rng, robot};

const ARM: &str = include_str!("arm.model.json");

fn arm() -> Model {
    Model::from_json(ARM.as_bytes()).expect("a model")
}

/// `tracker_from_body` of `arm.model.json`, computed by book/src/run-time/predict.py (it knows neither this crate nor nalgebra):
/// `python3 predict.py arm.model.json shoulder=A elbow=B` with 15 digits.
const BY_PYTHON: &[([f64; 2], [f64; 3])] = &[
    ([0.0, 0.0], [1.951744842257903, 0.2003, 0.422844541731461]),
    (
        [30.0, -50.0],
        [1.847537932350311, 0.2003, 0.323619125967508],
    ),
    (
        [-80.0, 110.0],
        [1.497730851850084, 0.2003, 0.699965019821336],
    ),
    (
        [57.3, 12.34],
        [1.446419473881378, 0.2003, -0.435438388915002],
    ),
    (
        [-3.0, -100.0],
        [1.374168254434289, 0.2003, 0.856941219961653],
    ),
];

#[test]
fn poses_are_those_of_an_independent_program() {
    let model = arm();
    let mut work = model.work();
    let body = model.place("marker_plate").expect("a body");
    for (deg, expected) in BY_PYTHON {
        let q = deg.map(f64::to_radians);
        model
            .forward(&q, &Under::default(), &mut work)
            .expect("a pose");
        let at = model.tracker_from(body, &work).expect("a place");
        for k in 0..3 {
            assert!((at.t[k] - expected[k]).abs() < 1e-13, "{deg:?}: {}", at.t);
        }
    }
}

#[test]
fn the_file_is_read_back_bit_for_bit() {
    for seed in 0..20 {
        let mut r = rng(seed);
        let file = crate::common::with_uncertainty(robot(&mut r, 7, true, Effects::All), &mut r);
        let text = serde_json::to_string(&file).expect("text");
        let again = RobotModelFile::from_json(text.as_bytes()).expect("a file");
        assert_eq!(again, file);
        assert_eq!(serde_json::to_string(&again).expect("text"), text);
    }
}

#[test]
fn without_effects_and_corrections_it_is_the_nominal_model() {
    let mut r = rng(3);
    for _ in 0..20 {
        let mut file = robot(&mut r, 6, true, Effects::All);
        for joint in &mut file.joints {
            joint.effects.clear();
            joint.parent_from_joint = joint.load_origin;
        }
        let model = Model::new(&file).expect("a model");
        let mut work = model.work();
        let q = posture(&mut r, model.joints().len());
        model
            .forward(&q, &Under::default(), &mut work)
            .expect("poses");
        let own = work.root_from_link(model.last_link());
        model.forward_nominal(&q, &mut work).expect("poses");
        assert_eq!(own, work.root_from_link(model.last_link()));
    }
}

#[test]
fn many_rows_are_each_row() {
    let mut r = rng(4);
    let model = Model::new(&robot(&mut r, 7, false, Effects::All)).expect("a model");
    let mut work = model.work();
    let place = Place::Link(model.last_link());
    let q: Vec<f64> = (0..10).flat_map(|_| posture(&mut r, 7)).collect();
    let mut out = vec![0.0; 120];
    let under = Under::default();
    model
        .forward_many(&q, place, &under, &mut work, &mut out)
        .expect("poses");
    for (q, out) in q.chunks(7).zip(out.chunks(12)) {
        model.forward(q, &under, &mut work).expect("a pose");
        assert_eq!(model.root_from(place, &work).expect("a place").rows(), *out);
    }
    let short = model.forward_many(&q[1..], place, &under, &mut work, &mut out);
    assert!(matches!(short, Err(ModelError::Length { what: "q", .. })));
}

#[test]
fn measured_torques_replace_gravity() {
    let model = arm();
    let mut work = model.work();
    let tool = model.link("tool").expect("a link");
    let q = [0.4, -0.7];
    let at = |held: Option<&[f64]>, work: &mut calib_model::Work| {
        let under = Under {
            approach: &[],
            held,
            temperature_c: &[],
        };
        model.forward(&q, &under, work).expect("a pose");
        work.root_from_link(tool).t
    };
    let gravity = at(None, &mut work);
    let free = at(Some(&[0.0, 0.0]), &mut work);
    // What the joint holds loads it the other way: 10 N m about y at 2e-4 rad/(N m).
    let pushed = at(Some(&[-10.0, 0.0]), &mut work);
    assert!((gravity - free).norm() > 1e-4);
    let arm = (free - work_origin()).norm();
    assert!(((pushed - free).norm() - 10.0 * 2e-4 * arm).abs() < 1e-6);
}

#[test]
fn a_link_grows_with_its_temperature_from_the_reference_on() {
    let mut file = RobotModelFile::from_json(ARM.as_bytes()).expect("a file");
    file.reference_temperature_c = Some(25.0);
    let along = [0.1, -0.2, 0.3];
    let mut effect = file.joints[0].effects[0].clone();
    effect.kind = "thermal_expansion".to_owned();
    (effect.value, effect.about, effect.along) = (2e-5, None, Some(along));
    let joint = file
        .joints
        .iter_mut()
        .find(|j| j.axis.is_some())
        .expect("one");
    joint.effects.push(effect);
    let model = Model::new(&file).expect("a model");
    assert!(model.grows() && !arm().grows());
    let tool = model.link("tool").expect("a link");
    let mut work = model.work();
    let mut at = |temperature_c: &[f64]| {
        let under = Under {
            temperature_c,
            ..Under::default()
        };
        model
            .forward(&[0.4, -0.7], &under, &mut work)
            .expect("a pose");
        work.root_from_link(tool).t
    };
    let (unknown, reference, warm) = (at(&[]), at(&[25.0, 60.0]), at(&[35.0, 60.0]));
    assert_eq!(unknown, reference);
    let grown = calib_model::nalgebra::Vector3::from(along).norm() * 2e-5 * 10.0;
    assert!(((warm - reference).norm() - grown).abs() < 1e-15);
    let short = Under {
        temperature_c: &[25.0],
        ..Under::default()
    };
    let refused = model.forward(&[0.4, -0.7], &short, &mut model.work());
    let named = matches!(&refused, Err(ModelError::Length { what, .. }) if *what == "temperature");
    assert!(named, "{refused:?}");
    // Growth of nothing, or along an axis, is refused.
    let last = |file: &mut RobotModelFile, along, about| {
        let joint = file.joints.iter_mut().find(|j| j.axis.is_some());
        let effect = joint.and_then(|j| j.effects.last_mut()).expect("one");
        (effect.along, effect.about) = (along, about);
    };
    for (along, about) in [(None, None), (Some(along), Some([0.0, 0.0, 1.0]))] {
        last(&mut file, along, about);
        assert!(matches!(Model::new(&file), Err(ModelError::Value { .. })));
    }
}

/// Where the shoulder of the arm is.
fn work_origin() -> calib_model::nalgebra::Vector3<f64> {
    calib_model::nalgebra::Vector3::new(0.001, 0.0, 0.402)
}

#[test]
fn bad_postures_are_refused_and_ranges_are_stated() {
    let model = arm();
    let mut work = model.work();
    let under = Under::default();
    let nan = model.forward(&[f64::NAN, 0.0], &under, &mut work);
    assert_eq!(
        nan,
        Err(ModelError::NotFinite {
            what: "q",
            index: 0
        })
    );
    let short = model.forward(&[0.0], &under, &mut work);
    assert!(matches!(
        short,
        Err(ModelError::Length {
            found: 1,
            expected: 2,
            ..
        })
    ));
    let mut r = rng(1);
    let other = Model::new(&robot(&mut r, 7, false, Effects::All)).expect("a model");
    let foreign = model.forward(&[0.0; 2], &under, &mut other.work());
    assert_eq!(foreign, Err(ModelError::ForeignWork));
    assert_eq!(model.scope(&[0.0, 0.0]), Ok(Scope::Inside));
    assert_eq!(model.scope(&[1.6, 0.0]), Ok(Scope::Outside(0)));
    assert_eq!(model.scope(&[0.0, 2.6]), Ok(Scope::BeyondLimits(1)));
    assert!(matches!(model.link("hand"), Err(ModelError::Name { .. })));
    // Far out, numbers stay numbers.
    model
        .forward(&[1e300, -1e300], &under, &mut work)
        .expect("a pose");
    let tool = work.root_from_link(model.last_link());
    assert!(tool.t.iter().all(|x| x.is_finite()));
}
