//! The difference of two robots, or of two files.

use std::path::Path;

use calib_urdf::source;

use crate::error::ApplyError;
use crate::kind::Kind;
use crate::target::{Origins, origins};

fn text(path: &Path) -> Result<String, ApplyError> {
    Ok(source::read_text(path, &path.display().to_string())?)
}

/// The difference of two robots as a table: URDFs, xacros, kinematics YAMLs, or one of each.
///
/// # Errors
/// [`ApplyError::Read`] with file and place, [`ApplyError::NoOrigins`] for a YAML that is about something else.
pub fn diff_table(a: &Path, b: &Path) -> Result<String, ApplyError> {
    Ok(format!("{}\n", model_diff(a, b)?).trim_end().to_owned() + "\n")
}

/// The difference of two robots as JSON.
///
/// # Errors
/// As [`diff_table`].
pub fn diff_json(a: &Path, b: &Path) -> Result<String, ApplyError> {
    Ok(calib_report::json::exact_json(&model_diff(a, b)?)?)
}

/// The difference of two files, line by line.
///
/// # Errors
/// [`ApplyError::Read`] when a file cannot be read as text.
pub fn diff_unified(a: &Path, b: &Path) -> Result<String, ApplyError> {
    Ok(calib_urdf::unified(
        &text(a)?,
        &a.display().to_string(),
        &text(b)?,
        &b.display().to_string(),
    ))
}

/// The origins of a file; a YAML must have some, or all joints would seem to be removed.
fn compared(path: &Path) -> Result<Origins, ApplyError> {
    let none = |is_profile| ApplyError::NoOrigins {
        path: path.to_path_buf(),
        is_profile,
    };
    let said = text(path)?;
    let is_xml = said
        .trim_start_matches('\u{feff}')
        .trim_start()
        .starts_with('<');
    if !is_xml && said.lines().any(|line| line.starts_with("calib:")) {
        return Err(none(true));
    }
    let found = origins(path)?;
    if found.kind == Kind::Yaml && found.found.is_empty() {
        return Err(none(false));
    }
    Ok(found)
}

fn model_diff(a: &Path, b: &Path) -> Result<calib_urdf::ModelDiff, ApplyError> {
    let (of_a, of_b) = (compared(a)?, compared(b)?);
    if (of_a.kind, of_b.kind) == (Kind::Urdf, Kind::Urdf) {
        return Ok(calib_urdf::diff(
            &text(a)?,
            &a.display().to_string(),
            &text(b)?,
            &b.display().to_string(),
        )?);
    }
    let mut from = of_a.found;
    // A UR arm's YAML calls `shoulder` what its URDF calls `shoulder_pan_joint`.
    let to: Vec<_> = of_b
        .found
        .into_iter()
        .map(|(name, pose)| {
            let known = from.iter().find(|(other, _)| same_joint(other, &name));
            (known.map_or(name, |(other, _)| other.clone()), pose)
        })
        .collect();
    let computed = |name: &String| {
        let found = of_a.computed.iter().chain(&of_b.computed);
        found.into_iter().any(|other| other == name)
    };
    let mut not_compared: Vec<String> = of_a
        .computed
        .iter()
        .chain(&of_b.computed)
        .cloned()
        .collect();
    not_compared.sort();
    not_compared.dedup();
    from.retain(|(name, _)| !computed(name));
    let to: Vec<_> = to.into_iter().filter(|(name, _)| !computed(name)).collect();
    let mut diff = calib_urdf::diff_origins(&from, &to);
    // What one file lacks may be what xacro makes of a name of it.
    let composed: Vec<&String> = from
        .iter()
        .chain(&to)
        .map(|(name, _)| name)
        .chain(&not_compared)
        .filter(|name| name.contains("${") || name.contains("$("))
        .collect();
    let unknown = |name: &String| {
        let mut composed = composed.iter();
        composed.any(|written| *written == name || calib_urdf::xacro_may_name(written, name))
    };
    for list in [&mut diff.added_joints, &mut diff.removed_joints] {
        let (open, only): (Vec<_>, Vec<_>) = std::mem::take(list).into_iter().partition(unknown);
        *list = only;
        diff.not_compared.extend(open);
    }
    diff.not_compared.extend(not_compared);
    diff.not_compared.sort();
    diff.not_compared.dedup();
    Ok(diff)
}

fn same_joint(a: &str, b: &str) -> bool {
    a == b || calib_urdf::ur_key(a) == Some(b) || calib_urdf::ur_key(b) == Some(a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_no_robot() {
        let robots = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
        let (urdf, profile) = (robots.join("ripley/r17.urdf"), robots.join("ripley.yaml"));
        for (a, b) in [(&urdf, &profile), (&profile, &urdf)] {
            let refused = diff_table(a, b).expect_err("a profile");
            let said = refused.to_string();
            let start = format!("{}: this YAML holds no origins", profile.display());
            assert!(said.starts_with(&start), "{said}");
            assert!(
                said.contains("it is a profile of calib\n  help: "),
                "{said}"
            );
            assert_eq!(refused.path(), Some(profile.as_path()));
        }
        assert!(diff_table(&urdf, &urdf).is_ok());
    }
}
