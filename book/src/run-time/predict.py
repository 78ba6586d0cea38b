#!/usr/bin/env python3
"""Predicts bodies and markers from `<robot>.calibrated.model.json`, without any package.

    predict.py MODEL.json TABLE.csv      compares with a table of calib's CSV: rms distance in mm
    predict.py MODEL.json joint=deg …    prints where bodies and markers are, m in the tracker's frame

The table has a column for each joint (`elbow_deg`) and three for each marker or 6-DoF body (`grip_1.x_m` …), named as
in the profile. An argument of a sliding joint is in m.

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


def places(model, q):
    """Origins of all bodies, then all markers, by the name of their columns; m in the tracker's frame."""
    at, base, found = links(model, q), pose(model["tracker_from_root"]), {}
    for name, b in model["bodies"].items():
        link = compose(base, at[b["link"]])
        if b["link_from_body"]:
            found[name] = compose(link, pose(b["link_from_body"]))[0]
        for marker, p in b["markers_m"].items():
            found[marker] = add(link[0], turn(link[1], p))
    return found


ANGLES = {"_deg": math.radians(1), "_rad": 1.0}
LENGTHS = {"_m": 1.0, "_cm": 1e-2, "_mm": 1e-3}


def number(row, name, units):
    """A cell in rad or m; None where there is no such column, or no number in it."""
    for unit, one in units.items():
        cell = (row.get(name + unit) or "").strip()
        if cell and not math.isnan(float(cell)):
            return one * float(cell)


def joints_of(model, row):
    """Joint positions in rad or m, and how warm the robot is."""
    moving = {j["name"]: LENGTHS if j["motion"] == "prismatic" else ANGLES
              for j in model["joints"] if j.get("axis") and not j.get("mimic")}
    q = {name: number(row, name, units) for name, units in moving.items()}
    return q | {"temperature_c": number(row, "temperature_c", {"": 1.0})}


def compare(model, table):
    with open(table, encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    rows = [{(k or "").removeprefix("joint:"): v for k, v in row.items()} for row in rows]
    squares, absent = [], set()
    for row in rows:
        q = joints_of(model, row)
        absent |= {k for k, v in q.items() if v is None and k != "temperature_c"}
        for name, at in places(model, {k: v for k, v in q.items() if v is not None}).items():
            seen = [number(row, f"{name}.{a}", LENGTHS) for a in "xyz"]
            if None not in seen and any(seen):      # a lost marker is empty, NaN or at 0, 0, 0
                off = sub(at, seen)
                squares.append(dot(off, off))
    if not squares or absent == q.keys() - {"temperature_c"}:
        what = "joint of the model" if squares else "body or marker of the model, such as " + list(places(model, {}))[-1]
        sys.exit(f"{table}: no values of a {what}. The columns must be those of calib's CSV; `calib convert` writes it.")
    if absent:
        print("taken at 0 where there is no value:", ", ".join(sorted(absent)), file=sys.stderr)
    print(f"{len(squares)} positions, rms {1e3 * math.sqrt(sum(squares) / len(squares)):.2f} mm")


def main(model_file, *rest):
    with open(model_file, encoding="utf-8") as file:
        model = json.load(file)
    if model.get("calib_model") != 1:
        sys.exit(f"{model_file}: not a model file of version 1")
    if len(rest) == 1 and "=" not in rest[0]:
        return compare(model, rest[0])
    given = {name: float(value) for name, value in (pair.split("=") for pair in rest)}
    angles = {j["name"] for j in model["joints"] if j["motion"] == "revolute"}
    unknown = given.keys() - {j["name"] for j in model["joints"]} - {"temperature_c"}
    if unknown:
        sys.exit(f"not a joint of this robot: {', '.join(sorted(unknown))}")
    for name, at in places(model, {k: math.radians(v) if k in angles else v for k, v in given.items()}).items():
        print(name, " ".join(f"{v:.5f}" for v in at))


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
