//! Names of estimators, readers, report writers and joint effects in a profile that nothing is called, and parameters that these do not
//! have, each at its place.

use calib_finding::nearest_word;
use std::collections::BTreeMap;

use calib_plugin::{Entry, Kind, Origin, ParameterError, PluginError, Registry, Shape, Tables};
use calib_profile::{ParameterValue, Profile, ProfileError};
use calib_urdf::RobotModel;

use crate::error::PipelineError;
use crate::prepare::estimators::values;
use crate::prepare::inputs::Written;

/// A name in the profile.
struct Named<'a> {
    kind: Kind,
    name: &'a str,
    /// Keys that lead to it; whether it is the last of them, not the value there.
    path: Vec<&'a str>,
    is_key: bool,
    /// What it is for.
    of: String,
}

/// Refuses the first name that is not in the tables.
///
/// # Errors
/// [`PipelineError::Profile`] with line, nearest name and the names there are.
pub(crate) fn check(
    profile: &Profile,
    model: &RobotModel,
    tables: &Tables,
    written: &Written,
) -> Result<(), PipelineError> {
    for named in names(profile, model) {
        let offered = match named.kind {
            Kind::Cor => offered(&tables.cor),
            Kind::Aor => offered(&tables.aor),
            Kind::Reader => offered(&tables.reader),
            Kind::Report => offered(&tables.report),
            Kind::Effect => offered(&tables.effect),
        };
        if offered.iter().any(|(name, _)| *name == named.name) {
            continue;
        }
        let Written { shown, text } = written;
        let finding = format!(
            "{}: no {} is called `{}`",
            named.of,
            named.kind.word(),
            named.name
        );
        let remedy = remedy(&named, &offered);
        let error = match named.is_key {
            true => ProfileError::at_key(shown, text, &named.path, finding, remedy),
            false => ProfileError::at(shown, text, &named.path, finding, remedy),
        };
        return Err(error.into());
    }
    Ok(())
}

/// Refuses parameters, at this path of the profile, that are not what the offer describes.
///
/// # Errors
/// [`PipelineError::Profile`] at the parameter.
pub(crate) fn parameters<T: ?Sized>(
    entry: &Entry<T>,
    given: &BTreeMap<String, ParameterValue>,
    path: &[&str],
    written: &Written,
) -> Result<(), PipelineError> {
    let (of, problem) = match entry.with(&values(given)) {
        Ok(_) => return Ok(()),
        Err(PluginError::Parameter { of, problem }) => (of, problem),
        Err(other) => return Err(other.into()),
    };
    let Written { shown, text } = written;
    let path = [path, &[problem.name()]].concat();
    Err(match &problem {
        ParameterError::Unknown { name, known } => {
            let finding = format!("{of}: no parameter is called `{name}`");
            let near = match nearest_word(name, known.iter().map(String::as_str)) {
                Some(near) => format!("did you mean `{near}`? "),
                None => String::new(),
            };
            let remedy = match known.is_empty() {
                true => "it has none: delete the key".to_owned(),
                false => format!("{near}known: {}", known.join(", ")),
            };
            ProfileError::at_key(shown, text, &path, finding, remedy)
        }
        ParameterError::Missing { .. } => {
            let remedy = format!("give it under `{}`", path[path.len() - 2]);
            ProfileError::at(shown, text, &path, format!("{of}: {problem}"), remedy)
        }
        _ => {
            let remedy = "correct the value, or delete the key: then the default is used";
            ProfileError::at(shown, text, &path, format!("{of}: {problem}"), remedy)
        }
    }
    .into())
}

/// Refuses an estimator, at this path of the profile, that does not take the data that it would be given.
///
/// # Errors
/// [`PipelineError::Profile`] at its name.
pub(crate) fn takes<T: ?Sized>(
    entry: &Entry<T>,
    shape: Shape,
    path: &[&str],
    written: &Written,
) -> Result<(), PipelineError> {
    entry.takes(shape).map_err(|error| {
        let Written { shown, text } = written;
        let remedy = "`calib plugins` lists the others; what each takes is in the manual, under `estimators`";
        ProfileError::at(shown, text, path, error.to_string(), remedy).into()
    })
}

/// Names of a kind with the plugin that offers each.
type Offered<'a> = Vec<(&'a str, Option<&'a str>)>;

fn offered<T: ?Sized>(registry: &Registry<T>) -> Offered<'_> {
    let one = registry.iter().map(|entry| {
        let plugin = match entry.origin() {
            Origin::Plugin { plugin, .. } => Some(plugin.as_str()),
            Origin::BuiltIn => None,
        };
        (entry.offer().name.as_str(), plugin)
    });
    one.collect()
}

fn remedy(named: &Named<'_>, offered: &[(&str, Option<&str>)]) -> String {
    let (kind, name) = (named.kind.word(), named.name);
    let of_plugin = offered.iter().filter(|(_, plugin)| *plugin == Some(name));
    let of_plugin: Vec<&str> = of_plugin.map(|(name, _)| *name).collect();
    if !of_plugin.is_empty() {
        let offers = of_plugin.join("`, `");
        return format!("`{name}` is the plugin; as {kind} it offers `{offers}`");
    }
    let known: Vec<&str> = offered.iter().map(|(name, _)| *name).collect();
    let near = match nearest_word(name, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`? "),
        None => String::new(),
    };
    match known.is_empty() {
        true => format!("none is built in: name the plugin that offers a {kind} under `plugins`"),
        false => format!("{near}known: {}", known.join(", ")),
    }
}

/// Every name of the profile.
fn names<'a>(profile: &'a Profile, model: &'a RobotModel) -> Vec<Named<'a>> {
    let mut names = Vec::new();
    let mut push = |kind, name: &'a str, path: Vec<&'a str>, of: String| {
        names.push(Named {
            kind,
            name,
            is_key: path.last() == Some(&name),
            path,
            of,
        });
    };
    for (origin, spec) in &profile.origins {
        let of = format!("origin `{origin}`");
        let path = |key| vec!["origins", origin.as_str(), key];
        push(Kind::Cor, &spec.center, path("center"), of.clone());
        push(Kind::Aor, &spec.axis, path("axis"), of);
    }
    for (recording, spec) in &profile.recordings {
        let of = format!("recording `{recording}`");
        let place = ["recordings", recording.as_str()];
        if let Some(reader) = &spec.reader {
            let path = [&place[..], &["reader"]].concat();
            push(Kind::Reader, reader, path, of.clone());
        }
        if let Some(reader) = spec.robot_log.as_ref().and_then(|log| log.reader.as_ref()) {
            let path = [&place[..], &["robot_log", "reader"]].concat();
            push(Kind::Reader, reader, path, of);
        }
    }
    for (joint, exception) in &profile.solve.joints {
        let joint = model.joint(*joint).name.as_str();
        for effect in exception.effects.keys() {
            let path = vec!["solve", "joints", joint, "effects", effect];
            push(Kind::Effect, effect, path, format!("joint `{joint}`"));
        }
    }
    for writer in profile.outputs.reports.keys() {
        let path = vec!["outputs", "reports", writer.as_str()];
        push(Kind::Report, writer, path, "outputs".to_owned());
    }
    names
}
