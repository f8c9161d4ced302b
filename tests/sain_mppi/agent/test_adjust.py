"""Settings of the planner that change between two plans, or in the middle of one."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.goal import Goal
from sain_core.model import IdentityPrior
from sain_core.randomness import generator
from sain_mppi.agent.events import PlanJob, SceneObserved, Task
from sain_mppi.agent.planning import PlanningDecider
from sain_mppi.config import PlannerConfig
from sain_mppi.objective.problem import Problem

TASK = Task(1, 0, Goal.place(0.68, 0.05, 0.01), 0)
FEW = PlannerConfig(samples=48, rounds=2, horizon=3)
CHANGES = (
    {"samples": 20},
    {"rounds": 1, "temperature": 0.0, "selection": "mean"},
    {"algorithm": "mppi"},
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
