//! Names of estimators, readers, report writers and joint effects in a profile that nothing is called, each at its place.

use calib_finding::nearest_word;
use calib_plugin::{Kind, Origin, Registry, Tables};
use calib_profile::{Profile, ProfileError};
use calib_urdf::RobotModel;

use crate::error::PipelineError;
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
