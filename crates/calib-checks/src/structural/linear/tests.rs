use nalgebra::{Isometry3, Point3, Unit};

use super::*;
use crate::structural::chain::{Chain, ChainJoint};
use crate::structural::data::Body;
use crate::structural::ids::{JointIndex, RecordingIndex};

/// A number in [−1, 1] that looks random.
fn drawn(k: usize) -> f64 {
    (k as f64 * 12.9898 + 4.1).sin()
}

/// Two arms of two joints each, a body of two markers on each and one on the base; some markers are hidden.
fn data() -> Data {
    let joint = |(j, parent): (usize, usize)| ChainJoint {
        parent: LinkIndex(parent),
        child: LinkIndex(j + 1),
        parent_from_joint: Isometry3::new(
            Vector3::new(drawn(j), drawn(j + 20), drawn(j + 40)) * 0.3,
            Vector3::new(drawn(j + 60), drawn(j + 80), drawn(j + 100)),
        ),
        motion: Motion::Revolute(Unit::new_normalize(Vector3::new(drawn(j), 0.3, 1.0))),
        law: vec![(JointIndex(j), 1.0)],
        offset: 0.0,
    };
    let joints = [(0, 0), (1, 1), (2, 0), (3, 3)].map(joint);
    // More than one piece.
    let rows = 70;
    let body = |(b, link): (usize, usize)| {
        let marker = |i: usize, m: usize| {
            let at = 7 * i + 300 * m + 100 * b;
            let place = Point3::new(drawn(at), drawn(at + 1), drawn(at + 2));
            (!at.is_multiple_of(5)).then_some(place)
        };
        let markers = (0..rows).map(|i| (0..2).map(|m| marker(i, m)).collect());
        Body {
            link: LinkIndex(link),
            measured: Measured::Markers(markers.collect()),
            mounts: Vec::new(),
        }
    };
    Data {
        chain: Chain::new(5, joints.to_vec()).expect("a tree"),
        readings: (0..rows)
            .map(|i| (0..4).map(|j| Some(drawn(31 * i + j))).collect())
            .collect(),
        recording: (0..rows).map(|i| RecordingIndex(i / 35)).collect(),
        rates: (0..rows)
            .map(|i| Some((0..4).map(|j| drawn(17 * i + j)).collect()))
            .collect(),
        bodies: [(0, 2), (1, 4), (2, 0)].map(body).into_iter().collect(),
    }
}

#[test]
fn groups_and_pieces_sum_to_what_all_bodies_in_one_give() {
    let data = data();
    let pairs = (0..4).flat_map(|j| (0..4).map(move |s| (JointIndex(j), JointIndex(s))));
    let mut tests: Vec<Test> = pairs
        .map(|(joint, source)| Test::Reading { joint, source })
        .collect();
    let recordings = [0, 1].map(RecordingIndex);
    tests.extend(recordings.map(|recording| Test::Lag { recording }));
    let model = Model::new(&data, &tests, &[]);
    assert_eq!(groups(&model).len(), 3);
    let whole = group_of(&model, vec![0, 1, 2]);
    let lambdas = [0.0, 0.7];
    let in_one = model.sums_of_group(&whole, 0..70, lambdas);
    for (own, one) in model.sums_of(lambdas).iter().zip(&in_one) {
        let p = one.gram.ncols() - 1;
        // Products of the residual with the columns are there once.
        let off = &own.gram - &one.gram;
        assert!(off.columns(0, p).rows(0, p).amax() < 1e-11);
        assert!(off.column(p).amax() < 1e-11);
        assert!((&own.cross - &one.cross).amax() < 1e-11);
        assert!((&own.own - &one.own).amax() < 1e-11);
        assert!((own.log_det - one.log_det).abs() < 1e-11);
        assert!((own.observations - one.observations).abs() < 1e-11);
    }
}
