"""A bench in place of a robot: serves FollowJointTrajectory, with a camera over the table."""

from functools import cached_property
from time import monotonic
from typing import Any, Final

import numpy as np
from control_msgs.action import FollowJointTrajectory
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from sain_arm.planning.push_events import Ended, Ending
from sain_arm.planning.timing import Trajectory
from sain_arm.robot.robot import FASTEST
from sain_arm.robot.urdf import visible
from sain_arm.ros.joint_listener import BEYOND
from sain_core.camera.image_camera import ImageCamera
from sain_core.randomness import generator
from sain_core.ros import codec
from sain_core.ros.camera_topics import CameraTopics
from sain_core.ros.node_main import NAMESPACE, OK, Diagnostics, steady_timer
from sain_core.ros.parameters import read_parameters
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_core.ros.worker import Worker
from sain_core.scene import THETA
from sain_core.world import ObservationConfig
from sain_sim.bench.bench import Bench, BenchConfig
from sain_sim.bench.faults import parse_faults
from sain_sim.camera.renderer import image_camera
from sain_sim.world.workcell import TIME_STEP

TICK: Final = 0.01  # [s] of wall time between two looks at the clock
BEHIND: Final = 0.05  # [s] that are caught up at most in one tick
FRAME: Final = 1.0 / 30.0  # [s]
SHORTEST: Final = 1e-9  # [s], so that a trajectory may begin at 0
SAME: Final = 0.05  # [rad], of a goal's first point from where the joints are


class BenchCamera:
    """Publishes images while somebody subscribes; the simulation goes on during this time."""

    def __init__(self, node: Node, bench: Bench, config: BenchConfig) -> None:
        """Stand over the table of a bench, and tell where."""
        self._node, self._bench, self._config = node, bench, config.images
        self._random = generator(config.seed, "images")
        self._topics = CameraTopics(node, config.images)
        self._static = node.create_publisher(TFMessage, "/tf_static", LATCHED)
        stamp = node.get_clock().now().to_msg()
        self._static.publish(TFMessage(transforms=[self._topics.transform(stamp)]))
        self.worker = Worker(node, "camera")
        steady_timer(node, 1.0 / config.images.rate, self._look)

    @cached_property
    def _camera(self) -> ImageCamera:
        """The camera, made on its thread with the first image: most benches take none."""
        bodies = self._bench.bodies
        seen = self._bench.robot, bodies.bodies, bodies.radii
        return image_camera(self._config, *seen, tags=bodies.tags)

    def _look(self) -> None:
        bench, worker = self._bench, self.worker
        if worker.pending or not self._topics.wanted or bench.controller.is_dark(bench.time):
            return
        joints, scene = bench.joints, bench.observe()
        stamp = self._node.get_clock().now().to_msg()
        self._topics.take(worker, lambda: self._camera.take(joints, scene, self._random), stamp)


class TrajectoryServer(Node):
    """Steps the simulation with the wall clock, and answers goals."""

    def __init__(self, **options: Any) -> None:
        """Set the table and wait for goals."""
        super().__init__("trajectory_server", namespace=NAMESPACE, **options)
        self.config = config = read_parameters(self, BenchConfig)
        self.bench = bench = Bench(config)
        self._noise = ObservationConfig(noise=config.noise).noise_std
        self._random = generator(config.seed, "camera")
        self._last, self._frame = monotonic(), 0.0
        self._goal: tuple[ServerGoalHandle, Future] | None = None
        self._states = self.create_publisher(JointState, "/joint_states", RELIABLE)
        self._poses = self.create_publisher(PoseArray, "poses", RELIABLE) if config.poses else None
        self._description = self.create_publisher(String, "/robot_description", LATCHED)
        self._description.publish(String(data=visible(bench.robot.description)))
        self._report = self.create_publisher(String, "bench", RELIABLE)
        name = f"/{bench.robot.controller.strip('/')}/follow_joint_trajectory"
        self._server = ActionServer(
            self,
            FollowJointTrajectory,
            name,
            self._execute,
            goal_callback=self._on_goal,
            cancel_callback=lambda handle: CancelResponse.ACCEPT,
        )
        if parse_faults(config.faults).twice:
            self._hasty = ActionServer(self, FollowJointTrajectory, name, self._answer_at_once)
        self.camera = BenchCamera(self, bench, config)
        self.diagnostics = Diagnostics(self, "bench")
        self.diagnostics.set(OK, "runs")
        steady_timer(self, TICK, self._tick)
        self.ready = f"{bench.robot.name} and {len(bench.bodies.names)} bodies, serving {name}"

    def _on_goal(self, goal: FollowJointTrajectory.Goal) -> GoalResponse:
        """Accept a goal that begins where the joints are."""
        problem = self._problem(goal)
        if self.bench.controller.rejects() and not problem:
            problem = "by a fault"
        if problem:
            self.get_logger().error(f"a goal is rejected: {problem}")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _problem(self, goal: FollowJointTrajectory.Goal) -> str:
        names, points = list(goal.trajectory.joint_names), goal.trajectory.points
        if sorted(names) != sorted(self.bench.robot.joints):
            return (
                f"its joints are {', '.join(names)}; allowed: {', '.join(self.bench.robot.joints)}"
            )
        if len(points) < 2:
            return f"it has {len(points)} points; at least 2 are needed"
        for number, point in enumerate(points):
            for what in ("positions", "velocities"):
                if (count := len(getattr(point, what))) != len(names):
                    return f"point {number} has {count} {what}; {len(names)} are needed"
        trajectory = self._decoded(goal)
        if not (np.diff(trajectory.times, prepend=-SHORTEST) > 0.0).all():
            return "its times do not increase from 0 s on"
        return self._out_of_range(trajectory)

    def _out_of_range(self, trajectory: Trajectory) -> str:
        """Return what the joints cannot do in a trajectory; empty: nothing."""
        robot = self.bench.robot
        fast = np.full_like(robot.velocity, FASTEST)
        for what, unit, values, low, high in (
            ("position", "rad", trajectory.positions, robot.lower - BEYOND, robot.upper + BEYOND),
            ("velocity", "rad/s", trajectory.velocities, -fast, fast),
        ):
            fine = (values >= low) & (values <= high)  # NaN is not
            if not fine.all():
                point, joint = (int(index) for index in np.argwhere(~fine)[0])
                return (
                    f"{what} of joint {robot.joints[joint]} in point {point} is"
                    f" {values[point, joint]:g} {unit}; allowed: {low[joint]:.2f} to"
                    f" {high[joint]:.2f} {unit}"
                )
        off = np.abs(trajectory.positions[0] - self.bench.joints).max()
        if off > SAME:
            return f"it begins {off:.3f} rad from where the joints are; allowed: {SAME} rad"
        return ""

    def _decoded(self, goal: FollowJointTrajectory.Goal) -> Trajectory:
        names, points = list(goal.trajectory.joint_names), goal.trajectory.points
        order = [names.index(name) for name in self.bench.robot.joints]
        times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points]
        return Trajectory(
            np.array(times),
            np.array([p.positions for p in points])[:, order],
            np.array([p.velocities for p in points])[:, order],
        )

    async def _execute(self, handle: ServerGoalHandle) -> FollowJointTrajectory.Result:
        """Follow a goal; a newer one ends it."""
        if self._goal is not None:
            self._end(Ending(Ended.ABORTED, "another goal came"))
        done: Future = Future(executor=self.executor)
        self._goal = handle, done
        self.bench.controller.start(self._decoded(handle.request), self.bench.time)
        ending = await done
        if ending.how is Ended.SUCCEEDED:
            handle.succeed()
        elif ending.how is Ended.CANCELLED:
            handle.canceled()
        else:
            handle.abort()
        result = FollowJointTrajectory.Result(error_string=ending.why)
        if ending.how is Ended.ABORTED:
            result.error_code = result.PATH_TOLERANCE_VIOLATED
        return result

    async def _answer_at_once(self, handle: ServerGoalHandle) -> FollowJointTrajectory.Result:
        """Call a goal successful that another server follows, too."""
        handle.succeed()
        return FollowJointTrajectory.Result()

    def _end(self, ending: Ending) -> None:
        if self._goal is not None:
            _, done = self._goal
            self._goal = None
            done.set_result(ending)

    def _tick(self) -> None:
        """Let the time pass that has passed on the wall clock."""
        bench, now = self.bench, monotonic()
        passed, self._last = min(now - self._last, BEHIND), now
        end = bench.time + passed * self.config.pace
        while bench.time < end - 0.5 * TIME_STEP:
            ending = bench.step()
            if self._goal is not None and self._goal[0].is_cancel_requested:
                bench.controller.stop(bench.time)
                ending = ending or Ending(Ended.CANCELLED, "cancelled")
            if ending is not None:
                self._end(ending)
        self._publish()

    def _publish(self) -> None:
        bench, stamp = self.bench, self.get_clock().now().to_msg()
        state = JointState(header=codec.header(stamp), name=list(bench.robot.joints))
        positions, velocities = bench.states()
        state.position, state.velocity = positions.tolist(), velocities.tolist()
        self._states.publish(state)
        if monotonic() < self._frame + FRAME:
            return
        self._frame = monotonic()
        self._report.publish(String(data=str(bench.report)))
        if self._poses is not None and not bench.controller.is_dark(bench.time):
            self._poses.publish(self._seen(stamp))

    def _seen(self, stamp: Any) -> PoseArray:
        message = PoseArray(header=codec.header(stamp))
        poses = self.bench.observe()[:, : THETA + 1]
        place, turn = self._noise
        poses += self._random.normal(size=poses.shape) * [place, place, turn]
        for x, y, theta in poses.tolist():
            half = theta / 2.0
            turned = Quaternion(z=float(np.sin(half)), w=float(np.cos(half)))
            message.poses.append(Pose(position=Point(x=x, y=y), orientation=turned))
        return message

    def destroy_node(self) -> None:
        """End camera and simulation, too."""
        self.camera.worker.close()
        super().destroy_node()
        self.bench.close()
