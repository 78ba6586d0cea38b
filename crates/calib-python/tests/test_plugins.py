"""An estimator and a reader in Python that a profile names."""

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import calib
import numpy as np
import pytest


@calib.center_estimator("linear_spheres", shapes=["points", "markers"], version="1.0")
def linear_spheres(motion: calib.Motion, scale: float = 1.0) -> calib.Center | calib.NotObservable:
    """|p − c|² = r² as linear equations in c and r² − |c|², one radius for each marker."""
    assert motion.points_m is not None
    rows, right = [], []
    for k, track in enumerate(motion.points_m):
        seen = track[~np.isnan(track).any(axis=1)]
        radius = np.zeros((len(seen), len(motion.points_m)))
        radius[:, k] = 1.0
        rows.append(np.hstack([2 * seen, radius]))
        right.append((seen**2).sum(axis=1))
    a, b = np.vstack(rows), np.concatenate(right)
    found, _, rank, _ = np.linalg.lstsq(a, b, rcond=None)
    if rank < a.shape[1]:
        return calib.NotObservable("the points lie in a plane")
    # Half of the algebraic error over the radius is the distance from the sphere: of the order of the noise.
    rms = float(np.sqrt(((a @ found - b) ** 2).mean())) * scale
    return calib.Center(found[:3], rms_m=rms, used=motion.samples)


@calib.reader("columns_in_json", recognizes=lambda head: head.startswith(b'{"columns"'))
def columns_in_json(file_name: str, content: bytes) -> calib.Table:
    """Columns of calib's own table as JSON."""
    try:
        columns = json.loads(content)["columns"]
    except ValueError as error:
        raise ValueError(f"line 1: {error}") from error
    joints, markers = {}, {}
    for name, values in columns.items():
        numbers = np.array([np.nan if v == "" else float(v) for v in values])
        if name.endswith("_deg"):
            joints[name.removesuffix("_deg")] = np.radians(numbers)
        elif name.endswith(".x_m"):
            markers[name.removesuffix(".x_m")] = [numbers]
        elif name.endswith((".y_m", ".z_m")):
            markers[name.rpartition(".")[0]].append(numbers)
    points = {name: np.stack(axes, axis=1) for name, axes in markers.items()}
    return calib.Table(joints=joints, markers=points, notes=["columns were read from JSON"])


def in_json(table: Path, file: Path) -> None:
    """A table of calib as the JSON of the reader above."""
    lines = [line for line in table.read_text().splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    columns = {name: [row[name] for row in rows] for name in rows[0] if name != "pose"}
    file.write_text(json.dumps({"columns": columns}))


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    """Ripley, one of whose recordings is JSON."""
    shutil.copytree("robots/ripley", tmp_path / "ripley")
    in_json(tmp_path / "ripley/arm_poses.csv", tmp_path / "ripley/arm_poses.json")
    (tmp_path / "ripley/arm_poses.csv").unlink()
    text = Path("robots/ripley.yaml").read_text()
    text = text.replace("ripley/arm_poses.csv", "ripley/arm_poses.json")
    file = tmp_path / "ripley.yaml"
    file.write_text(text)
    return file


def components(report: calib.Report) -> dict[str, Any]:
    return {c.name: c for c in report.components}


def test_a_reader_that_recognizes_its_file(profile: Path, ripley: calib.Report) -> None:
    report = calib.run(profile, own=[columns_in_json])
    assert report.verdict == "accepted"
    values = {p.name: p.value for p in report.parameters}
    for p in ripley.parameters:
        assert values[p.name] == pytest.approx(p.value, abs=1e-9), p.name
    used = components(report)["columns_in_json"]
    assert used.kind == "calib.reader/1" and used.used_for == ["arm_poses"]
    assert used.plugin.name == __name__ and used.plugin.sha256 is None
    with pytest.raises(calib.CalibError):
        calib.run(profile)


def test_a_profile_that_names_both(profile: Path) -> None:
    text = profile.read_text().replace("center: sfe", "center: linear_spheres")
    text = text.replace(
        "file: ripley/arm_poses.json", "file: ripley/arm_poses.json, reader: columns_in_json"
    )
    profile.write_text(text)
    report = calib.run(profile, method="paper", own=[linear_spheres, columns_in_json])
    named = components(report)
    assert named["linear_spheres"].kind == "calib.cor/1"
    assert named["linear_spheres"].used_for == ["base"]
    assert named["columns_in_json"].used_for == ["arm_poses"]
    built_in = calib.run("robots/ripley.yaml", method="paper")

    def base(of: calib.Report) -> np.ndarray:
        found = [t for t in of.transforms if "translation_m" in t and "base" in t.name]
        return np.array(found[0].translation_m)

    apart = np.linalg.norm(base(report) - base(built_in))
    # Two estimators of one center: near, and not the same numbers.
    assert 0 < apart < 2e-3
    with pytest.raises(calib.CalibError, match="linear_spheres"):
        calib.run(profile)


def test_what_a_function_raises_stops_the_run(profile: Path) -> None:
    @calib.center_estimator("broken", shapes=["markers", "poses"])
    def broken(motion: calib.Motion) -> calib.Center:
        raise ZeroDivisionError("nothing to divide by")

    @calib.center_estimator("beside", shapes=["markers"])
    def beside(motion: calib.Motion) -> calib.Center:
        return calib.Center([np.nan, 0.0, 0.0], rms_m=0.0, used=1)

    text = profile.read_text()
    for own, said in [(broken, "ZeroDivisionError: nothing to divide by"), (beside, r"center_m\[0\] is NaN")]:
        profile.write_text(text.replace("center: sfe", f"center: {own.name}"))
        with pytest.raises(calib.CalibError, match=said) as raised:
            calib.run(profile, method="paper", own=[columns_in_json, own])
        assert raised.value.exit_code == 6
    with pytest.raises(calib.CalibError, match="sfe"):
        taken = calib.center_estimator("sfe", shapes=["markers"])(broken.function)
        calib.run("robots/ripley.yaml", own=[taken])


def test_what_is_not_observable_is_an_answer(profile: Path) -> None:
    @calib.center_estimator("unsure", shapes=["markers"])
    def unsure(motion: calib.Motion) -> calib.NotObservable:
        return calib.NotObservable("nobody knows")

    profile.write_text(profile.read_text().replace("center: sfe", "center: unsure"))
    report = calib.run(profile, method="paper", own=[columns_in_json, unsure])
    assert "nobody knows" in report.json


def test_a_file_that_the_reader_refuses(profile: Path) -> None:
    (profile.parent / "ripley/arm_poses.json").write_text('{"columns": ')
    with pytest.raises(calib.CalibError, match="line 1: Expecting value"):
        calib.run(profile, own=[columns_in_json])


def test_parameters_need_defaults() -> None:
    with pytest.raises(calib.CalibError, match="parameter gate needs a default"):

        @calib.axis_estimator("gated", shapes=["poses"])
        def gated(motion: calib.Motion, gate: float) -> calib.Axis:
            return calib.Axis([0, 0, 0], [0, 0, 1], rms_m=0.0, used=0)


def test_an_axis_estimator_with_parameters(profile: Path) -> None:
    seen: list[tuple[str, float]] = []

    @calib.axis_estimator("by_rotations", shapes=["poses"])
    def by_rotations(motion: calib.Motion, least_deg: float = 5.0) -> calib.Axis:
        assert motion.rotations is not None and motion.translations_m is not None
        seen.append((motion.shape, least_deg))
        r = motion.rotations[0]
        r = r[~np.isnan(r).any(axis=(1, 2))]
        # Axes of rotations from the first pose: rows of one direction.
        change = r @ r[0].T
        skew = change - change.transpose(0, 2, 1)
        _, _, v = np.linalg.svd(np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1))
        return calib.Axis(np.nanmean(motion.translations_m[0], axis=0), v[0], rms_m=0.0, used=len(r))

    text = profile.read_text().replace(
        "    axes: {x: wrist_roll}\n",
        "    axes: {x: wrist_roll}\n    axis: by_rotations\n    axis_parameters: {least_deg: 7.5}\n",
    )
    profile.write_text(text)
    report = calib.run(profile, method="paper", own=[columns_in_json, by_rotations])
    assert seen and seen[0] == ("poses", 7.5)
    assert components(report)["by_rotations"].used_for == ["endJ"]
