//! Times of the closed forms and likelihood fits, one thread: `cargo run --release -p calib-cor --example speed -- <folder>`.
//!
//! Writes the data it times (`points36.csv`, `poses1000.csv`, `poses100000.csv`) into the folder, so that others can be timed on the same
//! numbers (`compare.py` beside this file). Each figure is the least and the median over 25 runs of many fits: the least is what the
//! processor needs, the median what a shared machine gave.

use std::{fmt::Write as _, fs, hint::black_box, path::Path, time::Instant};

use calib_cor::{Input, Options, Pose, fit};
use nalgebra::{Matrix3, Point3, Rotation3, Vector3};

/// SplitMix64 and Box–Muller: the same numbers everywhere.
struct Noise(u64);

impl Noise {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }

    fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sigma * self.normal())
    }
}

fn poses(n: usize) -> Vec<Option<Pose>> {
    let mut noise = Noise(7);
    let center = Vector3::new(1.2, -0.8, 0.9);
    let tip = Vector3::new(0.0, -0.1, 0.02);
    (0..n)
        .map(|_| {
            let r = Rotation3::from_scaled_axis(noise.vector(0.6));
            let seen = r * Rotation3::from_scaled_axis(noise.vector(5e-3));
            Some(Pose {
                rotation: seen.into_inner(),
                translation: center - r * tip + noise.vector(1e-3),
            })
        })
        .collect()
}

fn table(poses: &[Option<Pose>]) -> String {
    let mut out = String::from("x,y,z,r00,r01,r02,r10,r11,r12,r20,r21,r22\n");
    for pose in poses.iter().flatten() {
        let (t, r): (_, Matrix3<f64>) = (pose.translation, pose.rotation.transpose());
        let numbers: Vec<String> = t.iter().chain(r.iter()).map(f64::to_string).collect();
        let _ = writeln!(out, "{}", numbers.join(","));
    }
    out
}

fn timed(what: &str, repeats: usize, mut run: impl FnMut()) {
    let mut times: Vec<f64> = (0..25)
        .map(|_| {
            let start = Instant::now();
            for _ in 0..repeats {
                run();
            }
            start.elapsed().as_secs_f64() / repeats as f64 * 1e6
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!("{what:<28} {:>10.2} {:>10.2}", times[0], times[12]);
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("{:<28} {:>10} {:>10}", "", "least µs", "median µs");
    let folder = std::env::args().nth(1);
    let options = Options::default();
    for (n, repeats) in [(36, 500), (1000, 100), (100_000, 2)] {
        let data = poses(n);
        let track = vec![
            data.iter()
                .map(|p| p.map(|p| Point3::from(p.translation)))
                .collect::<Vec<_>>(),
        ];
        if let Some(folder) = &folder {
            fs::write(
                Path::new(folder).join(format!("poses{n}.csv")),
                table(&data),
            )?;
        }
        for id in ["sfe", "ml_sphere", "sphere_eiv"] {
            let input = Input::Points(&track);
            timed(&format!("{id}, n = {n}"), repeats, || {
                let _ = black_box(fit(id, black_box(&input), &options));
            });
        }
        for id in ["hse", "hotspot_ml"] {
            let input = Input::Poses(&data);
            timed(&format!("{id}, n = {n}"), repeats, || {
                let _ = black_box(fit(id, black_box(&input), &options));
            });
        }
    }
    Ok(())
}
