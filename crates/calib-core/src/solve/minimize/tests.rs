use super::*;
use crate::example::arm;

/// Some σ from there.
fn away(model: &Model, from: &Values, sigmas: f64) -> Values {
    let mut out = from.clone();
    for &p in &model.columns {
        out.0[p] += 1e-4 * sigmas * (p as f64).sin();
    }
    out
}

/// Steps of which it is known how they contract end one linearization sooner, as near the minimum as was asked.
#[test]
fn a_known_contraction_saves_the_last_linearization() {
    let model = Model::new(&arm()).unwrap();
    let weights = vec![1.0; model.observations.len()];
    let theta = [1e-6, 1e-6, 1e-6];
    let objective = Objective {
        model: &model,
        weights: &weights,
        theta: &theta,
    };
    let mut work = Workspace::new(&model);
    let exact = MinimizeSettings::default();
    let minimum = minimize_in(objective, &model.start(), &exact, &mut work);
    assert_eq!(minimum.status, SolveStatus::Converged);
    // How steps contract that are not damped either, from 2 σ away.
    let far = away(&model, &minimum.values, 2.0);
    let undamped = MinimizeSettings {
        damping: 1e-6,
        ..exact
    };
    let contraction = minimize_in(objective, &far, &undamped, &mut work).contraction;
    let left = contraction
        .and_then(|c| c.left(1.0, 1e-6))
        .expect("steps from farther");
    assert!(left < 1e-3, "{left}");
    // From up to 2 σ away.
    for size in [0.3, 1.0, 2.0] {
        let start = away(&model, &minimum.values, size);
        let coarse = MinimizeSettings {
            decrement: 1e-3,
            damping: 1e-6,
            ..exact
        };
        let asked = minimize_in(objective, &start, &coarse, &mut work);
        let known = MinimizeSettings {
            contraction,
            ..coarse
        };
        let sooner = minimize_in(objective, &start, &known, &mut work);
        assert_eq!(sooner.status, SolveStatus::Converged);
        assert_eq!(sooner.iterations + 1, asked.iterations);
        // How far it is still from the minimum, σ²: the decrement there.
        let rest = minimize_in(
            objective,
            &sooner.values,
            &MinimizeSettings {
                decrement: 1.0,
                ..exact
            },
            &mut work,
        );
        assert!(rest.decrement <= coarse.decrement, "{}", rest.decrement);
    }
}

/// Nothing is taken on trust far from the minimum.
#[test]
fn a_known_contraction_does_not_end_a_far_start() {
    let model = Model::new(&arm()).unwrap();
    let weights = vec![1.0; model.observations.len()];
    let objective = Objective {
        model: &model,
        weights: &weights,
        theta: &[1e-6, 1e-6, 1e-6],
    };
    let settings = MinimizeSettings {
        contraction: Contraction::of(9.0, 1e-12, 1.0),
        decrement: 1e-6,
        ..MinimizeSettings::default()
    };
    let found = minimize_in(
        objective,
        &model.start(),
        &settings,
        &mut Workspace::new(&model),
    );
    assert!(found.iterations > 1 && found.decrement < 10.0);
}
