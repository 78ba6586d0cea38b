"""Calibrates the kinematic model of a robot with a motion-capture system.

Lengths are m, angles rad, times s; ``a_from_b`` maps coordinates of b to those of a. A lost sample is NaN. Whatever is refused raises
:class:`CalibError` with the text of the program ``calib``.

>>> import calib
>>> model = calib.Model(arm_file)
>>> model.fk([0.3, -0.5]).shape
(4, 4)
"""

from calib._native import CalibError
from calib.fits import (
    AxisFit,
    CenterFit,
    FrameFit,
    HandEyeFit,
    fit_aor,
    fit_cor,
    fit_frame,
    fit_handeye,
)
from calib.jobs import Plan, Simulated, Twin, plan, simulate, twin
from calib.model import Correction, Joint, Model, Outcome
from calib.plugins import (
    Axis,
    Center,
    Motion,
    NotObservable,
    Plugin,
    Table,
    axis_estimator,
    center_estimator,
    reader,
)
from calib.recordings import Recording, Stream, Timeline, read
from calib.report import Figure, Record, Report, run

__all__ = [
    "Axis",
    "AxisFit",
    "CalibError",
    "Center",
    "CenterFit",
    "Correction",
    "Figure",
    "FrameFit",
    "HandEyeFit",
    "Joint",
    "Model",
    "Motion",
    "NotObservable",
    "Outcome",
    "Plan",
    "Plugin",
    "Record",
    "Recording",
    "Report",
    "Simulated",
    "Stream",
    "Table",
    "Timeline",
    "Twin",
    "axis_estimator",
    "center_estimator",
    "fit_aor",
    "fit_cor",
    "fit_frame",
    "fit_handeye",
    "plan",
    "read",
    "reader",
    "run",
    "simulate",
    "twin",
]
