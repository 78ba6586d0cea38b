"""What the tests share: the shipped robots, a small arm, and the program to compare with."""

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import calib
import pytest

ROOT = Path(__file__).resolve().parents[3]
ARM = ROOT / "crates/calib-model/tests/it/arm.model.json"

Program = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def program() -> Program:
    """Runs the program `calib` in the repository: the one that `CALIB_PROGRAM` names, else that of the package. Its messages are not wrapped."""
    named = os.environ.get("CALIB_PROGRAM")
    command = [named] if named else [sys.executable, "-m", "calib"]
    unbound = {name: value for name, value in os.environ.items() if name != "COLUMNS"}

    def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
        words: Sequence[str] = [*command, *map(str, arguments)]
        return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False, env=unbound)

    return run


@pytest.fixture(autouse=True)
def in_repository(monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths of profiles are relative to the repository, in the tests as in the book."""
    monkeypatch.chdir(ROOT)


@pytest.fixture(scope="session")
def justin(tmp_path_factory: pytest.TempPathFactory) -> calib.Report:
    """One run of the shipped robot with 7 joints to a hand."""
    os.chdir(ROOT)
    return calib.run("robots/justin.yaml", out=tmp_path_factory.mktemp("justin"))


@pytest.fixture(scope="session")
def ripley() -> calib.Report:
    """One run of the shipped arm with markers; nothing is written."""
    os.chdir(ROOT)
    return calib.run("robots/ripley.yaml")


@pytest.fixture(scope="session")
def model(justin: calib.Report) -> calib.Model:
    """The calibrated model of Justin."""
    return calib.Model.from_json(justin.files["justin.calibrated.model.json"])
