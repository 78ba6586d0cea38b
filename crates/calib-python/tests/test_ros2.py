"""The part of the ROS 2 example that needs no ROS; the rest is compiled."""

import importlib.util
import py_compile
import sys
from types import ModuleType

import calib
import numpy as np
from conftest import ARM, ROOT

EXAMPLE = ROOT / "examples/ros2"


def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("corrected_frames", EXAMPLE / "corrected_frames.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_frames_are_those_of_the_model() -> None:
    example, model = load(), calib.Model(ARM)
    q = example.positions(model, ["gripper", "elbow", "shoulder"], [9.0, -0.5, 0.3])
    assert q.tolist() == [0.3, -0.5]
    assert example.positions(model, ["elbow"], [0.0]) is None
    found = example.frame(model, q, "tool", model.approach([q])[-1])
    pose = model.fk(q, "tool")
    assert np.allclose(found.translation_m, pose[:3, 3])
    x, y, z, w = found.rotation_xyzw
    v = np.array([x, y, z])
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    r = np.eye(3) * (w * w - v @ v) + 2 * np.outer(v, v) + 2 * w * skew
    assert np.abs(r - pose[:3, :3]).max() < 1e-12
    covariance = np.reshape(found.covariance, (6, 6))
    own = model.sigma(q, "tool")
    assert np.isclose(np.trace(covariance[:3, :3]), np.trace(own[3:, 3:]))
    assert np.allclose(covariance[:3, :3], pose[:3, :3] @ own[3:, 3:] @ pose[:3, :3].T)


def test_quaternions_of_half_turns() -> None:
    example = load()
    for axis in range(3):
        r = -np.eye(3)
        r[axis, axis] = 1.0
        q = np.array(example.quaternion_xyzw(r))
        assert np.isclose(abs(q[axis]), 1.0) and np.isclose(np.linalg.norm(q), 1.0)


def test_node_and_launch_file_compile(tmp_path: object) -> None:
    for name in ("corrected_frames.py", "corrected_frames.launch.py"):
        py_compile.compile(str(EXAMPLE / name), cfile=f"{tmp_path}/{name}c", doraise=True)
