"""`sain verify`: the figures of the pages, measured again, by the benchmarks of a checkout."""

import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final, Literal, get_args

from rich.console import Console

from sain_core.config import MOST_SEED, Config, option
from sain_core.errors import ConfigError
from sain_core.output import OVERWRITE_HELP, claim_folder

MODULE: Final = "benchmarks.verify.__main__"
RESULT: Final = "verify.json"
Sample = Literal["model", "real", "loops", "faults", "pusht", "anything"]


@dataclass(frozen=True)
class VerifyOptions(Config):
    """Measure a sample of the published figures again, with new seeds, beside what pages state.

    It prints the figures that are outside, and those that it does not measure, with the reason.
    All takes 20 to 30 minutes on two cores. Exit code 1: a figure is outside, or none is measured.
    """

    share: float = option(1.0, "of the sample", minimum=0.01, maximum=1.0)
    only: tuple[Sample, ...] = option(
        get_args(Sample),
        "figures of the shipped model, of real pushes, of closed loops, of faults"
        " of a graph, of Push-T, of an arm with Push Anything's bodies",
    )
    data: Path | None = option(None, "real pushes, as `real_import` reads them")
    outlines: Path | None = option(None, "bodies of Push Anything, as `make anything` reads them")
    seed: int = option(0, "of the sample", minimum=0, maximum=MOST_SEED)
    out: Path = option(Path("results/verify"), "folder for verify.json and what is continued")
    overwrite: bool = option(False, OVERWRITE_HELP)


def run(options: VerifyOptions, console: Console) -> int:
    """Measure, print and write the figures."""
    claim_folder(options.out, (RESULT,), options.overwrite)
    root = Path(__file__).resolve().parents[4]
    if not (root / "benchmarks" / "verify").is_dir():
        raise ConfigError(
            "verify needs a checkout: an installed package has neither the pages nor the"
            " benchmarks; clone the repository, and run `./env sain verify` in it"
        )
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    try:
        benchmark: Any = import_module(MODULE)
    except ModuleNotFoundError as error:
        raise ConfigError(f"verify needs {error.name}: ./env --with test true") from error
    return int(benchmark.verify(options, console))
