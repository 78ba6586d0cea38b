//! Files that are wrong: refused with the place, never computed with.

use calib_model::{Model, ModelError, Under};
use rand::RngExt as _;
use serde_json::Value;

use crate::common::{Effects, posture, rng, robot, with_uncertainty};

const ARM: &str = include_str!("arm.model.json");

fn read(value: &Value) -> Result<Model, ModelError> {
    Model::from_json(value.to_string().as_bytes())
}

/// What stands at a pointer is replaced.
fn with(pointer: &str, by: Value) -> Result<Model, ModelError> {
    let mut value: Value = serde_json::from_str(ARM).expect("JSON");
    *value.pointer_mut(pointer).expect(pointer) = by;
    read(&value)
}

#[test]
fn what_is_wrong_is_named_with_its_place() {
    let cases: &[(&str, Value, &str)] = &[
        (
            "/calib_model",
            2.into(),
            "calib_model: version 2; this program reads version 1",
        ),
        (
            "/joints/0/axis",
            serde_json::json!([0, 2, 0]),
            "joints[0].axis: found 2; expected a vector of length 1",
        ),
        ("/joints/0/axis", Value::Null, "joints[0].axis: found null"),
        (
            "/joints/1/parent",
            "hand".into(),
            "joints[1].parent: found hand; expected the root or the child of a joint before",
        ),
        (
            "/joints/1/child",
            "upper".into(),
            "joints[1].child: found upper",
        ),
        (
            "/joints/1/name",
            "shoulder".into(),
            "joints[1].name: found shoulder",
        ),
        (
            "/joints/1/parent_from_joint/quat_xyzw",
            serde_json::json!([0, 0, 0, 0]),
            "joints[1].parent_from_joint.quat_xyzw: found 0",
        ),
        (
            "/joints/1/parent_from_joint/xyz_m/0",
            1e300.into(),
            "joints[1].parent_from_joint.xyz_m",
        ),
        (
            "/joints/0/effects/1/kind",
            "warp".into(),
            "joints[0].effects[1].kind: found warp",
        ),
        (
            "/joints/0/effects/1/kind",
            "clock_offset".into(),
            "joints[0].effects[1].kind: found clock_offset",
        ),
        (
            "/joints/0/effects/2/about",
            Value::Null,
            "joints[0].effects[2].about: found null",
        ),
        (
            "/joints/0/effects/1/about",
            serde_json::json!([1, 0, 0]),
            "joints[0].effects[1].about",
        ),
        (
            "/joints/1/effects/3/other",
            "wrist".into(),
            "joints[1].effects[3].other: found wrist",
        ),
        (
            "/joints/1/effects/3/other",
            "flange".into(),
            "joints[1].effects[3].other: found flange",
        ),
        (
            "/joints/1/limits",
            serde_json::json!([1, -1]),
            "joints[1].limits",
        ),
        (
            "/links/1/mass_kg",
            (-1).into(),
            "links[1].mass_kg: found -1",
        ),
        ("/links/1/name", "hand".into(), "links[1].name: found hand"),
        (
            "/links/1/name",
            "base".into(),
            "links[1].name: found base; expected a name that no link before has",
        ),
        (
            "/bodies/marker_plate/link",
            "hand".into(),
            "bodies.marker_plate.link: found hand",
        ),
        (
            "/uncertainty/numbers/0/number",
            "gain".into(),
            "uncertainty.numbers[0].number: found gain",
        ),
        (
            "/uncertainty/root/2",
            serde_json::json!([1.0]),
            "uncertainty.root[2]: found 1 numbers",
        ),
        ("/gravity_m_s2", serde_json::json!([0, 0]), "line 1, column"),
        ("/loads", "held".into(), "line 1, column"),
    ];
    for (pointer, by, expected) in cases {
        let said = with(pointer, by.clone()).expect_err(pointer).to_string();
        assert!(said.starts_with(expected), "{pointer}: {said}");
    }
    let depth = "[".repeat(100_000);
    assert!(matches!(
        Model::from_json(depth.as_bytes()),
        Err(ModelError::Syntax { .. })
    ));
    assert!(Model::from_json(b"").is_err() && Model::from_json(&[0xff, 0xfe]).is_err());
}

/// Of two bodies or points under one name one would be lost: the line and the name are said.
#[test]
fn a_name_that_stands_twice_is_refused() {
    for (list, entry) in [
        (
            "bodies",
            r#""plate": {"link": "forearm", "link_from_body": {"xyz_m": [0, 0, 0], "quat_xyzw": [0, 0, 0, 1]}, "markers_m": {}}"#,
        ),
        (
            "points",
            r#""plate": {"link": "forearm", "xyz_m": [0, 0, 0]}"#,
        ),
    ] {
        let mut value: Value = serde_json::from_str(ARM).expect("JSON");
        let place = value.pointer_mut(&format!("/{list}")).expect("a map");
        *place = "HERE".into();
        let once = value
            .to_string()
            .replace("\"HERE\"", &format!("{{{entry}}}"));
        let twice = value
            .to_string()
            .replace("\"HERE\"", &format!("{{{entry},\n{entry}}}"));
        let once = Model::from_json(once.as_bytes());
        assert!(
            !matches!(once, Err(ModelError::Syntax { .. })),
            "{list}: {once:?}"
        );
        let said = Model::from_json(twice.as_bytes())
            .expect_err(list)
            .to_string();
        assert!(said.starts_with("line 2, column "), "{list}: {said}");
        assert!(
            said.contains("the name `plate` stands twice"),
            "{list}: {said}"
        );
    }
}

#[test]
fn too_many_joints_are_refused_before_memory_is_taken() {
    let mut r = rng(1);
    let file = robot(&mut r, 501, false, Effects::Smooth);
    let said = Model::new(&file).expect_err("501 joints").to_string();
    assert_eq!(said, "joints: found 501; expected at most 500 joints");
}

/// Every number, text and list replaced in turn by what nobody expects: an error with its place, or finite poses.
#[test]
fn no_file_gives_a_panic_or_a_pose_that_is_not_finite() {
    let mut r = rng(2);
    let file = with_uncertainty(robot(&mut r, 4, true, Effects::All), &mut r);
    let good = serde_json::to_value(&file).expect("JSON");
    let mut pointers = Vec::new();
    fn walk(value: &Value, at: String, out: &mut Vec<String>) {
        match value {
            Value::Object(map) => map
                .iter()
                .for_each(|(k, v)| walk(v, format!("{at}/{k}"), out)),
            Value::Array(list) => {
                list.iter()
                    .enumerate()
                    .for_each(|(k, v)| walk(v, format!("{at}/{k}"), out));
            }
            _ => {}
        }
        out.push(at);
    }
    walk(&good, String::new(), &mut pointers);
    // Rows of the covariance are alike.
    pointers
        .retain(|p| !p.starts_with("/uncertainty/root/") || p.starts_with("/uncertainty/root/1"));
    let bad = [
        Value::Null,
        (-1).into(),
        1e308.into(),
        0.into(),
        "x".into(),
        serde_json::json!([]),
        serde_json::json!({}),
    ];
    let mut read_anyway = 0;
    for pointer in &pointers {
        let by = &bad[r.random_range(0..bad.len())];
        let mut value = good.clone();
        *value.pointer_mut(pointer).expect("there") = by.clone();
        let Ok(model) = read(&value) else { continue };
        read_anyway += 1;
        let mut work = model.work();
        let q = posture(&mut r, model.joints().len());
        model
            .forward(&q, &Under::default(), &mut work)
            .expect("poses");
        let end = work.root_from_link(model.last_link());
        assert!(
            end.t.iter().chain(end.r.iter()).all(|x| x.is_finite()),
            "{pointer} = {by}"
        );
    }
    assert!(
        pointers.len() > 300 && read_anyway > 20,
        "{} {read_anyway}",
        pointers.len()
    );
    let text = good.to_string();
    for end in (0..text.len()).step_by(211) {
        assert!(Model::from_json(&text.as_bytes()[..end]).is_err());
    }
}
