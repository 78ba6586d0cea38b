//! The figures that the project promises: a full solve of 12 000 rows, and the cost of one marker pose.

use criterion::{Criterion, criterion_group, criterion_main};

#[path = "../tests/it/common/mod.rs"]
mod common;

use calib_core::{ChangeSettings, MinimizeSettings, Model, NoiseKind, Settings, minimize, solve};
use common::{Chain, Free, Handles, rng, six_r};

// As in the program.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Best of many runs: what the code costs on a machine that others use too.
fn best_of(name: &str, runs: usize, mut f: impl FnMut()) {
    let best = (0..runs)
        .map(|_| {
            let start = std::time::Instant::now();
            f();
            start.elapsed()
        })
        .min()
        .unwrap_or_default();
    println!("best of {runs}: {name}: {best:.2?}");
}

/// One linearization and one cost.
fn once() -> MinimizeSettings {
    let mut once = MinimizeSettings::default();
    once.max_iterations = 0;
    once.decrement = 1e300;
    once
}

/// The problem of a chain whose joints scatter.
fn scattering(chain: &Chain, free: &Free) -> Handles {
    let mut h = chain.problem(free, 1e-4);
    let noise = h
        .problem
        .noise_group("joints", NoiseKind::Joint, 1e-4, true);
    for joint in h.joints.clone() {
        h.problem.joint_noise(joint, noise);
    }
    h
}

fn six_r_with_1000_poses(c: &mut Criterion) {
    let mut r = rng(1);
    let mut free = Free::frames_and_offsets(6);
    // 6 world, 6 mount, 4 offsets and three origins as lines: 28 unknowns.
    for (i, a) in [
        (2, (0.0, 1.0, 0.0)),
        (4, (0.0, 0.0, 1.0)),
        (5, (0.0, 1.0, 0.0)),
    ] {
        free.origins[i - 1] = calib_core::Chart::axis_line(&common::axis(a.0, a.1, a.2));
    }
    let chain = Chain::nominal(six_r())
        .posed(&mut r, 1000, 1.4)
        .deviate(&mut r, &free, 0.01, 0.005);
    let mut h = chain.problem(&free, 1e-4);
    chain.observe(&mut r, &mut h, 1e-4, 0.0);
    let model = Model::new(&h.problem).unwrap();
    println!("{} rows, {} unknowns", model.rows(), model.free());
    let weights = vec![1.0; model.observation_count()];
    let theta = [1e-8];
    let start = model.start();
    let fit = minimize(
        &model,
        &start,
        &weights,
        &theta,
        &MinimizeSettings::default(),
    );
    println!("{:?} after {} linearizations", fit.status, fit.iterations);
    best_of("full solve", 400, || {
        std::hint::black_box(minimize(
            &model,
            &start,
            &weights,
            &theta,
            &MinimizeSettings::default(),
        ));
    });
    best_of("one linearization and one cost", 400, || {
        let once = once();
        std::hint::black_box(minimize(&model, &start, &weights, &theta, &once));
    });
    c.bench_function("full solve, 1000 poses x 4 markers", |b| {
        b.iter(|| {
            minimize(
                &model,
                &start,
                &weights,
                &theta,
                &MinimizeSettings::default(),
            )
        });
    });
    let mut once = MinimizeSettings::default();
    once.max_iterations = 1;
    c.bench_function(
        "one linearization and one cost, 1000 poses x 4 markers",
        |b| {
            b.iter(|| minimize(&model, &start, &weights, &theta, &once));
        },
    );
    c.bench_function("solve with covariance and observability", |b| {
        b.iter(|| solve(&h.problem, &Settings::plain()).unwrap());
    });
}

/// What grows with the length of a recording: the lines that begin with `long`.
fn long_recordings(_: &mut Criterion) {
    for poses in [1_000, 4_000, 40_000] {
        let mut r = rng(1);
        let free = Free::frames_and_offsets(6);
        let chain = Chain::nominal(six_r())
            .posed(&mut r, poses, 1.4)
            .deviate(&mut r, &free, 0.01, 0.005);
        let mut h = scattering(&chain, &free);
        h.problem.group_mut(h.markers).estimate = true;
        chain.observe(&mut r, &mut h, 1e-4, 1e-4);
        let settings = Settings::default();
        let solution = solve(&h.problem, &settings).unwrap();
        best_of(&format!("long: robust fit of {poses} poses"), 2, || {
            std::hint::black_box(solve(&h.problem, &settings).unwrap());
        });
        best_of(&format!("long: tests after it, {poses} poses"), 2, || {
            std::hint::black_box(solution.goodness_of_fit());
            std::hint::black_box(solution.changes(&ChangeSettings::default()));
            std::hint::black_box(solution.cluster_robust_sigmas());
            std::hint::black_box(solution.standardized_residuals());
        });
    }
}

/// The same with joints that scatter.
fn joint_noise(_: &mut Criterion) {
    let mut r = rng(1);
    let free = Free::frames_and_offsets(6);
    let chain = Chain::nominal(six_r())
        .posed(&mut r, 1000, 1.4)
        .deviate(&mut r, &free, 0.01, 0.005);
    let mut h = scattering(&chain, &free);
    chain.observe(&mut r, &mut h, 1e-4, 1e-4);
    let model = Model::new(&h.problem).unwrap();
    let weights = vec![1.0; model.observation_count()];
    let theta = vec![1e-8; 2];
    let start = model.start();
    let once = once();
    let name = "joint noise: one linearization and one cost, 1000 poses x 4 markers";
    best_of(name, 100, || {
        std::hint::black_box(minimize(&model, &start, &weights, &theta, &once));
    });
}

/// What grows with the unknowns: all six numbers of every joint's frame, with joints that scatter and without.
fn unknowns(_: &mut Criterion) {
    for arms in [1, 2, 4, 8, 16] {
        let links: Vec<_> = (0..arms).flat_map(|_| six_r()).collect();
        let mut r = rng(1);
        let free = Free::everything(links.len());
        let chain = Chain::nominal(links).posed(&mut r, 200, 1.4);
        let mut h = scattering(&chain, &free);
        chain.observe(&mut r, &mut h, 1e-4, 1e-4);
        let model = Model::new(&h.problem).unwrap();
        let weights = vec![1.0; model.observation_count()];
        let start = model.start();
        let once = once();
        let name = format!("one linearization of {} unknowns", model.free());
        best_of(&name, 20, || {
            std::hint::black_box(minimize(&model, &start, &weights, &[1e-8; 2], &once));
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = six_r_with_1000_poses, joint_noise, unknowns, long_recordings
}
criterion_main!(benches);
