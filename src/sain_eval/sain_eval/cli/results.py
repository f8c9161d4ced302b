"""`ros2 run sain_eval results`: one page from several evaluations."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from sain_core.config import Config, option, required
from sain_core.errors import ConfigError
from sain_core.output import OVERWRITE_HELP, claim_file, write_whole


@dataclass(frozen=True)
class ResultsOptions(Config):
    """Write one page from several evaluations: scenarios in rows, realities in columns."""

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional] = required(
        "the --out folders of evaluations; of two with the same cell, the later one counts"
    )
    out: Path = option(Path("results/results.md"), "the page to write")
    overwrite: bool = option(False, OVERWRITE_HELP)
    names: str = option(
        "", "names of models in the page, with commas: runs/here/sain.safetensors=SAIN trained here"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.folders:
            raise ConfigError("no folder of an evaluation is given; at least one is needed")
        self.renamed()

    def renamed(self) -> dict[str, str]:
        """Return the names of models, by the name or path with which they were evaluated."""
        pairs = [word.strip().partition("=") for word in self.names.split(",") if word.strip()]
        if not all(equals for _, equals, _ in pairs):
            raise ConfigError(f"--names is {self.names!r}; allowed: MODEL=TEXT, with commas")
        return {model: text for model, _, text in pairs}


def run(options: ResultsOptions, console: Console) -> None:
    """Write the page, and print its path.

    Raises `DatasetError`: a folder holds no results; `OutputError`: the page cannot be written.
    """
    from sain_eval.loop.results_page import read_results, results_page

    claim_file(options.out, options.overwrite)
    page = results_page([read_results(folder) for folder in options.folders], options.renamed())
    write_whole(options.out, page.encode())
    console.print(str(options.out), markup=False, highlight=False, soft_wrap=True)
