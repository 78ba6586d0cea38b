//! Built-ins and plugins in the same tables.

use std::collections::BTreeMap;

use calib_plugin::{
    Answer, ByFn, Call, Control, CorFit, Entry, Failure, Kind, Motion, Offer, PluginError, Shape,
    Tables,
};

use crate::bed::{Bed, cubes};

fn mean(kind: Kind) -> impl calib_plugin::Cor {
    let offer = Offer::new(kind, "mean", "the built-in mean").takes(&[Shape::Points]);
    ByFn::new(offer, |motion: &Motion<'_>, _: &Call<'_>| {
        let points: Vec<_> = motion.points(0).flatten().collect();
        let n = points.len() as f64;
        Ok::<_, Failure>(Answer::Found(CorFit {
            center_m: [0, 1, 2].map(|i| points.iter().map(|p| p[i]).sum::<f64>() / n),
            covariance_m2: None,
            body_points_m: Vec::new(),
            radii_m: Vec::new(),
            rms_m: 0.0,
            used: points.len(),
            rejected: Vec::new(),
            weak: None,
        }))
    })
}

#[test]
fn a_built_in_and_a_plugin_are_called_alike() {
    let bed = Bed::new();
    let mut tables = Tables::default();
    tables
        .cor
        .register(Entry::built_in_cor(mean(Kind::Cor)))
        .unwrap();
    let built_in = tables
        .cor
        .get("mean")
        .unwrap()
        .with(&BTreeMap::new())
        .unwrap();
    let Answer::Found(first) = built_in.fit(&cubes().view(), &Control::default()).unwrap() else {
        panic!("a center")
    };

    if bed.build("tests/c/cor.c", "good", &[]).is_none() {
        return;
    }
    let plugin = bed.load("good").unwrap();
    let clash = tables.add(&plugin).unwrap_err();
    assert_eq!(
        clash.to_string(),
        "two center estimators are called `mean`: one built in, one from plugin `bad` 1.0"
    );
    let mut tables = Tables::default();
    tables.add(&plugin).unwrap();
    let loaded = tables
        .cor
        .get("mean")
        .unwrap()
        .with(&BTreeMap::new())
        .unwrap();
    let Answer::Found(second) = loaded.fit(&cubes().view(), &Control::default()).unwrap() else {
        panic!("a center")
    };
    for (a, b) in first.center_m.iter().zip(second.center_m) {
        assert!((a - b).abs() < 1e-12);
    }
    let list: Vec<String> = tables
        .list()
        .iter()
        .map(|(o, from)| format!("{} {} {from}", o.kind.id(), o.name))
        .collect();
    assert_eq!(list, ["calib.cor/1 mean from plugin `bad` 1.0"]);
}

#[test]
fn the_listing_shows_both_and_their_parameters() {
    let bed = Bed::new();
    if bed
        .build(
            "../../plugins/column-reader-c/column_reader.c",
            "column_reader",
            &[],
        )
        .is_none()
    {
        return;
    }
    let mut tables = Tables::default();
    tables
        .cor
        .register(Entry::built_in_cor(mean(Kind::Cor)))
        .unwrap();
    tables.add(&bed.load("column_reader").unwrap()).unwrap();
    insta::assert_snapshot!(tables);
    insta::assert_json_snapshot!(tables.json());
}

#[test]
fn unknown_names_and_wrong_kinds_say_what_there_is() {
    let mut tables = Tables::default();
    tables
        .cor
        .register(Entry::built_in_cor(mean(Kind::Cor)))
        .unwrap();
    let unknown = tables.cor.get("median").unwrap_err();
    assert_eq!(
        unknown.to_string(),
        "unknown center estimator `median`, did you mean `mean`? expected one of `mean`"
    );
    assert_eq!(unknown.exit_code(), 2);
    let wrong = tables
        .cor
        .register(Entry::built_in_cor(mean(Kind::Aor)))
        .unwrap_err();
    assert_eq!(
        wrong.to_string(),
        "`mean` describes itself as calib.aor/1, registered as calib.cor/1"
    );
    let parameter = tables
        .cor
        .get("mean")
        .unwrap()
        .with(&BTreeMap::from([(
            "gate".into(),
            calib_plugin::Value::Bool(true),
        )]))
        .err()
        .unwrap();
    assert!(matches!(parameter, PluginError::Parameter { .. }));
    assert_eq!(
        (parameter.to_string().as_str(), parameter.exit_code()),
        (
            "center estimator `mean`: unknown parameter `gate`, expected none",
            2
        )
    );
}
