//! Estimators of plugins, tried on the scenes of a study beside the built-in ones.
//!
//! Each gets the first of the shapes that it takes and the scene has, with no noise stated. A call that fails counts as a trial
//! without an answer.

use std::sync::Arc;

use calib_geometry::Line;
use calib_plugin::{
    Answer, Aor, AxisLine, BodyPose, Bound, Control, Cor, Entry, MotionData, Origin, PluginError,
    Registry, Shape, Tables, typed,
};
use nalgebra::{Matrix3, Point3, Unit, Vector3};

use crate::{
    cell::Quantity,
    tally::{Row, Tally},
};

/// Estimators of plugins with their parameters.
#[derive(Clone, Default)]
pub struct Tried {
    cor: Vec<Tool<dyn Cor>>,
    aor: Vec<Tool<dyn Aor>>,
}

/// One estimator.
pub(crate) struct Tool<T: ?Sized> {
    bound: Arc<Bound<T>>,
    name: String,
}

impl<T: ?Sized> Clone for Tool<T> {
    fn clone(&self) -> Self {
        Self {
            bound: self.bound.clone(),
            name: self.name.clone(),
        }
    }
}

impl Tried {
    /// All estimators that loaded plugins offer, with these parameters as they were written; one that has no parameter of a name is given
    /// none.
    ///
    /// # Errors
    /// [`PluginError::Parameter`] for values that the estimator does not take.
    pub fn of(tables: &Tables, parameters: &[(String, String)]) -> Result<Self, PluginError> {
        Ok(Self {
            cor: tools(&tables.cor, parameters)?,
            aor: tools(&tables.aor, parameters)?,
        })
    }

    /// Names, plugins and their sums, in the order of the rows.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let cor = self.cor.iter().map(|t| said(t.bound.entry()));
        cor.chain(self.aor.iter().map(|t| said(t.bound.entry())))
            .collect()
    }

    pub(crate) fn centers(&self) -> &[Tool<dyn Cor>] {
        &self.cor
    }

    pub(crate) fn axes(&self) -> &[Tool<dyn Aor>] {
        &self.aor
    }
}

fn tools<T: ?Sized>(
    registry: &Registry<T>,
    parameters: &[(String, String)],
) -> Result<Vec<Tool<T>>, PluginError> {
    let of = |entry: &Entry<T>| {
        let known = &entry.offer().parameters;
        let own = parameters
            .iter()
            .filter(|(n, _)| known.iter().any(|p| p.name == *n));
        let own: Vec<_> = own.cloned().collect();
        Ok(Tool {
            bound: Arc::new(entry.with(&typed(known, &own))?),
            name: entry.offer().name.clone(),
        })
    };
    registry.iter().map(of).collect()
}

fn said<T: ?Sized>(entry: &Entry<T>) -> String {
    let sum = match entry.origin() {
        Origin::Plugin {
            sha256: Some(sum), ..
        } => format!(", SHA-256 {sum}"),
        _ => String::new(),
    };
    format!("`{}` {}{sum}", entry.offer().name, entry.origin())
}

impl<T: ?Sized> Tool<T> {
    /// A row of its own; `bound`: that of what it is given.
    pub fn row(&self, quantity: Quantity, bound: Option<f64>, control: Option<f64>) -> Row {
        Row {
            method: format!("{}, plugin", self.name),
            estimator: self.name.clone(),
            from_plugin: true,
            quantity,
            bound,
            control,
        }
    }

    /// The first of these shapes that it takes.
    pub fn takes(&self, shapes: &[Shape]) -> Option<Shape> {
        let own = &self.bound.entry().offer().shapes;
        shapes.iter().copied().find(|shape| own.contains(shape))
    }
}

/// What an estimator is given, of the shape that it takes.
pub(crate) fn motion(
    shape: Shape,
    tracks: &[Vec<Option<Point3<f64>>>],
    poses: &[Option<(Matrix3<f64>, Vector3<f64>)>],
) -> MotionData {
    let point = |p: &Option<Point3<f64>>| p.map(|p| p.coords.into());
    let points = || -> Vec<Vec<Option<[f64; 3]>>> {
        let tracks = tracks.iter();
        tracks.map(|t| t.iter().map(point).collect()).collect()
    };
    match shape {
        Shape::Poses => {
            let pose = |p: &Option<(Matrix3<f64>, Vector3<f64>)>| {
                p.map(|(r, t)| BodyPose {
                    rotation: std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)])),
                    translation_m: t.into(),
                })
            };
            MotionData::poses(&poses.iter().map(pose).collect::<Vec<_>>())
        }
        Shape::Markers => MotionData::markers(&points()),
        _ => MotionData::points(&points()),
    }
}

impl Tool<dyn Cor> {
    /// One trial: the error of the center.
    pub fn record(
        &self,
        motion: &MotionData,
        (truth, linear): (Vector3<f64>, Option<Vector3<f64>>),
        tally: &mut Tally,
    ) {
        match self.bound.fit(&motion.view(), &Control::default()) {
            Ok(Answer::Found(fit)) => {
                let trace = fit.covariance_m2.map(|c| c[0][0] + c[1][1] + c[2][2]);
                let error = Vector3::from(fit.center_m) - truth;
                tally.error(fit.weak.is_none(), error, trace.unwrap_or(f64::NAN), linear);
            }
            _ => tally.verdict(false, false),
        }
    }
}

impl Tool<dyn Aor> {
    /// One trial: the axis, whether it is determined well, and the trace of the covariance of its direction, NaN where none is stated.
    pub fn axis(&self, motion: &MotionData) -> Option<(Line, (bool, f64))> {
        let Ok(Answer::Found(fit)) = self.bound.fit(&motion.view(), &Control::default()) else {
            return None;
        };
        let AxisLine { point_m, direction } = fit.line;
        let line = Line {
            point: Point3::from(point_m),
            direction: Unit::new_normalize(direction.into()),
        };
        let trace = fit.covariance.map(|c| c[0][0] + c[1][1] + c[2][2]);
        Some((line, (fit.weak.is_none(), trace.unwrap_or(f64::NAN))))
    }
}
