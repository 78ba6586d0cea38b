//! The study of centers (paper §3.3): which scenes, which methods.

mod bodies;
mod depth;
mod markers;
mod method;
mod mixture;
mod one_axis;
mod outliers;
mod poses;

use crate::{
    cell::{Part, Scene},
    experiment::Experiment,
    motion::{Range, grid},
    tried::Tried,
};

/// The paper's counts of poses.
pub(crate) const COUNTS: [usize; 3] = [63, 16, 9];
/// The paper's position noise, mm.
pub(crate) const SIGMAS_MM: [f64; 3] = [1.0, 2.5, 5.0];
/// The paper's orientation noise, degrees: its range in five steps.
pub(crate) const TURNS_DEG: [f64; 5] = [0.0, 0.5, 1.0, 2.0, 5.0];
/// Distances of the body from the center, mm.
pub(crate) const RADII_MM: [f64; 2] = [100.0, 250.0];
/// Line-of-sight noise relative to that across it.
pub(crate) const DEPTHS: [f64; 2] = [3.0, 5.0];
/// Ranges of both axes in the study of bias, degrees.
pub(crate) const ARCS_DEG: [f64; 5] = [180.0, 90.0, 45.0, 30.0, 20.0];

/// Every scene of the study.
pub(crate) fn plan(tried: &Tried) -> Vec<Box<dyn Experiment>> {
    let mut plan: Vec<Box<dyn Experiment>> = Vec::new();
    for samples in COUNTS {
        for radius_mm in RADII_MM {
            for sigma_mm in SIGMAS_MM {
                for turn_deg in TURNS_DEG {
                    plan.push(Box::new(poses::PoseScene::paper(
                        Range::Hand,
                        scene(Part::Grid, samples, radius_mm, sigma_mm, turn_deg),
                        tried,
                    )));
                }
                plan.push(Box::new(poses::PoseScene::paper(
                    Range::Head,
                    scene(Part::Grid, samples, radius_mm, sigma_mm, 1.0),
                    tried,
                )));
                plan.push(Box::new(markers::MarkerScene::new(
                    scene(Part::Markers, samples, radius_mm, sigma_mm, 0.0),
                    tried,
                )));
            }
            for sigma_mm in [0.5, 1.0, 2.5, 5.0] {
                for ratio in DEPTHS {
                    plan.push(Box::new(depth::DepthScene::new(
                        scene(Part::Depth, samples, radius_mm, sigma_mm, 0.0),
                        ratio,
                    )));
                }
            }
            for turn_deg in [0.1, 1.0] {
                plan.push(Box::new(bodies::BodiesScene::new(scene(
                    Part::Bodies,
                    samples,
                    radius_mm,
                    1.0,
                    turn_deg,
                ))));
            }
        }
        for reach_mm in [500.0, 20.0] {
            plan.push(Box::new(outliers::OutlierScene::new(
                scene(Part::Outliers, samples, 100.0, 1.0, 0.5),
                reach_mm * 1e-3,
            )));
        }
    }
    for arc in ARCS_DEG {
        for sigma_mm in [0.1, 0.5, 1.0] {
            let turns = grid([-arc / 2.0, arc / 2.0], 9, [-arc / 2.0, arc / 2.0], 7);
            plan.push(Box::new(poses::PoseScene::arc(
                format!("{arc}° × {arc}°"),
                turns,
                scene(Part::Arc, 63, 250.0, sigma_mm, 0.1),
                tried,
            )));
        }
    }
    for decade_mm in [[0.01, 0.1], [0.1, 1.0], [1.0, 5.0]] {
        plan.push(Box::new(one_axis::OneAxis::new(decade_mm)));
    }
    plan
}

fn scene(part: Part, samples: usize, radius_mm: f64, sigma_mm: f64, turn_deg: f64) -> Scene {
    Scene {
        part,
        motion: Range::Hand.word().to_owned(),
        condition: String::new(),
        samples,
        radius_m: radius_mm * 1e-3,
        sigma_t_m: sigma_mm * 1e-3,
        sigma_r_rad: turn_deg.to_radians(),
    }
}
