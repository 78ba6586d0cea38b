#!/usr/bin/env python3
"""Makes a fleet of small simulated arms, recorded twice, and checks what `calib batch` says of it.

    simulate.py make FOLDER --robots 10000     FOLDER/old and FOLDER/now; the elbow of 1 % of the robots moved in between
    calib batch 'FOLDER/old/*/r.yaml' --out FOLDER/last
    calib batch 'FOLDER/now/*/r.yaml' --earlier FOLDER/last --out FOLDER/tonight
    simulate.py check FOLDER                   planted changes that were found, and false alarms

The program is the one that CALIB names, or `calib` on the path.
"""

import argparse
import concurrent.futures
import json
import math
import os
import pathlib
import random
import subprocess
import sys

JOINTS = [
    ("base", "0 0 0.2", "0 0 1"),
    ("shoulder", "0.05 0 0.1", "0 1 0"),
    ("elbow", "0.3 0 0", "0 1 0"),
    ("wrist", "0.25 0 0.02", "1 0 0"),
]
ELBOW = 2
# Offsets of the joints of each robot, uniform up to this; the change that is planted in the elbow.
SPREAD_DEG = 0.2
DRIFT_DEG = 0.3
SECTION = """simulate:
  seed: 1
  tracker_from_root: {xyz_mm: [900, 300, 700], rpy_deg: [2, 5, 30]}
  mounts:
    foot: {xyz_mm: [-80, 60, 20]}
    tool: {xyz_mm: [20, 0, 30], rpy_deg: [0, 0, 90]}
  noise: {body_mm: 0.1, body_deg: 0.02}
  recordings:
    holds: {random: RANGES, poses: 15}
    checks: {random: RANGES, poses: 5}
""".replace(
    "RANGES", "{base_deg: [-150, 150], shoulder_deg: [-80, 80], elbow_deg: [-120, 120], wrist_deg: [-150, 150]}"
)


def urdf(offsets_deg):
    text = '<robot name="arm">\n<link name="l0"/>\n'
    for i, ((name, xyz, axis), offset) in enumerate(zip(JOINTS, offsets_deg)):
        rpy = " ".join(repr(float(a) * math.radians(offset)) for a in axis.split())
        text += (
            f'<link name="l{i + 1}"/>\n<joint name="{name}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
            '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>\n'
        )
    return text + "</robot>\n"


def profile(file, section=""):
    return f"""calib: 1
robot: {{name: arm, urdf: {file}}}
tracker: {{frame: hall, body_sigma_mm: 0.1, body_sigma_deg: 0.02}}
bodies:
  foot: {{link: l0, pose: true, mount: {{xyz_mm: [-80, 60, 20]}}}}
  tool: {{link: l4, pose: true, mount: {{xyz_mm: [20, 0, 30], rpy_deg: [0, 0, 90]}}}}
recordings:
  holds: {{file: holds.csv, use: static}}
  checks: {{file: checks.csv, use: validation}}
solve: {{free: [bodies, tracker, joint_offsets], noise: {{model: white}}, limits: {{held_out_rms_mm: 1}}}}
outputs: {{urdf: arm.calibrated.urdf}}
{section}"""


def drifted(k):
    return k % 100 == 42


def robot(folder, k):
    """Two visits of one robot: the same offsets but for the planted change, and other noise."""
    chance = random.Random(k)
    offsets = [chance.uniform(-SPREAD_DEG, SPREAD_DEG) for _ in JOINTS]
    for place, visit in enumerate(["old", "now"]):
        if visit == "now" and drifted(k):
            offsets[ELBOW] += DRIFT_DEG
        at = folder / visit / f"r{k:05}"
        at.mkdir(parents=True, exist_ok=True)
        (at / "true.urdf").write_text(urdf(offsets))
        (at / "true.yaml").write_text(profile("true.urdf", SECTION))
        program = os.environ.get("CALIB", "calib")
        seed = str(2 * k + place)
        subprocess.run(
            [program, "simulate", str(at / "true.yaml"), "--seed", seed, "--out", str(at), "--quiet"],
            check=True,
            stdout=subprocess.DEVNULL,
            env={**os.environ, "RAYON_NUM_THREADS": "1"},
        )
        (at / "arm.urdf").write_text(urdf([0.0] * len(JOINTS)))
        (at / "r.yaml").write_text(profile("arm.urdf"))


def make(folder, robots):
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for _ in pool.map(lambda k: robot(folder, k), range(robots)):
            pass


def check(folder):
    summary = json.loads((folder / "tonight" / "fleet.json").read_text())
    robots = summary["robots"]
    planted = {f"r{k:05}" for k in range(robots) if drifted(k)}
    alarms = summary["drift"]["alarms"]
    familywise = [alarm for alarm in alarms if alarm["familywise"]]

    def count(of, where):
        return sum((alarm["name"] in planted) == where for alarm in of)

    print(f"{robots} robots, {summary['drift']['compared']} compared, changed in {len(planted)}")
    print(f"at 1 % for each robot: {count(alarms, True)} found, {count(alarms, False)} false alarms")
    print(f"at 1 % for the fleet: {count(familywise, True)} found, {count(familywise, False)} false alarms")
    size = (folder / "tonight" / "fleet.html").stat().st_size
    print(f"fleet.html: {size / 1e6:.2f} MB compared, {(folder / 'last' / 'fleet.html').stat().st_size / 1e6:.2f} MB not compared")
    # More than four standard deviations above 1 %: the stated rate is not kept.
    unchanged = robots - len(planted)
    most = 0.01 * unchanged + 4 * math.sqrt(0.01 * unchanged) + 1
    kept = count(alarms, False) <= most and count(familywise, False) == 0 and count(familywise, True) == len(planted)
    return 0 if kept else 1


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("what", choices=["make", "check"])
    arguments.add_argument("folder", type=pathlib.Path)
    arguments.add_argument("--robots", type=int, default=10000)
    options = arguments.parse_args()
    if options.what == "check":
        return check(options.folder)
    make(options.folder, options.robots)
    return 0


if __name__ == "__main__":
    sys.exit(main())
