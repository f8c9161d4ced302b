"""Options of this package's commands, and the checks before any process starts."""

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro

from sain_bringup.graph_options import GraphOptions
from sain_core.config import Config, option
from sain_core.errors import OutputError
from sain_core.observation import ObservationConfig, changed_settings
from sain_core.push import DEFAULT_SPEED
from sain_core.shapes.shape import BOTTOMS, FEET
from sain_core.storage import make_folder
from sain_eval.scenes.scenarios import OFFERED, SCENARIOS
from sain_sim.world.engines import BULLET, DEFAULT_ENGINE, ENGINE_HELP

NAMESPACE: Final = "sain"  # as `sain_core.ros.node_main` has it, which needs rclpy
RECORDINGS: Final = Path("bags")
NAMESPACE_KEY: Final = "namespace"  # of a bag's custom data: of the graph that made it
EPISODES_KEY: Final = "episodes"  # of a bag's custom data: "scenario:seed scenario:seed ..."
DEMO: Final = (("anywhere", 3), ("paper", 1), ("push_t", 1))


@dataclass(frozen=True)
class ClosedLoopOptions(Config):
    """Run the closed loop on the whole graph: simulator, model, planner and recorder.

    Starts the four as separate processes, plays episodes, and writes a recording, a top view
    of each episode, a moving picture and a summary. Without options it plays the demo: three
    `anywhere` episodes, one `paper` and one `push_t` episode, each to 2 cm.
    """

    episodes: Annotated[int | None, tyro.conf.arg(metavar="N")] = option(
        None, "episodes to play; by default 1 of a chosen scenario", minimum=1
    )
    scenario: str | None = option(
        None,
        f"one of {', '.join(SCENARIOS)}, or of an installed package; by default those of the demo",
    )
    seed: int = option(0, "seed of the first episode; the next one has the next seed", minimum=0)
    tolerance: float = option(
        0.02,
        "largest distance from the goal that counts as reached",
        unit="m",
        minimum=1e-4,
        maximum=0.2,
    )
    engine: str = option(DEFAULT_ENGINE, ENGINE_HELP)
    bottom: str = option(
        FEET, "what bodies stand on: three feet, or a flat bottom", choices=BOTTOMS
    )
    model: str = option("sain", "name of a model (sain, planar, identity) or path of a checkpoint")
    belief: str = option(
        "", "file of `sain_model identify`, with which each episode begins; empty: none"
    )
    camera: Annotated[ObservationConfig, tyro.conf.arg(name="")] = ObservationConfig()
    out: Path | None = option(
        None, "folder to make for the results; by default bags/closed_loop-<date>-<time>"
    )
    gui: bool = option(False, "show the simulator's window, in real time")
    video: bool = option(True, "render the moving picture at the end")
    params_file: Path | None = option(
        None, "ROS parameters for the nodes (YAML), on top of their defaults"
    )
    timeout: float = option(
        60.0,
        "longest wait for the graph to start, or for an event in an episode",
        unit="s",
        minimum=0.1,
    )

    def __post_init__(self) -> None:
        """Check the fields, the model's name, the scenario and the file of parameters."""
        super().__post_init__()
        if self.scenario is not None:
            OFFERED.check(self.scenario)
        self.graph(None)  # which checks what concerns the graph

    def graph(self, bag: Path | None) -> GraphOptions:
        """Return the options of the graph that records to a folder."""
        return GraphOptions(
            engine=self.engine,
            bottom=self.bottom,
            model=self.model,
            belief=self.belief,
            seed=self.seed,
            camera=self.camera,
            gui=self.gui,
            params_file=self.params_file,
            bag=bag,
        )


@dataclass(frozen=True)
class PushOptions(Config):
    """Send one push to the simulator and print what became of it.

    Exits with 0 when the push was carried out, and with the error code of the refusal when not.
    """

    location: float = option(
        0.0,
        "where the tool touches: of a disk the heading from there to its centre, 0: along +x; of"
        " another body 2 pi times the share of its outline",
        unit="rad",
    )
    angle: float = option(
        0.0, "direction of travel relative to straight inward, -pi/4 to pi/4", unit="rad"
    )
    length: float = option(0.1, "travel of the tool, 0 to 0.15", unit="m")
    speed: float = option(DEFAULT_SPEED, "of the tool, 0.01 to 0.5", unit="m/s")
    body: int = option(0, "body to push, as counted in the scene", minimum=0, maximum=2**32 - 1)
    timeout: float = option(10.0, "longest wait for the simulator", unit="s", minimum=0.0)


@dataclass(frozen=True)
class GoalOptions(Config):
    """Give the planner a goal, print each push on the way, and how it ended.

    The place is that of the target, body 1, or that of `--body`. Ctrl-C cancels the goal. Exits
    with 0 when it was reached, and otherwise with the error code or 1.
    """

    x: Annotated[float, tyro.conf.Positional, tyro.conf.arg(metavar="X")] = option(
        0.6, "where to, along +x", unit="m"
    )
    y: Annotated[float, tyro.conf.Positional, tyro.conf.arg(metavar="Y")] = option(
        0.0, "where to, along +y", unit="m"
    )
    heading: float | None = option(None, "of the body; by default any will do", unit="rad")
    body: int | None = option(
        None, "body to bring there, as counted in the scene", minimum=0, maximum=2**32 - 1
    )
    tolerance: float = option(
        0.02, "largest distance that counts as reached", unit="m", minimum=1e-4, maximum=0.2
    )
    max_pushes: int = option(30, "pushes after which to give up; 0: never", minimum=0)
    timeout: float = option(10.0, "longest wait for the planner", unit="s", minimum=0.0)


@dataclass(frozen=True)
class ResetOptions(Config):
    """Begin another episode in the simulator, and print where its bodies are."""

    seed: int = option(0, "of the episode", minimum=0, maximum=2**32 - 1)
    timeout: float = option(10.0, "longest wait for the simulator", unit="s", minimum=0.0)


@dataclass(frozen=True)
class WatchOptions(Config):
    """Print the messages of a topic, or list the topics when none is given."""

    topic: Annotated[str, tyro.conf.Positional] = option(
        "", "for example scene, push_result or /clock"
    )
    count: int = option(0, "end after so many messages; 0: at Ctrl-C", minimum=0)
    timeout: float = option(10.0, "longest wait for topics to appear", unit="s", minimum=0.0)


@dataclass(frozen=True)
class EpisodePlan:
    """One episode to play."""

    scenario: str
    seed: int


def episode_plans(options: ClosedLoopOptions) -> tuple[EpisodePlan, ...]:
    """Return the episodes to play."""
    if options.scenario is None and options.episodes is None:
        wanted = [name for name, count in DEMO for _ in range(count)]
    else:
        wanted = [options.scenario or DEMO[0][0]] * (options.episodes or 1)
    return tuple(EpisodePlan(name, options.seed + number) for number, name in enumerate(wanted))


def describe(plans: Sequence[EpisodePlan], options: ClosedLoopOptions) -> str:
    """Return in a few words what is going to be played."""
    counts = Counter(plan.scenario for plan in plans)
    what = ", ".join(f"{count} × {name}" for name, count in counts.items())
    engine = "" if options.engine == BULLET else f" in {options.engine}"
    engine += "" if options.bottom == FEET else f" on {options.bottom} bottoms"
    seen = "".join(f", {name} {value}" for name, value in changed_settings(options.camera).items())
    return f"{what}, to {1e3 * options.tolerance:g} mm, with {options.model}{engine}{seen}"


def make_output_folder(options: ClosedLoopOptions) -> Path:
    """Make the folder for the results, and show that it can be written.

    Raises:
        OutputError: it exists and is not empty, or cannot be written.
    """
    folder = options.out or RECORDINGS / time.strftime("closed_loop-%Y%m%d-%H%M%S")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise OutputError(f"{folder} exists; results are never overwritten, choose another --out")
    return make_folder(folder)
