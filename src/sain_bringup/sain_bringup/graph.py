"""The processes of the graph: which executables, with which arguments."""

import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from sain_bringup.graph_options import ELSEWHERE, GraphOptions, LiveOptions
from sain_bringup.options import NAMESPACE
from sain_core.cli.command_line import executable, split_ros_arguments
from sain_core.observation import changed_settings
from sain_core.shapes.shape import FEET
from sain_sim.world.engines import DEFAULT_ENGINE

SIMULATOR: Final = "simulator"
ROBOT: Final = "robot"
POSES: Final = "poses"
MODEL: Final = "model"
PLANNER: Final = "planner"
RECORDER: Final = "recorder"
PAGE: Final = "page"
FLUSH_PERIOD: Final = "0.25"  # [s], at most so much is lost with the recorder


def graph_commands(
    options: GraphOptions,
    ros: Sequence[str],
    states: Path,
    custom_data: Mapping[str, str] | None = None,
    full_motion: bool = False,
) -> dict[str, list[str]]:
    """Return the command of each process, by its name; the one that starts slowest comes first.

    Args:
        options: of the graph; without a bag nothing is recorded. `LiveOptions` add the page.
        ros: arguments for ROS of every node, as `ros_arguments` returns them.
        states: folder for what nodes go on from after a crash.
        custom_data: what the bag should say about itself.
        full_motion: let the arm move all the way, for whom watches the recording, and not set
            it down.

    Raises:
        ConfigError: a package of the graph is not installed.
    """
    simulator = {"bullet.full_motion": "true"} if full_motion else {}
    if options.engine != DEFAULT_ENGINE:
        simulator |= {"engine": options.engine}
    if options.bottom != FEET:
        simulator |= {"bottom": options.bottom}
    told = changed_settings(options.observed)
    simulator |= {f"camera.{name}": str(value) for name, value in told.items()}
    planner = {f"estimator.{name}": str(value) for name, value in told.items()}
    if isinstance(options, LiveOptions):
        pace = str(options.real_time_factor)
        simulator |= {"bullet.full_motion": "true", "real_time_factor": pace}
        simulator["world"] = options.world
    if options.gui:
        simulator |= {"gui": "true", "real_time_factor": "1.0"}
    model = {"belief": str(Path(options.belief).absolute())} if options.belief else {}
    if "unknown" in told:
        model["unknown"] = told["unknown"]
    seed = {"seed": str(options.seed)}

    def node(package: str, name: str, **parameters: str) -> list[str]:
        files = [] if options.params_file is None else ["--params-file", str(options.params_file)]
        parameters["state_file"] = str(states.absolute() / f"{name}.json")
        given = [word for key, value in parameters.items() for word in ("-p", f"{key}:={value}")]
        return [str(executable(package, name)), "--ros-args", *ros, *files, *given]

    # The simulator's time is in all headers; with a robot it is the wall clock's.
    simulated = {} if options.robot else {"use_sim_time": "true"}
    planner |= {"dynamics": "service", **seed, **simulated}
    model |= {"model": options.model, **simulated}
    commands = {MODEL: node("sain_model", "model_node", **model)}
    if isinstance(options, LiveOptions):
        commands[PAGE] = page_command(options, ros)
    if options.bag is not None:
        about = [f"{key}={value}" for key, value in (custom_data or {}).items()]
        data = ["--custom-data", *about] if about else []
        recorder = [str(executable("sain_bags", "record")), "--out", str(options.bag), *data]
        commands[RECORDER] = [*recorder, "--bag.flush-period", FLUSH_PERIOD, "--ros-args", *ros]
    if options.robot:
        commands |= _robot_commands(options, ros, node)
    else:
        commands[SIMULATOR] = node("sain_sim", "sim_node", **seed, **simulator)
    commands[PLANNER] = node("sain_mppi", "mppi_node", **planner)
    return commands


def _robot_commands(
    options: GraphOptions, ros: Sequence[str], node: Callable[..., list[str]]
) -> dict[str, list[str]]:
    """Return the commands of a robot's driver, and of the node that makes scenes of poses."""
    commands = {}
    if options.bodies is not None:
        given = {"bodies": str(options.bodies.absolute()), "noise": options.camera.noise}
        commands[POSES] = node("sain_sim", "poses_to_scene", **given)
    if options.robot != ELSEWHERE:
        commands[ROBOT] = [*shlex.split(options.robot), "--ros-args", *ros]
    return commands


def page_command(options: LiveOptions, ros: Sequence[str]) -> list[str]:
    """Return the command of the live page."""
    page = options.page
    given = [("host", page.host), ("port", page.port), ("seed", page.seed)]
    given.append(("scenario", page.scenario))
    words = [word for name, value in given for word in ("-p", f"{name}:={value}")]
    return [str(executable("sain_live", "page_node")), "--ros-args", *ros, *words]


def ros_arguments(arguments: Sequence[str]) -> list[str]:
    """Return what of a command's arguments is for ROS; the namespace is ``/sain`` by default."""
    words = split_ros_arguments(list(arguments))[1]
    if any(word.startswith("__ns:=") for word in words):
        return words
    return ["-r", f"__ns:=/{NAMESPACE}", *words]


def restart_command(name: str, command: Sequence[str]) -> list[str]:
    """Return what starts a process of the graph anew after a crash."""
    if name == SIMULATOR:  # what it may find is the one that crashed
        return [*command, "-p", "peer_wait:=0.0"]
    if name == ROBOT:  # nobody knows where its arm is
        return []
    if name == PAGE:  # the episode that is played goes on
        return [*command, "-p", "scenario:=''"]
    if name == RECORDER:
        return [command[0], "--resume", *command[1:]]
    return list(command)
