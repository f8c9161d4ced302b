"""The processes of the graph: which executables, with which arguments."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sain_core.errors import ConfigError

SIMULATOR: Final = "simulator"
MODEL: Final = "model"
PLANNER: Final = "planner"
RECORDER: Final = "recorder"


@dataclass(frozen=True)
class GraphConfig:
    """What the processes are started with."""

    namespace: str  # for example /sain
    model: str
    seed: int
    bag: Path
    real_time_factor: float = 0.0
    gui: bool = False
    params_file: Path | None = None
    custom_data: tuple[tuple[str, str], ...] = ()
    ros_arguments: tuple[str, ...] = ()  # further ones, for every node


def graph_commands(config: GraphConfig) -> dict[str, list[str]]:
    """Return the command of each process, by its name; the one that starts slowest comes first.

    Raises:
        ConfigError: a package of the graph is not installed.
    """
    # The recording is watched later, so the arm moves all the way and is not set down.
    simulator: dict[str, object] = {
        "real_time_factor": config.real_time_factor,
        "bullet.full_motion": True,
    }
    planner: dict[str, object] = {"dynamics": "service", "seed": config.seed}
    if config.gui:
        simulator["gui"] = True
    recorder = ["--out", str(config.bag), "--custom-data"]
    recorder += [f"{key}={value}" for key, value in config.custom_data]
    return {
        MODEL: _command(config, "sain_model", "model_node", {"model": config.model}),
        RECORDER: _command(config, "sain_bags", "record", {}, recorder),
        SIMULATOR: _command(config, "sain_sim", "sim_node", simulator),
        PLANNER: _command(config, "sain_mppi", "mppi_node", planner),
    }


def executable(package: str, name: str) -> Path:
    """Return the file that ``ros2 run PACKAGE NAME`` starts.

    Raises:
        ConfigError: it is not installed.
    """
    prefixes = [p for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    for prefix in prefixes:
        path = Path(prefix, "lib", package, name)
        if os.access(path, os.X_OK):
            return path
    raise ConfigError(
        f"{package} {name} is not installed under AMENT_PREFIX_PATH; run inside ./env, or source"
        " the workspace's install/setup.bash"
    )


def _command(
    config: GraphConfig,
    package: str,
    name: str,
    parameters: dict[str, object],
    arguments: list[str] | None = None,
) -> list[str]:
    ros = ["-r", f"__ns:={config.namespace}", *config.ros_arguments]
    if config.params_file is not None and package != "sain_bags":
        ros += ["--params-file", str(config.params_file)]
    for key, value in parameters.items():
        ros += ["-p", f"{key}:={_yaml(value)}"]
    return [str(executable(package, name)), *(arguments or []), "--ros-args", *ros]


def _yaml(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
