//! A calibrated robot over arrays of postures.

use calib_export::Robot;
use calib_model::{Aim, Approach, ModelError, Options, Outcome, Place, Pose, Scope, Under};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::{array, slice};
use crate::error::{misused, raised, refused};

type Array<'py> = PyReadonlyArrayDyn<'py, f64>;

/// Directions of approach, held torques and temperatures, where they are given.
type Given<'py> = (Option<Array<'py>>, Option<Array<'py>>, Option<Array<'py>>);

/// Nothing beside the readings.
const NOTHING: Given<'static> = (None, None, None);

/// A calibrated robot, read once.
#[pyclass(frozen, module = "calib._native")]
pub(crate) struct Model {
    model: calib_model::Model,
}

/// Postures with what their readings do not say.
struct Postures<'a> {
    q: &'a [f64],
    approach: Option<&'a [f64]>,
    held: Option<&'a [f64]>,
    temperature_c: Option<&'a [f64]>,
    dof: usize,
}

/// A row that was refused.
struct Refused(usize, ModelError);

impl Refused {
    fn raise(self, py: Python<'_>) -> PyErr {
        refused(py, &format!("row {}: {}", self.0, self.1), "model", 2)
    }
}

impl<'a> Postures<'a> {
    /// Every array has one number for each joint and posture.
    fn of(
        py: Python<'_>,
        model: &calib_model::Model,
        q: &'a Array<'_>,
        (approach, held, temperature_c): &'a Given<'_>,
    ) -> PyResult<Self> {
        let dof = model.joints().len();
        let q = slice(py, "q", q)?;
        let of = |what: &'static str, given: Option<&'a Array<'_>>| -> PyResult<_> {
            let Some(given) = given else { return Ok(None) };
            let given = slice(py, what, given)?;
            match given.len() == q.len() {
                true => Ok(Some(given)),
                false => Err(lengths(py, what, given.len(), q.len())),
            }
        };
        if dof == 0 || q.len() % dof != 0 {
            return Err(lengths(py, "q", q.len(), dof));
        }
        Ok(Self {
            q,
            approach: of("approach", approach.as_ref())?,
            held: of("held", held.as_ref())?,
            temperature_c: of("temperature_c", temperature_c.as_ref())?,
            dof,
        })
    }

    fn len(&self) -> usize {
        self.q.len() / self.dof
    }

    /// `width` numbers for each posture.
    fn each(
        &self,
        width: usize,
        mut of: impl FnMut(&[f64], &Under<'_>, &mut [f64]) -> Result<(), ModelError>,
    ) -> Result<Vec<f64>, Refused> {
        let mut out = vec![0.0; self.len() * width];
        let rows = self.q.chunks_exact(self.dof);
        for (row, (q, out)) in rows.zip(out.chunks_exact_mut(width)).enumerate() {
            let of_row = |all: &'a [f64]| &all[row * self.dof..(row + 1) * self.dof];
            let under = Under {
                approach: self.approach.map_or(&[], of_row),
                held: self.held.map(of_row),
                temperature_c: self.temperature_c.map_or(&[], of_row),
            };
            of(q, &under, out).map_err(|error| Refused(row, error))?;
        }
        Ok(out)
    }
}

fn lengths(py: Python<'_>, what: &'static str, found: usize, expected: usize) -> PyErr {
    let error = ModelError::Length {
        what,
        found,
        expected,
    };
    refused(py, &error.to_string(), "model", 2)
}

/// The upper rows of a homogeneous matrix, and its last one.
fn homogeneous(pose: &Pose, out: &mut [f64]) {
    out[..12].copy_from_slice(&pose.rows());
    out[12..].copy_from_slice(&[0.0, 0.0, 0.0, 1.0]);
}

#[pymethods]
impl Model {
    /// Reads a model file.
    #[staticmethod]
    fn load(py: Python<'_>, path: std::path::PathBuf) -> PyResult<Self> {
        let read = py.detach(|| calib_export::robot(&path));
        let Robot { model, .. } = read.map_err(|e| raised(py, e))?;
        Ok(Self { model })
    }

    /// The same from the bytes of a model file.
    #[staticmethod]
    fn from_json(py: Python<'_>, bytes: &Bound<'_, PyBytes>) -> PyResult<Self> {
        let read = calib_model::Model::from_json(bytes.as_bytes());
        let model = read.map_err(|e| refused(py, &e.to_string(), "model", 2))?;
        Ok(Self { model })
    }

    /// Names, joints and links.
    fn facts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let m = &self.model;
        let facts = PyDict::new(py);
        facts.set_item("name", m.name())?;
        facts.set_item("links", m.links().to_vec())?;
        facts.set_item("bodies", m.bodies().collect::<Vec<_>>())?;
        facts.set_item("points", m.points().collect::<Vec<_>>())?;
        facts.set_item("tool", &m.links()[m.last_link().index()])?;
        facts.set_item("has_uncertainty", m.has_uncertainty())?;
        let reference = m.grows().then(|| m.reference_temperature_c());
        facts.set_item("reference_temperature_c", reference)?;
        let joints: Vec<_> = m.joints().iter().collect();
        let joints: Vec<_> = joints
            .into_iter()
            .map(|j| (&j.name, j.prismatic, j.limits, j.fitted_range))
            .collect();
        facts.set_item("joints", joints)?;
        let mut tracker = vec![0.0; 16];
        homogeneous(m.tracker_from_root(), &mut tracker);
        facts.set_item("tracker_from_root", array(py, tracker, [4, 4])?)?;
        Ok(facts)
    }

    /// n × 4 × 4; `how`: in the tracker's frame, of the nominal model.
    fn fk<'py>(
        &self,
        py: Python<'py>,
        q: Array<'py>,
        of: Option<&str>,
        how: (bool, bool),
        under: Given<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let asked = Postures::of(py, &self.model, &q, &under)?;
        let place = self.place(py, of)?;
        let (m, (in_tracker, nominal)) = (&self.model, how);
        let done = py.detach(|| {
            let mut work = m.work();
            asked.each(16, |q, under, out| {
                match nominal {
                    true => m.forward_nominal(q, &mut work)?,
                    false => m.forward(q, under, &mut work)?,
                }
                let pose = match in_tracker {
                    true => m.tracker_from(place, &work)?,
                    false => m.root_from(place, &work)?,
                };
                homogeneous(&pose, out);
                Ok(())
            })
        });
        array(py, done.map_err(|e| e.raise(py))?, [asked.len(), 4, 4])
    }

    /// n × 6 × dof.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        q: Array<'py>,
        link: Option<&str>,
        under: Given<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let asked = Postures::of(py, &self.model, &q, &under)?;
        let link = self.link(py, link)?;
        let (m, dof) = (&self.model, asked.dof);
        let done = py.detach(|| {
            let (mut work, mut columns) = (m.work(), vec![0.0; 6 * dof]);
            asked.each(6 * dof, |q, under, out| {
                m.jacobian(q, link, under, &mut work, &mut columns)?;
                for (k, column) in columns.chunks_exact(6).enumerate() {
                    for (i, x) in column.iter().enumerate() {
                        out[i * dof + k] = *x;
                    }
                }
                Ok(())
            })
        });
        array(py, done.map_err(|e| e.raise(py))?, [asked.len(), 6, dof])
    }

    /// n × 6 × 6.
    fn sigma<'py>(
        &self,
        py: Python<'py>,
        q: Array<'py>,
        of: Option<&str>,
        in_tracker: bool,
        under: Given<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let asked = Postures::of(py, &self.model, &q, &under)?;
        let place = self.place(py, of)?;
        let m = &self.model;
        let done = py.detach(|| {
            let mut work = m.work();
            asked.each(36, |q, under, out| {
                let covariance = match in_tracker {
                    true => m.sigma_in_tracker(q, place, under, &mut work)?,
                    false => m.sigma(q, place, under, &mut work)?,
                };
                // It is symmetric: columns are rows.
                out.copy_from_slice(covariance.as_slice());
                Ok(())
            })
        });
        array(py, done.map_err(|e| e.raise(py))?, [asked.len(), 6, 6])
    }

    /// n × (dof + 8): commands, then what they do; see `REPORTED`.
    fn correct<'py>(
        &self,
        py: Python<'py>,
        q: Array<'py>,
        link: Option<&str>,
        options: &Bound<'py, PyDict>,
        under: Given<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let asked = Postures::of(py, &self.model, &q, &under)?;
        let link = self.link(py, link)?;
        let options = with(Options::default(), options)?;
        let (m, dof) = (&self.model, asked.dof);
        let done = py.detach(|| {
            let mut work = m.work();
            asked.each(dof + REPORTED, |q, under, out| {
                let (command, report) = out.split_at_mut(dof);
                let done = m.correct(q, link, &options, under, &mut work, command)?;
                written(&done, report);
                Ok(())
            })
        });
        let shape = [asked.len(), dof + REPORTED];
        array(py, done.map_err(|e| e.raise(py))?, shape)
    }

    /// As [`Model::correct`], to n × 4 × 4 poses from n × dof seeds.
    fn ik<'py>(
        &self,
        py: Python<'py>,
        poses: Array<'py>,
        seed: Array<'py>,
        link: Option<&str>,
        options: &Bound<'py, PyDict>,
        under: Given<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let asked = Postures::of(py, &self.model, &seed, &under)?;
        let wanted = slice(py, "poses", &poses)?;
        if wanted.len() != 16 * asked.len() {
            return Err(lengths(py, "poses", wanted.len(), 16 * asked.len()));
        }
        let link = self.link(py, link)?;
        let options = with(Options::inverse(), options)?;
        let (m, dof) = (&self.model, asked.dof);
        let done = py.detach(|| {
            let mut work = m.work();
            let mut wanted = wanted.chunks_exact(16);
            asked.each(dof + REPORTED, |seed, under, out| {
                let (command, report) = out.split_at_mut(dof);
                let mut rows = [0.0; 12];
                rows.copy_from_slice(&wanted.next().unwrap_or(&[0.0; 16])[..12]);
                let pose = Pose::from_rows(&rows);
                let done = m.ik(&pose, seed, link, &options, under, (&mut work, command))?;
                written(&done, report);
                Ok(())
            })
        });
        let shape = [asked.len(), dof + REPORTED];
        array(py, done.map_err(|e| e.raise(py))?, shape)
    }

    /// n × 2: 0 inside, 1 outside of the fitted range, 2 beyond limits; and the joint, −1 where none.
    fn scope<'py>(&self, py: Python<'py>, q: Array<'py>) -> PyResult<Bound<'py, PyAny>> {
        let asked = Postures::of(py, &self.model, &q, &NOTHING)?;
        let done = py.detach(|| {
            asked.each(2, |q, _, out| {
                let found = match self.model.scope(q)? {
                    Scope::Inside => [0.0, -1.0],
                    Scope::Outside(joint) => [1.0, joint as f64],
                    Scope::BeyondLimits(joint) => [2.0, joint as f64],
                };
                out.copy_from_slice(&found);
                Ok(())
            })
        });
        array(py, done.map_err(|e| e.raise(py))?, [asked.len(), 2])
    }

    /// n × dof directions of approach along a sequence of postures.
    fn approach<'py>(
        &self,
        py: Python<'py>,
        q: Array<'py>,
        threshold: Option<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let asked = Postures::of(py, &self.model, &q, &NOTHING)?;
        let mut approach = Approach::new(&self.model);
        if let Some(threshold) = threshold {
            approach = approach.with_threshold(threshold);
        }
        let done = asked.each(asked.dof, |q, _, out| {
            approach.update(&self.model, q)?;
            out.copy_from_slice(approach.directions());
            Ok(())
        });
        let shape = [asked.len(), asked.dof];
        array(py, done.map_err(|e| e.raise(py))?, shape)
    }
}

impl Model {
    fn link(&self, py: Python<'_>, name: Option<&str>) -> PyResult<calib_model::LinkId> {
        let Some(name) = name else {
            return Ok(self.model.last_link());
        };
        let found = self.model.link(name);
        found.map_err(|e| refused(py, &e.to_string(), "model", 2))
    }

    /// The place that is named, or the last link.
    fn place(&self, py: Python<'_>, name: Option<&str>) -> PyResult<Place> {
        let Some(name) = name else {
            return Ok(self.model.last_link().into());
        };
        self.model.place(name).ok_or_else(|| {
            let links = self.model.links().iter().map(String::as_str);
            let names = links.chain(self.model.bodies()).chain(self.model.points());
            let error = ModelError::Name {
                kind: "link, body or point",
                name: name.to_owned(),
                known: names.collect::<Vec<_>>().join(", "),
            };
            refused(py, &error.to_string(), "model", 2)
        })
    }
}

/// Columns after the command: outcome, its joint, iterations, before and after (m, rad), largest step.
const REPORTED: usize = 8;

fn written(done: &calib_model::Correction, out: &mut [f64]) {
    let (outcome, joint) = match done.outcome {
        Outcome::Reached => (0.0, -1.0),
        Outcome::OutOfScope(joint) => (1.0, joint as f64),
        Outcome::Nearer => (2.0, -1.0),
        Outcome::BeyondLimits(joint) => (4.0, joint as f64),
        _ => (3.0, -1.0),
    };
    out.copy_from_slice(&[
        outcome,
        joint,
        done.iterations as f64,
        done.before_m,
        done.after_m,
        done.before_rad,
        done.after_rad,
        done.step,
    ]);
}

/// Options with those that were given.
fn with(mut options: Options, given: &Bound<'_, PyDict>) -> PyResult<Options> {
    for (key, value) in given {
        let key: String = key.extract()?;
        match key.as_str() {
            "aim" => {
                options.aim = match value.extract::<String>()?.as_str() {
                    "pose" => Aim::Pose,
                    "position" => Aim::Position,
                    other => {
                        let text = format!("aim: found {other}; expected pose or position");
                        return Err(misused(value.py(), &text));
                    }
                }
            }
            "largest_rad" => options.largest_rad = value.extract()?,
            "largest_m" => options.largest_m = value.extract()?,
            "tolerance_m" => options.tolerance_m = value.extract()?,
            "lever_m" => options.lever_m = value.extract()?,
            "iterations" => options.iterations = value.extract()?,
            other => return Err(misused(value.py(), &format!("there is no option {other}"))),
        }
    }
    Ok(options)
}
