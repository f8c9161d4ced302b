"""``make real DATA=PATH``: who predicts real pushes how well; writes results/real/real.md."""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import tyro
from rich.console import Console

from benchmarks.real import page
from benchmarks.real.folds import all_cases
from benchmarks.real.kept import Kept, all_steps, compute
from benchmarks.real.measures import Figures, measure
from benchmarks.real.network import ALONE, NetworkRow
from benchmarks.real.physics import IdentifiedPhysics
from benchmarks.real.pushes import PushTable, read_pushes
from benchmarks.real.rows import Row, fixed_rows, published_rows
from benchmarks.real.trees import Trees
from sain_core.errors import DatasetError, SainError
from sain_core.output import claim_file, claim_folder, write_json, write_whole
from sain_core.provenance import git_commit, processor
from sain_model.importing.real_pushes import FOUND_AT

RESULTS: Final = "results.json"


@dataclass(frozen=True)
class Options:
    """What to read, and where to write."""

    data: Path | None = None
    """recordings, as `ros2 run sain_model real_import` reads them"""
    again: bool = False
    """make the page again, from the results in the folder; computes nothing"""
    out: Path = Path("results/real")
    """folder of results and page; an interrupted run continues with it"""
    page: Path | None = None
    """Markdown page to write in place of real.md in that folder"""
    overwrite: bool = False
    """replace what others wrote there, such as docs/reference/real.md"""
    cases: tuple[str, ...] = ()
    """only those whose names begin like one of these: folds, train, object, surface; none: all"""
    seed: int = 0
    """of folds, own pushes, trainings and bootstrap"""


def main() -> int:
    """Compute what is not kept, measure it, and write the page."""
    options = tyro.cli(Options, description=__doc__)
    console = Console(stderr=True)
    written = options.page or options.out / "real.md"
    try:
        claim_folder(options.out, (RESULTS,), options.overwrite)
        claim_file(written, options.overwrite)
        if not options.again:
            write_json(options.out / RESULTS, computed(options, console))
        results = read_results(options.out / RESULTS)
        write_whole(written, page.page(results).encode())
    except SainError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    console.print(f"wrote {written}", markup=False, highlight=False, soft_wrap=True)
    return 0


def computed(options: Options, console: Console) -> Figures:
    """Return the results of data; what is kept of them is not computed again.

    Raises:
        DatasetError: no data; the message says where they come from.
    """
    if options.data is None:
        raise DatasetError(f"real pushes are needed: make real DATA=PATH; {FOUND_AT}")
    pushes = read_pushes(options.data, options.out)
    kept = Kept(options.out / "predictions")
    cases, rows = all_cases(pushes, options.seed), all_rows(pushes, options.out, options.seed)
    if options.cases:
        cases = [case for case in cases if case.key.startswith(("folds", *options.cases))]

    def say(text: str) -> None:
        console.print(text, markup=False, highlight=False, soft_wrap=True)

    say(f"{len(pushes):,} pushes; seed {options.seed}")
    compute(pushes, all_steps(cases, rows), kept, say)
    say("measuring")
    results = measure(pushes, cases, rows, kept, options.seed)
    results["data"]["published"] = bool(pushes.published)
    results["made"] = {
        "command": f"make real DATA={options.data.name}{_arguments(options)}",
        "commit": git_commit(),
        "processor": processor(),
        "seed": options.seed,
    }
    return results


def all_rows(pushes: PushTable, work: Path, seed: int) -> list[Row]:
    """Return the rows of all tables; priors and trainings are kept in a folder of work."""
    identified = IdentifiedPhysics(work)
    return [
        *fixed_rows(),
        identified,
        *published_rows(pushes),
        NetworkRow(work, config=ALONE),
        Trees(seed=seed),
        Trees(identified, seed=seed),
        NetworkRow(work, identified),
    ]


def _arguments(options: Options) -> str:
    given = f"--cases {' '.join(options.cases)}" if options.cases else ""
    return f" ARGS='{given}'" if given else ""


def read_results(path: Path) -> Figures:
    """Return the results of a run before; raises `DatasetError`: there are none."""
    if not path.exists():
        raise DatasetError(f"{path} does not exist; make it: make real DATA=PATH")
    found: Figures = json.loads(path.read_text())
    return found


if __name__ == "__main__":
    sys.exit(main())
