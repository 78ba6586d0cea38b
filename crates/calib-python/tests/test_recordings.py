"""`calib.read`: arrays of what the readers read."""

from pathlib import Path

import calib
import numpy as np
import pytest


def test_streams_of_a_table(tmp_path: Path) -> None:
    file = tmp_path / "poses.csv"
    file.write_text("elbow_deg,slide_mm,tip.x_mm,tip.y_mm,tip.z_mm\n90,10,100,200,300\n45,,,,\n")
    recording = calib.read(file)
    assert recording.joints["elbow"].unit == "rad" and recording.joints["slide"].unit == "m"
    assert recording.joints["elbow"].values == pytest.approx(np.radians([90, 45]))
    tip = recording.markers["tip"]
    assert tip.values[0] == pytest.approx([0.1, 0.2, 0.3])
    assert tip.seen.tolist() == [True, False] and np.isnan(tip.values[1]).all()
    assert tip.timeline is recording.timelines[0] and tip.timeline.t is None
    assert len(tip.timeline.rows) == 2
    with pytest.raises(ValueError, match="read-only"):
        tip.values[0, 0] = 1.0
    assert repr(recording).endswith("2 joints, 1 markers; 2 rows)")


def test_bodies_are_rigid_motions() -> None:
    recording = calib.read("robots/justin/arm_poses.csv")
    for body in recording.bodies.values():
        seen = body.values[body.seen]
        r = seen[:, :3, :3]
        assert np.abs(r @ r.transpose(0, 2, 1) - np.eye(3)).max() < 1e-12
        assert (seen[:, 3] == [0, 0, 0, 1]).all()


def test_errors_name_file_and_line(tmp_path: Path) -> None:
    file = tmp_path / "poses.csv"
    file.write_text("elbow_deg,tip.x_mm,tip.y_mm,tip.z_mm\n90,100,200,300\n45,1,zwei,3\n")
    with pytest.raises(calib.CalibError, match="poses.csv.*line 3|poses.csv:3") as raised:
        calib.read(file)
    assert raised.value.exit_code == 3
