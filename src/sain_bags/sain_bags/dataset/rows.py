"""Pushes of a recording as rows of a data set, a batch at a time, and why others are no rows."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import pi
from typing import Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.dataset.formats import VIDEOS, FormatName
from sain_bags.reading.reader import Bag
from sain_bags.rows.images import NEVER, Cameras
from sain_bags.rows.latched import Latched
from sain_bags.rows.results import OK, ResultReader, Results
from sain_bags.rows.topics import BODIES, GOAL, PUSH, PUSH_RESULT, STROKE, WORLD, topics_of
from sain_core.config import Config, option
from sain_core.errors import ErrorCode, SainError
from sain_core.guarding.untrusted import one_line, shown
from sain_core.model import Model
from sain_core.push import BODY, STROKE_NAMES, allowed_ranges, check_predictable
from sain_core.scene import MASS, RADIUS, STATE_NAMES, STATE_SIZE, THETA
from sain_core.shapes.bodies import Bodies, check_scenes
from sain_core.transitions import LIMITS as UNITS
from sain_core.transitions import MOVED, SAME_KIND, Column, Columns, changed_kinds, travels
from sain_core.types import Mask, Pushes, Scenes
from sain_core.wire import FRAMES, MIN_DISKS
from sain_core.wire.images import USUAL

READ: Final = (PUSH_RESULT, STROKE, GOAL, BODIES, WORLD)  # types that rows are made of
COMPUTED: Final = "computed:"  # prefix of a physics source: the recording has no prediction
FROM_RESULT: Final = "push_result"  # where the scenes of a row are from
LONGEST: Final = 3600.0  # [s], of a push
LIMITS: Final = {**UNITS, THETA: (-2.0 * pi, 2.0 * pi)}  # of columns of a scene
ANY: Final = (-float(np.finfo(float).max), float(np.finfo(float).max))  # but NaN and Inf
UNIT_HINT: Final = "; lengths are in m, headings in rad, masses in kg"

REFUSED: Final = "refused"
REPEATED: Final = "push id used before"
MIXED: Final = "made of several pushes: its ids differ"
UNSETTLED: Final = "scene before or after not settled"
SENSELESS: Final = "makes no sense"
CHANGED: Final = "mass or radius changed by the push"
UNPREDICTED: Final = "not predicted, and the prior cannot"
UNSEEN: Final = "no image of each camera within 1 s before it was sent"
NOT_MOVED: Final = "target moved by less than 2 mm"

Why = Callable[[Results, int], str]  # what is wrong with one push


@dataclass(frozen=True)
class ConversionConfig(Config):
    """The settings of a conversion."""

    format: FormatName = option(
        "npz", "format (docs/reference/formats.md); npz: the shards that `collect` writes"
    )
    prior: str = option(
        "planar",
        "predicts the pushes that a recording has no prediction of: a name, or a checkpoint's path",
    )
    moved_only: bool = option(
        False, "keep only transitions whose target moved by 2 mm or more, as the paper does"
    )
    keep_unsettled: bool = option(
        False, "keep also pushes before or after which something still moved"
    )
    images: str = option(
        USUAL,
        "colour images that become videos (LeRobot only): topics that end so, with commas between,"
        " or so and /compressed; none: empty",
    )
    namespace: str = option(
        "", "namespace of the graph, such as /sain; needed where a recording holds several"
    )

    @property
    def shown(self) -> str:
        """Topics of the images that the format has, as in `images`."""
        return self.images if self.format == VIDEOS else ""


class Dropped(NamedTuple):
    """A push that is no row, and why."""

    reason: str
    detail: str


class RowBlock(NamedTuple):
    """Rows whose scenes have one number of disks."""

    places: ndarray  # (M,) of their pushes among those that were given
    columns: Columns  # (M, ...) as in a shard, but for what numbers them


class BagPart(NamedTuple):
    """Rows of some pushes of a recording."""

    pushes: int  # that were read for them
    blocks: list[RowBlock]
    dropped: list[Dropped]


def read_rows(
    bag: Bag, namespace: str, config: ConversionConfig, prior: Callable[[], Model]
) -> Iterator[BagPart]:
    """Read one graph's recording once, in order, and yield its rows.

    An episode's rows are made when the next one begins: all that is stated of it is read then.

    Args:
        bag: the recording.
        namespace: of the graph.
        config: what becomes of pushes.
        prior: called for the model when a push without a prediction comes.
    """
    reader, latched = ResultReader(bag, namespace), Latched(bag, namespace)
    cameras = Cameras(bag, namespace, config.shown)
    maker, held = _RowMaker(config, latched, prior, cameras), list[Results]()
    types = (*READ, PUSH) if cameras.topics else READ
    for batch in bag.batches(topics_of(bag, namespace, *types), types=types):
        latched.read(batch)
        cameras.read(batch)
        if (results := reader.results(batch)) is None:
            continue
        episodes = results.column("episode_id")
        last = held[-1].column("episode_id")[-1] if held else episodes[0]
        if len(begins := np.flatnonzero(np.diff(episodes, prepend=last))):
            yield from map(maker.rows, held)
            yield maker.rows(results[: begins[-1]])
            held, results = [], results[begins[-1] :]
        held.append(results)
    yield from map(maker.rows, held)


class _RowMaker:
    """Makes rows of the pushes of one recording, or returns why a push is no row."""

    def __init__(
        self,
        config: ConversionConfig,
        latched: Latched,
        prior: Callable[[], Model],
        cameras: Cameras,
    ) -> None:
        self._config, self._latched, self._prior = config, latched, prior
        self._cameras = cameras
        self._used = np.empty(0, dtype=np.uint64)  # ids of executed pushes

    def rows(self, results: Results) -> BagPart:
        """Return the rows of pushes, and those that are none, in their order."""
        pushes = _Sorting(results)
        pushes.keep(results.column("error_code") == OK, REFUSED, why_refused)
        pushes.keep(~self._repeated(results, pushes.kept), REPEATED)
        pushes.keep(np.all([same for *_, same in results.ids], axis=0), MIXED, why_mixed)
        before, after = results.before, results.after
        if not self._config.keep_unsettled:
            pushes.keep(before.settled & after.settled, UNSETTLED)
        counts = before.counts
        alike = (counts == after.counts) & (counts >= MIN_DISKS)
        pushes.keep(alike, SENSELESS, why_uneven)
        for scenes in (before, after):
            frames = scenes.column("header.frame_id").astype(np.str_)
            pushes.keep(np.isin(frames, FRAMES), SENSELESS, partial(why_elsewhere, scenes.name))
        blocks = [
            self._block(pushes, np.flatnonzero(pushes.kept & (counts == count)), int(count))
            for count in np.unique(counts[pushes.kept])
        ]
        return BagPart(len(results), [one for one in blocks if len(one.places)], pushes.dropped)

    def _repeated(self, results: Results, executed: Mask) -> Mask:
        """Return which pushes have the id of one that was executed earlier (K,)."""
        ids, places = results.column("push_id"), np.flatnonzero(executed)
        repeated = np.zeros(len(ids), dtype=bool)
        if len(self._used) and len(ids) and ids.min() <= self._used.max():  # mostly counted up
            repeated = np.isin(ids, self._used) & executed
        _, first = np.unique(ids[places], return_index=True)
        again = np.ones(len(places), dtype=bool)
        again[first] = False
        repeated[places[again]] = True
        self._used = np.concatenate([self._used, ids[executed & ~repeated]])
        return repeated

    def _block(self, pushes: "_Sorting", chosen: ndarray, count: int) -> RowBlock:
        """Return the rows of pushes (M,) whose scenes have one number of disks N."""
        results = pushes.results
        before, after = (
            scenes.disks.take(chosen, count) for scenes in (results.before, results.after)
        )
        physics, predicted = results.physics(chosen, count), results.predicted[chosen]
        numbers = _Numbers.of(results, chosen, before, after, physics, predicted)
        pushes.keep_of(chosen, np.asarray(numbers.right.all(axis=1)), SENSELESS, numbers.why)
        same = np.asarray((changed_kinds(before, after) <= SAME_KIND).all(axis=(1, 2)))
        pushes.keep_of(chosen, same, CHANGED, why_changed)
        lacking = np.flatnonzero(pushes.kept[chosen] & ~predicted)
        if len(lacking):
            physics[lacking], why = self._predict(before[lacking], results, chosen[lacking])
            known = np.array([not why.get(push) for push in chosen.tolist()], dtype=bool)
            pushes.keep_of(chosen, known, UNPREDICTED, lambda _, push: why[push])
        episodes = results.column("episode_id")[chosen]
        goals, faults = self._goals(results, episodes, chosen)
        sound = np.array([push not in faults for push in chosen.tolist()], dtype=bool)
        pushes.keep_of(chosen, sound, SENSELESS, lambda _, push: faults[push])
        has_target = [self._latched.bodies_of(one).has_target for one in episodes.tolist()]
        moved = travels(before, after, np.array(has_target, dtype=bool)) >= MOVED
        if self._config.moved_only:
            pushes.keep_of(chosen, moved, NOT_MOVED)
        images = self._cameras.columns(results.column("push_id")[chosen])
        for times in images.values():
            pushes.keep_of(chosen, times != NEVER, UNSEEN)
        if not (kept := pushes.kept[chosen]).all():
            chosen, before, after, physics, episodes, goals, moved = (
                array[kept] for array in (chosen, before, after, physics, episodes, goals, moved)
            )
            images = {key: times[kept] for key, times in images.items()}
        if not len(chosen):
            return RowBlock(chosen, {})
        return RowBlock(
            chosen,
            _scene_columns(before, after, physics)
            | {Column.MOVED: moved}
            | self._push_columns(results, chosen)
            | self._latched.columns(episodes, goals, count)
            | images,
        )

    def _goals(
        self, results: Results, episodes: ndarray, chosen: ndarray
    ) -> tuple[ndarray, dict[int, str]]:
        """Return the goals of pushes (M,), and what is wrong with one, by push."""
        goals = self._latched.goals.chosen(episodes, results.log_times[chosen])
        faults = self._latched.goals.faults
        wrong = np.flatnonzero(np.isin(goals, list(faults))).tolist()
        return goals, {int(chosen[row]): faults[int(goals[row])] for row in wrong}

    def _push_columns(self, results: Results, chosen: ndarray) -> Columns:
        computed = COMPUTED + self._config.prior
        models = np.where(results.predicted, results.models, computed)[chosen]
        return {
            Column.ACTION: results.actions[chosen],
            Column.DURATION: results.column("duration")[chosen],
            Column.PUSH_ID: results.column("push_id")[chosen].astype(np.uint64),
            Column.BAG_EPISODE: results.column("episode_id")[chosen].astype(np.uint64),
            Column.BAG_SCENE: results.before.column("scene_id")[chosen].astype(np.uint64),
            Column.OUTCOME: np.full(len(chosen), OK),
            Column.STAMP: results.before.stamps[chosen],
            Column.NEXT_STAMP: results.after.stamps[chosen],
            Column.LOG_TIME: results.log_times[chosen],
            Column.SOURCE: np.full(len(chosen), FROM_RESULT),
            Column.PHYSICS_SOURCE: models.astype(np.str_),
            **{name: column[chosen] for name, column in results.origins.items()},
        }

    def _predict(
        self, scenes: Scenes, results: Results, chosen: ndarray
    ) -> tuple[Scenes, dict[int, str]]:
        """Return the prior's predictions (M, N, 8), and why it cannot predict a push, by place."""
        step, name = partial(_step, self._prior()), self._config.prior
        actions, episodes = results.actions[chosen], results.column("episode_id")[chosen]
        predicted, reasons = np.zeros_like(scenes), dict[int, str]()
        for episode in np.unique(episodes).tolist():
            rows, bodies = np.flatnonzero(episodes == episode), self._latched.bodies_of(episode)
            try:
                predicted[rows] = step(scenes[rows], actions[rows], bodies)
            except SainError:  # one spoils all: each is looked at alone
                for row in rows.tolist():
                    one = slice(row, row + 1)
                    try:
                        predicted[one] = step(scenes[one], actions[one], bodies)
                    except SainError as error:
                        reasons[int(chosen[row])] = str(error)
        for row in np.flatnonzero(~np.isfinite(predicted).all(axis=(1, 2))).tolist():
            reasons[int(chosen[row])] = f"{name} predicted NaN or Inf"
        return predicted, reasons


class _Sorting:
    """Results, which of them are still to be rows, and why the others are none."""

    def __init__(self, results: Results) -> None:
        self.results = results
        self.kept = np.ones(len(results), dtype=bool)
        self._dropped: dict[int, Dropped] = {}

    @property
    def dropped(self) -> list[Dropped]:
        """Those that are no rows, in their order."""
        return [self._dropped[place] for place in sorted(self._dropped)]

    def keep(self, right: Mask, reason: str, why: Why | None = None) -> None:
        """Drop the pushes that are not right (K,), with the reason and a detail of each, if any."""
        self.keep_of(np.arange(len(self.kept)), right, reason, why)

    def keep_of(self, chosen: ndarray, right: Mask, reason: str, why: Why | None = None) -> None:
        """Drop those of some pushes (M,) that are not right (M,)."""
        wrong = chosen[self.kept[chosen] & ~right]
        self.kept[wrong] = False
        for push in wrong.tolist():
            columns = self.results.table.columns
            named = f"push {columns['push_id'][push]} of episode {columns['push.episode_id'][push]}"
            detail = f"{named}: {why(self.results, push)}" if why else named
            self._dropped[push] = Dropped(reason, detail)


def _step(prior: Model, scenes: Scenes, pushes: Pushes, bodies: Bodies) -> Scenes:
    """Return the prior's predictions (M, N, 8) of pushes that it can be asked about."""
    check_scenes(scenes, bodies)
    return prior.with_bodies(bodies).step(scenes, check_predictable(pushes))


class _Numbers(NamedTuple):
    """All numbers of pushes (M,), each with what it may be."""

    chosen: ndarray  # (M,) the pushes
    values: ndarray  # (M, C)
    right: Mask  # (M, C)
    about: list[tuple[str, float, float, str]]  # (C,) its name, the range, and a hint

    @classmethod
    def of(
        cls, results: Results, chosen: ndarray, before: Scenes, after: Scenes,
        physics: Scenes, predicted: Mask,
    ) -> "_Numbers":  # fmt: skip
        """Gather the numbers of pushes with their scenes (M, N, 8)."""
        count = before.shape[1]
        predictions = np.where(predicted[:, None, None], physics, before)
        actions, durations = results.actions[chosen], results.column("duration")[chosen]
        parts = {"scene before": before, "scene after": after, "prediction": predictions}
        about = [
            (f"{part}: {name} of disk {disk}", *(LIMITS if part[0] == "s" else {}).get(column, ANY))
            for part in parts
            for disk in range(count)
            for column, name in enumerate(STATE_NAMES)
        ]
        ranges = {BODY: (0.0, count - 1.0)}
        allowed, names = allowed_ranges(results.are_strokes), STROKE_NAMES[: actions.shape[1]]
        ranges |= {column: (least, most) for column, least, most in allowed}
        about += [(f"{name} of the push", *ranges.get(n, ANY)) for n, name in enumerate(names)]
        about.append(("duration [s]", 0.0, LONGEST))
        flat = [part.reshape(len(chosen), -1) for part in parts.values()]
        values = np.concatenate([*flat, actions, durations[:, None]], axis=1)
        low, high = np.array([limits for _, *limits in about]).T
        hints = [UNIT_HINT] * (2 * count * STATE_SIZE) + [""] * len(about)
        named = [(*one, hint) for one, hint in zip(about, hints, strict=False)]
        return cls(chosen, values, (values >= low) & (values <= high), named)

    def why(self, results: Results, push: int) -> str:
        """Return which number of a push is wrong."""
        row = int(np.flatnonzero(self.chosen == push)[0])
        column = int(np.flatnonzero(~self.right[row])[0])
        name, least, most, hint = self.about[column]
        value = self.values[row, column]
        if (least, most) == ANY or np.isnan(value):
            return f"{name} is {value}; it must be finite"
        return f"{name} is {value:g}; allowed: {least:g} to {most:g}{hint}"


def _scene_columns(before: Scenes, after: Scenes, physics: Scenes) -> Columns:
    count = len(before)
    return {
        Column.STATE: before.reshape(count, -1),
        Column.PHYSICS_NEXT: physics.reshape(count, -1),
        Column.NEXT_STATE: after.reshape(count, -1),
        Column.MASSES: before[..., MASS],
        Column.RADII: before[..., RADIUS],
    }


def why_refused(results: Results, push: int) -> str:
    """Return the error of a refused push."""
    code = int(results.column("error_code")[push])
    name = ErrorCode(code).name if code in set(ErrorCode) else f"error {code}"
    return f"{name}: {one_line(results.column('error_message')[push])}"


def why_mixed(results: Results, push: int) -> str:
    """Return which id of a result differs from its own."""
    column, own = next((one, own) for one, own, same in results.ids if not same[push])
    return f"{column} is {results.column(column)[push]}; {own} is {results.column(own)[push]}"


def why_changed(results: Results, push: int) -> str:
    """Return how a mass or a radius was changed most."""
    before, after = results.before.disks.one(push), results.after.disks.one(push)
    body, place = np.unravel_index(changed_kinds(before, after).argmax(), (len(before), 2))
    column = (MASS, RADIUS)[place]
    return (
        f"{STATE_NAMES[column]} of body {body} is {before[body, column]:g} before and"
        f" {after[body, column]:g} after it; allowed: {100 * SAME_KIND:g} % of difference"
    )


def why_uneven(results: Results, push: int) -> str:
    """Return how many disks the scenes of a push have."""
    before, after = results.before.counts[push], results.after.counts[push]
    return f"{before} disks before the push, {after} after; allowed: as many, {MIN_DISKS} or more"


def why_elsewhere(scene: str, results: Results, push: int) -> str:
    """Return the frame that a scene is in."""
    frame = results.table.columns[f"{scene}.header.frame_id"][push]
    return f"scene {scene} is in frame {shown(frame)}; it must be in 'world'"
