//! A run in which nothing is stated but bodies and recordings, against registration only and plain least squares: what it decides by
//! itself (noise, outliers) may not cost predictions.

use crate::scratch;
use crate::selection::without_solve;

use std::path::Path;

use scratch::Scratch;

/// What a run may lose on average over the recordings of a cell…
const WORSE: f64 = 1.03;
/// …and on one of them, where few poses decide.
const ONCE: f64 = 1.08;
/// …or on one of those where 15 postures stand beside sweeps and compliance is missing: one posture of the fifteen decides there.
const ONCE_OF_FEW: f64 = 1.15;
/// Every measurement counts alike.
const PLAIN: &str = "solve: {robust: false, noise: {joint_deg: 0}}\n";

/// Errors of held-out poses, rms, m.
struct Errors {
    default: f64,
    plain: f64,
    registered: f64,
}

impl Errors {
    /// Of one profile without a `solve:` block.
    fn of(dir: Scratch, profile: &str) -> Self {
        let dir = dir
            .file("robots/default.yaml", profile)
            .file("robots/plain.yaml", profile.to_owned() + PLAIN);
        let rms = |name: &str, robot: &str| {
            let out = format!("out_{name}");
            dir.calib(["run", &format!("robots/{name}.yaml"), "--out", &out]);
            let report = dir.json(&format!("{out}/report.json"));
            let held_out = &report["verification"]["held_out"][robot]["rms_m"];
            held_out.as_f64().expect("validation poses")
        };
        let default = rms("default", "calibrated");
        let report = dir.json("out_default/report.json");
        let registered = &report["verification"]["held_out"]["registration_only"]["rms_m"];
        Self {
            default,
            plain: rms("plain", "calibrated"),
            registered: registered.as_f64().expect("validation poses"),
        }
    }

    fn against_plain(&self) -> f64 {
        self.default / self.plain
    }
}

/// 45 poses to fit and 60 of validation.
const FEWER: [(&str, &str); 2] = [("poses: 80", "poses: 45"), ("poses: 30", "poses: 12")];

/// Justin with fewer poses, recorded again with each seed under this change of its simulation.
fn justin_with(change: (&str, &str)) -> Vec<Errors> {
    justin(&[FEWER[0], FEWER[1], change], 3)
}

/// Justin, recorded again with so many seeds under these changes of its simulation.
fn justin(edits: &[(&str, &str)], seeds: u64) -> Vec<Errors> {
    let one = |seed: u64| {
        let mut dir = Scratch::new().robot("justin");
        for (from, to) in edits {
            dir = dir.edit("robots/justin.yaml", from, to);
        }
        let seed = seed.to_string();
        let simulate = [
            "simulate",
            "robots/justin.yaml",
            "--seed",
            &seed,
            "--out",
            "made",
        ];
        dir.calib(simulate).expect(0);
        for (name, bytes) in dir.files("made") {
            if Path::new(&name).extension().is_some_and(|e| e == "csv") {
                dir = dir.file(&format!("robots/justin/{name}"), bytes);
            }
        }
        let profile = without_solve(&dir.read("robots/justin.yaml"));
        Errors::of(dir, &profile)
    };
    let seeds: Vec<u64> = (1..=seeds).collect();
    seeds
        .chunks(3)
        .flat_map(|seeds| {
            std::thread::scope(|scope| {
                let spawned = seeds.iter().map(|seed| scope.spawn(move || one(*seed)));
                let runs: Vec<_> = spawned.collect();
                let joined = runs.into_iter().map(|run| run.join().expect("a run"));
                joined.collect::<Vec<_>>()
            })
        })
        .collect()
}

fn is_no_worse(cell: &str, errors: &[Errors]) {
    is_no_worse_than(cell, errors, (WORSE, ONCE));
}

fn is_no_worse_than(cell: &str, errors: &[Errors], (worse, once): (f64, f64)) {
    let ratios: Vec<f64> = errors.iter().map(Errors::against_plain).collect();
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    println!("{cell}: {mean:.3} of plain least squares {ratios:.3?}");
    assert!(mean <= worse, "{cell}: {ratios:?}");
    for e in errors {
        assert!(e.against_plain() <= once, "{cell}: {ratios:?}");
        assert!(
            e.default <= WORSE * e.registered,
            "{cell}: {} {}",
            e.default,
            e.registered
        );
    }
}

#[test]
fn with_missing_compliance_a_default_run_predicts_no_worse() {
    if !skipped_tests::thorough() {
        return;
    }
    let soft = (
        "right_0: 0.006, right_1: 0.006",
        "right_0: 0.03, right_1: 0.03",
    );
    is_no_worse("as shipped", &justin(&FEWER, 3));
    is_no_worse("five times softer", &justin_with(soft));
}

#[test]
fn with_noisy_joints_few_poses_or_large_errors_a_default_run_predicts_no_worse() {
    if !skipped_tests::thorough() {
        return;
    }
    is_no_worse(
        "noisy joints",
        &justin_with(("joint_deg: 0.005", "joint_deg: 0.05")),
    );
    let few = justin(&[("poses: 80", "poses: 15")], 16);
    is_no_worse_than("15 poses", &few, (WORSE, ONCE_OF_FEW));
    let offsets = ("joint_offset_deg: 0.15", "joint_offset_deg: 2");
    is_no_worse(
        "large errors",
        &justin(
            &[FEWER[0], FEWER[1], offsets, ("axis_mm: 0.6", "axis_mm: 8")],
            3,
        ),
    );
}
