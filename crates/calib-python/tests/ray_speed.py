"""What a cluster costs: `study cor` in many tasks on two Ray nodes of one processor each, against two processes with one half each.

    CALIB=PROGRAM python crates/calib-python/tests/ray_speed.py --trials 1600 --shards 64

Both are timed on this machine, one after the other, with two cores and nothing else to do; both calculate the same cells. The start of the cluster
is not counted, that of each task and the merging at the end are.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import calib
import calib.ray
import ray
from ray.cluster_utils import Cluster


def halves(program: str, trials: int, out: Path) -> float:
    started = time.monotonic()
    command = [program, "study", "cor", "--trials", str(trials), "--seed", "1", "--threads", "1", "--quiet"]
    running = [subprocess.Popen([*command, "--shard", f"{half}/2", "--out", str(out)], stdout=subprocess.DEVNULL) for half in (1, 2)]
    if any(process.wait() != 0 for process in running):
        sys.exit("a half ended with an error")
    return time.monotonic() - started


def cluster(program: str, trials: int, shards: int, out: Path) -> float:
    os.environ.setdefault("PYTHONPATH", str(Path(calib.__file__).parents[1]))
    made: Any = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    made.add_node(num_cpus=1)
    ray.init(address=made.address, log_to_driver=False)
    # Nodes, their workers and the function are there before the clock runs.
    ray.get([ray.remote(num_cpus=1)(lambda: None).remote() for _ in range(4)])
    started = time.monotonic()
    calib.ray.study("cor", shards=shards, out=out, program=program, trials=trials, seed=1)
    elapsed = time.monotonic() - started
    ray.shutdown()
    made.shutdown()
    return elapsed


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--trials", type=int, default=1600)
    arguments.add_argument("--shards", type=int, default=64)
    options = arguments.parse_args()
    program = os.environ.get("CALIB", "calib")
    with tempfile.TemporaryDirectory() as folder:
        plain = halves(program, options.trials, Path(folder) / "halves")
        divided = cluster(program, options.trials, options.shards, Path(folder) / "ray")
    print(f"two processes {plain:.1f} s, Ray with {options.shards} tasks {divided:.1f} s: {plain / divided:.3f}")


if __name__ == "__main__":
    main()
