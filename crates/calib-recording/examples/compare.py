"""Times polars, pandas, pyarrow and ezc3d on the files that the bench `reading` wrote: `python compare.py <folder>`.

Each reader opens each file four times, in turn with the others, from opening to the last sample; median and best in MB of the
file per second. A package that is not installed is named and left out. POLARS_MAX_THREADS sets the threads of polars.
"""

import importlib
import os
import shutil
import statistics
import sys
import tempfile
import time

RUNS = 4


def package(name):
    try:
        return importlib.import_module(name)
    except ImportError:
        project = name.split(".")[0]
        print(f"{project} is not installed: left out (pip install {project})", file=sys.stderr)
        return None


polars, pandas, csv, ezc3d = map(package, ("polars", "pandas", "pyarrow.csv", "ezc3d"))


def first_row(path):
    """Lines above the first one of numbers: comments, the export's own head, names, units."""
    with open(path, encoding="utf-8") as lines:
        for row, line in enumerate(lines):
            cells = line.strip().split(",")
            try:
                [float(cell) for cell in cells if cell]
            except ValueError:
                continue
            # Vicon writes the rate alone in a line.
            if len(cells) > 3:
                return row
    sys.exit(f"{path}: no row of numbers; write the files again with the bench `reading`")


def table_readers(path):
    skip = first_row(path)
    if polars is not None:
        yield f"polars {polars.__version__}", lambda: polars.read_csv(
            path, skip_lines=skip, has_header=False, infer_schema_length=100
        ).height
    if csv is not None:
        read = csv.ReadOptions(skip_rows=skip, autogenerate_column_names=True)
        version = importlib.import_module("pyarrow").__version__
        yield f"pyarrow {version}", lambda: csv.read_csv(path, read_options=read).num_rows
    if pandas is not None:
        yield f"pandas {pandas.__version__}, C parser", lambda: len(
            pandas.read_csv(path, skiprows=skip, header=None, engine="c")
        )


def c3d_readers(path):
    if ezc3d is None:
        return
    version = getattr(ezc3d, "__version__", "")
    yield f"ezc3d {version}", lambda: ezc3d.c3d(path)["data"]["points"].shape[2]


def timed(path, readers):
    megabytes = os.path.getsize(path) / 1e6
    rates = {name: [] for name, _ in readers}
    frames = {}
    for _ in range(RUNS):
        for name, read in readers:
            start = time.perf_counter()
            frames[name] = read()
            rates[name].append(megabytes / (time.perf_counter() - start))
    for name, _ in readers:
        median, best = statistics.median(rates[name]), max(rates[name])
        what = f"{os.path.basename(path)}, {name}"
        print(f"{what:<48} {frames[name]:>8} {megabytes:>8.1f} {median:>8.0f} {best:>8.0f}")


def main(folder):
    print(f"{'':<48} {'frames':>8} {'MB':>8} {'MB/s':>8} {'best':>8}")
    for name in ("canonical_csv", "nexus_csv", "c3d_float", "c3d_integer"):
        path = os.path.join(folder, name)
        if not os.path.exists(path):
            sys.exit(f"{path} is missing; write it: CALIB_BENCH_FILES={folder} cargo bench -p calib-recording --bench reading")
        if name.startswith("c3d"):
            with tempfile.TemporaryDirectory() as scratch:
                # ezc3d goes by the ending.
                ended = os.path.join(scratch, name + ".c3d")
                shutil.copyfile(path, ended)
                timed(ended, list(c3d_readers(ended)))
        else:
            timed(path, list(table_readers(path)))


if len(sys.argv) != 2:
    sys.exit(f"usage: {sys.argv[0]} <folder of the files that the bench wrote>")
main(sys.argv[1])
