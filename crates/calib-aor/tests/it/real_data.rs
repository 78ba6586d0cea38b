//! Measurements of another laboratory; nothing here is tuned to them.
//!
//! Read from `CALIB_REAL_DATA` (a folder) or `../shared/data` beside the workspace.

use std::collections::BTreeMap;

use calib_aor::{Input, Options, Pose, fit};
use calib_geometry::registration::rigid_registration;
use nalgebra::{Point3, Vector3};

/// A mechanical hinge with five markers on each side and two on its pin.
fn hinge() -> Option<BTreeMap<String, Vec<Option<Point3<f64>>>>> {
    let file = skipped_tests::real_data("hinge/hinge_markers.csv")?;
    let mut reader = csv::Reader::from_path(file).expect("readable");
    let names: Vec<String> = reader
        .headers()
        .expect("header")
        .iter()
        .map(String::from)
        .collect();
    let mut tracks: BTreeMap<String, Vec<Option<Point3<f64>>>> = BTreeMap::new();
    for record in reader.records() {
        let record = record.expect("row");
        for (at, name) in names.iter().enumerate() {
            if let Some(marker) = name.strip_suffix("_x_m") {
                let cell = |k: usize| record[at + k].parse::<f64>().ok();
                let point = cell(0)
                    .zip(cell(1))
                    .zip(cell(2))
                    .map(|((x, y), z)| Point3::new(x, y, z));
                tracks.entry(marker.to_string()).or_default().push(point);
            }
        }
    }
    Some(tracks)
}

fn body(tracks: &BTreeMap<String, Vec<Option<Point3<f64>>>>, names: &[&str]) -> Vec<Option<Pose>> {
    let markers: Vec<&Vec<Option<Point3<f64>>>> = names.iter().map(|n| &tracks[*n]).collect();
    let rows = markers[0].len();
    let first = (0..rows)
        .find(|&k| markers.iter().all(|m| m[k].is_some()))
        .expect("one full frame");
    let at = |k: usize| -> Option<Vec<Point3<f64>>> { markers.iter().map(|m| m[k]).collect() };
    let seen = at(first).expect("full");
    let centroid = seen.iter().map(|p| p.coords).sum::<Vector3<f64>>() / seen.len() as f64;
    let template: Vec<Point3<f64>> = seen.iter().map(|p| p - centroid).collect();
    (0..rows)
        .map(|k| {
            rigid_registration(&template, &at(k)?, None)
                .ok()
                .map(|r| r.b_from_a.into())
        })
        .collect()
}

#[test]
fn the_axis_of_a_hinge_is_its_pin() {
    /// The pin markers themselves give the direction to 0.5–1°.
    const DIRECTION_DEG: f64 = 0.31;
    const DISTANCE_MM: f64 = 0.55;
    let Some(tracks) = hinge() else { return };
    let upper = body(&tracks, &["up1", "up2", "up3", "up4", "up5"]);
    let lower = body(&tracks, &["dw1", "dw2", "dw3", "dw4", "dw5"]);
    for id in ["sara", "rotation_axis", "hinge_poses"] {
        let input = Input::TwoBodies {
            parent: &upper,
            child: &lower,
        };
        let outcome = fit(id, &input, &Options::default()).expect(id);
        let estimate = outcome.estimate().expect(id);
        // The pin in the upper body: mean of its two markers over all frames.
        let mut ends = [Vector3::zeros(), Vector3::zeros()];
        let mut n = 0.0;
        for (k, pose) in upper.iter().enumerate() {
            if let (Some(pose), Some(a), Some(b)) = (pose, tracks["ax1"][k], tracks["ax2"][k]) {
                for (end, p) in ends.iter_mut().zip([a, b]) {
                    *end += pose.rotation.tr_mul(&(p.coords - pose.translation));
                }
                n += 1.0;
            }
        }
        let [a, b] = ends.map(|e| e / n);
        let angle = estimate
            .line
            .direction
            .cross(&(b - a).normalize())
            .norm()
            .asin()
            .to_degrees();
        let middle = Point3::from((a + b) / 2.0);
        let distance = 1000.0 * estimate.line.distance_to_point(&middle);
        println!(
            "{id} {angle} {distance} sd {} {:?} ends {} {}",
            estimate.sigma_direction.to_degrees(),
            outcome.verdict(),
            estimate.line.distance_to_point(&Point3::from(a)),
            estimate.line.distance_to_point(&Point3::from(b))
        );
        assert!(angle <= DIRECTION_DEG, "{id}: {angle}° from the pin");
        assert!(
            distance <= DISTANCE_MM,
            "{id}: {distance} mm from the pin's middle"
        );
    }
}
