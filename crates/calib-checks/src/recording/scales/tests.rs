use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use nalgebra::Vector3;

use super::super::shapes::tests::recording;
use super::*;

/// Four markers of a hand, in recordings of so many rows and these scales.
fn found(
    seed: u64,
    of: &[(&'static str, usize, f64)],
    moved: Option<Vector3<f64>>,
) -> Vec<Finding> {
    let mut at = [
        Vector3::new(0.0, 0.0, 0.0),
        Vector3::new(0.08, 0.0, 0.0),
        Vector3::new(0.02, 0.06, 0.0),
        Vector3::new(0.03, 0.02, 0.05),
    ];
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut recordings = Vec::new();
    for (name, rows, scale) in of {
        recordings.push((*name, recording(&at, *rows, *scale, &mut rng)));
        // From the second on, a marker sits elsewhere.
        at[1] += moved.filter(|_| recordings.len() == 1).unwrap_or_default();
    }
    let names = (0..4).map(|k| format!("m{k}")).collect();
    let expected = Expectations {
        bodies: BTreeMap::from([("hand".to_owned(), names)]),
        ..Expectations::default()
    };
    let all: Vec<(&str, &Poses)> = recordings.iter().map(|(n, p)| (*n, p)).collect();
    other_scales(&all, &expected)
}

fn scale_of(finding: &Finding) -> f64 {
    finding
        .facts
        .get("scale")
        .and_then(Fact::value)
        .expect("a scale")
}

#[test]
fn a_recording_with_another_unit_of_length_is_named_with_its_scale() {
    for seed in 0..20 {
        let of = [("poses", 60, 1.0), ("sweep", 30, 1.02), ("checks", 30, 1.0)];
        let found = found(seed, &of, None);
        assert_eq!(found.len(), 1, "{seed}: {found:?}");
        assert_eq!(found[0].subject.recordings, ["sweep"], "{seed}");
        assert_eq!(found[0].severity, Severity::Error, "{seed}");
        assert!(
            (scale_of(&found[0]) - 0.02).abs() < 3e-3,
            "{seed}: {found:?}"
        );
    }
}

#[test]
fn where_all_others_agree_the_longest_recording_is_the_odd_one() {
    for seed in 0..20 {
        let of = [("poses", 60, 0.98), ("sweep", 30, 1.0), ("checks", 30, 1.0)];
        let found = found(seed, &of, None);
        assert_eq!(found.len(), 1, "{seed}: {found:?}");
        assert_eq!(found[0].subject.recordings, ["poses"], "{seed}");
        assert!(
            (scale_of(&found[0]) + 0.02).abs() < 3e-3,
            "{seed}: {found:?}"
        );
    }
}

#[test]
fn equal_scales_and_a_marker_that_moved_are_no_scale() {
    for seed in 0..200 {
        let of = [("poses", 60, 1.0), ("sweep", 30, 1.0), ("checks", 12, 1.0)];
        let clean = found(seed, &of, None);
        assert!(clean.is_empty(), "{seed}: {clean:?}");
        let moved = found(seed, &of, Some(Vector3::new(5e-3, 0.0, 0.0)));
        assert!(moved.is_empty(), "{seed}: {moved:?}");
    }
}

#[test]
fn a_body_that_a_filter_makes_smaller_and_a_marker_that_slid_are_no_scale() {
    let at = [
        Vector3::new(0.0, 0.0, 0.0),
        Vector3::new(0.08, 0.0, 0.0),
        Vector3::new(0.02, 0.06, 0.0),
    ];
    let names: Vec<String> = (0..3).map(|k| format!("m{k}")).collect();
    let expected = Expectations {
        bodies: BTreeMap::from([("hand".to_owned(), names)]),
        ..Expectations::default()
    };
    for seed in 0..200 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let usual = recording(&at, 40, 1.0, &mut rng);
        let [a, mut b, c] = at;
        b.x += 7e-4;
        let slid = recording(&[a, b, c], 40, 1.0, &mut rng);
        let found = other_scales(&[("usual", &usual), ("slid", &slid)], &expected);
        assert!(found.is_empty(), "{seed}: {found:?}");
        // Four fifths of a row and one of the row before it.
        let mut filtered = recording(&at, 40, 1.0, &mut rng);
        for track in filtered.markers.values_mut() {
            let before = track.clone();
            for row in 1..track.len() {
                let (now, last) = (before[row].expect("seen"), before[row - 1].expect("seen"));
                track[row] = Some(nalgebra::Point3::from(0.8 * now.coords + 0.2 * last.coords));
            }
        }
        let found = other_scales(&[("usual", &usual), ("filtered", &filtered)], &expected);
        assert!(found.is_empty(), "{seed}: {found:?}");
    }
}
