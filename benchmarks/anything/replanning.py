"""Whether a stroke is to be corrected while it is made: pushes to a goal, with and without.

The world is our physics with parameters drawn from what is believed before any push, another draw
for each episode. The planner has the mean of them. Within a stroke, the pose of the body is seen
exactly, at once and 30 times a second: the most that correcting can gain. Each time, the rest of
the tool's path is chosen anew, of many straight ones from where the tool is: the one that leads the
body nearest to where the plan had it. The other way to know better is to infer the parameters from
pushes that were made, as the planner does by default.
"""

import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np
from numpy import ndarray

from benchmarks.report import markdown_table
from sain_core.cli.arguments import read_options
from sain_core.config import Config, option
from sain_core.push import (
    LENGTH,
    LOCATION,
    SPEED,
    START,
    PushLimits,
    make_stroke,
    push_direction,
    strokes,
)
from sain_core.randomness import generator
from sain_core.scene import POSITION, RADIUS, THETA, unit, wrap_angle
from sain_core.types import PushArray, Scene
from sain_core.world import Outcome, Setting
from sain_eval.loop.closed_loop import agent_maker
from sain_eval.loop.play import play
from sain_eval.scenes.anything import ANYTHING, AnythingScenario
from sain_eval.scenes.families import ScenarioScene
from sain_model.physics.parameters import BY_NAME, Parameter
from sain_model.physics.planar import PlanarConfig, PlanarPrior
from sain_mppi.agent.agent import AgentConfig

CORRECTED: Final = 1 / 30  # [s], between two corrections
TURNS, SHARES = np.radians(np.linspace(-50.0, 50.0, 21)), np.linspace(0.0, 1.5, 16)
TRIED: Final = np.array(list(product(TURNS, SHARES)))  # turns of the rest of a path, shares of it
NOTHING: Final = 1e-6  # [m]
BODIES: Final = ("push_t", "letter_r", "letter_i", "letter_y", "expo_box", "chicken_broth")


HIDDEN: Final = [p for p in BY_NAME.values() if p.spread and p.scope in ("body", "episode")]


@dataclass(frozen=True)
class Options(Config):
    """Compare pushes to a goal with and without corrections within strokes."""

    data: Path = option(Path("objects.json"), "file of outlines")
    bodies: tuple[str, ...] = option(BODIES, "names")
    goals: int = option(10, "of each body", minimum=1)
    seed: int = option(0, "of goals and hidden parameters", minimum=0)


class HiddenPhysics:
    """Our physics with hidden parameters; a stroke may be corrected while it is made."""

    def __init__(self, case: ScenarioScene, corrects: bool) -> None:
        """Draw the parameters of an episode; seeds of scenes give them."""
        self._scene, self._corrects = case.disks.copy(), corrects
        self._believed = PlanarPrior(bodies=case.bodies)
        random = generator(case.seed, "hidden", case.scenario)
        self._hidden = {one.name: np.array([drawn(one, random)]) for one in HIDDEN}

    def observe(self) -> Scene:
        """Return the scene, exactly."""
        return self._scene

    def reset(self, start: Setting) -> Scene:
        """Begin with another scene."""
        self._scene = start.scene
        return self._scene

    def push(self, push: PushArray, *, seen: Scene | None = None) -> Outcome:
        """Make a push, in one stroke or in many short ones."""
        before = self._scene
        start, heading = strokes(self._scene, push, PushLimits(), self._believed.bodies)
        rest = make_stroke(start, heading, push[LENGTH], speed=push[SPEED])
        wanted = self._believed.step(self._scene[None], rest[None])[0]
        most = float(push[SPEED]) * CORRECTED if self._corrects else np.inf
        while rest[LENGTH] > NOTHING:
            made = shortened(rest, min(most, float(rest[LENGTH])))
            self._scene = self._believed.step(self._scene[None], made[None], self._hidden)[0]
            tip = made[START] + made[LENGTH] * unit(push_direction(made))
            rest = self._corrected(rest, tip, float(rest[LENGTH] - made[LENGTH]), wanted)
        return Outcome(before, self._scene)

    def _corrected(self, rest: PushArray, tip: ndarray, left: float, wanted: Scene) -> PushArray:
        """Return the rest of a stroke: of those tried, the one that ends nearest to a scene."""
        if left <= NOTHING:
            return shortened(rest, 0.0)
        tried = np.tile(rest, (len(TRIED), 1))
        tried[:, START] = tip
        tried[:, LOCATION] += TRIED[:, 0]
        tried[:, LENGTH] = left * TRIED[:, 1]
        scenes = np.repeat(self._scene[None], len(tried), axis=0)
        off = self._believed.step(scenes, tried)[:, 0] - wanted[0]
        turn = wanted[0, RADIUS] * wrap_angle(off[:, THETA])
        return tried[int(np.argmin((off[:, POSITION] ** 2).sum(axis=-1) + turn**2))]


def drawn(one: Parameter, random: np.random.Generator) -> float:
    """Draw a parameter from what is believed of it before any push."""
    default = getattr(PlanarConfig(), one.name)
    way = one.spread * random.standard_normal()
    value = default * np.exp(way) if one.logarithm else default + way
    return float(np.clip(value, one.least, one.most))


def shortened(stroke: PushArray, length: float) -> PushArray:
    """Return the beginning of a stroke (11,), of a length [m]."""
    first = stroke.copy()
    first[LENGTH] = length
    return first


def play_all(options: Options, name: str, corrects: bool, learns: bool) -> list[int]:
    """Return pushes to each goal of a body; those of a goal that was not reached count, too."""
    scenario = AnythingScenario.named(f"{ANYTHING}:{name}", options.data)
    make = agent_maker("planar", AgentConfig(history=learns))
    pushes = []
    for seed in range(options.seed, options.seed + options.goals):
        case = scenario.scene(seed)
        world = HiddenPhysics(case, corrects)
        outcome = play(make(case), world, [case.goal], case.bodies, case.max_pushes)
        pushes.append(len(outcome.records[0].pushes))
    return pushes


def main() -> int:
    """Print pushes to a goal by body: as they are planned, corrected within, and inferred from."""
    options = read_options(Options, "python -m benchmarks.anything.replanning", sys.argv[1:])
    kinds = {"none": (False, False), "corrected": (True, False), "inferred": (False, True)}
    kinds["both"] = (True, True)
    found = {
        name: {kind: play_all(options, name, *how) for kind, how in kinds.items()}
        for name in options.bodies
    }
    rows = [
        [name.replace("_", " "), *(f"{np.mean(found[name][kind]):.1f}" for kind in kinds)]
        for name in options.bodies
    ]
    rows.append(["all", *(
        f"{np.mean([found[name][kind] for name in options.bodies]):.2f}" for kind in kinds
    )])  # fmt: skip
    print(markdown_table(["body", *kinds], rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
