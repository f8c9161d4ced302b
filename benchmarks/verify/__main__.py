"""A sample of the published figures, measured again with new seeds, beside what the pages state.

Values, intervals and sizes are read from the pages. Each is compared with a new sample by a test of
two samples. *outside*: both are no chance, at 5 % for all figures together (Holm). Figures that are
not measured are listed with the reason, and so are figures without a command on their page, and
those that differ from the page that they repeat.
"""

import hashlib
import sys
from collections import Counter
from dataclasses import asdict
from math import isfinite
from time import perf_counter
from typing import Final

from rich.console import Console
from rich.table import Table

from benchmarks.verify import samples
from benchmarks.verify.judging import LEVEL, Judged, judge
from benchmarks.verify.pages import ROOT, all_pages, stated_elsewhere, tables, without_command
from sain_core.output import write_json
from sain_core.provenance import DISTRIBUTION, command, git_commit, processor, versions
from sain_eval import commands
from sain_eval.cli.verify import RESULT, VerifyOptions
from sain_model.dynamics.load import load_shipped

PACKAGES: Final = ("numpy", "scipy", "numba", "pybullet", "mujoco", DISTRIBUTION)
REPEATS: Final = {  # pages, and those whose figures they repeat
    "README.md": (samples.RESULTS, samples.REAL),
    "docs/explanation/paper.md": (samples.RESULTS, samples.MODEL),
}
WHERE: Final = {  # why figures of a page are not measured here
    "README.md": "repeated from other pages, or learned: python -m benchmarks.results.learning",
}
OTHERWISE: Final = "no sample is drawn of it; see the commands of the page"


def verify(options: VerifyOptions, console: Console) -> int:
    """Measure, and print what is outside and what was not measured; see `VerifyOptions`."""
    pairs, missing, seconds = samples.Pairs(), list[str](), dict[str, float]()
    for name in options.only:
        start, take = perf_counter(), getattr(samples, name)
        found, left = take(options, console)
        seconds[name] = perf_counter() - start
        pairs, missing = [*pairs, *found], [*missing, *left]
    judged = judge(pairs)
    missing += not_measured({(claim.page, claim.row.partition(", ")[0]) for claim, _ in pairs})
    lists = {
        "not measured": missing,
        "no command beside it": [line for page in all_pages() for line in without_command(page)],
        "differs from its source": [
            line for page, sources in REPEATS.items() for line in stated_elsewhere(page, sources)
        ],
    }
    path = options.out / RESULT
    write_json(path, {**provenance_of(options), "seconds": seconds, "figures": [
        asdict(one.claim) | {"new": one.measured._asdict(), "inside": one.inside,
                             "probability": one.probability if isfinite(one.probability) else None}
        for one in judged
    ], **lists})  # fmt: skip
    show(judged, lists, console)
    console.print(f"{sum(seconds.values()):.0f} s; {path}", highlight=False)
    enough = [one for one in judged if isfinite(one.probability)]
    return int(not enough or not all(one.inside for one in enough))


def provenance_of(options: VerifyOptions) -> dict[str, object]:
    """Return what it takes to measure the same sample again."""
    pages = {page: (ROOT / page).read_bytes() for page in all_pages()}
    return {
        "command": command(), "commit": git_commit(), "processor": processor(),
        "versions": versions(*PACKAGES), "model": load_shipped().origin.model_hash,
        "pages": {page: hashlib.sha256(content).hexdigest() for page, content in pages.items()},
        "seed": options.seed, "share": options.share, "level": LEVEL,
    }  # fmt: skip


def not_measured(done: set[tuple[str, str]]) -> list[str]:
    """Return the sections with figures of which nothing was measured, with the reason."""
    found = Counter({(one.page, one.section): 0 for page in all_pages() for one in tables(page)})
    for page in all_pages():
        for table in tables(page):
            found[page, table.section] += table.figures
    return [
        f"{page}, {section}: {count} figures; {WHERE.get(page, OTHERWISE)}"
        for (page, section), count in found.items()
        if count and (page, section) not in done
    ]


def show(judged: list[Judged], lists: dict[str, list[str]], console: Console) -> None:
    """Print how many figures are inside on each page, each that is outside, and the lists."""
    table = Table(title="outside", title_justify="left")
    for column in ("figure", "page", "new", "n", "p"):
        table.add_column(column, justify="left" if column == "figure" else "right")
    for one in judged:
        if not one.inside:
            new, claim = one.measured, one.claim
            table.add_row(f"{claim.row}: {claim.what}", f"{claim.value:.3g}",
                          f"{new.value:.3g} [{new.low:.3g}, {new.high:.3g}]", str(new.n),
                          f"{one.probability:.1g}")  # fmt: skip
    if table.row_count:
        console.print(table)
    for page in dict.fromkeys(one.claim.page for one in judged):
        here = [one for one in judged if one.claim.page == page]
        few = sum(one.probability != one.probability for one in here)
        outside = sum(not one.inside for one in here)
        inside = len(here) - few - outside
        console.print(
            f"{page}: {inside} figures inside, {outside} outside, {few} of too few values"
        )
    for title, lines in lists.items():
        for line in lines:
            console.print(f"{title}: {line}", highlight=False, markup=False, soft_wrap=True)


if __name__ == "__main__":
    sys.exit(commands.verify(program="python -m benchmarks.verify"))
