#!/usr/bin/env python3
"""Predicts body poses from `<robot>.calibrated.model.json`, without any package.

    predict.py MODEL.json TABLE.csv      compares with a table of 6-DoF bodies: rms distance in mm
    predict.py MODEL.json joint=deg …    prints where the bodies are, m in the tracker's frame

The equations are those at the top of crates/calib-model/src/file.rs. Joints are taken in the middle of their backlash, and
links at the reference temperature unless `temperature_c` (an argument, or a column) says how warm the robot is.
"""
import csv, json, math, sys


def add(a, b): return [x + y for x, y in zip(a, b)]
def sub(a, b): return [x - y for x, y in zip(a, b)]
def scale(s, a): return [s * x for x in a]
def dot(a, b): return sum(x * y for x, y in zip(a, b))
def cross(a, b): return [a[1]*b[2] - a[2]*b[1], a[2]*b[0] - a[0]*b[2], a[0]*b[1] - a[1]*b[0]]


def quat(vector):
    """Unit quaternion x, y, z, w of a rotation vector."""
    angle = math.sqrt(dot(vector, vector))
    half = 0.5 if angle < 1e-12 else math.sin(0.5 * angle) / angle
    return scale(half, vector) + [math.cos(0.5 * angle)]


def times(p, q):
    a, b = p[:3], q[:3]
    return add(add(scale(p[3], b), scale(q[3], a)), cross(a, b)) + [p[3] * q[3] - dot(a, b)]


def turn(q, v):
    t = scale(2, cross(q[:3], v))
    return add(v, add(scale(q[3], t), cross(q[:3], t)))


def inverse(q): return scale(-1, q[:3]) + [q[3]]


def compose(a, b):
    """Poses are (translation, quaternion): a_from_c = a_from_b * b_from_c."""
    return add(a[0], turn(a[1], b[0])), times(a[1], b[1])


def pose(p): return p["xyz_m"], p["quat_xyzw"]


def factor(effect, r, load, axis, reading, warmer):
    """F of equation (2): an effect moves the joint by its value times this."""
    kind, n = effect["kind"], effect.get("gear_ratio") or 1.0
    across = effect["about"] and dot(turn(inverse(quat(scale(r, axis))), load), effect["about"])
    simple = {"offset": 1.0, "gain": r, "compliance": dot(load, axis),
              "lateral_1": across, "lateral_2": across,
              "eccentricity_cos": math.cos(r) - 1, "eccentricity_sin": math.sin(r),
              "eccentricity_2_cos": math.cos(2*r) - 1, "eccentricity_2_sin": math.sin(2*r),
              "motor_eccentricity_cos": math.cos(n*r) - 1, "motor_eccentricity_sin": math.sin(n*r),
              "motor_eccentricity_2_cos": math.cos(2*n*r) - 1,
              "motor_eccentricity_2_sin": math.sin(2*n*r),
              "flank_backlash": math.copysign(1, dot(load, axis)) if abs(dot(load, axis)) > (effect.get("friction") or 1e-9) else 0.0,
              "backlash": 0.0, "friction": 0.0, "thermal_expansion": warmer}
    if kind.startswith("coupling"):
        return reading(effect["other"])
    return simple[kind]


def links(model, q):
    """root_from_link of every link; q in rad or m by joint name, absent joints at zero."""
    joints = {j["name"]: j for j in model["joints"]}
    reference = model.get("reference_temperature_c") or 20
    warmer = q.get("temperature_c", reference) - reference

    def reading(name):
        mimic = joints[name].get("mimic")
        return mimic["multiplier"] * q.get(mimic["joint"], 0) + mimic["offset"] if mimic else q.get(name, 0)

    def walk(loads):
        at = {model["root"]: ([0, 0, 0], [0, 0, 0, 1])}
        for j in model["joints"]:
            here = compose(at[j["parent"]], pose(j["parent_from_joint" if loads else "load_origin"]))
            axis = j.get("axis")
            if axis:
                r, theta, grown = reading(j["name"]), [0, 0, 0], [0, 0, 0]
                phi = r
                for e in j["effects"] if loads else []:
                    change = e["value"] * factor(e, r, loads[j["name"]], axis, reading, warmer)
                    if e["about"]:
                        theta = add(theta, scale(change, e["about"]))
                    elif e.get("along"):
                        grown = add(grown, scale(change, e["along"]))
                    else:
                        phi += change
                slides = j["motion"] == "prismatic"
                moved = (scale(phi, axis), [0, 0, 0, 1]) if slides else ([0, 0, 0], quat(scale(phi, axis)))
                here = compose(here, (grown, [0, 0, 0, 1]))
                here = compose(compose(here, moved), ([0, 0, 0], quat(theta)))
            at[j["child"]] = here
        return at

    nominal, loads = walk(None), {}
    for j in model["joints"]:
        carried = {j["child"]}
        for k in model["joints"]:           # parents come before their children
            if k["parent"] in carried:
                carried.add(k["child"])
        origin, rotation = compose(nominal[j["parent"]], pose(j["load_origin"]))
        load = [0, 0, 0]
        for link in model["links"]:
            if link["name"] in carried:
                at, r = nominal[link["name"]]
                moment = add(turn(r, link["first_moment_kg_m"]), scale(link["mass_kg"], sub(at, origin)))
                force = scale(link["mass_kg"], model["gravity_m_s2"])
                slides = j["motion"] == "prismatic"
                load = add(load, force if slides else cross(moment, model["gravity_m_s2"]))
        loads[j["name"]] = turn(inverse(rotation), load)
    return walk(loads)


def bodies(model, q):
    """tracker_from_body of every body."""
    at, base = links(model, q), pose(model["tracker_from_root"])
    return {name: compose(compose(base, at[b["link"]]), pose(b["link_from_body"]))
            for name, b in model["bodies"].items() if b["link_from_body"]}


def joints_of(row):
    """Columns `joint_deg` in rad, and how warm it is."""
    q = {k[:-4]: math.radians(float(v)) for k, v in row.items() if k.endswith("_deg")}
    return q | {k: float(row[k]) for k in ["temperature_c"] if row.get(k)}


def main(model_file, *rest):
    model = json.load(open(model_file))
    if rest[0].endswith(".csv"):
        lines = (line for line in open(rest[0]) if not line.startswith("#"))
        squares = []
        for row in csv.DictReader(lines):
            for name, (at, _) in bodies(model, joints_of(row)).items():
                seen = [row[f"{name}.{a}_m"] for a in "xyz"]
                if all(seen):
                    off = sub(at, [float(v) for v in seen])
                    squares.append(dot(off, off))
        print(f"{len(squares)} positions, rms {1e3 * math.sqrt(sum(squares) / len(squares)):.2f} mm")
    else:
        pairs = dict(pair.split("=") for pair in rest)
        q = joints_of({k if k == "temperature_c" else f"{k}_deg": v for k, v in pairs.items()})
        for name, (at, _) in bodies(model, q).items():
            print(name, " ".join(f"{v:.5f}" for v in at))


if __name__ == "__main__":
    main(*sys.argv[1:])
