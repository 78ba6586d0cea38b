"""A ROS 2 node that publishes where a robot's links really are: frames of the calibrated model beside those of the URDF.

`robot_state_publisher` publishes the frames of a URDF, which cannot hold compliance, eccentricity or backlash. This node reads the same
`/joint_states` and publishes, for each link, body or point that it is asked for, the frame `calibrated/NAME` below the root, and its pose with
covariance on `~/NAME`.

    python3 corrected_frames.py --ros-args -p model:=ripley.calibrated.model.json -p of:="['tool']"

It was written against rclpy, tf2_ros, sensor_msgs and geometry_msgs of ROS 2 Jazzy, and has NOT been run under ROS: see README.md.
"""

from dataclasses import dataclass

import calib
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Frame:
    """A pose as messages hold it: `root_from_frame`."""

    name: str
    translation_m: tuple[float, float, float]
    rotation_xyzw: tuple[float, float, float, float]
    covariance: list[float]
    """6 × 6 by rows, [translation; rotation] about the root's fixed axes, as `geometry_msgs/PoseWithCovariance` wants it; zeros where the model has none."""


def positions(model: calib.Model, names: list[str], values: list[float]) -> Array | None:
    """Joint positions of a message in the order of the model; `None` where one of them is missing."""
    by_name = dict(zip(names, values))
    if any(joint.name not in by_name for joint in model.joints):
        return None
    return np.array([by_name[joint.name] for joint in model.joints])


def quaternion_xyzw(r: Array) -> tuple[float, float, float, float]:
    """Of a rotation matrix, by its largest component."""
    m = r
    squares = [
        1 + m[0, 0] - m[1, 1] - m[2, 2],
        1 - m[0, 0] + m[1, 1] - m[2, 2],
        1 - m[0, 0] - m[1, 1] + m[2, 2],
        1 + m[0, 0] + m[1, 1] + m[2, 2],
    ]
    k = int(np.argmax(squares))
    q = [
        [squares[0], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
        [m[0, 1] + m[1, 0], squares[1], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
        [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squares[2], m[1, 0] - m[0, 1]],
        [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], squares[3]],
    ][k]
    x, y, z, w = (float(v) for v in np.array(q) / np.linalg.norm(q))
    return x, y, z, w


def frame(model: calib.Model, q: Array, name: str, approach: Array | None) -> Frame:
    """Where a link, body or point really is."""
    pose = model.fk(q, name, approach=approach)
    covariance = np.zeros((6, 6))
    if model.has_uncertainty:
        # [ω; v] in the frame's own axes becomes [v; ω] in those of the root.
        rotate = np.zeros((6, 6))
        rotate[:3, 3:] = rotate[3:, :3] = pose[:3, :3]
        covariance = rotate @ model.sigma(q, name, approach=approach) @ rotate.T
    x, y, z = (float(v) for v in pose[:3, 3])
    return Frame(name, (x, y, z), quaternion_xyzw(pose[:3, :3]), covariance.reshape(-1).tolist())


def main() -> None:
    """The node. Imports of ROS stand here, so that everything above runs without it."""
    import rclpy
    from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
    from rclpy.node import Node
    from sensor_msgs.msg import JointState
    from tf2_ros import TransformBroadcaster

    class CorrectedFrames(Node):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__("corrected_frames")
            file = self.declare_parameter("model", "").value
            self.robot = calib.Model(file)
            asked = self.declare_parameter("of", [self.robot.tool]).value
            self.names = [str(name) for name in asked]
            self.seen: list[Array] = []
            self.broadcaster = TransformBroadcaster(self)
            self.poses = {
                name: self.create_publisher(PoseWithCovarianceStamped, f"~/{name}", 10)
                for name in self.names
            }
            self.create_subscription(JointState, "joint_states", self.moved, 10)

        def moved(self, message: JointState) -> None:
            q = positions(self.robot, list(message.name), list(message.position))
            if q is None:
                self.get_logger().warn("joints of the model are missing", once=True)
                return
            # The side that each joint came from follows from where it was: a few seconds are enough.
            self.seen = [*self.seen[-200:], q]
            approach = self.robot.approach(np.array(self.seen))[-1]
            if not self.robot.in_scope(q):
                text = f"not verified here: {self.robot.outside(q)[0]}"
                self.get_logger().warn(text, throttle_duration_sec=10.0)
            for name in self.names:
                self.publish(message.header.stamp, frame(self.robot, q, name, approach))

        def publish(self, stamp: object, found: Frame) -> None:
            transform = TransformStamped()
            transform.header.stamp = stamp
            transform.header.frame_id = self.robot.links[0]
            transform.child_frame_id = f"calibrated/{found.name}"
            t, r = transform.transform.translation, transform.transform.rotation
            t.x, t.y, t.z = found.translation_m
            r.x, r.y, r.z, r.w = found.rotation_xyzw
            self.broadcaster.sendTransform(transform)
            pose = PoseWithCovarianceStamped()
            pose.header = transform.header
            p, o = pose.pose.pose.position, pose.pose.pose.orientation
            p.x, p.y, p.z = found.translation_m
            o.x, o.y, o.z, o.w = found.rotation_xyzw
            pose.pose.covariance = found.covariance
            self.poses[found.name].publish(pose)

    rclpy.init()
    try:
        rclpy.spin(CorrectedFrames())
    except KeyboardInterrupt:
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
