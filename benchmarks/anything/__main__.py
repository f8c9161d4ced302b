"""``make anything DATA=PATH``: times in which the whole graph brings bodies to random goals."""

import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, islice, product
from pathlib import Path
from typing import Any, Final

from rich.console import Console

from benchmarks.anything import page
from benchmarks.anything.bodies import MOST_TAGS, place_tags
from benchmarks.anything.film import film
from benchmarks.anything.trial import Played, trial
from sain_arm.planning.arm_config import MotionConfig
from sain_arm.planning.push_planner import PushPlanner
from sain_bringup.graph import OUTLINES, TAGS, GraphOptions
from sain_core.cli.arguments import read_options
from sain_core.config import MOST_SEED, Config, option
from sain_core.errors import ConfigError, DatasetError, SainError
from sain_core.goal import Goal
from sain_core.guarding.documents import dump_yaml, read_json
from sain_core.output import claim_folder, write_json, write_whole
from sain_core.provenance import git_commit, processor
from sain_core.scene import RADIUS
from sain_core.shapes.body_file import outlined_bodies
from sain_core.shapes.library import own_bodies
from sain_core.shapes.outlines import BodyOutline, slug_of
from sain_eval.scenes.anything import ANYTHING, AnythingScenario
from sain_model.compute.kernel_store import compile_visibly
from sain_sim.bench.faults import NONE
from sain_sim.world.engines import MUJOCO
from sain_sim.world.workcell import WorldConfig

OBJECTS: Final = "objects.json"
TIMES: Final = "times.json"
RESULTS: Final = "results.json"
PAGE: Final = "anything.md"
FILM: Final = "anything.gif"
FILMED: Final = ("letter_r", "letter_y", "push_t", "chicken_broth", "wood_block", "clamp")
ROOM: Final = 0.025  # [m], for the tool around a body
MOST_DRAWS: Final = 10_000  # of goals


@dataclass(frozen=True)
class Options(Config):
    """Time how fast a simulated arm pushes bodies of Push Anything to random goals.

    Arm, camera, vision, planner, model and recorder run in real time on this machine. An
    interrupted run continues. The results are a page, anything.md, and a film, anything.gif.
    """

    data: Path | None = option(
        None, "file of outlines, or folder with objects.json, and times.json of others"
    )
    robots: tuple[str, ...] = option(("ur5", "panda"), "names or files of robots")
    see: tuple[str, ...] = option((TAGS,), f"how bodies are seen: {TAGS}, {OUTLINES}, or both")
    bodies: tuple[str, ...] = option(
        (), "names; A+B are two bodies on one table; none: each body of the file alone"
    )
    goals: int = option(20, "of each trial, one after another", minimum=1)
    seed: int = option(0, "of goals, masses and friction", minimum=0, maximum=MOST_SEED)
    film: tuple[str, ...] = option(
        FILMED, "bodies in the film, as --bodies has them; none: no film"
    )
    out: Path = option(
        Path("results/anything"), "folder of results; a run continues with those in it"
    )
    again: bool = option(False, "make page and film again, from the results in the folder")
    overwrite: bool = option(False, "replace what others wrote there")


def main() -> int:
    """Play what is not in the results yet, and write page and film."""
    console = Console(stderr=True, soft_wrap=True)
    try:
        options = read_options(Options, "python -m benchmarks.anything", sys.argv[1:])
        claim_folder(options.out, (RESULTS, PAGE, FILM), options.overwrite)
        path = options.out / RESULTS
        if options.again and not path.exists():
            raise ConfigError(f"there are no results in {options.out}; leave out --again")
        found = read_results(path)
        if not options.again:
            compile_visibly(console)
            for results in play_all(options, found, console):
                write_json(path, results)
        write_whole(options.out / PAGE, page.page(found).encode())
        if bags := recorded(options, found["trials"]):
            console.print(f"rendering the film of {', '.join(bags)}", markup=False)
            write_whole(options.out / FILM, film(bags))
    except SainError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def read_results(path: Path) -> dict[str, Any]:
    """Return the results in a file, or none; raises `DatasetError`: of goals without a commit."""
    found: dict[str, Any] = read_json(path) if path.exists() else {}
    for key, rows in found.get("trials", {}).items():
        if any("commit" not in goal for goal in rows["goals"]):
            raise DatasetError(
                f"{path} has goals of {key} without a commit: an earlier version played them, and"
                " gave the planner exact poses; choose another --out"
            )
    return found


def play_all(options: Options, found: dict[str, Any], console: Console) -> Iterator[dict[str, Any]]:
    """Play all trials that have no results yet; yield all results after each goal."""
    if options.data is None:
        raise ConfigError("outlines of bodies are needed: make anything DATA=PATH")
    file = options.data / OBJECTS if options.data.is_dir() else options.data
    outlines = own_bodies(file)
    found["theirs"] = read_times(file.with_name(TIMES))
    found["flat"] = {name: one.fair for name, one in outlines.items()}
    made = {"commit": git_commit(), "processor": processor(), "seed": options.seed}
    trials = found.setdefault("trials", {})
    for robot, see, names in product(options.robots, options.see, options.bodies or outlines):
        key = f"{robot} {see} {names}"
        rows = trials.setdefault(key, {"goals": [], "broken": []})
        done = len(rows["goals"])
        if done >= options.goals:
            continue
        folder = folder_of(options, key)
        bodies = folder / "bodies.yaml"
        content = {"bodies": rows_of(file, names.split("+"), outlines, see)}
        write_whole(bodies, dump_yaml(content).encode())
        graph = GraphOptions(
            robot=robot, engine=MUJOCO, faults=NONE, see=see, bodies=bodies, seed=options.seed,
            bag=folder / time.strftime("bag-%Y%m%d-%H%M%S"),
        )  # fmt: skip
        with trial(graph, folder) as run:
            for goal in islice(goals(names, file, robot, options.seed), done, options.goals):
                played = run.reach(goal)
                console.print(f"{key}: {describe(played)}", markup=False, highlight=False)
                rows["goals"].append(played.row() | made)
                yield found
        rows["broken"].append(run.report)
        yield found


def folder_of(options: Options, key: str) -> Path:
    """Return the folder of the logs and bags of a trial."""
    return options.out / "logs" / key.replace(" ", "-")


def recorded(options: Options, trials: Iterable[str]) -> dict[str, tuple[Path, str]]:
    """Return bags for the film, by titles, each with its robot; the last one of each trial.

    What has none is left out. Of several robots, it is the one that came first.
    """
    found: dict[str, tuple[Path, str]] = {}
    for names, key in product(options.film, trials):
        robot, _, others = key.split(" ")
        if names == others and (bags := sorted(folder_of(options, key).glob("bag-*"))):
            found.setdefault(names.replace("_", " "), (bags[-1], robot))
    return found


def goals(names: str, file: Path, robot: str, seed: int) -> Iterator[Goal]:
    """Yield goals as the protocol has them, of those around which the robot's tool finds room.

    Raises:
        ConfigError: there are none.
    """
    cell = WorldConfig(robot, MotionConfig())
    reach = cell.fitted(PushPlanner(cell.arm, config=cell.motion)).feasibility.reach
    scenario, missed = AnythingScenario.named(f"{ANYTHING}:{names}", file), 0
    for number in count(seed):
        case = scenario.scene(number)
        sizes = case.disks[:, RADIUS] * [shape.circumradius for shape in case.bodies.shapes]
        if (reach.room(case.goal.places) >= sizes + ROOM).all():
            missed = 0
            yield case.goal
        elif (missed := missed + 1) > MOST_DRAWS:
            raise ConfigError(f"{robot} finds room around no goal of {names}")


def rows_of(
    file: Path, names: Sequence[str], outlines: Mapping[str, BodyOutline], see: str
) -> list[dict[str, Any]]:
    """Return rows for a file of these bodies, of unknown mass, with tags where these are seen."""
    stated, rows = outlined_bodies(outlines, names), []
    for body, name in enumerate(names):
        radius = stated.radii[body]
        row: dict[str, Any] = {
            "name": stated.names[body],
            "shape": f"{file.absolute()}:{name}:flat",
        }
        row |= {"role": "pushable", "radius": radius, "height": stated.heights[body]}
        if see == TAGS:
            outline = stated.bodies.shapes[body].outline(radius)
            row["tags"] = place_tags(outline, MOST_TAGS * body)
        rows.append(row)
    return rows


def read_times(path: Path) -> dict[str, list[float]]:
    """Return times to goal [s] of others by body, where a file has them."""
    objects = read_json(path)["objects"] if path.exists() else {}
    return {slug_of(name): one["times"] for name, one in objects.items()}


def describe(played: Played) -> str:
    """Return in a line what came of a goal."""
    how = played.failure or f"{played.seconds:.1f} s"
    return (
        f"{how}, {played.pushes} pushes, {played.refused} refused, {played.off_mm:.1f} mm,"
        f" {played.off_degrees:.1f} degrees, {played.at_rest:.0%} at rest, {played.busy:.0%} busy"
    )


if __name__ == "__main__":
    sys.exit(main())
