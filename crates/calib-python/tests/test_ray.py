"""`calib.ray`: the options, and a cluster of two nodes on this machine, of which one is killed midway."""

import os
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import calib
import calib.ray
import pytest

STUDY = {"trials": 2, "seed": 1}
ARGUMENTS = ["study", "aor", "--trials", "2", "--seed", "1"]


def files(folder: Path) -> dict[str, bytes]:
    """What a command wrote, without the shards and what is kept to continue."""
    found = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    return {name: text for name, text in found.items() if not name.endswith((".parquet", ".jsonl"))}


def test_options_are_those_of_the_program() -> None:
    assert calib.ray.words(noise_times=2, force=True, restart=False, jobs=None) == ["--noise-times", "2", "--force"]
    assert calib.ray.words(earlier=Path("last")) == ["--earlier", "last"]


@pytest.fixture
def cluster() -> Iterator[Any]:
    ray = pytest.importorskip("ray", reason="no Ray (CALIB_RAY=1)")
    utils = pytest.importorskip("ray.cluster_utils")
    # Workers are found by the package's place, not by the folder of the tests.
    os.environ.setdefault("PYTHONPATH", str(Path(calib.__file__).parents[1]))
    made = utils.Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    made.add_node(num_cpus=1)
    ray.init(address=made.address, log_to_driver=False)
    yield made
    ray.shutdown()
    made.shutdown()


def test_a_node_that_is_killed_changes_nothing(cluster: Any, program: Any, tmp_path: Path) -> None:
    quiet = tmp_path / "quiet"
    assert program(*ARGUMENTS, "--out", quiet).returncode == 0
    out = tmp_path / "out"
    made: list[Path] = []
    named = os.environ.get("CALIB_PROGRAM")
    work = Thread(target=lambda: made.append(calib.ray.study("aor", shards=8, out=out, program=named, **STUDY)))
    work.start()
    # A shard of each node is finished, others are not.
    limit = time.monotonic() + 120
    while len(list(out.glob("*/*.parquet"))) < 2 and time.monotonic() < limit:
        time.sleep(0.02)
    finished = len(list(out.glob("*/*.parquet")))
    second = next(node for node in cluster.list_all_nodes() if node is not cluster.head_node)
    cluster.remove_node(second, allow_graceful=False)
    assert 2 <= finished < 8
    work.join(240)
    assert made == [out]
    assert files(out) == files(quiet)


def test_what_the_program_refuses_is_raised(cluster: Any, tmp_path: Path) -> None:
    with pytest.raises(calib.CalibError, match="no-such-option"):
        calib.ray.study("aor", shards=2, out=tmp_path, program=os.environ.get("CALIB_PROGRAM"), no_such_option=1)


def test_nodes_need_no_common_disk_with_a_store(cluster: Any, program: Any, tmp_path: Path) -> None:
    store = f"file://{tmp_path}/store"
    probe = program(*ARGUMENTS, "--shard", "1/1", "--out", tmp_path / "probe", "--store", f"{store}-probe")
    if "built without object stores" in probe.stderr:
        pytest.skip("the program was built without object stores")
    quiet, out = tmp_path / "quiet", tmp_path / "out"
    assert program(*ARGUMENTS, "--out", quiet).returncode == 0
    assert calib.ray.study("aor", shards=4, out=out, program=os.environ.get("CALIB_PROGRAM"), store=store, **STUDY) == out
    assert files(out) == files(quiet)
    # The shards are in the store, and nowhere else.
    assert not list(out.glob("*/*.parquet"))
    assert len(list((tmp_path / "store").glob("*.parquet"))) == 4
