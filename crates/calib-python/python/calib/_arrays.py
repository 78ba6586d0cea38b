"""Arrays as the native code takes them: C-contiguous ``float64``."""

from typing import Any

import numpy as np
import numpy.typing as npt

from calib._native import CalibError

Array = npt.NDArray[np.float64]


def refused(text: str) -> CalibError:
    """An argument that is not what a function takes."""
    error = CalibError(text)
    error.exit_code = 2
    error.id = "usage"
    return error


def numbers(what: str, values: npt.ArrayLike) -> Array:
    """The values as a contiguous array of ``float64``."""
    try:
        return np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise refused(f"{what}: {error}") from error


def shaped(what: str, values: npt.ArrayLike, shape: tuple[int | str, ...]) -> Array:
    """The same, of this shape; a word in it stands for any length."""
    array = numbers(what, values)
    fits = array.ndim == len(shape) and all(
        isinstance(want, str) or have == want for have, want in zip(array.shape, shape)
    )
    if not fits:
        expected = " × ".join(str(s) for s in shape)
        found = " × ".join(str(s) for s in array.shape) or "one number"
        raise refused(f"{what}: found {found}; expected {expected}")
    return array


def last(what: str, values: npt.ArrayLike, shape: tuple[int, ...]) -> tuple[Array, tuple[int, ...]]:
    """The values with all leading dimensions made one, and what these were: postures in any arrangement."""
    array = numbers(what, values)
    k = len(shape)
    if array.shape[array.ndim - k :] != shape:
        expected = " × ".join(["…", *(str(s) for s in shape)])
        found = " × ".join(str(s) for s in array.shape) or "one number"
        raise refused(f"{what}: found {found}; expected {expected}")
    lead = array.shape[: array.ndim - k]
    return array.reshape(-1, *shape), lead


def given(**options: Any) -> dict[str, Any]:
    """The options that are not ``None``."""
    return {key: value for key, value in options.items() if value is not None}
