//! What a plan buys on the recorded postures of Agile Justin: subsets that it chooses against random ones, on postures of neither.

use std::collections::BTreeSet;

use calib_pipeline::options::Plugins;
use calib_pipeline::prepare::load::load_robot;
use calib_plan::Known;
use calib_plan::basis::{Basis, compressed};
use calib_plan::candidates::Candidate;
use calib_plan::design::{Criterion, Question};
use calib_urdf::JointId;
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha12Rng;

use crate::real_robots::{data, justin};
use crate::scratch::Scratch;

/// Postures that are compared on.
const TEST: usize = 100;
/// Divisions of the postures.
const SPLITS: u64 = 20;

/// A table of joint positions and markers as it was published.
struct Table {
    header: String,
    rows: Vec<String>,
}

impl Table {
    fn of(&self, rows: &[usize]) -> String {
        let chosen = rows.iter().map(|i| format!("{}\n", self.rows[*i]));
        format!("{}\n{}", self.header, chosen.collect::<String>())
    }
}

/// Whitened rows of every posture in a basis, and the information of the priors, at the nominal robot: nothing is recorded.
fn linear(dir: &Scratch, table: &Table) -> (Vec<DMatrix<f64>>, DMatrix<f64>) {
    let robot = load_robot(&dir.path("plan.yaml")).unwrap_or_else(|e| panic!("{e}"));
    let known = Known::of(robot, Plugins::Refused).unwrap_or_else(|e| panic!("{e}"));
    let model = &known.robot.model;
    let columns: Vec<Option<JointId>> = table
        .header
        .split(',')
        .map(|name| model.joint_id(name).ok())
        .collect();
    let subjects = known.subjects(&|_| true);
    let candidates = table.rows.iter().map(|row| {
        let mut q = model.zero_positions();
        for (cell, joint) in row.split(',').zip(&columns) {
            if let Some(joint) = joint {
                q[joint.index()] = cell.parse().expect("a number");
            }
        }
        Candidate {
            q,
            seen: vec![Some(None); subjects.len()],
        }
    });
    let candidates: Vec<Candidate> = candidates.collect();
    // Some task is part of the problem; the one of the study is made of the rows.
    let some = [candidates[0].q.clone()];
    let linear = known.linearize(&candidates, &subjects, &some);
    let linear = linear.unwrap_or_else(|e| panic!("{e}"));
    let basis = Basis::new(linear.scale, &linear.has_prior, &[&linear.planned]);
    let rows = linear.planned.iter().map(|y| compressed(&basis.of(y)));
    (rows.collect(), basis.prior(&linear.has_prior))
}

/// Mean and largest error on the postures of a test set after a calibration with others, mm.
fn reached(dir: &Scratch, table: &Table, fitted: &[usize], test: &[usize]) -> [f64; 2] {
    std::fs::write(dir.path("train.csv"), table.of(fitted)).expect("written");
    std::fs::write(dir.path("check.csv"), table.of(test)).expect("written");
    dir.calib(["run", "justin.yaml", "--out", "out"]);
    let report = dir.json("out/report.json");
    let of = &report["verification"]["held_out"]["calibrated"];
    ["mean_m", "max_m"].map(|key| of[key].as_f64().expect("held out") * 1e3)
}

/// `CALIB_SPLITS=5` makes fewer.
#[test]
#[ignore = "study: 120 calibrations of Agile Justin, ten minutes"]
fn study_subsets_of_agile_justin_on_a_fixed_test_set() {
    let Some(data) = data() else { return };
    let read = |path: &str| std::fs::read_to_string(data.join(path)).expect("part of the data");
    let text = read("agile_justin/postures.csv");
    let mut lines = text.lines().map(str::to_owned);
    let table = Table {
        header: lines.next().expect("a header"),
        rows: lines.collect(),
    };
    let free = ", compliance, lateral_compliance";
    let profile = justin(free, free);
    let dir = Scratch::new()
        // The postures that are to be chosen from are no recording yet.
        .file("plan.yaml", profile.replace(".csv", "_not_recorded.csv"))
        .file("justin.yaml", profile)
        .file(
            "justin.urdf",
            read("agile_justin/agile_justin_nominal.urdf"),
        );
    let (rows, before) = linear(&dir, &table);
    let splits = std::env::var("CALIB_SPLITS").map_or(SPLITS, |n| n.parse().expect("a number"));
    for n in [40, 60, 100] {
        let mut sums = [[0.0; 2]; 2];
        for split in 0..splits {
            let mut order: Vec<usize> = (0..rows.len()).collect();
            order.shuffle(&mut ChaCha12Rng::seed_from_u64(split));
            let (test, pool) = order.split_at(TEST);
            let of_pool: Vec<DMatrix<f64>> = pool.iter().map(|i| rows[*i].clone()).collect();
            // The task: the markers in all postures that can be chosen.
            let mut task = DMatrix::zeros(before.nrows(), before.nrows());
            for y in &of_pool {
                task.gemm_tr(1.0 / of_pool.len() as f64, y, y, 1.0);
            }
            let question = Question {
                rows: &of_pool,
                before: &before,
                criterion: &Criterion::Trace(task),
            };
            let planned = question.choose(n, &[]);
            assert_eq!(planned.iter().collect::<BTreeSet<_>>().len(), n);
            let planned: Vec<usize> = planned.iter().map(|i| pool[*i]).collect();
            for (sum, chosen) in sums.iter_mut().zip([planned.as_slice(), &pool[..n]]) {
                let errors = reached(&dir, &table, chosen, test);
                for (sum, error) in sum.iter_mut().zip(errors) {
                    *sum += error / splits as f64;
                }
            }
        }
        let [[planned, most], [random, most_random]] = sums;
        println!(
            "{n} of 250 postures, {splits} splits: mean {planned:.3} mm, random {random:.3} mm, ratio {:.3}; mean maximum {most:.2} mm, random {most_random:.2} mm, ratio {:.3}",
            planned / random,
            most / most_random
        );
        assert!(planned <= 1.02 * random, "{n}: {planned} {random}");
        assert!(most <= most_random, "{n}: {most} {most_random}");
    }
}
