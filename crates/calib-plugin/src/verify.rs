//! What comes back, and what goes in, checked once at the border. Texts say which number is wrong.

use crate::{
    answer::{AorFit, AxisLine, CorFit},
    effect::JointStates,
    motion::Motion,
    streams::ReportFile,
};

/// Entries of RᵀR − I may add up to this much, as for recordings (printed matrices have four decimals).
const ROTATION_LIMIT: f64 = 1e-4;
/// A direction may miss unit length by this much: single precision normalizes to 10⁻⁷.
const UNIT_LIMIT: f64 = 1e-6;
/// A covariance may be asymmetric, or its correlations exceed one, by this part: rounding of a 6 × 6 inverse.
const COVARIANCE_LIMIT: f64 = 1e-6;

type Verified = Result<(), String>;

fn finite(what: &str, values: &[f64]) -> Verified {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(i) => Err(format!("{what}[{i}] is {}", values[i])),
    }
}

/// Defect of a rotation, as a text; row-major.
pub(crate) fn rotation(what: &str, r: &[[f64; 3]; 3]) -> Verified {
    // RᵀR − I, and det R
    let mut defect = 0.0;
    for i in 0..3 {
        for j in 0..3 {
            let dot: f64 = (0..3).map(|k| r[k][i] * r[k][j]).sum();
            defect += (dot - f64::from(u8::from(i == j))).abs();
        }
    }
    let determinant = r[0][0] * (r[1][1] * r[2][2] - r[1][2] * r[2][1])
        - r[0][1] * (r[1][0] * r[2][2] - r[1][2] * r[2][0])
        + r[0][2] * (r[1][0] * r[2][1] - r[1][1] * r[2][0]);
    // A NaN fails both comparisons.
    if defect <= ROTATION_LIMIT && determinant > 0.0 {
        return Ok(());
    }
    Err(format!(
        "{what} is not a rotation (RᵀR differs from I by {defect:.1e}, det {determinant:.3})"
    ))
}

fn covariance<const N: usize>(c: &[[f64; N]; N]) -> Verified {
    finite("covariance", c.as_flattened())?;
    for i in 0..N {
        if c[i][i] < 0.0 {
            return Err(format!(
                "covariance[{i}][{i}] is negative ({:.3e})",
                c[i][i]
            ));
        }
        for j in 0..i {
            // |c_ij| ≤ √(c_ii c_jj)
            let largest = (c[i][i] * c[j][j]).sqrt();
            let slack = COVARIANCE_LIMIT * largest + f64::MIN_POSITIVE;
            if (c[i][j] - c[j][i]).abs() > slack {
                return Err(format!("covariance is not symmetric at [{i}][{j}]"));
            }
            if c[i][j].abs() > largest + slack {
                return Err(format!("covariance[{i}][{j}] is a correlation above one"));
            }
        }
    }
    Ok(())
}

fn length(what: &str, got: usize, needed: usize, of: &str) -> Verified {
    if got == 0 || got == needed {
        return Ok(());
    }
    Err(format!("{got} {what} for {needed} {of}"))
}

fn common(motion: &Motion<'_>, rms_m: f64, used: usize, rejected: &[[usize; 2]]) -> Verified {
    if !(rms_m.is_finite() && rms_m >= 0.0) {
        return Err(format!("rms_m is {rms_m}"));
    }
    let rows = motion.tracks.saturating_mul(motion.samples);
    if used > rows {
        return Err(format!("{used} samples used of {rows}"));
    }
    if let Some([track, sample]) = rejected
        .iter()
        .find(|[track, sample]| *track >= motion.tracks || *sample >= motion.samples)
    {
        return Err(format!(
            "rejected (track {track}, sample {sample}), which there is not"
        ));
    }
    Ok(())
}

/// A center of rotation.
pub(crate) fn cor(fit: &CorFit, motion: &Motion<'_>) -> Verified {
    finite("center_m", &fit.center_m)?;
    common(motion, fit.rms_m, fit.used, &fit.rejected)?;
    if let Some(c) = &fit.covariance_m2 {
        covariance(c)?;
    }
    length("radii", fit.radii_m.len(), motion.tracks, "markers")?;
    finite("radii_m", &fit.radii_m)?;
    if let Some(radius) = fit.radii_m.iter().find(|r| **r < 0.0) {
        return Err(format!("a radius is negative ({radius})"));
    }
    length(
        "body points",
        fit.body_points_m.len(),
        motion.tracks,
        "bodies",
    )?;
    finite("body_points_m", fit.body_points_m.as_flattened())
}

fn line(what: &str, line: &AxisLine) -> Verified {
    finite(&format!("{what} point_m"), &line.point_m)?;
    finite(&format!("{what} direction"), &line.direction)?;
    let norm = line.direction.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (norm - 1.0).abs() > UNIT_LIMIT {
        return Err(format!("the direction of {what} has length {norm}, not 1"));
    }
    Ok(())
}

/// An axis of rotation.
pub(crate) fn aor(fit: &AorFit, motion: &Motion<'_>) -> Verified {
    line("axis", &fit.line)?;
    common(motion, fit.rms_m, fit.used, &fit.rejected)?;
    if let Some(c) = &fit.covariance {
        covariance(c)?;
    }
    fit.in_child
        .as_ref()
        .map_or(Ok(()), |in_child| line("in_child", in_child))
}

/// The data of a call: sizes first, because a plugin trusts them.
pub(crate) fn motion(motion: &Motion<'_>) -> Verified {
    let rows = motion
        .tracks
        .checked_mul(motion.samples)
        .ok_or_else(|| "tracks × samples is too large".to_string())?;
    let poses = motion.shape.is_poses();
    let (points, matrices) = if poses { (0, rows) } else { (rows, 0) };
    for (what, got, needed) in [
        ("seen", motion.seen.len(), rows),
        ("points_m", motion.points_m.len(), points),
        ("rotations", motion.rotations.len(), matrices),
        ("translations_m", motion.translations_m.len(), matrices),
        (
            "covariances_m2",
            motion.covariances_m2.map_or(rows, <[_]>::len),
            rows,
        ),
        (
            "angles_rad",
            motion.angles_rad.map_or(motion.samples, <[_]>::len),
            motion.samples,
        ),
    ] {
        if got != needed {
            return Err(format!("{what} has {got} rows, needs {needed}"));
        }
    }
    let tracks = match motion.shape {
        crate::Shape::Poses => 1,
        crate::Shape::TwoBodies => 2,
        _ => motion.tracks,
    };
    if motion.tracks != tracks {
        return Err(format!(
            "{} tracks of {}",
            motion.tracks,
            motion.shape.word()
        ));
    }
    let place = |row: usize| {
        let samples = motion.samples.max(1);
        format!("track {}, sample {}", row / samples, row % samples)
    };
    for row in 0..rows {
        match motion.seen[row] {
            0 => continue,
            1 => {}
            other => return Err(format!("{}: seen is {other}, not 0 or 1", place(row))),
        }
        let point = if poses {
            &motion.translations_m[row]
        } else {
            &motion.points_m[row]
        };
        let covariance = motion
            .covariances_m2
            .map_or(0.0, |c| c[row].as_flattened().iter().sum());
        if !(point[0] + point[1] + point[2] + covariance).is_finite() {
            return Err(format!("{}: not a finite number", place(row)));
        }
        if poses {
            rotation(&place(row), &motion.rotations[row])?;
        }
    }
    finite("angles_rad", motion.angles_rad.unwrap_or(&[]))?;
    finite("center_m", &motion.center_m.unwrap_or_default())?;
    finite("towards", &motion.towards.unwrap_or_default())?;
    finite(
        "sigma",
        &[
            motion.sigma_t_m.unwrap_or(0.0),
            motion.sigma_r_rad.unwrap_or(0.0),
        ],
    )?;
    if !(motion.significance > 0.0 && motion.significance < 1.0) {
        return Err(format!(
            "significance is {}, not in (0, 1)",
            motion.significance
        ));
    }
    Ok(())
}

/// States of a joint: sizes first, because a plugin trusts them.
pub(crate) fn states(states: &JointStates<'_>) -> Verified {
    for (what, values) in [
        ("readings", states.readings),
        ("motor_rad", states.motor_rad),
        ("loads", states.loads),
        ("approaches", states.approaches),
    ] {
        length(what, values.len(), states.samples(), "samples")?;
        finite(what, values)?;
    }
    Ok(())
}

/// Regressors of a joint effect.
pub(crate) fn regressors(values: &[f64], samples: usize) -> Verified {
    if values.len() != samples {
        return Err(format!("{} regressors for {samples} samples", values.len()));
    }
    finite("regressors", values)
}

/// The files of a report: relative paths that stay inside their folder, each once.
pub(crate) fn files(files: &[ReportFile]) -> Verified {
    if files.is_empty() {
        return Err("no file was made".into());
    }
    for (i, file) in files.iter().enumerate() {
        path(&file.path)?;
        // Case is ignored because some file systems do.
        let same = |other: &ReportFile| other.path.eq_ignore_ascii_case(&file.path);
        if files[..i].iter().any(same) {
            return Err(format!("`{}` was given twice", file.path));
        }
    }
    Ok(())
}

/// One path of a report's file.
pub(crate) fn path(path: &str) -> Verified {
    let good = |part: &str| !matches!(part, "" | "." | "..") && !part.contains(['\\', ':', '\0']);
    if path.split('/').all(good) {
        return Ok(());
    }
    Err(format!("the path `{path}` is not a plain relative path"))
}
