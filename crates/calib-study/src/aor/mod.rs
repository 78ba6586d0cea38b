//! The study of axes and frames (paper §4 and §5.2): which scenes, which methods.

mod bounds;
mod circle;
mod frame;
mod hinge;
mod literal;
mod method;
mod poses;

use crate::{
    cell::{Part, Scene},
    experiment::Experiment,
    tried::Tried,
};

/// The paper's counts of poses for one axis.
pub(crate) const COUNTS: [usize; 3] = [19, 10, 6];
/// The paper's position noise, mm.
pub(crate) const SIGMAS_MM: [f64; 3] = [1.0, 2.5, 5.0];
/// Orientation noise, degrees. At 0° the bound of a direction from poses is 0: 0.1° stands in its place.
pub(crate) const TURNS_DEG: [f64; 5] = [0.1, 0.5, 1.0, 2.0, 5.0];
/// Distances of the body from the axis, mm.
pub(crate) const RADII_MM: [f64; 2] = [100.0, 250.0];
/// Arcs of the study with four markers, degrees: the hand's z and x, and shorter ones.
pub(crate) const ARCS_DEG: [f64; 4] = [180.0, 125.0, 60.0, 20.0];

/// The hand's two axes: its sweep in degrees, and the axis in the tracker's frame.
pub(crate) const AXES: [(&str, [f64; 2]); 2] =
    [("hand z", [-45.0, 135.0]), ("hand x", [-45.0, 80.0])];

/// Every scene of the study.
pub(crate) fn plan(tried: &Tried) -> Vec<Box<dyn Experiment>> {
    let mut plan: Vec<Box<dyn Experiment>> = Vec::new();
    for (name, range) in AXES {
        for samples in COUNTS {
            for radius_mm in RADII_MM {
                for sigma_mm in SIGMAS_MM {
                    let scene = scene(Part::Grid, name, samples, radius_mm, sigma_mm);
                    plan.push(Box::new(circle::CircleScene::new(
                        scene.clone(),
                        range,
                        tried,
                    )));
                    for turn_deg in TURNS_DEG {
                        plan.push(Box::new(poses::PoseScene::new(
                            Scene {
                                sigma_r_rad: turn_deg.to_radians(),
                                ..scene.clone()
                            },
                            range,
                            tried,
                        )));
                    }
                }
            }
        }
    }
    for arc in ARCS_DEG {
        for samples in COUNTS {
            for radius_mm in RADII_MM {
                for sigma_mm in SIGMAS_MM {
                    let motion = format!("arc {arc}°");
                    let scene = scene(Part::Markers, &motion, samples, radius_mm, sigma_mm);
                    plan.push(Box::new(hinge::HingeScene::new(scene, arc, tried)));
                }
            }
        }
    }
    for (sigma_mm, turn_deg) in [(1.0, 0.5), (2.5, 0.5), (1.0, 2.0)] {
        let scene = Scene {
            sigma_r_rad: f64::to_radians(turn_deg),
            ..scene(Part::Frame, "hand", 36, 100.0, sigma_mm)
        };
        plan.push(Box::new(frame::FrameScene::new(scene)));
    }
    plan
}

fn scene(part: Part, motion: &str, samples: usize, radius_mm: f64, sigma_mm: f64) -> Scene {
    Scene {
        part,
        motion: motion.to_owned(),
        condition: String::new(),
        samples,
        radius_m: radius_mm * 1e-3,
        sigma_t_m: sigma_mm * 1e-3,
        sigma_r_rad: 0.0,
    }
}
