"""`calib.simulate`, `calib.plan` and `calib.twin`: the commands, from Python."""

import json
from pathlib import Path

import calib
import numpy as np
import pytest
from conftest import Program


def test_a_simulation_is_that_of_the_program(program: Program, tmp_path: Path) -> None:
    simulated = calib.simulate("robots/ripley.yaml", seed=5)
    done = program("simulate", "robots/ripley.yaml", "--seed", "5", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert simulated.truth == json.loads((tmp_path / "truth.json").read_text())
    for name, recording in simulated.recordings.items():
        files = [f for f in tmp_path.glob("*.csv") if f.stem == name]
        if not files:
            continue
        written = calib.read(files[0])
        for marker, stream in recording.markers.items():
            there = written.markers[marker].values
            # The table has micrometers.
            assert np.nanmax(np.abs(there - stream.values)) < 1e-6


def test_a_plan(program: Program, tmp_path: Path) -> None:
    stages: list[str] = []
    plan = calib.plan("robots/ripley.yaml", poses=8, candidates=256, progress=stages.append)
    assert plan.postures.shape[1] == plan.held_out.shape[1] == len(plan.joints)
    assert len(plan.postures) == 8 and "choose postures" in stages
    words = ["plan", "robots/ripley.yaml", "--poses", "8", "--candidates", "256"]
    done = program(*words, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    for name, content in plan.files.items():
        assert content == (tmp_path / name).read_bytes(), name
    with pytest.raises(calib.CalibError, match="goal: found tusk"):
        calib.plan("robots/ripley.yaml", goal="tusk")  # type: ignore[arg-type]


def test_a_twin() -> None:
    counted: list[tuple[int, int]] = []
    twin = calib.twin("robots/ripley.yaml", trials=2, progress=lambda *at: counted.append(at))
    assert twin.data.trials == 2 and twin.data.robot == "ripley"
    assert counted and max(done for done, _ in counted) <= counted[0][1]
    assert "<iframe" in twin._repr_html_()
