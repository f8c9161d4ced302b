"""Faults of a table with a robot arm: its camera, its controller, its bodies and its processes.

The bench's arm and table are nodes of this process, so what is really moved is known here.
Driver, planner, model, scenes and enable signal are the processes that an owner of a robot runs.
`SPOILT` has what a broken sender sends, `FAULTS` what is done, and when.
"""

import random
import subprocess
import time
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from copy import deepcopy
from functools import partial, reduce
from itertools import cycle
from math import inf, nan
from pathlib import Path
from threading import Thread, Timer
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
from builtin_interfaces.msg import Time
from control_msgs.action import FollowJointTrajectory
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionServer
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_msgs.msg import Bool
from vision_msgs.msg import Detection3DArray

from benchmarks.faults.running import NEVER, own_domain, strike
from benchmarks.faults.table import Row
from sain_arm.planning.push_events import Ended, Ending
from sain_arm.ros.enabling import HOLD
from sain_bringup.bench import ENABLE, ROBOT, SERVER
from sain_bringup.children import ProcessDiedError
from sain_bringup.graph import (
    MODEL,
    PLANNER,
    SCENES,
    GraphOptions,
    graph_commands,
    ros_arguments,
)
from sain_bringup.processes import UNHURRIED, Supervisor
from sain_bringup.running import start_commands
from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.ros import codec
from sain_core.ros.node_main import ros_context, steady_timer
from sain_core.ros.qos import LATCHED, QUEUE, RELIABLE
from sain_core.scene import POSITION, THETA
from sain_core.shapes.bodies import Bodies
from sain_core.world import ObservationConfig
from sain_interfaces.msg import Bodies as BodiesMessage
from sain_interfaces.msg import Goal, GoalPose, Plan, Push, PushResult, Scene
from sain_sim.bench.faults import NONE
from sain_sim.ros.trajectory_server import TrajectoryServer
from sain_sim.world.engines import MUJOCO
from sain_sim.world.truth import MEASURED
from sain_vision.detection.sighting import Sighting
from sain_vision.ros.detections import encode_sightings

ENDING: Final = (ROBOT, ENABLE)  # processes whose death ends the graph, and stops the arm
PACE: Final = 2.0
FRAME: Final = 1.0 / 30.0  # [s]
LASTING: Final = 5.0  # [s] that a fault lasts
NOISE: Final = (0.0005, 0.005)  # [m], [rad]
TOLERANCE: Final = 0.01  # [m]
PLACES: Final = ((0.45, -0.2), (0.65, 0.2))  # [m], corners of where goals are
FAR: Final = 0.12  # [m], of a goal from where the body is
LONGEST: Final = 150.0  # [s] for one goal
ENDED: Final = (Plan.REACHED, Plan.NO_PUSH, Plan.EXHAUSTED)
REACHED: Final = "reached"
END: Final = "the graph ended: "
DISABLED: Final = 0.8  # [s] from the last signal to rest: the time-out, a cancel, the brake
EARLY: Final = 0.1  # [s] by which the driver may hear a signal before the table does
MOVES: Final = 0.05  # [rad/s], of a joint
SHIFT: Final = 0.06  # [m], by a hand
TOUCHED: Final = 0.003  # [m], of a body that was pushed
IN_TOUCH: Final = 0.05  # [s] since the last touch, in which the tool pushes
LOW: Final = 0.02  # [m], of a tip that may push
EMPTY: Final = np.zeros((0, 0, 2))
OTHERS: Final = ("came before", "is under way")  # in refusals of what another one sent
LIES: Final = ("succeeded, and stays", "succeeded, and moves", "aborted, and moves")
ROUND: Final = codec.encode_bodies(Bodies.named(["disk"]), [0.05], stamp=Time(), episode_id=1)
Spoiling = tuple[str, str, Callable[[Any, Any], Any]]
"""A topic (of `BESIDE`: good ones go on), a field, its value by that and by the good one."""
AT: Final = "detections.0.results.0.pose.pose"
HEADERS: Final[Sequence[tuple[str, Callable[[Any, Any], Any]]]] = (
    ("header.stamp.sec", lambda sec, _: sec - 3600),
    ("header.stamp.sec", lambda sec, _: sec + 3600),
    ("header.frame_id", lambda *_: "camera"),
)
SPOILT: Final[dict[str, Sequence[Spoiling]]] = {
    "bad detections": [
        *(("detections", *one) for one in HEADERS),
        ("detections", f"{AT}.position.x", lambda *_: nan),
        ("detections", f"{AT}.position.x", lambda x, _: x + random.uniform(-0.02, 0.02)),
        ("detections", f"{AT}.orientation", lambda *_: Quaternion(x=1.0, w=0.0)),
    ],
    "bad scenes beside the good ones": [
        *(("scene", *one) for one in HEADERS),
        ("scene", "disks.0.x", lambda *_: nan),
        ("scene", "disks.0.y", lambda y, _: y + 0.1),
        ("scene", "scene_id", lambda number, _: number - 1),
    ],
    "another body": [
        ("shapes", "bodies.0.name", lambda *_: "disk"),
        ("shapes", "bodies", lambda *_: ROUND.bodies),
        ("detections", "detections.0.id", lambda *_: "cup"),
    ],
    "another number of bodies": [
        ("shapes", "bodies", lambda bodies, _: [*bodies, *bodies]),
        ("scene", "disks", lambda disks, _: [*disks, *disks]),
        ("scene", "disks", lambda *_: []),
        ("detections", "detections", lambda seen, _: [*seen, *seen]),
    ],
    "joint states freeze in a stroke": [
        ("/joint_states", "position", lambda _, good: good),
        ("/joint_states", "header", lambda _, good: good),
        ("/joint_states", "name", lambda names, _: [f"other_{name}" for name in names]),
        ("/joint_states", "position", lambda position, _: [nan, *position[1:]]),
    ],
    "a second publisher of pushes in a stroke": [
        ("push", "push_id", lambda same, _: same),
        ("push", "push_id", lambda *_: random.getrandbits(60)),
    ],
    "the enable signal flickers in a stroke": [
        ("enable", "data", lambda *_: time.monotonic() % 0.2 < 0.1)
    ],
}
BESIDE: Final = {"scene": Scene, "shapes": BodiesMessage, "push": Push, "enable": Bool}


QUALITIES: Final = defaultdict(lambda: QUEUE, shapes=LATCHED)


def _step(at: Any, name: str) -> Any:
    return at[int(name)] if name.isdigit() else getattr(at, name)


class Table(TrajectoryServer):
    """Arm, bodies and camera, with faults on demand; it takes note of what must not happen."""

    def __init__(self, bodies: Path) -> None:
        """Set the table."""
        given: dict[str, Any] = {"cell.robot": "ur5", "engine": MUJOCO, "world": MEASURED}
        given |= {"bodies": str(bodies), "pace": PACE, "poses": False}
        super().__init__(parameter_overrides=[Parameter(k, value=v) for k, v in given.items()])
        self.orders: deque[Callable[[], object]] = deque()
        self.wrong: list[str] = []
        self.results: list[tuple[float, PushResult]] = []
        self.enabled_at = self.true_at = self.false_at = 0.0
        self.faults = set[str]()  # that last
        self.struck_by_hand = False
        self._lowered = self.by_hand = self.pushes = False
        self._touched, self._touched_at = 0, 0.0
        self._before = self.bench.observe()
        self.good: dict[str, Any] = {}  # the latest such message of a topic
        self.spoilings: dict[str, Spoiling] = {}  # of now, by their topics
        states = partial(self._send, "/joint_states", self._states)
        self._states: Any = SimpleNamespace(publish=states)
        self._sees = self.create_publisher(Detection3DArray, "detections", RELIABLE)
        self.others: dict[str, Any] = {}  # publishers beside those of good messages
        for topic, kind in BESIDE.items():
            self.create_subscription(kind, topic, partial(self._hear, topic), QUALITIES[topic])
        self.create_subscription(Bool, "enable", self._on_enable, RELIABLE)
        self.create_subscription(PushResult, "push_result", self._on_result, QUEUE)
        hear = partial(self._hear, "reach_table")
        self.create_subscription(OccupancyGrid, "reach_table", hear, LATCHED)
        self.plans: dict[int, list[Plan]] = defaultdict(list)
        self.create_subscription(Plan, "plan", self._on_plan, QUEUE)
        self.goal = self.create_publisher(Goal, "goal", LATCHED)
        steady_timer(self, FRAME, self._see)

    @property
    def moves(self) -> bool:
        """Whether a joint of the arm moves."""
        return float(np.abs(self.bench.velocities).max()) > MOVES

    @property
    def executed(self) -> list[tuple[float, PushResult]]:
        """Results of pushes that were made, and when they came [s]."""
        return [one for one in self.results if one[1].error_code == ErrorCode.OK]

    @property
    def broken(self) -> list[str]:
        """What the bench has counted that must not be."""
        report = self.bench.report
        return [f"limit of {name}" for name in report.limits] + [
            f"contact of {names}" for names in report.contacts if not self.struck_by_hand
        ]

    # --- faults, to be done on the executor's thread ---------------------------------------------

    def abort(self) -> None:
        """Stop as a robot does that was touched."""
        self.bench.controller.stop(self.bench.time)
        self._end(Ending(Ended.ABORTED, "protective stop"))

    def move_by_hand(self) -> None:
        """Take the body away from the tool and put it down beside it."""
        poses = self.bench.observe()[:, : THETA + 1].copy()
        away = poses[0, :2] - self.bench.tip[:2]
        poses[0, :2] += SHIFT * away / max(float(np.linalg.norm(away)), 1e-6)
        self.by_hand = self.struck_by_hand = True
        self.bench.place(poses)

    def later(self, action: Callable[[], object]) -> None:
        """Do something when the fault of now ends."""
        Timer(LASTING, lambda: self.orders.append(action)).start()

    def begin(self, fault: str) -> None:
        """Begin a fault that lasts."""
        self.faults.add(fault)
        self.later(lambda: self.faults.discard(fault))

    def spoil(self, spoiling: Spoiling) -> None:
        """Spoil what is sent, or send it beside the good."""
        topic = spoiling[0]
        self.spoilings[topic] = spoiling
        if topic in BESIDE:
            self.others[topic] = self.create_publisher(BESIDE[topic], topic, QUALITIES[topic])
            self.later(lambda: self.destroy_publisher(self.others.pop(topic)))
        self.later(lambda: self.spoilings.pop(topic))

    def answer_twice(self) -> None:
        """Have a second server call each goal successful at once."""
        name = f"/{self.bench.robot.controller.strip('/')}/follow_joint_trajectory"
        server = ActionServer(self, FollowJointTrajectory, name, self._answer_at_once)
        self.later(server.destroy)

    async def _execute(self, handle: Any) -> FollowJointTrajectory.Result:
        if not (lie := next(iter(self.faults.intersection(LIES)), "")):
            return await super()._execute(handle)
        if lie.endswith("moves"):
            self.bench.controller.start(self._decoded(handle.request), self.bench.time)
        (handle.abort if lie.startswith("aborted") else handle.succeed)()
        return FollowJointTrajectory.Result()

    # --- what is seen ----------------------------------------------------------------------------

    def _see(self) -> None:
        poses = self.bench.observe()[:, : THETA + 1]
        spread = np.array([NOISE[0], NOISE[0], NOISE[1]])
        seen = [
            Sighting(body, pose + spread * self._random.normal(size=3), np.diag(spread**2), EMPTY)
            for body, pose in enumerate(poses)
            if "covered" not in self.faults
        ]
        stamp = self.get_clock().now().to_msg()
        if "dark" not in self.faults:
            sightings = encode_sightings(seen, self.bench.bodies, "world", stamp)
            self._send("detections", self._sees, sightings)
        for topic, publisher in self.others.items():
            message = deepcopy(self.good[topic])
            if topic != "enable":
                message.header.stamp = stamp
            self._send(topic, publisher, message)

    def _send(self, topic: str, publisher: Any, message: Any) -> None:
        """Publish a message, or what it is spoilt to."""
        if topic not in self.spoilings:
            self.good[topic] = message
        else:
            _, path, spoilt = self.spoilings[topic]
            *way, name = path.split(".")
            at, good = (reduce(_step, way, one) for one in (message, self.good[topic]))
            setattr(at, name, spoilt(getattr(at, name), getattr(good, name)))
        publisher.publish(message)

    # --- what must not happen --------------------------------------------------------------------

    def _tick(self) -> None:
        while self.orders:
            self.orders.popleft()()
        super()._tick()
        touched, self._touched = self._touched, self.bench.report.tool
        self._touched_at = time.monotonic() if self._touched > touched else self._touched_at
        low, now = bool(self.bench.tip[2] < LOW), time.monotonic()
        self.pushes = low and self.bench.controller.busy and now - self._touched_at < IN_TOUCH
        self._lowered |= low
        if now > self.false_at + HOLD - EARLY:
            self.enabled_at = self.true_at
        since = now - self.enabled_at
        if self.moves and since > DISABLED and "moved" not in " ".join(self.wrong[-1:]):
            self.wrong.append(f"the arm moved {since:.1f} s after the last enable signal")

    def _hear(self, topic: str, message: Any) -> None:
        if topic not in self.others:
            self.good[topic] = message

    def _on_plan(self, message: Plan) -> None:
        self.plans[message.goal_id].append(message)

    def _on_enable(self, message: Any) -> None:
        if message.data:
            self.true_at = time.monotonic()
        else:
            self.false_at = time.monotonic()

    def _on_result(self, message: PushResult) -> None:
        """Hold what the driver says of a push against what the arm has done."""
        if any(words in message.error_message for words in OTHERS):
            return
        executed = message.error_code == ErrorCode.OK
        if executed and any(one.push_id == message.push_id for _, one in self.executed):
            self.wrong.append(f"push {message.push_id} has two results")
        self.results.append((time.monotonic(), message))
        now = self.bench.observe()
        moved = float(np.linalg.norm((now - self._before)[:, POSITION], axis=1).max())
        if executed and not self._lowered:
            self.wrong.append(f"push {message.push_id} counts, and the tool was never lowered")
        if executed and len(message.after.disks) == len(now):
            off = np.linalg.norm((wire.decode_disks(message.after.disks) - now)[:, POSITION])
            if off > TOUCHED and not self.by_hand:
                self.wrong.append(f"push {message.push_id} led {1e3 * off:.0f} mm off the truth")
        if not executed and moved > TOUCHED and not self.by_hand:
            self.wrong.append(f"push {message.push_id} is refused, and moved {1e3 * moved:.0f} mm")
        self._before, self._lowered, self.by_hand = now, False, False


class Hall:
    """A table with the processes of its graph. Use it as a context manager."""

    def __init__(self, folder: Path) -> None:
        """Start all in a domain of its own."""
        self._stack = ExitStack()
        self.on_end = self._stack.callback
        self._folder = folder
        self.random = random.Random(str(folder.name))
        self._goals = 0

    def __enter__(self) -> "Hall":
        """Start, and wait until a goal can be given."""
        stack = self._stack
        stack.enter_context(own_domain())
        stack.enter_context(ros_context())
        seen = ObservationConfig(noise=",".join(map(str, NOISE)))
        options = GraphOptions(
            robot="ur5", engine=MUJOCO, faults=NONE, model="planar", camera=seen,
            bag=self._folder / "bag",
        )  # fmt: skip
        assert options.bench is not None
        self.table = Table(options.bench.bodies_file)
        executor = SingleThreadedExecutor()
        executor.add_node(self.table)
        thread = Thread(target=executor.spin, daemon=True)
        stack.callback(self.table.destroy_node)
        stack.callback(thread.join, 5.0)
        stack.callback(executor.shutdown, 5.0)
        thread.start()
        self.supervisor = stack.enter_context(Supervisor(self._folder, UNHURRIED, NEVER))
        self.commands = graph_commands(options, ros_arguments(()), self._folder)
        del self.commands[SERVER]  # it is in this process
        start_commands(self.supervisor, self.commands)
        nodes, good = (MODEL, PLANNER, SCENES), self.table.good
        self.wait(lambda: "reach_table" in good and not self.supervisor.starting(nodes), LONGEST)
        return self

    def __exit__(self, *_: object) -> None:
        """End all."""
        self.end_processes()
        self._stack.close()

    def end_processes(self) -> None:
        """End the processes, and leave the table."""
        self.supervisor.close_files(UNHURRIED.interrupt)
        self.supervisor.stop()

    def process(self, name: str) -> int:
        """Return the number of a process."""
        return next(c.process.pid for c in self.supervisor.children if c.name == name)

    def wait(self, done: Callable[[], Any], longest: float) -> bool:
        """Look after the processes until something is so; return whether it is, in time [s]."""
        end = time.monotonic() + longest
        while not (so := done()) and time.monotonic() < end:
            self.supervisor.check()
            time.sleep(0.02)
        return bool(so)

    def reach(self, strike: Callable[[], None], when: Callable[[], bool]) -> tuple[str, float]:
        """Give a goal and strike once; return how that ended, and the time [s] to the next push.

        Raises:
            ProcessDiedError: a process ended that is not started anew.
        """
        table = self.table
        goal = self._far_goal()
        table.goal.publish(goal)
        plans = table.plans[goal.goal_id]

        def over() -> bool:
            return any(plan.status in ENDED for plan in plans)

        if not self.wait(lambda: when() or over(), LONGEST):
            return f"no moment to strike in {LONGEST:g} s", inf
        struck, clock = time.monotonic(), time.time()
        strike()
        wake = struck + LASTING  # the last plan may be one from before the fault
        self.wait(lambda: time.monotonic() > wake and over(), LONGEST)
        made = [
            at for at, one in table.executed if codec.decode_time(one.push.header.stamp) > clock
        ]
        recovery = min(made, default=inf) - struck
        ends = [plan for plan in plans if plan.status in ENDED]
        if not ends:
            return f"no end in {LONGEST:g} s", recovery
        if ends[-1].status == Plan.REACHED:
            off = float(
                np.hypot(*(table.bench.observe()[0, POSITION] - [goal.poses[0].x, goal.poses[0].y]))
            )
            far = off > TOLERANCE + 3.0 * NOISE[0] and not table.by_hand
            return (f"called reached {1e3 * off:.0f} mm away" if far else REACHED), recovery
        return f"ended: {ends[-1].error_message or 'no push is left'}", recovery

    def _far_goal(self) -> Goal:
        at = self.table.bench.observe()[0, POSITION]
        x, y = at
        while np.hypot(x - at[0], y - at[1]) < FAR:
            x, y = (self.random.uniform(*both) for both in zip(*PLACES, strict=True))
        self._goals += 1
        pose = GoalPose(body=0, x=x, y=y, tolerance=TOLERANCE)
        header = codec.header(self.table.get_clock().now().to_msg())
        return Goal(header=header, goal_id=self._goals, max_pushes=40, poses=[pose])


def process(name: str, stopped: float = 0.0) -> Callable[[Hall], None]:
    """Return what kills a process, or stops it for so long [s]."""
    return lambda hall: strike(hall.process(name), stopped)


def soon(hall: Hall) -> Callable[[], bool]:
    """Return what comes true at a random time, whatever the arm does then."""
    due = time.monotonic() + hall.random.uniform(0.1, 4.0)
    return lambda: time.monotonic() > due


def in_stroke(hall: Hall) -> Callable[[], bool]:
    """Return what is true while the tool pushes a body."""
    return lambda: hall.table.pushes


def at_table(fault: Callable[[Table], None]) -> Callable[[Hall], None]:
    """Return what does something to the table on its own thread."""
    return lambda hall: hall.table.orders.append(lambda: fault(hall.table))


def until(name: str) -> Callable[[Hall], None]:
    """Return what begins a fault that ends by itself."""
    return at_table(partial(Table.begin, fault=name))


def in_turn(strikes: Iterable[Callable[[Hall], None]]) -> Callable[[Hall], None]:
    """Return what does one of these at a time."""
    turns = cycle(strikes)
    return lambda hall: next(turns)(hall)  # noqa: PLW0108 - the next one each time


def second_planner(hall: Hall) -> None:
    """Start another planner, which ends after a while."""
    command = [word.replace("mppi_node.json", "second.json") for word in hall.commands[PLANNER]]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    hall.on_end(process.kill)
    Timer(3.0 * LASTING, process.terminate).start()


FAULTS: Final[dict[str, tuple[Callable[[Hall], Callable[[], bool]], Callable[[Hall], None]]]] = {
    **{
        kind: (
            in_stroke if kind.endswith("in a stroke") else soon,
            in_turn(at_table(partial(Table.spoil, spoiling=one)) for one in spoilings),
        )
        for kind, spoilings in SPOILT.items()
    },
    "the trajectory server lies": (
        soon,
        in_turn([*map(until, LIES), at_table(Table.answer_twice)]),
    ),
    "a second planner": (soon, second_planner),
    f"camera dark for {LASTING:g} s": (soon, until("dark")),
    f"body covered for {LASTING:g} s": (soon, until("covered")),
    "a hand moves the body in a stroke": (in_stroke, at_table(Table.move_by_hand)),
    "the controller aborts a stroke": (in_stroke, at_table(Table.abort)),
    f"the enable signal is lost in a stroke for {LASTING:g} s": (
        in_stroke,
        process(ENABLE, LASTING),
    ),
    **{f"SIGKILL: {name}": (soon, process(name)) for name in (SCENES, MODEL, PLANNER)},
    **{f"SIGKILL: {name} in a stroke": (in_stroke, process(name)) for name in ENDING},
}


def arm_faults(folder: Path, tries: int, words: Sequence[str]) -> Iterator[Row]:
    """Do each fault with one of these words in its name so often, one goal each."""
    for number, fault in enumerate(FAULTS):
        if any(word in fault for word in words):
            yield _row(folder / f"arm_{number}", fault, tries)


def _row(folder: Path, fault: str, tries: int) -> Row:
    when, strike = FAULTS[fault]
    outcomes: list[str] = []
    wrong: list[str] = []
    recoveries: list[float] = []
    while len(outcomes) < tries:
        with Hall(folder / f"{len(outcomes)}") as hall:
            try:
                while len(outcomes) < tries:
                    outcome, recovery = hall.reach(partial(strike, hall), when(hall))
                    outcomes.append(outcome)
                    recoveries.append(recovery)
                    print(f"{fault}: {outcome}, {recovery:.1f} s", *hall.table.wrong, flush=True)
            except ProcessDiedError as error:
                outcomes.append(f"{END}{error.reason.splitlines()[0]}")
                print(f"{fault}: {outcomes[-1]}", flush=True)
                hall.end_processes()
                time.sleep(DISABLED)
                if hall.table.moves:
                    hall.table.wrong.append("the arm moves after the end of the graph")
            wrong += hall.table.wrong + hall.table.broken
    good = (REACHED, *(f"{END}{name} was killed by SIGKILL" for name in ENDING))
    survived = [one for one in outcomes if one in good]
    others = Counter(one for one in outcomes if one not in survived) + Counter(wrong)
    ended = sum(one != REACHED for one in survived)
    others["the graph ended with the reason, and the arm stood still"] += ended
    note = "; ".join(f"{one} ({count})" for one, count in others.items() if count)
    return Row(fault, tries, len(survived), len(wrong), recoveries, note)
