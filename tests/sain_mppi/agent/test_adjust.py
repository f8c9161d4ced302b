"""Settings of the planner that change between two plans, or in the middle of one."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import ConfigError
from sain_core.goal import Goal
from sain_core.model import IdentityPrior
from sain_core.randomness import generator
from sain_mppi.agent.events import PlanJob, SceneObserved, Task
from sain_mppi.agent.planning import Decider, PlanningDecider
from sain_mppi.algorithms.config import PlannerConfig
from sain_mppi.objective.problem import Problem

TASK = Task(1, 0, Goal.place(0.68, 0.05, 0.01), 0)
FEW = PlannerConfig(samples=48, rounds=2, horizon=3)
CHANGES = (
    {"samples": 20},
    {"horizon": 2},
    {"rounds": 1, "temperature": 0.0, "selection": "mean"},
    {"algorithm": "icem"},
    {"weights": replace(FEW.weights, position=(400.0, 20.0))},
)


def decider_of(dynamics, config):
    model = dynamics
    return PlanningDecider(model, model, config)


def job_in(scene, number=0):
    return PlanJob(
        TASK, SceneObserved(scene, 1, 1 + number), Problem.of(scene, TASK.goal), 1, number
    )


@pytest.mark.parametrize("changes", CHANGES, ids="-".join)
def test_the_next_plan_is_that_of_a_planner_made_with_these_settings(scene, dynamics, changes):
    other = replace(FEW, **changes)
    decider = decider_of(dynamics, replace(FEW, warm_start=False))
    first = decider.decide(job_in(scene), generator(0))
    decider.prepare(first, generator(1))
    decider.adjust(replace(other, warm_start=False))
    adjusted = decider.decide(job_in(first.predicted, 1), generator(2))
    fresh = decider_of(dynamics, replace(other, warm_start=False))
    expected = fresh.decide(job_in(first.predicted, 1), generator(2))
    np.testing.assert_array_equal(adjusted.push, expected.push)
    assert adjusted.plan.pushes.shape[0] == other.horizon
    assert adjusted.settings == expected.settings


def test_what_was_found_with_other_settings_is_where_the_next_search_begins(scene, dynamics):
    decider = decider_of(dynamics, FEW)
    first = decider.decide(job_in(scene), generator(0))
    decider.adjust(replace(FEW, temperature=0.2))
    again = decider.decide(job_in(scene, 1), generator(1))
    assert again.plan.cost <= first.plan.cost


class Adjusting(IdentityPrior):
    """A model that changes the settings while it is asked."""

    decider: PlanningDecider

    def __init__(self, dynamics):
        self.model = dynamics

    def rollout(self, scene, pushes):
        self.decider.adjust(replace(FEW, samples=12, horizon=1))
        return self.model.rollout(scene, pushes)


def test_a_plan_in_progress_keeps_its_settings(scene, dynamics):
    model = Adjusting(dynamics)
    model.decider = PlanningDecider(model, model, FEW)
    first = model.decider.decide(job_in(scene), generator(0))
    assert first.settings == FEW
    assert len(first.plan.pushes) == FEW.horizon
    assert first.plan.samples >= FEW.samples + FEW.samples // 2
    model.decider.prepare(first, generator(1))
    then = model.decider.decide(job_in(first.predicted, 1), generator(2))
    assert (then.settings.samples, len(then.plan.pushes)) == (12, 1)


def test_a_surprise_is_judged_by_the_settings_of_now(scene, dynamics):
    decider = decider_of(dynamics, FEW)
    decider.decide(job_in(scene), generator(0))
    decider.adjust(replace(FEW, progress=replace(FEW.progress, surprise=1.0, surprise_share=1.0)))
    then = decider.decide(job_in(scene + 0.0, 1), generator(1))
    moved = scene.copy()
    moved[1, 0] += 0.03
    then = decider.decide(job_in(moved, 2), generator(2))
    assert (then.warning, then.last_expected.min()) == ("", 1.0)


def test_who_does_not_plan_has_nothing_to_change():
    class Fixed(Decider):
        def decide(self, job, generator):
            raise NotImplementedError

    with pytest.raises(ConfigError, match=r"^Fixed does not plan"):
        Fixed().adjust(FEW)
