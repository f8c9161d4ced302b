"""The processes of the graph: which executables, with which arguments."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from sain_bringup.options import ClosedLoopOptions
from sain_core.errors import ConfigError
from sain_core.observation import told_settings
from sain_sim.world.engines import BULLET

SIMULATOR: Final = "simulator"
MODEL: Final = "model"
PLANNER: Final = "planner"
RECORDER: Final = "recorder"


def graph_commands(
    options: ClosedLoopOptions, namespace: str, bag: Path, custom_data: Mapping[str, str]
) -> dict[str, list[str]]:
    """Return the command of each process, by its name; the one that starts slowest comes first.

    The recorder puts the custom data into the bag.

    Raises:
        ConfigError: a package of the graph is not installed.
    """
    # The recording is watched later, so the arm moves all the way and is not set down.
    simulator = {"bullet.full_motion": "true"}
    if options.engine != BULLET:
        simulator |= {"engine": options.engine}
    told = told_settings(options.camera)
    simulator |= {f"camera.{name}": str(value) for name, value in told.items()}
    planner = {f"estimator.{name}": str(value) for name, value in told.items()}
    if options.gui:
        simulator |= {"gui": "true", "real_time_factor": "1.0"}
    model = {"belief": str(Path(options.belief).absolute())} if options.belief else {}
    if options.camera.unknown:
        model["unknown"] = options.camera.unknown
    about = [f"{key}={value}" for key, value in custom_data.items()]
    recorder = [str(executable("sain_bags", "record")), "--out", str(bag), "--custom-data", *about]

    def node(package: str, name: str, **parameters: str) -> list[str]:
        files = [] if options.params_file is None else ["--params-file", str(options.params_file)]
        given = [word for key, value in parameters.items() for word in ("-p", f"{key}:={value}")]
        return [str(executable(package, name)), *to_namespace, *files, *given]

    simulated = {"use_sim_time": "true"}  # the simulator's time is in all headers
    to_namespace = ["--ros-args", "-r", f"__ns:={namespace}"]
    return {
        MODEL: node("sain_model", "model_node", model=options.model, **model, **simulated),
        RECORDER: [*recorder, *to_namespace],
        SIMULATOR: node("sain_sim", "sim_node", **simulator),
        PLANNER: node(
            "sain_mppi",
            "mppi_node",
            dynamics="service",
            seed=str(options.seed),
            **planner,
            **simulated,
        ),
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
