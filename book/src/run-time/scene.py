"""Where everything is: the frames of a calib scene in its root frame at joint positions in degrees; sigma is that at position 0.

    scene.py SCENE.json [joint=deg …]
"""
import json, math, sys


def product(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def pose(xyz, q):
    x, y, z, w = q
    r = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
         [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
         [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    return [row + [t] for row, t in zip(r, xyz)] + [[0, 0, 0, 1]]


def main(path, *at):
    scene = json.load(open(path, encoding="utf-8"))
    assert scene["calib_scene"] == 1, "another version of the format"
    degrees = dict(word.split("=") for word in at)
    moved_by = {joint["child"]: joint for joint in scene["joints"]}
    place = {}
    for frame in scene["frames"]:  # parents come first
        here = pose(frame["xyz_m"], frame["quat_xyzw"])
        joint = moved_by.get(frame["name"])
        if joint and joint["motion"] == "revolute":
            half = math.radians(float(degrees.get(joint["name"], 0))) / 2
            turn = [math.sin(half) * x for x in joint["axis"]] + [math.cos(half)]
            here = product(here, pose([0, 0, 0], turn))
        place[frame["name"]] = product(place[frame["parent"]], here) if frame["parent"] else here
        c = frame["covariance_in_root"]
        sigma = f"± {1e3 * math.sqrt(sum(c[k][k] for k in (3, 4, 5))):.2f} mm" if c else ""
        x, y, z = (row[3] for row in place[frame["name"]][:3])
        print(f'{frame["name"]:20} {x:9.4f} {y:9.4f} {z:9.4f}  {frame["status"]:10} {sigma}')
    verdict = scene["verdict"]
    if verdict["position_error_m"] is not None:
        print(f'{verdict["verdict"]}: {1e3 * verdict["position_error_m"]:.2f} mm rms on new poses')


main(*sys.argv[1:])
