"""`calib.Model` over arrays: against the program, against differences, and its speed."""

import csv
import time
from pathlib import Path

import calib
import numpy as np
import pytest
import speed
from conftest import ARM, Program


def postures(model: calib.Model, n: int, seed: int = 1) -> np.ndarray:
    """Inside of what was fitted, where that is known."""
    ranges = np.array([j.fitted_range or (0.0, 0.0) for j in model.joints])
    return np.random.default_rng(seed).uniform(ranges[:, 0], ranges[:, 1], (n, model.dof))


def test_poses_are_those_of_the_program(
    model: calib.Model, justin: calib.Report, program: Program, tmp_path: Path
) -> None:
    q = postures(model, 20)
    table = tmp_path / "q.csv"
    header = ",".join(f"{j.name}_{'m' if j.prismatic else 'rad'}" for j in model.joints)
    np.savetxt(table, q, delimiter=",", header=header, comments="", fmt="%.17g")
    file = tmp_path / "justin.calibrated.model.json"
    file.write_bytes(justin.files[file.name])
    done = program("predict", file, table, "--of", model.tool, "--unordered")
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))

    def column(name: str) -> np.ndarray:
        return np.array([float(row[f"{model.tool}.{name}"]) for row in rows])

    theirs = np.stack([column(axis) for axis in ("x_m", "y_m", "z_m")], axis=1)
    ours = model.fk(q)
    # The table has nine decimals.
    assert np.abs(theirs - ours[:, :3, 3]).max() < 2e-9
    w, z = column("qw"), column("qz")
    assert np.abs(np.abs(4 * w * z) - np.abs(ours[:, 1, 0] - ours[:, 0, 1])).max() < 1e-7
    covariance = model.sigma(q)
    # Four digits, in the axes of the root.
    r = ours[:, :3, :3]
    turned = r @ covariance[:, 3:, 3:] @ r.transpose(0, 2, 1)
    for k, axis in enumerate("xyz"):
        stated = column(f"sigma_{axis}_m")
        assert (np.abs(stated - np.sqrt(turned[:, k, k])) < 1e-3 * stated).all()


def test_shapes_follow_the_postures(model: calib.Model) -> None:
    q = postures(model, 6)
    one, six, grid = model.fk(q[0]), model.fk(q), model.fk(q.reshape(2, 3, -1))
    assert one.shape == (4, 4) and six.shape == (6, 4, 4) and grid.shape == (2, 3, 4, 4)
    assert (six[0] == one).all() and (grid.reshape(6, 4, 4) == six).all()
    assert model.jacobian(q).shape == (6, 6, model.dof)
    assert model.sigma(q).shape == (6, 6, 6)
    assert model.in_scope(q).all() and not any(model.outside(q))
    assert model.fk(q[:0]).shape == (0, 4, 4)


def test_tracker_and_nominal_poses(model: calib.Model) -> None:
    q = postures(model, 3)
    in_root, in_tracker = model.fk(q), model.fk(q, frame="tracker")
    assert np.allclose(model.tracker_from_root @ in_root, in_tracker, atol=1e-14)
    apart = np.linalg.norm(in_root[:, :3, 3] - model.fk(q, nominal=True)[:, :3, 3], axis=1)
    assert (apart > 1e-4).all(), "a calibrated robot is not its nominal model"


def test_the_jacobian_is_the_slope(model: calib.Model) -> None:
    q, step = postures(model, 1)[0], 1e-5
    jacobian = model.jacobian(q)
    here = model.fk(q)
    for k in range(model.dof):
        there = model.fk(q + step * np.eye(model.dof)[k])
        back = model.fk(q - step * np.eye(model.dof)[k])
        change = np.linalg.inv(here) @ (there - back) / (2 * step)
        twist = [change[2, 1], change[0, 2], change[1, 0], *change[:3, 3]]
        assert np.abs(jacobian[:, k] - twist).max() < 1e-6


def test_covariances_are_symmetric_and_positive(model: calib.Model) -> None:
    c = model.sigma(postures(model, 5))
    assert (c == c.transpose(0, 2, 1)).all()
    assert (np.linalg.eigvalsh(c) > -1e-18).all()
    in_tracker = model.sigma(postures(model, 5), frame="tracker")
    assert not np.allclose(c, in_tracker)


def test_corrections_reach_the_nominal_pose_or_say_why_not(model: calib.Model) -> None:
    q = postures(model, 200)
    done = model.correct(q)
    bound = np.where([j.prismatic for j in model.joints], 0.05, 0.1)
    assert (np.abs(done.q - q) <= bound + 1e-12).all()
    reached = done.outcome == calib.Outcome.REACHED
    assert reached.any()
    wanted, real = model.fk(q, nominal=True), model.fk(done.q)
    error = np.linalg.norm(wanted[:, :3, 3] - real[:, :3, 3], axis=1)
    assert (error[reached] < 1e-8).all()
    refused = ~done.usable
    assert (done.q[refused] == q[refused]).all()
    np.testing.assert_allclose(error, done.after_m, atol=1e-12)


def test_inverse_kinematics_finds_back(model: calib.Model) -> None:
    q = postures(model, 50)
    done = model.ik(model.fk(q), q + 0.02)
    assert done.usable.mean() > 0.9
    reached = done.outcome <= calib.Outcome.OUT_OF_SCOPE
    assert (done.after_m[reached] < 1e-8).all()


def test_directions_of_approach_along_a_sequence() -> None:
    arm = calib.Model(ARM)
    q = np.array([[0.0, 0.0], [0.1, 0.0], [0.2, -0.1], [0.1, -0.1]])
    assert arm.approach(q).tolist() == [[0, 0], [1, 0], [1, -1], [-1, -1]]
    assert arm.fk(q, approach=arm.approach(q)).shape == (4, 4, 4)


def test_what_is_refused_says_where() -> None:
    arm = calib.Model(ARM)
    with pytest.raises(calib.CalibError, match=r"row 1: q\[0\] is not a finite number") as raised:
        arm.fk([[0.0, 0.0], [np.nan, 0.0]])
    assert (raised.value.id, raised.value.exit_code) == ("model", 2)
    with pytest.raises(calib.CalibError, match="q: found 3; expected … × 2"):
        arm.fk([0.0, 0.0, 0.0])
    with pytest.raises(calib.CalibError, match="found 2 × 2 × 2|link, body or point nowhere"):
        arm.fk([0.0, 0.0], "nowhere")
    with pytest.raises(calib.CalibError, match="cannot be read"):
        calib.Model("no/such.model.json")
    with pytest.raises(calib.CalibError, match="line 1, column"):
        calib.Model.from_json("{")


def test_beyond_the_limits() -> None:
    arm = calib.Model(ARM)
    assert not arm.in_scope([[0.0, 50.0]]).any()
    assert "elbow" in arm.outside([[0.0, 50.0]])[0]


def test_a_million_postures(capsys: pytest.CaptureFixture[str]) -> None:
    """One core; the limit is 1 s for seven joints. The time is printed; the test itself leaves room for a busy machine."""
    model = speed.seven_joints()
    q = postures(model, 1_000_000)
    times = []
    for _ in range(2):
        start = time.process_time()
        model.fk(q)
        times.append(time.process_time() - start)
    with capsys.disabled():
        print(f"\nfk of 1e6 postures of {model.name} ({model.dof} joints): {min(times):.2f} s")
    assert min(times) < 10.0
