//! `calib drift` keeps its promise: an unchanged robot is said to have changed in 1 % of the comparisons at most, whatever
//! conventions, priors and mounts are in between, and a real change is found.

use calib_drift::{Drift, Evidence, FALSE_ALARMS, Undecided, compare};
use calib_report::{
    DataInformation, Input, Noise, NoiseKind, Output, Parameter, Quantity, Report, Term, Unit,
};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Parameters: name, belongs to the robot, σ of the prior.
const PARAMETERS: [(&str, bool, Option<f64>); 9] = [
    ("shoulder.x", true, Some(0.01)),
    ("shoulder.y", true, Some(0.01)),
    ("elbow.x", true, Some(0.01)),
    ("elbow.z", true, Some(0.01)),
    ("elbow.offset", true, Some(0.02)),
    ("wrist.turn", true, Some(0.02)),
    ("world.x", false, None),
    ("mount.x", false, None),
    ("mount.z", false, Some(0.05)),
];
/// Rows of a recording.
const ROWS: usize = 60;
/// Noise of a row.
const SIGMA: f64 = 2e-4;

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}

/// Poses of a recording: every session has its own. Two gauges: shoulder.x is the world's, elbow.offset the wrist's turn.
fn jacobian(rng: &mut ChaCha8Rng, rows: usize) -> DMatrix<f64> {
    let mut j = DMatrix::from_fn(rows, PARAMETERS.len(), |_, _| normal(rng));
    for r in 0..rows {
        j[(r, 6)] = j[(r, 0)];
        j[(r, 5)] = j[(r, 4)];
    }
    j
}

/// The report of one session on a robot with these parameters; tracker and bodies stand anywhere.
fn session(rng: &mut ChaCha8Rng, robot: &[f64; 6]) -> Report {
    session_of(rng, robot, ROWS, SIGMA)
}

/// The same of so many rows with this noise.
fn session_of(rng: &mut ChaCha8Rng, robot: &[f64; 6], rows: usize, noise: f64) -> Report {
    let n = PARAMETERS.len();
    let j = jacobian(rng, rows);
    let mut truth = DVector::zeros(n);
    for i in 0..n {
        truth[i] = robot.get(i).copied().unwrap_or_else(|| 0.02 * normal(rng));
    }
    let seen = &j * truth + DVector::from_fn(rows, |_, _| noise * normal(rng));
    // The noise is found from the residuals of the fit by the data alone.
    let free: Vec<usize> = (0..n).filter(|i| ![5, 6].contains(i)).collect();
    let reduced = j.select_columns(&free);
    let normal_matrix = reduced.transpose() * &reduced;
    let solved = normal_matrix
        .cholesky()
        .expect("full rank")
        .solve(&(reduced.transpose() * &seen));
    let dof = (rows - free.len()) as f64;
    let sigma = ((&seen - &reduced * solved).norm_squared() / dof).sqrt();
    let white = &j / sigma;
    let mut h = white.transpose() * &white;
    for (i, (_, _, prior)) in PARAMETERS.iter().enumerate() {
        h[(i, i)] += prior.map_or(0.0, |s| 1.0 / (s * s));
    }
    let found = h
        .cholesky()
        .expect("priors")
        .solve(&(white.transpose() * (seen / sigma)));
    let root = white.qr().r();
    Report {
        robot: "arm".to_owned(),
        parameters: PARAMETERS
            .iter()
            .enumerate()
            .map(|(i, (name, robot, _))| Parameter {
                name: (*name).to_owned(),
                kind: "translation".to_owned(),
                joint: robot.then(|| name.split('.').next().unwrap_or("").to_owned()),
                unit: Unit::Meter,
                value: found[i],
                ..Parameter::default()
            })
            .collect(),
        data_information: Some(DataInformation {
            parameters: PARAMETERS.iter().map(|p| p.0.to_owned()).collect(),
            prior_sigma: PARAMETERS.iter().map(|p| p.2).collect(),
            root: (0..n)
                .map(|r| root.view((r, r), (1, n - r)).iter().copied().collect())
                .collect(),
            degrees_of_freedom: dof,
            effect_signs: None,
            quantities: vec![Quantity {
                name: "zero.elbow".to_owned(),
                text: "zero of the elbow".to_owned(),
                unit: Unit::Meter,
                value: found[4] + found[5],
                gradient: ["elbow.offset", "wrist.turn"]
                    .map(|p| Term {
                        parameter: p.to_owned(),
                        coefficient: 1.0,
                    })
                    .to_vec(),
            }],
        }),
        inputs: vec![Input {
            path: "arm.urdf".to_owned(),
            sha256: "0".to_owned(),
        }],
        outputs: vec![Output {
            changes: Some("arm.urdf".to_owned()),
            ..Output::default()
        }],
        ..Report::default()
    }
}

fn drift(rng: &mut ChaCha8Rng, old: &[f64; 6], new: &[f64; 6]) -> Drift {
    let evidence = |report: Report| Evidence::of(&report, "report.json").expect("a report");
    let (old, new) = (session(rng, old), session(rng, new));
    compare(&evidence(old), &evidence(new)).expect("one robot")
}

const ROBOT: [f64; 6] = [0.004, -0.012, 0.008, 0.003, -0.015, 0.011];
/// The same robot in other conventions: what both recordings see is the sum of the last two.
const SAME_ROBOT: [f64; 6] = [0.054, -0.012, 0.008, 0.003, 0.015, -0.019];

/// More than this many standard deviations of a binomial count from its mean happen once in 30 000 tests.
const FAR: f64 = 4.0;

#[test]
fn an_unchanged_robot_is_called_changed_in_one_percent_at_most() {
    /// 1 % ± 0.13 %: a rate of 1.6 % or of 0.3 % would be seen.
    const PAIRS: usize = 6000;
    let mut rng = ChaCha8Rng::seed_from_u64(71);
    let (mut alarms, mut joint_5_percent, mut numbers, mut numbers_5_percent) = (0, 0, 0, 0);
    for _ in 0..PAIRS {
        let found = drift(&mut rng, &ROBOT, &SAME_ROBOT);
        // 4 numbers of the robot are seen by both: shoulder.y, elbow.x, elbow.z, and the sum.
        assert_eq!(found.joint.degrees_of_freedom, 4);
        assert_eq!(found.numbers.len(), 4);
        alarms += usize::from(found.changed);
        joint_5_percent += usize::from(found.joint.p_value < 0.05);
        numbers += found.numbers.len();
        numbers_5_percent += found.numbers.iter().filter(|n| n.p_value < 0.05).count();
    }
    let spread = |p: f64, n: usize| (p * (1.0 - p) / n as f64).sqrt();
    let rate = alarms as f64 / PAIRS as f64;
    println!("{PAIRS} pairs: {alarms} alarms, {:.2} %", 100.0 * rate);
    assert!(
        rate < FALSE_ALARMS + FAR * spread(FALSE_ALARMS, PAIRS),
        "{rate}"
    );
    // Two tests at half a percent each, which overlap: not a test that never speaks either.
    assert!(
        rate > 0.5 * FALSE_ALARMS - FAR * spread(0.5 * FALSE_ALARMS, PAIRS),
        "{rate}"
    );
    let joint = joint_5_percent as f64 / PAIRS as f64;
    println!("all at once at 5 %: {:.2} %", 100.0 * joint);
    assert!((joint - 0.05).abs() < FAR * spread(0.05, PAIRS), "{joint}");
    let single = numbers_5_percent as f64 / numbers as f64;
    println!("each number at 5 %: {:.2} %", 100.0 * single);
    // Four numbers of a pair belong together.
    assert!(
        (single - 0.05).abs() < FAR * spread(0.05, PAIRS),
        "{single}"
    );
}

/// Few postures on one side or on both, and noise that differs: 1 % all the same, from the same nominal URDF and from another.
#[test]
fn few_postures_do_not_raise_more_alarms() {
    const PAIRS: usize = 3000;
    for (rows, noise) in [
        ([14, 14], [SIGMA, SIGMA]),
        ([14, 60], [SIGMA, SIGMA]),
        ([14, 60], [4.0 * SIGMA, SIGMA]),
        ([20, 200], [SIGMA, 3.0 * SIGMA]),
    ] {
        for same_nominal in [true, false] {
            let mut rng = ChaCha8Rng::seed_from_u64(77);
            let (mut alarms, mut joint, mut single, mut numbers) = (0, 0, 0, 0);
            for _ in 0..PAIRS {
                let old = session_of(&mut rng, &ROBOT, rows[0], noise[0]);
                let mut new = session_of(&mut rng, &SAME_ROBOT, rows[1], noise[1]);
                if !same_nominal {
                    new.inputs[0].sha256 = "1".to_owned();
                }
                let of = |r: &Report| Evidence::of(r, "report.json").expect("a report");
                let found = compare(&of(&old), &of(&new)).expect("one robot");
                assert_eq!(found.same_nominal, same_nominal);
                alarms += usize::from(found.changed);
                joint += usize::from(found.joint.p_value < 0.01);
                numbers += found.numbers.len();
                single += found.numbers.iter().filter(|n| n.p_value < 0.01).count();
            }
            let rate = |count: usize, of: usize| count as f64 / of as f64;
            let spread = (0.01 * 0.99 / PAIRS as f64).sqrt();
            let rates = [
                rate(alarms, PAIRS),
                rate(joint, PAIRS),
                rate(single, numbers.max(1)),
            ];
            println!(
                "{rows:?} {noise:?} {same_nominal}: alarms, all at once and single numbers at 1 %: {rates:?}"
            );
            for rate in rates {
                assert!(
                    rate < 0.01 + FAR * spread,
                    "{rows:?} {noise:?} {same_nominal}: {rates:?}"
                );
            }
            assert!(rates[1] > 0.01 - FAR * spread && numbers > 0, "{rates:?}");
        }
    }
}

#[test]
fn a_real_change_is_found_and_named() {
    /// 98 % ± 0.7 %.
    const PAIRS: usize = 400;
    let mut rng = ChaCha8Rng::seed_from_u64(72);
    let mut moved = SAME_ROBOT;
    // σ of a change is about 0.2 mm · √2 / √60 = 0.037 mm: this is six of them.
    const SHIFT: f64 = 0.22e-3;
    moved[2] += SHIFT;
    let (mut found, mut named, mut wrong) = (0, 0, 0);
    let mut sum = 0.0;
    for _ in 0..PAIRS {
        let drift = drift(&mut rng, &ROBOT, &moved);
        found += usize::from(drift.changed);
        for number in drift.numbers.iter().filter(|n| n.significant) {
            match number.name.as_str() {
                "elbow.x" => named += 1,
                _ => wrong += 1,
            }
        }
        let elbow = drift
            .numbers
            .iter()
            .find(|n| n.name == "elbow.x")
            .expect("elbow.x");
        sum += (elbow.change - SHIFT) / elbow.sigma;
    }
    println!("{PAIRS} pairs: found {found}, named {named}, named something else {wrong}");
    assert!(found >= 376, "power {found} of {PAIRS}");
    assert!(named >= 368, "power {named} of {PAIRS}");
    // At most half a percent of the pairs, binomially.
    assert!(wrong <= 8, "{wrong} of {PAIRS}");
    // The size of the change is not pulled towards the prior.
    let bias = sum / (PAIRS as f64).sqrt();
    assert!(bias.abs() < FAR, "{bias}");
}

#[test]
fn a_gauge_free_sum_changes_where_its_parts_are_conventions() {
    let mut rng = ChaCha8Rng::seed_from_u64(73);
    let mut moved = SAME_ROBOT;
    moved[5] += 1e-3;
    let drift = drift(&mut rng, &ROBOT, &moved);
    let names: Vec<&str> = drift
        .numbers
        .iter()
        .filter(|n| n.significant)
        .map(|n| n.name.as_str())
        .collect();
    assert_eq!(names, ["zero.elbow"]);
    assert_eq!(
        drift.known_in_neither,
        ["shoulder.x", "elbow.offset", "wrist.turn"]
    );
    let sum = &drift.numbers[0];
    assert!((sum.change - 1e-3).abs() < 5.0 * sum.sigma && sum.sigma < 1e-4);
}

#[test]
fn parameters_of_one_calibration_only_are_named() {
    let mut rng = ChaCha8Rng::seed_from_u64(74);
    let (old, mut new) = (session(&mut rng, &ROBOT), session(&mut rng, &ROBOT));
    new.parameters[2].name = "elbow.gain".to_owned();
    let info = new.data_information.as_mut().expect("information");
    info.parameters[2] = "elbow.gain".to_owned();
    let of = |r: &Report| Evidence::of(r, "report.json").expect("a report");
    let drift = compare(&of(&old), &of(&new)).expect("one robot");
    assert_eq!(drift.only_old, ["elbow.x"]);
    assert_eq!(drift.only_new, ["elbow.gain"]);
    assert_eq!(drift.joint.degrees_of_freedom, 3);
}

/// What one of them holds, the rest makes up for.
#[test]
fn a_difference_of_calibrations_with_other_parameters_is_not_decided() {
    let mut rng = ChaCha8Rng::seed_from_u64(80);
    let of = |r: &Report| Evidence::of(r, "report.json").expect("a report");
    let mut moved = SAME_ROBOT;
    moved[3] += 2e-3;
    let (old, mut new) = (session(&mut rng, &ROBOT), session(&mut rng, &moved));
    assert!(compare(&of(&old), &of(&new)).expect("one robot").changed);
    new.parameters[2].name = "elbow.gain".to_owned();
    let info = new.data_information.as_mut().expect("information");
    info.parameters[2] = "elbow.gain".to_owned();
    let drift = compare(&of(&old), &of(&new)).expect("one robot");
    assert!(!drift.changed && drift.joint.significant);
    assert_eq!(drift.undecided, Some(Undecided::OtherParameters));
    let text = calib_drift::text(&drift, 80);
    assert!(text.contains("NOT DECIDED"), "{text}");
    assert!(text.lines().all(|l| l.chars().count() <= 80), "{text}");
}

/// A level of one degree of freedom hides what the residuals show; an unchanged robot is unchanged beside it.
#[test]
fn a_difference_that_a_hardly_known_noise_hides_is_not_decided() {
    let mut rng = ChaCha8Rng::seed_from_u64(81);
    let of = |r: &Report| Evidence::of(r, "report.json").expect("a report");
    let mut undecided = 0;
    for by in [0.0, 6e-4] {
        for _ in 0..50 {
            let mut moved = SAME_ROBOT;
            moved[3] += by;
            let (old, mut new) = (session(&mut rng, &ROBOT), session(&mut rng, &moved));
            new.noise.push(Noise {
                kind: NoiseKind::Orientation,
                relative_error: Some(0.65),
                ..Noise::default()
            });
            let drift = compare(&of(&old), &of(&new)).expect("one robot");
            let hidden = drift.undecided == Some(Undecided::NoiseHardlyKnown);
            undecided += usize::from(by == 0.0 && hidden);
            assert!(!drift.changed);
            assert!(by == 0.0 || hidden, "{drift:#?}");
        }
    }
    assert!(undecided <= 3, "{undecided} of 50 unchanged robots");
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let mut rng = ChaCha8Rng::seed_from_u64(75);
    let report = session(&mut rng, &ROBOT);
    let of = |r: &Report| Evidence::of(r, "report.json");
    let good = of(&report).expect("a report");
    let mut said = Vec::new();
    for change in [
        |r: &mut Report| r.data_information = None,
        |r: &mut Report| r.parameters.truncate(3),
        |r: &mut Report| {
            if let Some(info) = &mut r.data_information {
                info.root.truncate(3);
            }
        },
        |r: &mut Report| {
            if let Some(info) = &mut r.data_information {
                info.parameters.clear();
            }
        },
        |r: &mut Report| r.robot = "leg".to_owned(),
        |r: &mut Report| {
            for p in &mut r.parameters {
                p.joint = None;
            }
        },
    ] {
        let mut other = report.clone();
        change(&mut other);
        let refused = of(&other).and_then(|other| compare(&good, &other));
        said.push(refused.expect_err("a refusal").to_string());
    }
    insta::assert_snapshot!(said.join("\n---\n"));
}

/// The second calibration starts from the URDF that the first was applied to: only what does not depend on it is compared, with the same
/// rate of false alarms.
#[test]
fn other_nominal_urdfs_are_compared_by_what_does_not_depend_on_them() {
    /// 1 % ± 0.2 %.
    const PAIRS: usize = 2000;
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    let of = |r: &Report| Evidence::of(r, "report.json").expect("a report");
    let applied = |mut report: Report| {
        report.inputs[0].sha256 = "1".to_owned();
        report
    };
    let mut alarms = 0;
    for _ in 0..PAIRS {
        let (old, new) = (session(&mut rng, &ROBOT), session(&mut rng, &SAME_ROBOT));
        let found = compare(&of(&old), &of(&applied(new))).expect("one robot");
        assert!(!found.same_nominal);
        let names: Vec<&str> = found.numbers.iter().map(|n| n.name.as_str()).collect();
        assert_eq!(
            (found.joint.degrees_of_freedom, names),
            (1, vec!["zero.elbow"])
        );
        alarms += usize::from(found.changed);
    }
    let rate = alarms as f64 / PAIRS as f64;
    println!(
        "{PAIRS} pairs from two nominal URDFs: {alarms} alarms, {:.2} %",
        100.0 * rate
    );
    let spread = (FALSE_ALARMS * (1.0 - FALSE_ALARMS) / PAIRS as f64).sqrt();
    assert!(rate < FALSE_ALARMS + FAR * spread, "{rate}");
    let mut moved = SAME_ROBOT;
    moved[5] += 1e-3;
    let (old, new) = (session(&mut rng, &ROBOT), session(&mut rng, &moved));
    let found = compare(&of(&old), &of(&applied(new))).expect("one robot");
    assert!(found.numbers[0].significant && found.joint.significant);
}

/// A direction that a recording hardly sees is no evidence: its linear step would be as long as the robot.
#[test]
fn what_a_recording_hardly_sees_is_left_out() {
    let mut rng = ChaCha8Rng::seed_from_u64(78);
    let of = |r: &Report| Evidence::of(r, "report.json").expect("a report");
    let (old, mut new) = (session(&mut rng, &ROBOT), session(&mut rng, &SAME_ROBOT));
    // elbow.x: σ of 5 cm by the data alone, and an estimate that the prior holds.
    if let Some(info) = &mut new.data_information {
        for (r, row) in info.root.iter_mut().enumerate() {
            if let Some(entry) = 2_usize.checked_sub(r).and_then(|c| row.get_mut(c)) {
                *entry *= if r == 2 {
                    0.05_f64.recip() / *entry
                } else {
                    0.0
                };
            }
            if r == 2 {
                row.iter_mut().skip(1).for_each(|x| *x = 0.0);
            }
        }
    }
    let found = compare(&of(&old), &of(&new)).expect("one robot");
    assert_eq!(found.not_credible, ["elbow.x"]);
    assert_eq!(
        (
            found.directions_not_credible,
            found.joint.degrees_of_freedom
        ),
        (1, 3)
    );
    assert!(!found.changed, "{found:?}");
    let text = calib_drift::text(&found, 80);
    assert!(text.contains("too far for the linear comparison"), "{text}");
}

/// Many σ of a noise that few degrees of freedom tell are not significant: the text says why, and does not call them small.
#[test]
fn many_sigmas_of_few_degrees_of_freedom_are_called_not_significant() {
    let mut rng = ChaCha8Rng::seed_from_u64(79);
    let of = |r: &Report| Evidence::of(r, "report.json").expect("a report");
    let mut moved = SAME_ROBOT;
    moved[3] += 6e-4;
    let (old, mut new) = (session(&mut rng, &ROBOT), session(&mut rng, &moved));
    if let Some(info) = &mut new.data_information {
        info.degrees_of_freedom = 1.0;
    }
    let found = compare(&of(&old), &of(&new)).expect("one robot");
    let number = (found.numbers.iter())
        .find(|n| n.name == "elbow.z")
        .expect("a number of both");
    assert!(number.change / number.sigma > 5.0 && !number.significant);
    let mut text = found.clone();
    // As an invariant: only those are listed where they did not change.
    text.numbers
        .iter_mut()
        .for_each(|n| n.gauge_free = n.name == "elbow.z");
    let text = calib_drift::text(&text, 80);
    let line = text
        .lines()
        .find(|l| l.contains("elbow.z"))
        .expect("a line");
    assert!(
        text.contains("Not significant at the level of 0.5 %"),
        "{text}"
    );
    let said = format!(
        "{:.0} dof, p {:.2})",
        number.degrees_of_freedom, number.p_adjusted
    );
    assert!(line.ends_with(&said), "{line}");
    assert!(!text.contains("Within its uncertainty"), "{text}");
    assert!(text.lines().all(|l| l.chars().count() <= 80), "{text}");
}

/// A number that is not finite, or a root of zeros, is no panic and no NaN.
#[test]
fn degenerate_information_stays_finite() {
    let mut rng = ChaCha8Rng::seed_from_u64(76);
    let report = session(&mut rng, &ROBOT);
    let mut zero = report.clone();
    if let Some(info) = &mut zero.data_information {
        for row in &mut info.root {
            row.iter_mut().for_each(|x| *x = 0.0);
        }
        info.degrees_of_freedom = 0.0;
    }
    let of = |r: &Report| Evidence::of(r, "report.json");
    let drift = compare(
        &of(&report).expect("a report"),
        &of(&zero).expect("a report"),
    );
    let drift = drift.expect("one robot");
    assert!(!drift.changed && drift.joint.degrees_of_freedom == 0 && drift.joint.p_value == 1.0);
    assert!(drift.numbers.is_empty());
}

/// A compliance that lifts in one report and gives way in the other would look like a change, or hide one.
#[test]
fn reports_from_before_the_signs_of_loads_were_stated_are_refused_where_it_matters() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut report = session(&mut rng, &[0.0; 6]);
    assert!(Evidence::of(&report, "old").is_ok());
    for kind in ["torque_compliance", "lateral_compliance", "backlash"] {
        report.parameters[2].kind = kind.to_owned();
        let refused = Evidence::of(&report, "old").expect_err("no signs");
        assert!(refused.is_refusal());
        let said = refused.to_string();
        assert!(
            said.contains("`elbow.x`") && said.contains("run that calibration again"),
            "{said}"
        );
        let mut stated = report.clone();
        stated
            .data_information
            .as_mut()
            .expect("there")
            .effect_signs = Some(2);
        assert!(Evidence::of(&stated, "new").is_ok());
    }
}
