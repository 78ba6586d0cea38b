//! The choice of effects by prediction: none where there is none, the right ones where there are some, and the error that it states.

mod bound;

use std::collections::{BTreeMap, BTreeSet};

use crate::common::{Chain, Free, Handles, normal, rng, six_r};
use calib_core::{
    Axis, Chart, Configuration, EdgeKind, EffectKind, FrameId, NestedError, ParameterId, Part,
    Problem, Selection, SelectionRule, Settings, StepOutcome, select, solve,
};
use nalgebra::Point3;
use rand::RngExt;

const DEG: f64 = std::f64::consts::PI / 180.0;

/// One effect of one joint, with its coefficients.
#[derive(Debug, Clone, PartialEq)]
struct Truth {
    joint: usize,
    effect: &'static str,
    /// In units of the largest that is drawn.
    coefficients: Vec<f64>,
    other: usize,
}

/// A robot with effects, its recording, and everything that a model could have.
struct Robot {
    problem: Problem,
    parts: Vec<Part>,
    /// Offsets and axes.
    first: BTreeSet<usize>,
    /// The parts that the robot has.
    truth: BTreeSet<usize>,
    /// What each part is called.
    names: Vec<String>,
    tracker: FrameId,
    body: FrameId,
    /// One point of the body, and where it is in each new pose.
    point: Point3<f64>,
    places: Vec<Point3<f64>>,
}

/// What is drawn.
#[derive(Debug, Clone, Copy)]
struct Design {
    poses: usize,
    markers: usize,
    joint_noise: f64,
    sigma: f64,
    /// One joint after the other moves, over so many poses each in place of random ones.
    sweeps: Option<usize>,
}

impl Default for Design {
    fn default() -> Self {
        Self {
            poses: 60,
            markers: 4,
            joint_noise: 0.005 * DEG,
            sigma: 3e-4,
            sweeps: None,
        }
    }
}

/// One joint after the other from end to end, the others at rest.
fn one_joint_at_a_time(each: usize) -> Vec<Vec<f64>> {
    const HOME: [f64; 6] = [0.2, -0.6, 0.9, 0.3, -0.7, 0.4];
    let at = |k: usize| {
        let mut q = HOME.to_vec();
        q[k / each] = 2.8 * ((k % each) as f64 / (each - 1) as f64 - 0.5);
        q
    };
    (0..6 * each).map(at).collect()
}

/// Prior σ of axes and offsets: rotation, rad, and translation, m.
const PRIOR: (f64, f64) = (DEG, 0.01);
/// How far they are off.
const DEVIATION: (f64, f64) = (0.3 * DEG, 0.001);

/// Samples without noise that no fit sees.
const NEW: usize = 100;

/// Terms of an effect, prior σ, the largest that is drawn.
const EFFECTS: [(&str, &[EffectKind], f64, f64); 6] = [
    ("gain", &[EffectKind::Gain], 0.01, 0.005),
    (
        "eccentricity",
        &[EffectKind::EccentricityCos, EffectKind::EccentricitySin],
        0.2 * DEG,
        0.2 * DEG,
    ),
    (
        "eccentricity_2",
        &[EffectKind::Eccentricity2Cos, EffectKind::Eccentricity2Sin],
        0.1 * DEG,
        0.1 * DEG,
    ),
    (
        "compliance",
        &[EffectKind::TorqueCompliance],
        0.02 * DEG,
        0.01 * DEG,
    ),
    ("backlash", &[EffectKind::Backlash], 0.2 * DEG, 0.1 * DEG),
    ("coupling", &[EffectKind::Coupling], 1.0, 0.01),
];

/// Regressors per effect term, joint, sample; of couplings per other joint.
struct Regressors {
    q: Vec<Vec<f64>>,
    torque: Vec<Vec<f64>>,
    approach: Vec<Vec<f64>>,
}

impl Regressors {
    fn of(&self, kind: EffectKind, joint: usize, other: usize, s: usize) -> f64 {
        let q = self.q[s][joint];
        match kind {
            EffectKind::Gain => q,
            EffectKind::EccentricityCos => q.cos() - 1.0,
            EffectKind::EccentricitySin => q.sin(),
            EffectKind::Eccentricity2Cos => (2.0 * q).cos() - 1.0,
            EffectKind::Eccentricity2Sin => (2.0 * q).sin(),
            EffectKind::TorqueCompliance => self.torque[joint][s],
            EffectKind::Backlash => self.approach[joint][s],
            EffectKind::Coupling => self.q[s][other],
            _ => 0.0,
        }
    }
}

fn draw(seed: u64, count: usize, least: f64) -> Vec<Truth> {
    let mut r = rng(seed);
    let mut out: Vec<Truth> = Vec::new();
    while out.len() < count {
        let (joint, e) = (r.random_range(0..6), r.random_range(0..EFFECTS.len()));
        let (effect, kinds, _, largest) = EFFECTS[e];
        // A body sees no effect of the reading alone at the last joint better than its mount.
        if out.iter().any(|t| t.joint == joint && t.effect == effect) {
            continue;
        }
        let other = (joint + 1 + r.random_range(0..5)) % 6;
        let size = largest * r.random_range(least..1.0);
        let direction: f64 = r.random_range(0.0..std::f64::consts::TAU);
        let coefficients = match kinds.len() {
            1 => vec![if direction < std::f64::consts::PI {
                size
            } else {
                -size
            }],
            _ => vec![size * direction.cos(), size * direction.sin()],
        };
        out.push(Truth {
            joint,
            effect,
            coefficients,
            other,
        });
    }
    out
}

/// An arm at its poses, what of it is free, and what its effects follow.
fn scene(seed: u64, design: Design) -> (Chain, Free, Regressors) {
    let mut r = rng(seed);
    let free = Free {
        world: Chart::full(),
        origins: six_r()
            .iter()
            .map(|l| match &l.axis {
                Axis::Revolute(a) | Axis::Prismatic(a) => Chart::axis_line(a),
            })
            .collect(),
        offsets: vec![true; 6],
        mount: Chart::full(),
        points: false,
        prior: Some(PRIOR),
    };
    let mut chain = Chain::nominal(six_r())
        .posed(&mut r, design.poses + NEW, 1.4)
        .deviate(&mut r, &free, DEVIATION.0, DEVIATION.1);
    chain.markers.truncate(design.markers);
    if let Some(each) = design.sweeps {
        let rows = one_joint_at_a_time(each);
        chain.q.splice(..design.poses, rows);
    }
    let n = chain.q.len();
    let mut table = |scale: f64| -> Vec<Vec<f64>> {
        (0..6)
            .map(|_| (0..n).map(|_| r.random_range(-scale..scale)).collect())
            .collect()
    };
    let regressors = Regressors {
        q: chain.q.clone(),
        torque: table(40.0),
        approach: table(1.0)
            .into_iter()
            .map(|v| v.into_iter().map(f64::signum).collect())
            .collect(),
    };
    (chain, free, regressors)
}

fn robot(seed: u64, design: Design, effects: &[Truth]) -> Robot {
    let (chain, free, regressors) = scene(seed, design);
    let n = chain.q.len();
    let mut h = chain.problem(&free, design.sigma);
    h.problem.group_mut(h.markers).estimate = true;
    let noise = h
        .problem
        .noise_group("joint", calib_core::NoiseKind::Joint, 0.01 * DEG, true);
    for edge in h.joints.clone() {
        h.problem.joint_noise(edge, noise);
    }
    let moved = |s: usize| {
        let mut extra = [0.0; 6];
        for t in effects {
            let kinds = EFFECTS.iter().find(|e| e.0 == t.effect).unwrap().1;
            for (kind, c) in kinds.iter().zip(&t.coefficients) {
                extra[t.joint] += c * regressors.of(*kind, t.joint, t.other, s);
            }
        }
        extra
    };
    observe(&chain, &mut h, seed, design, moved);
    let point = chain.markers[0];
    let places = (design.poses..n)
        .map(|s| chain.tracker_from_body(&chain.q[s], &moved(s)) * point)
        .collect();
    h.problem.held_out = (design.poses..n).collect();
    let (parts, names, first) = everything(&mut h, &regressors);
    let truth = effects
        .iter()
        .map(|t| {
            let name = name_of(t.joint, t.effect, t.other);
            names.iter().position(|n| *n == name).unwrap()
        })
        .chain(first.iter().copied())
        .collect();
    Robot {
        tracker: h.tracker,
        body: h.body,
        point,
        places,
        problem: h.problem,
        parts,
        first,
        truth,
        names,
    }
}

fn name_of(joint: usize, effect: &str, other: usize) -> String {
    match effect {
        "coupling" => format!("j{}.coupling.j{}", joint + 1, other + 1),
        _ => format!("j{}.{effect}", joint + 1),
    }
}

/// Markers with noise in the samples that are fitted, without in the others.
fn observe(
    chain: &Chain,
    h: &mut Handles,
    seed: u64,
    design: Design,
    extra: impl Fn(usize) -> [f64; 6],
) {
    let mut r = rng(seed + 1_000_003);
    let mut seen = Vec::new();
    for (s, q) in chain.q.iter().enumerate() {
        let noisy = f64::from(u8::from(s < design.poses));
        let mut moved = extra(s);
        for m in &mut moved {
            *m += noisy * design.joint_noise * normal(&mut r);
        }
        let x = chain.tracker_from_body(q, &moved);
        for (m, p) in chain.markers.iter().enumerate() {
            seen.push(calib_core::MarkerObservation {
                sample: s,
                point: h.points[m],
                position: x * p + crate::common::normal3(&mut r) * design.sigma * noisy,
                shape: None,
            });
        }
    }
    h.problem
        .markers("body", h.tracker, h.body, h.markers, seen);
}

/// Frees everything, and says what belongs together.
fn everything(
    h: &mut Handles,
    regressors: &Regressors,
) -> (Vec<Part>, Vec<String>, BTreeSet<usize>) {
    let (mut parts, mut names, mut first) = (Vec::new(), Vec::new(), BTreeSet::new());
    let mut add = |name: String, parameters: Vec<ParameterId>, place: u8| {
        names.push(name);
        parts.push(Part { parameters, place });
        parts.len() - 1
    };
    let n = regressors.q.len();
    for j in 0..6 {
        let EdgeKind::Unknown(origin) = &h.problem.edges()[h.origins[j].index()].kind else {
            panic!("an origin is unknown");
        };
        let axes = origin.parameters.iter().flatten().copied().collect();
        first.insert(add(format!("j{}.axis", j + 1), axes, 2));
        let EdgeKind::Joint(joint) = &h.problem.edges()[h.joints[j].index()].kind else {
            panic!("a joint");
        };
        let offset = vec![joint.effects[0].parameter];
        first.insert(add(format!("j{}.offset", j + 1), offset, 1));
    }
    let mut of_effect: BTreeMap<&str, Vec<ParameterId>> = BTreeMap::new();
    for j in 0..6 {
        for (place, (effect, kinds, sigma, _)) in EFFECTS.iter().enumerate() {
            let others: Vec<usize> = match *effect {
                "coupling" => (0..6).filter(|o| *o != j).collect(),
                _ => vec![j],
            };
            for other in others {
                let ids: Vec<ParameterId> = kinds
                    .iter()
                    .map(|kind| {
                        let values = (0..n).map(|s| regressors.of(*kind, j, other, s));
                        let values = values.collect();
                        h.problem
                            .free_effect_with(h.joints[j], *kind, values, Some(*sigma))
                    })
                    .collect();
                if *effect != "coupling" {
                    of_effect.entry(effect).or_default().extend(&ids);
                }
                add(name_of(j, effect, other), ids, 3 + place as u8);
            }
        }
    }
    for (effect, ids) in of_effect {
        add(format!("all.{effect}"), ids, 20);
    }
    (parts, names, first)
}

impl Robot {
    fn select(&self) -> Selection {
        let rule = SelectionRule::default();
        select(
            &self.problem,
            &self.parts,
            &self.first,
            &Settings::default(),
            &rule,
            &mut |_| {},
        )
        .unwrap()
    }

    /// The problem with these parts free.
    fn with(&self, parts: &BTreeSet<usize>) -> Problem {
        let mut problem = self.problem.clone();
        let free: BTreeSet<ParameterId> = parts
            .iter()
            .flat_map(|p| self.parts[*p].parameters.clone())
            .collect();
        for id in self.parts.iter().flat_map(|p| &p.parameters) {
            problem.parameter_mut(*id).fixed = !free.contains(id);
        }
        problem
    }

    /// The likeliest model of as many parts as the robot has, by exchanges from the true one (Akaike's 2 a parameter): what a
    /// choice could do at best that knew their number.
    fn of_true_size(&self) -> BTreeSet<usize> {
        let noise = solve(&self.with(&self.truth), &Settings::default())
            .unwrap()
            .noise;
        let cost = |parts: &BTreeSet<usize>| {
            let mut problem = self.with(parts);
            for level in &noise {
                let group = problem.group_mut(level.id);
                (group.sigma, group.estimate) = (level.sigma, false);
            }
            let free = parts.iter().map(|p| self.parts[*p].parameters.len());
            solve(&problem, &Settings::plain()).unwrap().chi2 + 2.0 * free.sum::<usize>() as f64
        };
        let mut parts = self.truth.clone();
        let mut now = cost(&parts);
        loop {
            let mut better = None;
            let single = |p: &usize| !parts.contains(p) && !self.names[*p].starts_with("all.");
            for into in (0..self.parts.len()).filter(single) {
                for out in parts.difference(&self.first) {
                    let mut other = parts.clone();
                    other.remove(out);
                    other.insert(into);
                    let c = cost(&other);
                    if c < now {
                        (now, better) = (c, Some(other));
                    }
                }
            }
            let Some(other) = better else { return parts };
            parts = other;
        }
    }

    /// Position error on the new poses, rms, m.
    fn error(&self, parts: &BTreeSet<usize>) -> f64 {
        let solution = solve(&self.with(parts), &Settings::default()).unwrap();
        let held_out = solution.held_out().unwrap();
        calib_core::ErrorSummary::positions(&held_out.samples).rms
    }

    /// Part of the coordinates of the point at the new poses that lie within their 95 % intervals: of what the parameters leave
    /// uncertain, without noise; widened by what the choice cost. `None` where a joint has two couplings, which a configuration cannot
    /// tell apart.
    fn coverage(&self, parts: &BTreeSet<usize>, nested: Option<&NestedError>) -> Option<f64> {
        /// Two-sided 95 %.
        const Z95: f64 = 1.96;
        let given = solve(&self.with(parts), &Settings::default()).unwrap();
        let widened = nested.and_then(|nested| given.widened_by_choice(nested));
        let solution = widened.map_or(given, |(solution, _)| solution);
        let first = self.problem.samples() - self.places.len();
        let free: BTreeSet<ParameterId> = parts
            .iter()
            .flat_map(|p| self.parts[*p].parameters.clone())
            .collect();
        let mut inside = 0;
        for (s, truth) in self.places.iter().enumerate() {
            let at = self.configuration(first + s, &free)?;
            let found = solution.predict_point(self.tracker, self.body, &self.point, &at);
            let found = found.unwrap();
            let covariance = found.covariance.unwrap();
            let close =
                |&i: &usize| (found.position[i] - truth[i]).abs() < Z95 * covariance[(i, i)].sqrt();
            inside += (0..3).filter(close).count();
        }
        Some(inside as f64 / (3 * self.places.len()) as f64)
    }

    /// Readings and regressors of a sample; `None` as in [`coverage`](Self::coverage).
    fn configuration(&self, s: usize, free: &BTreeSet<ParameterId>) -> Option<Configuration> {
        let mut at = Configuration::zero();
        for (e, edge) in self.problem.edges().iter().enumerate() {
            let EdgeKind::Joint(joint) = &edge.kind else {
                continue;
            };
            let id = self.problem.find_edge(&edge.name).unwrap();
            assert_eq!(id.index(), e);
            at = at.with(id, joint.q[s]);
            for effect in joint.effects.iter().filter(|f| free.contains(&f.parameter)) {
                let Some(values) = &effect.values else {
                    continue;
                };
                let known = at.regressors.insert((id, effect.kind), values[s]);
                if known.is_some() {
                    return None;
                }
            }
        }
        Some(at)
    }
}

/// What a robot with effects costs: error on new poses against that of the true model.
struct Judged {
    ratio: f64,
    /// Parts that the robot lacks.
    lacked: usize,
    found: Selection,
    robot: Robot,
}

impl Judged {
    fn has_added(&self) -> bool {
        let mut steps = self.found.steps.iter();
        steps.any(|s| s.outcome == StepOutcome::Added)
    }

    /// Of a choice that added something.
    fn nested(&self) -> Option<&NestedError> {
        let nested = self.found.nested.as_ref();
        nested.filter(|_| self.found.parts != self.robot.first)
    }
}

/// Mean over robots, %.
fn mean_coverage(robots: &[Judged], of: impl Fn(&Judged) -> Option<f64>) -> f64 {
    let each: Vec<f64> = robots.iter().filter_map(of).collect();
    100.0 * each.iter().sum::<f64>() / each.len().max(1) as f64
}

fn judged(seed: u64, design: Design, effects: &[Truth]) -> Judged {
    let robot = robot(seed, design, effects);
    let found = robot.select();
    Judged {
        ratio: robot.error(&found.parts) / robot.error(&robot.truth),
        lacked: found.parts.difference(&robot.truth).count(),
        found,
        robot,
    }
}

#[test]
fn nothing_is_chosen_where_nothing_is() {
    // By design 3 of 100 robots get a part that they lack; the study below counts them.
    let robots: Vec<Judged> = (0..10)
        .map(|seed| judged(300 + seed, Design::default(), &[]))
        .collect();
    let lacked = robots.iter().filter(|r| r.lacked > 0).count();
    assert!(lacked <= 1, "{lacked} of 10");
    let tested = robots.iter().all(|r| r.found.tested > 50);
    assert!(tested);
    // Offsets and axes of this robot are wrong: the predictions need most of them.
    let idle: usize = robots.iter().map(|r| r.found.unsupported.len()).sum();
    assert!(idle < 60, "{idle} of 120");
}

#[test]
fn strong_effects_are_chosen() {
    for seed in 1..6 {
        let effects = draw(seed, 1 + seed as usize % 2, 0.8);
        let found = judged(seed, Design::default(), &effects);
        assert!(found.ratio < 1.3, "{seed}: {effects:?} {}", found.ratio);
        let (before, after) = found.found.rms;
        assert!(after < before, "{before} {after}");
        // The choice looked at the poses that it predicts: folds say how much that flatters.
        let nested = found.found.nested.as_ref().unwrap();
        assert_eq!(nested.folds, 5);
        assert!(nested.rms > 0.95 * after && nested.rms < 1.3 * after);
        assert!(nested.rms_first > nested.rms);
    }
}

#[test]
fn the_choice_does_not_depend_on_the_number_of_threads() {
    let robot = robot(
        7,
        Design {
            poses: 40,
            ..Design::default()
        },
        &draw(7, 2, 0.5),
    );
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| robot.select())
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn a_held_part_keeps_its_nominal_value() {
    let robot = robot(
        9,
        Design {
            poses: 40,
            ..Design::default()
        },
        &[],
    );
    let found = robot.select();
    let free: BTreeSet<ParameterId> = found
        .parts
        .iter()
        .flat_map(|p| robot.parts[*p].parameters.clone())
        .collect();
    let held = robot.parts.iter().flat_map(|p| &p.parameters);
    for id in held.filter(|id| !free.contains(id)) {
        assert_eq!(
            found.values[id.index()],
            robot.problem.parameters()[id.index()].nominal
        );
    }
}

/// What the choice leaves uncertain is in the intervals, too: as if the model had been given, they hold 91 % here.
#[test]
fn intervals_of_chosen_models_cover() {
    let design = Design {
        poses: 25,
        ..Design::default()
    };
    let each: Vec<Judged> = (0..12)
        .map(|seed| judged(1000 + seed, design, &draw(seed, 1 + seed as usize % 4, 0.0)))
        .collect();
    let widened = mean_coverage(&each, |j| j.robot.coverage(&j.found.parts, j.nested()));
    let given = mean_coverage(&each, |j| j.robot.coverage(&j.found.parts, None));
    println!("{widened:.1} %, as if given {given:.1} %");
    // 12 robots of 300 coordinates that share a fit: ± 2 %
    assert!(widened > 92.0 && widened >= given, "{widened} {given}");
}

/// Rates over many robots: `ROBOTS=200 cargo test --release -p calib-core --test it select:: -- --ignored --nocapture`.
#[test]
#[ignore = "a study: minutes"]
fn study() {
    let number = |name: &str, otherwise: f64| {
        std::env::var(name).map_or(otherwise, |n| n.parse().expect("a number"))
    };
    let robots = number("ROBOTS", 40.0) as u64;
    for poses in [25, 60] {
        let design = Design {
            poses,
            ..Design::default()
        };
        for (label, some, least) in [
            ("no effect", 0, 0.0),
            ("1 to 4 effects, none to strong", 1, 0.0),
            ("1 to 4 effects, half to full strength", 1, 0.5),
        ] {
            let each: Vec<Judged> = (0..robots)
                .map(|seed| {
                    let effects = draw(seed, some * (1 + seed as usize % 4), least);
                    judged(1000 + seed, design, &effects)
                })
                .collect();
            let mut ratios: Vec<f64> = each.iter().map(|j| j.ratio).collect();
            ratios.sort_by(f64::total_cmp);
            let n = ratios.len();
            let share = |count: usize| 100.0 * count as f64 / n as f64;
            println!(
                "coverage of 95 % intervals: selected {:.1} % (as if the model were given {:.1} %), true model {:.1} %",
                mean_coverage(&each, |j| j.robot.coverage(&j.found.parts, j.nested())),
                mean_coverage(&each, |j| j.robot.coverage(&j.found.parts, None)),
                mean_coverage(&each, |j| j.robot.coverage(&j.robot.truth, None)),
            );
            let within = |limit: f64| share(ratios.iter().filter(|r| **r <= limit).count());
            let nested = each
                .iter()
                .filter_map(|j| Some(j.found.nested.as_ref()?.rms / j.found.rms.1));
            let nested: Vec<f64> = nested.collect();
            // The slowest part: only where it is asked for.
            let asked = std::env::var_os("OF_TRUE_SIZE").is_some();
            let known: Vec<f64> = each
                .iter()
                .filter(|_| asked)
                .map(|j| j.robot.error(&j.robot.of_true_size()) / j.robot.error(&j.robot.truth))
                .collect();
            let known = |limit: f64| share(known.iter().filter(|r| **r <= limit).count());
            let likeliest = match asked {
                true => format!(
                    "; likeliest of the true size: ≤ 1.05 in {:.0} %, ≤ 1.2 in {:.0} %",
                    known(1.05),
                    known(1.2)
                ),
                false => String::new(),
            };
            println!(
                "{poses} poses, {label}: {n} robots; something added {:.0} %, a part that the robot lacks {:.1} %; \
                 error / true model's: median {:.3}, ≤ 1.05 in {:.0} %, ≤ 1.2 in {:.0} %, largest {:.2}; \
                 nested / left out {:.3}{likeliest}",
                share(each.iter().filter(|j| j.has_added()).count()),
                share(each.iter().filter(|j| j.lacked > 0).count()),
                ratios[n / 2],
                within(1.05),
                within(1.2),
                ratios[n - 1],
                nested.iter().sum::<f64>() / nested.len().max(1) as f64,
            );
        }
    }
}

/// A gain that one sweep shows: the robust fit without it rejects the rows at the ends of that sweep.
#[test]
fn the_gain_of_one_joint_is_chosen_from_sweeps() {
    let design = Design {
        sweeps: Some(10),
        markers: 3,
        joint_noise: 0.0,
        sigma: 1e-4,
        ..Design::default()
    };
    let mut missed = Vec::new();
    for (seed, joint) in [(1, 1), (2, 2), (3, 1)] {
        let gain = Truth {
            joint,
            effect: "gain",
            coefficients: vec![0.04],
            other: 0,
        };
        let robot = robot(seed, design, &[gain]);
        let found = robot.select();
        let wanted = robot
            .names
            .iter()
            .position(|n| *n == name_of(joint, "gain", 0));
        if !found.parts.contains(&wanted.unwrap()) {
            let added = found.parts.difference(&robot.first);
            let added: Vec<&String> = added.map(|p| &robot.names[*p]).collect();
            missed.push(format!("{seed}, joint {joint}: {added:?}"));
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}
