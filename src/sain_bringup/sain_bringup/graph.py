"""A graph: which processes it has, and the options from which each command starts one."""

import shlex
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import tyro

from sain_core.cli.arguments import split_ros_arguments
from sain_core.cli.command_line import command_of_node, executable
from sain_core.config import MOST_SEED, Config, option
from sain_core.errors import ConfigError
from sain_core.guarding.documents import read_user_yaml
from sain_core.model import check_model_name
from sain_core.shapes.body_file import read_bodies
from sain_core.shapes.shape import BOTTOMS, FEET
from sain_core.world import MASSES, ObservationConfig, changed_settings
from sain_lab.storage.laboratory import laboratory_path
from sain_sim.world.engines import DEFAULT_ENGINE, ENGINE_HELP, check_engine

T = TypeVar("T")

NAMESPACE: Final = "sain"  # as `sain_core.ros.node_main` has it, which needs rclpy
RECORDINGS: Final = Path("bags")
NAMESPACE_KEY: Final = "namespace"  # of a bag's custom data: of the graph that made it
EPISODES_KEY: Final = "episodes"  # of a bag's custom data: "scenario:seed scenario:seed ..."
ELSEWHERE: Final = "elsewhere"  # the robot that is started by somebody else
SIMULATOR: Final = "simulator"
ROBOT: Final = "robot"
SCENES: Final = "scenes"
TAGS: Final = "tags"
OUTLINES: Final = "outlines"
SEEN_NOISE: Final = {TAGS: "0.0005,0.005", OUTLINES: "0.001,0.01"}  # [m], [rad], of poses
SEEING: Final = {TAGS: "tag_node", OUTLINES: "outline_node"}  # nodes
DEPTH_IMAGES: Final = {"images.width": "640", "images.height": "480", "images.detail": "1.0"}
SEEN_BODIES: Final = "bodies.yaml"  # in the folder of states
MODEL: Final = "model"
PLANNER: Final = "planner"
RECORDER: Final = "recorder"
LEARNER: Final = "learner"
PAGE: Final = "page"
FLUSH_PERIOD: Final = "0.25"  # [s], at most so much is lost with the recorder
SHIPPED: Final = "sain"  # model


def absent(value: T) -> T:
    """Declare an option of `GraphOptions` that a command has not."""
    return field(default=value, init=False)


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
    model: str = option(
        SHIPPED, "name of a model (sain, planar, identity, lab:NAME) or path of a checkpoint"
    )
    belief: str = option(
        "", "file of `sain_model identify`, with which each episode begins; empty: none"
    )
    learn: str = option(
        "",
        "laboratory to learn in while the graph works: a name, or a path with a '/'; its model is"
        " served. Empty: nothing is learned",
    )
    seed: int = option(0, "of the first scene and of the planner", minimum=0, maximum=MOST_SEED)
    camera: Annotated[ObservationConfig, tyro.conf.arg(name="")] = ObservationConfig()
    see: str = option(
        "",
        "what the scenes are made of: tags in a camera's images, or outlines in its depth images;"
        " empty: the simulator's own scenes, or poses of a robot's bodies",
        choices=("", *SEEN_NOISE),
    )
    gui: bool = option(False, "show the simulator's window, in real time")
    params_file: Path | None = option(
        None, "ROS parameters for the nodes (YAML), on top of their defaults"
    )

    robot: str = option(
        "",
        "command that starts a robot's driver, in place of the simulator; elsewhere: it is started"
        " by somebody else",
    )
    bodies: Path | None = option(None, "YAML file of the robot's bodies: their poses become scenes")
    record: bool = option(True, "record all topics")
    bag: Path | None = option(
        None, "folder to make for the recording; by default bags/<date>-<time>"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_model_name(self.model)
        check_engine(self.engine)
        if self.learn:
            laboratory_path(self.learn)
            if self.model != SHIPPED or self.belief:
                raise ConfigError(
                    f"--learn {self.learn} serves the model of that laboratory; leave out --model"
                    " and --belief"
                )
        if self.images and not self.camera.is_exact:
            raise ConfigError("--see has the errors of its images; --noise and the like are others")
        if self.params_file is not None:
            _check_parameter_file(self.params_file)
        self.check_robot()

    def check_robot(self) -> None:
        """Check that robot and bodies belong together, and that no option is the simulator's."""
        if self.bodies is not None and not self.robot:
            raise ConfigError("--bodies is for a robot; give --robot, too")
        if self.robot and (self.gui or self.engine != DEFAULT_ENGINE or self.bottom != FEET):
            raise ConfigError(
                "--robot replaces the simulator; leave out --gui, --engine and --bottom"
            )
        if self.robot and self.see and self.bodies is None:
            raise ConfigError(f"--see {self.see} needs the bodies of the robot; give --bodies")
        try:
            words = shlex.split(self.robot)
        except ValueError as error:
            raise ConfigError(f"--robot is {self.robot!r}: {error}") from error
        if words and words[0] != ELSEWHERE and shutil.which(words[0]) is None:
            raise ConfigError(
                f"--robot is {self.robot!r}; there is no command {words[0]!r}. It starts a driver:"
                f" for an arm's file or name, give --robot {ELSEWHERE} and start arm_node, or start"
                " laboratory --robot"
            )
        if self.bodies is not None:
            read_bodies(self.bodies)

    @property
    def images(self) -> str:
        """By what bodies are seen in images; empty: they are not."""
        return self.see if self.see in SEEN_NOISE else ""

    @property
    def arm(self) -> str:
        """File or name of the arm that a camera may see; empty: it is not known."""
        return ""

    @property
    def bodies_file(self) -> Path | None:
        """The file of the robot's bodies; None: the simulator states its own."""
        return self.bodies

    @property
    def pose_noise(self) -> str:
        """Standard deviation of the poses that scenes are made of: METRES,RADIANS."""
        return SEEN_NOISE[self.images] if self.images else self.camera.noise

    @cached_property
    def observed(self) -> dict[str, Any]:
        """What planner and model are given of observations that are not exact."""
        camera = replace(self.camera, noise=self.pose_noise)
        weighed = self.bodies_file is None or read_bodies(self.bodies_file).weighed
        if not weighed and MASSES not in camera.unknown_names:
            camera = replace(camera, unknown=",".join((*camera.unknown_names, MASSES)))
        return changed_settings(camera)

    def recording(self) -> Path | None:
        """Return the folder to record to, by default one by the time; None: nothing is."""
        folder = self.bag or RECORDINGS / time.strftime("%Y%m%d-%H%M%S")
        return folder if self.record else None

    def custom_data(self, namespace: str) -> Mapping[str, str]:
        """Return what the bag of a graph in a namespace should say about itself."""
        return {}

    def simulator(self) -> dict[str, str]:
        """Return parameters of the simulator that the command has."""
        return {}

    def planner(self) -> dict[str, str]:
        """Return parameters of the planner that the command has."""
        return {}

    def own_commands(self, ros: Sequence[str]) -> dict[str, list[str]]:
        """Return commands of the robot and of more processes, by name, with arguments for ROS."""
        if self.robot in ("", ELSEWHERE):
            return {}
        return {ROBOT: [*shlex.split(self.robot), "--ros-args", *ros]}


def graph_commands(options: GraphOptions, ros: Sequence[str], states: Path) -> dict[str, list[str]]:
    """Return the command of each process, by its name; the one that starts slowest comes first.

    Args:
        options: of the graph.
        ros: arguments for ROS of every node, as `ros_arguments` returns them.
        states: folder for what nodes go on from after a crash.

    Raises:
        ConfigError: a package of the graph is not installed.
    """
    clock = {} if options.robot else {"use_sim_time": "true"}
    files = () if options.params_file is None else ("--params-file", str(options.params_file))
    node = partial(_node, [*ros, *files], states.absolute())
    model = {"model": options.model, **clock}
    if options.belief:
        model["belief"] = str(Path(options.belief).absolute())
    if unknown := options.observed.get("unknown"):
        model["unknown"] = unknown
    commands = {MODEL: node("sain_model", "model_node", model)}
    if options.learn:  # it works in another folder
        learner = {"laboratory": str(laboratory_path(options.learn).absolute())}
        learner |= {"noise": options.camera.noise} if options.robot else {}
        commands[LEARNER] = node("sain_lab", "learner_node", learner)
    commands |= options.own_commands(ros)
    if (bag := options.recording()) is not None:
        commands[RECORDER] = _recorder(bag, options.custom_data(namespace_in(ros)), ros)
    if not options.robot:
        commands[SIMULATOR] = node("sain_sim", "sim_node", _simulator(options))
    commands |= _vision(options, node, clock, states)
    planner = {**options.planner(), **_named("estimator", options.observed), **clock}
    planner |= {"dynamics": "service", "seed": str(options.seed)}
    commands[PLANNER] = node("sain_mppi", "mppi_node", planner)
    return commands


def _node(
    ros: Sequence[str], states: Path, package: str, name: str, parameters: Mapping[str, str]
) -> list[str]:
    """Return the command of a node, which keeps its state in a folder if it remembers anything."""
    kept = {} if name in SEEING.values() else {"state_file": str(states / f"{name}.json")}
    return command_of_node(package, name, ros, **parameters, **kept)


def _recorder(bag: Path, about: Mapping[str, str], ros: Sequence[str]) -> list[str]:
    data = ["--custom-data", *(f"{key}={value}" for key, value in about.items())] if about else []
    command = [str(executable("sain_bags", "record")), "--out", str(bag), *data]
    return [*command, "--bag.flush-period", FLUSH_PERIOD, "--ros-args", *ros]


def _simulator(options: GraphOptions) -> dict[str, str]:
    """Return the parameters of the simulator that differ from their defaults."""
    given = options.simulator()
    if options.engine != DEFAULT_ENGINE:
        given["engine"] = options.engine
    if options.bottom != FEET:
        given["bottom"] = options.bottom
    if options.images:
        given |= {"scenes": "false", "cell.wait_aside": "true"}
        given |= DEPTH_IMAGES if options.images == OUTLINES else {}
    else:
        given |= _named("camera", options.observed)
    if options.gui:
        given |= {"gui": "true", "real_time_factor": "1.0"}
    return {"seed": str(options.seed), **given}


def _vision(
    options: GraphOptions,
    node: Callable[[str, str, Mapping[str, str]], list[str]],
    clock: Mapping[str, str],
    states: Path,
) -> dict[str, list[str]]:
    """Return the commands of what makes scenes of poses or images; none: the simulator does."""
    images, bodies = options.images, options.bodies_file
    if not images and bodies is None:
        return {}
    given = {"bodies": str((bodies or states / SEEN_BODIES).absolute()), **clock}
    commands = {}
    if images:
        arm = {"robot": options.arm} if options.arm and images == OUTLINES else {}
        commands[images] = node("sain_vision", SEEING[images], given | arm)
    scenes = given | {"noise": options.pose_noise}
    return commands | {SCENES: node("sain_vision", "scene_node", scenes)}


def _named(group: str, settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the settings of a group as parameters of a node."""
    return {f"{group}.{name}": str(value) for name, value in settings.items()}


NAMESPACE_WORD: Final = "__ns:="


def ros_arguments(arguments: Sequence[str]) -> list[str]:
    """Return what of a command's arguments is for ROS; the namespace is ``/sain`` by default."""
    words = split_ros_arguments(list(arguments))[1]
    if any(word.startswith(NAMESPACE_WORD) for word in words):
        return words
    return ["-r", f"{NAMESPACE_WORD}/{NAMESPACE}", *words]


def namespace_in(ros: Sequence[str]) -> str:
    """Return the namespace that arguments for ROS have; empty: none."""
    spaces = [word.removeprefix(NAMESPACE_WORD) for word in ros if word.startswith(NAMESPACE_WORD)]
    return spaces[-1] if spaces else ""


def restart_command(name: str, command: Sequence[str]) -> list[str]:
    """Return what starts a process of the graph anew after a crash."""
    if name == ROBOT:  # nobody knows where its arm is
        return []
    if name == PAGE:  # the episode that is played goes on
        return [*command, "-p", "scenario:=''"]
    if name == RECORDER:
        return [command[0], "--resume", *command[1:]]
    return list(command)


def _check_parameter_file(path: Path) -> None:
    content = read_user_yaml(path, "--params-file")
    nodes = content if isinstance(content, dict) else {}
    if not nodes or not all(
        isinstance(node, dict) and "ros__parameters" in node for node in nodes.values()
    ):
        raise ConfigError(
            f"--params-file {path} must hold, for each node, its name and below it ros__parameters"
        )
