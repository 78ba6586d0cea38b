//! The profile of a case, as a careful person would write it who does not know of the fault.

use super::case::{Case, LAST, LIMIT_MM, SIGMA, SIGMA_ORIENTATION};
use super::fault::Fault;
use super::robot::{Errors, NominalErrors};

impl Case {
    /// How far the nominal robot may be off, as the profile says.
    pub(super) fn prior(&self) -> NominalErrors {
        let (angle, origin_mm) = match self.cell.errors {
            Errors::Small => (0.5, 2.0),
            Errors::Big => (1.0, 5.0),
            Errors::Huge => (3.0, 20.0),
        };
        NominalErrors {
            offset_deg: angle,
            origin_mm,
            tilt_deg: angle,
        }
    }

    /// The profile as YAML.
    pub fn profile(&self) -> String {
        let n = self.robot.joints.len();
        let link = if self.has(Fault::WrongLink) { n - 1 } else { n };
        let markers: Vec<String> = (1..=self.markers.len())
            .map(|m| format!("tip_{m}"))
            .collect();
        let body = if markers.is_empty() {
            "pose: true".to_owned()
        } else {
            format!("markers: [{}]", markers.join(", "))
        };
        let recordings: Vec<String> = self
            .readings
            .iter()
            .map(|(name, _)| {
                let usage = if *name == LAST {
                    "validation"
                } else {
                    "static"
                };
                format!("  {name}: {{file: {name}.csv, use: {usage}}}")
            })
            .collect();
        let prior = self.prior();
        let sigma = format!(
            "{{position_mm: {}, angle_deg: {}, offset_deg: {}}}",
            prior.origin_mm, prior.tilt_deg, prior.offset_deg
        );
        let tracker = if markers.is_empty() {
            format!(
                "body_sigma_mm: {}, body_sigma_deg: {:.4}",
                SIGMA * 1e3,
                SIGMA_ORIENTATION.to_degrees()
            )
        } else {
            format!("marker_sigma_mm: {}", SIGMA * 1e3)
        };
        format!(
            "calib: 1\nrobot: {{name: arm, urdf: arm.urdf}}\ntracker: {{frame: lab, {tracker}}}\nbodies:\n  tip: {{link: l{link}, {body}}}\n\
             recordings:\n{}\nsolve:\n  free: [bodies, tracker, joint_offsets, joint_axes]\n  prior: {sigma}\n  \
             limits: {{held_out_rms_mm: {LIMIT_MM}, held_out_max_mm: {}}}\noutputs: {{urdf: arm.calibrated.urdf}}\n",
            recordings.join("\n"),
            4.0 * LIMIT_MM,
        )
    }
}
