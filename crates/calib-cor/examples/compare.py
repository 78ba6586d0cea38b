"""Times SciPy and scikit-surgerycalibration on the data that `speed.rs` wrote: `python compare.py <folder>`.

Least and median of 25 runs in microseconds, one thread. Needs numpy, scipy; scikit-surgerycalibration where installed.
"""

import os
import sys
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import numpy as np
from scipy.optimize import least_squares

try:
    from sksurgerycalibration.algorithms import pivot, sphere_fitting
except ImportError:
    pivot = sphere_fitting = None


def timed(what, run, repeats):
    times = []
    for _ in range(25):
        start = time.perf_counter()
        for _ in range(repeats):
            run()
        times.append((time.perf_counter() - start) / repeats * 1e6)
    times.sort()
    print(f"{what:<44} {times[0]:>12.2f} {times[12]:>12.2f}")


def sphere(points):
    start = np.append(points.mean(0), 0.1)

    def residual(x):
        return np.linalg.norm(points - x[:3], axis=1) - x[3]

    return least_squares(residual, start, method="lm").x


def hot_spot(rotations, translations):
    n = len(translations)
    a = np.concatenate([rotations, -np.broadcast_to(np.eye(3), (n, 3, 3))], 2).reshape(-1, 6)
    return np.linalg.lstsq(a, -translations.reshape(-1), rcond=None)[0]


def main(folder):
    print(f"{'':<44} {'least us':>12} {'median us':>12}")
    for n, repeats in ((36, 20), (1000, 5), (100000, 1)):
        table = np.loadtxt(os.path.join(folder, f"poses{n}.csv"), delimiter=",", skiprows=1)
        t, r = table[:, :3].copy(), table[:, 3:].reshape(-1, 3, 3).copy()
        timed(f"numpy lstsq, hot spot, n = {n}", lambda: hot_spot(r, t), repeats)
        timed(f"scipy least_squares lm, sphere, n = {n}", lambda: sphere(t), repeats)
        if pivot is None:
            continue
        m = np.zeros((n, 4, 4))
        m[:, :3, :3], m[:, :3, 3], m[:, 3, 3] = r, t, 1.0
        timed(f"scikit-surgerycalibration aos_pivot, n = {n}", lambda: pivot.pivot_calibration_aos(m), repeats)
        if n <= 1000:
            first = np.append(t.mean(0), 0.1)
            timed(
                f"scikit-surgerycalibration sphere, n = {n}",
                lambda: sphere_fitting.fit_sphere_least_squares(t, first),
                repeats,
            )


main(sys.argv[1])
