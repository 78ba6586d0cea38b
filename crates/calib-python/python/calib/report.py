"""``calib.run``: from recordings to a report, as the command ``calib run``."""

import csv
import html
import io
import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from calib import _native
from calib._arrays import given, refused
from calib.plugins import Plugin

if TYPE_CHECKING:
    import pandas
    import polars

Table = Literal["parameters", "residuals", "held_out"]
Plugins = Literal["refused", "placed", "allowed"]


class Record(dict[str, Any]):
    """An object of ``report.json``: a dictionary whose keys are attributes as well."""

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"there is no {name}; there are {', '.join(self)}") from None

    def __dir__(self) -> Iterator[str]:
        yield from super().__dir__()
        yield from self


@dataclass(frozen=True)
class Figure:
    """A figure of the report's page; a notebook shows it."""

    title: str
    description: str
    """What it shows and how to read it."""
    svg: str
    """A file of its own."""

    def _repr_svg_(self) -> str:
        return self.svg


class Report:
    """What a run found: the keys of ``report.json`` as attributes, and every file that the run writes.

    ``report.verdict``, ``report.transforms``, ``report.verification.held_out.calibrated.rms_m``: SI, as
    `the schema of the report` (``calib schema report``) describes them.
    """

    def __init__(self, files: dict[str, bytes], exit_code: int) -> None:
        self.files = files
        """Every file of the results by its name."""
        self.exit_code = exit_code
        """How the program would end: 0 accepted, 1 not accepted, 4 not observable, 5 not converged."""
        self.json = files["report.json"].decode()
        """``report.json``, byte for byte what the program writes."""
        self.data: Record = json.loads(self.json, object_hook=Record)
        """The same as dictionaries and lists."""

    def __getattr__(self, name: str) -> Any:
        if name == "data":
            raise AttributeError(name)
        return getattr(self.data, name)

    def __dir__(self) -> Iterator[str]:
        yield from super().__dir__()
        yield from self.data

    def __repr__(self) -> str:
        return f"Report({self.data.robot!r}: {self.data.verdict})"

    def _repr_html_(self) -> str:
        """The report's page, in a frame of its own."""
        page = html.escape(self.files["report.html"].decode(), quote=True)
        return f'<iframe srcdoc="{page}" style="width:100%;height:40em;border:1px solid"></iframe>'

    @property
    def figures(self) -> dict[str, Figure]:
        """The figures of the report's page by their ids."""
        drawn = _native.figures(self.files["report.json"])
        return {name: Figure(title, text, svg) for name, title, text, svg in drawn}

    def rows(self, table: Table) -> list[dict[str, Any]]:
        """A table as a list of rows: ``parameters``, ``residuals`` (of the fit, by sample) or ``held_out`` (errors at poses not fitted)."""
        if table == "parameters":
            return [dict(row) for row in self.data.parameters]
        if table == "residuals":
            text = self.files["residuals.csv"].decode() if "residuals.csv" in self.files else ""
            return [
                {key: _cell(key, value) for key, value in row.items()}
                for row in csv.DictReader(io.StringIO(text))
            ]
        if table == "held_out":
            held_out = self.data.verification.held_out
            return [_flat(pose) for pose in held_out.poses] if held_out else []
        raise refused(f"table: found {table}; expected parameters, residuals or held_out")

    def to_pandas(self, table: Table = "parameters") -> "pandas.DataFrame":
        """A table as a ``pandas.DataFrame``; pandas is not installed with this package."""
        import pandas

        return pandas.DataFrame(self.rows(table))

    def to_polars(self, table: Table = "parameters") -> "polars.DataFrame":
        """A table as a ``polars.DataFrame``; polars is not installed with this package."""
        import polars

        return polars.DataFrame(self.rows(table), infer_schema_length=None)


_TEXTS = ("recording", "subject")


def _cell(key: str, value: str) -> object:
    """A cell of ``residuals.csv``: names are texts, ``used`` is yes or no, everything else a number or empty."""
    if key in _TEXTS:
        return value
    if value in ("true", "false"):
        return value == "true"
    if not value:
        return None
    return int(value) if key == "row" else float(value)


def _flat(pose: dict[str, Any]) -> dict[str, Any]:
    """A held-out pose as one row: a column for each joint and each component."""
    row: dict[str, Any] = {}
    for key, value in pose.items():
        if key == "joints":
            row.update({f"{j['joint']}_{j['unit']}": j["value"] for j in value})
        elif key == "vector_m":
            x, y, z = value if value is not None else (None, None, None)
            row.update({"x_m": x, "y_m": y, "z_m": z})
        else:
            row[key] = value
    return row


def run(
    profile: str | os.PathLike[str],
    *,
    method: Literal["paper", "ml"] | None = None,
    force: bool = False,
    strict: bool = False,
    select: bool = False,
    plugins: Plugins = "placed",
    own: Sequence[Plugin] = (),
    out: str | os.PathLike[str] | None = None,
    progress: Callable[[str], object] | None = None,
) -> Report:
    """Calibrates a robot from the recordings that its profile names.

    The options are those of ``calib run``: ``method`` instead of the profile's, ``force`` to continue although the data checks found
    errors, ``strict`` to end with 1 where the verdict has warnings, ``select`` to choose by cross-validation what is freed, ``plugins``
    that may be loaded. Files are written where ``out`` names a folder, and are in :attr:`Report.files` in any case. ``own``: estimators and
    readers written in Python (:mod:`calib.plugins`), which the profile names like any others. ``progress(stage)`` is called as each stage
    begins; an exception in it stops the run, as Ctrl-C does.

    >>> report = run(profile_file)
    >>> report.verdict
    'accepted'
    """
    options = given(method=method, force=force, strict=strict, select=select, plugins=plugins)
    exit_code, files = _native.run(profile, options, out, list(own), progress)
    return Report(files, exit_code)
