//! `calib.fit_*`: one estimator on arrays, by the road of `calib fit`.

use calib_cli::CliError;
use calib_fit::{FrameRequest, HandEyeRequest, Held, TableRequest};
use pyo3::conversion::FromPyObjectOwned;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::background::waited;
use crate::error::misused;
use crate::table::poses;

/// Options of one call, each asked for once.
struct Given<'a, 'py>(&'a Bound<'py, PyDict>);

impl<'py> Given<'_, 'py> {
    /// The value of a key; the default where it is absent or `None`.
    fn get<T: Default + FromPyObjectOwned<'py>>(&self, key: &str) -> PyResult<T> {
        Ok(self.some(key)?.unwrap_or_default())
    }

    /// The value of a key, where it is given.
    fn some<T: FromPyObjectOwned<'py>>(&self, key: &str) -> PyResult<Option<T>> {
        let value = self.0.get_item(key)?.filter(|v| !v.is_none());
        value.map(|v| v.extract().map_err(Into::into)).transpose()
    }
}

/// What `calib fit KIND --json` prints for these arrays.
#[pyfunction]
pub(crate) fn fit<'py>(
    py: Python<'py>,
    kind: &str,
    table: &Bound<'py, PyDict>,
    options: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyBytes>> {
    let given = Given(options);
    let held = Held {
        poses: poses(table)?,
        weights: given.get("weights")?,
    };
    let answer = match kind {
        "cor" | "aor" => {
            let request = table_request(held, &given)?;
            let axis = kind == "aor";
            waited(py, None, move |_| {
                Ok::<_, CliError>(match axis {
                    true => calib_fit::aor(&request)?,
                    false => calib_fit::cor(&request)?,
                })
            })?
        }
        "frame" => {
            let request = FrameRequest {
                file: Some(held.into()),
                proximal: given.get("proximal")?,
                distal: given.get("distal")?,
                estimator: given.some("estimator")?,
                sigma_m: given.some("sigma_m")?,
                sigma_rad: given.some("sigma_rad")?,
                ..FrameRequest::default()
            };
            waited(py, None, move |_| {
                Ok::<_, CliError>(calib_fit::frame(&request)?)
            })?
        }
        "handeye" => {
            let request = HandEyeRequest {
                file: Some(held.into()),
                robot: "robot".to_owned(),
                measured: "measured".to_owned(),
                inverted: given.get("inverted")?,
                optical: given.get("optical")?,
                estimator: given.some("estimator")?,
                sigma_m: given.some("sigma_m")?,
                sigma_rad: given.some("sigma_rad")?,
                ..HandEyeRequest::default()
            };
            waited(py, None, move |_| {
                Ok::<_, CliError>(calib_fit::handeye(&request)?)
            })?
        }
        other => return Err(misused(py, &format!("there is no fit of {other}"))),
    };
    Ok(PyBytes::new(py, answer.json.as_bytes()))
}

fn table_request(held: Held, given: &Given<'_, '_>) -> PyResult<TableRequest> {
    Ok(TableRequest {
        file: Some(held.into()),
        estimator: given.some("estimator")?,
        only: given.get("only")?,
        parent: given.get("parent")?,
        child: given.get("child")?,
        sigma_m: given.some("sigma_m")?,
        sigma_rad: given.some("sigma_rad")?,
        sight_m: given.some("sight_m")?,
        camera_m: given.get::<[f64; 3]>("camera_m")?.into(),
        noise_per_marker: given.get("noise_per_marker")?,
        joint: given.some("joint")?,
        center_m: given.some::<[f64; 3]>("center_m")?.map(Into::into),
        towards: given.some::<[f64; 3]>("towards")?.map(Into::into),
        ..TableRequest::default()
    })
}
