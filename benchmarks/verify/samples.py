"""New samples of the figures of some pages, with other seeds than theirs."""

import re
import shlex
import shutil
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.console import Console

from benchmarks import pusht as push_t
from benchmarks.anything.__main__ import Options as AnythingOptions
from benchmarks.anything.__main__ import play_all
from benchmarks.faults.graph_faults import strikes
from benchmarks.real.__main__ import all_rows
from benchmarks.real.folds import five_folds
from benchmarks.real.pushes import read_pushes
from benchmarks.real.rows import Fixed, Published
from benchmarks.results.shipped_model import FRESH, collect
from benchmarks.verify.judging import Measured
from benchmarks.verify.pages import ROOT, Claim, bounded_claims, share_claims, solved_claims
from sain_core.cli.arguments import read_options
from sain_core.guarding.documents import read_json
from sain_core.randomness import Interval, bootstrap_mean, bootstrap_ratio, generator
from sain_eval.cli.evaluate import EvaluateOptions, evaluate
from sain_eval.cli.verify import VerifyOptions
from sain_eval.loop.results import SceneRecord, wilson_interval
from sain_eval.loop.results_page import CONTROLLER_NAMES
from sain_eval.loop.tables import tolerance_text
from sain_model.data.dataset import load_dataset
from sain_model.dynamics.load import load_shipped
from sain_model.evaluation.errors import MM, PRIOR_HISTORY, PUSHED, SAIN, SAIN_HISTORY
from sain_model.evaluation.errors import evaluate as errors_of
from sain_sim.world.engines import OFFERED

RESULTS: Final = "docs/reference/results.md"
REAL: Final = "docs/reference/real.md"
MODEL: Final = "docs/explanation/model.md"
ANYTHING: Final = "docs/reference/anything.md"
FAULTS: Final = "docs/reference/faults.md"
PUSHT: Final = "docs/reference/pusht.md"
SCENES: Final = 40  # of each scenario, model and world, in a whole sample
PUSHES: Final = 2000  # real ones, likewise
LEARNS: Final = 0.5  # least share at which models learn from real pushes, for minutes
EPISODES: Final = 40  # of each world of the models' page
KILLS: Final = 3  # of each process
GOALS: Final = 4  # of each of the bodies
BODIES: Final = ("push_t", "letter_r")
FIRST: Final = 1_000_000  # seed; those of the pages are below
SAMPLES: Final = 1000  # that differ; further seeds begin with the first again
METRES: Final = 1e3
WORLDS: Final = {
    "Bullet, disks": "disks", "Bullet, feet": "feet", "Bullet, flat": "flat", "`rough`": "rough",
    "MuJoCo, feet": "mujoco_feet", "MuJoCo, flat": "mujoco_flat", "`measured`, flat": "measured",
}  # fmt: skip
COMMAND: Final = re.compile(
    r"^# (?P<world>.+), commit \w+(?P<rest>.*)\nros2 run sain_eval evaluate (?P<words>.+)$", re.M
)

Pairs = list[tuple[Claim, Measured]]


def _of(request: VerifyOptions) -> tuple[float, int, Path]:
    """Return the share, the seed of a sample, and the folder for what is continued."""
    return request.share, request.seed % SAMPLES, request.out


def loops(request: VerifyOptions, console: Console) -> tuple[Pairs, list[str]]:
    """Play new scenes with each command of the page of results."""
    share, seed, work = _of(request)
    claims, pairs, skipped = solved_claims(RESULTS), Pairs(), list[str]()
    text = (ROOT / RESULTS).read_text(encoding="utf-8")
    for place, found in enumerate(COMMAND.finditer(text)):
        words, why = shlex.split(found["words"]), ""
        if found["rest"]:
            why = f"commit of its command{found['rest']}"
        elif "--engine" in words and (engine := words[words.index("--engine") + 1]):
            why = "" if engine in OFFERED.names() else f"engine {engine} is not installed"
        if why:
            skipped.append(f"{RESULTS}, {found['world']}: {why}")
            continue
        options = read_options(EvaluateOptions, "", words, True)
        name = f"{RESULTS}, {found['world']}, {options.scenario}, {options.controllers}"
        scenes = max(min(round(share * SCENES), options.scenes), 1)
        first = FIRST * (1 + seed) + 1000 * place
        out = work / "loops" / f"{place}_{seed}"
        console.print(f"{name}: {scenes} scenes from {first}", highlight=False)
        sample = replace(options, out=out, scenes=scenes, seed=first, workers=2)
        records = sorted(evaluate(sample, name, console), key=lambda one: one.group)
        for group, some in groupby(records, lambda one: one.group):
            measured = _of_scenes(rows := [*some], generator(seed, *map(str, group)))
            turn = group[3] if any(one.has_heading for one in rows) else 0.0
            within, model = tolerance_text(group[2], turn), CONTROLLER_NAMES.get(group[1], group[1])
            stated = claims.pop((group[0], within, model, found["world"]), [])
            pairs += [(one, measured[one.what]) for one in stated if one.what in measured]
    rest = [f"{one[0].page}, {one[0].row}: no command of its page" for one in claims.values()]
    return pairs, [*skipped, *rest]


def _of_scenes(records: list[SceneRecord], random: np.random.Generator) -> dict[str, Measured]:
    """Return what scenes show of share solved, pushes, seconds and errors."""
    solved = [one for one in records if one.success]
    found = {"solved": _share(len(solved), len(records))}
    for name, of, values in (
        ("pushes", solved, [one.pushes for one in solved]),
        ("s", records, [one.seconds for one in records]),
    ):
        mean = bootstrap_mean(np.array(values, float), random)
        found[name] = Measured(mean.estimate, len(of), mean.low, mean.high)
    errors = [one.target_errors for one in records if one.target_errors]
    sums, counts = (np.array([f(one) for one in errors], float) for f in (sum, len))
    found["mm"] = _scaled(bootstrap_ratio(sums, counts, random), len(errors))
    return {name: one for name, one in found.items() if one.n}


def _scaled(interval: Interval, n: int) -> Measured:
    return Measured(METRES * interval.estimate, n, METRES * interval.low, METRES * interval.high)


def real(request: VerifyOptions, console: Console) -> tuple[Pairs, list[str]]:
    """Predict a sample of real pushes; rows that learn do so of all but one of other folds."""
    share, seed, work = _of(request)
    if request.data is None:
        return [], [f"{REAL}: the data are not given (--data)"]
    pushes = read_pushes(request.data, work / "real")
    claims, pairs = bounded_claims(REAL, "5 folds", "position [mm]"), Pairs()
    fold = five_folds(pushes, FIRST + seed).folds[0]
    chosen = generator(seed, "verify").permutation(fold.test)[: max(round(share * PUSHES), 20)]
    sample = pushes.select(np.sort(chosen))
    for row in all_rows(pushes, work / "real", seed):
        if not (isinstance(row, Fixed | Published) or share >= LEARNS):
            continue
        console.print(f"{REAL}, {row.title}: {len(sample)} pushes", highlight=False)
        fitted = row.fit(pushes.select(fold.train), pushes.select(fold.own))
        off = np.linalg.norm((fitted.predict(sample).poses - sample.after)[:, :2], axis=1)
        mean = bootstrap_mean(off, generator(seed, row.key), sample.group)
        pairs.append((claims.pop(row.title), _scaled(mean, len(np.unique(sample.group)))))
    why = f"it needs a training: --share {LEARNS:g} or more"
    return pairs, [f"{one.page}, {one.row}: {why}" for one in claims.values()]


def model(request: VerifyOptions, console: Console) -> tuple[Pairs, list[str]]:
    """Collect new episodes in new laboratories, and predict their pushes with the shipped model."""
    share, seed, work = _of(request)
    claims, pairs = bounded_claims(MODEL, "Accuracy", "ratio of positions"), Pairs()
    shipped, episodes = load_shipped(), max(round(share * EPISODES), 2)
    for number, (world, name) in enumerate(WORLDS.items()):
        how = FRESH[name][1].replace("--lab 7000", f"--lab {20_000 + 100 * seed}")
        folder = work / "model" / f"{name}_{seed}_{episodes}"
        if not (folder / "card.json").exists():
            collect(folder, episodes, FIRST // 100 + 100 * seed + number, how)
        found = errors_of(load_dataset(folder), {SAIN: shipped})["after"]["1"]
        ratio = found["ratios"][PUSHED][SAIN_HISTORY][PRIOR_HISTORY][MM]
        pairs.append((claims.pop(world), Measured(ratio[0], episodes, ratio[1], ratio[2])))
    return pairs, []


def faults(request: VerifyOptions, console: Console) -> tuple[Pairs, list[str]]:
    """Kill each process of a graph; where something is lost, nothing survived."""
    share, seed, work = _of(request)
    claims, pairs = share_claims(FAULTS), Pairs()
    folder = work / "faults" / str(seed)
    shutil.rmtree(folder, ignore_errors=True)
    for row in strikes(folder, "kill", max(round(share * KILLS), 1), seed):
        console.print(f"{FAULTS}, {row.fault}", highlight=False)
        (claim,) = claims["Faults", row.fault]
        pairs.append((claim, _share(row.survived if not row.lost else 0, row.tries)))
    return pairs, []


def pusht(request: VerifyOptions, console: Console) -> tuple[Pairs, list[str]]:
    """Play a new episode of Push-T with each factor."""
    share, seed, work = _of(request)
    claims, pairs, folder = share_claims(PUSHT), Pairs(), work / "pusht" / str(seed)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / push_t.RESULTS
    found = read_json(path) if path.exists() else {"episodes": []}
    names = tuple(dict.fromkeys(row for _, row in claims))
    some = names[:: max(round(1.0 / share), 1)]
    push_t.play_all(
        push_t.Options(episodes=1, factors=some, seed=FIRST + seed), found, path, console
    )
    for row in found["episodes"]:
        for claim in claims.get((f"From {row['see']}", row["factor"]), []):
            pairs.append((claim, _share(int(0 < row["success"] <= push_t.BUDGET), 1)))
    return pairs, []


def anything(request: VerifyOptions, console: Console) -> tuple[Pairs, list[str]]:
    """Bring bodies of Push Anything to new goals, with the whole graph at its pace."""
    share, seed, work = _of(request)
    if request.outlines is None:
        return [], [f"{ANYTHING}: the outlines are not given (--outlines)"]
    claims, pairs, found = share_claims(ANYTHING), Pairs(), dict[str, Any]()
    options = AnythingOptions(
        data=request.outlines, robots=("ur5",), bodies=BODIES, goals=max(round(share * GOALS), 1),
        seed=FIRST + seed, out=work / "anything" / str(seed),
    )  # fmt: skip
    for _ in play_all(options, found, console):
        pass
    for name in BODIES:
        goals = found["trials"][f"ur5 tags {name}"]["goals"]
        times = [one["seconds"] for one in goals if one["seconds"] is not None]
        mean = bootstrap_mean(np.array(times), generator(seed, name))
        new = (
            _share(len(times), len(goals)),
            Measured(mean.estimate, len(times), mean.low, mean.high),
        )
        pairs += zip(claims["ur5, seen by tags", name.replace("_", " ")], new, strict=True)
    return pairs, []


def _share(hits: int, count: int) -> Measured:
    rate = wilson_interval(hits, count)
    return Measured(rate.estimate, count, rate.low, rate.high)
