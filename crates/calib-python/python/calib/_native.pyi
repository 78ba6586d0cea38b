"""The native half of calib: plain values in and out. Use the package ``calib``."""

import os
from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "CalibError",
    "Model",
    "figures",
    "fit",
    "main",
    "plan",
    "read",
    "run",
    "simulate",
    "twin",
]

_Array = npt.NDArray[np.float64]
_Under = tuple[_Array | None, _Array | None, _Array | None]
_Path = str | os.PathLike[str]

class CalibError(Exception):
    """Something that calib refuses: the text is what the program prints after ``error:``."""

    exit_code: int
    """The program's exit code: 2 usage or profile, 3 data, 4 not observable, 5 not converged, 6 plugin, 7 not written."""
    id: str
    """Which kind of error; the words stay in later versions."""

@final
class Model:
    @staticmethod
    def load(path: _Path) -> Model: ...
    @staticmethod
    def from_json(bytes: bytes) -> Model: ...
    def facts(self) -> dict[str, Any]: ...
    def fk(
        self,
        q: _Array,
        of: str | None,
        how: tuple[bool, bool],
        under: _Under,
    ) -> _Array: ...
    def jacobian(
        self, q: _Array, link: str | None, under: _Under
    ) -> _Array: ...
    def sigma(
        self,
        q: _Array,
        of: str | None,
        in_tracker: bool,
        under: _Under,
    ) -> _Array: ...
    def correct(
        self,
        q: _Array,
        link: str | None,
        options: dict[str, Any],
        under: _Under,
    ) -> _Array: ...
    def ik(
        self,
        poses: _Array,
        seed: _Array,
        link: str | None,
        options: dict[str, Any],
        under: _Under,
    ) -> _Array: ...
    def scope(self, q: _Array) -> _Array: ...
    def approach(self, q: _Array, threshold: float | None) -> _Array: ...

def main(argv: Sequence[str]) -> int: ...
def read(path: _Path, format: str | None) -> dict[str, Any]: ...
def fit(kind: str, table: dict[str, Any], options: dict[str, Any]) -> bytes: ...
def run(
    profile: _Path,
    options: dict[str, Any],
    out: _Path | None,
    own: Sequence[Any],
    progress: Callable[[str], object] | None,
) -> tuple[int, dict[str, bytes]]: ...
def figures(report_json: bytes) -> list[tuple[str, str, str, str]]: ...
def simulate(profile: _Path, seed: int | None) -> tuple[dict[str, dict[str, Any]], str]: ...
def plan(
    profile: _Path,
    options: dict[str, Any],
    plugins: str,
    progress: Callable[[str], object] | None,
) -> tuple[bytes, dict[str, bytes]]: ...
def twin(
    of: _Path,
    options: dict[str, Any],
    truth: str | None,
    plugins: str,
    progress: Callable[[int, int], object] | None,
) -> dict[str, bytes]: ...
