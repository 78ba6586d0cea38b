"""A calibrated robot at work: poses, their uncertainty, and corrected commands, over arrays of postures.

Postures ``q`` are arrays whose last dimension is that of :attr:`Model.joints` (rad or m, as the controller reads them); whatever stands
before it stays: one posture gives one pose, n postures give n. The interpreter is released while they are evaluated.
"""

import enum
import os
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from calib import _native
from calib._arrays import Array, given, last

Frame = Literal["root", "tracker"]
Aim = Literal["pose", "position"]


@dataclass(frozen=True)
class Joint:
    """A joint that the controller moves."""

    name: str
    prismatic: bool
    """It slides: m in place of rad."""
    limits: tuple[float, float] | None
    """Of the URDF, rad or m."""
    fitted_range: tuple[float, float] | None
    """Smallest and largest reading that was fitted, equal where it stood still; ``None`` where it moves nothing that was seen."""


class Outcome(enum.IntEnum):
    """How a correction ended."""

    REACHED = 0
    """The tool is there to the tolerance."""
    OUT_OF_SCOPE = 1
    """Reached, but a joint's command is outside of its fitted range: nothing was verified there."""
    NEARER = 2
    """The tool came nearer, but not to the tolerance: a singular posture, or too few joints."""
    NOT_REACHED = 3
    """Refused: within the bound nothing brings the tool nearer. The command is the desired position."""
    BEYOND_LIMITS = 4
    """Refused: a joint would have to leave its limits. The command is the desired position."""


@dataclass(frozen=True)
class Correction:
    """Commands and what they do to the tool, by the model: one entry for each posture."""

    q: Array
    """Commands, … × dof, rad or m."""
    outcome: npt.NDArray[np.int64]
    """Values of :class:`Outcome`."""
    joint: npt.NDArray[np.int64]
    """The joint that :class:`Outcome` speaks of, as an index of :attr:`Model.joints`; −1 where there is none."""
    iterations: npt.NDArray[np.int64]
    """Steps that were made."""
    before_m: Array
    """Distance from where the tool is wanted before the correction, m."""
    after_m: Array
    """After it."""
    before_rad: Array
    """Rotation from how it is wanted, rad; 0 where only the position is wanted."""
    after_rad: Array
    """After it."""
    step: Array
    """Largest change of a joint, rad or m."""

    @property
    def usable(self) -> npt.NDArray[np.bool_]:
        """Whether the command brings the tool nearer than the desired position would."""
        return np.asarray(self.outcome <= Outcome.NEARER)


class Model:
    """A calibrated robot, read from the ``<robot>.calibrated.model.json`` of a run. It never changes; threads may share it.

    >>> model = Model(arm_file)
    >>> [joint.name for joint in model.joints], model.tool
    (['shoulder', 'elbow'], 'tool')
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._set(_native.Model.load(path))

    @classmethod
    def from_json(cls, text: str | bytes) -> "Model":
        """The model of a file's text: ``Model.from_json(report.files["ripley.calibrated.model.json"])``."""
        model = cls.__new__(cls)
        model._set(_native.Model.from_json(text.encode() if isinstance(text, str) else text))
        return model

    def _set(self, native: _native.Model) -> None:
        self._native = native
        facts = native.facts()
        self.name: str = facts["name"]
        """The robot's name."""
        self.joints: tuple[Joint, ...] = tuple(
            Joint(
                name,
                prismatic,
                None if limits is None else (limits[0], limits[1]),
                None if fitted is None else (fitted[0], fitted[1]),
            )
            for name, prismatic, limits, fitted in facts["joints"]
        )
        """The joints that the controller moves, in the order of all ``q``."""
        self.links: tuple[str, ...] = tuple(facts["links"])
        """All links; the first is the root."""
        self.bodies: tuple[str, ...] = tuple(facts["bodies"])
        """Tracking bodies that have a frame."""
        self.points: tuple[str, ...] = tuple(facts["points"])
        """Points of the robot, as tool centers."""
        self.tool: str = facts["tool"]
        """The link at the end of the longest chain: what is meant where no place is named."""
        self.has_uncertainty: bool = facts["has_uncertainty"]
        """Whether :meth:`sigma` can answer."""
        self.reference_temperature_c: float | None = facts["reference_temperature_c"]
        """Temperature at which the lengths hold, °C; ``None`` where none follows the temperature."""
        self.tracker_from_root: Array = facts["tracker_from_root"]
        """Where the root stands in the tracker, 4 × 4."""

    @property
    def dof(self) -> int:
        """Number of :attr:`joints`."""
        return len(self.joints)

    def __repr__(self) -> str:
        return f"Model({self.name!r}, {self.dof} joints, tool {self.tool!r})"

    def _postures(self, what: str, q: npt.ArrayLike) -> tuple[Array, tuple[int, ...]]:
        return last(what, q, (self.dof,))

    def _under(
        self,
        approach: npt.ArrayLike | None,
        held: npt.ArrayLike | None,
        temperature_c: npt.ArrayLike | None,
        like: Array,
    ) -> tuple[Array | None, Array | None, Array | None]:
        def of(what: str, values: npt.ArrayLike | None) -> Array | None:
            if values is None:
                return None
            rows, _ = self._postures(what, values)
            # One row stands for all postures.
            one = len(rows) == 1
            return np.ascontiguousarray(np.broadcast_to(rows, like.shape)) if one else rows

        if temperature_c is not None and np.ndim(temperature_c) == 0:
            # One temperature of the whole robot.
            temperature_c = np.full(self.dof, temperature_c)
        return of("approach", approach), of("held", held), of("temperature_c", temperature_c)

    def fk(
        self,
        q: npt.ArrayLike,
        of: str | None = None,
        *,
        frame: Frame = "root",
        nominal: bool = False,
        approach: npt.ArrayLike | None = None,
        held: npt.ArrayLike | None = None,
        temperature_c: npt.ArrayLike | None = None,
    ) -> Array:
        """Poses ``frame_from_of`` as homogeneous matrices, … × 4 × 4, m.

        ``of`` is a link, a body or a point; the tool where none is named. ``nominal``: what a controller without calibration believes.
        ``approach`` (… × dof): +1 where a joint comes from below, −1 from above, 0 not known; see :meth:`approach`. ``held`` (… × dof):
        torques (N m) that sensors in the joints read, in place of those of gravity. ``temperature_c`` (… × dof, or one number): how warm
        the link before each joint is, where lengths follow it; see :attr:`reference_temperature_c`.

        >>> pose = Model(arm_file).fk([[0.0, 0.0], [0.3, -0.5]])
        >>> pose.shape, bool(abs(pose[0, 3, 3] - 1) < 1e-15)
        ((2, 4, 4), True)
        """
        rows, lead = self._postures("q", q)
        poses = self._native.fk(
            rows,
            of,
            (frame == "tracker", nominal),
            self._under(approach, held, temperature_c, rows),
        )
        return poses.reshape(*lead, 4, 4)

    def jacobian(
        self,
        q: npt.ArrayLike,
        link: str | None = None,
        *,
        approach: npt.ArrayLike | None = None,
        held: npt.ArrayLike | None = None,
        temperature_c: npt.ArrayLike | None = None,
    ) -> Array:
        """Jacobians of a link, … × 6 × dof: twists ``[ω; v]`` in the link's frame per unit of each joint, all effects included.

        >>> Model(arm_file).jacobian([0.3, -0.5]).shape
        (6, 2)
        """
        rows, lead = self._postures("q", q)
        found = self._native.jacobian(
            rows,
            link,
            self._under(approach, held, temperature_c, rows),
        )
        return found.reshape(*lead, 6, self.dof)

    def sigma(
        self,
        q: npt.ArrayLike,
        of: str | None = None,
        *,
        frame: Frame = "root",
        approach: npt.ArrayLike | None = None,
        held: npt.ArrayLike | None = None,
        temperature_c: npt.ArrayLike | None = None,
    ) -> Array:
        """Covariances of predicted poses, … × 6 × 6: ``[ω; v]`` in the place's own frame, rad² and m².

        They are those of the robot's numbers alone: neither a measurement's noise nor how well a posture repeats is in them.

        >>> c = Model(arm_file).sigma([0.3, -0.5])
        >>> c.shape, bool((c == c.T).all())
        ((6, 6), True)
        """
        rows, lead = self._postures("q", q)
        found = self._native.sigma(
            rows,
            of,
            frame == "tracker",
            self._under(approach, held, temperature_c, rows),
        )
        return found.reshape(*lead, 6, 6)

    def correct(
        self,
        q: npt.ArrayLike,
        link: str | None = None,
        *,
        aim: Aim | None = None,
        largest_rad: float | None = None,
        largest_m: float | None = None,
        tolerance_m: float | None = None,
        lever_m: float | None = None,
        iterations: int | None = None,
        approach: npt.ArrayLike | None = None,
        held: npt.ArrayLike | None = None,
        temperature_c: npt.ArrayLike | None = None,
    ) -> Correction:
        """Commands at which the link stands where the nominal model has it at ``q``.

        No command leaves ``q`` by more than ``largest_rad`` (0.1) or ``largest_m`` (0.05) at any joint. A correction that cannot be made is
        marked in :attr:`Correction.outcome`, and its command is ``q`` itself.

        >>> model = Model(arm_file)
        >>> done = model.correct([0.3, -0.5], aim="position")
        >>> bool(done.usable), bool(done.after_m <= done.before_m)
        (True, True)
        """
        rows, lead = self._postures("q", q)
        options = given(
            aim=aim,
            largest_rad=largest_rad,
            largest_m=largest_m,
            tolerance_m=tolerance_m,
            lever_m=lever_m,
            iterations=iterations,
        )
        done = self._native.correct(
            rows,
            link,
            options,
            self._under(approach, held, temperature_c, rows),
        )
        return self._correction(done, lead)

    def ik(
        self,
        poses: npt.ArrayLike,
        seed: npt.ArrayLike,
        link: str | None = None,
        *,
        aim: Aim | None = None,
        largest_rad: float | None = None,
        largest_m: float | None = None,
        tolerance_m: float | None = None,
        lever_m: float | None = None,
        iterations: int | None = None,
        approach: npt.ArrayLike | None = None,
        held: npt.ArrayLike | None = None,
        temperature_c: npt.ArrayLike | None = None,
    ) -> Correction:
        """Positions at which the link stands at ``poses`` (``root_from_link``, … × 4 × 4), near ``seed`` (… × dof, or one for all).

        >>> model = Model(arm_file)
        >>> done = model.ik(model.fk([0.3, -0.5]), [0.25, -0.45], aim="position")
        >>> bool(done.after_m < 1e-8)
        True
        """
        wanted, lead = last("poses", poses, (4, 4))
        seeds, _ = self._postures("seed", seed)
        if len(seeds) == 1:
            seeds = np.ascontiguousarray(np.broadcast_to(seeds, (len(wanted), self.dof)))
        options = given(
            aim=aim,
            largest_rad=largest_rad,
            largest_m=largest_m,
            tolerance_m=tolerance_m,
            lever_m=lever_m,
            iterations=iterations,
        )
        done = self._native.ik(
            wanted,
            seeds,
            link,
            options,
            self._under(approach, held, temperature_c, seeds),
        )
        return self._correction(done, lead)

    def _correction(self, done: Array, lead: tuple[int, ...]) -> Correction:
        def column(k: int) -> Array:
            return done[:, self.dof + k].reshape(lead)

        def whole(k: int) -> npt.NDArray[np.int64]:
            return column(k).astype(np.int64)

        return Correction(
            q=done[:, : self.dof].reshape(*lead, self.dof),
            outcome=whole(0),
            joint=whole(1),
            iterations=whole(2),
            before_m=column(3),
            after_m=column(4),
            before_rad=column(5),
            after_rad=column(6),
            step=column(7),
        )

    def in_scope(self, q: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether every joint is in the range that was fitted: outside of it nothing was verified.

        >>> bool(Model(arm_file).in_scope([0.3, -0.5]))
        True
        """
        rows, lead = self._postures("q", q)
        return np.asarray(self._native.scope(rows)[:, 0] == 0).reshape(lead)

    def outside(self, q: npt.ArrayLike) -> list[str]:
        """For each posture what is out of scope, as ``elbow: beyond its limits``; empty where nothing is."""
        rows, _ = self._postures("q", q)
        words = {1: "outside of its fitted range", 2: "beyond its limits"}
        found = self._native.scope(rows)
        return [
            f"{self.joints[int(joint)].name}: {words[int(what)]}" if what else ""
            for what, joint in found
        ]

    def approach(self, q: npt.ArrayLike, threshold: float | None = None) -> Array:
        """From which side each joint came, along a sequence of postures (n × dof): +1 from below, −1 from above, 0 not known yet.

        A joint that moved by less than ``threshold`` (rad or m, the model's own by default) keeps its direction.
        """
        rows, lead = self._postures("q", q)
        return self._native.approach(rows, threshold).reshape(*lead, self.dof)
