"""``calib.simulate``, ``calib.plan`` and ``calib.twin``, as the commands of these names."""

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from calib import _native
from calib._arrays import Array, given, shaped
from calib.recordings import Recording, _recording
from calib.report import Plugins, Record


@dataclass(frozen=True, eq=False)
class Simulated:
    """Recordings with known truth."""

    recordings: dict[str, Recording]
    """By the profile's names."""
    truth: Record
    """What was drawn, with the keys of ``truth.json``."""


def simulate(profile: str | os.PathLike[str], seed: int | None = None) -> Simulated:
    """Simulates the recordings of a profile's ``simulate`` section; ``seed`` in place of the profile's.

    >>> simulated = simulate(profile_file, seed=7)
    >>> simulated.truth.seed
    7
    """
    recordings, truth = _native.simulate(profile, seed)
    return Simulated(
        recordings={name: _recording(plain) for name, plain in recordings.items()},
        truth=json.loads(truth, object_hook=Record),
    )


@dataclass(frozen=True, eq=False)
class Plan:
    """Postures to record."""

    joints: tuple[str, ...]
    """The columns of the postures."""
    postures: Array
    """n × joints, rad or m, in the order in which they are taken."""
    held_out: Array
    """The same, to validate with."""
    data: Record = field(repr=False)
    """Everything that ``calib plan --json`` prints."""
    files: dict[str, bytes] = field(repr=False)
    """The files that ``calib plan`` writes, by name."""


def _si(column: str, value: float) -> tuple[str, float]:
    """Joint and value of a column ``<joint>_deg`` or ``<joint>_mm``."""
    name, _, unit = column.rpartition("_")
    return name, math.radians(value) if unit == "deg" else value * 1e-3


def _postures(joints: Sequence[str], lines: Sequence[Mapping[str, float]]) -> Array:
    table = [dict(_si(column, value) for column, value in line.items()) for line in lines]
    rows = [[line[joint] for joint in joints] for line in table]
    return np.asarray(rows, dtype=np.float64).reshape(len(rows), len(joints))


def plan(
    profile: str | os.PathLike[str],
    *,
    poses: int | None = None,
    sigma_m: float | None = None,
    goal: Literal["task", "parameters", "variances"] = "task",
    of: Sequence[str] = (),
    task: npt.ArrayLike | None = None,
    candidates: int | None = None,
    seed: int = 1,
    plugins: Plugins = "placed",
    progress: Callable[[str], object] | None = None,
) -> Plan:
    """Chooses the postures to record next; the profile's recordings need not exist yet.

    ``poses`` of them (36 by default), or as many as ``sigma_m`` of the tool's position needs. ``task`` (n × the robot's joints, by the URDF's
    order): where the robot is to be accurate. The others as in ``calib plan``.
    """
    options = given(
        poses=poses,
        sigma_m=sigma_m,
        goal=goal,
        of=list(of),
        task=None if task is None else shaped("task", task, ("n", "joints")).tolist(),
        candidates=candidates,
        seed=seed,
    )
    text, files = _native.plan(profile, options, plugins, progress)
    data: Record = json.loads(text, object_hook=Record)
    recorded = [line.joints for line in data.postures if line.pose is not None]
    columns = [*recorded, *data.held_out]
    joints = tuple(_si(column, 0.0)[0] for column in (columns[0] if columns else ()))
    return Plan(joints, _postures(joints, recorded), _postures(joints, data.held_out), data, files)


@dataclass(frozen=True, eq=False)
class Twin:
    """What a session can and cannot tell."""

    data: Record
    """With the keys of ``twin.json``."""
    files: dict[str, bytes] = field(repr=False)
    """``twin.json`` and ``twin.html``."""

    def _repr_html_(self) -> str:
        import html

        page = html.escape(self.files["twin.html"].decode(), quote=True)
        return f'<iframe srcdoc="{page}" style="width:100%;height:40em;border:1px solid"></iframe>'


def twin(
    of: str | os.PathLike[str],
    *,
    trials: int = 200,
    seed: int = 1,
    noise_times: float = 1.0,
    sigma_m: float | None = None,
    truth: Literal["found", "prior"] | None = None,
    threads: int | None = None,
    plugins: Plugins = "placed",
    progress: Callable[[int, int], object] | None = None,
) -> Twin:
    """Repeats a session with known truth: what it promises, what it reaches, what it would not notice.

    ``of`` is a profile, or a folder of results. The options are those of ``calib twin``; ``progress(done, total)`` counts trials.
    """
    options = given(
        trials=trials, seed=seed, noise_times=noise_times, sigma_m=sigma_m, threads=threads
    )
    files = _native.twin(of, options, truth, plugins, progress)
    return Twin(json.loads(files["twin.json"], object_hook=Record), files)
