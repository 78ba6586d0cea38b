//! A plan while it is recorded: σ follows from what was held, and the rest is chosen again from there.

use std::collections::{BTreeMap, BTreeSet};

use calib_plan::candidates::Candidate;
use calib_plan::follow::{Follow, Next};
use calib_plan::list::Why;
use calib_plan::{Known, Options, Plan, PlanError, plan};

use crate::robots::{SCARA, SIX, Seen, known, robot};

fn few(poses: usize) -> Options {
    Options {
        poses: Some(poses),
        candidates: 120,
        ..Options::default()
    }
}

fn made(known: &Known, options: &Options) -> Plan {
    plan(known, options).unwrap_or_else(|e| panic!("{e}"))
}

fn followed<'a>(known: &'a Known, options: &'a Options, plan: &Plan) -> Follow<'a> {
    let file = plan.file(&known.robot.model);
    Follow::fitted(known, options, &file, "plan.yaml").unwrap_or_else(|e| panic!("{e}"))
}

/// The first posture, held as it was asked for; `hidden`: nothing of the hand was seen.
fn hold(follow: &mut Follow<'_>, known: &Known, hidden: bool) -> bool {
    while follow.rest()[0].is_on_the_way() {
        follow.pass();
    }
    let q = &follow.rest()[0].candidate.q;
    let model = &known.robot.model;
    let joints = model
        .joint_ids()
        .map(|id| (model.joint(id).name.clone(), q[id.index()]));
    let names = [
        "hand", "f1", "f2", "f3", "f4", "foot", "b1", "b2", "b3", "b4",
    ];
    let seen = names
        .into_iter()
        .skip(if hidden { 5 } else { 0 })
        .map(str::to_owned);
    let (joints, seen): (BTreeMap<_, _>, BTreeSet<_>) = (joints.collect(), seen.collect());
    let held = follow.as_held(&joints, &seen);
    follow.hold(held)
}

fn count(follow: &Follow<'_>) -> usize {
    follow.rest().iter().filter(|n| !n.is_on_the_way()).count()
}

/// Over joints of two kinds, one marker and two.
#[test]
fn postures_held_as_planned_reach_what_was_planned_and_the_choice_from_there_is_no_worse() {
    let robots = [(SIX, Seen::Markers(1)), (SCARA, Seen::Markers(2))];
    for (joints, seen) in robots {
        let known = known(robot(joints, seen, false, ""));
        let options = few(18);
        let plan = made(&known, &options);
        let mut follow = followed(&known, &options, &plan);
        let measured = plan.postures.iter().filter(|p| p.why != Why::Detour);
        let measured: Vec<_> = measured.collect();
        for _ in 0..14 {
            assert!(!hold(&mut follow, &known, false), "too early");
        }
        let reached = follow.reached().expect("a problem");
        let (now, then) = (reached.sigma, measured[13].sigma);
        let (now, then) = (now.expect("known"), then.expect("known"));
        assert!((now / then - 1.0).abs() < 1e-3, "{now} {then}");
        let before = reached.expected.expect("known");
        assert!(hold(&mut follow, &known, false), "it is time");
        let after = follow
            .reached()
            .expect("a problem")
            .expected
            .expect("known");
        assert!(after < 1.01 * before, "{seen:?}: {after} {before}");
        assert_eq!(count(&follow), 3);
        while count(&follow) > 0 {
            hold(&mut follow, &known, false);
        }
        let reached = follow.reached().expect("a problem");
        assert_eq!(reached.sigma, reached.expected);
        assert!(reached.sigma.expect("known") < 1.02 * after, "{reached:?}");
    }
}

#[test]
fn what_was_hidden_does_not_count_and_is_not_asked_for_nearby() {
    let known = known(robot(SIX, Seen::Markers(3), false, ""));
    let options = few(20);
    let plan = made(&known, &options);
    let (mut all, mut some) = (
        followed(&known, &options, &plan),
        followed(&known, &options, &plan),
    );
    let mut hidden = Vec::new();
    for k in 0..15 {
        hold(&mut all, &known, false);
        if k % 3 == 0 {
            hidden.push(some.rest()[0].candidate.q.clone());
        }
        hold(&mut some, &known, k % 3 == 0);
    }
    let sigma = |f: &Follow<'_>| f.reached().expect("a problem").sigma.expect("known");
    assert!(
        sigma(&some) > 1.1 * sigma(&all),
        "{} {}",
        sigma(&some),
        sigma(&all)
    );
    // As many are still to come, none of those chosen near to one that was hidden.
    assert_eq!(count(&some), count(&all));
    let joints = known.joint_box().expect("ranges");
    let chosen = some.rest().iter().filter(|n| n.why == Why::Information);
    let mut near = chosen.map(|n| {
        let of = |q: &Vec<f64>| joints.distance(q, &n.candidate.q);
        hidden.iter().map(of).fold(f64::INFINITY, f64::min)
    });
    assert!(near.all(|d| d >= 0.1));
}

#[test]
fn postures_are_exchanged_skipped_taken_again_and_found_in_a_file() {
    let known = known(robot(SCARA, Seen::Pose, false, ""));
    let plan = made(&known, &few(12));
    let end = plan.sigma.expect("determined");
    let options = Options {
        sigma: Some(0.9 * end),
        ..few(12)
    };
    let mut follow = followed(&known, &options, &plan);
    hold(&mut follow, &known, false);
    let first: Next = follow.rest()[0].clone();
    let offered = follow.offer().expect("another").clone();
    assert!(follow.instead());
    assert_eq!(follow.rest()[0].candidate, offered.candidate);
    assert_ne!(offered.candidate, first.candidate);
    hold(&mut follow, &known, false);
    follow.forget();
    assert_eq!(follow.rest()[0].candidate, offered.candidate);
    assert_eq!(count(&follow), 11);
    // A file says that the first was exchanged for the offered one: neither is asked for.
    let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.01);
    let mut gone_on = followed(&known, &options, &plan);
    let exchanged = [first.candidate.q.clone()];
    let kept = count(&gone_on);
    // A posture may be in a list twice.
    let asked = |follow: &Follow<'_>, q: &[f64]| {
        let recorded = follow.rest().iter().filter(|n| !n.is_on_the_way());
        recorded.filter(|n| near(&n.candidate.q, q)).count()
    };
    let [given_up, taken] = [&first, &offered].map(|n| n.candidate.q.clone());
    let before = [&given_up, &taken].map(|q| asked(&gone_on, q));
    gone_on.resume(vec![offered.candidate.clone()], &exchanged, &near);
    assert_eq!(count(&gone_on), kept - 1);
    assert_eq!(asked(&gone_on, &given_up) + 1, before[0]);
    assert_eq!((asked(&gone_on, &taken), before[1]), (0, 0));
    // One that is asked for later is the last.
    let before: Vec<Next> = gone_on.rest().to_vec();
    assert!(gone_on.later());
    let recorded = |rest: &[Next]| -> Vec<Vec<f64>> {
        let rest = rest.iter().filter(|n| !n.is_on_the_way());
        rest.map(|n| n.candidate.q.clone()).collect()
    };
    let (before, mut after) = (recorded(&before), recorded(gone_on.rest()));
    after.rotate_right(1);
    assert_eq!(before, after);
    follow.skip();
    assert_eq!(count(&follow), 10);
    assert_ne!(follow.rest()[0].candidate, offered.candidate);
    // A file with some of them, in another order, and one that the plan does not have.
    let mut again = followed(&known, &options, &plan);
    let measured: Vec<_> = plan
        .postures
        .iter()
        .filter(|p| p.why != Why::Detour)
        .collect();
    let other = again.rest()[0].candidate.seen.clone();
    let candidate = |q: &Vec<f64>| Candidate {
        q: q.clone(),
        seen: other.clone(),
    };
    let mut foreign = measured[5].q.clone();
    foreign[0] += 0.3;
    let holds = vec![
        candidate(&measured[3].q),
        candidate(&foreign),
        candidate(&measured[0].q),
    ];
    let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.01);
    again.resume(holds, &[], &near);
    assert_eq!(count(&again), 10);
    let all = |q: &[f64]| measured.iter().filter(|p| near(&p.q, q)).count();
    let left = |q: &[f64]| {
        let same = again.rest().iter().filter(|n| near(&n.candidate.q, q));
        same.count()
    };
    let gone = [0, 1, 3].map(|k| all(&measured[k].q) - left(&measured[k].q));
    assert_eq!(gone, [1, 0, 1]);
    // The list does not reach the σ that is asked for: postures are added until it is.
    let mut held = 3;
    let reached = loop {
        let reached = again.reached().expect("a problem");
        if count(&again) == 0 || again.is_reached(&reached).is_some() {
            break reached;
        }
        hold(&mut again, &known, false);
        held += 1;
    };
    assert_eq!(again.is_reached(&reached), Some(0.9 * end));
    assert!(held > 13 && count(&again) > 0, "{held}");
}

#[test]
fn a_plan_of_something_else_is_refused_with_both_numbers() {
    let known_before = known(robot(SCARA, Seen::Markers(4), true, ""));
    let options = few(12);
    let plan = made(&known_before, &options);
    let file = plan.file(&known_before.robot.model);
    let refused = |extra: &str, seen: Seen| {
        let other = known(robot(SCARA, seen, true, extra));
        let refused = Follow::fitted(&other, &options, &file, "plan.yaml");
        refused.map(|_| ()).expect_err("something else")
    };
    let outdated = refused("", Seen::Markers(1));
    assert!(matches!(outdated, PlanError::Outdated { .. }), "{outdated}");
    assert!(
        outdated.to_string().matches(" mm").count() >= 2,
        "{outdated}"
    );
    let ground = refused("plan: {ground_mm: 100}\n", Seen::Markers(4));
    let said = ground.to_string();
    assert!(
        said.contains("no longer possible") && said.contains("the ground removes"),
        "{said}"
    );
    let narrow = refused("plan: {joints: {j1_deg: [0, 3]}}\n", Seen::Markers(4));
    assert!(narrow.to_string().contains("joint `j1`"), "{narrow}");
}
