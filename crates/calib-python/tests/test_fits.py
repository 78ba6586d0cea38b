"""`calib.fit_*`: the answers of the command, from arrays; truths that are known exactly."""

import json
from pathlib import Path

import calib
import numpy as np
import pytest
from conftest import Program


def rotations(n: int, seed: int) -> np.ndarray:
    """Random rotations, n × 3 × 3."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(n, 3, 3)))
    q *= np.sign(np.diagonal(r, axis1=1, axis2=2))[:, None, :]
    q[:, :, 0] *= np.linalg.det(q)[:, None]
    return q


def poses(rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """n × 4 × 4."""
    out = np.zeros((len(rotation), 4, 4))
    out[:, :3, :3], out[:, :3, 3], out[:, 3, 3] = rotation, translation, 1.0
    return out


CENTER = np.array([0.1, -0.2, 0.3])
BODY_POINT = np.array([0.02, 0.05, 0.11])


def about_a_center(n: int = 30) -> np.ndarray:
    """`tracker_from_body` of a body that keeps one point of it at the center."""
    r = rotations(n, 3)
    return poses(r, CENTER - r @ BODY_POINT)


def test_a_center_from_poses_and_from_markers(program: Program, tmp_path: Path) -> None:
    body = about_a_center()
    fit = calib.fit_cor(poses=body)
    assert fit.observable and fit.verdict == "ok" and fit.used > 0
    assert fit.center_m == pytest.approx(CENTER, abs=1e-9)
    markers = {
        name: (body @ np.array([*place, 1.0]))[:, :3]
        for name, place in {"a": (0, 0, 0), "b": (0.1, 0, 0), "c": (0, 0.08, 0.02)}.items()
    }
    noisy = {k: v + np.random.default_rng(5).normal(scale=1e-4, size=v.shape) for k, v in markers.items()}
    noisy["a"][4] = np.nan
    found = calib.fit_cor(noisy)
    assert found.center_m == pytest.approx(CENTER, abs=1e-3)
    # The same table by the command.
    table = tmp_path / "points.csv"
    header = ",".join(f"{name}.{axis}_m" for name in noisy for axis in "xyz")
    lines = [
        ",".join("" if np.isnan(x) else repr(float(x)) for v in noisy.values() for x in v[i])
        for i in range(len(body))
    ]
    table.write_text("\n".join([header, *lines]) + "\n")
    done = program("fit", "cor", table, "--json")
    assert done.returncode == 0, done.stderr
    of_command = json.loads(done.stdout)
    assert {k: v for k, v in of_command.items() if k != "rejected"} == {
        k: v for k, v in found.details.items() if k != "rejected"
    }


def test_an_axis_with_angles() -> None:
    angles = np.linspace(-0.8, 0.9, 40)
    c, s, o, i = np.cos(angles), np.sin(angles), np.zeros(40), np.ones(40)
    r = np.stack([c, -s, o, s, c, o, o, o, i], axis=1).reshape(-1, 3, 3)
    body = poses(r, r @ np.array([0.3, 0.1, 0.0]))
    fit = calib.fit_aor(poses=body, angles=angles)
    assert fit.observable
    assert fit.direction == pytest.approx([0, 0, 1], abs=1e-9)
    assert fit.covariance is not None and fit.covariance.shape == (6, 6)


def test_a_joint_frame() -> None:
    def about(axis: int, angle: np.ndarray) -> np.ndarray:
        out = np.tile(np.eye(3), (len(angle), 1, 1))
        i, k = [(1, 2), (2, 0), (0, 1)][axis]
        out[:, i, i], out[:, i, k] = np.cos(angle), -np.sin(angle)
        out[:, k, i], out[:, k, k] = np.sin(angle), np.cos(angle)
        return out

    grid = np.meshgrid(np.linspace(-0.7, 0.7, 8), np.linspace(-0.5, 0.6, 8), indexing="ij")
    pan, tilt = (angles.reshape(-1) for angles in grid)
    joint_from_body = rotations(1, 8)[0]
    r = about(2, pan) @ about(0, tilt) @ joint_from_body
    offset = np.array([0.05, 0.02, 0.1])
    moved = (about(2, pan) @ about(0, tilt)) @ offset
    fit = calib.fit_frame(poses(r, moved), pan, tilt, axes="zx")
    assert fit.observable and fit.body_from_joint is not None
    assert fit.body_from_joint[:3, :3] == pytest.approx(joint_from_body.T, abs=1e-7)
    assert fit.body_from_joint[:3, 3] == pytest.approx(-joint_from_body.T @ offset, abs=1e-7)
    with pytest.raises(calib.CalibError, match="axes: found zz9"):
        calib.fit_frame(poses(r, moved), pan, tilt, axes="zz9")


def test_hand_and_eye() -> None:
    x = poses(rotations(1, 11), np.array([[0.02, -0.01, 0.09]]))[0]
    z = poses(rotations(1, 12), np.array([[0.9, 0.2, -0.4]]))[0]
    flange = poses(rotations(25, 13), np.random.default_rng(14).uniform(-0.5, 0.5, (25, 3)))
    measured = np.linalg.inv(z) @ flange @ x
    fit = calib.fit_handeye(flange, measured)
    assert fit.observable and fit.certified
    assert fit.x == pytest.approx(x, abs=1e-8) and fit.z == pytest.approx(z, abs=1e-8)
    again = calib.fit_handeye(flange, np.linalg.inv(measured), inverted=True)
    assert again.x == pytest.approx(x, abs=1e-8)
    # Without rotation nothing ties the two.
    still = np.tile(flange[:1], (10, 1, 1))
    blind = calib.fit_handeye(still, np.linalg.inv(z) @ still @ x)
    assert not blind.observable and blind.reason and blind.x is None


def test_what_is_refused() -> None:
    with pytest.raises(calib.CalibError, match="points: found 5 × 2; expected n × 3"):
        calib.fit_cor(np.zeros((5, 2)))
    with pytest.raises(calib.CalibError, match="neither points nor poses"):
        calib.fit_cor()
    with pytest.raises(calib.CalibError, match="not a rotation"):
        calib.fit_cor(poses=np.ones((5, 4, 4)))
    with pytest.raises(calib.CalibError, match="there is no estimator `sphare`") as raised:
        calib.fit_cor(np.random.default_rng(1).normal(size=(9, 3)), estimator="sphare")
    assert raised.value.exit_code == 2
    still = calib.fit_cor(np.zeros((20, 3)))
    assert not still.observable and still.center_m is None and still.reason
    with pytest.raises(calib.CalibError, match="2 weights for 9 rows"):
        calib.fit_cor(np.random.default_rng(1).normal(size=(9, 3)), weights=[1.0, 2.0])
