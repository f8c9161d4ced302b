"""Close the loop with the real arm and without ROS: three seeded scenes, one picture.

./env python examples/03_closed_loop_without_ros.py [picture.png]
"""

import sys
from pathlib import Path

from sain_core.view.figures import write_png
from sain_eval.loop.closed_loop import agent_maker, run_episode
from sain_eval.plots.pictures import draw_episode
from sain_eval.scenes.scenarios import SCENARIOS

picture = Path(sys.argv[1]) if len(sys.argv) > 1 else None
for seed in range(3):
    case = SCENARIOS["anywhere"].scene(seed)
    outcome = run_episode(case, agent_maker("planar")(case), tolerance=0.01)
    left = 1e3 * outcome.record.last.distance
    verdict = outcome.failure or "reached"
    print(f"scene {seed}: {len(outcome.record.pushes)} pushes, {left:.1f} mm left: {verdict}")
    if picture and seed == 0:
        write_png(draw_episode(outcome.record), picture)
