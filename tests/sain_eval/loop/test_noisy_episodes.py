"""Episodes of which the agent sees noisy and late frames; the truth is judged."""

from sain_core.scene import MASS, NOMINAL_MASS
from sain_eval.cli.evaluate import EvaluateOptions
from sain_eval.loop.evaluation import EpisodeJob, play_job
from sain_sim.camera.camera import WorldCameraConfig


def play(seed, **camera):
    options = EvaluateOptions(camera=WorldCameraConfig(**camera))
    job = EpisodeJob("anywhere", seed, "planar", (0.01,), options.agent, camera=options.camera)
    return play_job(job)


def test_a_noisy_episode_reaches_the_goal_in_truth():
    outcome, again = (play(1, noise="0.005,0.035", delay=0.1) for _ in range(2))
    assert outcome.failure == ""
    assert outcome.record.last.distance <= 0.01
    assert again.final.tobytes() == outcome.final.tobytes()


def test_bodies_of_unknown_mass_are_pushed_too():
    unknown = play(1, unknown="mass", bias="0.001,0.01")
    assert unknown.failure == ""
    assert unknown.final[0, MASS] != NOMINAL_MASS  # what is judged is the truth
