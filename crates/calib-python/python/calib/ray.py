"""Divides studies, batches and twins over the workers of a Ray cluster.

Each task runs one shard with the program ``calib``: ``--shard I/N``. A task whose worker is lost runs again, on another node if need be, and continues
with what the shard has finished. At the end the shards are merged, and the results are those of the command that was not divided, byte for byte.

The folder ``out`` must be on a disk that all nodes share and that knows file locks; with ``store``, the address of an object store, the nodes need no
common disk, only the files that the work reads at the same places. Ray itself is not installed with ``calib``: ``pip install ray``.

>>> import calib.ray
>>> calib.ray.words(trials=20, noise_times=1.5, jobs=None, force=True)
['--trials', '20', '--noise-times', '1.5', '--force']
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from calib._native import CalibError

__all__ = ["batch", "study", "twin", "words"]

Option = str | int | float | bool | os.PathLike[str] | None

# A second process makes the same shard, as one of a node that is only cut off: it is waited for.
_BUSY = 7
_WAIT_S = 5.0


def words(**options: Option) -> list[str]:
    """Options as the program takes them: ``noise_times=2`` is ``--noise-times 2``, ``True`` a flag; ``None`` and ``False`` are not given."""
    found: list[str] = []
    for name, value in options.items():
        if value is None or value is False:
            continue
        found.append("--" + name.replace("_", "-"))
        if value is not True:
            found.append(os.fspath(value) if isinstance(value, os.PathLike) else str(value))
    return found


def _program(given: str | os.PathLike[str] | None) -> list[str]:
    """The program that was named, that of ``CALIB``, that on the path, or that of this package."""
    named = os.fspath(given) if given is not None else os.environ.get("CALIB") or shutil.which("calib")
    return [named] if named else [sys.executable, "-m", "calib"]


def _run(command: Sequence[str], folder: str | None) -> str:
    """What the program prints.

    The program ends with the process that started it: a worker that is killed leaves none behind that holds the lock of its shard.
    """
    while True:
        ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, preexec_fn=_end_with_parent())
        if ran.returncode == 0:
            return ran.stdout
        if ran.returncode != _BUSY:
            raise CalibError(f"{' '.join(command)} ended with {ran.returncode}:\n{ran.stderr}")
        time.sleep(_WAIT_S)


def _end_with_parent() -> Any:
    if not sys.platform.startswith("linux"):
        return None
    import ctypes
    import signal

    prctl = ctypes.CDLL(None).prctl
    set_death_signal = 1
    return lambda: prctl(set_death_signal, signal.SIGKILL)


def _divided(
    command: Sequence[str],
    *,
    shards: int,
    out: str | os.PathLike[str],
    program: str | os.PathLike[str] | None,
    retries: int,
    store: str | None,
    threads: Literal["--threads", "--jobs"],
) -> Path:
    """Makes the shards of a command in tasks, merges them, and writes the results to ``out``."""
    try:
        import ray
        import ray.exceptions
    except ImportError as error:
        raise CalibError("calib.ray needs Ray\n  help: pip install ray") from error
    if shards < 1:
        raise CalibError(f"shards is {shards}, expected 1 or more")
    # Profiles are named as in the caller's folder.
    here, results = os.getcwd(), Path(out).absolute()
    calib = [*_program(program), *command]

    def shard(number: int) -> str:
        part = [*calib, "--shard", f"{number}/{shards}", threads, "1", "--quiet"]
        if store is None:
            return _run([*part, "--out", os.fspath(results)], here).strip()
        # A node without the caller's disk may lack the caller's folder as well.
        with tempfile.TemporaryDirectory(prefix="calib-") as own:
            return _run([*part, "--out", own, "--store", store], here if os.path.isdir(here) else None).strip()

    if not ray.is_initialized():
        ray.init()
    # One task holds one processor. A task whose worker is lost runs again; what the program refuses does not.
    task = ray.remote(num_cpus=1, max_retries=retries)(shard)
    try:
        files: list[str] = ray.get([task.remote(number) for number in range(1, shards + 1)])
    except ray.exceptions.RayTaskError as error:
        # Without the frames of Ray's own processes.
        raise CalibError(str(error.cause)) from error
    # Its bytes do not depend on the division; one that is there with other bytes is refused.
    merged = results / "merged.parquet"
    shards_of = files if store is None else ["--store", store]
    _run([*_program(program), "merge", *shards_of, "--out", os.fspath(merged), "--quiet"], here)
    _run([*calib, "--from", os.fspath(merged), "--out", os.fspath(results), "--quiet"], here)
    return results


def study(
    kind: Literal["cor", "aor", "faults", "justin", "ripley"],
    *,
    shards: int,
    out: str | os.PathLike[str],
    program: str | os.PathLike[str] | None = None,
    retries: int = 20,
    store: str | None = None,
    **options: Option,
) -> Path:
    """``calib study KIND`` in ``shards`` tasks; ``options`` are the command's, as ``trials=100``. Returns ``out``.

    ``program`` is the program on every node, else that of ``CALIB``, of the path, or of this package. ``retries``: how often a task is started again
    after its worker was lost. ``store``: the address of an object store, ``s3://BUCKET/PREFIX``, for shards of this work alone; a ``program`` other than
    that of this package must be built with the feature ``object-store``. Raises :class:`calib.CalibError` with what the program says.
    """
    command = ["study", kind, *words(**options)]
    return _divided(command, shards=shards, out=out, program=program, retries=retries, store=store, threads="--threads")


def batch(
    fleet: str | os.PathLike[str],
    *,
    shards: int,
    out: str | os.PathLike[str],
    program: str | os.PathLike[str] | None = None,
    retries: int = 20,
    store: str | None = None,
    **options: Option,
) -> Path:
    """``calib batch FLEET`` in ``shards`` tasks, as :func:`study`; ``fleet`` is a list of robots or a pattern of profiles."""
    command = ["batch", os.fspath(fleet), *words(**options)]
    return _divided(command, shards=shards, out=out, program=program, retries=retries, store=store, threads="--jobs")


def twin(
    profile: str | os.PathLike[str],
    *,
    shards: int,
    out: str | os.PathLike[str],
    program: str | os.PathLike[str] | None = None,
    retries: int = 20,
    store: str | None = None,
    **options: Option,
) -> Path:
    """``calib twin PROFILE`` in ``shards`` tasks, as :func:`study`. Trials with effects are made at the end, in the calling process."""
    command = ["twin", os.fspath(profile), *words(**options)]
    return _divided(command, shards=shards, out=out, program=program, retries=retries, store=store, threads="--threads")
