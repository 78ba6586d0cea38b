//! Slices of numpy arrays, and arrays of vectors, without a copy.

use numpy::ndarray::{ArrayBase, Dim, OwnedRepr};
use numpy::{IntoPyArray, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use crate::error::misused;

/// The numbers of a C-contiguous array.
pub(crate) fn slice<'a>(
    py: Python<'_>,
    what: &str,
    array: &'a PyReadonlyArrayDyn<'_, f64>,
) -> PyResult<&'a [f64]> {
    let slice = array.as_slice();
    slice.map_err(|_| misused(py, &format!("{what}: the array is not C-contiguous")))
}

/// A vector as an array of this shape: the array owns it, nothing is copied.
pub(crate) fn array<'py, T: numpy::Element, const D: usize>(
    py: Python<'py>,
    values: Vec<T>,
    shape: [usize; D],
) -> PyResult<Bound<'py, PyAny>>
where
    Dim<[usize; D]>: numpy::ndarray::Dimension,
    [usize; D]: numpy::ndarray::IntoDimension<Dim = Dim<[usize; D]>>,
{
    let shaped: Result<ArrayBase<OwnedRepr<T>, Dim<[usize; D]>>, _> =
        ArrayBase::from_shape_vec(shape, values);
    let shaped = shaped.map_err(|e| misused(py, &e.to_string()))?;
    Ok(shaped.into_pyarray(py).into_any())
}

/// The same, as an array that cannot be written to: a view of what a recording holds.
pub(crate) fn view<'py, T: numpy::Element, const D: usize>(
    py: Python<'py>,
    values: Vec<T>,
    shape: [usize; D],
) -> PyResult<Bound<'py, PyAny>>
where
    Dim<[usize; D]>: numpy::ndarray::Dimension,
    [usize; D]: numpy::ndarray::IntoDimension<Dim = Dim<[usize; D]>>,
{
    let array = array(py, values, shape)?;
    array.getattr("flags")?.setattr("writeable", false)?;
    Ok(array)
}
