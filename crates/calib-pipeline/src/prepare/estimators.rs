//! Estimators that a profile names: the entries of the estimators' crates and those of plugins in one table.
//!
//! This is the only place where the plugin ABI and [`calib_estimator::EstimatorInfo`] meet: an adapter offers each built-in entry with the
//! options that a profile can set as its parameters, and calls [`calib_estimator::EstimatorInfo::run`].

use std::collections::BTreeMap;

use calib_cor::{InputKind, Pose, Shape as CorShape};
use calib_core::EffectKind;
use calib_estimator::{Estimate, EstimatorInfo, OptionId, Outcome, parameter};
use calib_plugin::{
    Answer, AorFit, AxisLine, ByFn, Call, Control, CorFit, Entry, Failure, Host, Kind, Motion,
    MotionData, Offer, PluginError, SearchPath, Shape, Tables, Value,
};
use calib_profile::Profile;
use nalgebra::{Matrix3, Point3, SMatrix, Vector3};

use crate::error::PipelineError;
use crate::options::Plugins;
use crate::prepare::plugin_effect::PluginEffect;
use crate::prepare::readers;

/// A center that was estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CenterFit {
    /// In the tracker's frame, m.
    pub center: Point3<f64>,
    /// Its covariance, m²; `None` when the estimator gives none.
    pub covariance: Option<Matrix3<f64>>,
}

/// An axis that was estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisFit {
    /// In the tracker's frame.
    pub line: calib_geometry::Line,
    /// Largest variance of the direction, rad²; `None` when the estimator gives none.
    pub direction_variance: Option<f64>,
    /// Mean variance of the point across the axis, m².
    pub point_variance: Option<f64>,
}

/// All estimators that a profile can name.
pub struct Estimators {
    /// The tables, built-in first.
    pub tables: Tables,
    /// Effects of joints that plugins compute for this profile.
    pub effects: Vec<PluginEffect>,
    /// Plugins that the profile names: what each calls itself, by its name there.
    pub loaded: BTreeMap<String, String>,
}

impl std::fmt::Debug for Estimators {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Estimators").finish_non_exhaustive()
    }
}

impl Estimators {
    /// The built-in ones only.
    ///
    /// # Errors
    /// [`PipelineError::Plugin`] when two have one name.
    pub fn built_in() -> Result<Self, PipelineError> {
        let mut tables = Tables::default();
        for info in calib_cor::estimators() {
            tables.cor.register(built_in_cor(info))?;
        }
        for info in calib_aor::estimators() {
            tables.aor.register(built_in_aor(info))?;
        }
        for reader in calib_recording::readers::readers() {
            tables.reader.register(readers::built_in_reader(reader))?;
        }
        for writer in readers::built_in_reports() {
            tables.report.register(writer)?;
        }
        Ok(Self {
            tables,
            effects: Vec::new(),
            loaded: BTreeMap::new(),
        })
    }

    /// Whether something of this kind has the name.
    #[must_use]
    pub fn has(&self, kind: Kind, name: &str) -> bool {
        let effects = || EffectKind::all().map(|kind| kind.effect().id);
        let offered = self.tables.list();
        let mut same = offered.iter().filter(|(offer, _)| offer.kind == kind);
        same.any(|(offer, _)| offer.name == name)
            || kind == Kind::Effect && effects().any(|effect| effect == name)
    }

    /// With the plugins that a profile names, found beside it and on the search path.
    ///
    /// # Errors
    /// [`PipelineError::Plugin`] when one cannot be loaded, has another hash, or offers a name that is taken.
    pub fn of_profile(
        profile: &Profile,
        folder: &std::path::Path,
        plugins: Plugins,
    ) -> Result<Self, PipelineError> {
        let mut estimators = Self::built_in()?;
        let refused = std::env::var_os("CALIB_NO_PLUGINS").is_some_and(|set| !set.is_empty());
        let enabled = plugins != Plugins::Refused && !refused;
        let mut host = Host::new(SearchPath::from_environment(Some(folder)), enabled);
        if plugins != Plugins::Allowed {
            host = host.without_foreign();
        }
        for (name, spec) in &profile.plugins {
            // Relative paths start from the profile: the search path knows its folder.
            let place = spec.path.clone().unwrap_or_else(|| name.clone());
            let loaded = host.load(&place, spec.sha256.as_deref())?;
            estimators.tables.add(&loaded)?;
            let own = loaded.description.name.clone();
            estimators.loaded.insert(name.clone(), own);
        }
        Ok(estimators)
    }

    /// With plugins that the user names, found on the search path or by their path. None is loaded where `CALIB_NO_PLUGINS` is set.
    ///
    /// # Errors
    /// As [`Estimators::of_profile`].
    pub fn with_plugins(plugins: &[String]) -> Result<Self, PipelineError> {
        let mut estimators = Self::built_in()?;
        estimators.tables.add_named(plugins)?;
        Ok(estimators)
    }

    /// Whether every regressor that a plugin was asked for is there.
    ///
    /// # Errors
    /// What the first call that failed ended with: results after it are not to be used.
    pub fn evaluated(&self) -> Result<(), PluginError> {
        self.effects.iter().try_for_each(PluginEffect::evaluated)
    }

    /// Finds a center; `Ok(Err(reason))` when the data do not determine one.
    ///
    /// # Errors
    /// [`PipelineError::Plugin`] for an unknown name, data that the estimator does not take, and failures.
    pub fn center(
        &self,
        id: &str,
        parameters: &BTreeMap<String, Value>,
        motion: &MotionData,
    ) -> Result<Result<CenterFit, String>, PipelineError> {
        let bound = self.tables.cor.get(id)?.with(parameters)?;
        Ok(match bound.fit(&motion.view(), &Control::default())? {
            Answer::NotObservable(reason) => Err(reason),
            Answer::Found(CorFit {
                weak: Some(reason), ..
            }) => Err(reason),
            Answer::Found(fit) => Ok(CenterFit {
                center: Point3::from(fit.center_m),
                covariance: fit.covariance_m2.map(|c| Matrix3::from_fn(|i, j| c[i][j])),
            }),
        })
    }
}

impl Estimators {
    /// Finds an axis; `Ok(Err(reason))` when the data do not determine one.
    ///
    /// # Errors
    /// As [`Estimators::center`].
    pub fn axis(
        &self,
        id: &str,
        parameters: &BTreeMap<String, Value>,
        motion: &MotionData,
    ) -> Result<Result<AxisFit, String>, PipelineError> {
        let bound = self.tables.aor.get(id)?.with(parameters)?;
        let fit = match bound.fit(&motion.view(), &Control::default())? {
            Answer::NotObservable(reason) => return Ok(Err(reason)),
            Answer::Found(AorFit {
                weak: Some(reason), ..
            }) => return Ok(Err(reason)),
            Answer::Found(fit) => fit,
        };
        let line = calib_geometry::Line::new(
            Point3::from(fit.line.point_m),
            Vector3::from(fit.line.direction),
        );
        let Some(line) = line else {
            return Ok(Err("the direction vanishes".to_owned()));
        };
        let block = |c: &[[f64; 6]; 6], at: usize| Matrix3::from_fn(|i, j| c[at + i][at + j]);
        Ok(Ok(AxisFit {
            line,
            direction_variance: fit.covariance.map(|c| {
                let eigen = calib_geometry::decompose::symmetric_eigen_small(&block(&c, 0));
                eigen.values[2].max(0.0)
            }),
            // Two directions across the axis share the trace; the third has none.
            point_variance: fit.covariance.map(|c| block(&c, 3).trace().max(0.0) / 2.0),
        }))
    }

    /// JSON Schema of the parameters of everything that a profile can name, by kind and name.
    #[must_use]
    pub fn parameter_schemas(&self) -> serde_json::Value {
        fn of<T: ?Sized>(registry: &calib_plugin::Registry<T>) -> serde_json::Value {
            let entry = |e: &Entry<T>| {
                (
                    e.offer().name.clone(),
                    calib_plugin::schema(&e.offer().parameters),
                )
            };
            serde_json::Value::Object(registry.iter().map(entry).collect())
        }
        serde_json::json!({
            Kind::Cor.id(): of(&self.tables.cor),
            Kind::Aor.id(): of(&self.tables.aor),
            Kind::Reader.id(): of(&self.tables.reader),
            Kind::Report.id(): of(&self.tables.report),
            Kind::Effect.id(): of(&self.tables.effect),
        })
    }
}

/// Values of a profile as values of the contract.
#[must_use]
pub fn values(given: &BTreeMap<String, calib_profile::ParameterValue>) -> BTreeMap<String, Value> {
    use calib_profile::ParameterValue as Given;
    let value = |v: &Given| match v {
        Given::Bool(b) => Value::Bool(*b),
        Given::Integer(i) => Value::Integer(*i),
        Given::Number(x) => Value::Number(*x),
        Given::Text(t) => Value::Text(t.clone()),
    };
    given
        .iter()
        .map(|(name, v)| (name.clone(), value(v)))
        .collect()
}

fn shapes(input: InputKind) -> Vec<Shape> {
    let shape = |kind: &InputKind| match kind {
        InputKind::Points => Some(Shape::Points),
        InputKind::Markers => Some(Shape::Markers),
        InputKind::Poses => Some(Shape::Poses),
        InputKind::TwoBodies => Some(Shape::TwoBodies),
        _ => None,
    };
    let mut shapes: Vec<Shape> = input.shapes().iter().filter_map(shape).collect();
    shapes.sort();
    shapes
}

fn tracks(motion: &Motion<'_>) -> Vec<Vec<Option<Point3<f64>>>> {
    (0..motion.tracks)
        .map(|k| motion.points(k).map(|p| p.map(Point3::from)).collect())
        .collect()
}

fn poses(motion: &Motion<'_>, track: usize) -> Vec<Option<Pose>> {
    let pose = |p: calib_plugin::BodyPose| Pose {
        rotation: Matrix3::from_fn(|i, j| p.rotation[i][j]),
        translation: Vector3::from(p.translation_m),
    };
    motion.poses(track).map(|p| p.map(pose)).collect()
}

/// An entry with the options that a profile can set, as parameters of the offer.
fn offer<E: Estimate>(kind: Kind, info: &EstimatorInfo<E>) -> Offer {
    let offer = Offer::new(kind, info.id, info.summary)
        .from_source(info.source)
        .takes(&shapes(info.input));
    let options = info.options.iter();
    let described = options.filter_map(|o| parameter::parameter(*o));
    described.fold(offer, |offer, p| {
        offer.with(calib_plugin::Parameter {
            name: p.name,
            summary: p.summary,
            value: match p.value {
                parameter::Value::Bool(v) => Value::Bool(v),
                parameter::Value::Integer(v) => Value::Integer(v),
                parameter::Value::Number(v) => Value::Number(v),
                parameter::Value::Text(v) => Value::Text(v),
            },
            limits: p.limits,
            choices: p.choices,
            required: p.required,
        })
    })
}

/// Sets the options that the profile gives as parameters.
fn set_parameters(
    options: &mut calib_estimator::Options,
    used: &[OptionId],
    call: &Call<'_>,
) -> Result<(), Failure> {
    for option in used {
        let Some(p) = parameter::parameter(*option) else {
            continue;
        };
        let value = match &p.value {
            parameter::Value::Bool(_) => parameter::Value::Bool(call.flag(&p.name)?),
            parameter::Value::Integer(_) => parameter::Value::Integer(call.integer(&p.name)?),
            parameter::Value::Number(_) => parameter::Value::Number(call.number(&p.name)?),
            parameter::Value::Text(_) => parameter::Value::Text(call.text(&p.name)?.to_owned()),
        };
        // An option at its default stays as the recording states it.
        if value != p.value {
            parameter::set(options, *option, &value);
        }
    }
    Ok(())
}

fn why_not<E: Estimate>(outcome: &Outcome<E>) -> String {
    let (verdict, reason) = (outcome.verdict(), outcome.reason());
    format!("{verdict}: {}", reason.unwrap_or(""))
}

/// Why an estimate is weak.
fn doubt<E: Estimate>(outcome: &Outcome<E>) -> Option<String> {
    let reason = outcome.reason().unwrap_or("");
    (!outcome.is_observable()).then(|| reason.to_owned())
}

/// A matrix by rows, as it crosses the border.
fn rows<const N: usize>(matrix: &SMatrix<f64, N, N>) -> [[f64; N]; N] {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)]))
}

fn built_in_cor(info: &'static calib_cor::EstimatorInfo) -> Entry<dyn calib_plugin::Cor> {
    let offer = offer(Kind::Cor, info);
    Entry::built_in_cor(ByFn::new(
        offer,
        move |motion: &Motion<'_>, call: &Call<'_>| {
            let mut options = calib_cor::Options {
                sigma_t: motion.sigma_t_m,
                sigma_r: motion.sigma_r_rad,
                significance: motion.significance,
                seed: motion.seed,
                ..calib_cor::Options::default()
            };
            set_parameters(&mut options, info.options, call)?;
            let (tracks, first, second) = (tracks(motion), poses(motion, 0), poses(motion, 1));
            let input = match motion.shape {
                Shape::Points => calib_cor::Input::Points(&tracks),
                Shape::Markers => calib_cor::Input::Markers(&tracks),
                Shape::Poses => calib_cor::Input::Poses(&first),
                Shape::TwoBodies => calib_cor::Input::TwoBodies {
                    parent: &first,
                    child: &second,
                },
            };
            let outcome = info
                .run(&input, &options.only(info.options))
                .map_err(|e| Failure::BadInput(e.to_string()))?;
            let Some(e) = outcome.estimate() else {
                return Ok(Answer::NotObservable(why_not(&outcome)));
            };
            let (radii_m, body_points_m) = match &e.shape {
                CorShape::Radii { radii, .. } => (radii.clone(), Vec::new()),
                CorShape::BodyPoint { body_point, .. } => {
                    (Vec::new(), vec![body_point.coords.into()])
                }
                CorShape::BodyPoints {
                    in_first,
                    in_second,
                    ..
                } => (
                    Vec::new(),
                    vec![in_first.coords.into(), in_second.coords.into()],
                ),
                _ => (Vec::new(), Vec::new()),
            };
            Ok(Answer::Found(CorFit {
                center_m: e.center.coords.into(),
                covariance_m2: Some(rows(&e.covariance)),
                body_points_m,
                radii_m,
                rms_m: e.rms,
                used: e.used,
                rejected: e.rejected.iter().map(|r| [r.marker, r.row]).collect(),
                weak: doubt(&outcome),
            }))
        },
    ))
}

fn built_in_aor(info: &'static calib_aor::EstimatorInfo) -> Entry<dyn calib_plugin::Aor> {
    let offer = offer(Kind::Aor, info);
    Entry::built_in_aor(ByFn::new(
        offer,
        move |motion: &Motion<'_>, call: &Call<'_>| {
            let mut options = calib_aor::Options {
                sigma_t: motion.sigma_t_m,
                sigma_r: motion.sigma_r_rad,
                center: motion.center_m.map(Point3::from),
                angles: motion.angles_rad.map_or_else(Vec::new, <[f64]>::to_vec),
                significance: motion.significance,
                ..calib_aor::Options::default()
            };
            set_parameters(&mut options, info.options, call)?;
            let (tracks, parent, child) = (tracks(motion), poses(motion, 0), poses(motion, 1));
            let input = match motion.shape {
                Shape::Points => calib_aor::Input::Points(&tracks),
                Shape::Markers => calib_aor::Input::Markers(&tracks),
                Shape::Poses => calib_aor::Input::Poses(&parent),
                Shape::TwoBodies => calib_aor::Input::TwoBodies {
                    parent: &parent,
                    child: &child,
                },
            };
            let outcome = info
                .run(&input, &options.only(info.options))
                .map_err(|e| Failure::BadInput(e.to_string()))?;
            let Some(e) = outcome.estimate() else {
                return Ok(Answer::NotObservable(why_not(&outcome)));
            };
            let line = |l: &calib_geometry::Line| AxisLine {
                point_m: l.point.coords.into(),
                direction: l.direction.into_inner().into(),
            };
            Ok(Answer::Found(AorFit {
                line: line(&e.line),
                covariance: Some(rows(&e.covariance)),
                in_child: e.in_child.as_ref().map(line),
                rms_m: e.rms,
                used: e.used,
                rejected: e.rejected.iter().map(|row| [0, *row]).collect(),
                weak: doubt(&outcome),
            }))
        },
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_of_built_in_estimators_are_honored_and_unknown_ones_refused() {
        let estimators = Estimators::built_in().unwrap();
        // A patch of a sphere of radius 1 with a millimeter of scatter.
        let track: Vec<_> = (0..40)
            .map(f64::from)
            .map(|i| {
                let (a, b) = (0.9 * (1.7 * i).sin(), 0.9 * (2.3 * i).cos());
                let r = 1.0 + 1e-3 * (12.9898 * i * i).sin();
                Some([r * a.sin() * b.cos(), r * b.sin(), r * a.cos() * b.cos()])
            })
            .collect();
        let motion = MotionData::points(&[track]);
        let with = |name: &str, value: Value| {
            let given: BTreeMap<String, Value> = [(name.to_owned(), value)].into();
            estimators.center("sfe", &given, &motion)
        };
        let plain = estimators.center("sfe", &BTreeMap::new(), &motion);
        assert!(plain.unwrap().is_ok());
        let strict = with("weak_fraction", Value::Number(1e-8)).unwrap();
        assert!(strict.is_err(), "{strict:?}");
        let unknown = with("weak_fractoin", Value::Number(0.1)).unwrap_err();
        assert!(
            unknown
                .to_string()
                .contains("did you mean `weak_fraction`?"),
            "{unknown}"
        );
        // `sfe` draws nothing at random.
        assert!(with("seed", Value::Integer(3)).is_err());
    }
}
