"""Plan pushes that move the target to a goal beside it, without a robot.

./env python examples/02_plan_a_push.py
"""

import numpy as np

from sain_core.goal import Goal
from sain_core.push import ANGLE, LENGTH, LOCATION
from sain_core.scene import make_scene
from sain_core.world import PushRecord
from sain_model.physics.planar import PlanarPrior
from sain_mppi.agent.agent import AgentConfig, act, planning_agent
from sain_mppi.agent.events import GoalGiven, PushDecision, PushEnded, SceneObserved, Task

scene = make_scene(
    positions=np.array([[0.45, 0.0], [0.591, 0.0]]),
    masses=np.array([8.0, 8.0]),
    radii=np.array([0.08, 0.06]),
)
# To the left: the mid disk must first go round the target.
goal = Goal.place(0.50, 0.25, tolerance=0.005)

prior = PlanarPrior()
agent = planning_agent(prior, prior, AgentConfig(seed=7))
task = Task(goal_id=1, episode_id=0, goal=goal, max_pushes=15)

decision = act(agent, GoalGiven(task), SceneObserved(scene, episode_id=1, scene_id=1))
while isinstance(decision, PushDecision):
    push = decision.push
    print(
        f"push {agent.pushes}: location {push[LOCATION]:+.2f} rad, angle {push[ANGLE]:+.2f} rad,"
        f" {100 * push[LENGTH]:4.1f} cm;"
        f" target {1e3 * decision.job.judgement.distance:5.1f} mm from the goal"
    )
    after = prior.step(scene[None], push[None])[0]  # in place of a real push
    record = PushRecord(push, scene, after)
    ended = PushEnded(decision.push_id, record=record, episode_id=1)
    decision = act(agent, ended, SceneObserved(after, 1, scene_id=agent.pushes + 1))
    scene = after

if decision is None or decision.failure:
    raise SystemExit(decision.failure if decision else "the agent waits")
left = 1e3 * decision.job.judgement.distance
print(f"target {left:.1f} mm from the goal after {agent.pushes} pushes")
