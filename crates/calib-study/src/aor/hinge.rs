//! Four markers of a rigid body on a hinge: what each method makes of them, down to short arcs.

use calib_aor::{Input, Options, bounds};
use nalgebra::{Point3, Vector3};

use super::method::{Method, POINT, axis, method, truth, turned};
use crate::{
    cell::Scene,
    experiment::Experiment,
    motion::steps,
    noise::Noise,
    tally::{Row, Tally},
};

const MARKERS: usize = 4;

pub(crate) struct HingeScene {
    scene: Scene,
    angles: Vec<f64>,
    /// Markers at angle 0, relative to the axis's point.
    places: Vec<Vector3<f64>>,
    methods: Vec<Method>,
    rows: Vec<Row>,
}

impl HingeScene {
    pub fn new(scene: Scene, arc: f64) -> Self {
        let angles: Vec<f64> = steps(0.0, arc, scene.samples).collect();
        let places = layout(scene.radius_m);
        let at = |p: &Vector3<f64>| Point3::from(POINT + p);
        let tracks: Vec<Vec<Point3<f64>>> = places
            .iter()
            .map(|p| angles.iter().map(|a| at(&(turned(*a) * p))).collect())
            .collect();
        let resting: Vec<Point3<f64>> = places.iter().map(at).collect();
        let sigma = scene.sigma_t_m;
        let spheres = bounds::common_line(&tracks, &truth(), sigma);
        let bundle = |known| bounds::hinge(&resting, &truth(), &angles, known, sigma);
        let encoder = Options {
            angles: angles.clone(),
            ..Options::default()
        };
        let plain = Options::default;
        let (methods, rows): (Vec<Method>, Vec<[Row; 2]>) = [
            method("hinge_bundle", "hinge_bundle", plain(), 5, bundle(false)),
            method(
                "hinge_bundle, encoder",
                "hinge_bundle",
                encoder,
                5,
                bundle(true),
            ),
            method("line_ml", "line_ml", plain(), 5, spheres),
            method("dir_ml", "dir_ml", plain(), 5, spheres),
            method("plane", "plane", plain(), 5, spheres),
            method("halvorsen_line", "halvorsen_line", plain(), 5, spheres),
        ]
        .into_iter()
        .flatten()
        .unzip();
        Self {
            scene: Scene {
                condition: format!("{MARKERS} markers"),
                ..scene
            },
            angles,
            places,
            methods,
            rows: rows.into_iter().flatten().collect(),
        }
    }
}

/// Markers spread around the axis, near the radius, at different heights.
fn layout(radius: f64) -> Vec<Vector3<f64>> {
    let n = axis().into_inner();
    let e1 = n.cross(&Vector3::x()).normalize();
    let e2 = n.cross(&e1);
    (0..MARKERS)
        .map(|p| {
            let p = p as f64;
            let r = radius * (1.0 + 0.15 * (1.7 * p).sin());
            let height = 0.3 * radius * (2.3 * p).cos();
            (e1 * (0.6 * p).cos() + e2 * (0.6 * p).sin()) * r + n * height
        })
        .collect()
}

impl Experiment for HingeScene {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn rows(&self) -> &[Row] {
        &self.rows
    }

    fn trial(&self, number: u64, noise: &mut Noise, tallies: &mut [Tally]) {
        if self.methods.iter().all(|m| !number.is_multiple_of(m.every)) {
            return;
        }
        let tracks: Vec<Vec<Option<Point3<f64>>>> = self
            .places
            .iter()
            .map(|p| {
                let seen = |a: &f64| POINT + turned(*a) * p + noise.vector(self.scene.sigma_t_m);
                self.angles
                    .iter()
                    .map(seen)
                    .map(|x| Some(x.into()))
                    .collect()
            })
            .collect();
        for (method, pair) in self.methods.iter().zip(tallies.chunks_mut(2)) {
            method.record(&Input::Markers(&tracks), None, pair);
        }
    }
}
