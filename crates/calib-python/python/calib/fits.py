"""One estimator on arrays: centers, axes, frames and hand-eye transforms, by the same road as the command ``calib fit``.

Points are n × 3 (one marker), or a dictionary of such arrays by marker name; poses are n × 4 × 4, ``tracker_from_body``. A row of NaN is a
lost sample. Covariances are over ``[x; y; z]`` (m²) for points and ``[ω; v]`` (rad², m²) for poses. What the data do not determine is a
result: ``observable`` is false, ``reason`` says why.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from calib import _native
from calib._arrays import Array, given, numbers, refused, shaped

Points = npt.ArrayLike | Mapping[str, npt.ArrayLike]
Side = str | Sequence[str]


@dataclass(frozen=True, eq=False)
class _Fit:
    estimator: str
    """Which estimator answered."""
    observable: bool
    """Whether the data determine the quantity."""
    verdict: str
    """``ok``, or what is wrong with the data."""
    reason: str | None
    """Why the quantity is not, or only weakly, determined."""
    details: dict[str, Any] = field(repr=False)
    """Everything that ``calib fit --json`` prints."""


@dataclass(frozen=True, eq=False)
class CenterFit(_Fit):
    """A center of rotation."""

    center_m: Array | None
    """In the tracker's frame, m; for two moving bodies in the parent's."""
    covariance: Array | None
    """Of the center, 3 × 3, m²."""
    rms_m: float | None
    """Root mean square of the residuals, m."""
    used: int
    """Samples used."""
    rejected: list[int]
    """Rows that were rejected, from 0."""


@dataclass(frozen=True, eq=False)
class AxisFit(_Fit):
    """An axis of rotation."""

    point_m: Array | None
    """A point of it, m."""
    direction: Array | None
    """Unit vector."""
    covariance: Array | None
    """Of direction and point, 6 × 6."""
    rms_m: float | None
    """Root mean square of the residuals, m."""
    used: int
    """Samples used."""
    rejected: list[int]
    """Rows that were rejected, from 0."""


@dataclass(frozen=True, eq=False)
class FrameFit(_Fit):
    """The frame of a joint with two axes."""

    body_from_joint: Array | None
    """4 × 4, m."""
    covariance: Array | None
    """6 × 6."""
    rms_m: float | None
    """Root mean square of the position residuals, m."""
    rms_rad: float | None
    """Of the rotation residuals, rad."""
    used: int
    """Samples used."""
    rejected: list[int]
    """Samples that were rejected, from 0."""


@dataclass(frozen=True, eq=False)
class HandEyeFit(_Fit):
    """Both transforms of ``base_from_flange · x = z · tracker_from_body``."""

    x: Array | None
    """``flange_from_body``, 4 × 4, m."""
    z: Array | None
    """``base_from_tracker``, 4 × 4, m."""
    covariance: Array | None
    """Of ``[x; z]``, 12 × 12."""
    rms_m: float | None
    """Root mean square of the position residuals, m."""
    rms_rad: float | None
    """Of the rotation residuals, rad."""
    certified: bool
    """The estimate is proved to be the global minimum."""
    used: int
    """Pairs used."""
    rejected: list[int]
    """Pairs that were rejected, from 0."""


def _array(values: Any) -> Array | None:
    return None if values is None else np.asarray(values, dtype=np.float64)


def _pose(value: dict[str, list[float]] | None) -> Array | None:
    if value is None:
        return None
    x, y, z, w = value["rotation_xyzw"]
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = value["translation_m"]
    return pose


def _table(points: Points | None, poses: Points | None) -> dict[str, Any]:
    def by_name(what: str, values: Points | None, shape: tuple[int | str, ...]) -> dict[str, Array]:
        if values is None:
            return {}
        named = values if isinstance(values, Mapping) else {what: values}
        return {name: shaped(name, array, shape) for name, array in named.items()}

    if points is None and poses is None:
        raise refused("neither points nor poses are given; give one of them")
    return {
        "markers": by_name("points", points, ("n", 3)),
        "bodies": by_name("poses", poses, ("n", 4, 4)),
    }


def _names(side: Side) -> list[str]:
    return [side] if isinstance(side, str) else list(side)


def _fit(kind: str, table: dict[str, Any], options: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(_native.fit(kind, table, options))
    return found


def _common(found: dict[str, Any]) -> dict[str, Any]:
    return {
        "estimator": found["estimator"],
        "observable": found["observable"],
        "verdict": found["verdict"],
        "reason": found.get("reason"),
        "details": found,
        "covariance": _array(found.get("covariance")),
        "rms_m": found.get("rms_m"),
        "used": found.get("used", 0),
        "rejected": found.get("rejected", []),
    }


def fit_cor(
    points: Points | None = None,
    *,
    poses: Points | None = None,
    estimator: str | None = None,
    parent: Side = (),
    child: Side = (),
    sigma_m: float | None = None,
    sigma_rad: float | None = None,
    sight_m: float | None = None,
    camera_m: Sequence[float] | None = None,
    noise_per_marker: bool = False,
    weights: npt.ArrayLike | None = None,
) -> CenterFit:
    """A center of rotation, from markers or poses of a body that rotates about it.

    ``parent`` and ``child`` name the markers (or the body) on both sides of a joint where both move. ``sigma_m`` is the noise of one
    coordinate, ``sigma_rad`` that of an orientation; with ``sight_m``, the noise along the line of sight from ``camera_m``, ``sigma_m`` is
    that across it. ``weights``: how many readings each row is worth.

    >>> import numpy as np
    >>> directions = np.random.default_rng(1).normal(size=(40, 3))
    >>> directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    >>> fit = fit_cor(np.array([0.1, 0.2, 0.3]) + 0.25 * directions)
    >>> fit.observable, bool(np.allclose(fit.center_m, [0.1, 0.2, 0.3]))
    (True, True)
    """
    options = given(
        estimator=estimator,
        parent=_names(parent),
        child=_names(child),
        sigma_m=sigma_m,
        sigma_rad=sigma_rad,
        sight_m=sight_m,
        camera_m=None if camera_m is None else numbers("camera_m", camera_m).tolist(),
        noise_per_marker=noise_per_marker,
        weights=None if weights is None else shaped("weights", weights, ("n",)).tolist(),
    )
    found = _fit("cor", _table(points, poses), options)
    return CenterFit(**_common(found), center_m=_array(found.get("center_m")))


def fit_aor(
    points: Points | None = None,
    *,
    poses: Points | None = None,
    angles: npt.ArrayLike | None = None,
    estimator: str | None = None,
    parent: Side = (),
    child: Side = (),
    sigma_m: float | None = None,
    sigma_rad: float | None = None,
    center_m: Sequence[float] | None = None,
    towards: Sequence[float] | None = None,
    weights: npt.ArrayLike | None = None,
) -> AxisFit:
    """An axis of rotation, from markers or poses of a body that rotates about it.

    ``angles`` (n, rad) are taken as exact, and give the axis its sign; without them ``towards`` does. ``center_m`` is a point that the axis
    passes through. The others as in :func:`fit_cor`.

    >>> import numpy as np
    >>> a = np.linspace(0, 1, 30)
    >>> circle = np.stack([np.cos(a), np.sin(a), np.full_like(a, 0.4)], axis=1)
    >>> fit = fit_aor(circle, towards=[0, 0, 1])
    >>> bool(np.allclose(fit.direction, [0, 0, 1]))
    True
    """
    table = _table(points, poses)
    if angles is not None:
        table["joints"] = {"angle": shaped("angles", angles, ("n",))}
    options = given(
        estimator=estimator,
        parent=_names(parent),
        child=_names(child),
        sigma_m=sigma_m,
        sigma_rad=sigma_rad,
        joint=None if angles is None else "angle",
        center_m=None if center_m is None else numbers("center_m", center_m).tolist(),
        towards=None if towards is None else numbers("towards", towards).tolist(),
        weights=None if weights is None else shaped("weights", weights, ("n",)).tolist(),
    )
    found = _fit("aor", table, options)
    return AxisFit(
        **_common(found),
        point_m=_array(found.get("point_m")),
        direction=_array(found.get("direction")),
    )


def fit_frame(
    poses: npt.ArrayLike,
    proximal: npt.ArrayLike,
    distal: npt.ArrayLike,
    *,
    axes: str = "zx",
    estimator: str | None = None,
    sigma_m: float | None = None,
    sigma_rad: float | None = None,
    weights: npt.ArrayLike | None = None,
) -> FrameFit:
    """The frame of a joint with two axes, from poses of the body behind it and both angles (n, rad).

    ``axes``: the axis of the joint closer to the base, then that of the other, as ``zx``.
    """
    if len(axes) != 2 or any(axis not in "xyz" for axis in axes):
        raise refused(f"axes: found {axes}; expected two of x, y and z, as zx")
    table = _table(None, {"body": poses})
    table["joints"] = {
        "proximal": shaped("proximal", proximal, ("n",)),
        "distal": shaped("distal", distal, ("n",)),
    }
    options = given(
        proximal=f"{axes[0]}=proximal",
        distal=f"{axes[1]}=distal",
        estimator=estimator,
        sigma_m=sigma_m,
        sigma_rad=sigma_rad,
        weights=None if weights is None else shaped("weights", weights, ("n",)).tolist(),
    )
    found = _fit("frame", table, options)
    return FrameFit(
        **_common(found),
        rms_rad=found.get("rms_rad"),
        body_from_joint=_pose(found.get("body_from_joint")),
    )


def fit_handeye(
    robot: npt.ArrayLike,
    measured: npt.ArrayLike,
    *,
    inverted: bool = False,
    estimator: str | None = None,
    sigma_m: float | None = None,
    sigma_rad: float | None = None,
) -> HandEyeFit:
    """Where a body is on the flange and the tracker in the robot's base, from pairs of poses (n × 4 × 4).

    ``robot`` is ``base_from_flange``, ``measured`` is ``tracker_from_body``; ``inverted`` where ``measured`` is its inverse, as a detector
    states a board in a camera. The answer is :class:`HandEyeFit`.
    """
    table = _table(None, {"robot": robot, "measured": measured})
    options = given(inverted=inverted, estimator=estimator, sigma_m=sigma_m, sigma_rad=sigma_rad)
    found = _fit("handeye", table, options)
    return HandEyeFit(
        **_common(found),
        rms_rad=found.get("rms_rad"),
        x=_pose(found.get("x")),
        z=_pose(found.get("z")),
        certified=bool(found.get("certified", False)),
    )
