"""Writes docs/parameters.md: every ROS parameter, made from the dataclasses that declare it.

./env python tools/parameters.py
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from sain_core.config import Config
from sain_model.serving.settings import ServingConfig
from sain_mppi.loop.settings import MppiConfig
from sain_sim.node.simulator import SimulatorConfig

PAGE = Path(__file__).parents[1] / "docs" / "parameters.md"
NODES = {
    "sain_sim sim_node": SimulatorConfig(),
    "sain_model model_node": ServingConfig(),
    "sain_mppi mppi_node": MppiConfig(),
}
INTRODUCTION = """# Parameters

Made by `tools/parameters.py` from the dataclasses that hold the defaults; a test sees that it is
current.

Set them with `--ros-args -p name:=value` or `--params-file FILE`. They are read at the start and
read-only from then on, but for those marked *live*, which may be changed at any time. An unknown
name or a value that is not allowed stops the node with one line that says what was probably meant.
"""
TABLE_HEAD = "| parameter | default | allowed | meaning |\n| --- | --- | --- | --- |\n"


def page() -> str:
    """Return the page."""
    parts = [INTRODUCTION]
    for node, settings in NODES.items():
        parts.append(f"\n## {node}\n\n{TABLE_HEAD}")
        parts += [f"| {' | '.join(row)} |\n" for row in rows(settings, "")]
    return "".join(parts)


def rows(settings: Config, prefix: str) -> list[tuple[str, str, str, str]]:
    """Return name, default, allowed values and meaning of each parameter."""
    found = []
    for item in dataclasses.fields(settings):
        value, about = getattr(settings, item.name), item.metadata
        if isinstance(value, Config):
            found += rows(value, f"{prefix}{item.name}.")
            continue
        unit = f" [{about['unit']}]" if about.get("unit") else ""
        meaning = about.get("description", "").replace("|", "\\|")
        meaning = f"*live*: {meaning}" if about.get("live") else meaning
        found.append(
            (f"`{prefix}{item.name}`", f"`{shown(value)}`", allowed(about), meaning + unit)
        )
    return found


def shown(value: object) -> str:
    """Return a default as YAML has it."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(shown, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def allowed(about: dict[str, object]) -> str:
    """Return what a value may be."""
    if about.get("choices"):
        return ", ".join(f"`{choice}`" for choice in about["choices"])
    low, high = about.get("minimum"), about.get("maximum")
    if low is None and high is None:
        return ""
    if high is None:
        return f"from {shown(low)}"
    return f"to {shown(high)}" if low is None else f"{shown(low)} to {shown(high)}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
