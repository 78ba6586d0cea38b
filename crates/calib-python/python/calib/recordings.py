"""Recordings: what trackers and robots write, read into arrays that cannot be written to. A lost sample is NaN."""

import os
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from calib import _native
from calib._arrays import Array

Kind = Literal["joint", "torque", "body", "marker"]


@dataclass(frozen=True, eq=False)
class Timeline:
    """Sampling instants of one device."""

    clock: str
    """Which clock the times are read from; two timelines share a clock only where these texts are equal."""
    rows: npt.NDArray[np.uint64]
    """Where each sample stands in the file: frame number, or line from 1."""
    t: Array | None
    """Times, s, never decreasing; ``None`` for static poses."""
    received: Array | None
    """When each sample arrived at the computer that recorded it, s since 1970."""
    labels: dict[str, list[str]]
    """Text columns that name samples."""


@dataclass(frozen=True, eq=False)
class Stream:
    """One joint, torque, body or marker."""

    kind: Kind
    name: str
    unit: str
    """``rad``, ``m`` or ``N m``."""
    timeline: Timeline
    values: Array
    """Joints, torques and temperatures: n. Markers: n × 3, m. Bodies: n × 4 × 4, ``tracker_from_body``. Read-only; a lost sample is NaN."""
    filled: npt.NDArray[np.bool_] | None = None
    """Markers: which samples were interpolated by the device and measure nothing."""

    @property
    def seen(self) -> npt.NDArray[np.bool_]:
        """Which samples are not lost."""
        flat = self.values.reshape(len(self.values), -1)
        return np.asarray(~np.isnan(flat).any(axis=1))


@dataclass(frozen=True, eq=False)
class Recording:
    """All streams of one file, in SI, each with its clock.

    >>> recording = read(poses_file)
    >>> recording.joints["elbow"].values
    array([1.57079633, 0.78539816])
    >>> recording.markers["tip"].values
    array([[0.1, 0.2, 0.3],
           [nan, nan, nan]])
    """

    source: str
    """The file as it was named."""
    format: str
    """The reader."""
    comments: list[str]
    """Comment lines of the file, or its header fields."""
    conversions: list[str]
    """What the reader converted: units, order, ignored columns."""
    findings: list[str]
    """What the reader noticed."""
    up_axis: str | None
    """The axis that points up, where the file says so."""
    timelines: list[Timeline]
    joints: dict[str, Stream] = field(default_factory=dict)
    torques: dict[str, Stream] = field(default_factory=dict)
    temperatures: dict[str, Stream] = field(default_factory=dict)
    bodies: dict[str, Stream] = field(default_factory=dict)
    markers: dict[str, Stream] = field(default_factory=dict)

    def __repr__(self) -> str:
        counts = ", ".join(
            f"{len(streams)} {name}"
            for name in ("joints", "torques", "temperatures", "bodies", "markers")
            if (streams := getattr(self, name))
        )
        rows = " + ".join(str(len(t.rows)) for t in self.timelines) or "0"
        return f"Recording({self.source!r}: {counts or 'nothing'}; {rows} rows)"


def _recording(plain: dict[str, Any]) -> Recording:
    timelines = [Timeline(**timeline) for timeline in plain["timelines"]]
    kinds = ("joint", "torque", "temperature", "body", "marker")
    streams: dict[str, dict[str, Stream]] = {kind: {} for kind in kinds}
    for kind, name, timeline, unit, values, filled in plain["streams"]:
        of_kind = streams[kind]
        # Unlabeled markers may share a name.
        key, times = name, 2
        while key in of_kind:
            key, times = f"{name}#{times}", times + 1
        of_kind[key] = Stream(kind, key, unit, timelines[timeline], values, filled)
    return Recording(
        source=plain["source"],
        format=plain["format"],
        comments=plain["comments"],
        conversions=plain["conversions"],
        findings=plain["findings"],
        up_axis=plain["up_axis"],
        timelines=timelines,
        joints=streams["joint"],
        torques=streams["torque"],
        temperatures=streams["temperature"],
        bodies=streams["body"],
        markers=streams["marker"],
    )


def read(path: str | os.PathLike[str], format: str | None = None) -> Recording:
    """Reads a recording in any format that ``calib`` knows; ``format`` names the reader where the file does not say.

    Raises :class:`calib.CalibError` with file, line and column for a file that is not what its reader expects.
    """
    return _recording(_native.read(path, format))
