//! `calib fit`: measurements of other laboratories, the forms of its answers, weights and noise, frames and hand-eye transforms.

use crate::scratch;

mod answers;
mod frames;
mod real;
mod weights;

use scratch::Scratch;
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .expect("numbers")
        .iter()
        .map(|v| v.as_f64().expect("a number"))
        .collect()
}

#[track_caller]
fn assert_near(what: &str, found: &Value, expected_mm: [f64; 3], within_mm: f64) {
    let off: Vec<f64> = numbers(found)
        .iter()
        .zip(expected_mm)
        .map(|(f, e)| (f * 1e3 - e).abs())
        .collect();
    let worst = off.iter().copied().fold(0.0, f64::max);
    println!("{what}: {worst:.4} mm off, {within_mm} allowed");
    assert!(
        worst <= within_mm,
        "{what}: {found} m, expected {expected_mm:?} mm"
    );
}

/// A pivot about (0.1, 0.2, 0.3) with the tip 0.15 m below the body, in two directions.
fn pivot() -> Scratch {
    let mut table =
        String::from("tool.x_m,tool.y_m,tool.z_m,tool.qx,tool.qy,tool.qz,tool.qw,a_deg,b_deg\n");
    for i in -3..=3 {
        for j in -3..=3 {
            let (a, b) = (f64::from(i) * 0.15, f64::from(j) * 0.15);
            let ((sa, ca), (sb, cb)) = ((0.5 * a).sin_cos(), (0.5 * b).sin_cos());
            // q = q_z(a) · q_x(b);  origin = center + R · [0, 0.15, 0]
            let q = [ca * sb, sa * sb, sa * cb, ca * cb];
            let up = [
                -a.sin() * b.cos() * 0.15,
                a.cos() * b.cos() * 0.15,
                b.sin() * 0.15,
            ];
            table += &format!(
                "{},{},{},{},{},{},{},{},{}\n",
                0.1 + up[0],
                0.2 + up[1],
                0.3 + up[2],
                q[0],
                q[1],
                q[2],
                q[3],
                a.to_degrees(),
                b.to_degrees()
            );
        }
    }
    Scratch::new().file("pivot.csv", table)
}

/// Even noise without a random number generator: −1 to 1.
fn jitter(k: usize) -> f64 {
    let x = (k as f64 * 12.9898 + 4.1).sin() * 43_758.545_3;
    2.0 * (x - x.floor()) - 1.0
}

type V = [f64; 3];

fn minus(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn scaled(a: V, s: f64) -> V {
    [a[0] * s, a[1] * s, a[2] * s]
}

fn unit(a: V) -> V {
    scaled(a, 1.0 / dot(a, a).sqrt())
}

fn cross(a: V, b: V) -> V {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
