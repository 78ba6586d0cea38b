"""Estimators and readers written in Python, for a run: ``calib.run(profile, own=[…])``.

A profile names them like built-in ones. They run in this process; what they raise stops the run with exit code 6, and their answers are
checked like those of any plugin: sizes, finite numbers, unit vectors.

>>> import calib, numpy as np
>>> @calib.center_estimator("mean_of_points", shapes=["markers"])
... def mean_of_points(motion: calib.Motion) -> calib.Center:
...     return calib.Center(np.nanmean(motion.points_m, axis=(0, 1)), rms_m=0.0, used=motion.samples)
>>> mean_of_points.name
'mean_of_points'
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy.typing as npt

from calib._arrays import Array, numbers, refused, shaped

Shape = Literal["points", "markers", "poses", "two bodies"]


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of one joint in the tracker's frame: what an estimator is given. A lost sample is NaN."""

    shape: Shape
    """What was measured: single points, markers of one body, poses of one body, or poses of both sides of the joint (parent first)."""
    points_m: Array | None = None
    """tracks × samples × 3, m; ``None`` for poses."""
    rotations: Array | None = None
    """tracks × samples × 3 × 3; ``None`` for points."""
    translations_m: Array | None = None
    """tracks × samples × 3, m; ``None`` for points."""
    covariances_m2: Array | None = None
    """tracks × samples × 3 × 3, m², where the points' noise is known."""
    angles_rad: Array | None = None
    """Joint angle of each sample, where encoders say it."""
    center_m: Sequence[float] | None = None
    """A point that an axis must pass through."""
    towards: Sequence[float] | None = None
    """The side that an axis points to."""
    sigma_t_m: float | None = None
    """Noise of one coordinate as the tracker states it."""
    sigma_r_rad: float | None = None
    """Noise of the orientation about one axis."""
    significance: float = 1e-3
    """Probability of calling an unanswerable recording answerable."""
    seed: int = 0
    """Seed of all random numbers."""

    @property
    def samples(self) -> int:
        """Number of samples of each track."""
        of = self.points_m if self.points_m is not None else self.translations_m
        return 0 if of is None else of.shape[1]


@dataclass(frozen=True, eq=False)
class Center:
    """A center of rotation that an estimator found."""

    center_m: npt.ArrayLike
    """In the tracker's frame, m."""
    rms_m: float
    """Root mean square of the residuals, m."""
    used: int
    """Samples used."""
    covariance_m2: npt.ArrayLike | None = None
    """3 × 3, m²."""
    body_points_m: npt.ArrayLike = ()
    """The center in each body, m."""
    radii_m: Sequence[float] = ()
    """Radius of each marker, m."""
    rejected: Sequence[tuple[int, int]] = ()
    """(track, sample) that were rejected."""
    weak: str | None = None
    """Why the center is determined only badly."""


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis of rotation that an estimator found."""

    point_m: npt.ArrayLike
    """A point of it in the tracker's frame, m."""
    direction: npt.ArrayLike
    """Unit vector."""
    rms_m: float
    """Root mean square of the residuals, m."""
    used: int
    """Samples used."""
    covariance: npt.ArrayLike | None = None
    """Over ``[direction; point]``, 6 × 6, rad and m."""
    rejected: Sequence[tuple[int, int]] = ()
    """(track, sample) that were rejected."""
    weak: str | None = None
    """Why the axis is determined only badly."""


@dataclass(frozen=True)
class NotObservable:
    """The data do not determine the quantity."""

    reason: str


@dataclass(frozen=True, eq=False)
class Table:
    """What a reader returns: arrays with one row for each pose or sample. A row of NaN is a lost sample."""

    joints: Mapping[str, npt.ArrayLike] = field(default_factory=dict)
    """Angles by joint, n, rad."""
    lengths: Mapping[str, npt.ArrayLike] = field(default_factory=dict)
    """Positions of sliding joints, n, m."""
    torques: Mapping[str, npt.ArrayLike] = field(default_factory=dict)
    """By joint, n, N m."""
    temperatures: Mapping[str, npt.ArrayLike] = field(default_factory=dict)
    """Of the link before a joint, or of the whole ``robot``, n, °C."""
    markers: Mapping[str, npt.ArrayLike] = field(default_factory=dict)
    """Points in the tracker's frame, n × 3, m."""
    bodies: Mapping[str, npt.ArrayLike] = field(default_factory=dict)
    """``tracker_from_body``, n × 4 × 4, m."""
    t: npt.ArrayLike | None = None
    """Times, s, never decreasing; ``None`` for static poses."""
    rows: Sequence[int] | None = None
    """Where each row stands in the file; from 0 by default."""
    labels: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Text columns."""
    notes: Sequence[str] = ()
    """What was converted or excluded, one sentence each."""


@dataclass(frozen=True, eq=False)
class Plugin:
    """A function that a run may call by name. Made by :func:`center_estimator`, :func:`axis_estimator` and :func:`reader`."""

    kind: Literal["center", "axis", "reader"]
    name: str
    summary: str
    source: str
    shapes: tuple[str, ...]
    parameters: dict[str, bool | int | float | str]
    """Parameters of the function with their defaults: what a profile may set."""
    plugin: str
    """The module that it stands in: what the report names."""
    version: str
    call: Callable[..., Any] = field(repr=False)
    recognizes: Callable[[bytes], bool] | None = field(repr=False)
    function: Callable[..., Any] = field(repr=False)

    def __call__(self, *args: Any, **parameters: Any) -> Any:
        """The function itself."""
        return self.function(*args, **parameters)


def _parameters(function: Callable[..., Any], positional: int) -> dict[str, Any]:
    """Those after the data, with their defaults."""
    given = list(inspect.signature(function).parameters.values())[positional:]
    for parameter in given:
        if not isinstance(parameter.default, (bool, int, float, str)):
            raise refused(
                f"{function.__name__}: parameter {parameter.name} needs a default: true or false, a number or a text"
            )
    return {parameter.name: parameter.default for parameter in given}


def _plugin(
    kind: Literal["center", "axis", "reader"],
    name: str,
    function: Callable[..., Any],
    call: Callable[..., Any],
    *,
    positional: int,
    shapes: Sequence[str] = (),
    source: str = "",
    version: str = "0",
    recognizes: Callable[[bytes], bool] | None = None,
) -> Plugin:
    first = (inspect.getdoc(function) or "").partition("\n")[0]
    return Plugin(
        kind=kind,
        name=name,
        summary=first,
        source=source,
        shapes=tuple(shapes),
        parameters=_parameters(function, positional),
        plugin=function.__module__,
        version=version,
        call=call,
        recognizes=recognizes,
        function=function,
    )


def _list(what: str, values: npt.ArrayLike | None, shape: tuple[int | str, ...]) -> Any:
    return None if values is None else shaped(what, values, shape).tolist()


def _pairs(rejected: Sequence[tuple[int, int]]) -> list[list[int]]:
    return [[int(track), int(sample)] for track, sample in rejected]


def center_estimator(
    name: str,
    *,
    shapes: Sequence[Shape],
    source: str = "",
    version: str = "0",
) -> Callable[[Callable[..., Center | NotObservable]], Plugin]:
    """Makes a function ``(motion, **parameters) -> Center | NotObservable`` an estimator of centers of rotation.

    ``shapes`` are the data that it takes. Its parameters after ``motion`` need defaults, whose types are those of the parameters; a profile
    sets them under ``center_parameters``.
    """

    def made(function: Callable[..., Center | NotObservable]) -> Plugin:
        def call(motion: dict[str, Any], parameters: dict[str, Any]) -> dict[str, Any] | str:
            answer = function(Motion(**motion), **parameters)
            if isinstance(answer, NotObservable):
                return answer.reason
            points = numbers("body_points_m", answer.body_points_m).reshape(-1, 3)
            return {
                "center_m": _list("center_m", answer.center_m, (3,)),
                "covariance_m2": _list("covariance_m2", answer.covariance_m2, (3, 3)),
                "body_points_m": points.tolist(),
                "radii_m": [float(radius) for radius in answer.radii_m],
                "rms_m": float(answer.rms_m),
                "used": int(answer.used),
                "rejected": _pairs(answer.rejected),
                "weak": answer.weak,
            }

        return _plugin(
            "center",
            name,
            function,
            call,
            positional=1,
            shapes=shapes,
            source=source,
            version=version,
        )

    return made


def axis_estimator(
    name: str,
    *,
    shapes: Sequence[Shape],
    source: str = "",
    version: str = "0",
) -> Callable[[Callable[..., Axis | NotObservable]], Plugin]:
    """The same for axes of rotation: ``(motion, **parameters) -> Axis | NotObservable``; a profile sets ``axis_parameters``."""

    def made(function: Callable[..., Axis | NotObservable]) -> Plugin:
        def call(motion: dict[str, Any], parameters: dict[str, Any]) -> dict[str, Any] | str:
            answer = function(Motion(**motion), **parameters)
            if isinstance(answer, NotObservable):
                return answer.reason
            return {
                "point_m": _list("point_m", answer.point_m, (3,)),
                "direction": _list("direction", answer.direction, (3,)),
                "covariance": _list("covariance", answer.covariance, (6, 6)),
                "rms_m": float(answer.rms_m),
                "used": int(answer.used),
                "rejected": _pairs(answer.rejected),
                "weak": answer.weak,
            }

        return _plugin(
            "axis",
            name,
            function,
            call,
            positional=1,
            shapes=shapes,
            source=source,
            version=version,
        )

    return made


def reader(
    name: str,
    *,
    recognizes: Callable[[bytes], bool] | None = None,
    version: str = "0",
) -> Callable[[Callable[..., Table]], Plugin]:
    """Makes a function ``(file_name, content, **parameters) -> Table`` a reader of recordings.

    ``recognizes(first_bytes)`` says whether a file is in its format where the profile names no reader. A ``ValueError`` is a file that is
    not what the reader expects: its text should name line and column.
    """

    def made(function: Callable[..., Table]) -> Plugin:
        def call(file_name: str, content: bytes, parameters: dict[str, Any]) -> dict[str, Any]:
            table = function(file_name, content, **parameters)

            def arrays(
                values: Mapping[str, npt.ArrayLike], shape: tuple[int | str, ...]
            ) -> dict[str, Array]:
                return {key: shaped(key, value, shape) for key, value in values.items()}

            return {
                "joints": arrays(table.joints, ("n",)),
                "lengths": arrays(table.lengths, ("n",)),
                "torques": arrays(table.torques, ("n",)),
                "temperatures": arrays(table.temperatures, ("n",)),
                "markers": arrays(table.markers, ("n", 3)),
                "bodies": arrays(table.bodies, ("n", 4, 4)),
                "t": _list("t", table.t, ("n",)),
                "rows": None if table.rows is None else [int(row) for row in table.rows],
                "labels": {key: list(values) for key, values in table.labels.items()},
                "notes": list(table.notes),
            }

        return _plugin(
            "reader", name, function, call, positional=2, version=version, recognizes=recognizes
        )

    return made


__all__ = [
    "Axis",
    "Center",
    "Motion",
    "NotObservable",
    "Plugin",
    "Table",
    "axis_estimator",
    "center_estimator",
    "reader",
]
