//! What a control loop pays: a 7-axis arm with every effect that there is.

use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};

#[path = "../tests/it/common.rs"]
mod common;

use calib_model::{Model, Options, Place, Under, Work};
use common::{Effects, WARM, posture, rng, robot, with_uncertainty};

/// Median and 99th percentile of single calls, each timed in groups of 16.
fn percentiles(name: &str, mut call: impl FnMut(usize)) {
    const GROUP: u32 = 16;
    let mut times: Vec<f64> = (0..20_000)
        .map(|i| {
            let start = Instant::now();
            (0..GROUP as usize).for_each(|k| call(i + k));
            start.elapsed().as_secs_f64() / f64::from(GROUP) * 1e6
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
    println!(
        "{name}: best {:.3} µs, median {:.3} µs, p99 {:.3} µs",
        times[0],
        at(0.5),
        at(0.99)
    );
}

fn arm(c: &mut Criterion) {
    let mut r = rng(1);
    let all = with_uncertainty(robot(&mut r, 7, false, Effects::All), &mut r);
    // What calibrations of arms usually find: offsets, compliance, eccentricity, backlash.
    let mut usual = all.clone();
    let kept = [
        "offset",
        "eccentricity_cos",
        "eccentricity_sin",
        "compliance",
        "backlash",
    ];
    for joint in &mut usual.joints {
        joint.effects.retain(|e| kept.contains(&e.kind.as_str()));
    }
    usual.uncertainty = None;
    let postures: Vec<Vec<f64>> = (0..256).map(|_| posture(&mut r, 7)).collect();
    let approach = [1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0];
    let under = Under {
        approach: &approach,
        held: None,
        temperature_c: &WARM[..7],
    };
    for (name, file) in [("usual effects", &usual), ("all effects", &all)] {
        let model = Model::new(file).expect("a model");
        let tool = model.last_link();
        let mut work: Work = model.work();
        let (mut command, mut jacobian) = ([0.0; 7], [0.0; 42]);
        let q = |i: usize| postures[i % 256].as_slice();
        percentiles(&format!("forward, {name}"), |i| {
            model.forward(q(i), &under, &mut work).expect("poses");
            black_box(work.root_from_link(tool));
        });
        percentiles(&format!("jacobian, {name}"), |i| {
            model
                .jacobian(q(i), tool, &under, &mut work, &mut jacobian)
                .expect("a jacobian");
            black_box(jacobian);
        });
        percentiles(&format!("correct, {name}"), |i| {
            let options = Options::default();
            let done = model.correct(q(i), tool, &options, &under, &mut work, &mut command);
            let _ = black_box(done);
        });
        if model.has_uncertainty() {
            percentiles(&format!("sigma, {name}"), |i| {
                let _ = black_box(model.sigma(q(i), Place::Link(tool), &under, &mut work));
            });
        }
        c.bench_function(&format!("forward, {name}"), |b| {
            let mut i = 0;
            b.iter(|| {
                i += 1;
                model.forward(q(i), &under, &mut work).expect("poses");
            });
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(30);
    targets = arm
}
criterion_main!(benches);
