"""The node that plays episodes, with a planner and a simulator of straw."""

from dataclasses import replace
from io import StringIO
from pathlib import Path
from time import monotonic

import pytest
from rich.console import Console

import sain_bringup.ros.director
import sain_bringup.ros.progress
from sain_bringup.display import Display
from sain_bringup.processes import Supervisor
from sain_bringup.ros.director import Director, GraphTimeoutError
from sain_bringup.ros.progress import Progress
from sain_core.errors import ErrorCode
from sain_core.ros import codec
from sain_core.ros.node_main import ros_context
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_eval.scenes.families import PoseScenario
from sain_interfaces.msg import Goal, Plan
from sain_interfaces.msg import Scene as SceneMessage
from sain_interfaces.srv import ResetScene

CASE = PoseScenario("streak", "t", goals=4).scene(0)


class Straw:
    """Answers each goal with the next of some statuses, or several, and executes no push."""

    def __init__(self, graph, statuses):
        self.goals, self.resets = [], []
        self.statuses = iter(statuses)
        node = graph.bystander
        self.plans = node.create_publisher(Plan, "plan", RELIABLE)
        node.create_subscription(Goal, "goal", self.on_goal, LATCHED)
        node.create_service(ResetScene, "reset_scene", self.on_reset)

    def on_reset(self, request, response):
        self.resets.append(request)
        response.error_code = int(ErrorCode.OK)
        response.scene = SceneMessage(episode_id=5, settled=True)
        response.scene.disks = codec.encode_disks(CASE.disks)
        return response

    def on_goal(self, message):
        self.goals.append(message)
        ids = {"goal_id": message.goal_id, "episode_id": message.episode_id}
        told = next(self.statuses)
        for status in told if isinstance(told, tuple) else (told,):
            if status is not None:
                self.plans.publish(Plan(**ids, status=status, push_id=7, error_code=1))


def play(graph, statuses, case=CASE, supervisor=None, timeout=20.0):
    supervisor = supervisor or Supervisor(Path())
    straw = Straw(graph, statuses)
    progress = Progress(Display(Console(file=StringIO(), width=120)), "1/1  streak 0")
    with ros_context():
        director = Director(lambda: graph.executor.spin_once(timeout_sec=0.0), timeout, supervisor)
        try:
            director.wait(
                lambda: (
                    straw.plans.get_subscription_count() == 2
                    and director._goal.get_subscription_count() == 1
                    and director._servers["reset_scene"].service_is_ready()
                ),
                lambda: "the straw is not there",
            )
            director.play(case, 0.02, progress)
        finally:
            director.destroy_node()
    return straw, progress


def test_goals_in_a_row_are_given_without_a_reset_until_one_is_missed(graph):
    straw, progress = play(graph, (Plan.REACHED, Plan.REACHED, Plan.EXHAUSTED))
    assert len(straw.resets) == 1
    assert [goal.goal_id for goal in straw.goals] == [1, 2, 3]
    assert {goal.episode_id for goal in straw.goals} == {5}
    for message, goal in zip(straw.goals, CASE.goals, strict=False):
        (sent,), (pose,) = message.poses, goal.poses
        assert (sent.x, sent.y, sent.heading) == (pose.x, pose.y, pose.heading)
        assert message.max_pushes == 30
    assert not progress.reached and progress.goals == 2
    assert progress.summary().endswith("2 of 4 goals in a row  no pushes left of 0")


class Crashed(Supervisor):
    """A supervisor that has restarted a process."""

    def __init__(self):
        self.restarted_at = monotonic()

    @property
    def back_at(self):
        return self.restarted_at


def test_a_goal_is_given_again_where_a_crash_swallowed_what_became_of_it(graph, monkeypatch):
    monkeypatch.setattr(sain_bringup.ros.director, "SILENT", 0.3)
    statuses = (Plan.REACHED, None, Plan.EXHAUSTED)
    straw, progress = play(graph, statuses, supervisor=Crashed())
    assert [goal.goal_id for goal in straw.goals] == [1, 2, 2]
    assert progress.goals == 1


@pytest.mark.parametrize("crashed", [False, True])
def test_a_push_without_a_result_is_waited_for_in_vain_only_after_a_crash(
    graph, monkeypatch, crashed
):
    monkeypatch.setattr(sain_bringup.ros.progress, "LOST", 0.5)
    case, statuses = replace(CASE, further=()), ((Plan.PUSH, Plan.REACHED),)
    if crashed:
        _, progress = play(graph, statuses, case, Crashed())
        assert progress.reached
    else:
        with pytest.raises(GraphTimeoutError, match="no sign of planner or simulator"):
            play(graph, statuses, case, timeout=1.5)
