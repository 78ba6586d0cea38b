//! The estimators of a plugin on one table.

use std::fmt::Write as _;

use calib_cor::Pose;
use calib_plugin::{
    Answer as Estimated, AorFit, BodyPose, Control, CorFit, Entry, MotionData, Offer, Origin,
    PluginError, Registry, Shape, Tables, typed,
};
use serde_json::{Value, json};

use crate::answer::{Answer, OF_CENTER, OF_LINE, answer, coordinates, copied, doubt};
use crate::error::FitError;
use crate::table::Table;
use crate::{TableRequest, usage};

/// What the plugins that a request names offer.
fn tables(request: &TableRequest) -> Result<Tables, PluginError> {
    let mut tables = Tables::default();
    tables.add_named(&request.plugins)?;
    Ok(tables)
}

/// `calib fit cor --plugin`.
pub(crate) fn cor(request: &TableRequest) -> Result<Answer, FitError> {
    let tables = tables(request)?;
    if request.list {
        return Ok(listed(&tables.cor));
    }
    let (table, entry) = (Table::read(request)?, chosen(request, &tables.cor)?);
    let motion = motion(request, &table, entry.offer())?;
    let bound = entry.with(&typed(&entry.offer().parameters, &request.parameters))?;
    Ok(match bound.fit(&motion.view(), &Control::default())? {
        Estimated::NotObservable(why) => refused(entry, &why),
        Estimated::Found(fit) => center(&table, entry, &fit),
    })
}

/// `calib fit aor --plugin`.
pub(crate) fn aor(request: &TableRequest) -> Result<Answer, FitError> {
    let tables = tables(request)?;
    if request.list {
        return Ok(listed(&tables.aor));
    }
    let (table, entry) = (Table::read(request)?, chosen(request, &tables.aor)?);
    let motion = motion(request, &table, entry.offer())?;
    let bound = entry.with(&typed(&entry.offer().parameters, &request.parameters))?;
    Ok(match bound.fit(&motion.view(), &Control::default())? {
        Estimated::NotObservable(why) => refused(entry, &why),
        Estimated::Found(fit) => axis(&table, entry, &fit),
    })
}

/// The estimator that is named, or the only one.
fn chosen<'a, T: ?Sized>(
    request: &TableRequest,
    registry: &'a Registry<T>,
) -> Result<&'a Entry<T>, FitError> {
    if request.all {
        return Err(usage(
            "--all runs the built-in estimators, not those of plugins",
            "replace --all by --estimator NAME, or remove --plugin; `calib study cor|aor --plugin PLUGIN` compares an estimator with the built-in ones",
        ));
    }
    if let Some(name) = &request.estimator {
        return Ok(registry.get(name)?);
    }
    let names: Vec<&str> = registry.iter().map(|e| e.offer().name.as_str()).collect();
    match names.as_slice() {
        [only] => Ok(registry.get(only)?),
        [] => Err(usage(
            "the plugin offers no estimator of this kind",
            "`calib plugins check PLUGIN` lists what it offers",
        )),
        several => Err(usage(
            format!("the plugins offer {}", several.join(", ")),
            "name one with --estimator",
        )),
    }
}

/// The measurements in the first shape that the estimator takes and the table has. What the contract cannot pass on is refused.
fn motion(request: &TableRequest, table: &Table, offer: &Offer) -> Result<MotionData, FitError> {
    let ignored = [
        (request.noise_per_marker, "--noise-per-marker"),
        (!table.weights.is_empty(), "--weights"),
    ];
    if let Some((_, flag)) = ignored.into_iter().find(|(given, _)| *given) {
        return Err(usage(
            format!("an estimator of a plugin is not given {flag}"),
            "remove it",
        ));
    }
    let points = || -> Vec<Vec<Option<[f64; 3]>>> {
        let tracks = table.markers.iter();
        tracks
            .map(|(_, track)| track.iter().map(|p| p.map(|p| p.coords.into())).collect())
            .collect()
    };
    let pose = |p: &Option<Pose>| {
        p.map(|p| BodyPose {
            rotation: std::array::from_fn(|i| std::array::from_fn(|j| p.rotation[(i, j)])),
            translation_m: p.translation.into(),
        })
    };
    let poses = |track: &Vec<Option<Pose>>| track.iter().map(pose).collect::<Vec<_>>();
    let given = |shape: &Shape| match (shape, &table.pair, &table.body) {
        (Shape::TwoBodies, Some([parent, child]), _) => {
            Some(MotionData::two_bodies(&poses(parent), &poses(child)))
        }
        (Shape::Poses, None, Some(body)) => Some(MotionData::poses(&poses(body))),
        (Shape::Markers, None, _) if table.rigid && !table.origin_only => {
            Some(MotionData::markers(&points()))
        }
        (Shape::Points, None, _) => Some(MotionData::points(&points())),
        _ => None,
    };
    let Some(mut motion) = offer.shapes.iter().find_map(given) else {
        let takes: Vec<&str> = offer.shapes.iter().map(|shape| shape.word()).collect();
        return Err(usage(
            format!(
                "`{}` takes {}, which the table does not have",
                offer.name,
                takes.join(", ")
            ),
            "a body's poses need its columns or 3 markers; two bodies need --parent and --child",
        ));
    };
    if !table.covariances.is_empty() {
        if !matches!(motion.view().shape, Shape::Points | Shape::Markers) {
            return Err(usage(
                format!(
                    "`{}` takes poses: covariances of samples are of points",
                    offer.name
                ),
                "remove --covariances or --sigma-sight-mm",
            ));
        }
        let all = table.covariances.iter().flatten();
        motion.covariances_m2 = all
            .map(|c| std::array::from_fn(|i| std::array::from_fn(|j| c[(i, j)])))
            .collect();
    }
    motion.angles_rad.clone_from(&table.angles);
    motion.sigma_t_m = request.sigma_m;
    motion.sigma_r_rad = request.sigma_rad;
    motion.center_m = request.center_m.map(|p| p.coords.into());
    motion.towards = request.towards.map(Into::into);
    Ok(motion)
}

/// The estimators that the plugins offer.
fn listed<T: ?Sized>(registry: &Registry<T>) -> Answer {
    let (mut text, mut values) = (String::new(), Vec::new());
    for entry in registry.iter() {
        let offer = entry.offer();
        let takes: Vec<&str> = offer.shapes.iter().map(|shape| shape.word()).collect();
        let takes = takes.join(", ");
        let (name, what) = (&offer.name, &offer.summary);
        let _ = writeln!(text, "{name:<16} {takes:<10} {what} ({})", entry.origin());
        values.push(json!({ "id": name, "input": takes, "name": what, "source": offer.source }));
    }
    answer(text, &Value::Array(values), true)
}

/// What both answers begin with; `plugin` says whose code answered.
fn head<T: ?Sized>(entry: &Entry<T>, weak: Option<&str>) -> Value {
    let plugin = match entry.origin() {
        Origin::BuiltIn => Value::Null,
        Origin::Plugin {
            plugin,
            version,
            sha256,
            ..
        } => json!({ "name": plugin, "version": version, "sha256": sha256 }),
    };
    json!({
        "estimator": entry.offer().name,
        "plugin": plugin,
        "observable": weak.is_none(),
        "reason": weak,
    })
}

fn refused<T: ?Sized>(entry: &Entry<T>, why: &str) -> Answer {
    let name = &entry.offer().name;
    let text = format!("{name}: not observable: {why}\n");
    answer(text, &head(entry, Some(why)), false)
}

/// Rows of the file whose samples were rejected.
fn rows(table: &Table, rejected: &[[usize; 2]]) -> Vec<u64> {
    let rows = rejected.iter();
    rows.filter_map(|[_, row]| table.rows.get(*row).copied())
        .collect()
}

/// RMS, counts and origin: the end of both answers.
fn tail<T: ?Sized>(entry: &Entry<T>, rms_m: f64, used: usize, rejected: usize) -> String {
    format!(
        "  rms {:.4} mm, {used} samples used, {rejected} rejected\n  {}\n",
        rms_m * 1e3,
        entry.origin()
    )
}

fn center(table: &Table, entry: &Entry<dyn calib_plugin::Cor>, fit: &CorFit) -> Answer {
    let mut value = head(entry, fit.weak.as_deref());
    value["center_m"] = json!(fit.center_m);
    value["covariance"] = json!(fit.covariance_m2);
    value["covariance_of"] = json!(OF_CENTER);
    value["radius_m"] = json!(fit.radii_m);
    value["rms_m"] = json!(fit.rms_m);
    value["used"] = json!(fit.used);
    value["rejected"] = json!(rows(table, &fit.rejected));
    let mut text = format!(
        "{}: center {} m\n",
        entry.offer().name,
        coordinates(&fit.center_m)
    );
    text += &doubt(fit.weak.as_deref());
    match &fit.covariance_m2 {
        Some(c) => {
            let sigma = [0, 1, 2].map(|i| format!("{:.4}", c[i][i].max(0.0).sqrt() * 1e3));
            let _ = writeln!(text, "  sigma  {} mm", sigma.join(", "));
        }
        None => text += "  sigma  not stated by the plugin\n",
    }
    text += &tail(entry, fit.rms_m, fit.used, fit.rejected.len());
    text += &copied(table.copies);
    answer(text, &value, fit.weak.is_none())
}

fn axis(table: &Table, entry: &Entry<dyn calib_plugin::Aor>, fit: &AorFit) -> Answer {
    let mut value = head(entry, fit.weak.as_deref());
    value["direction"] = json!(fit.line.direction);
    value["point_m"] = json!(fit.line.point_m);
    value["covariance"] = json!(fit.covariance);
    value["covariance_of"] = json!(OF_LINE);
    value["rms_m"] = json!(fit.rms_m);
    value["used"] = json!(fit.used);
    value["rejected"] = json!(rows(table, &fit.rejected));
    let name = &entry.offer().name;
    let mut text = format!("{name}: direction {}\n", coordinates(&fit.line.direction));
    text += &doubt(fit.weak.as_deref());
    let _ = writeln!(text, "  through {} m", coordinates(&fit.line.point_m));
    match &fit.covariance {
        Some(c) => {
            let sigma = |at: usize, unit: f64| {
                let of = (at..at + 3).map(|i| format!("{:.4}", c[i][i].max(0.0).sqrt() * unit));
                of.collect::<Vec<_>>().join(", ")
            };
            let _ = writeln!(
                text,
                "  sigma  direction {} mrad, point {} mm",
                sigma(0, 1e3),
                sigma(3, 1e3)
            );
        }
        None => text += "  sigma  not stated by the plugin\n",
    }
    text += &tail(entry, fit.rms_m, fit.used, fit.rejected.len());
    text += &copied(table.copies);
    answer(text, &value, fit.weak.is_none())
}
