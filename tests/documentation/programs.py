"""Whether what a command names exists: program, subcommand, options, values, parameters."""

import contextlib
import io
import re
import tomllib
from collections.abc import Iterator
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import yaml

from sain_core.cli.arguments import read_options, split_ros_arguments
from sain_core.cli.command_line import Command, load
from sain_core.cli.node_command import NodeCommand, describe_parameters
from sain_core.errors import SainError
from tests.documentation.modules import module_problem
from tests.paths import ROOT
from tests.workspace.source_tree import console_scripts

REQUIRED = {  # what an ellipsis stands for
    "sain_model evaluate": ["data"],
    "sain_sim collect": [],
    "sain_bringup closed_loop": [],
    "sain_eval evaluate": [],
    "sain_model train": ["data", "--out", "o"],
}
INSTALLED = {  # what the packages of the examples offer -> what is there without them
    "my_model": "planar", "my_arrow": "cube", "my_centre:0.5": "", "my_planner": "mppi",
    "my_scenario": "anywhere", "robot_node": "elsewhere", "my_world": "bullet",
}  # fmt: skip
FILES = {  # that a page shows -> files of their kinds
    "params.yaml": "src/sain_bringup/config/launch.yaml",
    "bodies.yaml": "src/sain_arm/sain_arm/robots/bodies/t.yaml",
}
OTHERS = ("usb_cam", "camera_calibration")  # packages of a ROS 2 installation
BOTH = {"--engine": "bullet", "--scenario": "anywhere"}  # what `gym-pusht` is after an option
STOCK = {"topic": ("echo", "pub", "list"), "action": ("send_goal",), "bag": ("info",),
         "param": ("set", "get"), "service": ("call",), "interface": ("show",),
         "pkg": ("executables",)}  # fmt: skip
TARGET = re.compile(r"^([a-z][\w-]*):", re.MULTILINE)
INTERFACE = re.compile(r"sain_interfaces/(msg|srv|action)/(\w+)")


def problems(words: list[str]) -> Iterator[str]:
    """What does not exist of what a command names, unless it is a program of others."""
    if not (words[0] == "tar" or (words[:2] == ["ros2", "run"] and words[2] in OTHERS)):
        yield from problems_of_ours(words)


def problems_of_ours(words: list[str]) -> Iterator[str]:
    while words and words[0] in ("./env", "nice"):
        words = words[1:]
    match words:
        case ["python" | "pip", *rest]:
            yield from python(words[0], rest)
        case ["make", *rest]:
            yield from make(rest)
        case ["sain", "--version" | "--help"]:
            pass
        case ["ros2", "run", package, name, *rest]:
            yield from executable(package, name, rest)
        case ["ros2", *rest]:
            yield from stock(rest)
        case ["train", *rest]:  # a function of the page about rollouts
            yield from executable("sain_model", "train", ["...", *rest])
        case ["docker", "compose", "-f", file, *rest]:
            yield from compose(file, rest)
        case [path, *_] if "/" in path:
            yield from missing([path])
        case _:
            yield f"unknown program: {' '.join(words[:3])}"


def python(program: str, words: list[str]) -> Iterator[str]:
    match program, words:
        case "python", ["-m", "pytest", *rest]:
            yield from missing([word for word in rest if not word.startswith("-")])
        case "python", ["-m", module, *rest]:
            yield from module_problem(module, [word for word in rest if word != "..."])
        case "python", [path, *_]:
            yield from missing([path])
        case "pip", ["install", *rest]:
            yield from install(rest)
        case _:
            yield f"unknown: {program} {' '.join(words)}"


def missing(paths: list[str]) -> Iterator[str]:
    for path in paths:
        if not (ROOT / path).exists():
            yield f"{path} does not exist"


def make(words: list[str]) -> Iterator[str]:
    targets = TARGET.findall((ROOT / "Makefile").read_text())
    variables = set(re.findall(r"\$\((\w+)\)", (ROOT / "Makefile").read_text()))
    for word in words:
        name, equals, _ = word.partition("=")
        if name not in (variables if equals else targets):
            yield f"make has no {name}"


def executable(package: str, name: str, words: list[str]) -> Iterator[str]:
    if name not in console_scripts(package):
        yield f"{package} has no executable {name}"
        return
    entry = getattr(import_module(f"{package}.commands"), name)
    if isinstance(entry, NodeCommand):
        yield from node(entry, words)
    elif "--help" not in words:
        yield from options(entry, words)


def options(command: Command, words: list[str]) -> Iterator[str]:
    own, ros = split_ros_arguments(words) if command.ros else (words, [])
    yield from ros_arguments(ros, set())
    if "..." in own:
        own = [*REQUIRED.get(command.name, []), *(word for word in own if word != "...")]
    try:
        read(command, [value(*pair) for pair in pairwise(["", *own])])
    except SainError as error:
        yield str(error)


def read(command: Command, own: list[str]) -> None:
    output = io.StringIO()
    try:
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
            # Without their defaults: a checkpoint that --from names is made by an earlier command.
            read_options(command.options(), command.name, own, command.prefixes)
    except SystemExit as end:
        if end.code:
            raise SainError(f"{' '.join(own)}: {plain(output.getvalue())}") from end


def value(option: str, word: str) -> str:
    """A placeholder, or the name of a package that is not installed here, as what is allowed."""
    if word in FILES:
        return str(ROOT / FILES[word])
    if word == "gym-pusht":
        return BOTH.get(option, word)
    for name, known in INSTALLED.items():
        word = word.replace(name, known)
    return {"EFFECT": "tilt"}.get(word, word)


def plain(text: str) -> str:
    return " ".join(re.sub(r"[│╭╮╰╯─]", " ", text).split())


def node(entry: NodeCommand, words: list[str]) -> Iterator[str]:
    own, ros = split_ros_arguments(words)
    if own:
        yield f"{entry.name} takes no {own}"
    settings = load(entry.name, entry.settings)()
    yield from ros_arguments(ros, {row[0] for row in describe_parameters(settings)})


def ros_arguments(words: list[str], parameters: set[str]) -> Iterator[str]:
    for option, what in zip(words[::2], words[1::2], strict=True):
        name, assigned, _ = what.partition(":=")
        if option == "-p" and (not assigned or name not in parameters):
            yield f"no parameter {name}"
        elif option not in ("-p", "-r", "--params-file"):
            yield f"no option {option} of ROS"


def stock(words: list[str]) -> Iterator[str]:
    """A command of ROS 2 itself: what it says of our messages and launch files."""
    if words[0] == "launch":
        yield from launch(words[1], words[2], words[3:])
        return
    if len(words) < 2 or words[1] not in STOCK.get(words[0], ()):
        yield f"unknown: ros2 {' '.join(words[:2])}"
    for place, word in enumerate(words):
        if found := INTERFACE.fullmatch(word):
            path = f"src/sain_interfaces/{found[1]}/{found[2]}.{found[1]}"
            yield from missing([path])
            if words[place + 1 :]:
                yield from fields(ROOT / path, words[place + 1])


def fields(path: Path, text: str) -> Iterator[str]:
    """The fields of a message, written as YAML."""
    definition = path.read_text().partition("\n---")[0]
    names = set(re.findall(r"^[\w/\[\]]+ +(\w+)", definition, re.MULTILINE))
    for name in yaml.safe_load(text):
        if name not in names:
            yield f"{path.name} has no {name}"


def launch(package: str, name: str, words: list[str]) -> Iterator[str]:
    path = ROOT / "src" / package / "launch" / name
    yield from missing([str(path.relative_to(ROOT))])
    for word in words:
        if f'"{word.partition(":=")[0]}": (' not in path.read_text():
            yield f"{name} has no argument {word}"


def install(words: list[str]) -> Iterator[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for word in words:
        if found := re.fullmatch(r"\.\[(\w+)\]", word):
            if found[1] not in project["optional-dependencies"]:
                yield f"there is no extra {found[1]}"
        elif word.startswith("./"):
            yield from missing([word])


def compose(file: str, words: list[str]) -> Iterator[str]:
    services = yaml.safe_load((ROOT / file).read_text())["services"]
    match [word for word in words if not word.startswith("--")]:
        case ["build" | "up"]:
            pass
        case ["run", service, *rest] | ["demo", "run", service, *rest]:
            if service not in services:
                yield f"{file} has no {service}"
            if rest:
                yield from problems(rest)
        case other:
            yield f"docker compose has no {other}"
