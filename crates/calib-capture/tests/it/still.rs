//! What stands still under a noisy tracker, and what moves.

use calib_capture::{Frame, StillSettings, Stillness};
use nalgebra::Point3;

/// Seconds between frames.
const STEP: f64 = 1.0 / 60.0;

/// Numbers that are normal enough: sums of twelve that are equally likely between 0 and 1, by a linear congruence.
struct Normal(u64);

impl Normal {
    fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

/// Frames of one marker with noise σ (m per coordinate) that moves at a speed, m/s: the share of frames that are still, after the first second.
fn still(sigma: f64, speed: f64) -> f64 {
    let mut normal = Normal(7);
    let mut stillness = Stillness::new(StillSettings::default());
    let (mut still, mut all) = (0, 0);
    for k in 0..1800 {
        let t = f64::from(k) * STEP;
        let mut noise = || normal.next() * sigma;
        let at = Point3::new(1.0 + speed * t + noise(), noise(), noise());
        let mut frame = Frame::default();
        frame.markers.insert("m".to_owned(), at);
        let is = stillness.sees(t, &frame, &["m"]).is_some();
        if t > 1.0 {
            all += 1;
            still += usize::from(is);
        }
    }
    f64::from(still as u32) / f64::from(all)
}

#[test]
fn noise_is_no_motion_and_motion_is_no_noise() {
    for sigma in [0.0, 1e-4, 4e-4, 1e-3] {
        assert_eq!(still(sigma, 0.0), 1.0, "{sigma}");
        // Three times what the noise needs within the window of 0.3 s.
        let speed = 3.0 * (9.0 * sigma).max(1e-3) / 0.3;
        assert!(still(sigma, speed) < 0.02, "{sigma}");
    }
}
