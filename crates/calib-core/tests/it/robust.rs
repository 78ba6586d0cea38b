//! Contaminated recordings: the task error stays near the clean one, and every rejection has a reason.

use crate::common::{Chain, Free, Handles, normal3, rng, six_r};
use calib_core::{
    Configuration, MarkerObservation, MeasurementKind, PointId, RejectReason, RobustSettings,
    Settings, Solution, measurement, relabel, solve, solve_some,
};
use nalgebra::Point3;
use rand::{Rng, RngExt};

const SIGMA: f64 = 1e-4;

struct Case {
    chain: Chain,
    h: Handles,
}

fn case(seed: u64, poses: usize) -> Case {
    case_with(seed, poses, &Free::frames_and_offsets(6))
}

fn case_with(seed: u64, poses: usize, free: &Free) -> Case {
    let mut r = rng(seed);
    let chain = Chain::nominal(six_r())
        .posed(&mut r, poses, 1.4)
        .deviate(&mut r, free, 0.02, 0.01);
    let mut h = chain.problem(free, SIGMA);
    h.problem.group_mut(h.markers).estimate = true;
    chain.observe(&mut r, &mut h, SIGMA, 0.0);
    Case { chain, h }
}

fn seen(h: &mut Handles) -> &mut Vec<MarkerObservation> {
    match &mut h.problem.measurements_mut()[0].kind {
        MeasurementKind::Markers(measurement::Markers { observations, .. }) => observations,
        _ => unreachable!("the chain has one marker measurement"),
    }
}

fn outliers(h: &mut Handles, r: &mut impl Rng, share: f64) -> Vec<usize> {
    let mut hit = Vec::new();
    for (i, o) in seen(h).iter_mut().enumerate() {
        if r.random_bool(share) {
            o.position += normal3(r) * 0.05;
            hit.push(i);
        }
    }
    hit
}

/// Three labels go round. (With a known layout, exchanging only two adds no torque at the truth,
/// p_a × p_b + p_b × p_a = 0, and even least squares survives it.)
fn swaps(h: &mut Handles, r: &mut impl Rng, share: f64) -> Vec<usize> {
    let mut hit = Vec::new();
    let list = seen(h);
    let mut i = 0;
    while i < list.len() {
        let mut end = i;
        while end < list.len() && list[end].sample == list[i].sample {
            end += 1;
        }
        if r.random_bool(share) && end - i >= 3 {
            let n = end - i;
            let a = r.random_range(0..n);
            let [a, b, c] = [0, 1, 2].map(|k| i + (a + k) % n);
            let p = list[a].position;
            list[a].position = list[b].position;
            list[b].position = list[c].position;
            list[c].position = p;
            hit.extend([a, b, c]);
        }
        i = end;
    }
    hit
}

/// Mean error of a tool point over 20 new configurations, m.
fn task_error(case: &Case, s: &Solution) -> f64 {
    let mut r = rng(77);
    let p = Point3::new(0.0, 0.0, 0.1);
    let n = 20;
    (0..n)
        .map(|_| {
            let q: Vec<f64> = (0..6).map(|_| r.random_range(-1.4..1.4)).collect();
            let mut at = Configuration::zero();
            for (j, q) in case.h.joints.iter().zip(&q) {
                at = at.with(*j, *q);
            }
            let found = s
                .predict_point(case.h.tracker, case.h.body, &p, &at)
                .unwrap();
            (found.position - case.chain.tracker_from_body(&q, &[]) * p).norm() / n as f64
        })
        .sum()
}

fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    x[x.len() / 2]
}

fn medians(free: &Free, spoil: impl Fn(&mut Handles, &mut rand_chacha::ChaCha8Rng)) -> (f64, f64) {
    let plain = Settings::default().with_robust(RobustSettings::off());
    let mut errors = (Vec::new(), Vec::new());
    for seed in 0..7 {
        let mut c = case_with(seed, 36, free);
        let mut r = rng(900 + seed);
        spoil(&mut c.h, &mut r);
        errors
            .0
            .push(task_error(&c, &solve(&c.h.problem, &plain).unwrap()));
        errors.1.push(task_error(
            &c,
            &solve(&c.h.problem, &Settings::default()).unwrap(),
        ));
    }
    (median(errors.0), median(errors.1))
}

#[test]
fn thirty_percent_outliers() {
    let (clean, also_clean) = medians(&Free::frames_and_offsets(6), |_, _| {});
    assert!(clean < 7e-5, "{clean}");
    assert!((clean - also_clean).abs() < 0.2 * clean);
    let (plain, robust) = medians(&Free::frames_and_offsets(6), |h, r| {
        outliers(h, r, 0.3);
    });
    // Least squares is off by millimeters; the published recipe reaches 0.065 mm against 0.051 clean.
    assert!(plain > 1e-3, "{plain}");
    assert!(robust < 8e-5, "{robust}");
}

#[test]
fn forty_percent_of_the_frames_with_swapped_markers() {
    let (plain, robust) = medians(&Free::frames_and_offsets(6), |h, r| {
        swaps(h, r, 0.4);
    });
    assert!(plain > 1e-3, "{plain}");
    assert!(robust < 1e-4, "{robust}");
    let (clean, _) = medians(&Free::frames_and_offsets(6), |_, _| {});
    let (_, relabeled) = medians(&Free::frames_and_offsets(6), |h, r| {
        swaps(h, r, 0.4);
        relabel(&mut h.problem, 10.0 * SIGMA);
    });
    // Nothing is lost when the labels are put right: as good as clean.
    assert!(relabeled < 1.01 * clean, "{relabeled} {clean}");
}

#[test]
fn dropouts_outliers_and_swaps_together() {
    let (plain, robust) = medians(&Free::frames_and_offsets(6), |h, r| {
        seen(h).retain(|_| !r.random_bool(0.3));
        outliers(h, r, 0.1);
        swaps(h, r, 0.2);
        relabel(&mut h.problem, 10.0 * SIGMA);
    });
    assert!(plain > 1e-3, "{plain}");
    assert!(robust < 1e-4, "{robust}");
}

#[test]
fn relabeling_restores_the_labels_and_touches_nothing_else() {
    let mut c = case(3, 30);
    let before: Vec<PointId> = seen(&mut c.h).iter().map(|o| o.point).collect();
    assert!(relabel(&mut c.h.problem, 10.0 * SIGMA).is_empty());
    let mut r = rng(5);
    let hit = swaps(&mut c.h, &mut r, 0.4);
    let changed = relabel(&mut c.h.problem, 10.0 * SIGMA);
    let touched: usize = changed.iter().map(|c| c.changes.len()).sum();
    assert_eq!(touched, hit.len());
    // Positions moved with the swap, so the labels moved after them.
    for three in hit.chunks(3) {
        let list = seen(&mut c.h);
        for k in 0..3 {
            assert_eq!(list[three[k]].point, before[three[(k + 1) % 3]]);
        }
    }
}

#[test]
fn a_symmetric_layout_is_left_alone() {
    let mut r = rng(8);
    let free = Free::frames_and_offsets(6);
    let mut chain = Chain::nominal(six_r()).posed(&mut r, 12, 1.4);
    chain.markers = vec![
        Point3::new(0.05, 0.0, 0.0),
        Point3::new(-0.025, 0.0433, 0.0),
        Point3::new(-0.025, -0.0433, 0.0),
    ];
    let mut h = chain.problem(&free, SIGMA);
    chain.observe(&mut r, &mut h, SIGMA, 0.0);
    swaps(&mut h, &mut r, 0.5);
    assert!(relabel(&mut h.problem, 10.0 * SIGMA).is_empty());
}

#[test]
fn every_rejection_has_its_reason() {
    let mut c = case(11, 40);
    let (swapped, alone, moved) = {
        let list = seen(&mut c.h);
        // Sample 3: two markers exchanged. Sample 7: one marker off. Sample 20: the body elsewhere.
        let p = list[12].position;
        list[12].position = list[13].position;
        list[13].position = p;
        list[28].position.x += 0.03;
        for o in list.iter_mut().filter(|o| o.sample == 20) {
            o.position.z += 0.02;
        }
        (vec![12, 13], vec![28], vec![80, 81, 82, 83])
    };
    let s = solve(&c.h.problem, &Settings::default()).unwrap();
    let of = |reason: RejectReason| -> Vec<usize> {
        s.rejected
            .iter()
            .filter(|r| r.reason == reason)
            .map(|r| r.item)
            .collect()
    };
    assert_eq!(of(RejectReason::Swap), swapped);
    assert_eq!(of(RejectReason::NotSettled), moved);
    assert!(alone.iter().all(|i| of(RejectReason::Outlier).contains(i)));
    // 160 good vectors at 99.9 %: chance rejects at most a few more.
    assert!(of(RejectReason::Outlier).len() <= 3);
    assert!(s.rejected.iter().all(|r| r.distance > 3.0));
}

#[test]
fn a_prior_is_never_weighted_down() {
    // A tight prior that contradicts the data by 30 σ keeps its full pull.
    let mut c = case(12, 30);
    let p = c.h.problem.find_parameter("j2.offset").unwrap();
    c.h.problem.parameter_mut(p).nominal = 0.5;
    c.h.problem.parameter_mut(p).prior_sigma = Some(1e-6);
    let s = solve(&c.h.problem, &Settings::default()).unwrap();
    assert!((s.parameters[p.index()].value - 0.5).abs() < 1e-2);
}

/// Of 14 postures the first lies far outside the others, the second on the way there. Rejected markers of the first, which are all good, and of all
/// others, over seeds, where the second is off by `off` (m).
fn rejected_beside(off: f64) -> (usize, usize) {
    let (mut far_rejected, mut others) = (0, 0);
    let free = Free::everything(6);
    for seed in 0..40 {
        let mut r = rng(500 + seed);
        let mut chain = Chain::nominal(six_r()).posed(&mut r, 14, 0.25);
        let far: Vec<f64> = (0..6)
            .map(|_| if r.random_bool(0.5) { 1.2 } else { -1.2 })
            .collect();
        chain.q[1] = far.iter().map(|q| 0.6 * q).collect();
        chain.q[0] = far;
        let chain = chain.deviate(&mut r, &free, 0.02, 0.01);
        let mut h = chain.problem(&free, SIGMA);
        h.problem.group_mut(h.markers).estimate = true;
        chain.observe(&mut r, &mut h, SIGMA, 0.0);
        for o in seen(&mut h).iter_mut().filter(|o| o.sample == 1) {
            o.position.z += off;
        }
        let s = solve(&h.problem, &Settings::default()).unwrap();
        let far = s.rejected.iter().filter(|r| r.sample == 0).count();
        far_rejected += far;
        others += s.rejected.len() - far;
    }
    (far_rejected, others)
}

#[test]
fn a_good_posture_that_alone_determines_a_direction_is_kept() {
    // Six of its markers were rejected where the gate knew nothing of the uncertainty of the others' prediction.
    let counts = [0.0005, 0.001, 0.002].map(rejected_beside);
    assert!(counts.iter().all(|c| c.0 == 0), "{counts:?}");
    // What is off is rejected as before.
    assert!(counts[1].1 > 30 && counts[2].1 > 70, "{counts:?}");
}

/// Of 300 poses, 1 200 observations, one or two are rejected by chance; an exchange of three labels, or outliers beside these, are not chance.
#[test]
fn what_chance_rejects_asks_for_no_explanation() {
    let settings = Settings::default();
    let rejects_by_chance = |case: &Case| {
        let s = solve(&case.h.problem, &settings).expect("solves");
        s.rejects_by_chance(&settings)
    };
    let clean = (0..6).filter(|seed| rejects_by_chance(&case(*seed, 300)));
    assert!(clean.count() >= 4);
    for seed in 0..3 {
        let mut exchanged = case(seed, 300);
        let list = seen(&mut exchanged.h);
        let [a, b, c] = [0, 1, 2].map(|k| list[400 + k].position);
        (list[400].position, list[401].position, list[402].position) = (b, c, a);
        assert!(!rejects_by_chance(&exchanged));
        let mut off = case(seed, 300);
        assert!(!outliers(&mut off.h, &mut rng(seed), 0.01).is_empty());
        assert!(!rejects_by_chance(&off));
    }
    // A fit of few poses has nothing to spare: one observation is one too many.
    let mut few = case(1, 15);
    seen(&mut few.h)[17].position.x += 0.05;
    assert!(!rejects_by_chance(&few));
    assert!(solve_some(&few.h.problem, &settings).is_ok_and(|none| none.is_none()));
}
