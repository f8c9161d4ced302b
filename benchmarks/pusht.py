# ruff: noqa: E501 - lines of the page
"""``make pusht``: stable-worldmodel's Push-T, each of its factors of variation, played by SAIN.

The results are a page, pusht.md. An interrupted run continues.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import numpy as np
from joblib import Parallel, delayed
from rich.console import Console

from benchmarks.report import markdown_table
from sain_core.cli.arguments import read_options
from sain_core.config import MOST_SEED, Config, option
from sain_core.errors import ConfigError, SainError
from sain_core.guarding.documents import read_json
from sain_core.output import claim_folder, write_json, write_whole
from sain_core.provenance import git_commit, processor, versions
from sain_eval.loop.results import wilson_interval

EXAMPLE: Final = Path(__file__).parents[1] / "examples" / "pusht"
RESULTS: Final = "results.json"
PAGE: Final = "pusht.md"
NONE, ALL_DISK, ALL = "none", "all, with a disk", "all"
SHAPE: Final = "agent.shape"
SEES: Final = ("states", "pictures")
PACKAGES: Final = ("stable-worldmodel", "pymunk", "pygame", "numpy")
BUDGET: Final = 100  # steps: the default of stable-worldmodel's World

ABOUT: Final = """# Push-T with other colours, sizes and shapes

For users who compare with world models. stable-worldmodel has a Push-T with factors of variation. SAIN's agent plays it with the model
`pusht` of [`examples/pusht`](../../examples/pusht/README.md), from states, and from pictures alone.

<!-- not tested: takes hours -->
```
make pusht
```

**Success** is what the environment's own `step` states, within {budget} steps: the default of its `World`. Agent and block have to be
within 20 pixels of their places, in one norm over four numbers, and the block within 20 degrees. That code compares angles that may differ
by more than a turn, and then accepts any angle. *Angle, too* counts only episodes in which the angles agree as well.
Those are played on, to {late} steps; *in {late}* is success by then. *Steps* is the mean of the successes within {budget}.

**Episodes** are those that its own `reset` draws, with its own goals. *none*: its default, which draws start places and the block's angle.
Any other factor is drawn beside these three; each of the three is drawn alone. Its list has 17 factors, its own table says 16.
An agent is a disk unless `agent.shape` is drawn: then seven of eight have a mass and creep, at most 9.6 pixels a step,
where a disk moves 37. *all, with a disk* draws all other factors.

| published | success |
| --- | ---: |
| DINO-WM, no factor (arXiv 2602.08968) | 94 % |
| DINO-WM, one factor (arXiv 2602.08968) | 4 to 12 % |
| LeWM, with factors (arXiv 2605.21800) | 6 % |
| diffusion policy, gym-pusht: 95 % covered (LeRobot's model card) | 63.8 % |

**What differs.** These learn from pictures and demonstrations. Our agent is given outlines, sizes, centre of mass and inertia of agent
and block, the room, and the physics: contacts without friction, and how the agent follows its target. From pictures, it learns
the colours from the first one and that of the goal, and fits the outlines. It is given no pose and no goal state. A block that looks
the same after a turn may come to the wrong heading first; without success, it is turned on. The published goals
lie 25 steps ahead in recorded demonstrations, with a budget of 50 steps. Those recordings have 13 GB and are not used:
goals here lie anywhere in the room. Actions stay in their space. Only the modules of Push-T are imported, without
the package's dependencies, and with the pymunk 6 of gym-pusht. With pymunk 7, six episodes of 60 random actions were equal to the bit.
"""


@dataclass(frozen=True)
class Options(Config):
    """Play stable-worldmodel's Push-T with each of its factors of variation.

    An interrupted run continues. The results are a page, pusht.md.
    """

    episodes: int = option(50, "of each factor", minimum=1)
    factors: tuple[str, ...] = option((), f"names, {NONE} and {ALL}; none: every one")
    see: tuple[str, ...] = option(SEES, f"how scenes are seen: {', '.join(SEES)}")
    seed: int = option(0, "of the first episode", minimum=0, maximum=MOST_SEED)
    workers: int = option(2, "processes that share the work", minimum=1)
    out: Path = option(Path("results/pusht"), "folder of results; a run continues with those in it")
    again: bool = option(False, "make the page again, from the results in the folder")
    overwrite: bool = option(False, "replace what others wrote there")


def main() -> int:
    """Play what is not in the results yet, and write the page."""
    console = Console(stderr=True, soft_wrap=True)
    try:
        options = read_options(Options, "python -m benchmarks.pusht", sys.argv[1:])
        if others := set(options.see) - set(SEES):
            raise ConfigError(f"see is {', '.join(others)}; allowed: {', '.join(SEES)}")
        claim_folder(options.out, (RESULTS, PAGE), options.overwrite)
        path = options.out / RESULTS
        found: dict[str, Any] = read_json(path) if path.exists() else {"episodes": []}
        if not options.again:
            play_all(options, found, path, console)
        write_whole(options.out / PAGE, page(found).encode())
    except SainError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def play_all(options: Options, found: dict[str, Any], path: Path, console: Console) -> None:
    """Play the episodes without results: the first of each factor, then the second."""
    allowed = (NONE, *_example().factors(), ALL_DISK, ALL)
    if unknown := set(options.factors) - set(allowed):
        raise ConfigError(f"factors are {', '.join(unknown)}; allowed: {'; '.join(allowed)}")
    names = options.factors or allowed
    done = {(row["factor"], row["see"], row["seed"]) for row in found["episodes"]}
    jobs = [
        (name, see, seed)
        for seed in range(options.seed, options.seed + options.episodes)
        for see in options.see
        for name in names
        if (name, see, seed) not in done
    ]
    made = {"commit": git_commit(), "processor": processor(), **versions(*PACKAGES)}
    work = Parallel(n_jobs=options.workers, return_as="generator_unordered")
    for count, row in enumerate(work(delayed(played)(*job) for job in jobs), start=1):
        found["episodes"].append(row | made)
        write_json(path, found)
        said = f"{row['factor']}, {row['see']}, seed {row['seed']}: {row['success'] or 'failed'}"
        console.print(f"{count}/{len(jobs)} {said}", markup=False, highlight=False)


def played(name: str, see: str, seed: int) -> dict[str, Any]:
    """Play an episode; return its row: steps until success, 0 without one."""
    example, begun = _example(), perf_counter()
    world = example.begin_episode(drawn(name, example), seed, see == SEES[1])
    import_module("pusht.aims").play_episode(world)
    return {
        "factor": name,
        "see": see,
        "seed": seed,
        "success": world.success,
        "agreed": world.steps if world.done else 0,
        "steps": world.steps,
        "seconds": round(perf_counter() - begun, 1),
    }


def drawn(name: str, example: Any) -> list[str]:
    """Return the factors that are drawn for a row of the table."""
    if name == NONE:
        return list(example.STARTS)
    if name == ALL_DISK:
        return [factor for factor in example.factors() if factor != SHAPE]
    return [name] if name in (ALL, *example.STARTS) else [*example.STARTS, name]


def _example() -> Any:
    if str(EXAMPLE) not in sys.path:
        sys.path.insert(0, str(EXAMPLE))
    return import_module("pusht.varied")


def page(found: Mapping[str, Any]) -> str:
    """Return the page in Markdown."""
    about = ABOUT.format(budget=BUDGET, late=2 * BUDGET)
    return "\n".join(part.strip() + "\n" for part in (about, *_tables(found), _made(found)))


def _tables(found: Mapping[str, Any]) -> Iterator[str]:
    for see in SEES:
        rows = [row for row in found["episodes"] if row["see"] == see]
        names = dict.fromkeys(row["factor"] for row in sorted(rows, key=_order))
        lines = [_line(name, [row for row in rows if row["factor"] == name]) for name in names]
        if lines:
            header = [
                "factor",
                "success",
                "95 % interval",
                "steps",
                f"in {2 * BUDGET}",
                "angle, too",
            ]
            yield f"## From {see}"
            yield markdown_table(header, lines)


def _order(row: Mapping[str, Any]) -> tuple[int, str]:
    ends = {NONE: 0, ALL_DISK: 2, ALL: 3}
    return ends.get(row["factor"], 1), row["factor"]


def _line(name: str, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    count = len(rows)
    steps = [row["success"] for row in rows if 0 < row["success"] <= BUDGET]
    _, low, high = wilson_interval(len(steps), count)
    late = sum(row["success"] > 0 for row in rows)
    agreed = sum(row["agreed"] > 0 for row in rows)
    mean = f"{np.mean(steps):.0f}" if steps else "-"
    share = f"{100 * low:.0f} to {100 * high:.0f} %"
    return [name, f"{len(steps)}/{count}", share, mean, f"{late}/{count}", f"{agreed}/{count}"]


def _made(found: Mapping[str, Any]) -> str:
    keys = ("commit", "processor", *PACKAGES)
    made = {tuple(row[key] for key in keys) for row in found["episodes"]}
    rows = [[commit[:12] + "-dirty" * ("-" in commit), *others] for commit, *others in sorted(made)]
    return "## Provenance\n\n" + markdown_table(keys, rows)


if __name__ == "__main__":
    sys.exit(main())
