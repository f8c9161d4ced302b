"""``ros2 run sain_model identify``: what recordings of a laboratory tell of its physics."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console

from sain_core.cli.terminal import FittingTable, make_table
from sain_core.config import Config, option, required
from sain_core.errors import ConfigError, DatasetError
from sain_core.output import OVERWRITE_HELP, claim_file
from sain_core.provenance import ros2_command
from sain_model.network.settings import SHIPPED

if TYPE_CHECKING:
    from sain_model.inference.evidence import ObservedPushes
    from sain_model.inference.kinds import Belief


@dataclass(frozen=True)
class IdentifyOptions(Config):
    """Learn from recordings of one laboratory what a model believes before an episode's first push.

    Bags become data sets by ``ros2 run sain_bags to_dataset`` first. Two recordings that disagree
    about a parameter are an error.
    """

    datasets: Annotated[tuple[Path, ...], tyro.conf.Positional] = required(
        "folders of shards *.npz, each a recording of the laboratory"
    )
    out: Path = option(Path("runs/belief.json"), "file for the belief")
    overwrite: bool = option(False, OVERWRITE_HELP)
    model: str = option(SHIPPED, "model that it is for: sain, or the path of a checkpoint")
    pushes: int = option(
        0,
        "largest number of pushes of each recording, or of each body that recordings of a robot"
        " name; 0: all, or as many as change anything",
        minimum=0,
    )
    surface: str = option(
        "",
        "surface that bodies are pushed on next, as a robot's recordings name it; empty: the one of"
        " all recordings, or another",
    )


def run(options: IdentifyOptions, console: Console) -> None:
    """Identify, print a table and write the belief."""
    from sain_core.model import load_dynamics
    from sain_model.data.dataset import load_dataset
    from sain_model.dynamics.identify import (
        ENOUGH,
        identify,
        identify_bodies,
        states_bodies,
        with_all_parameters,
    )
    from sain_model.dynamics.sain import SainDynamics

    claim_file(options.out, options.overwrite)
    for place, path in enumerate(options.datasets):
        if path in options.datasets[:place]:
            raise DatasetError(f"{path} is given twice; give each recording once")
    if states_bodies(data := load_dataset(*options.datasets)):
        if options.model != SHIPPED:
            raise ConfigError(
                f"--model is {options.model!r}; it is for recordings of a laboratory, and these"
                " name the pushed bodies (column object): leave it out"
            )
        _write(options, identify_bodies(data, options.pushes or ENOUGH, options.surface), console)
        return
    if options.surface:
        raise ConfigError(
            f"--surface is {options.surface!r}; it is for recordings that name the pushed bodies"
            " (column object), and these do not: leave it out"
        )
    model = load_dynamics(options.model)
    if not isinstance(model, SainDynamics):
        raise ConfigError(f"--model is {options.model!r}; it must be sain or a checkpoint")
    _write(options, identify(with_all_parameters(model), load_recordings(options)), console)


def _write(options: IdentifyOptions, belief: "Belief", console: Console) -> None:
    from sain_model.inference.kinds import write_belief

    card = belief.card | {"model": options.model, "command": ros2_command("sain_model", "identify")}
    for table in belief_tables(belief):
        console.print(table, soft_wrap=True)
    for notice in card.get("notices", ()):
        console.print(f"warning: {notice}", soft_wrap=True, markup=False, highlight=False)
    path = write_belief(options.out, replace(belief, card=card))
    console.print(f"{card['pushes']} pushes of {card['episodes']} episodes; written to {path}")


def load_recordings(options: IdentifyOptions) -> "dict[str, Sequence[ObservedPushes]]":
    """Return recordings by name.

    Raises `DatasetError`: one is damaged, or its first episode has more pushes than are asked for.
    """
    from sain_model.data.dataset import load_dataset
    from sain_model.dynamics.identify import observed_pushes

    found: dict[str, Sequence[ObservedPushes]] = {}
    for path in options.datasets:
        found[str(path)] = observed_pushes(load_dataset(path), options.pushes)
        if not found[str(path)]:
            raise DatasetError(
                f"the first episode of {path} has more than {options.pushes} pushes; give a larger"
                " --pushes"
            )
    return found


def belief_tables(belief: "Belief") -> Iterator[FittingTable]:
    """Yield a belief as tables: kinds that were compared, and the parameters of the likeliest."""
    from sain_model.physics.parameters import BY_NAME

    if evidence := belief.card.get("evidence"):
        rows = (
            (kind.name, f"{evidence[kind.name]:.0f}", f"{kind.log_odds:.1f}")
            for kind in belief.kinds
        )
        yield make_table("Kinds of physics", ("physics", "log evidence", "log odds"), rows)
    kind = belief.likeliest
    parameters = (
        (name, f"{mean:.4g}", _spread(spread, BY_NAME[name].logarithm))
        for name, (mean, spread) in kind.stated.items()
    )
    yield make_table(f"Parameters, {kind.name}", ("parameter", "mean", "spread"), parameters)


def _spread(spread: float, logarithm: bool) -> str:
    return f"{100 * spread:.1f} %" if logarithm else f"{spread:.2g}"
