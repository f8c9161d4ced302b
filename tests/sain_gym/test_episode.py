"""Rewards, success and ends of episodes, without an engine."""

import numpy as np
import pytest

from sain_core.errors import BlockedError, ErrorCode
from sain_core.push import make_push
from sain_core.scene import POSITION, THETA
from sain_eval.episode import EpisodeRecord, Tolerance
from sain_eval.scenes.scenarios import SCENARIOS
from sain_gym.episode import PushEpisode

PUSH = make_push(0.0, 0.0, 0.1)
COST = 0.05


def begin(scenario: str, seed: int = 0, within: Tolerance = Tolerance(0.02)) -> PushEpisode:
    case = SCENARIOS[scenario].scene(seed)
    return PushEpisode(case, case.disks, within, COST)


def at_the_goal(episode: PushEpisode, off: float = 0.0, turned: float = 0.0) -> np.ndarray:
    """The scene with the bodies so far [m] and so much turned [rad] from the present goal."""
    goal, scene = episode.record.goal, episode.scene.copy()
    scene = goal.placed(scene)
    scene[:, 0] += off
    scene[:, THETA] += turned
    return scene


@pytest.mark.parametrize(
    ("off", "turned", "solved"),
    [(0.019, 0.0, True), (0.021, 0.0, False), (0.0, 0.099, True), (0.0, 0.101, False)],
)
def test_success_is_that_of_an_evaluation(off, turned, solved):
    episode = begin("push_t")
    goal, start = episode.record.goal, episode.scene
    after = at_the_goal(episode, off, turned)
    record = EpisodeRecord(goal, (), start, episode.case.bodies)
    judged = record.judge(after, Tolerance(0.02))
    away = judged.distance + judged.turn / 5.0
    assert episode.execute(PUSH, after) == (pytest.approx(-away), solved, False)
    info = episode.info()
    assert (info["distance"], info["turn"]) == (judged.distance, judged.turn)
    assert judged.reached == info["is_success"] == episode.over == solved
    assert episode.failure == ""


def test_the_pushes_of_the_scenario_end_an_episode():
    episode = begin("anywhere")
    verdicts = [episode.execute(PUSH, episode.scene.copy()) for _ in range(15)]
    assert [verdict[1:] for verdict in verdicts] == [(False, False)] * 14 + [(False, True)]
    assert len({verdict.reward for verdict in verdicts}) == 1
    assert episode.over and not episode.is_success
    assert episode.failure == "15 pushes left the goal unreached"


def test_ten_refusals_from_one_scene_end_an_episode_and_do_not_pay():
    episode = begin("anywhere")
    away = episode.miss
    for _ in range(9):
        assert episode.refuse(PUSH, BlockedError("no")) == (-away - COST, False, False)
    episode.execute(PUSH, episode.scene.copy())
    for _ in range(9):
        assert not episode.refuse(PUSH, BlockedError("no")).terminated
    last = episode.refuse(PUSH, BlockedError("no"))
    assert last == (pytest.approx(-15 * away - COST), True, False)
    assert episode.failure == "10 pushes in a row were refused from this scene, the last: no"
    assert (episode.pushes, episode.refusals) == (1, 19)
    assert episode.info()["refusal_code"] == ErrorCode.BLOCKED


def test_a_body_off_the_table_ends_an_episode_and_does_not_pay():
    episode = begin("anywhere")
    after = at_the_goal(episode, 0.1)
    after[0, POSITION] = 1.3, 0.0
    assert episode.execute(PUSH, after) == (pytest.approx(-15 * 0.1), True, False)
    assert episode.failure == "push 1 moved body 0 off the table, to (1.300, 0.000) m"


def test_goals_follow_one_another_each_with_its_own_pushes():
    episode = begin("streak")
    case = episode.case
    for number in range(100):
        assert episode.goals_reached == number
        goal = episode.record.goal
        far = episode.scene.copy()
        episode.execute(PUSH, far)
        verdict = episode.execute(PUSH, at_the_goal(episode))
        assert verdict.terminated == (number == 99)
        assert verdict.reward == pytest.approx(0.0)
        assert (episode.record.goal is goal) == (number == 99)
    assert episode.is_success
    assert episode.pushes == 200 > case.max_pushes
