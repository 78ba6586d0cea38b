//! Joint effects: good ones give their regressors and pass the conformance check, others are refused, contained or found out.

use std::{collections::BTreeMap, fmt::Write, time::Duration};

use calib_plugin::{
    Call, Coefficient, Control, DependsOn, EffectTerm, Failure, Host, JointEffect, JointStates,
    Kind, Offer, Parameter, PluginError, SearchPath,
    check::{Limits, Outcome, check},
};

use crate::bed::Bed;

const READINGS: [f64; 4] = [0.1, 0.2, 0.3, 1.4];

fn regressors(bed: &Bed, name: &str) -> Result<Vec<f64>, PluginError> {
    let plugin = bed.load(name)?;
    let bound = plugin.effect("third")?.with(&BTreeMap::new())?;
    bound.regressors(&JointStates::of_readings(&READINGS), &Control::default())
}

#[test]
fn an_effect_in_c_says_what_it_is_and_gives_its_regressors() {
    let bed = Bed::new();
    if bed.build("tests/c/effect.c", "good", &[]).is_none() {
        return;
    }
    let found = regressors(&bed, "good").unwrap();
    assert_eq!(found, READINGS.map(|q| (3.0 * q).sin()));
    let plugin = bed.load("good").unwrap();
    let expected = EffectTerm {
        depends_on: DependsOn::Reading,
        coefficient: Coefficient::Position,
        prior_sigma: 0.0087,
        revolute_only: true,
    };
    assert_eq!(plugin.effect("third").unwrap().term(), expected);
}

#[test]
fn bad_effects_are_refused_or_contained() {
    let bed = Bed::new();
    let mut table = String::new();
    for deed in [
        // refused when loaded
        "BAD_SOURCE",
        "BAD_COEFFICIENT",
        "NO_PRIOR",
        "NO_FUNCTION",
        // contained when called
        "NOT_A_NUMBER",
        "WRONG_LENGTH",
        "NOT_OBSERVABLE",
        "SAYS_NOTHING",
        "FAILS_AT_LARGE",
    ] {
        if bed.build("tests/c/effect.c", deed, &[deed]).is_none() {
            return;
        }
        let error = regressors(&bed, deed).expect_err(deed);
        assert_eq!(error.exit_code(), 6, "{deed}");
        let _ = writeln!(table, "{deed}\n    {}", bed.tidy(&error));
    }
    insta::assert_snapshot!(table);
}

#[test]
fn the_check_finds_effects_that_are_no_function_of_one_state() {
    let limits = Limits {
        huge: 20_000,
        call: Duration::from_secs(3),
        cancel: Duration::from_secs(1),
        ..Limits::default()
    };
    let bed = Bed::new();
    for (deed, test) in [
        ("GOOD", ""),
        ("ON_MOTOR", ""),
        ("ON_LOAD", ""),
        ("ON_APPROACH", ""),
        ("NOT_A_NUMBER", "golden cases"),
        ("BY_ORDER", "golden cases"),
        ("JUMPS", "without jumps"),
        ("STEPS_ONCE", "without jumps"),
        ("WRAPS", "without jumps"),
        ("STEEP", ""),
        ("BY_SIGN_OF_LOAD", ""),
        ("LESS_THE_MEAN", "of one state alone"),
    ] {
        if bed.build("tests/c/effect.c", deed, &[deed]).is_none() {
            return;
        }
        let search = SearchPath {
            environment: vec![bed.path().to_path_buf()],
            ..SearchPath::default()
        };
        let table = check(&Host::new(search, true), deed, &limits);
        let failed = table.rows.iter().filter(|r| r.outcome == Outcome::Failed);
        let failed: Vec<&str> = failed.map(|row| row.test.as_str()).collect();
        let first = failed.first().copied().unwrap_or_default();
        assert_eq!(first, test, "{deed}\n{table}");
    }
}

/// Answers with numbers made from everything that it is given.
struct Everything;

impl JointEffect for Everything {
    fn offer(&self) -> Offer {
        Offer::new(Kind::Effect, "everything", "uses every input")
            .with(Parameter::number("gain", 0.5, "a number"))
    }

    fn term(&self) -> EffectTerm {
        EffectTerm {
            depends_on: DependsOn::Approach,
            coefficient: Coefficient::Ratio,
            prior_sigma: 0.25,
            revolute_only: false,
        }
    }

    fn regressors(&self, states: &JointStates<'_>, call: &Call<'_>) -> Result<Vec<f64>, Failure> {
        let gain = call.number("gain")?;
        let sum = |s: usize| {
            let more = [states.motor_rad, states.loads, states.approaches];
            let more: f64 = more.iter().filter_map(|v| v.get(s)).sum();
            gain * states.readings[s] + more + f64::from(u8::from(states.prismatic))
        };
        Ok((0..states.samples()).map(sum).collect())
    }
}

calib_plugin::entry! {
    everything:
    name: "everything",
    version: "1.0.0",
    author: "a test",
    licence: "MIT",
    effect: [Everything],
}

#[test]
fn an_effect_in_rust_is_the_same_across_the_border() {
    let plugin = Host::adopt(&everything::ENTRY).unwrap();
    let entry = plugin.effect("everything").unwrap();
    assert_eq!(entry.term(), Everything.term());
    let states = JointStates {
        prismatic: true,
        readings: &[1.0, 2.0],
        motor_rad: &[],
        loads: &[],
        approaches: &[1.0, -1.0],
    };
    let bound = entry.with(&BTreeMap::new()).unwrap();
    let found = bound.regressors(&states, &Control::default()).unwrap();
    assert_eq!(found, [2.5, 1.0]);
    // What a plugin would trust is refused before it is called.
    let short = JointStates {
        approaches: &[1.0],
        ..states
    };
    let refused = bound.regressors(&short, &Control::default()).unwrap_err();
    assert!(
        refused.to_string().contains("1 approaches for 2 samples"),
        "{refused}"
    );
}
