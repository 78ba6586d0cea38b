//! Plugins that misbehave are refused or contained, with a message that says what was found.

use std::{collections::BTreeMap, fmt::Write, time::Duration};

use calib_plugin::{Answer, Cancel, Control, MotionData, PluginError, ReportInput, Source};

use crate::bed::{Bed, cubes, turning};

fn no_parameters() -> BTreeMap<String, calib_plugin::Value> {
    BTreeMap::new()
}

fn fit(bed: &Bed, name: &str) -> Result<Answer<calib_plugin::CorFit>, PluginError> {
    let plugin = bed.load(name)?;
    plugin
        .cor("mean")?
        .with(&no_parameters())?
        .fit(&cubes().view(), &Control::default())
}

#[test]
fn a_good_one_answers() {
    let bed = Bed::new();
    if bed.build("tests/c/cor.c", "good", &[]).is_none() {
        return;
    }
    let Answer::Found(fit) = fit(&bed, "good").unwrap() else {
        panic!("an answer")
    };
    assert!(
        fit.center_m
            .iter()
            .zip([1.0, 2.0, 3.0])
            .all(|(a, b)| (a - b).abs() < 1e-12)
    );
    assert_eq!((fit.used, fit.radii_m.len()), (8, 2));
}

#[test]
fn bad_center_estimators_are_refused_or_contained() {
    let bed = Bed::new();
    let mut table = String::new();
    for deed in [
        // refused when loaded
        "WRONG_ABI",
        "NO_SYMBOL",
        "SHORT_ENTRY",
        "SHORT_DESCRIPTOR",
        "NO_DESCRIPTION",
        "BAD_COUNT",
        "BAD_NAME",
        "NOT_UTF8",
        "BAD_DEFAULT",
        "OFFERS_TWICE",
        "NOT_FOUND",
        "NO_FUNCTION",
        // contained when called
        "PANICS",
        "SAYS_NOTHING",
        "NOT_A_NUMBER",
        "WRONG_LENGTH",
        "WRONG_REJECTED",
        "BAD_COVARIANCE",
        "SHORT_RESULT",
        "NOWHERE",
        "TWICE",
        "NO_RESULT",
        "UNKNOWN_STATUS",
        "HALF",
    ] {
        if bed.build("tests/c/cor.c", deed, &[deed]).is_none() {
            return;
        }
        let error = fit(&bed, deed).expect_err(deed);
        assert_eq!(error.exit_code(), 6, "{deed}");
        let _ = writeln!(table, "{deed}\n    {}", bed.tidy(&error));
    }
    insta::assert_snapshot!(table);
}

#[test]
fn other_bad_kinds_are_contained() {
    let bed = Bed::new();
    let mut table = String::new();
    for deed in [
        "GOOD",
        "NOT_UNIT",
        "NOT_A_NUMBER",
        "SCALED",
        "MIRRORED",
        "MEASURED_NAN",
        "BAD_MASK",
        "WRONG_LENGTH",
        "NO_TIMELINE",
        "TIME_BACK",
        "BAD_UNIT",
        "NO_NAME",
        "NOT_UTF8",
        "NULL_NAME",
        "SAME_NAME",
        "NOT_OBSERVABLE",
        "ESCAPES",
        "ABSOLUTE",
        "NO_FILE",
        "SAME_FILE",
    ] {
        if bed.build("tests/c/others.c", deed, &[deed]).is_none() {
            return;
        }
        let plugin = bed.load(deed).unwrap();
        let control = Control::default();
        let axis = plugin.aor("up").unwrap().with(&no_parameters()).unwrap();
        let reader = plugin
            .reader("two")
            .unwrap()
            .with(&no_parameters())
            .unwrap();
        let writer = plugin
            .report("copy")
            .unwrap()
            .with(&no_parameters())
            .unwrap();
        let errors = [
            axis.fit(&MotionData::poses(&turning()).view(), &control)
                .err(),
            reader
                .read(
                    &Source {
                        name: "x.txt",
                        bytes: b"ok",
                    },
                    &control,
                )
                .err(),
            writer
                .write(
                    &ReportInput {
                        report_json: b"{}",
                        scene_json: None,
                    },
                    &control,
                )
                .err(),
        ];
        let errors: Vec<_> = errors.into_iter().flatten().collect();
        assert_eq!(
            errors.len(),
            usize::from(deed != "GOOD"),
            "{deed}: {errors:?}"
        );
        for error in errors {
            assert_eq!(error.exit_code(), 6, "{deed}");
            let _ = writeln!(table, "{deed}\n    {error}");
        }
        let empty = reader
            .read(
                &Source {
                    name: "x.txt",
                    bytes: b"",
                },
                &control,
            )
            .unwrap_err();
        assert_eq!(
            empty.to_string(),
            "plugin `others`, reader `two`: line 1: the file is empty"
        );
        assert_eq!(empty.exit_code(), 3);
    }
    insta::assert_snapshot!(table);
}

#[test]
fn one_that_hangs_stops_when_cancelled() {
    let bed = Bed::new();
    if bed.build("tests/c/cor.c", "hangs", &["HANGS"]).is_none() {
        return;
    }
    let cancel = Cancel::new();
    let from_outside = cancel.clone();
    let seen = std::sync::Mutex::new(Vec::new());
    let progress = |fraction: f64, text: &str| {
        seen.lock().unwrap().push((fraction, text.to_string()));
    };
    let stopper = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(50));
        from_outside.cancel();
    });
    let plugin = bed.load("hangs").unwrap();
    let control = Control {
        cancel: Some(&cancel),
        progress: Some(&progress),
    };
    let error = plugin
        .cor("mean")
        .unwrap()
        .with(&no_parameters())
        .unwrap()
        .fit(&cubes().view(), &control)
        .unwrap_err();
    stopper.join().unwrap();
    assert!(error.is_cancelled());
    assert_eq!(
        error.to_string(),
        "plugin `bad`, center estimator `mean`: cancelled"
    );
    assert_eq!(seen.lock().unwrap()[0], (0.5, "waiting".to_string()));
}

#[test]
fn a_progress_function_that_panics_does_not_cross_the_plugin() {
    let bed = Bed::new();
    if bed.build("tests/c/cor.c", "tells", &["HANGS"]).is_none() {
        return;
    }
    let cancel = Cancel::new();
    let inner = cancel.clone();
    let progress = move |_: f64, _: &str| {
        inner.cancel();
        panic!("the caller's own fault");
    };
    let plugin = bed.load("tells").unwrap();
    let control = Control {
        cancel: Some(&cancel),
        progress: Some(&progress),
    };
    let bound = plugin.cor("mean").unwrap().with(&no_parameters()).unwrap();
    assert!(
        bound
            .fit(&cubes().view(), &control)
            .unwrap_err()
            .is_cancelled()
    );
}

#[test]
fn a_long_text_is_cut_and_a_weak_answer_keeps_its_reason() {
    let bed = Bed::new();
    if bed.build("tests/c/cor.c", "long", &["LONG_TEXT"]).is_none() {
        return;
    }
    let message = fit(&bed, "long").unwrap_err().to_string();
    assert_eq!(message.matches('x').count(), 2047);
    bed.build("tests/c/cor.c", "weak", &["WEAK"]).unwrap();
    let Answer::Found(weak) = fit(&bed, "weak").unwrap() else {
        panic!("an answer")
    };
    assert_eq!(weak.weak.as_deref(), Some("a mean is a weak center"));
}

#[test]
fn data_that_break_the_contract_never_reach_a_plugin() {
    let bed = Bed::new();
    if bed.build("tests/c/cor.c", "good", &[]).is_none() {
        return;
    }
    let plugin = bed.load("good").unwrap();
    let bound = plugin.cor("mean").unwrap().with(&no_parameters()).unwrap();
    let control = Control::default();
    let said = |data: &calib_plugin::Motion<'_>| bound.fit(data, &control).unwrap_err().to_string();

    let nan = MotionData::points(&[vec![Some([0.0; 3]), Some([0.0, f64::NAN, 0.0])]]);
    assert_eq!(
        said(&nan.view()),
        "plugin `bad`, center estimator `mean`: track 0, sample 1: not a finite number"
    );
    let cubes = cubes();
    let mut short = cubes.view();
    short.points_m = &short.points_m[1..];
    assert_eq!(
        said(&short),
        "plugin `bad`, center estimator `mean`: points_m has 15 rows, needs 16"
    );
    let poses = MotionData::poses(&turning());
    assert_eq!(
        said(&poses.view()),
        "plugin `bad`, center estimator `mean` takes points, got poses"
    );
}

#[test]
fn an_exception_that_is_caught_in_cpp_is_an_error_with_the_plugin_s_name() {
    let bed = Bed::new();
    if bed.build("tests/c/throws.cc", "cpp", &[]).is_none() {
        return;
    }
    assert!(matches!(fit(&bed, "cpp").unwrap(), Answer::Found(_)));
    let plugin = bed.load("cpp").unwrap();
    let bound = plugin.cor("mean").unwrap().with(&no_parameters()).unwrap();
    let error = bound
        .fit(
            &MotionData::points(&[vec![None; 3]]).view(),
            &Control::default(),
        )
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "plugin `cpp`, center estimator `mean`: panicked: std::out_of_range"
    );
    assert_eq!(error.exit_code(), 6);
}
