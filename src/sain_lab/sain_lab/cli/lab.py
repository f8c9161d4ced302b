"""``sain lab``: list, show, add to, export and forget laboratories."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, islice
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import tyro
from rich.console import Console

from sain_core.cli.terminal import FittingTable, make_table
from sain_core.config import Config, option, required
from sain_core.errors import ConfigError
from sain_core.output import OVERWRITE_HELP
from sain_lab.storage.log import NOT_LEARNED

if TYPE_CHECKING:
    from sain_lab.judging.curves import Curves
    from sain_lab.learner import Learner
    from sain_lab.storage.laboratory import Laboratory
    from sain_lab.storage.log import Event
    from sain_lab.storage.results import Result

Action = Literal["list", "show", "add", "replay", "export", "forget"]
SHOWN: Final = 12  # events
CHART: Final = "chart.png"
NEEDS: Final = {  # fewest and most names, and what they are; of other actions one laboratory
    "list": (0, 0, "no name"),
    "add": (1, inf, "a laboratory, and recordings"),
    "replay": (1, inf, "at least one recording"),
}


@dataclass(frozen=True)
class LabOptions(Config):
    """Look at a laboratory (what was learned where a table stands), and handle it.

    list: all laboratories of this user. show NAME: parameters, errors, events.
    add NAME RECORDING...: learn from bags or data sets; without any, from pushes that wait. replay
    RECORDING...: stream recorded pushes as if they happened now, and draw the chart. export NAME:
    belief and checkpoint for a robot without the laboratory. forget NAME: remove it for good. NAME
    is a name, or a path with a slash.
    """

    action: Annotated[Action, tyro.conf.Positional] = required("what to do")
    names: Annotated[tuple[str, ...], tyro.conf.Positional] = option(
        (), "the laboratory; with add and replay, bags, MCAP files or folders of shards"
    )
    out: Path = option(
        Path(), "folder: export for belief.json and sain.safetensors; show and replay for chart.png"
    )
    train: bool = option(True, "add, replay: train networks on the way")
    laboratory: str = option("", "replay: laboratory that is kept; empty: none is")
    overwrite: bool = option(False, OVERWRITE_HELP)

    def __post_init__(self) -> None:
        super().__post_init__()
        fewest, most, wanted = NEEDS.get(self.action, (1, 1, "one laboratory"))
        if not fewest <= len(self.names) <= most:
            given = " ".join(self.names) or "none"
            raise ConfigError(f"{self.action} needs {wanted}; given: {given}")
        if self.action == "export" and self.out == Path():
            raise ConfigError("export needs --out, a folder")

    @property
    def chart_folder(self) -> Path:
        """The folder for the chart; the empty path: none is drawn."""
        if self.action == "replay" and self.out == Path():
            return Path("results/replay")
        return self.out if self.action in ("show", "replay") else Path()


def run(options: LabOptions, console: Console) -> None:
    """Do what is asked for."""
    from sain_core.output import claim_folder
    from sain_lab.storage.laboratory import Laboratory, forget

    if options.chart_folder != Path():
        claim_folder(options.chart_folder, (CHART,), options.overwrite)
    match options.action:
        case "list":
            show_list(console)
        case "forget":
            console.print(f"removed {forget(options.names[0])}")
        case "show":
            show(Laboratory.named(options.names[0]), console, options.chart_folder)
        case "replay":
            replay(options, console)
        case "export":
            export(Laboratory.named(options.names[0]), options, console)
        case "add":
            add(options, console)


def show_list(console: Console) -> None:
    """Print all laboratories of this user."""
    from sain_core.errors import SainError
    from sain_lab.storage.laboratory import Laboratory, data_folder, laboratory_names

    rows = []
    for name in laboratory_names():
        try:
            one = Laboratory.named(name)
            pushes = str(sum(record["kind"] == "push" for record in one.records()))
            pushes += f"; {len(one.damage)} lines of the log are damaged" if one.damage else ""
            rows.append((name, pushes, one.manifest.service, f"{one.bytes / 1e6:.1f} MB"))
        except SainError as error:
            rows.append((name, "", str(error), ""))
    if rows:
        console.print(
            make_table(str(data_folder()), ("name", "pushes", "in service", "size"), rows)
        )
    else:
        console.print(f"no laboratories in {data_folder()}")


def show(laboratory: "Laboratory", console: Console, out: Path) -> None:
    """Print parameters, errors and events of a laboratory; draw the chart where it is asked for."""
    from sain_lab.judging.curves import curves_of

    curves = curves_of(laboratory.records())
    console.print(f"{laboratory.path}: {curves.pushes} pushes", soft_wrap=True)
    learned = {record["id"] for record in laboratory.records() if record["kind"] == "push"}
    if waiting := sum(one.identity not in learned for one in laboratory.waiting()):
        how = f"`sain lab add {laboratory.path}` learns from them"
        console.print(f"{waiting} pushes were received and wait: {how}", soft_wrap=True)
    for text in laboratory.damage:
        console.print(text, soft_wrap=True)
    console.print(f"in service: {laboratory.manifest.service}")
    for table in tables(curves):
        console.print(table, soft_wrap=True)
    if out != Path() and curves.pushes:
        from sain_core.view.figures import write_png
        from sain_lab.judging.chart import draw_curves

        path = write_png(draw_curves(curves, laboratory.name), out / CHART)
        console.print(f"{path}: errors and parameters", soft_wrap=True)


def tables(curves: "Curves") -> Iterator[FittingTable]:
    """Yield parameters, errors and events as tables."""
    from sain_lab.judging.curves import SERVICE

    if curves.parameters:
        rows = (
            (name, f"{values[-1, 1]:.4g}", f"{values[-1, 2]:.2g}", f"{values[0, 2]:.2g}")
            for name, values in curves.parameters.items()
        )
        columns = ("parameter", "value", "spread", "spread at first")
        yield make_table("Physics", columns, rows)
    if curves.pushes:
        names = [name for name in ("planar", "physics", SERVICE) if name in curves.errors]
        parts = [(0, min(25, curves.pushes)), (max(curves.pushes - 100, 0), curves.pushes)]
        errors = (
            (name, *(_interval(*curves.interval(name, *part)) for part in parts)) for name in names
        )
        heads = (f"pushes {first + 1} to {last} [mm]" for first, last in parts)
        yield make_table("Errors before learning", ("predictor", *heads), errors)
    if curves.events:
        events = curves.events[-SHOWN:]
        latest = ((str(one.pushes), one.kind, one.text) for one in events)
        yield make_table("Events", ("pushes", "event", "what"), latest)


def _interval(mean: float, low: float, high: float) -> str:
    return f"{mean:.2f} [{low:.2f}, {high:.2f}]"


def export(laboratory: "Laboratory", options: LabOptions, console: Console) -> None:
    """Write what a robot without the laboratory needs: the belief, and the network in service.

    Raises `DatasetError`: nothing was learned yet; `OutputError`: the folder cannot be written, or
    a file there is not ours.
    """
    from sain_core.errors import DatasetError
    from sain_core.guarding.untrusted import read_regular
    from sain_core.output import claim_folder, write_whole
    from sain_model.dynamics.load import card_path
    from sain_model.inference.kinds import read_belief

    files: list[tuple[Path, str]] = []
    if laboratory.belief_path.exists():
        use = "evaluate --controllers sain --belief {}, or the parameter belief"
        if read_belief(laboratory.belief_path).trained.of_bodies:
            use = "train --belief {} on recordings of its bodies"
        files.append((laboratory.belief_path, use))
    if laboratory.manifest.has_network:
        weights = laboratory.model_path(laboratory.manifest.service)
        files += [(card_path(weights), "its card"), (weights, "evaluate --controllers {}")]
    if not files:
        raise DatasetError(f"laboratory {laboratory.path} has learned nothing yet")
    claim_folder(options.out, [source.name for source, _ in files], options.overwrite)
    for source, use in files:
        path = write_whole(options.out / source.name, read_regular(source))
        console.print(f"{path}: {use.format(path)}", soft_wrap=True)


def add(options: LabOptions, console: Console) -> None:
    """Learn from recordings."""
    from sain_lab.learner import Learner
    from sain_lab.storage.laboratory import Laboratory
    from sain_lab.storage.recordings import read_recording

    laboratory, *names = options.names
    if not names:
        Laboratory.named(laboratory)  # it must exist
    recordings = [begin(read_recording(Path(name))) for name in names]
    with Learner.named(laboratory, options.train) as learner:
        for text in learner.laboratory.damage:
            console.print(text, soft_wrap=True)
        if learner.waiting or not names:
            learn(learner, waiting(learner), "received before", console)
        for name, results in zip(names, recordings, strict=True):
            learn(learner, results, name, console)


def waiting(learner: "Learner") -> "Iterator[Result]":
    """Yield what was received before, one after another, to be observed."""
    while learner.waiting:
        yield learner.waiting[0]


def begin(results: "Iterator[Result]") -> "Iterator[Result]":
    """Read up to the first result: a recording that is refused leaves no laboratory behind."""
    return chain(list(islice(results, 1)), results)


def learn(
    learner: "Learner", results: "Iterable[Result]", name: str, console: Console, wait: bool = False
) -> None:
    """Learn from results, and print what happens; with `wait` trainings end before the next."""
    reasons: Counter[str] = Counter()

    def print_events(events: "Iterable[Event]") -> None:
        for event in events:
            if event.kind != NOT_LEARNED:
                console.print(f"{event.pushes}: {event.kind}: {event.text}", soft_wrap=True)

    for result in results:
        update = learner.observe(result)
        reasons[update.reason] += 1
        print_events(update.events)
        if wait:
            print_events(learner.wait())
    learner.end_episode()
    print_events(learner.wait())
    console.print(f"{name}: learned from {reasons.pop('', 0)} pushes", soft_wrap=True)
    for reason, count in reasons.most_common():
        console.print(f"  left out: {count}, {reason}", soft_wrap=True)


def replay(options: LabOptions, console: Console) -> None:
    """Stream recorded pushes through a learner as if they happened now."""
    from sain_core.scratch import scratch_folder
    from sain_lab.learner import Learner
    from sain_lab.storage.recordings import read_recording

    with scratch_folder("replay") as scratch:
        name = options.laboratory or str(Path(scratch) / "replay")
        recordings = [begin(read_recording(Path(path))) for path in options.names]
        with Learner.named(name, options.train) as learner:
            for path, results in zip(options.names, recordings, strict=True):
                learn(learner, results, path, console, wait=True)
            show(learner.laboratory, console, options.chart_folder)
