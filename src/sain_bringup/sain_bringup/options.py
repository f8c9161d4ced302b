"""What the closed loop can be asked for, and the checks that come before anything starts."""

import difflib
import os
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro
import yaml

from sain_core.errors import ConfigError, OutputError
from sain_core.plugins import check_model_name
from sain_eval.scenes.scenarios import SCENARIOS

RECORDINGS: Final = Path("bags")
DEMO: Final = (("anywhere", 3), ("paper", 1))
LARGEST_TOLERANCE: Final = 0.20  # [m]


@dataclass(frozen=True)
class ClosedLoopOptions:
    """Run the closed loop on the whole graph: simulator, model, planner and recorder.

    Starts the four as processes of their own, plays episodes, and writes a recording, a top view
    of each episode, a moving picture and a summary. Without options it plays the demo: three
    `anywhere` episodes and one `paper` episode, each to 2 cm.
    """

    episodes: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Episodes to play; by default 1 of a chosen scenario."""
    scenario: str | None = None
    """paper, paper_shift, paper_cube, anywhere, clutter, anywhere_cube or anywhere_rubber; by
    default the demo's."""
    seed: int = 0
    """Of the first episode; the next one has the next seed."""
    tolerance: float = 0.02
    """How near the goal is near enough [m]."""
    model: str = "sain"
    """What predicts: a name (sain, planar, identity) or the path of a checkpoint."""
    out: Path | None = None
    """Folder to make for the results; by default bags/closed_loop-<date>-<time>."""
    gui: bool = False
    """Show the simulator's window, in real time."""
    video: bool = True
    """Render the moving picture at the end."""
    params_file: Path | None = None
    """ROS parameters for the nodes (YAML), on top of their defaults."""
    timeout: float = 60.0
    """Longest wait for the graph to start, or for anything to happen in an episode [s]."""


@dataclass(frozen=True)
class EpisodePlan:
    """One episode to play."""

    scenario: str
    seed: int


def episode_plans(options: ClosedLoopOptions) -> tuple[EpisodePlan, ...]:
    """Return the episodes to play.

    Raises:
        ConfigError: no such scenario, or fewer than one episode.
    """
    if options.scenario is None and options.episodes is None:
        wanted = [name for name, count in DEMO for _ in range(count)]
    else:
        wanted = [options.scenario or DEMO[0][0]] * (
            1 if options.episodes is None else options.episodes
        )
    for name in wanted:
        if name not in SCENARIOS:
            near = difflib.get_close_matches(name, SCENARIOS, n=1)
            hint = f" (did you mean {near[0]!r}?)" if near else ""
            raise ConfigError(f"scenario {name!r} is unknown{hint}; known: {', '.join(SCENARIOS)}")
    if not wanted:
        raise ConfigError(f"--episodes is {options.episodes}; it must be at least 1")
    return tuple(EpisodePlan(name, options.seed + number) for number, name in enumerate(wanted))


def describe(plans: Sequence[EpisodePlan], options: ClosedLoopOptions) -> str:
    """Return in a few words what is going to be played."""
    counts = Counter(plan.scenario for plan in plans)
    what = ", ".join(f"{count} × {name}" for name, count in counts.items())
    return f"{what}, to {1e3 * options.tolerance:g} mm, with {options.model}"


def check_options(options: ClosedLoopOptions) -> None:
    """Check everything that can be checked before a process starts.

    Raises:
        ConfigError: naming the option, its value and what is allowed.
    """
    episode_plans(options)
    check_model_name(options.model)
    if not 0.0 < options.tolerance <= LARGEST_TOLERANCE:
        raise ConfigError(
            f"--tolerance is {options.tolerance} m; it must be above 0 and at most"
            f" {LARGEST_TOLERANCE} m"
        )
    if options.seed < 0:
        raise ConfigError(f"--seed is {options.seed}; it must not be negative")
    if not options.timeout > 0.0:
        raise ConfigError(f"--timeout is {options.timeout} s; it must be positive")
    if options.params_file is not None:
        _check_parameter_file(options.params_file)


def make_output_folder(options: ClosedLoopOptions) -> Path:
    """Make the folder for the results, and show that it can be written.

    Raises:
        OutputError: it exists and is not empty, or cannot be written.
    """
    folder = options.out or RECORDINGS / time.strftime("closed_loop-%Y%m%d-%H%M%S")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise OutputError(f"{folder} exists; results are never overwritten, choose another --out")
    probe = folder / ".probe"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.write_bytes(os.urandom(1 << 16))
        probe.unlink()
    except OSError as error:
        raise OutputError(f"cannot write to {folder}: {error.strerror or error}") from error
    return folder


def _check_parameter_file(path: Path) -> None:
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"--params-file {path}: {error.strerror or error}") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"--params-file {path} is not YAML: {' '.join(str(error).split())}"
        ) from error
    nodes = content if isinstance(content, dict) else {}
    if not nodes or not all(
        isinstance(node, dict) and "ros__parameters" in node for node in nodes.values()
    ):
        raise ConfigError(
            f"--params-file {path} must hold, for each node, its name and below it ros__parameters"
        )
