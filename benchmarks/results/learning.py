"""What a learner gains in laboratories that it does not know, push by push of ordinary work.

    ./env python -m benchmarks.results.learning --out results/learning --lab rough_101   # each lab
    ./env python -m benchmarks.results.learning --out results/learning                   # figures

With `--replay results/learning`, another learner learns from the same pushes: a tenth of the time.
The planner brings targets to goals of `anywhere` within 0.5 cm, with the model in service in the
laboratory. Every push is predicted by planar physics, by the shipped model, and by the model in
service, all with the earlier pushes of the episode, before it is learned from. A training ends
`TRAINING` pushes after it began, as on a robot that needs 6 s a push. What was stopped goes on.

`others` is a table-like world that nothing here was fitted to: soft contacts, a tool that is off,
friction that is twice as large along y, and in each episode bodies with other centres of mass.
`drawn` is the same with drawn pushes: how far the k-th push of a body errs less than its first.
"""

import argparse
import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from math import cos, hypot, pi, sin
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.report import Figure, report
from sain_core.errors import BlockedError, OffTableError, SainError, UnreachableError
from sain_core.model import RolloutModel, load_dynamics
from sain_core.output import claim_folder, make_folder, write_json
from sain_core.push import pushed_bodies
from sain_core.randomness import Interval, bootstrap_ratio, generator
from sain_core.scene import is_settled
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.shape import FLAT
from sain_core.transitions import PushHistory
from sain_core.types import PredictedScenes, PushArray, PushSequences, Scene
from sain_core.world import AnyWorld
from sain_eval.loop.play import Sight, play
from sain_eval.scenes.families import ScenarioScene
from sain_eval.scenes.scenarios import draw_scene
from sain_lab.learner import Learner
from sain_lab.storage.laboratory import Laboratory
from sain_lab.storage.results import Result
from sain_model.compute.kernel_store import compile_kernels
from sain_mppi.agent.agent import AgentConfig, planning_agent
from sain_sim.collecting.episode import draw_outline_push
from sain_sim.engines import mujoco_cell
from sain_sim.world.engines import BULLET, MUJOCO
from sain_sim.world.own import open_world
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.start import wholly_on
from sain_sim.world.truth import MEASURED, ROUGH, TruthConfig
from sain_sim.world.workcell import WorldConfig

OTHERS: Final = "others"
DRAWN: Final = "drawn"
MOST_OFFSET: Final = 0.3  # [radii], of the centre of mass there
GRAIN: Final = 2.0  # friction along y over friction along x there
STRANGE: Final = TruthConfig(MEASURED, "soft,offset,grip", lab=777, engine=MUJOCO, bottom=FLAT)
LABS: Final = {
    "mujoco": TruthConfig(engine=MUJOCO),
    OTHERS: STRANGE,
    DRAWN: STRANGE,
    **{f"rough_{lab}": TruthConfig(ROUGH, lab=lab, engine=BULLET) for lab in (101, 102, 103)},
    **{f"measured_{lab}": TruthConfig(MEASURED, lab=lab, engine=MUJOCO) for lab in (101, 102)},
}
SEED: Final = 300_000  # of the first scene
PUSHES: Final = 350
TOLERANCE: Final = 0.005  # [m]
TRIES: Final = 50  # of a drawn push
TRAINING: Final = 10  # pushes
NEXT: Final = 50  # pushes that the error of the next one is the mean of
TARGETS: Final = {25: (0.85, 0.95), 100: (0.75, 0.85), 300: (0.65, 0.8)}  # others: the second
WORST: Final = 1.03
EPISODE: Final = 16  # drawn pushes
OF_BODY: Final = {3: 0.8, 6: 0.7}  # number of a body's push: most of its error over the first's
SHIPPED, PLANAR, SERVICE = "shipped", "planar", "service"


class GrainedCell(mujoco_cell.MujocoCell):
    """A cell where friction is larger for bodies that move along the world's y."""

    def advance(self) -> None:
        """Simulate one control step."""
        for feet, (x, y) in zip(self._feet, self.states().speeds[:, :2].tolist(), strict=True):
            along = (y / way) ** 2 if (way := hypot(x, y)) > 1e-4 else 0.5
            self._model.geom_friction[feet, 0] = GRAIN ** (along - 0.5) * self._slip[feet]
        super().advance()


def of_others(parameters: WorldParameters, seed: int) -> WorldParameters:
    """Return a world where each body's centre of mass is anywhere."""
    random, offsets = generator(seed, OTHERS), []
    for _ in range(parameters.count):
        away, bearing = MOST_OFFSET * random.uniform() ** 0.5, random.uniform(-pi, pi)
        offsets.append((float(away * cos(bearing)), float(away * sin(bearing))))
    return replace(parameters, roughness=replace(parameters.roughness, mass_offsets=tuple(offsets)))


class InService:
    """What is in service in a laboratory, whenever a plan asks: a `RolloutModel`."""

    def __init__(self, learner: Learner) -> None:
        self._learner = learner

    def with_bodies(self, bodies: Bodies) -> RolloutModel:
        """Return what is in service now, for these bodies."""
        return self._learner.model.with_bodies(bodies)

    def condition(self, history: PushHistory) -> RolloutModel:
        """Return what is in service now, conditioned."""
        return self._learner.model.condition(history)

    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        """Predict with what is in service now."""
        return self._learner.model.rollout(scene, pushes)

    def regions(self, scene: Scene, pushes: PushSequences, predicted: PredictedScenes) -> None:
        """Return None: regions come from the model with bodies."""


class Watched(Sight):
    """A world whose pushes are learned from."""

    def __init__(
        self,
        world: AnyWorld[Any],
        learn: Callable[[Result], None],
        bodies: Bodies,
        episode: str,
    ) -> None:
        super().__init__(world)
        self._learn, self._bodies, self._episode = learn, bodies, episode

    def push(self, push: PushArray, seen: Scene) -> Scene:
        """Execute a push, and learn from it."""
        before = self.world.observe()
        after = super().push(push, seen)
        if is_settled(after):
            self._learn(Result(push, before, after, bodies=self._bodies, episode=self._episode))
        return after


def push_anywhere(watched: Watched, bodies: Bodies, seed: int, pushes: int) -> None:
    """Carry out drawn pushes of all bodies, until one leaves the table or none is possible."""
    random = generator(seed, DRAWN)
    for _ in range(pushes):
        scene, done = watched.world.observe(), False
        for _ in range(TRIES):
            push = draw_outline_push(random, scene, bodies.fitted(len(scene)))
            with suppress(UnreachableError, BlockedError, OffTableError):
                watched.push(push, scene)
                done = True
                break
        if not done or not wholly_on(watched.world.observe(), WorldConfig().feasibility.table):
            return


@dataclass
class Work:
    """The work of one laboratory, and what was measured of it."""

    name: str
    folder: Path
    learner: Learner

    def __post_init__(self) -> None:
        """Read what was measured before."""
        self.path = self.folder / f"{self.name}.jsonl"
        text = self.path.read_text() if self.path.exists() else ""
        self.rows = [json.loads(line) for line in text.splitlines()]
        self.due: int | None = None

    def case(self, seed: int) -> ScenarioScene:
        """Return a scene of this laboratory."""
        case = draw_scene("anywhere", seed)
        return case.within(LABS[self.name])

    def run(self, pushes: int) -> None:
        """Work until there are so many pushes."""
        seed = self.rows[-1]["seed"] + 1 if self.rows else SEED
        config, planar = AgentConfig(), load_dynamics(PLANAR)
        while len(self.rows) < pushes:
            case = self.case(seed)
            parameters = case.parameters()
            if case.truth == STRANGE:
                parameters = of_others(parameters, seed)
            with open_world(parameters, WorldConfig(), engine=case.truth.engine) as world:
                world.reset(case.disks)
                agent = planning_agent(InService(self.learner), planar, config)
                goal = case.goal.within(TOLERANCE, 5 * TOLERANCE)
                watched = Watched(world, self.learn, parameters.bodies, f"{self.name}/{case.seed}")
                left = pushes - len(self.rows)
                try:
                    if self.name == DRAWN:
                        push_anywhere(watched, parameters.bodies, seed, min(EPISODE, left))
                    else:
                        most = min(case.max_pushes, left)
                        play(agent, watched, [goal], parameters.bodies, most)
                except SainError as error:
                    print(f"{self.name} scene {seed}: {error}", flush=True)
            seed += 1

    def replay(self, folder: Path, pushes: int) -> None:
        """Learn from the first pushes of the same laboratory in another folder."""
        records = Laboratory(folder / self.name).records()
        results = [Result.of_record(record) for record in records if record["kind"] == "push"]
        for result in results[len(self.rows) : pushes]:
            self.learn(result)

    def learn(self, result: Result) -> None:
        """Learn from a push, and keep what was measured of it."""
        update, judge = self.learner.observe(result), self.learner.state.judge
        service = update.errors.get(judge.service, float("nan"))
        row = {"seed": int(result.episode.rpartition("/")[2]), "errors": dict(update.errors)}
        row |= {"body": int(pushed_bodies(result.push))}
        row |= {SERVICE: service, "reason": update.reason, "model": judge.service}
        events = [f"{event.kind}: {event.text}" for event in update.events]
        if any(event.kind == "training" for event in update.events):
            self.due = len(self.rows) + TRAINING
        if self.due is not None and len(self.rows) >= self.due:
            events += [f"{event.kind}: {event.text}" for event in self.learner.wait()]
            self.due = None
        row["events"] = events
        self.rows.append(row)
        with self.path.open("a") as file:
            file.write(json.dumps(row) + "\n")
        for event in events:
            print(f"{self.name} {len(self.rows)}: {event}", flush=True)


def figures_of(name: str, rows: list[dict[str, Any]]) -> Iterator[tuple[Figure, Interval]]:
    """Yield the figures of a laboratory with their intervals."""
    rows = [row for row in rows if not row["reason"] and PLANAR in row["errors"]]
    planar = np.array([row["errors"][PLANAR] for row in rows])
    shipped = np.array([row["errors"][SHIPPED] for row in rows])
    service = np.array([row[SERVICE] for row in rows])
    seeds = np.array([row["seed"] for row in rows])

    def ratio(above: np.ndarray, below: np.ndarray, some: slice) -> Interval:
        return bootstrap_ratio(above[some], below[some], generator(0, "learning"), seeds[some])

    if name == DRAWN:
        yield from of_bodies(rows)
        return
    for count, targets in TARGETS.items():
        some = slice(count, count + NEXT)
        if len(rows) < count + NEXT // 3:
            continue
        most = targets[name == OTHERS]
        found = ratio(service, planar, some)
        yield Figure(f"{name}: after {count} pushes, over planar", found[0], "", most), found
        found = ratio(shipped, planar, some)
        yield Figure(f"{name}: shipped after {count} pushes, over planar", found[0], ""), found
    if len(rows) >= NEXT:
        means = [
            ratio(service, planar, slice(first, first + NEXT))
            for first in range(len(rows) - NEXT + 1)
        ]
        worst = max(means)
        yield Figure(f"{name}: worst {NEXT} pushes, over planar", worst[0], "", WORST), worst


def of_bodies(rows: list[dict[str, Any]]) -> Iterator[tuple[Figure, Interval]]:
    """Yield errors of the k-th push of each body, over those of its first."""
    bodies: dict[tuple[int, int], list[dict[str, Any]]] = {}
    for row in rows:
        bodies.setdefault((row["seed"], row["body"]), []).append(row)
    longest = max(OF_BODY)
    long = {key: some[:longest] for key, some in bodies.items() if len(some) >= longest}
    if not long:
        return
    seeds = np.array([seed for seed, _ in long])
    for model in (SERVICE, SHIPPED, PLANAR):
        errors = np.array([[{**row, **row["errors"]}[model] for row in r] for r in long.values()])
        for count, most in OF_BODY.items():
            found = bootstrap_ratio(
                errors[:, count - 1], errors[:, 0], generator(0, "learning"), seeds
            )
            wanted = most if model == SERVICE else None
            name = f"{DRAWN}: {model}, push {count} of a body over its first"
            yield Figure(name, found[0], "", wanted), found


def main() -> None:
    """Work in one laboratory, or report of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--lab", choices=tuple(LABS))
    parser.add_argument("--pushes", type=int, default=PUSHES)
    parser.add_argument("--replay", type=Path, help="earlier --out, whose pushes are learned from")
    options = parser.parse_args()
    make_folder(claim_folder(options.out, ("intervals.json",)))
    if options.lab:
        compile_kernels()
        if LABS[options.lab] == STRANGE:
            vars(mujoco_cell)["MujocoCell"] = GrainedCell
        with Learner.named(str((options.out / options.lab).absolute())) as learner:
            work = Work(options.lab, options.out, learner)
            if options.replay:
                work.replay(options.replay, options.pushes)
            else:
                work.run(options.pushes)
        return
    figures, intervals = [], {}
    for name in LABS:
        path = options.out / f"{name}.jsonl"
        rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
        for figure, interval in figures_of(name, rows):
            figures.append(figure)
            intervals[figure.name] = interval
    report("Learning in unknown laboratories", figures, options.out / "results.json")
    write_json(options.out / "intervals.json", intervals)


if __name__ == "__main__":
    main()
