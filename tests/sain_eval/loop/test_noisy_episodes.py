"""Episodes of which the agent sees noisy and late frames; the truth is judged."""

import pytest

from sain_core.scene import MASS, NOMINAL_MASS
from sain_eval.cli.evaluate import EvaluateOptions
from sain_eval.loop.evaluation import EpisodeJob, play_job
from sain_sim.camera.camera import WorldCameraConfig


def play(seed, **camera):
    options = EvaluateOptions(camera=WorldCameraConfig(**camera))
    job = EpisodeJob("anywhere", seed, "planar", (0.01,), options.agent, camera=options.camera)
    return play_job(job)


@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_a_noisy_episode_reaches_the_goal_in_truth(delay):
    outcome = play(1, noise="0.005,0.035", delay=delay)
    assert outcome.failure == ""
    assert outcome.record.last.distance <= 0.01
    again = play(1, noise="0.005,0.035", delay=delay)
    assert again.final.tobytes() == outcome.final.tobytes()


def test_delay_alone_changes_little_and_unknown_bodies_are_pushed_too():
    assert play(1, delay=0.1).failure == ""
    unknown = play(1, unknown="mass", bias="0.001,0.01")
    assert unknown.failure == ""
    assert unknown.final[0, MASS] != NOMINAL_MASS  # what is judged is the truth
