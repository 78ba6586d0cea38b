//! Parameters of a profile against an offer.

use std::collections::BTreeMap;

use calib_plugin::{Parameter, Value, schema, validate};

fn parameters() -> Vec<Parameter> {
    vec![
        Parameter::number("gate_mm", 3.0, "distance").between(0.0, f64::INFINITY),
        Parameter::integer("rounds", 10, "rounds").between(1.0, 100.0),
        Parameter::flag("robust", false, "robust"),
        Parameter::text("columns", "t_s, x", "layout").required(),
        Parameter::text("unit", "mm", "unit").one_of(&["mm", "m"]),
    ]
}

fn said(given: &[(&str, Value)]) -> Result<Vec<Value>, String> {
    let given: BTreeMap<_, _> = given
        .iter()
        .map(|(k, v)| (k.to_string(), v.clone()))
        .collect();
    validate(&parameters(), &given).map_err(|error| error.to_string())
}

fn layout() -> (&'static str, Value) {
    ("columns", Value::Text("a".into()))
}

#[test]
fn defaults_fill_what_is_not_given() {
    assert_eq!(
        said(&[layout(), ("gate_mm", Value::Integer(2))]).unwrap(),
        [
            Value::Number(2.0),
            Value::Integer(10),
            Value::Bool(false),
            Value::Text("a".into()),
            Value::Text("mm".into()),
        ]
    );
}

#[test]
fn every_wrong_parameter_says_what_would_be_right() {
    let messages: Vec<String> = [
        vec![],
        vec![layout(), ("gate", Value::Number(1.0))],
        vec![layout(), ("gate_mm", Value::Number(-1.0))],
        vec![layout(), ("gate_mm", Value::Number(f64::NAN))],
        vec![layout(), ("rounds", Value::Number(1.5))],
        vec![layout(), ("rounds", Value::Integer(101))],
        vec![layout(), ("robust", Value::Text("yes".into()))],
        vec![layout(), ("unit", Value::Text("inch".into()))],
        vec![("columns", Value::Text("a\0b".into()))],
    ]
    .iter()
    .map(|given| said(given).unwrap_err())
    .collect();
    insta::assert_snapshot!(messages.join("\n"));
}

#[test]
fn an_offer_without_parameters_takes_none() {
    let given = BTreeMap::from([("gate".to_string(), Value::Bool(true))]);
    let error = validate(&[], &given).unwrap_err();
    assert_eq!(error.to_string(), "unknown parameter `gate`, expected none");
}

#[test]
fn the_schema_says_the_same() {
    insta::assert_json_snapshot!(schema(&parameters()));
}
