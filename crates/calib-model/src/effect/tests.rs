//! The table of effects holds together.

use super::*;

#[test]
fn shared_sines_give_the_regressors() {
    for k in -40..40 {
        let q = 0.37 * f64::from(k);
        let motor = 51.3 * q;
        let state = JointState {
            q,
            motor,
            ..JointState::default()
        };
        let of = |kind: EffectKind| kind.of_angles(&SinCos::of(q), &SinCos::of(motor));
        let shared: Vec<EffectKind> = EffectKind::all().filter(|k| of(*k).is_some()).collect();
        assert_eq!(shared, HARMONICS);
        for kind in shared {
            let expected = kind.term().regressor.at(&state);
            let own = of(kind).expect("shared");
            assert!((own - expected).abs() < 1e-13, "{kind:?} at {q}");
        }
    }
}

#[test]
fn numbers_of_the_state_are_the_regressors() {
    let state = JointState {
        q: 0.3,
        velocity: 0.7,
        torque: -4.0,
        across: [5.0, 6.0],
        approach: -1.0,
        motor: 31.0,
        friction: 0.5,
        other: 0.9,
        warmth: 3.0,
        given: 1.7,
    };
    let shared: Vec<EffectKind> = EffectKind::all()
        .filter(|k| k.of_state(&state).is_some())
        .collect();
    assert_eq!(shared, OF_STATE);
    for kind in shared {
        assert_eq!(
            kind.of_state(&state),
            Some(kind.term().regressor.at(&state))
        );
    }
}

#[test]
fn every_term_is_listed_once_and_every_name_is_its_own() {
    let kinds: Vec<EffectKind> = EffectKind::all().collect();
    for (i, kind) in kinds.iter().enumerate() {
        assert_eq!(kind.term().kind, *kind);
        assert_eq!(kinds.iter().filter(|k| *k == kind).count(), 1);
        let same = kinds.iter().filter(|k| k.label() == kind.label());
        assert_eq!(same.count(), 1, "{}", kind.label());
        // The order of creation is the order of the enumeration: maps by kind are in table order.
        assert!(i == 0 || kinds[i - 1] < *kind);
    }
    let mut ids: Vec<_> = EFFECTS.iter().map(|e| e.id).collect();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), EFFECTS.len());
}
