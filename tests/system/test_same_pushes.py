"""The graph and `evaluate` run the same agent in the same world: their pushes are equal to the bit.

Both take their settings from the same defaults. The graph has what can differ: messages, threads,
one agent and one world for all episodes, and the arm's ways through the air shown.
"""

import numpy as np
import pytest

from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.ros import codec
from sain_eval.loop.evaluation import EpisodeJob, play_job
from sain_interfaces.msg import Plan
from sain_mppi.ros.mppi_node import MppiNode
from sain_sim.episodes.truth import TruthConfig
from sain_sim.ros.sim_node import SimNode

TOLERANCE = 0.01
RANDOMISED, ROUGH = TruthConfig(), TruthConfig(world="rough")
PLAYED = [
    ("anywhere", 0, RANDOMISED),
    ("anywhere", 3, ROUGH),
    ("clutter", 1, RANDOMISED),
    ("paper", 0, RANDOMISED),
    ("anywhere_cube", 2, RANDOMISED),
]


def play_on_graph(graph, number, case):
    """Return the executed pushes (P, 3) of an episode, its last scene, and how it ended."""
    first = graph.reset(
        seed=case.seed,
        world=case.truth.world,
        disks=codec.encode_disks(case.disks),
        shapes=list(case.shapes),
        friction=case.friction,
    )
    episode = first.episode_id
    graph.aim(case.goal, number, TOLERANCE, episode_id=episode, max_pushes=case.max_pushes)

    def ended():
        return [p for p in graph.find("plan", goal_id=number) if p.status != Plan.PUSH]

    graph.wait(ended, f"the end of episode {number}")
    results = graph.find("push_result", episode_id=episode, error_code=int(ErrorCode.OK))
    refused = len(graph.find("push_result", episode_id=episode)) - len(results)
    pushes = np.array([wire.decode_push(result.push) for result in results]).reshape(-1, 3)
    last = results[-1].after if results else first
    return pushes, wire.decode_disks(last.disks), refused, ended()[0].status == Plan.REACHED


@pytest.mark.parametrize("full_motion", [False, True])
def test_the_graph_and_evaluate_play_the_same_pushes(graph, full_motion):
    graph.start(SimNode, shadow=False, peer_wait=0.0, bullet__full_motion=full_motion)
    graph.start(MppiNode, dynamics="in_process", model="sain")
    graph.wait(lambda: graph.aiming.get_subscription_count() == 1, "the planner")
    played = PLAYED[:2] if full_motion else PLAYED
    counts = []
    for number, (scenario, seed, truth) in enumerate(played, start=1):
        job = EpisodeJob(scenario, seed, "sain", (TOLERANCE,), truth=truth)
        outcome = play_job(job)  # first: it compiles what is not compiled yet
        pushes, final, refused, reached = play_on_graph(graph, number, job.case())
        expected = np.array([push.push for push in outcome.record.pushes]).reshape(-1, 3)
        assert pushes.tobytes() == expected.tobytes(), (scenario, seed, pushes, expected)
        assert final.tobytes() == outcome.final.tobytes()
        assert (refused, reached) == (outcome.refusals, outcome.failure == "")
        counts.append(len(pushes))
    assert min(counts) >= 2
