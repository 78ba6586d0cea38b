"""How long a million postures take on one core: `python speed.py [MODEL.json]`; an arm with seven joints by default."""

import copy
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import calib
import numpy as np

N = 1_000_000
ARM = Path(__file__).resolve().parents[2] / "calib-model/tests/it/arm.model.json"


def seven_joints() -> calib.Model:
    """An arm of seven joints, each of which has all effects of both joints of the tests' small arm: compliance, eccentricity, backlash, …"""
    small: dict[str, Any] = json.loads(ARM.read_text())
    moved = [joint for joint in small["joints"] if joint["effects"]]
    effects = {effect["kind"]: effect for joint in moved for effect in joint["effects"]}
    effects = {kind: effect for kind, effect in effects.items() if effect["other"] is None}
    links, joints = [small["links"][0]], []
    for k in range(7):
        link = copy.deepcopy(small["links"][1])
        joint = copy.deepcopy(moved[0])
        link["name"] = f"link_{k}"
        joint.update(name=f"joint_{k}", parent=links[-1]["name"], child=link["name"])
        joint["axis"] = [0, 0, 1] if k % 2 == 0 else [0, 1, 0]
        joint["effects"] = list(effects.values())
        links.append(link)
        joints.append(joint)
    arm = {**small, "robot": "seven joints", "links": links, "joints": joints}
    arm.update(bodies={}, points={}, uncertainty=None)
    return calib.Model.from_json(json.dumps(arm))


def timed(what: str, n: int, call: Callable[[], object]) -> None:
    """The best of three, in seconds of one processor."""
    times = []
    for _ in range(3):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    print(f"{what:<10} {n:>9} postures {min(times):8.3f} s {min(times) / n * 1e6:8.3f} µs each")


def main(model: calib.Model) -> None:
    ranges = np.array([j.fitted_range or (0.0, 0.0) for j in model.joints])
    q = np.random.default_rng(1).uniform(ranges[:, 0], ranges[:, 1], (N, model.dof))
    print(f"{model.name}: {model.dof} joints, {len(model.links)} links, to {model.tool}")
    timed("fk", N, lambda: model.fk(q))
    few = q[: N // 10]
    timed("jacobian", len(few), lambda: model.jacobian(few))
    timed("correct", len(few), lambda: model.correct(few))
    few = q[: N // 100]
    if model.has_uncertainty:
        timed("sigma", len(few), lambda: model.sigma(few))


if __name__ == "__main__":
    main(calib.Model(sys.argv[1]) if len(sys.argv) > 1 else seven_joints())
