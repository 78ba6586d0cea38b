"""The examples in the package's documentation."""

import doctest
import importlib
import pkgutil
from pathlib import Path

import calib
import pytest
from conftest import ARM, ROOT

MODULES = ["calib", *(f"calib.{m.name}" for m in pkgutil.iter_modules(calib.__path__))]


@pytest.mark.parametrize("name", [m for m in MODULES if not m.endswith(("_native", "__main__"))])
def test_examples(name: str, tmp_path: Path) -> None:
    poses = tmp_path / "poses.csv"
    poses.write_text("elbow_deg,tip.x_mm,tip.y_mm,tip.z_mm\n90,100,200,300\n45,,,\n")
    names = {
        "arm_file": ARM,
        "poses_file": poses,
        "profile_file": ROOT / "robots/ripley.yaml",
    }
    result = doctest.testmod(
        importlib.import_module(name), extraglobs=names, optionflags=doctest.NORMALIZE_WHITESPACE
    )
    assert result.failed == 0


def test_most_modules_have_examples() -> None:
    finder = doctest.DocTestFinder()
    tried = [t for m in ("model", "fits", "plugins", "recordings", "report", "jobs") for t in finder.find(importlib.import_module(f"calib.{m}")) if t.examples]
    assert len(tried) >= 10
