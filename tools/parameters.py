"""Writes docs/reference/parameters.md: every ROS parameter, from the dataclasses that declare it.

./env python tools/parameters.py
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from sain_core.cli.node_command import NodeCommand
from sain_core.config import Config, show_value
from sain_mppi.agent.agent import MppiConfig

PAGE = Path(__file__).parents[1] / "docs/reference/parameters.md"
PACKAGES = (
    "sain_sim",
    "sain_vision",
    "sain_arm",
    "sain_model",
    "sain_mppi",
    "sain_lab",
    "sain_live",
)
INTRODUCTION = """# Parameters

For users of the nodes. This page lists every ROS parameter. `tools/parameters.py` makes it from the
dataclasses that hold the defaults, and a test checks that it is current.

```
./env ros2 run sain_mppi mppi_node --ros-args -p planner.samples:=1024
./env ros2 run sain_mppi mppi_node --ros-args --params-file FILE
```

The title of a table is the prefix of its names: `samples` under `planner` is `planner.samples`.
Nodes read parameters at the start. Those marked *live* can be changed at any time. An unknown name
or a value that is not allowed stops the node with one line; it names the nearest valid name.
"""
TABLE_HEAD = "| parameter | default | allowed | meaning |\n| --- | --- | --- | --- |\n"
SHARED = "feasibility"
"""Settings that nodes share: listed once, at the end of the page."""
SHARED_HEAD = f"""
## {SHARED.capitalize()}

`sim_node` has these with the prefix `bullet.{SHARED}`, `mppi_node` and `arm_node` with `{SHARED}`.
"""


def page() -> str:
    """Return the page."""
    parts = [INTRODUCTION]
    for node, settings in nodes():
        parts.append(f"\n## {node}\n")
        parts += tables(settings, "")
    parts += [SHARED_HEAD, *tables(MppiConfig().feasibility, "")]
    return "".join(parts)


def nodes() -> Iterator[tuple[str, Config]]:
    """Yield each node of the installed packages, with the defaults of its settings."""
    for package in filter(find_spec, PACKAGES):
        for entry in vars(import_module(f"{package}.commands")).values():
            if isinstance(entry, NodeCommand) and entry.settings:
                module, _, name = entry.settings.partition(":")
                yield entry.name, getattr(import_module(f"{package}.{module}"), name)()


def tables(settings: Config, prefix: str, live: bool = False) -> list[str]:
    """Return a table of the settings with a prefix, then the tables of the groups among them."""
    rows, groups = [], []
    for item in dataclasses.fields(settings):
        value, may_change = getattr(settings, item.name), live or item.metadata.get("live", False)
        if not isinstance(value, Config):
            rows.append(f"| {' | '.join(row(item, value, may_change))} |\n")
        elif item.name != SHARED:
            groups += tables(value, f"{prefix}{item.name}.", may_change)
    heading = f"\n### {prefix[:-1]}\n" if prefix and rows else ""
    return [f"{heading}\n{TABLE_HEAD}", *rows, *groups] if rows else groups


def row(item: dataclasses.Field[object], value: object, live: bool) -> tuple[str, str, str, str]:
    """Return name, default, allowed values and meaning of a parameter."""
    about = item.metadata
    unit = f" [{about['unit']}]" if about.get("unit") else ""
    meaning = about.get("description", "").replace("|", "\\|")
    meaning = f"*live*: {meaning}" if live else meaning
    return f"`{item.name}`", f"`{show_value(value)}`", allowed(about), meaning + unit


def allowed(about: dict[str, object]) -> str:
    """Return what a value may be."""
    if about.get("choices"):
        return ", ".join(f"`{choice}`" for choice in about["choices"])
    low, high = about.get("minimum"), about.get("maximum")
    if low is None and high is None:
        return ""
    if high is None:
        return f">= {show_value(low)}"
    return f"<= {show_value(high)}" if low is None else f"[{show_value(low)}, {show_value(high)}]"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
