"""The program ``sain``: the commands of all installed packages, each as a subcommand.

``ros2 run PACKAGE COMMAND`` starts the same commands. Those that need ROS 2 say so where it is not
installed; all others work without it.
"""

import pkgutil
import sys
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from sain_core.cli.command_line import WRONG_USAGE, Command, end_with_the_reader
from sain_core.cli.node_command import NodeCommand, wrapped
from sain_core.guarding.plugins import did_you_mean

PROGRAM: Final = "sain"
OWN: Final = "sain_"  # how the names of packages begin


def main(arguments: list[str] | None = None) -> int:
    """Run the subcommand that the arguments begin with, by default those of the process."""
    given = sys.argv[1:] if arguments is None else arguments
    if given == ["--version"]:
        sys.stdout.write(f"{PROGRAM} {version(PROGRAM)}\n")
        return 0
    if not given or given[0] in ("-h", "--help"):
        with end_with_the_reader():
            sys.stdout.write("\n".join(help_lines()) + "\n")
        return 0 if given else WRONG_USAGE
    name, commands = given[0], find_commands()
    if name not in commands:
        near = did_you_mean(name, commands)
        sys.stderr.write(f"{PROGRAM}: there is no command {name!r}{near}; see {PROGRAM} --help\n")
        return WRONG_USAGE
    command = commands[name]
    bare = getattr(command, "without_ros", "") in given[1:]
    if command.needs_ros and not bare and find_spec("rclpy") is None:
        sys.stderr.write(
            f"{PROGRAM} {name} needs ROS 2 (rclpy), which is not installed here: run it inside"
            " ./env of a checkout, or in a workspace of ROS 2 Jazzy\n"
        )
        return 1
    own = f"{PROGRAM} {name}"
    if arguments is not None:
        return command(given[1:], program=own)
    sys.argv = [own, *given[1:]]  # for rclpy
    return command(program=own)


def find_commands() -> dict[str, Command | NodeCommand]:
    """Return the commands of all installed packages by their names as subcommands."""
    found = {}
    for finder, package, is_package in pkgutil.iter_modules():
        folder = Path(getattr(finder, "path", ""), package)
        if is_package and package.startswith(OWN) and (folder / "commands.py").exists():
            for value in vars(import_module(f"{package}.commands")).values():
                if isinstance(value, Command | NodeCommand):
                    found[value.subcommand] = value
    return dict(sorted(found.items()))


def help_lines() -> Iterator[str]:
    """Yield the lines of the help: every command with what it does."""
    yield f"usage: {PROGRAM} COMMAND [OPTIONS]"
    yield f"       {PROGRAM} --version"
    yield ""
    yield f"{PROGRAM} COMMAND --help has the options. ros2 run PACKAGE NAME starts the same."
    commands = find_commands()
    wide = 2 + max(map(len, commands))
    for title, needs_ros in (("without ROS 2", False), ("on ROS 2", True)):
        yield ""
        yield f"{title}:"
        for name, command in commands.items():
            if command.needs_ros == needs_ros:
                yield from wrapped(command.summary, f"  {name:<{wide}}")
