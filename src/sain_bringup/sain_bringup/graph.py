"""``ros2 run sain_bringup graph``: the processes of the graph, looked after until Ctrl-C."""

import shlex
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import tyro
from rich.console import Console

from sain_bringup.children import ProcessDiedError
from sain_bringup.conditions import show_line
from sain_bringup.interrupts import Interrupts, Stopped
from sain_bringup.processes import UNHURRIED, Supervisor
from sain_core.cli.arguments import split_ros_arguments
from sain_core.cli.command_line import command_of_node, executable
from sain_core.config import MOST_SEED, Config, option
from sain_core.errors import ConfigError
from sain_core.guarding import lifetime
from sain_core.guarding.documents import read_user_yaml
from sain_core.model import check_model_name
from sain_core.shapes.body_file import read_bodies, write_tagged_bodies
from sain_core.shapes.shape import BOTTOMS, FEET
from sain_core.world import MASSES, ObservationConfig, changed_settings
from sain_lab.storage.laboratory import laboratory_path
from sain_model.compute.kernel_store import compile_visibly
from sain_sim.world.engines import DEFAULT_ENGINE, ENGINE_HELP, check_engine
from sain_sim.world.start import draw_episode
from sain_sim.world.truth import TruthConfig

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
PATIENT: Final = (RECORDER, LEARNER)  # have files to close
PAGE: Final = "page"
FLUSH_PERIOD: Final = "0.25"  # [s], at most so much is lost with the recorder
UNWATCHED: Final = {lifetime.SOCKET: "", lifetime.TIMEOUT: ""}  # a driver may wait for its arm
POLL: Final = 0.02  # [s] between looks at the processes
STARTED: Final = 15.0  # [s], after which warnings are printed though processes still start
SHIPPED: Final = "sain"  # model


@dataclass(frozen=True)
class GraphConfig(Config):
    """What `graph` and `closed_loop` start the graph with."""

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

    def __post_init__(self) -> None:
        """Check the fields, the model's name and the file of parameters."""
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
        if self.see in SEEN_NOISE and not self.camera.is_exact:
            raise ConfigError("--see has the errors of its images; --noise and the like are others")
        if self.params_file is not None:
            _check_parameter_file(self.params_file)


@dataclass(frozen=True)
class GraphOptions(GraphConfig):
    """Start the whole graph and look after it: simulator, model, planner and recorder.

    It waits for goals, as `goal` and RViz send them. What dies or hangs is restarted, and goes on
    where it was. Three crashes within a minute end the graph, and so does the end of a process
    that did not crash. Ctrl-C ends all of them.
    """

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
        """Check the fields, and that those of a robot make sense."""
        super().__post_init__()
        self._check_robot()

    def graph(self) -> "Graph":
        """Return the graph that these options ask for."""
        bag = recording_folder(self.record, self.bag)
        return Graph(self, self.see, self.robot, self.bodies, bag=bag)

    def _check_robot(self) -> None:
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


def recording_folder(record: bool, folder: Path | None) -> Path | None:
    """Return the folder to record to: the given one, or one by the time; None: nothing is."""
    return (folder or RECORDINGS / time.strftime("%Y%m%d-%H%M%S")) if record else None


@dataclass(frozen=True)
class Graph:
    """A graph that a command starts: its processes, and how they differ from their defaults.

    Attributes:
        options: that all graphs have.
        see: by what bodies are seen in images; empty: they are not.
        robot: command of its driver, or `ELSEWHERE`; empty: the simulator.
        bodies: file of the robot's bodies, whose poses become scenes.
        arm: file or name of the arm that a camera may see; empty: it is not known.
        bag: folder to record to; None: nothing is recorded.
        about: what the bag should say about itself.
        simulator: parameters of the simulator.
        planner: parameters of the planner.
        more: returns commands of more processes, by name, with these arguments for ROS.
    """

    options: GraphConfig
    see: str = ""
    robot: str = ""
    bodies: Path | None = None
    arm: str = ""
    bag: Path | None = None
    about: Mapping[str, str] = field(default_factory=dict)
    simulator: Mapping[str, str] = field(default_factory=dict)
    planner: Mapping[str, str] = field(default_factory=dict)
    more: Callable[[Sequence[str]], dict[str, list[str]]] = lambda ros: {}

    @property
    def pose_noise(self) -> str:
        """Standard deviation of the poses that scenes are made of: METRES,RADIANS."""
        return SEEN_NOISE[self.see] if self.see else self.options.camera.noise

    @property
    def observed(self) -> dict[str, Any]:
        """What planner and model are given of observations that are not exact."""
        camera = replace(self.options.camera, noise=self.pose_noise)
        weighed = self.bodies is None or read_bodies(self.bodies).weighed
        if not weighed and MASSES not in camera.unknown_names:
            camera = replace(camera, unknown=",".join((*camera.unknown_names, MASSES)))
        return changed_settings(camera)


def run(options: GraphOptions, console: Console) -> int:
    """Run the graph of some options; see `run_graph`."""
    return run_graph(options.graph(), console)


def run_graph(graph: Graph, console: Console) -> int:
    """Run a graph until it is interrupted, or a process ends; return that one's exit code.

    Raises:
        BusyError: another graph runs already.
        SainError: a package is not installed, or a log cannot be written.
    """

    def tell(text: str) -> None:
        console.print(f"graph: {text}", markup=False, highlight=False, soft_wrap=True)

    interrupts, code = Interrupts(), 0
    try:
        check_free(graph)
        compile_visibly(console)
    except Stopped:
        return 0
    with (
        interrupts.deferred(),
        tempfile.TemporaryDirectory(prefix="sain-graph-") as folder,
        Supervisor(Path(folder), UNHURRIED, tell=tell) as supervisor,
    ):
        logs = start(supervisor, graph, Path(folder))
        try:
            watch(supervisor, logs, interrupts, console)
        except ProcessDiedError as error:
            logs.show()
            tell(error.reason)
            code = error.exit_code
        with supervisor.signals_noted():
            supervisor.close_files(UNHURRIED.interrupt)
            supervisor.stop()
        logs.show()
    return code


def check_free(graph: Graph) -> None:
    """Raise `BusyError` where another simulator has the namespace; a robot locks it itself."""
    if graph.robot:
        return
    from sain_core.guarding.ros.ownership import lock_namespace
    from sain_core.ros.node_main import command_node

    with command_node("graph") as node:
        lock_namespace(node)()  # the simulator to come locks it again


def watch(supervisor: Supervisor, logs: "Logs", interrupts: Interrupts, console: Console) -> None:
    """Look after the processes until a signal comes; print what keeps the graph from working.

    Raises:
        ProcessDiedError: one ended that is not restarted.
    """
    from sain_bringup.ros.listener import listening

    begun, names = time.monotonic(), [child.name for child in supervisor.children]

    def show_what_is_new() -> None:
        supervisor.check()
        logs.show()

    while not interrupts.came and supervisor.starting(names):
        show_what_is_new()
        time.sleep(POLL)
        if time.monotonic() - begun > STARTED:
            break
    with listening("graph", partial(show_line, console)) as listen:
        while not interrupts.came:
            show_what_is_new()
            listen(POLL)


def start(supervisor: Supervisor, graph: Graph, folder: Path) -> "Logs":
    """Start the processes of the graph; return their logs."""
    for name, command in graph_commands(graph, ros_arguments(sys.argv[1:]), folder).items():
        variables = UNWATCHED if name == ROBOT else {}
        again = restart_command(name, command)
        supervisor.start(name, command, variables, patient=name in PATIENT, again=again)
    return Logs([child.log for child in supervisor.children])


class Logs:
    """What processes say, as they say it."""

    def __init__(self, paths: list[Path]) -> None:
        """Begin with these files."""
        self._places = dict.fromkeys(paths, 0)

    def show(self) -> None:
        """Write what is new to standard output."""
        for path, place in self._places.items():
            with path.open("rb") as file:
                file.seek(place)
                text = file.read()
            whole = text[: text.rfind(b"\n") + 1]
            self._places[path] = place + len(whole)
            sys.stdout.write(whole.decode("utf-8", errors="replace"))
        sys.stdout.flush()


def graph_commands(graph: Graph, ros: Sequence[str], states: Path) -> dict[str, list[str]]:
    """Return the command of each process, by its name; the one that starts slowest comes first.

    Args:
        graph: the graph.
        ros: arguments for ROS of every node, as `ros_arguments` returns them.
        states: folder for what nodes go on from after a crash.

    Raises:
        ConfigError: a package of the graph is not installed.
    """
    options, clock = graph.options, {} if graph.robot else {"use_sim_time": "true"}
    files = () if options.params_file is None else ("--params-file", str(options.params_file))
    node = partial(_node, [*ros, *files], states.absolute())
    model = {"model": options.model, **clock}
    if options.belief:
        model["belief"] = str(Path(options.belief).absolute())
    if unknown := graph.observed.get("unknown"):
        model["unknown"] = unknown
    commands = {MODEL: node("sain_model", "model_node", model)}
    if options.learn:
        commands[LEARNER] = node("sain_lab", "learner_node", learner_of(graph))
    commands |= graph.more(ros)
    if graph.bag is not None:
        commands[RECORDER] = _recorder(graph.bag, graph.about, ros)
    if not graph.robot:
        commands[SIMULATOR] = node("sain_sim", "sim_node", _simulator(graph))
    elif graph.robot != ELSEWHERE:
        commands[ROBOT] = [*shlex.split(graph.robot), "--ros-args", *ros]
    if graph.bodies is not None or graph.see:
        bodies = write_seen_bodies(options, states) if graph.bodies is None else graph.bodies
        given = {"bodies": str(bodies.absolute()), **clock}
        if graph.see:
            arm = {"robot": graph.arm} if graph.arm and graph.see == OUTLINES else {}
            commands[graph.see] = node("sain_vision", SEEING[graph.see], given | arm)
        given["noise"] = graph.pose_noise
        commands[SCENES] = node("sain_vision", "scene_node", given)
    planner = {**graph.planner, **_named("estimator", graph.observed), **clock}
    planner |= {"dynamics": "service", "seed": str(options.seed)}
    commands[PLANNER] = node("sain_mppi", "mppi_node", planner)
    return commands


def _node(
    ros: Sequence[str], states: Path, package: str, name: str, parameters: dict[str, str]
) -> list[str]:
    """Return the command of a node, which keeps its state in a folder if it remembers anything."""
    kept = {} if name in SEEING.values() else {"state_file": str(states / f"{name}.json")}
    return command_of_node(package, name, ros, **parameters, **kept)


def _recorder(bag: Path, about: Mapping[str, str], ros: Sequence[str]) -> list[str]:
    data = ["--custom-data", *(f"{key}={value}" for key, value in about.items())] if about else []
    command = [str(executable("sain_bags", "record")), "--out", str(bag), *data]
    return [*command, "--bag.flush-period", FLUSH_PERIOD, "--ros-args", *ros]


def _simulator(graph: Graph) -> dict[str, str]:
    """Return the parameters of the simulator that differ from their defaults."""
    options, given = graph.options, dict(graph.simulator)
    if options.engine != DEFAULT_ENGINE:
        given["engine"] = options.engine
    if options.bottom != FEET:
        given["bottom"] = options.bottom
    if graph.see:
        given |= {"scenes": "false", "bullet.wait_aside": "true"}
        given |= DEPTH_IMAGES if graph.see == OUTLINES else {}
    else:
        given |= _named("camera", graph.observed)
    if options.gui:
        given |= {"gui": "true", "real_time_factor": "1.0"}
    return {"seed": str(options.seed), **given}


def _named(group: str, settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the settings of a group as parameters of a node."""
    return {f"{group}.{name}": str(value) for name, value in settings.items()}


def learner_of(graph: Graph) -> dict[str, str]:
    """Return parameters of the learner, which runs in another folder."""
    noise = {"noise": graph.options.camera.noise} if graph.robot else {}
    return {"laboratory": str(laboratory_path(graph.options.learn).absolute()), **noise}


def write_seen_bodies(options: GraphConfig, folder: Path) -> Path:
    """Write the file of the bodies that the simulator begins with; return its path."""
    truth = TruthConfig(engine=options.engine, bottom=options.bottom)
    parameters, scene = draw_episode(options.seed, truth, None, (), 0.0)
    path = folder.absolute() / SEEN_BODIES
    path.parent.mkdir(parents=True, exist_ok=True)
    write_tagged_bodies(path, scene, parameters.bodies)
    return path


def ros_arguments(arguments: Sequence[str]) -> list[str]:
    """Return what of a command's arguments is for ROS; the namespace is ``/sain`` by default."""
    words = split_ros_arguments(list(arguments))[1]
    if any(word.startswith("__ns:=") for word in words):
        return words
    return ["-r", f"__ns:=/{NAMESPACE}", *words]


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
