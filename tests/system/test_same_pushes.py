"""The graph and `evaluate` run the same agent in the same world: their pushes are equal to the bit.

Both take their settings from the same defaults. The graph has what can differ: messages, threads,
one agent and one world for all episodes, and the arm's ways through the air shown.
"""

import numpy as np
import pytest

from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.ros import codec
from sain_core.scene import MASS
from sain_core.world import observation_settings
from sain_eval.loop.evaluation import EpisodeJob, play_job
from sain_interfaces.msg import Plan
from sain_mppi.agent.agent import AgentConfig
from sain_mppi.agent.uncertainty import EstimatorConfig
from sain_mppi.ros.mppi_node import MppiNode
from sain_sim.camera.camera import WorldCameraConfig
from sain_sim.ros.sim_node import SimNode
from sain_sim.world.truth import TruthConfig

TOLERANCE = 0.01
RANDOMISED, ROUGH = TruthConfig(), TruthConfig(world="rough")
PLAYED = [("anywhere", 0, RANDOMISED), ("clutter", 3, ROUGH), ("anywhere_cube", 2, RANDOMISED)]


def play_on_graph(graph, number, case, tolerance=TOLERANCE):
    """Return the executed pushes (P, 5) of an episode, its last scene, and how it ended."""
    first = graph.reset(
        seed=case.seed,
        world=case.truth.world,
        disks=codec.encode_disks(case.disks),
        shapes=list(case.shapes),
        friction=case.friction,
    )
    episode = first.episode_id
    graph.aim(
        case.goal.places[0], number, tolerance, episode_id=episode, max_pushes=case.max_pushes
    )

    def ended():
        return [p for p in graph.find("plan", goal_id=number) if p.status != Plan.PUSH]

    graph.wait(ended, f"the end of episode {number}")
    results = graph.find("push_result", episode_id=episode, error_code=int(ErrorCode.OK))
    refused = len(graph.find("push_result", episode_id=episode)) - len(results)
    pushes = np.array([wire.decode_push(result.push) for result in results]).reshape(-1, 5)
    last = results[-1].after if results else first
    return pushes, wire.decode_disks(last.disks), refused, ended()[0].status == Plan.REACHED


@pytest.mark.parametrize("full_motion", [False, True])
def test_the_graph_and_evaluate_play_the_same_pushes(graph, full_motion):
    graph.start(SimNode, shadow=False, cell__full_motion=full_motion)
    graph.start(MppiNode, dynamics="in_process", model="sain")
    graph.wait(lambda: graph.aiming.get_subscription_count() == 2, "the planner")
    played = PLAYED[:1] if full_motion else PLAYED
    counts = []
    for number, (scenario, seed, truth) in enumerate(played, start=1):
        job = EpisodeJob(scenario, seed, "sain", (TOLERANCE,), truth=truth)
        outcome = play_job(job)  # first: it compiles what is not compiled yet
        pushes, final, refused, reached = play_on_graph(graph, number, job.case())
        expected = np.array([push.push for push in outcome.record.pushes]).reshape(-1, 5)
        assert pushes.tobytes() == expected.tobytes(), (scenario, seed, pushes, expected)
        assert final.tobytes() == outcome.final.tobytes()
        assert (refused, reached) == (outcome.refusals, outcome.failure == "")
        counts.append(len(pushes))
    assert min(counts) >= 2


def test_a_policy_of_a_stranger_pushes_in_the_graph_as_in_evaluate(graph):
    """And its refused pushes move nothing."""
    name = "tests.policies:straight"
    graph.start(SimNode, shadow=False)
    graph.start(MppiNode, policy=name)
    graph.wait(lambda: graph.aiming.get_subscription_count() == 2, "the planner")
    ended = []
    for number, (scenario, within) in enumerate((("paper", 0.05), ("paper_shift", 0.02)), start=1):
        job = EpisodeJob(scenario, 0, f"policy:{name}", (within,))
        outcome = play_job(job)
        pushes, final, refused, reached = play_on_graph(graph, number, job.case(), within)
        assert pushes.tolist() == [push.push.tolist() for push in outcome.record.pushes]
        assert final.tobytes() == outcome.final.tobytes()
        assert (refused, reached) == (outcome.refusals, outcome.failure == "")
        ended.append((bool(refused), reached))
    assert ended == [(False, True), (True, False)]
    assert {plan.dynamics for plan in graph.find("plan", status=Plan.PUSH)} == {f"policy:{name}"}


def test_noisy_and_late_frames_lead_to_the_same_pushes_too(graph):
    camera = WorldCameraConfig(noise="0.005,0.035", delay=0.1, unknown="mass")
    told = observation_settings(camera)
    graph.start(SimNode, shadow=False, **{f"camera__{k}": v for k, v in told.items()})
    graph.start(
        MppiNode,
        dynamics="in_process",
        model="sain",
        **{f"estimator__{k}": v for k, v in told.items()},
    )
    graph.wait(lambda: graph.aiming.get_subscription_count() == 2, "the planner")
    agent = AgentConfig(estimator=EstimatorConfig(**told))
    for number, seed in enumerate((0, 3), start=1):
        job = EpisodeJob("anywhere", seed, "sain", (TOLERANCE,), agent, camera=camera)
        outcome = play_job(job)
        pushes, final, refused, reached = play_on_graph(graph, number, job.case())
        expected = np.array([push.push for push in outcome.record.pushes]).reshape(-1, 5)
        assert pushes.tobytes() == expected.tobytes(), (seed, pushes, expected)
        assert final.tobytes() == outcome.final.tobytes()
        assert (refused, reached) == (outcome.refusals, outcome.failure == "")
    seen = wire.decode_disks(graph.find("scene", settled=True)[-1].disks)
    assert np.abs(seen - final).max() > 1e-3 and (seen[:, MASS] == 8.0).all()
    plan = graph.find("plan", status=Plan.PUSH)[-1]
    assert plan.estimate[0].covariance[0] == pytest.approx(1e-6, rel=0.7)
