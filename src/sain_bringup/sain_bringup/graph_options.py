"""Options of ``graph`` and ``live``, and their checks before any process starts."""

import shlex
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Final

import tyro

from sain_core.config import Config, option
from sain_core.errors import ConfigError, UntrustedFileError
from sain_core.model import check_model_name
from sain_core.observation import MASSES, ObservationConfig
from sain_core.shapes.shape import BOTTOMS, FEET
from sain_core.untrusted import read_yaml
from sain_eval.scenes.scenarios import SCENARIOS
from sain_live.settings import PageConfig
from sain_sim.camera.body_file import read_bodies
from sain_sim.world.engines import DEFAULT_ENGINE, ENGINE_HELP, check_engine
from sain_sim.world.truth import TRUTHS, TruthConfig

ELSEWHERE: Final = "elsewhere"  # the robot that is started by somebody else


@dataclass(frozen=True)
class GraphOptions(Config):
    """Start the whole graph and look after it: simulator, model, planner and recorder.

    It waits for goals, as `goal` and RViz send them. What dies or hangs is restarted, and goes on
    where it was. Three crashes within a minute end the graph, and so does the end of a process
    that did not crash. Ctrl-C ends all of them.
    """

    engine: str = option(DEFAULT_ENGINE, ENGINE_HELP)
    bottom: str = option(
        FEET, "what bodies stand on: three feet, or a flat bottom", choices=BOTTOMS
    )
    model: str = option("sain", "name of a model (sain, planar, identity) or path of a checkpoint")
    belief: str = option(
        "", "file of `sain_model identify`, with which each episode begins; empty: none"
    )
    seed: int = option(0, "of the first scene and of the planner", minimum=0)
    camera: Annotated[ObservationConfig, tyro.conf.arg(name="")] = ObservationConfig()
    robot: str = option(
        "",
        "command that starts a robot's driver, in place of the simulator; elsewhere: it is started"
        " by somebody else",
    )
    bodies: Path | None = option(None, "YAML file of the robot's bodies: their poses become scenes")
    gui: bool = option(False, "show the simulator's window, in real time")
    params_file: Path | None = option(
        None, "ROS parameters for the nodes (YAML), on top of their defaults"
    )
    record: bool = option(True, "record all topics")
    bag: Path | None = option(
        None, "folder to make for the recording; by default bags/<date>-<time>"
    )

    def __post_init__(self) -> None:
        """Check the fields, the model's name and the file of parameters."""
        super().__post_init__()
        check_model_name(self.model)
        check_engine(self.engine)
        if self.params_file is not None:
            _check_parameter_file(self.params_file)
        self._check_robot()

    @property
    def observed(self) -> ObservationConfig:
        """What planner and model have to be told of observations."""
        bodies = None if self.bodies is None else read_bodies(self.bodies)
        if bodies is None or bodies.weighed or MASSES in self.camera.unknown_names:
            return self.camera
        return replace(self.camera, unknown=",".join((*self.camera.unknown_names, MASSES)))

    def _check_robot(self) -> None:
        """Check that robot and bodies belong together, and that no option is the simulator's."""
        if self.bodies is not None and not self.robot:
            raise ConfigError("--bodies is for a robot; give --robot, too")
        if self.robot and (self.gui or self.engine != DEFAULT_ENGINE or self.bottom != FEET):
            raise ConfigError(
                "--robot replaces the simulator; --gui, --engine and --bottom are its"
            )
        try:
            words = shlex.split(self.robot)
        except ValueError as error:
            raise ConfigError(f"--robot is {self.robot!r}: {error}") from error
        if "--ros-args" in words:
            raise ConfigError("--robot has --ros-args; the graph adds its own to the command")
        if words and words[0] != ELSEWHERE and shutil.which(words[0]) is None:
            raise ConfigError(f"--robot is {self.robot!r}; there is no command {words[0]!r}")
        if self.bodies is not None:
            read_bodies(self.bodies)


@dataclass(frozen=True)
class LiveOptions(GraphOptions):
    """Start the whole graph and a page in the browser that shows and steers it.

    The page has the scene, goals to drag, the planner's settings, charts and a log. It prints its
    address. Only browsers on this computer can open it, unless --host says otherwise. What dies
    or hangs is restarted. Ctrl-C ends all of it.
    """

    scenario: str = option(
        "push_t", f"scene to begin with: {', '.join(SCENARIOS)}, or of an installed package"
    )
    world: str = option("randomised", "hidden truth about friction and contacts", choices=TRUTHS)
    host: str = option("127.0.0.1", "address to listen at; 0.0.0.0: open to other computers")
    port: int = option(8080, "port to listen at", minimum=1, maximum=65535)
    real_time_factor: float = option(
        1.0, "simulated time over wall time; 0: as fast as possible", minimum=0.0, maximum=100.0
    )

    def __post_init__(self) -> None:
        """Check the fields, those of the page, and that the engine simulates the world."""
        super().__post_init__()
        TruthConfig(self.world, engine=self.engine, bottom=self.bottom)
        _ = self.page

    @property
    def page(self) -> PageConfig:
        """The settings of the page."""
        return PageConfig(self.host, self.port, self.scenario, self.seed)


def _check_parameter_file(path: Path) -> None:
    try:
        content = read_yaml(path)
    except OSError as error:
        raise ConfigError(f"--params-file {path}: {error.strerror or error}") from error
    except UntrustedFileError as error:
        raise ConfigError(f"--params-file {path} is not read: {error}") from error
    nodes = content if isinstance(content, dict) else {}
    if not nodes or not all(
        isinstance(node, dict) and "ros__parameters" in node for node in nodes.values()
    ):
        raise ConfigError(
            f"--params-file {path} must hold, for each node, its name and below it ros__parameters"
        )
