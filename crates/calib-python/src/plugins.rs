//! Estimators and readers written in Python, as entries of a run's tables.
//!
//! An object of `calib.plugins` has what is offered and a function `call` on plain values: it gets a dictionary and returns one, or a text for
//! "not observable". What an exception says is the failure's text.

use calib_pipeline::prepare::readers::streams;
use calib_plugin::{
    Answer, Aor, AorFit, AxisLine, Call, Cor, CorFit, Entry, Failure, Kind, Motion, Offer, Origin,
    OwnEntries, Parameter, Reader, Shape, Source, Streams, Value,
};
use pyo3::conversion::FromPyObjectOwned;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};

use crate::arrays::array;
use crate::error::misused;
use crate::table::{as_recording, poses};

/// A function with its description.
struct InPython {
    offer: Offer,
    call: Py<PyAny>,
    recognizes: Option<Py<PyAny>>,
}

/// The entries of objects of `calib.plugins`.
pub(crate) fn own_entries(py: Python<'_>, objects: Vec<Py<PyAny>>) -> PyResult<OwnEntries> {
    let mut own = OwnEntries::default();
    for object in objects {
        let object = object.bind(py);
        let kind = match object.getattr("kind")?.extract::<String>()?.as_str() {
            "center" => Kind::Cor,
            "axis" => Kind::Aor,
            "reader" => Kind::Reader,
            other => {
                let text = format!("kind: found {other}; expected center, axis or reader");
                return Err(misused(py, &text));
            }
        };
        let origin = Origin::Plugin {
            plugin: object.getattr("plugin")?.extract()?,
            version: object.getattr("version")?.extract()?,
            path: None,
            sha256: None,
        };
        let recognizes = object.getattr("recognizes")?;
        let it = InPython {
            offer: offer(kind, object)?,
            call: object.getattr("call")?.unbind(),
            recognizes: (!recognizes.is_none()).then(|| recognizes.unbind()),
        };
        match kind {
            Kind::Cor => own.cor.push(Entry::cor(it, origin)),
            Kind::Aor => own.aor.push(Entry::aor(it, origin)),
            _ => own.reader.push(Entry::reader(it, origin)),
        }
    }
    Ok(own)
}

fn offer(kind: Kind, object: &Bound<'_, PyAny>) -> PyResult<Offer> {
    let py = object.py();
    let text = |key: &str| object.getattr(key)?.extract::<String>();
    let mut shapes = Vec::new();
    for word in object.getattr("shapes")?.extract::<Vec<String>>()? {
        let shape = Shape::ALL.into_iter().find(|s| s.word() == word);
        shapes.push(shape.ok_or_else(|| {
            let words = Shape::ALL.map(Shape::word).join(", ");
            misused(py, &format!("shapes: found {word}; expected {words}"))
        })?);
    }
    let mut offer = Offer::new(kind, &text("name")?, &text("summary")?)
        .from_source(&text("source")?)
        .takes(&shapes);
    for (name, default) in object.getattr("parameters")?.cast::<PyDict>()? {
        let name: String = name.extract()?;
        offer = offer.with(Parameter::new(&name, value(&name, &default)?, ""));
    }
    Ok(offer)
}

/// The value of a parameter: its type is that of the default.
fn value(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Value> {
    // In this order: a bool of Python is a number of Python.
    if let Ok(value) = given.extract::<bool>() {
        return Ok(Value::Bool(value));
    }
    if let Ok(value) = given.extract::<i64>() {
        return Ok(Value::Integer(value));
    }
    if let Ok(value) = given.extract::<f64>() {
        return Ok(Value::Number(value));
    }
    if let Ok(value) = given.extract::<String>() {
        return Ok(Value::Text(value));
    }
    let text = format!("parameter {name}: expected true or false, a number or a text");
    Err(misused(given.py(), &text))
}

/// The values of a call by their names.
fn parameters<'py>(
    py: Python<'py>,
    offer: &Offer,
    call: &Call<'_>,
) -> PyResult<Bound<'py, PyDict>> {
    let given = PyDict::new(py);
    for (parameter, value) in offer.parameters.iter().zip(call.values()) {
        match value {
            Value::Bool(v) => given.set_item(&parameter.name, v)?,
            Value::Integer(v) => given.set_item(&parameter.name, v)?,
            Value::Number(v) => given.set_item(&parameter.name, v)?,
            Value::Text(v) => given.set_item(&parameter.name, v)?,
        }
    }
    Ok(given)
}

/// What an exception says; a `ValueError` is data that are not what the function takes.
fn failure(py: Python<'_>, error: &PyErr) -> Failure {
    if error.is_instance_of::<PyValueError>(py) {
        return Failure::BadInput(error.value(py).to_string());
    }
    let kind = error.get_type(py).name();
    let kind = kind.map_or_else(|_| "an exception".to_owned(), |name| name.to_string());
    Failure::Failed(format!("{kind}: {}", error.value(py)))
}

/// A motion as a dictionary: lost samples are NaN.
fn motion_dict<'py>(py: Python<'py>, motion: &Motion<'_>) -> PyResult<Bound<'py, PyDict>> {
    let (k, n) = (motion.tracks, motion.samples);
    let numbers = |values: Vec<&[f64]>| -> Vec<f64> {
        let rows = motion.seen.iter().zip(values);
        let row = |(seen, row): (&u8, &[f64])| -> Vec<f64> {
            let lost = |x: &f64| if *seen != 0 { *x } else { f64::NAN };
            row.iter().map(lost).collect()
        };
        rows.flat_map(row).collect()
    };
    let dict = PyDict::new(py);
    dict.set_item("shape", motion.shape.word())?;
    if motion.shape.is_poses() {
        let rotations = motion.rotations.iter().map(|r| r.as_flattened()).collect();
        let translations = motion.translations_m.iter().map(<[f64; 3]>::as_slice);
        let rotations = array(py, numbers(rotations), [k, n, 3, 3])?;
        let translations = array(py, numbers(translations.collect()), [k, n, 3])?;
        dict.set_item("rotations", rotations)?;
        dict.set_item("translations_m", translations)?;
    } else {
        let points = motion.points_m.iter().map(<[f64; 3]>::as_slice).collect();
        dict.set_item("points_m", array(py, numbers(points), [k, n, 3])?)?;
    }
    if let Some(c) = motion.covariances_m2 {
        let entries = c.iter().flat_map(|c| c.as_flattened().to_vec()).collect();
        dict.set_item("covariances_m2", array(py, entries, [k, n, 3, 3])?)?;
    }
    if let Some(angles) = motion.angles_rad {
        dict.set_item("angles_rad", array(py, angles.to_vec(), [angles.len()])?)?;
    }
    dict.set_item("center_m", motion.center_m)?;
    dict.set_item("towards", motion.towards)?;
    dict.set_item("sigma_t_m", motion.sigma_t_m)?;
    dict.set_item("sigma_r_rad", motion.sigma_r_rad)?;
    dict.set_item("significance", motion.significance)?;
    dict.set_item("seed", motion.seed)?;
    Ok(dict)
}

impl InPython {
    /// What the function returns for a motion: a dictionary, or why there is no answer.
    fn answer<T>(
        &self,
        motion: &Motion<'_>,
        call: &Call<'_>,
        fit: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>,
    ) -> Result<Answer<T>, Failure> {
        Python::attach(|py| {
            let asked = || -> PyResult<Answer<T>> {
                let given = parameters(py, &self.offer, call)?;
                let motion = motion_dict(py, motion)?;
                let answer = self.call.bind(py).call1((motion, given))?;
                Ok(match answer.cast::<PyString>() {
                    Ok(why) => Answer::NotObservable(why.to_string()),
                    Err(_) => Answer::Found(fit(&answer)?),
                })
            };
            asked().map_err(|error| failure(py, &error))
        })
    }
}

/// An entry of an answer.
fn entry<'py, T: FromPyObjectOwned<'py>>(answer: &Bound<'py, PyAny>, key: &str) -> PyResult<T> {
    answer.get_item(key)?.extract().map_err(Into::into)
}

impl Cor for InPython {
    fn offer(&self) -> Offer {
        self.offer.clone()
    }

    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
        self.answer(motion, call, |a| {
            Ok(CorFit {
                center_m: entry(a, "center_m")?,
                covariance_m2: entry(a, "covariance_m2")?,
                body_points_m: entry(a, "body_points_m")?,
                radii_m: entry(a, "radii_m")?,
                rms_m: entry(a, "rms_m")?,
                used: entry(a, "used")?,
                rejected: entry(a, "rejected")?,
                weak: entry(a, "weak")?,
            })
        })
    }
}

impl Aor for InPython {
    fn offer(&self) -> Offer {
        self.offer.clone()
    }

    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<AorFit>, Failure> {
        self.answer(motion, call, |a| {
            Ok(AorFit {
                line: AxisLine {
                    point_m: entry(a, "point_m")?,
                    direction: entry(a, "direction")?,
                },
                covariance: entry(a, "covariance")?,
                in_child: None,
                rms_m: entry(a, "rms_m")?,
                used: entry(a, "used")?,
                rejected: entry(a, "rejected")?,
                weak: entry(a, "weak")?,
            })
        })
    }
}

impl Reader for InPython {
    fn offer(&self) -> Offer {
        self.offer.clone()
    }

    fn recognizes(&self, head: &[u8]) -> bool {
        let Some(recognizes) = &self.recognizes else {
            return false;
        };
        Python::attach(|py| {
            let answer = recognizes.bind(py).call1((PyBytes::new(py, head),));
            answer.and_then(|a| a.is_truthy()).unwrap_or(false)
        })
    }

    fn read(&self, source: &Source<'_>, call: &Call<'_>) -> Result<Streams, Failure> {
        Python::attach(|py| {
            let asked = || -> PyResult<Streams> {
                let given = parameters(py, &self.offer, call)?;
                let bytes = PyBytes::new(py, source.bytes);
                let table = self.call.bind(py).call1((source.name, bytes, given))?;
                let read = poses(table.cast::<PyDict>()?)?;
                let mut streams = streams(&as_recording(read, source.name, &self.offer.name));
                streams.notes = entry(&table, "notes")?;
                Ok(streams)
            };
            asked().map_err(|error| failure(py, &error))
        })
    }
}
