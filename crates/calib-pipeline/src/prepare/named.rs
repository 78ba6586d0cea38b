//! Estimators, readers, report writers and joint effects that a profile names: whether they are there and take what they would be given, and whose code
//! they are. Asked before a file is opened, so that `calib check` refuses what `calib run` would.

use std::collections::{BTreeMap, BTreeSet};

use calib_finding::{About, Fact, Finding, Subject, catalog};
use calib_plugin::{Entry, Kind, Origin as From, Shape, Tables};
use calib_profile::{BodyKind, Origin};
use calib_report::{Component, PluginFile};

use crate::error::PipelineError;
use crate::prepare::inputs::{Inputs, RobotProfile};
use crate::prepare::unknown;

/// Whether an origin's estimator is that of an axis, not of a center.
fn is_line(origin: &Origin) -> bool {
    origin.axes.len() == 1
}

/// Refuses names that are not there, parameters that they do not have, and data that they do not take.
///
/// # Errors
/// [`PipelineError::Profile`] with the place.
pub(crate) fn check(robot: &RobotProfile, tables: &Tables) -> Result<(), PipelineError> {
    let (profile, written) = (&robot.profile, &robot.written);
    unknown::check(profile, &robot.model, tables, written)?;
    for (name, origin) in &profile.origins {
        let path = |key| ["origins", name.as_str(), key];
        let center = tables.cor.get(&origin.center)?;
        let given = &origin.center_parameters;
        unknown::parameters(center, given, &path("center_parameters"), written)?;
        let axis = tables.aor.get(&origin.axis)?;
        let given = &origin.axis_parameters;
        unknown::parameters(axis, given, &path("axis_parameters"), written)?;
        let markers = matches!(
            profile.bodies.get(&origin.body).map(|b| &b.kind),
            Some(BodyKind::Markers { .. })
        );
        if is_line(origin) {
            unknown::takes(axis, Shape::Poses, &path("axis"), written)?;
        } else if !(markers && center.offer().shapes.contains(&Shape::Markers)) {
            unknown::takes(center, Shape::Poses, &path("center"), written)?;
        }
    }
    for (name, spec) in &profile.recordings {
        if let Some(reader) = &spec.reader {
            let path = ["recordings", name.as_str(), "reader_parameters"];
            let reader = tables.reader.get(reader)?;
            unknown::parameters(reader, &spec.reader_parameters, &path, written)?;
        }
    }
    for (joint, exception) in &profile.solve.joints {
        let joint = robot.model.joint(*joint).name.as_str();
        for (name, given) in &exception.effects {
            let path = ["solve", "joints", joint, "effects", name.as_str()];
            unknown::parameters(tables.effect.get(name)?, given, &path, written)?;
        }
    }
    for (name, given) in &profile.outputs.reports {
        let path = ["outputs", "reports", name.as_str()];
        unknown::parameters(tables.report.get(name)?, given, &path, written)?;
    }
    Ok(())
}

/// What the profile names and nothing uses: estimators that no origin calls, plugins, and names of the tracker that no recording has.
pub(crate) fn unused(inputs: &Inputs) -> Vec<Finding> {
    let profile = &inputs.robot.profile;
    let mut findings = Vec::new();
    for (name, origin) in &profile.origins {
        let about = About::Origin(name.clone());
        let (form, stated, estimator, called) = match is_line(origin) {
            true => ("center", origin.center_stated, &origin.center, &origin.axis),
            false => ("axis", origin.axis_stated, &origin.axis, &origin.center),
        };
        if stated {
            findings.push(
                Finding::of_kind(catalog::ORIGIN_ESTIMATOR_UNUSED, form, about)
                    .with("estimator", Fact::name(estimator))
                    .with("called", Fact::name(called)),
            );
        }
    }
    let used = components(inputs);
    let used: BTreeSet<&str> = used
        .iter()
        .filter_map(|c| Some(c.plugin.as_ref()?.name.as_str()))
        .collect();
    for (key, loaded) in &inputs.estimators.loaded {
        if used.contains(loaded.as_str()) {
            continue;
        }
        let offers = inputs.estimators.tables.list().into_iter();
        let offers = offers
            .filter(|(_, from)| matches!(from, From::Plugin { plugin, .. } if plugin == loaded));
        let offers = offers.map(|(offer, _)| offer.name.clone());
        findings.push(
            Finding::new(
                catalog::PLUGIN_UNUSED,
                Subject::default().in_file(&inputs.robot.file),
            )
            .with("plugin", Fact::name(key))
            .with("offers", Fact::names(offers)),
        );
    }
    for (name, from) in profile.names.iter().filter(|(name, from)| name != from) {
        let mut recordings = inputs.recordings.values();
        if !recordings.any(|recording| recording.meta.renamed(name, from)) {
            findings.push(
                Finding::new(
                    catalog::TRACKER_NAME_UNUSED,
                    Subject::default().in_file(&inputs.robot.file),
                )
                .with("name", Fact::name(name))
                .with("tracker", Fact::name(from)),
            );
        }
    }
    findings
}

/// Whether an origin is found by a plugin.
pub(crate) fn plugins_find_origins(inputs: &Inputs) -> bool {
    let tables = &inputs.estimators.tables;
    let mut origins = inputs.robot.profile.origins.values();
    origins.any(|origin| {
        let of_plugin = match is_line(origin) {
            true => tables.aor.get(&origin.axis).map(|e| e.origin().clone()),
            false => tables.cor.get(&origin.center).map(|e| e.origin().clone()),
        };
        of_plugin.is_ok_and(|from| from != From::BuiltIn)
    })
}

/// Everything that the profile's origins, recordings, joints and outputs used, by kind and name.
pub(crate) fn components(inputs: &Inputs) -> Vec<Component> {
    let (profile, tables) = (&inputs.robot.profile, &inputs.estimators.tables);
    let mut used = Used::default();
    for (name, origin) in &profile.origins {
        match is_line(origin) {
            true => used.add(tables.aor.get(&origin.axis).ok(), name),
            false => used.add(tables.cor.get(&origin.center).ok(), name),
        }
    }
    for (name, recording) in &inputs.recordings {
        used.add(tables.reader.get(&recording.meta.format).ok(), name);
    }
    for (name, spec) in &profile.recordings {
        let log = spec.robot_log.as_ref().and_then(|log| log.reader.as_ref());
        used.add(log.and_then(|id| tables.reader.get(id).ok()), name);
    }
    for (joint, exception) in &profile.solve.joints {
        let joint = &inputs.robot.model.joint(*joint).name;
        for name in exception.effects.keys() {
            used.add(tables.effect.get(name).ok(), joint);
        }
    }
    for name in profile.outputs.reports.keys() {
        used.add(tables.report.get(name).ok(), name);
    }
    used.0.into_values().collect()
}

/// Components by kind and name.
#[derive(Default)]
struct Used(BTreeMap<(Kind, String), Component>);

impl Used {
    fn add<T: ?Sized>(&mut self, entry: Option<&Entry<T>>, by: &str) {
        let Some(entry) = entry else { return };
        let offer = entry.offer();
        let plugin = match entry.origin() {
            From::BuiltIn => None,
            From::Plugin {
                plugin,
                version,
                sha256,
                ..
            } => Some(PluginFile {
                name: plugin.clone(),
                version: version.clone(),
                sha256: sha256.clone(),
            }),
        };
        let key = (offer.kind, offer.name.clone());
        let component = self.0.entry(key).or_insert_with(|| Component {
            kind: offer.kind.id().to_owned(),
            name: offer.name.clone(),
            used_for: Vec::new(),
            plugin,
        });
        if !component.used_for.iter().any(|known| known == by) {
            component.used_for.push(by.to_owned());
        }
    }
}
