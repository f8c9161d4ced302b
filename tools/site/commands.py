"""The pages of commands: what ``--help`` of every executable says, as tables."""

import re
import warnings
from argparse import Action
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any, Final

import tyro

from sain_core.cli.arguments import describe_options
from sain_core.cli.command_line import Command
from sain_core.cli.node_command import NodeCommand

PACKAGES: Final = (
    "sain_bringup", "sain_sim", "sain_vision", "sain_arm", "sain_model", "sain_mppi", "sain_bags",
    "sain_eval", "sain_lab", "sain_live",
)  # fmt: skip
INTRODUCTION: Final = """# Commands

For users of the terminal: every executable with all of its options, as `--help` prints them.

```
./env ros2 pkg executables           # lists them
./env ros2 run sain_sim collect --help
```

| command | does |
| --- | --- |
"""
TOPICS: Final = ("publishes", "subscribes", "offers", "calls", "actions")
ENDING: Final = re.compile(r" *\((?:default: (.*)|(required))\)$", re.DOTALL)


def pages() -> dict[str, str]:
    """Return a page for each package and one that lists all commands, by place in the site."""
    found, rows = {}, []
    for package in filter(find_spec, PACKAGES):
        module = import_module(f"{package}.commands")
        entries = entries_of(module)
        found[f"reference/commands/{package}.md"] = "\n".join(page(package, entries))
        for entry in entries:
            name = entry.name.split()[1]
            link = f"[`{entry.name}`]({package}.md#{name})"
            rows.append(f"| {link} | {summary(entry)} |\n")
    found["reference/commands/index.md"] = INTRODUCTION + "".join(rows)
    return found


def entries_of(module: ModuleType) -> list[Command | NodeCommand]:
    """Return the executables that a module declares, in its order."""
    return [entry for entry in vars(module).values() if isinstance(entry, Command | NodeCommand)]


def page(package: str, entries: list[Command | NodeCommand]) -> Iterator[str]:
    """Yield the lines of the page of a package."""
    yield f"# {package}\n"
    yield f"Options of the executables of `{package}`, as `--help` prints them.\n"
    for entry in entries:
        name = entry.name.split()[1]
        yield f"## {name}\n"
        yield from node(entry) if isinstance(entry, NodeCommand) else program(entry)


def about(entry: Command | NodeCommand) -> str:
    """Return the text of an executable's help."""
    if isinstance(entry, NodeCommand):
        return entry.about
    return " ".join((entry.options().__doc__ or "").split("\n\n    Attributes:")[0].split())


def summary(entry: Command | NodeCommand) -> str:
    """Return the first sentence of it."""
    return escape(re.split(r"(?<=[.:])\s", about(entry))[0].rstrip(":"))


def node(entry: NodeCommand) -> Iterator[str]:
    """Yield what a node does, its topics, and where its parameters stand."""
    yield f"```\nros2 run {entry.name} --ros-args -p {entry.example}\n```\n"
    yield f"{escape(entry.about)}\n"
    yield "| has | names |\n| --- | --- |"
    for title in TOPICS:
        if names := getattr(entry, title):
            yield f"| {title} | {', '.join(f'`{name}`' for name in names)} |"
    anchor = entry.name.replace(" ", "-")
    yield f"\nIts parameters are [listed here](../parameters.md#{anchor}).\n"


def program(command: Command) -> Iterator[str]:
    """Yield the usage of a command and a table for each group of its options."""
    parser = parser_of(command)
    asked = [action for action in parser._actions if not action.option_strings]
    words = " ".join(f"{metavar(action)}" for action in asked)
    ros = " [--ros-args ...]" if command.ros else ""
    yield f"```\nros2 run {command.name} {words + ' ' if words else ''}[OPTIONS]{ros}\n```\n"
    yield f"{escape(about(command))}\n"
    for group in parser._action_groups:
        actions = [one for one in group._group_actions if "--help" not in one.option_strings]
        if not actions:
            continue
        if group.title not in ("options", "positional arguments"):
            yield f"**{group.title.removesuffix(' options')}.** {escape(group.description or '')}\n"
        yield '<div class="options" markdown>\n\n| option | meaning |\n| --- | --- |'
        yield from map(row, actions)
        yield "\n</div>\n"


def parser_of(command: Command) -> Any:
    """Return the parser of a command's options."""
    kind = command.options()
    describe_options(kind)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return tyro.extras.get_parser(
            kind, config=() if command.prefixes else (tyro.conf.OmitArgPrefixes,)
        )


def row(action: Action) -> str:
    """Return an option as a row of a table."""
    names = ", ".join(f"`{name}`" for name in action.option_strings) or f"`{metavar(action)}`"
    if action.option_strings and action.nargs != 0:
        names = names[:-1] + f" {metavar(action)}`"
    ending = ENDING.search(action.help or "")
    meaning = (action.help or "")[: ending.start()] if ending else action.help or ""
    shown = ""
    if ending and ending[2]:
        shown = ". Required"
    elif ending and ending[1] not in ("", "''", "None"):
        shown = f". Default: `{ending[1]}`"
    return f"| {names} | {escape(meaning)}{shown} |"


def metavar(action: Action) -> str:
    """Return what stands for the value of an option."""
    found = str(action.metavar or action.dest.upper())
    if found.startswith("["):  # any number of them
        return re.sub(r"^\[+(\w+).*", r"\1 ...", found)
    return found.replace("|", " or ")


def escape(text: str) -> str:
    """Return plain text as Markdown; what stands in backticks stays."""
    parts = re.split(r"(`[^`]*`)", " ".join(text.split()))
    return "".join(
        part.replace("|", "\\|") if part.startswith("`") else re.sub(r"([|*<\[\]_])", r"\\\1", part)
        for part in parts
    )
