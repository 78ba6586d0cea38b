"""The problem of benches/solve.rs in NumPy and SciPy: a 6R chain, 1 000 poses of four markers, 28 unknowns, noise 0.1 mm.

Vectorized over the poses, one thread: OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python3 chain.py
"""

import time

import numpy as np
from scipy.optimize import least_squares

POSES, MARKERS, SIGMA = 1000, 4, 1e-4
rng = np.random.default_rng(1)
# x, y, z, roll, pitch, yaw of the joints, and their axes: the robot of the benchmark.
JOINTS = [
    ([0.0, 0.0, 0.13, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
    ([0.02, 0.12, 0.05, 0.1, 0.0, 0.2], [0.0, 1.0, 0.0]),
    ([0.03, -0.1, 0.45, 0.0, 0.3, 0.0], [0.0, 1.0, 0.2]),
    ([0.05, 0.02, 0.40, 0.0, 0.0, 0.0], [1.0, 0.1, 0.0]),
    ([0.08, 0.05, 0.10, 0.2, 0.0, 0.0], [0.0, 0.0, 1.0]),
    ([0.02, 0.06, 0.09, 0.0, 0.0, 0.1], [0.0, 1.0, 0.0]),
]
AXES = np.array([axis / np.linalg.norm(axis) for _, axis in JOINTS])
STEPS = np.array([pose[:3] for pose, _ in JOINTS])
POINTS = rng.uniform(-0.05, 0.05, (MARKERS, 3))
LINES = {1: 0, 3: 1, 4: 2}  # joints whose origin is free as a line: two shifts and two turns
LINE_AXES = {1: [0.0, 1.0, 0.0], 3: [0.0, 0.0, 1.0], 4: [0.0, 1.0, 0.0]}
OFFSETS = [1, 2, 3, 4]


def skew(v):
    out = np.zeros(v.shape[:-1] + (3, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return out - np.swapaxes(out, -1, -2)


def exp(w):
    """Rotation of a rotation vector, and its left Jacobian."""
    t = np.linalg.norm(w)
    k = skew(w)
    if t < 1e-7:
        return np.eye(3) + k, np.eye(3) + k / 2
    s, c = np.sin(t), np.cos(t)
    return (
        np.eye(3) + s / t * k + (1 - c) / t**2 * k @ k,
        np.eye(3) + (1 - c) / t**2 * k + (t - s) / t**3 * k @ k,
    )


def about(axis, angles):
    """Rotations by many angles about one axis."""
    k = skew(axis)
    return np.eye(3) + np.sin(angles)[:, None, None] * k + (1 - np.cos(angles))[:, None, None] * (k @ k)


def turned(roll, pitch, yaw):
    x, y, z = np.eye(3)
    return exp(yaw * z)[0] @ exp(pitch * y)[0] @ exp(roll * x)[0]


TURNS = [turned(*pose[3:]) for pose, _ in JOINTS]


def across(axis):
    """Two directions across an axis, as columns."""
    u = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    return np.column_stack([u, np.cross(axis, u)])


BASES = {i: across(np.array(LINE_AXES[i])) for i in LINES}
q = rng.uniform(-1.4, 1.4, (POSES, 6))


def evaluate(x, jacobian=True):
    """Markers in all poses (poses, markers, 3), and their derivatives (poses, markers, 3, 28)."""
    world, mount, offsets, lines = x[:6], x[6:12], x[12:16], x[16:]
    rotation, left = exp(world[3:])
    a = np.broadcast_to(rotation, (POSES, 3, 3))
    at = np.broadcast_to(world[:3], (POSES, 3))
    # Each unknown: rotation in front of it, the origin of what it turns, the axis it turns about or shifts along.
    columns = [("turn", np.broadcast_to(left, (POSES, 3, 3)), at, [3, 4, 5]), ("shift", np.broadcast_to(np.eye(3), (POSES, 3, 3)), at, [0, 1, 2])]
    for i in range(6):
        at = at + a @ STEPS[i]
        a = a @ TURNS[i]
        if i in LINES:
            p = lines[4 * LINES[i] : 4 * LINES[i] + 4]
            basis, first = BASES[i], 16 + 4 * LINES[i]
            columns.append(("shift", a @ basis, at, [first, first + 1]))
            at = at + a @ (basis @ p[:2])
            turn, left = exp(basis @ p[2:])
            columns.append(("turn", a @ (left @ basis), at, [first + 2, first + 3]))
            a = a @ turn
        if i in OFFSETS:
            k = OFFSETS.index(i)
            columns.append(("turn", (a @ AXES[i])[:, :, None], at, [12 + k]))
            a = a @ about(AXES[i], q[:, i] + offsets[k])
        else:
            a = a @ about(AXES[i], q[:, i])
    columns.append(("shift", a, at, [6, 7, 8]))
    at = at + a @ mount[:3]
    turn, left = exp(mount[3:])
    columns.append(("turn", a @ left, at, [9, 10, 11]))
    a = a @ turn
    seen = at[:, None, :] + np.einsum("pij,mj->pmi", a, POINTS)
    if not jacobian:
        return seen, None
    out = np.zeros((POSES, MARKERS, 3, 28))
    for kind, axes, origin, numbers in columns:
        if kind == "shift":
            out[..., numbers] = axes[:, None]
        else:
            arm = seen - origin[:, None, :]
            out[..., numbers] = -np.einsum("pmij,pjk->pmik", skew(arm), axes)
    return seen, out.reshape(-1, 28)


truth = np.concatenate([rng.normal(0, 0.01, 12), rng.normal(0, 0.005, 4), rng.normal(0, 0.005, 12)])
measured = evaluate(truth, False)[0] + rng.normal(0, SIGMA, (POSES, MARKERS, 3))


def residuals(x):
    return ((evaluate(x, False)[0] - measured) / SIGMA).ravel()


def derivatives(x):
    return evaluate(x)[1] / SIGMA


# The derivatives are right, or their time says nothing.
start = np.zeros(28)
step = 1e-6 * rng.normal(size=28)
off = residuals(truth + step) - residuals(truth - step) - 2 * derivatives(truth) @ step
assert np.abs(off).max() < 1e-6 * np.abs(2 * derivatives(truth) @ step).max()


def best_of(runs, call):
    times = []
    for _ in range(runs):
        # Processor time: other programs on the machine do not count.
        begun = time.process_time()
        result = call()
        times.append(time.process_time() - begun)
    return min(times), result


for name, jac, runs in [("derivatives by hand", derivatives, 10), ("derivatives by differences", "2-point", 3)]:
    seconds, fit = best_of(runs, lambda: least_squares(residuals, start, jac, method="lm", xtol=1e-10, ftol=1e-10))
    rms = np.sqrt(2 * fit.cost / (fit.fun.size - 28))
    print(f"SciPy, {name}: {1e3 * seconds:.1f} ms, {fit.nfev} evaluations, residual {rms:.3f} sigma")


def gauss_newton():
    """Steps by the normal equations until a step is a millionth of the noise."""
    x, steps = start, 0
    while True:
        seen, jacobian = evaluate(x)
        jacobian, e = jacobian / SIGMA, ((seen - measured) / SIGMA).ravel()
        gradient = jacobian.T @ e
        step = np.linalg.solve(jacobian.T @ jacobian, -gradient)
        x, steps = x + step, steps + 1
        if -gradient @ step < 1e-6:
            return x, steps


seconds, (x, steps) = best_of(10, gauss_newton)
rms = np.sqrt((residuals(x) ** 2).sum() / (measured.size - 28))
print(f"NumPy, Gauss-Newton by hand: {1e3 * seconds:.1f} ms, {steps} linearizations, residual {rms:.3f} sigma")
