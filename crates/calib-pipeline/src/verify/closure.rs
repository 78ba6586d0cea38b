//! Loop closures: where the tracker sees one origin from another, against forward kinematics.
//!
//! ```text
//! measured = (T_a · a_from_i)⁻¹ · (T_b · b_from_j)       fk = (root_from_i)⁻¹ · root_from_j
//! ΔT = measured⁻¹ · fk     e_t = ‖ΔT_t‖, e_θ = angle of ΔT_R         (paper §5.3, Table 1)
//! e_n = | ‖measured_t‖ − ‖fk_t‖ |                                    (paper §6.3, Table 2: a lower bound of e_t)
//! ```

use std::collections::BTreeMap;

use calib_geometry::so3;
use calib_profile::Usage;
use calib_report::{LoopClosure, LoopGroup, Stats};
use nalgebra::Isometry3;

use crate::formulate::kinematics::Calibration;
use crate::prepare::conditions::conditions;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;

/// Closes every loop of the profile with the given origins (`body_from_origin`) and robot.
#[must_use]
pub fn close_loops(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    body_from_origin: &BTreeMap<String, Isometry3<f64>>,
    robot: &Calibration,
) -> Vec<LoopClosure> {
    let mut loops = Vec::new();
    for (name, l) in &inputs.robot.profile.loops {
        let origins = &inputs.robot.profile.origins;
        let (Some(a), Some(b)) = (body_from_origin.get(&l.from), body_from_origin.get(&l.to))
        else {
            continue;
        };
        let (from, to) = (&origins[&l.from], &origins[&l.to]);
        let mut errors = Errors::default();
        let mut groups: Vec<(String, Errors)> = Vec::new();
        let mut grouped_by = String::new();
        for (recording, loaded) in &inputs.recordings {
            let wanted = match &l.recording {
                Some(only) => only == recording,
                None => loaded.spec.usage == Usage::Validation,
            };
            if !wanted {
                continue;
            }
            let labels = loaded
                .spec
                .group
                .as_ref()
                .and_then(|g| loaded.poses.labels.get(g));
            if let (Some(group), Some(_)) = (&loaded.spec.group, labels) {
                grouped_by.clone_from(group);
            }
            let seen_from = tracks[&from.body].in_recording(recording);
            let seen_to = tracks[&to.body].in_recording(recording);
            let under = conditions(loaded, &inputs.robot, inputs.robot.profile.solve.load);
            for (row, q) in loaded.q.iter().enumerate() {
                let (Some(q), Some(Some(t_a)), Some(Some(t_b))) =
                    (q, seen_from.get(row), seen_to.get(row))
                else {
                    continue;
                };
                let measured = (t_a * a).inverse() * (t_b * b);
                let root_from_link = robot.root_from_link_under(q, &under[row]);
                let fk =
                    root_from_link[from.link.index()].inverse() * root_from_link[to.link.index()];
                errors.push(&measured, &fk);
                if let Some(labels) = labels {
                    match groups.iter_mut().find(|(g, _)| *g == labels[row]) {
                        Some((_, errors)) => errors.push(&measured, &fk),
                        None => {
                            let mut own = Errors::default();
                            own.push(&measured, &fk);
                            groups.push((labels[row].clone(), own));
                        }
                    }
                }
            }
        }
        let Some(translation_m) = Stats::of(&errors.translation) else {
            continue;
        };
        loops.push(LoopClosure {
            name: name.clone(),
            samples: errors.translation.len(),
            translation_m,
            rotation_rad: Stats::of(&errors.rotation),
            norm_error_m: Stats::of(&errors.norm),
            groups: groups
                .into_iter()
                .filter_map(|(name, e)| {
                    Some(LoopGroup {
                        name,
                        samples: e.translation.len(),
                        translation_m: Stats::of(&e.translation)?,
                        rotation_rad: Stats::of(&e.rotation),
                    })
                })
                .collect(),
            grouped_by,
        });
    }
    loops
}

#[derive(Default)]
struct Errors {
    translation: Vec<f64>,
    rotation: Vec<f64>,
    norm: Vec<f64>,
}

impl Errors {
    fn push(&mut self, measured: &Isometry3<f64>, fk: &Isometry3<f64>) {
        let delta = measured.inverse() * fk;
        self.translation.push(delta.translation.vector.norm());
        self.rotation.push(so3::log(&delta.rotation).norm());
        self.norm
            .push((measured.translation.vector.norm() - fk.translation.vector.norm()).abs());
    }
}
