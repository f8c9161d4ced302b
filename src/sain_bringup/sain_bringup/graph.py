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

from sain_arm.robot.robot import read_robot, shipped
from sain_bringup.bench import DEPTH_IMAGES, ROBOT, TAG_IMAGES, Bench, check_bench_engine
from sain_core.cli.arguments import split_ros_arguments
from sain_core.cli.command_line import command_of_node, executable
from sain_core.config import MOST_SEED, Config, option
from sain_core.errors import ConfigError
from sain_core.guarding.documents import read_user_yaml
from sain_core.model import check_model_name
from sain_core.policy import POLICY, POLICY_HELP, check_policy_name
from sain_core.push import PushLimits
from sain_core.shapes.body_file import read_bodies
from sain_core.shapes.shape import BOTTOMS, FEET
from sain_core.world import MASSES, ObservationConfig, changed_settings
from sain_eval.scenes.anything import is_anything
from sain_lab.storage.laboratory import laboratory_path
from sain_sim.bench.faults import FAULTS_HELP, parse_faults
from sain_sim.world.engines import DEFAULT_ENGINE, DEFAULT_ROBOT, ENGINE_HELP, check_engine

T = TypeVar("T")

NAMESPACE: Final = "sain"  # as `sain_core.ros.node_main` has it, which needs rclpy
RECORDINGS: Final = Path("bags")
NAMESPACE_KEY: Final = "namespace"  # of a bag's custom data: of the graph that made it
ROBOT_KEY: Final = "robot"  # of a bag's custom data: name or file of the robot that moved
EPISODES_KEY: Final = "episodes"  # of a bag's custom data: "scenario:seed scenario:seed ..."
ELSEWHERE: Final = "elsewhere"  # the driver that is started by somebody else
SIMULATOR: Final = "simulator"
SCENES: Final = "scenes"
TAGS: Final = "tags"
OUTLINES: Final = "outlines"
OWN: Final = "own"  # as `sain_sim.ros.simulator` has it
OUTLINES_HELP: Final = "file of outlines with the bodies of `anything`; without it, your own shapes"
SEEN_NOISE: Final = {TAGS: "0.0005,0.005", OUTLINES: "0.001,0.01"}  # [m], [rad], of poses
SEEING: Final = {TAGS: "tag_node", OUTLINES: "outline_node"}  # nodes
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
    policy: str = option("", f"in place of the planner, {POLICY_HELP}; empty: none")
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
        DEFAULT_ROBOT, "robot that is simulated: its YAML file, or the name of a shipped one"
    )
    faults: str = option(
        "",
        "a bench in place of the simulator: the robot's driver, a controller and these faults, with"
        f" commas between; or none. {FAULTS_HELP}",
    )
    driver: str = option(
        "",
        "command that starts a real robot's driver, in place of the simulator; elsewhere: it is"
        " started by somebody else",
    )
    bodies: Path | None = option(
        None, "YAML file of the bodies of bench or driver: their poses become scenes"
    )
    pace: float = option(
        1.0, "of the bench: simulated time over wall time", minimum=0.05, maximum=20.0
    )
    enable: bool = option(True, "of the bench: let the arm move; else start `sain_arm enable`")
    record: bool = option(True, "record all topics")
    bag: Path | None = option(
        None, "folder to make for the recording; by default bags/<date>-<time>"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_model_name(self.model)
        if self.policy:
            check_policy_name(self.policy)
        check_engine(self.engine)
        if self.learn:
            laboratory_path(self.learn)
            if self.model != SHIPPED or self.belief:
                raise ConfigError(
                    f"--learn {self.learn} serves the model of that laboratory; leave out --model"
                    " and --belief"
                )
        if self.see and not self.camera.is_exact:
            raise ConfigError("--see has the errors of its images; --noise and the like are others")
        if self.params_file is not None:
            _check_parameter_file(self.params_file)
        self._check_robot()

    def _check_robot(self) -> None:
        """Check that robot, bench, driver and bodies belong together."""
        simulated = self.gui or self.bottom != FEET
        if self.faults:
            parse_faults(self.faults)
            check_bench_engine(self.engine)
            if self.driver or simulated:
                raise ConfigError(
                    "--faults starts a bench in place of the simulator; leave out --driver, --gui"
                    " and --bottom"
                )
        simulated |= self.engine != DEFAULT_ENGINE or self.robot != DEFAULT_ROBOT
        if self.driver and simulated:
            raise ConfigError(
                "--driver replaces the simulator; leave out --gui, --engine, --bottom and --robot"
            )
        if self.bodies is not None and not self.is_real:
            raise ConfigError("--bodies is for a robot; give --driver or --faults, too")
        if self.driver and self.see and self.bodies is None:
            raise ConfigError(f"--see {self.see} needs the bodies of the robot; give --bodies")
        _check_driver(self.driver)
        if self.robot != DEFAULT_ROBOT:
            _check_robot(self.robot)
        if self.bodies_file is not None:
            read_bodies(self.bodies_file)

    @property
    def chooses(self) -> str:
        """The policy that chooses pushes, or the model that they are planned with."""
        return f"{POLICY}{self.policy}" if self.policy else self.model

    @property
    def is_real(self) -> bool:
        """Whether time and poses are those of a robot, or of a bench."""
        return bool(self.driver or self.faults)

    @cached_property
    def bench(self) -> Bench | None:
        """The bench, where there is one."""
        if not self.faults:
            return None
        camera = {"": None, TAGS: TAG_IMAGES, OUTLINES: DEPTH_IMAGES}[self.see]
        about = (self.robot, self.faults, self.engine, self.bodies)
        return Bench(*about, self.pace, self.enable, camera)

    @property
    def bodies_file(self) -> Path | None:
        """The file of the robot's bodies; None: the simulator states its own."""
        return self.bodies if self.bench is None else self.bench.bodies_file

    @property
    def pose_noise(self) -> str:
        """Standard deviation of the poses that scenes are made of: METRES,RADIANS."""
        return SEEN_NOISE[self.see] if self.see else self.camera.noise

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

    def own_commands(self, ros: Sequence[str]) -> dict[str, list[str]]:
        """Return commands of the robot and of more processes, by name, with arguments for ROS."""
        if self.bench is not None:
            return self.bench.commands(ros)
        if self.driver in ("", ELSEWHERE):
            return {}
        return {ROBOT: [*shlex.split(self.driver), "--ros-args", *ros]}


def stated_bodies(scenario: str | None, outlines: Path | None) -> dict[str, str]:
    """Return the simulator's parameter for a scenario with bodies of a file, or of the user."""
    if scenario is None or not is_anything(scenario):
        return {}
    return {"outlines": OWN if outlines is None else str(outlines.absolute())}


def graph_commands(options: GraphOptions, ros: Sequence[str], states: Path) -> dict[str, list[str]]:
    """Return the command of each process, by its name; the one that starts slowest comes first.

    Args:
        options: of the graph.
        ros: arguments for ROS of every node, as `ros_arguments` returns them.
        states: folder for what nodes go on from after a crash.

    Raises:
        ConfigError: a package of the graph is not installed.
    """
    clock = {} if options.is_real else {"use_sim_time": "true"}
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
        learner |= {"noise": options.camera.noise} if options.is_real else {}
        commands[LEARNER] = node("sain_lab", "learner_node", learner)
    commands |= options.own_commands(ros)
    if (bag := options.recording()) is not None:
        commands[RECORDER] = _recorder(bag, options.custom_data(namespace_in(ros)), ros)
    if not options.is_real:
        commands[SIMULATOR] = node("sain_sim", "sim_node", _simulator(options))
    commands |= _vision(options, node, clock, states)
    planner = {**_tool_radius(options), **_named("estimator", options.observed), **clock}
    planner |= {"dynamics": "service", "seed": str(options.seed)}
    if options.policy:
        folder = Path(options.policy)  # one named 20261130 would be a number
        planner["policy"] = str(folder.absolute()) if folder.is_dir() else options.policy
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
    if options.robot != DEFAULT_ROBOT:
        given["cell.robot"] = options.robot
    if options.see:
        given |= {"scenes": "false", "cell.wait_aside": "true"}
        given |= DEPTH_IMAGES if options.see == OUTLINES else {}
    else:
        given |= _named("camera", options.observed)
    if options.gui:
        given |= {"gui": "true", "real_time_factor": "1.0"}
    return {"seed": str(options.seed), **given}


def _tool_radius(options: GraphOptions) -> dict[str, str]:
    """Return the radius of the robot's tool for the planner, if it is not the usual one."""
    radius = read_robot(options.robot).tool_radius if not options.driver else None
    differs = radius not in (None, PushLimits().tool_radius)
    return {"feasibility.limits.tool_radius": str(radius)} if differs else {}


def _vision(
    options: GraphOptions,
    node: Callable[[str, str, Mapping[str, str]], list[str]],
    clock: Mapping[str, str],
    states: Path,
) -> dict[str, list[str]]:
    """Return the commands of what makes scenes of poses or images; none: the simulator does."""
    images, bodies = options.see, options.bodies_file
    if not images and bodies is None:
        return {}
    given = {"bodies": str((bodies or states / SEEN_BODIES).absolute()), **clock}
    commands = {}
    if images:
        arm = {"robot": options.robot} if options.faults and images == OUTLINES else {}
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


def _check_driver(driver: str) -> None:
    """Check that there is a command, or raise `ConfigError`."""
    try:
        words = shlex.split(driver)
    except ValueError as error:
        raise ConfigError(f"--driver is {driver!r}: {error}") from error
    if words and words[0] != ELSEWHERE and shutil.which(words[0]) is None:
        raise ConfigError(
            f"--driver is {driver!r}; there is no command {words[0]!r}. To simulate a robot, give"
            f" its name or file as --robot. For a real one, give --driver {ELSEWHERE} and start"
            " arm_node"
        )


def _check_robot(robot: str) -> None:
    """Check the file of a robot, or raise `ConfigError`."""
    try:
        read_robot(robot)
    except ConfigError as error:
        if robot != ELSEWHERE and shutil.which(robot.split(" ")[0]) is None:
            raise
        raise ConfigError(
            f"--robot is {robot!r}; it must be a robot's YAML file, or one of"
            f" {', '.join(shipped())}. What starts a driver is given as --driver {robot!r}"
        ) from error


def _check_parameter_file(path: Path) -> None:
    content = read_user_yaml(path, "--params-file")
    nodes = content if isinstance(content, dict) else {}
    if not nodes or not all(
        isinstance(node, dict) and "ros__parameters" in node for node in nodes.values()
    ):
        raise ConfigError(
            f"--params-file {path} must hold, for each node, its name and below it ros__parameters"
        )
