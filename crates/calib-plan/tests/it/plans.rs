//! Whole plans: what they reach against other designs, and that they say why there is none.

use calib_plan::candidates::Candidate;
use calib_plan::list::{Posture, Why};
use calib_plan::prepare::{Prepared, prepare};
use calib_plan::{Goal, Known, Note, Options, Plan, PlanError, plan, terminal, write};
use nalgebra::Vector3;
use rand::seq::index::sample;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::robots::{SCARA, SEVEN, SIX, Seen, five, known, robot, six};

/// Few candidates: the tests are about laws, not about the last percent.
pub(crate) fn few(poses: usize) -> Options {
    Options {
        poses: Some(poses),
        candidates: 240,
        ..Options::default()
    }
}

/// As many as the figures of the book are of.
fn many(poses: usize) -> Options {
    Options {
        candidates: 600,
        ..few(poses)
    }
}

pub(crate) fn planned(known: &Known, options: &Options) -> Plan {
    plan(known, options).unwrap_or_else(|e| panic!("{e}"))
}

/// σ of the task after some postures, m.
fn sigma_of(prepared: &Prepared<'_>, postures: &[Candidate]) -> f64 {
    let (_, after, _) = prepared.predicted(postures).expect("a problem");
    after.last().copied().flatten().unwrap_or(f64::INFINITY)
}

/// As many random candidates: the mean over some draws.
fn random(prepared: &Prepared<'_>, count: usize, draws: u64) -> f64 {
    let draw = |seed: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let chosen = sample(&mut rng, prepared.candidates.len(), count);
        let postures: Vec<Candidate> = chosen
            .iter()
            .map(|i| prepared.candidates[i].clone())
            .collect();
        sigma_of(prepared, &postures)
    };
    (0..draws).map(draw).sum::<f64>() / draws as f64
}

/// One joint at a time over its range, the others in the middle.
fn one_at_a_time(prepared: &Prepared<'_>, count: usize) -> f64 {
    let moved = &prepared.joints.moved;
    let mut middle = prepared.joints.base.clone();
    for m in moved {
        middle[m.joint.index()] = (m.low + m.high) / 2.0;
    }
    let seen = prepared.candidates[0].seen.clone();
    let postures: Vec<Candidate> = (0..count)
        .map(|k| {
            let m = moved[k % moved.len()];
            let of_joint = count.div_ceil(moved.len());
            let t = ((k / moved.len()) as f64 + 0.5) / of_joint as f64;
            let mut q = middle.clone();
            q[m.joint.index()] = m.low + (m.high - m.low) * t;
            Candidate {
                q,
                seen: seen.clone(),
            }
        })
        .collect();
    sigma_of(prepared, &postures)
}

#[test]
fn a_plan_beats_random_postures_and_sweeps_of_single_joints() {
    let known = six(Seen::Markers(2), "");
    let options = few(24);
    let prepared = prepare(&known, &options).unwrap_or_else(|e| panic!("{e}"));
    let found = planned(&known, &options);
    let sigma = found.sigma.expect("determined");
    assert!(sigma <= 0.95 * random(&prepared, 24, 4));
    assert!(sigma <= 0.5 * one_at_a_time(&prepared, 24));
    assert!(found.efficiency >= 0.95, "{}", found.efficiency);
}

#[test]
#[ignore = "five robots: half a minute"]
fn plans_beat_random_postures_and_sweeps_of_single_joints_on_five_robots() {
    for (name, known) in five() {
        let options = many(36);
        let prepared = prepare(&known, &options).unwrap_or_else(|e| panic!("{name}: {e}"));
        let found = planned(&known, &options);
        let sigma = found.sigma.expect("determined");
        let drawn = random(&prepared, 36, 6);
        let swept = one_at_a_time(&prepared, 36);
        // No plan of as many of these candidates is better than the certified one by more than its efficiency.
        let least = found.efficiency * sigma / swept;
        println!(
            "{name}: {:.4} mm, /random {:.3}, /one at a time {:.3}, of any plan {least:.3} at least, I-efficiency {:.4}",
            sigma * 1e3,
            sigma / drawn,
            sigma / swept,
            found.efficiency
        );
        assert!(sigma <= 0.95 * drawn, "{name}: {sigma} {drawn}");
        // Half of a sweep's σ, where the certificate does not say that no plan has it: four joints swept by nine postures each leave a
        // sweep of single joints of the SCARA arm less to miss.
        assert!(
            sigma <= 0.5 * swept || least > 0.5,
            "{name}: {sigma} {swept}"
        );
        assert!(sigma <= 0.6 * swept, "{name}: {sigma} {swept}");
        assert!(found.efficiency >= 0.97, "{name}: {}", found.efficiency);
    }
}

#[test]
#[ignore = "five robots: half a minute"]
fn designs_for_all_parameters_are_certified() {
    for (name, known) in five() {
        let options = Options {
            goal: Goal::Parameters,
            ..many(36)
        };
        let found = planned(&known, &options);
        println!("{name}: D-efficiency {:.4}", found.efficiency);
        assert!(found.efficiency >= 0.98, "{name}: {}", found.efficiency);
    }
}

/// The motions take no longer than they may, with fewer postures where more take longer; and where no plan is that short, or none that
/// short is good enough, the error says so.
#[test]
fn a_path_time_that_is_asked_for_is_kept_or_refused() {
    let known = six(Seen::Markers(4), "");
    let free = planned(&known, &few(24));
    let within = |time: f64| Options {
        path_time: Some(time),
        ..few(24)
    };
    let most = 0.5 * free.motion_time;
    let found = planned(&known, &within(most));
    assert!(found.motion_time <= most, "{} {most}", found.motion_time);
    // The way alone decides the order, so that half of the time is enough for more than half of the postures.
    let recorded = found.recorded();
    assert!((12..=24).contains(&recorded), "{recorded}");
    let is_stated =
        |note: &Note| matches!(note, Note::PathTime { asked: 24, found, .. } if *found == recorded);
    assert_eq!(recorded < 24, found.notes.iter().any(is_stated));
    let file = found.file(&known.robot.model);
    assert_eq!(file.asked.path_time_s, Some(most));
    let said = plan_error(&known, &within(0.5));
    assert!(said.contains("6 postures take"), "{said}");
    let sigma = Options {
        poses: None,
        sigma: free.sigma,
        ..within(0.3 * free.motion_time)
    };
    let said = plan_error(&known, &sigma);
    assert!(said.contains("is not reached in"), "{said}");
}

/// The smallest eigenvalue of the information of a plan, in units of the priors.
fn smallest(known: &Known, prepared: &Prepared<'_>, found: &Plan) -> f64 {
    let recorded = found.postures.iter().filter(|p| p.why != Why::Detour);
    let candidate = |p: &Posture| Candidate {
        q: p.q.clone(),
        seen: prepared.candidates[0].seen.clone(),
    };
    let postures: Vec<Candidate> = recorded.map(candidate).collect();
    let subjects = &prepared.feasible.sight.subjects;
    let linear = known.linearize(&postures, subjects, &prepared.task);
    let linear = linear.unwrap_or_else(|e| panic!("{e}"));
    let mut m = prepared.before.clone();
    for y in &linear.planned {
        let y = prepared.basis.of(y);
        m += y.transpose() * &y;
    }
    m.symmetric_eigenvalues().min()
}

/// The goal of the least determined combination makes it better than the other goals do, and is certified.
#[test]
fn a_plan_for_the_least_determined_combination_determines_it_best() {
    let known = six(Seen::Markers(4), "");
    let of = |goal: Goal| Options { goal, ..few(24) };
    let options = of(Goal::Weakest);
    let prepared = prepare(&known, &options).unwrap_or_else(|e| panic!("{e}"));
    let found = |goal: Goal| planned(&known, &of(goal));
    let own = found(Goal::Weakest);
    let least = smallest(&known, &prepared, &own);
    for other in [Goal::Task, Goal::Variances] {
        assert!(
            least >= smallest(&known, &prepared, &found(other)),
            "{other:?}"
        );
    }
    assert!(own.efficiency > 0.9, "{}", own.efficiency);
}

#[test]
#[ignore = "five robots: a minute"]
fn designs_for_the_least_determined_combination_are_certified() {
    for (name, known) in five() {
        let options = Options {
            goal: Goal::Weakest,
            ..many(36)
        };
        let prepared = prepare(&known, &options).unwrap_or_else(|e| panic!("{e}"));
        let found = planned(&known, &options);
        let half = Options {
            goal: Goal::Weakest,
            ..many(18)
        };
        let [whole, half] =
            [&found, &planned(&known, &half)].map(|of| smallest(&known, &prepared, of));
        println!(
            "{name}: E-efficiency {:.4}, smallest eigenvalue {whole:.4}, of 18 postures {half:.4}",
            found.efficiency
        );
        assert!(found.efficiency >= 0.9, "{name}: {}", found.efficiency);
    }
}

#[test]
fn every_posture_improves_the_task_and_the_list_is_what_was_asked_for() {
    let known = six(Seen::Markers(4), "");
    let found = planned(&known, &few(24));
    let measured: Vec<_> = found
        .postures
        .iter()
        .filter(|p| p.why != Why::Detour)
        .collect();
    assert_eq!(measured.len(), 24);
    let of = |why: Why| measured.iter().filter(|p| p.why == why).count();
    assert!(of(Why::SpaceFilling) >= 6);
    assert_eq!((of(Why::Approach), of(Why::OtherSide)), (1, 1));
    let sigmas: Vec<f64> = measured.iter().filter_map(|p| p.sigma).collect();
    assert!(sigmas.len() > 12, "{sigmas:?}");
    assert!(sigmas.windows(2).all(|w| w[1] <= w[0] * (1.0 + 1e-9)));
    assert_eq!(found.sigma, sigmas.last().copied());
    assert_eq!(found.held_out.len(), 6);
    for q in &found.held_out {
        assert!(found.joints.holds(q));
        assert!(found.postures.iter().all(|p| p.q != *q));
    }
}

#[test]
fn a_posture_from_the_other_side_has_all_joints_coming_back() {
    let known = six(Seen::Markers(4), "");
    let found = planned(&known, &few(24));
    let last = found.postures.iter().position(|p| p.why == Why::OtherSide);
    let last = last.expect("one is planned");
    let first = found.postures[last].repeats.expect("it repeats one");
    let at = |k: usize, j: usize| found.postures[k].q[j];
    let mut turned = 0;
    for m in &found.joints.moved {
        let j = m.joint.index();
        assert_eq!(at(last, j), at(first, j));
        let came = (at(first, j) - at(first - 1, j)) * (at(last, j) - at(last - 1, j));
        assert!(came <= 0.0, "joint {j}");
        turned += usize::from(came < 0.0);
    }
    assert!(turned >= 4, "{turned}");
}

/// Cameras on one side, and markers that face one way.
const CAMERAS: &str = "plan:\n  cameras:\n    \
    c1: {at_mm: [3400, 300, 1500], toward_mm: [900, 300, 500], field_deg: 60}\n    \
    c2: {at_mm: [2900, 1900, 1700], toward_mm: [900, 300, 500], field_deg: 60}\n    \
    c3: {at_mm: [2900, -1300, 1700], toward_mm: [900, 300, 500], field_deg: 60}\n  \
    facing: {hand: {normal: [0, 0, 1], within_deg: 70}}\n";

#[test]
#[ignore = "1500 candidates: ten seconds"]
fn hidden_postures_are_no_candidates_and_the_plan_beats_those_that_are_left() {
    let known = six(Seen::Markers(4), CAMERAS);
    let options = Options {
        candidates: 1500,
        ..many(36)
    };
    let prepared = prepare(&known, &options).unwrap_or_else(|e| panic!("{e}"));
    let counts = &prepared.counts;
    let usable = counts.feasible as f64 / (counts.feasible + counts.not_seen) as f64;
    assert!(usable < 0.7, "{usable}");
    let sigma = planned(&known, &options).sigma.expect("determined");
    // Filtered blind: the best postures for a tracker that sees everything, those that are hidden taken out, filled up at random.
    let blind_known = six(Seen::Markers(4), "");
    let blind = planned(&blind_known, &options);
    let mut kept: Vec<Candidate> = blind
        .postures
        .iter()
        .filter(|p| p.why != Why::Detour)
        .filter_map(|p| prepared.feasible.candidate(p.q.clone()).ok())
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    while kept.len() < 36 {
        let i = rng.random_range(0..prepared.candidates.len());
        kept.push(prepared.candidates[i].clone());
    }
    let filtered = sigma_of(&prepared, &kept);
    println!(
        "usable {usable:.2}, plan/filtered blind {:.3}",
        sigma / filtered
    );
    assert!(sigma <= 0.92 * filtered, "{sigma} {filtered}");
}

#[test]
fn the_same_question_has_the_same_answer() {
    let known = six(Seen::Markers(4), "");
    let model = &known.robot.model;
    let text = |plan: &Plan| plan.json(model).expect("JSON");
    let first = text(&planned(&known, &few(8)));
    assert_eq!(first, text(&planned(&known, &few(8))));
    let other = Options { seed: 2, ..few(8) };
    assert_ne!(first, text(&planned(&known, &other)));
}

#[test]
fn a_sigma_that_is_asked_for_is_reached_by_the_fewest_postures_or_refused() {
    if !skipped_tests::thorough() {
        return;
    }
    let known = six(Seen::Markers(4), "");
    let mut options = Options {
        sigma: Some(0.12e-3),
        poses: None,
        ..few(0)
    };
    options.poses = None;
    let found = planned(&known, &options);
    let measured = found
        .postures
        .iter()
        .filter(|p| p.why != Why::Detour)
        .count();
    println!("0.12 mm: {measured} postures");
    assert!(found.sigma.is_some_and(|s| s <= 0.12e-3));
    let fewer = planned(&known, &few(measured - 1));
    assert!(fewer.sigma.is_none_or(|s| s > 0.12e-3));
    options.sigma = Some(1e-7);
    let refused = plan(&known, &options).expect_err("no plan reaches it");
    let needed = |refused: PlanError| match refused {
        PlanError::NotReached { needed, .. } => needed,
        other => panic!("{other}"),
    };
    assert_eq!(needed(refused), None);
    // A little more than 200 postures reach: their number is said, and reaches it.
    let most = Options {
        candidates: 1200,
        ..few(200)
    };
    let reached = planned(&known, &most).sigma.expect("determined");
    let asked = Options {
        sigma: Some(0.93 * reached),
        poses: None,
        ..most.clone()
    };
    let number = needed(plan(&known, &asked).expect_err("beyond 200"));
    let more = Options {
        poses: Some(number.expect("a number")),
        ..most
    };
    let reached = planned(&known, &more).sigma;
    assert!(reached.is_some_and(|s| s <= asked.sigma.expect("asked")));
}

#[test]
fn what_is_written_is_read_back_and_another_robot_refuses_it() {
    let known = six(Seen::Markers(4), "");
    let model = &known.robot.model;
    let found = planned(&known, &few(16));
    let files = found.files(model, "arm.yaml").expect("files");
    let text = |name: &str| {
        let file = files.iter().find(|f| f.name == name).expect("written");
        String::from_utf8(file.bytes.clone()).expect("text")
    };
    let read = write::read(&text("plan.yaml"), "plan.yaml", model).expect("a plan");
    assert_eq!(read, found.file(model));
    let table = text("plan.csv");
    let rows = write::read_postures(table.as_bytes(), "plan.csv", model, &found.joints);
    let rows = rows.unwrap_or_else(|e| panic!("{e}\n{table}"));
    let measured = found.postures.iter().filter(|p| p.why != Why::Detour);
    let measured: Vec<_> = measured.collect();
    for (row, posture) in rows.iter().zip(&measured) {
        for (a, b) in row.iter().zip(&posture.q) {
            assert!((a - b).abs() < 2e-7, "{a} {b}");
        }
    }
    assert_eq!(rows.len(), measured.len());
    let trajectory: serde_json::Value =
        serde_json::from_str(&text("trajectory.json")).expect("JSON");
    assert_eq!(trajectory["joint_names"].as_array().map(Vec::len), Some(6));
    assert!(text("plan.html").contains("<svg") && !text("plan.html").contains("NaN"));
    let other = crate::robots::five().swap_remove(3).1;
    let error = write::read(&text("plan.yaml"), "plan.yaml", &other.robot.model);
    assert!(
        error
            .expect_err("it has no joint j5")
            .to_string()
            .contains("j5_deg")
    );
    let lines = terminal::summary(&found, "out", 80).lines().count();
    assert!(lines <= 24, "{lines}");
}

#[test]
fn there_is_no_plan_without_a_posture_and_the_error_says_why() {
    let cases = [
        (
            "plan: {ground_mm: 5000}\n",
            "the ground removes",
            "plan.ground_mm",
        ),
        (
            "plan: {keep_outs: {room: {size_mm: [9000, 9000, 9000], center: {}}}}\n",
            "keep-out `room` removes",
            "plan.keep_outs.room",
        ),
        (
            "plan: {min_cameras: 1, cameras: {c: {at_mm: [9000, 0, 0], toward_mm: [19000, 0, 0], field_deg: 20}}}\n",
            "visibility removes",
            "cameras",
        ),
        (
            "plan: {clearance_mm: 900}\n",
            "self-collision",
            "clearance_mm",
        ),
        (
            "plan: {task_box_mm: [[5000, 5000, 5000], [6000, 6000, 6000]]}\n",
            "0 of",
            "the tool reaches",
        ),
    ];
    for (extra, finding, remedy) in cases {
        let known = six(Seen::Markers(4), extra);
        let error = plan(&known, &few(12)).expect_err(extra).to_string();
        assert!(
            error.contains(finding) && error.contains(remedy),
            "{extra}: {error}"
        );
    }
}

#[test]
fn task_postures_outside_the_ranges_are_refused_with_their_row() {
    let known = six(Seen::Markers(4), "");
    let joints = known.joint_box().expect("ranges");
    let table = "pose,j1_deg,j2_deg\n0,10,20\n1,10,200\n";
    let error = write::read_postures(table.as_bytes(), "task.csv", &known.robot.model, &joints);
    let error = error.expect_err("200 deg is too far").to_string();
    assert!(error.contains("row 2") && error.contains("`j2`"), "{error}");
    let table = "pose,waist_deg\n0,10\n";
    let error = write::read_postures(table.as_bytes(), "task.csv", &known.robot.model, &joints);
    assert!(
        error
            .expect_err("an unknown joint")
            .to_string()
            .contains("waist")
    );
}

#[test]
fn a_subset_is_determined_better_by_a_plan_for_it() {
    let known = six(Seen::Markers(4), "");
    let mean = |plan: &Plan| {
        let of = plan.parameters.iter().filter(|p| p.name.contains("j5"));
        let all: Vec<f64> = of
            .filter_map(|p| Some((p.after? / p.prior?).ln()))
            .collect();
        all.iter().sum::<f64>() / all.len() as f64
    };
    let own = planned(
        &known,
        &Options {
            goal: Goal::Parameters,
            of: vec!["j5".to_owned()],
            ..few(16)
        },
    );
    let task = planned(&known, &few(16));
    assert!(mean(&own) < mean(&task), "{} {}", mean(&own), mean(&task));
}

#[test]
fn places_of_the_tool_are_a_task() {
    let known = six(Seen::Markers(4), "plan: {ground_mm: 0}\n");
    let model = &known.robot.model;
    let link = model.link_id("l6").expect("the last link").index();
    // From postures: places that are reached.
    let joints = known.joint_box().expect("ranges");
    let (feasible, _) = known.feasible(&joints, 1);
    let free = |q: &Vec<f64>| feasible.candidate(q.clone()).is_ok();
    let there: Vec<_> = joints
        .postures(40, 3)
        .into_iter()
        .filter(free)
        .take(10)
        .collect();
    assert_eq!(there.len(), 10);
    let mut with = "l6.x_m,l6.y_m,l6.z_m,l6.qx,l6.qy,l6.qz,l6.qw\n".to_owned();
    let mut without = "l6.x_m,l6.y_m,l6.z_m\n".to_owned();
    for q in &there {
        let pose = model.forward_kinematics(q)[link];
        let (p, r) = (pose.translation.vector, pose.rotation);
        with += &format!("{},{},{},{},{},{},{}\n", p.x, p.y, p.z, r.i, r.j, r.k, r.w);
        without += &format!("{},{},{}\n", p.x, p.y, p.z);
    }
    for (table, oriented) in [(&with, true), (&without, false)] {
        let task = write::read_task(table.as_bytes(), "task.csv", &known);
        let task = task.unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(task.len(), there.len());
        for (q, wanted) in task.iter().zip(&there) {
            let own = model.forward_kinematics(q)[link];
            let wanted = model.forward_kinematics(wanted)[link];
            let off = (own.translation.vector - wanted.translation.vector).norm();
            assert!(off < 1e-4, "{off}");
            if oriented {
                assert!(own.rotation.angle_to(&wanted.rotation) < 1e-3);
            }
            assert!(joints.holds(q) && free(q));
        }
        let options = Options {
            task: Some(task),
            ..few(8)
        };
        assert!(planned(&known, &options).sigma.is_some());
    }
    let far = "l6.x_m,l6.y_m,l6.z_m\n0.4,0.1,0.5\n4,0,1\n";
    // Reached with the hand straight down, 4 cm below the ground.
    let q = [0.0, 1.55, 0.02, 0.0, 0.0, 0.0];
    let p = model.forward_kinematics(&q)[link].translation.vector;
    assert!(p.z < -0.03, "{p}");
    let below = format!("l6.x_m,l6.y_m,l6.z_m\n{},{},{}\n", p.x, p.y, p.z);
    let unknown = "arm.x_m,arm.y_m,arm.z_m\n0.4,0.1,0.5\n";
    for (table, said) in [
        (far, &["row 2", "mm off", "meters"][..]),
        (&below, &["row 1", "touch", "plan.keep_outs"][..]),
        (unknown, &["`arm`", "link, body or marker"][..]),
    ] {
        let error = write::read_task(table.as_bytes(), "task.csv", &known);
        let error = error.expect_err(table).to_string();
        assert!(said.iter().all(|s| error.contains(s)), "{error}");
    }
}

#[test]
fn every_place_that_a_posture_reaches_is_found() {
    let sliding: Vec<_> = (SIX.iter().copied().enumerate())
        .map(|(i, mut joint)| {
            if i == 1 {
                (joint.1, joint.4, joint.5) = ("prismatic", -0.2, 0.3);
            }
            joint
        })
        .collect();
    let arms = [
        ("six", SIX),
        ("seven", SEVEN),
        ("three", &SIX[..3]),
        ("SCARA", SCARA),
        ("six, one of them slides", sliding.as_slice()),
    ];
    let places = if skipped_tests::thorough() { 400 } else { 60 };
    for (name, joints) in arms {
        let link = format!("l{}", joints.len());
        let known = known(robot(joints, Seen::Markers(4), false, ""));
        let model = &known.robot.model;
        let last = model.link_id(&link).expect("the last link").index();
        let joints = known.joint_box().expect("ranges");
        let mut with =
            format!("{link}.x_m,{link}.y_m,{link}.z_m,{link}.qx,{link}.qy,{link}.qz,{link}.qw\n");
        let mut without = format!("{link}.x_m,{link}.y_m,{link}.z_m\n");
        for q in joints.postures(places, 11) {
            let pose = model.forward_kinematics(&q)[last];
            let (p, r) = (pose.translation.vector, pose.rotation);
            with += &format!("{},{},{},{},{},{},{}\n", p.x, p.y, p.z, r.i, r.j, r.k, r.w);
            without += &format!("{},{},{}\n", p.x, p.y, p.z);
        }
        for table in [&with, &without] {
            let task = write::read_task(table.as_bytes(), "task.csv", &known);
            let task = task.unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(task.len(), places);
        }
    }
    // One that is out of reach says how far the tool stays away: the arm stretched towards it.
    let known = six(Seen::Markers(4), "");
    let model = &known.robot.model;
    let last = model.link_id("l6").expect("the last link").index();
    let joints = known.joint_box().expect("ranges");
    let goal = Vector3::new(3.0, 0.5, 0.8);
    let off = |q: &Vec<f64>| (model.forward_kinematics(q)[last].translation.vector - goal).norm();
    let sampled = joints
        .postures(20_000, 5)
        .iter()
        .map(off)
        .fold(f64::INFINITY, f64::min);
    let table = format!("l6.x_m,l6.y_m,l6.z_m\n{},{},{}\n", goal.x, goal.y, goal.z);
    let error = write::read_task(table.as_bytes(), "task.csv", &known).expect_err("too far");
    match error {
        calib_plan::PlanError::PlaceOutOfReach { nearest_mm, .. } => {
            assert!(
                nearest_mm * 1e-3 < sampled && nearest_mm * 1e-3 > sampled - 0.1,
                "{nearest_mm} {sampled}"
            );
        }
        other => panic!("{other}"),
    }
}

/// An arm of three joints whose second one has these limits, without shapes.
fn held(low: f64, high: f64, extra: &str) -> Known {
    let mut joints = SIX[..3].to_vec();
    (joints[1].4, joints[1].5) = (low, high);
    known(robot(&joints, Seen::Markers(4), false, extra))
}

#[test]
fn a_joint_whose_limits_leave_no_range_stands_still_and_the_plan_says_so() {
    let known = held(0.3, 0.3, "");
    let plan = planned(&known, &few(8));
    let second = known.robot.model.joint_id("j2").expect("a joint").index();
    assert!(plan.postures.iter().all(|p| p.q[second] == 0.3));
    let joints = vec!["j2".to_owned()];
    assert!(
        plan.notes.contains(&Note::NoRoom { joints }),
        "{:?}",
        plan.notes
    );
    let all = held(0.3, 0.3, "plan: {hold: {j1_deg: 0, j3_deg: 0}}\n");
    let error = plan_error(&all, &few(8));
    for said in [
        "no range to `j2`",
        "`j1`, `j3` stand still",
        "`lower` and `upper`",
    ] {
        assert!(error.contains(said), "{error}");
    }
    let all = held(
        -1.0,
        1.0,
        "plan: {hold: {j1_deg: 0, j2_deg: 0, j3_deg: 0}}\n",
    );
    let error = plan_error(&all, &few(8));
    assert!(
        error.contains("stand still") && error.contains("plan.hold"),
        "{error}"
    );
}

/// Nobody knows which limits are meant where they are exchanged.
#[test]
fn a_joint_whose_limits_are_exchanged_stands_still_and_the_plan_says_so() {
    let known = held(0.5, -0.5, "");
    let plan = planned(&known, &few(8));
    let second = known.robot.model.joint_id("j2").expect("a joint").index();
    assert!(plan.postures.iter().all(|p| p.q[second] == 0.0));
    let joints = vec!["j2".to_owned()];
    assert!(
        plan.notes.contains(&Note::NoRoom { joints }),
        "{:?}",
        plan.notes
    );
}

fn plan_error(known: &Known, options: &Options) -> String {
    let made = plan(known, options);
    made.map_or_else(|e| e.to_string(), |_| "a plan".to_owned())
}

#[test]
fn a_name_that_no_parameter_has_is_refused() {
    let known = held(-1.0, 1.0, "");
    let asked = |part: &str| Options {
        goal: Goal::Parameters,
        of: vec!["j2".to_owned(), part.to_owned()],
        ..few(8)
    };
    let error = plan_error(&known, &asked("ofset"));
    for said in ["--of ofset", "did you mean `offset`?", "j1."] {
        assert!(error.contains(said), "{error}");
    }
    assert!(plan(&known, &asked("offset")).is_ok());
}

#[test]
fn surroundings_that_nothing_is_compared_with_come_first_among_the_notes() {
    let extra = "plan: {ground_mm: 0, keep_outs: {desk: {size_mm: [900, 900, 900], center: {}}}}\n";
    let plan = planned(&held(-1.0, 1.0, extra), &few(8));
    let first = plan.notes.first();
    let is_first = matches!(first, Some(Note::SurroundingsUnchecked { .. }));
    assert!(is_first, "{:?}", plan.notes);
    let screen = terminal::summary(&plan, "out", 80);
    let words: Vec<&str> = screen.split_whitespace().collect();
    let said = words.join(" ");
    for part in [
        "`plan.ground_mm`, `plan.keep_outs.desk` are",
        "`l3`",
        "<collision>",
    ] {
        assert!(said.contains(part), "{said}");
    }
    // However many other notes and links there are, and wherever it stands, it is the first and is not cut.
    let mut many = plan.clone();
    let other = |k: usize| Note::MountAssumed {
        body: format!("body_{k}"),
    };
    many.notes = (0..12).map(other).chain(plan.notes.clone()).collect();
    for note in &mut many.notes {
        if let Note::SurroundingsUnchecked { links, .. } = note {
            *links = (0..40).map(|k| format!("link_{k}")).collect();
        }
    }
    let screen = terminal::summary(&many, "out", 80);
    let words: Vec<&str> = screen.split_whitespace().collect();
    let (said, first) = (
        words.join(" "),
        screen.lines().find(|l| l.starts_with("note: ")),
    );
    assert!(
        first.is_some_and(|l| l.contains("`plan.ground_mm`")),
        "{screen}"
    );
    assert!(
        said.contains("`link_2`, and 37 more. The plan may move them through. Give links"),
        "{screen}"
    );
    assert!(screen.contains("more in plan.html"), "{screen}");
    assert!(screen.lines().count() <= 24, "{screen}");
    let stated = planned(&six(Seen::Markers(4), "plan: {ground_mm: -900}\n"), &few(8));
    let checked = |n: &Note| !matches!(n, Note::SurroundingsUnchecked { .. });
    assert!(stated.notes.iter().all(checked));
}
