"""How the program's time and memory grow with each size of a calibration, and how they compare with another build:

    python growth.py FOLDER PROGRAM [OTHER] [--only NAME,...] [--runs N]

Robots, profiles and recordings (by `PROGRAM simulate`) go to FOLDER. Times are medians of N runs of which those of both programs take turns: processor
time, user and system, by which the exponent goes (the slope of log time over log size), and elapsed. The share of the other program is given of both. No
test reads what this prints.
"""

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

# Markers lie on a spiral on a ball of this radius, mm: no two rigid subsets of them are alike.
BALL_MM = 90.0


def markers(body: str, n: int) -> dict[str, list[float]]:
    """`n` markers of a body, mm."""
    found = {}
    for k in range(n):
        z = 1 - (2 * k + 1) / n
        turn, out = 2.399963 * k, math.sqrt(1 - z * z) * (1 + 0.13 * math.sin(3.7 * k))
        at = (out * math.cos(turn), out * math.sin(turn), z)
        found[f"{body}_m{k}"] = [round(BALL_MM * x, 3) for x in at]
    return found


@dataclass
class Scene:
    """A robot of serial limbs on one root, and what is recorded of it."""

    joints: int = 6
    limbs: int = 1
    # Fixed links in a row after each joint.
    fixed: int = 0
    # Markers of each body; 0 is a body measured as a pose.
    markers: int = 4
    poses: int = 100
    # The rows of `poses` in so many files.
    files: int = 1
    # The robot goes from pose to pose and is recorded all the time.
    stream: bool = False
    # Every row of a stream is taken as a pose, not only where the robot holds still.
    every_row: bool = False
    free: list[str] = field(default_factory=lambda: ["bodies", "tracker", "joint_offsets", "joint_axes"])

    def urdf(self) -> str:
        """Joints turn about z and y in turn, as of an arm whose links are 0.1 to 0.3 m long."""
        out = ['<robot name="grown">', '<link name="root"/>']

        def joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str) -> None:
            limits = '<limit lower="-3" upper="3" effort="50" velocity="2"/>' if axis else ""
            axis = f'<axis xyz="{axis}"/>' if axis else ""
            out.append(
                f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
                f'<origin xyz="{xyz}"/>{axis}{limits}</joint>'
            )
            out.append(
                f'<link name="{child}"><inertial><origin xyz="0.05 0 0.02"/><mass value="1"/>'
                '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            )

        for limb in range(self.limbs):
            parent = "root"
            for k in range(self.joints):
                xyz = f"0 {0.3 * limb:.2f} 0.2" if k == 0 else f"{0.1 + 0.2 * (k % 3 == 2):.2f} 0.01 0.08"
                axis = ("0 0 1", "0 1 0", "0 1 0", "1 0 0")[k % 4]
                joint(f"j{limb}_{k}", "revolute", parent, f"l{limb}_{k}", xyz, axis)
                parent = f"l{limb}_{k}"
                for f in range(self.fixed):
                    joint(f"f{limb}_{k}_{f}", "fixed", parent, f"l{limb}_{k}_{f}", "0.004 0.001 0.002", "")
                    parent = f"l{limb}_{k}_{f}"
        return "\n".join([*out, "</robot>"])

    def profile(self, timing: bool) -> dict[str, object]:
        """The profile, with what `simulate` needs; with the clock of a stream."""
        bodies: dict[str, object] = {}
        mounts: dict[str, object] = {}
        for limb in range(self.limbs):
            link = f"l{limb}_{self.joints - 1}" + (f"_{self.fixed - 1}" if self.fixed else "")
            # The limb's end, and the root once.
            for body, on in [(f"b{limb}", link)] + ([("foot", "root")] if limb == 0 else []):
                own = markers(body, self.markers)
                bodies[body] = {"link": on, **({"markers": list(own)} if own else {"pose": True})}
                mounts[body] = {"xyz_mm": [30, 20, 40], "rpy_deg": [5, -7, 12], **({"markers_mm": own} if own else {})}
                if body == "foot":
                    # The root does not move against the tracker: its body is known.
                    bodies[body].update(mount={"xyz_mm": [30, 20, 40], "rpy_deg": [5, -7, 12]})
                    bodies[body].update({"template_mm": own} if own else {})
        names = [f"j{limb}_{k}" for limb in range(self.limbs) for k in range(self.joints)]
        random = {f"{name}_deg": [-80, 80] for name in names}
        recordings: dict[str, object] = {"checks": {"file": "checks.csv", "use": "validation"}}
        protocols: dict[str, object] = {"checks": {"random": random, "poses": 12}}
        for f in range(self.files):
            name = f"poses_{f}"
            recordings[name] = {"file": f"{name}.csv", "use": "static"}
            if timing:
                recordings[name]["timing"] = {"clock": "shared"}
            protocols[name] = {"random": random, "poses": self.poses // self.files}
        tracker = {"marker_sigma_mm": 0.1} if self.markers else {"body_sigma_mm": 0.1, "body_sigma_deg": 0.05}
        return {
            "calib": 1,
            "robot": {"name": "grown", "urdf": "grown.urdf"},
            "tracker": {"frame": "lab", **tracker},
            "bodies": bodies,
            "recordings": recordings,
            "solve": {"free": self.free},
            "simulate": {
                "seed": 7,
                "tracker_from_root": {"xyz_mm": [300, -200, 100], "rpy_deg": [3, 2, 40]},
                "mounts": mounts,
                "errors": {"joint_offset_deg": 0.2, "axis_mm": 0.5, "axis_deg": 0.1, "mount_mm": 2, "mount_deg": 1},
                "noise": {"marker_mm": 0.1, "body_mm": 0.1, "body_deg": 0.05, "joint_deg": 0.01},
                "recordings": protocols,
            },
        }

    def write(self, folder: Path, program: str) -> None:
        """Robot, profile and recordings, where they are not there yet."""
        text = json.dumps(self.profile(timing=self.stream and not self.every_row), indent=1)
        if (folder / "done").exists() and (folder / "grown.yaml").read_text() == text:
            return
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "grown.urdf").write_text(self.urdf())
        (folder / "grown.yaml").write_text(json.dumps(self.profile(timing=self.stream), indent=1))
        call = [program, "simulate", "grown.yaml", "--out", ".", "--quiet"]
        subprocess.run(call, cwd=folder, check=True)
        (folder / "grown.yaml").write_text(text)
        (folder / "done").touch()


@dataclass
class Line:
    """One command at several sizes."""

    command: list[str]
    # Size and scene.
    scenes: list[tuple[int, Scene]]
    # Largest exponent, and largest share of the other program's time at each size.
    exponent: float | None = None
    share: float | None = None


def lines() -> dict[str, Line]:
    """What is measured."""
    run, check = ["run"], ["check"]

    def over(name: str, sizes: list[int], **same: object) -> list[tuple[int, Scene]]:
        return [(n, Scene(**{**same, name: n})) for n in sizes]

    # A pose of a stream is some 87.5 rows.
    streams = [(rows, Scene(poses=round(rows / 87.5), stream=True)) for rows in [4_800, 48_000, 480_000]]
    rows_of_streams = [(rows, Scene(poses=round(rows / 87.5), stream=True, every_row=True)) for rows in [4_800, 48_000]]
    humanoid = Scene(joints=6, limbs=10, poses=100)
    return {
        "stream": Line(check, streams, 1.05, 0.1),
        "stream-rows": Line(check, rows_of_streams, 1.05, 0.1),
        "rows": Line(run, over("poses", [1_000, 10_000, 100_000]), 1.05),
        "rows-as-poses": Line(run, over("poses", [1_000, 10_000, 100_000], markers=0), 1.05),
        "check-rows": Line(check, over("poses", [1_000, 10_000, 100_000]), 1.05),
        "markers": Line(run, over("markers", [4, 12, 40, 120, 400], poses=40), 1.3),
        "check-markers": Line(check, over("markers", [4, 12, 40, 120, 400], poses=40), 1.3),
        "body-of-200": Line(run, over("markers", [200], poses=40), share=0.05),
        "check-body-of-200": Line(check, over("markers", [200], poses=40), share=0.05),
        "files": Line(run, over("files", [1, 10, 100], poses=1_000), 1.1),
        "recordings": Line(run, [(n, Scene(files=n, poses=10 * n)) for n in [3, 30, 300]], 1.1),
        "fixed-links": Line(run, over("fixed", [1, 10, 100]), 1.1),
        "joints": Line(run, over("joints", [3, 6, 12, 24], poses=200)),
        "humanoid": Line(run, [(60, humanoid)], share=0.3),
        "compare-models": Line(["run", "--compare-models"], [(100, Scene())], share=0.5),
    }


def measure(program: str, command: list[str], folder: Path) -> tuple[float, float, float, int]:
    """Processor time and elapsed time, s, peak memory, MB, and exit code of one call."""
    out = ["--out", "out"] if command[0] == "run" and "--compare-models" not in command else []
    call = [program, *command, "grown.yaml", *out]
    began = time.monotonic()
    child = subprocess.Popen(call, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(child.pid, 0)
    elapsed = time.monotonic() - began
    child.returncode = os.waitstatus_to_exitcode(status)
    return used.ru_utime + used.ru_stime, elapsed, used.ru_maxrss / 1e3, child.returncode


def slope(sizes: list[int], values: list[float]) -> float:
    """Least squares of log value over log size."""
    x, y = [math.log(n) for n in sizes], [math.log(v) for v in values]
    mx, my = statistics.fmean(x), statistics.fmean(y)
    return sum((a - mx) * (b - my) for a, b in zip(x, y)) / sum((a - mx) ** 2 for a in x)


def main() -> None:
    """Prints a row per size, then the exponent and the share."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("programs", nargs="+")
    parser.add_argument("--only", default="")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--largest", type=int, default=sys.maxsize, help="no larger sizes than this")
    args = parser.parse_args()
    programs = [str(Path(p).resolve()) for p in args.programs]
    chosen = args.only.split(",") if args.only else list(lines())
    for name in chosen:
        line = lines()[name]
        scenes = [(n, s) for n, s in line.scenes if n <= args.largest]
        columns: list[list[float]] = [[] for _ in programs]
        for n, scene in scenes:
            folder = args.folder / name.removeprefix("check-") / str(n)
            scene.write(folder, programs[0])
            all_runs = [[measure(p, line.command, folder) for p in programs] for _ in range(args.runs)]
            shown, elapsed = [], []
            for k in range(len(programs)):
                seconds = statistics.median(r[k][0] for r in all_runs)
                elapsed.append(statistics.median(r[k][1] for r in all_runs))
                columns[k].append(seconds)
                memory, code = max(r[k][2] for r in all_runs), all_runs[0][k][3]
                shown.append(f"{seconds:9.3f} s, {elapsed[k]:.3f} s elapsed {memory:8.1f} MB exit {code}")
            share = ""
            if len(programs) > 1:
                share = f"  share {columns[0][-1] / columns[1][-1]:.3f}, elapsed {elapsed[0] / elapsed[1]:.3f}"
            print(f"{name:18} {n:8} {' | '.join(shown)}{share}", flush=True)
        if len(scenes) > 1:
            slopes = ", ".join(f"{slope([n for n, _ in scenes], c):.2f}" for c in columns)
            print(f"{name:18} exponent {slopes}" + (f" (at most {line.exponent})" if line.exponent else ""), flush=True)
        if line.share is not None:
            print(f"{name:18} at most {line.share} of the other", flush=True)


main()
