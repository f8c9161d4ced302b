"""Plan the same scene with every algorithm and draw the plans into planners.png.

./env python examples/04_compare_planners.py
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from sain_core.goal import Goal
from sain_core.randomness import generator
from sain_core.scene import make_scene
from sain_core.view.figures import TEXT, new_figure, write_png
from sain_eval.plots.axes import draw_legend
from sain_eval.plots.pictures import draw_plan
from sain_model.dynamics.load import load_checkpoint, shipped_checkpoint
from sain_mppi.algorithms import ALGORITHMS
from sain_mppi.config import PlannerConfig
from sain_mppi.planner import Planner, Problem

scene = make_scene(
    positions=np.array([[0.45, 0.0], [0.591, 0.0]]),
    masses=np.array([8.0, 8.0]),
    radii=np.array([0.08, 0.06]),
)
goal = Goal.place(0.50, 0.25)  # to the left: the mid disk must first go round the target
problem = Problem.of(scene, goal)
sain = load_checkpoint(shipped_checkpoint())

COLUMNS = 3
ROWS = -(-len(ALGORITHMS) // COLUMNS)
figure = new_figure(6.6, 2.5 * ROWS + 0.9)
places = figure.subplots(ROWS, COLUMNS).ravel()
for place, (axes, name) in enumerate(zip(places, ALGORITHMS, strict=False)):
    planner = Planner(sain, replace(PlannerConfig(), algorithm=name))
    planner.plan(problem, generator(7, name))  # the first plan loads and compiles
    plan = planner.complete(problem, planner.plan(problem, generator(7, name)))
    names = draw_plan(axes, scene, goal, plan)
    axes.set(xlim=(0.28, 0.83), ylim=(-0.22, 0.33))  # the same view for every algorithm
    title = f"{name}\ncost {plan.cost:.2f}, {plan.samples} sequences"
    axes.set_title(title, loc="left", fontsize=TEXT - 1)
    axes.set_ylabel("y [m]" if place % COLUMNS == 0 else "")
    axes.set_xlabel("x [m]" if place + COLUMNS >= len(ALGORITHMS) else "")
    worst = max(plan.terms, key=plan.terms.__getitem__)
    print(
        f"{name:12} cost {plan.cost:5.2f} (doing nothing: {plan.rest_cost:.2f}; largest"
        f" term: {worst}), {plan.samples} sequences in {1e3 * plan.times.total:.0f} ms"
    )
for axes in places[len(ALGORITHMS) :]:
    axes.remove()
draw_legend(figure, names, columns=3)
print(f"drawn into {write_png(figure, Path('planners.png'))}")
