//! Estimators of plugins in the studies: one that does what a built-in one does has its figures.

use calib_aor::Input as AxisInput;
use calib_cor::{Input, Options};
use calib_plugin::{
    Answer, AorFit, AxisLine, ByFn, Call, CorFit, Entry, Failure, Kind, Motion, Offer, Origin,
    Shape, Tables,
};
use calib_study::{Cell, Study, StudyError, StudyOptions, Tried, markdown, run, run_with};
use nalgebra::{Matrix3, Point3};

fn origin() -> Origin {
    Origin::Plugin {
        plugin: "mine".to_owned(),
        version: "1.2".to_owned(),
        path: None,
        sha256: None,
    }
}

fn tracks(motion: &Motion<'_>) -> Vec<Vec<Option<Point3<f64>>>> {
    let point = |p: Option<[f64; 3]>| p.map(Point3::from);
    (0..motion.tracks)
        .map(|t| motion.points(t).map(point).collect())
        .collect()
}

/// Kåsa's sphere through the contract, and the bundle of the hinge.
fn tables() -> Tables {
    let center = |motion: &Motion<'_>, _: &Call<'_>| -> Result<Answer<CorFit>, Failure> {
        let tracks = tracks(motion);
        let info = calib_cor::estimators().iter().find(|e| e.id == "kasa");
        let outcome = info
            .expect("in the table")
            .run(&Input::Points(&tracks), &Options::default())
            .map_err(|e| Failure::Failed(e.to_string()))?;
        let weak = (!outcome.is_observable()).then(|| "weak".to_owned());
        let Some(e) = outcome.estimate() else {
            return Ok(Answer::NotObservable("none".to_owned()));
        };
        let c: &Matrix3<f64> = &e.covariance;
        Ok(Answer::Found(CorFit {
            center_m: e.center.coords.into(),
            covariance_m2: Some(std::array::from_fn(|i| std::array::from_fn(|j| c[(i, j)]))),
            body_points_m: vec![],
            radii_m: vec![],
            rms_m: 0.0,
            used: 1,
            rejected: vec![],
            weak,
        }))
    };
    let axis = |motion: &Motion<'_>, _: &Call<'_>| -> Result<Answer<AorFit>, Failure> {
        let tracks = tracks(motion);
        let info = calib_aor::estimators().iter();
        let mut info = info.filter(|e| e.id == "hinge_bundle");
        let outcome = info
            .next()
            .expect("in the table")
            .run(&AxisInput::Markers(&tracks), &calib_aor::Options::default())
            .map_err(|e| Failure::Failed(e.to_string()))?;
        let weak = (!outcome.is_observable()).then(|| "weak".to_owned());
        let Some(e) = outcome.estimate() else {
            return Ok(Answer::NotObservable("none".to_owned()));
        };
        Ok(Answer::Found(AorFit {
            line: AxisLine {
                point_m: e.line.point.coords.into(),
                direction: e.line.direction.into_inner().into(),
            },
            covariance: None,
            in_child: None,
            rms_m: 0.0,
            used: 1,
            rejected: vec![],
            weak,
        }))
    };
    let cor = Offer::new(Kind::Cor, "sphere", "a sphere").takes(&[Shape::Points]);
    let aor = Offer::new(Kind::Aor, "hinge", "a hinge").takes(&[Shape::Markers]);
    let mut tables = Tables::default();
    let entry = Entry::cor(ByFn::new(cor, center), origin());
    tables.cor.register(entry).expect("a name");
    let entry = Entry::aor(ByFn::new(aor, axis), origin());
    tables.aor.register(entry).expect("a name");
    tables
}

fn options(only: &str) -> StudyOptions {
    StudyOptions {
        trials: 5,
        only: vec![only.to_owned()],
        ..StudyOptions::default()
    }
}

/// Everything of a cell that a trial decides.
fn figures(c: &Cell) -> [Option<f64>; 5] {
    let answered = Some(c.answered as f64);
    [c.rms, c.bias, c.efficiency, answered, Some(c.trials as f64)]
}

#[test]
fn an_estimator_of_a_plugin_has_the_figures_of_the_built_in_one_that_it_is() {
    let tried = Tried::of(&tables(), &[]).expect("no parameters");
    for (study, only, of, built_in) in [
        (
            Study::Cor,
            "grid/hand//n16/r100mm/s1mm/0deg",
            "sphere, plugin",
            "kasa",
        ),
        (Study::Cor, "arc/45", "sphere, plugin", "kasa"),
        (
            Study::Aor,
            "markers/arc 60°/4 markers/n10",
            "hinge, plugin",
            "hinge_bundle",
        ),
    ] {
        let options = options(only);
        let plain = run(study, &options, &|_, _| {}).expect("runs");
        let with = run_with(study, &tried, &options, &|_, _| {}).expect("runs");
        let named = |name: &str| -> Vec<[Option<f64>; 5]> {
            let cells = with.cells.iter();
            cells.filter(|c| c.method == name).map(figures).collect()
        };
        let (own, other) = (named(built_in), named(of));
        assert!(!own.is_empty(), "{only}: no scene");
        assert_eq!(own.len(), other.len(), "{only}");
        // Sums of controls are taken in another order.
        let same = |a: &Option<f64>, b: &Option<f64>| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() <= 1e-9 * a.abs(),
            _ => a == b,
        };
        for (a, b) in own.iter().flatten().zip(other.iter().flatten()) {
            assert!(same(a, b), "{only}: {a:?} {b:?}");
        }
        // Nothing else changes.
        let rest = with.cells.iter().filter(|c| !c.from_plugin).cloned();
        assert_eq!(rest.collect::<Vec<_>>(), plain.cells);
        assert_eq!(
            (plain.standards, plain.claims),
            (with.standards.clone(), with.claims.clone())
        );
        let text = markdown(&with);
        assert!(
            text.contains("Estimators of plugins") && text.contains("from plugin `mine` 1.2"),
            "{text}"
        );
    }
}

#[test]
fn a_state_with_other_plugins_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let tried = Tried::of(&tables(), &[]).expect("no parameters");
    let path = folder.path().join("cor.state.jsonl");
    // The first line is all that is compared.
    let header = serde_json::json!({ "calib_study": 1, "version": env!("CARGO_PKG_VERSION"), "study": "cor", "trials": 1, "seed": 1 });
    std::fs::write(&path, format!("{header}\n")).expect("written");
    let options = StudyOptions {
        trials: 1,
        out: Some(folder.path().to_owned()),
        resume: true,
        ..StudyOptions::default()
    };
    let refused = run_with(Study::Cor, &tried, &options, &|_, _| {});
    assert!(
        matches!(refused, Err(StudyError::OtherState { expected, .. }) if expected.contains("`sphere`"))
    );
}
