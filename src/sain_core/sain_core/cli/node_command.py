"""The entry point of a node: its help, and its arguments checked before anything is imported."""

import os
import shutil
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Final

from sain_core.cli.arguments import split_ros_arguments
from sain_core.cli.command_line import WRONG_USAGE, end_with_the_reader, load
from sain_core.config import Config, describe_values, settings_of, show_value
from sain_core.errors import INTERRUPTED, SainError
from sain_core.guarding.lifetime import check_host
from sain_core.guarding.plugins import nearest

WIDEST: Final = 100  # columns of the help


@dataclass(frozen=True)
class NodeCommand:
    """The entry point of a node's executable."""

    name: str  # package and executable, as after ``ros2 run``
    about: str  # what the node does
    node: str  # ``module:name``, in the package, of its class
    settings: str  # likewise, of the `Config` that its parameters are made from
    publishes: tuple[str, ...]  # names of its topics; likewise services and actions below
    subscribes: tuple[str, ...] = ()
    offers: tuple[str, ...] = ()
    calls: tuple[str, ...] = ()
    actions: tuple[str, ...] = ()
    needs_ros: ClassVar = True  # it does nothing without ROS 2
    example: str = ""  # a parameter in the help's example, as ``name:=value``

    @property
    def subcommand(self) -> str:
        """Its name as a subcommand of ``sain``."""
        return self.name.split()[1]

    @property
    def summary(self) -> str:
        """What it does."""
        return self.about

    def __call__(self, arguments: list[str] | None = None, program: str = "") -> int:
        """Run the node with these arguments, or those of the process, until it is interrupted.

        `program` is its name in the help; by default that after ``ros2 run``.
        """
        name = self.name.split()[1]
        own, _ = split_ros_arguments(sys.argv[1:] if arguments is None else arguments)
        try:
            if "--help" in own or "-h" in own:
                with end_with_the_reader():
                    sys.stdout.write("\n".join(self.help(program)) + "\n")
                return 0
            if own:
                sys.stderr.write(f"{name}: {self._problem(own)}\n")
                return WRONG_USAGE
            check_host()
            from sain_core.ros.node_main import node_main

            node_main(load(self.name, self.node), name)
        except SainError as error:
            sys.stderr.write(f"{name}: {error}\n")
            return 1
        except KeyboardInterrupt:
            os._exit(INTERRUPTED)

    def help(self, program: str = "") -> Iterator[str]:
        """Yield the lines of the help."""
        program = program or f"ros2 run {self.name}"
        yield f"usage: {program} [--help] [--ros-args -p NAME:=VALUE ...]"
        yield ""
        yield from wrapped(self.about)
        yield ""
        for title in ("publishes", "subscribes", "offers", "calls", "actions"):
            if names := getattr(self, title):
                yield from wrapped(", ".join(names), f"{title + ':':12}")
        yield ""
        yield "parameters:"
        for name, default, allowed, meaning in self._parameters():
            yield f"  {name}"
            notes = "; ".join(filter(None, (allowed, f"default: {default}")))
            yield from wrapped(f"{meaning} ({notes})", " " * 6)
        yield ""
        yield "example:"
        yield f"  {program} --ros-args -p {self.example}"

    def _parameters(self) -> list[tuple[str, str, str, str]]:
        return describe_parameters(load(self.name, self.settings)())

    def _problem(self, own: list[str]) -> str:
        word, _, value = own[0].partition("=")
        names = [row[0] for row in self._parameters()]
        near = nearest(word.lstrip("-"), names)
        name = near[0] if near else "NAME"
        value = value or next((other for other in own[1:2] if not other.startswith("-")), "VALUE")
        return (
            f"unknown argument {word!r}; allowed are --help and --ros-args. Parameters are given as"
            f" --ros-args -p {name}:={value if near else 'VALUE'}"
        )


def wrapped(text: str, start: str = "") -> list[str]:
    """Return a text in lines of the terminal, the first one after `start`, the others below it."""
    width, indent = min(shutil.get_terminal_size().columns, WIDEST), " " * len(start)
    return textwrap.TextWrapper(width, start, indent, break_long_words=False).wrap(text)


def describe_parameters(settings: Config) -> list[tuple[str, str, str, str]]:
    """Return name, default, allowed values and meaning of each parameter."""
    rows = []
    for name, item, _, value, live in settings_of(settings):
        about, unit = item.metadata, item.metadata.get("unit")
        allowed = describe_values(about)
        allowed += f" {unit}" if allowed and unit else ""
        meaning = ("live: " if live else "") + about.get("description", "")
        rows.append((name, " ".join(filter(None, (show_value(value), unit))), allowed, meaning))
    return rows
