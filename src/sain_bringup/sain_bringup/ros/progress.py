"""How far a graph and an episode are: who is missing at the start, and each push as it is shown."""

import time
from collections.abc import Callable, Iterable, Iterator
from math import inf
from typing import Final, NamedTuple

from rclpy.client import Client
from rclpy.node import Node

from sain_bringup.display import Display
from sain_bringup.graph import MODEL, OUTLINES, PLANNER, RECORDER, SCENES, SEEING, SIMULATOR, TAGS
from sain_core.errors import ErrorCode
from sain_core.wire import decode_disks
from sain_eval.scenes.families import ScenarioScene
from sain_interfaces.msg import Plan, PushResult, Scene
from sain_interfaces.srv import DescribeModel, ResetScene, Rollout
from sain_model.commands import model_node
from sain_mppi.commands import mppi_node
from sain_sim.commands import sim_node
from sain_vision import commands as commands_of_vision

SHOWN_DISTANCES: Final = 8  # of an episode, in one line
LOST: Final = 5.0  # [s] after which what was not heard has got lost, where a process has crashed


class Progress:
    """One episode as it is played and shown: its pushes, and what became of them.

    Attributes:
        reached: whether the planner has reached the latest goal.
        goals: how many were reached in a row.
        heard_at: the time [s] of the last news that brought the goal nearer, or began it.
    """

    def __init__(
        self, display: Display, name: str, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._display, self._name, self._clock = display, name, clock
        self._case: ScenarioScene | None = None
        self._goal_id = self._last_sent = 0
        self._sent: set[int] = set()  # ids of pushes: those planned for this goal, ...
        self._answered: set[int] = set()  # ... and those with a result
        self._distances: list[float] = []  # [m] from the goal, at the start and after each push
        self._fallbacks = 0  # pushes that were planned without the model
        self._ended, self._why = False, ""
        self.reached, self.goals, self._most_goals = False, 0, 0
        self.heard_at = clock()
        self._show()

    def begin(self, goal_id: int, case: ScenarioScene, most_goals: int = 1) -> None:
        """Follow the goal of a case, which has this id, the next of so many in a row."""
        self._goal_id, self._case, self._most_goals = goal_id, case, most_goals
        self._sent.clear()
        self._last_sent, self._ended, self.reached = 0, False, False
        self.heard_at = self._clock()

    def at(self, distance: float) -> None:
        """Take note of the distance [m] from the goal, at the start and after each push."""
        self._display.begun += not self._distances
        self._distances.append(distance)
        self._show()

    def on_plan(self, plan: Plan) -> None:
        """Take note of a plan for the goal; others are passed over."""
        if plan.goal_id != self._goal_id:
            return
        if plan.status == Plan.PUSH:
            self._sent.add(plan.push_id)
            self._last_sent = plan.push_id
            self._show(f"planned in {1e3 * plan.planning_time:.0f} ms, pushing")
            if plan.fallback and not self._fallbacks:
                why = plan.error_message
                self._display.note(f"{self._name}  planned with physics alone: {why}")
            self._fallbacks += plan.fallback
        elif not self._ended:  # else the goal was given twice
            self.heard_at, self._ended = self._clock(), True
            self.reached = plan.status == Plan.REACHED
            self.goals += self.reached
            if plan.status == Plan.EXHAUSTED:
                self._why = f"no pushes left of {len(self._sent)}"
            elif not self.reached:
                self._why = plan.error_message or "the planner found no push"

    def on_result(self, result: PushResult) -> None:
        """Take note of what became of a push."""
        assert self._case is not None
        self._answered.add(result.push_id)
        self.heard_at = self._clock()
        if result.error_code == ErrorCode.OK:
            self.at(distance(self._case, result.after))
        else:
            self._display.note(f"{self._name}  a push was refused: {result.error_message}")

    def is_over(self, back_at: float) -> bool:
        """Tell whether the planner is done, and so is the last push it sent: news may overtake.

        `back_at` is when the last process came back that had crashed, as in `Supervisor`. A push
        that has no answer so long after that was carried out by a process that died before it
        told of it.
        """
        if not self._ended:
            return False
        before = self._clock() - LOST
        lost = -inf < back_at < before and self.heard_at < before
        return lost or self._last_sent in (0, *self._answered)

    def end(self) -> None:
        """Print the outcome."""
        self._display.outcome(self.reached, self._name, self.summary())

    def summary(self) -> str:
        """Return the line that stays."""
        noun = "push  " if self._pushes == 1 else "pushes"
        several = self._most_goals > 1
        why = f"  {self.goals} of {self._most_goals} goals in a row" if several else ""
        why += f"  {self._why}" if self._why else ""
        why += f"  ({self._fallbacks} without the model)" if self._fallbacks else ""
        return f"{self._pushes:2d} {noun}  {self._way()}{why}"

    @property
    def _pushes(self) -> int:
        return max(0, len(self._distances) - 1)

    def _show(self, doing: str = "planning") -> None:
        way, most = self._way() or "resetting", self._most_goals
        goal = f"goal {self.goals + 1} of {most}  " if most > 1 else ""
        self._display.status(f"{self._name}  {goal}{way}  push {self._pushes + 1}: {doing}")

    def _way(self) -> str:
        shown = [f"{1e3 * distance:.0f}" for distance in self._distances]
        if len(shown) > SHOWN_DISTANCES:
            shown[1 : 1 - SHOWN_DISTANCES] = ["…"]
        return f"{' → '.join(shown)} mm" if shown else ""


def distance(case: ScenarioScene, message: Scene) -> float:
    """Return the largest distance [m] of a body to its pose."""
    scene = decode_disks(message.disks)
    return case.goal.judge(scene, scene, case.bodies).distance


PROCESSES: Final = {  # by the name of the node in each
    "sim_node": SIMULATOR, "model_node": MODEL, "mppi_node": PLANNER, "recorder": RECORDER,
    "tag_node": TAGS, "outline_node": OUTLINES, "scene_node": SCENES,
}  # fmt: skip
NODES: Final = {one.subcommand: one for one in (sim_node, model_node, mppi_node)}
SERVERS: Final = {service: name for name, node in NODES.items() for service in node.offers}
SERVER_PARTS: Final = {  # that the director asks
    "reset_scene": ResetScene, "rollout": Rollout, "describe_model": DescribeModel,
}  # fmt: skip
SEEN: Final = ("scene", "shapes")  # by the node that sees the bodies, if there is one
IMAGES: Final = "camera/"  # topics that are sent only where somebody asks for them


def seeing_nodes(see: str) -> tuple[str, ...]:
    """Return the nodes that make the scenes, by what they see; empty: the simulator does."""
    return (SEEING[see], "scene_node") if see else ()


def published_topics(see: str) -> dict[str, tuple[str, ...]]:
    """Return what each node of a graph publishes, whose scenes come from images or not."""
    seeing = {name: getattr(commands_of_vision, name) for name in seeing_nodes(see)}
    topics = {name: set(node.publishes) for name, node in (NODES | seeing).items()}
    topics["sim_node"] -= set(SEEN) if see else set()
    kept = {
        name: tuple(sorted(one for one in some if not one.startswith(IMAGES)))
        for name, some in topics.items()
    }
    return kept | {"closed_loop": ("goal",)}


class Missing(NamedTuple):
    """Something that is not there yet, and the process that should see to it."""

    process: str
    what: str


def missing_parts(node: Node, clients: Iterable[Client], see: str = "") -> list[Missing]:
    """Return everything that the graph still lacks, as this node sees it."""
    names = [client.srv_name for client in clients if not client.service_is_ready()]
    servers = [PROCESSES[SERVERS[name.rpartition("/")[2]]] for name in names]
    services = [f"service {name}" for name in names]
    return [*map(Missing, servers, services), *_missing_topics(node, see)]


def _missing_topics(node: Node, see: str) -> Iterator[Missing]:
    for publisher, topics in published_topics(see).items():
        for topic in topics:
            name = node.resolve_topic_name(topic)
            publishers = {info.node_name for info in node.get_publishers_info_by_topic(name)}
            if publisher not in publishers:
                yield Missing(PROCESSES[publisher], f"topic {name}")
                continue
            found = {info.node_name for info in node.get_subscriptions_info_by_topic(name)}
            listeners = [other for other, command in NODES.items() if topic in command.subscribes]
            for listener in ("recorder", *listeners):
                if listener not in found:
                    yield Missing(PROCESSES[listener], f"{PROCESSES[listener]} on {name}")
