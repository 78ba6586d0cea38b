//! Algorithm 1 to the letter: the distal axes averaged in the tracker's frame.
//!
//! ```text
//! m = CoR of all samples;  AoR_z, AoR_x: each plane's axis with m held, averaged as they stand
//! AoR_y = AoR_z × AoR_x / |AoR_z × AoR_x|,   T = (AoR_x, AoR_y, AoR_z, m)                         (1)
//! ```
//!
//! Of the printed orders of the cross product only this one (the paper's Eq. 26) makes a frame, the others a reflection or
//! zero. Signs of the axes are turned towards the truth, for the paper does not say how it finds them. The study shows what
//! turning the axes back is worth; nothing else uses this.

use std::collections::BTreeMap;

use calib_aor::{FrameAxes, FrameSample, Input, Options};
use calib_geometry::{mean::axis_mean, so3};
use nalgebra::{Isometry3, Matrix3, Point3, Unit, Vector3};

/// (body_from_joint, world_from_joint) by (1); `None` where a plane or the mean has no answer. `truth`: gives the axes their signs.
pub(crate) fn algorithm1_as_printed(
    samples: &[FrameSample],
    center: &Point3<f64>,
    axes: FrameAxes,
    truth: &Isometry3<f64>,
) -> Option<(Isometry3<f64>, Isometry3<f64>)> {
    let options = Options {
        center: Some(*center),
        ..Options::default()
    };
    let proximal = mean_axis(
        samples,
        |s| s.distal,
        &options,
        &(truth * axes.proximal.axis()),
    )?;
    let distal = mean_axis(
        samples,
        |s| s.proximal,
        &options,
        &(truth * axes.distal.axis()),
    )?;
    let third = proximal.cross(&distal).try_normalize(1e-9)?;
    let world_from_joint =
        Matrix3::from_columns(&[distal.into_inner(), third, proximal.into_inner()]);
    let rotation = so3::nearest_rotation(&world_from_joint)?;
    let world_from_joint = Isometry3::from_parts(center.coords.into(), rotation);
    // At the reference configuration, α = β = 0: the sample nearest to it, its angles taken off.
    let nearest = samples.iter().min_by(|a, b| size(a).total_cmp(&size(b)))?;
    let pose = nearest.world_from_body?;
    let measured = nalgebra::Rotation3::from_matrix_unchecked(pose.rotation);
    let world_from_body =
        Isometry3::from_parts(pose.translation.into(), so3::quaternion_of(&measured));
    let turn = axes.turned(nearest.proximal, nearest.distal);
    let body_from_joint = world_from_body.inverse() * world_from_joint * turn;
    Some((body_from_joint, world_from_joint))
}

fn size(sample: &FrameSample) -> f64 {
    sample.proximal.hypot(sample.distal)
}

/// The mean of the axes of all planes in which `held` stands still.
fn mean_axis(
    samples: &[FrameSample],
    held: impl Fn(&FrameSample) -> f64,
    options: &Options,
    towards: &Unit<Vector3<f64>>,
) -> Option<Unit<Vector3<f64>>> {
    let mut planes: BTreeMap<i64, Vec<Option<Point3<f64>>>> = BTreeMap::new();
    for sample in samples {
        // Grid lines are degrees apart: a thousandth of a radian tells them.
        let line = (held(sample) * 1e3).round() as i64;
        let point = sample.world_from_body.map(|p| Point3::from(p.translation));
        planes.entry(line).or_default().push(point);
    }
    let mut found = Vec::new();
    for track in planes.into_values() {
        let tracks = [track];
        let circle = calib_aor::estimator("planar_radial_gn").ok()?;
        let options = options.only(circle.options);
        let outcome = circle.run(&Input::Points(&tracks), &options).ok()?;
        found.extend(outcome.estimate().map(|e| e.line.direction));
    }
    axis_mean(&found, Some(*towards)).ok()
}
