"""Pushes of a recording as rows of a data set, a batch at a time, and why others are no rows."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import pi
from typing import Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.dataset.formats import FormatName
from sain_bags.reading.reader import Bag
from sain_bags.rows.latched import Latched
from sain_bags.rows.results import OK, RecordedScenes, ResultReader, Results
from sain_bags.rows.topics import BODIES, GOAL, PUSH_RESULT, WORLD, topics_of
from sain_core.config import Config, option
from sain_core.errors import ErrorCode, InvalidInputError, OutOfRangeError, SainError
from sain_core.guarding.untrusted import one_line, shown
from sain_core.model import Model
from sain_core.push import PUSH_NAMES, allowed_ranges, check_predictable
from sain_core.scene import MASS, POSITION, RADIUS, STATE_NAMES, STATE_SIZE, TARGET, THETA
from sain_core.shapes.bodies import Bodies, check_scenes
from sain_core.transitions import LIMITS as UNITS
from sain_core.transitions import MOVED, SAME_KIND, Column, Columns, changed_kinds
from sain_core.types import Mask, Pushes, Scene, Scenes
from sain_core.wire import FRAMES, MIN_DISKS, check_disks, check_fields

READ: Final = (PUSH_RESULT, GOAL, BODIES, WORLD)  # types of the messages that rows are made of
COMPUTED: Final = "computed:"  # prefix of a physics source: the recording has no prediction
FROM_RESULT: Final = "push_result"  # where the scenes of a row are from
LONGEST: Final = 3600.0  # [s], of a push
LIMITS: Final = {**UNITS, THETA: (-2.0 * pi, 2.0 * pi)}  # of columns of a scene

REFUSED: Final = "refused"
REPEATED: Final = "push id used before"
MIXED: Final = "made of several pushes: its ids differ"
UNSETTLED: Final = "scene before or after not settled"
SENSELESS: Final = "makes no sense"
CHANGED: Final = "mass or radius changed by the push"
UNPREDICTED: Final = "not predicted, and the prior cannot"
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
    namespace: str = option(
        "", "namespace of the graph, such as /sain; needed where a recording holds several"
    )


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
    maker, held = _RowMaker(config, latched, prior), list[Results]()
    for batch in bag.batches(topics_of(bag, namespace, *READ), types=READ):
        latched.read(batch)
        if not len(found := reader.of(batch)):
            continue
        results = reader.results(found)
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
        self, config: ConversionConfig, latched: Latched, prior: Callable[[], Model]
    ) -> None:
        self._config, self._latched, self._prior = config, latched, prior
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
        pushes.keep(alike, SENSELESS, why_senseless)
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
        sensible = _sensible(results, chosen, before, after)
        sensible &= np.isfinite(physics).all(axis=(1, 2)) | ~predicted
        pushes.keep_of(chosen, sensible, SENSELESS, why_senseless)
        same = np.asarray((changed_kinds(before, after) <= SAME_KIND).all(axis=(1, 2)))
        pushes.keep_of(chosen, same, CHANGED, why_changed)
        lacking = np.flatnonzero(pushes.kept[chosen] & ~predicted)
        if len(lacking):
            physics[lacking], why = self._predict(before[lacking], results, chosen[lacking])
            known = np.array([not why.get(push) for push in chosen.tolist()], dtype=bool)
            pushes.keep_of(chosen, known, UNPREDICTED, lambda _, push: why[push])
        pushes.keep_of(chosen, _carried_out(results.actions[chosen]), SENSELESS, why_senseless)
        episodes = results.column("episode_id")[chosen]
        goals, faults = self._goals(results, episodes, chosen)
        sound = np.array([push not in faults for push in chosen.tolist()], dtype=bool)
        pushes.keep_of(chosen, sound, SENSELESS, lambda _, push: faults[push])
        if self._config.moved_only:
            pushes.keep_of(chosen, _moved(before, after), NOT_MOVED)
        if not (kept := pushes.kept[chosen]).all():
            chosen, before, after, physics, episodes, goals = (
                array[kept] for array in (chosen, before, after, physics, episodes, goals)
            )
        if not len(chosen):
            return RowBlock(chosen, {})
        return RowBlock(
            chosen,
            _scene_columns(before, after, physics)
            | self._push_columns(results, chosen)
            | self._latched.columns(episodes, goals, count),
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


def _sensible(results: Results, chosen: ndarray, before: Scenes, after: Scenes) -> Mask:
    """Return which pushes (M,) are such as can be; `why_senseless` says what is wrong."""
    sensible = _possible(before) & _possible(after)
    sensible &= results.bodies[chosen] < before.shape[1]
    sensible &= np.isfinite(results.actions[chosen]).all(axis=-1)
    for scenes in (results.before, results.after):
        frames = scenes.column("header.frame_id")[chosen].astype(np.str_)
        sensible &= np.isin(frames, FRAMES)
    durations = results.column("duration")[chosen]
    return np.asarray(sensible & (durations >= 0.0) & (durations <= LONGEST))


def _possible(scenes: Scenes) -> Mask:
    """Return which scenes (M, N, 8) are of finite numbers within `LIMITS`."""
    within = np.isfinite(scenes).all(axis=(1, 2))
    for column, (least, most) in LIMITS.items():
        values = scenes[..., column]
        within &= ((values >= least) & (values <= most)).all(axis=1)
    return within


def _carried_out(pushes: Pushes) -> Mask:
    """Return which pushes (M, 5) an arm may have carried out, see `check_predictable`."""
    right = np.ones(len(pushes), dtype=bool)
    for column, least, most in allowed_ranges(stroke=False):
        right &= (pushes[:, column] >= least) & (pushes[:, column] <= most)
    return right


def _moved(before: Scenes, after: Scenes) -> Mask:
    """Return which pushes moved the target, or the only body, by 2 mm or more (M,)."""
    target = min(TARGET, before.shape[1] - 1)
    travel = after[:, target, POSITION] - before[:, target, POSITION]
    return np.asarray(np.hypot(travel[:, 0], travel[:, 1]) >= MOVED)


def _scene_columns(before: Scenes, after: Scenes, physics: Scenes) -> Columns:
    count = len(before)
    return {
        Column.STATE: before.reshape(count, -1),
        Column.PHYSICS_NEXT: physics.reshape(count, -1),
        Column.NEXT_STATE: after.reshape(count, -1),
        Column.MASSES: before[..., MASS],
        Column.RADII: before[..., RADIUS],
        Column.MOVED: _moved(before, after),
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


def why_senseless(results: Results, push: int) -> str:
    """Return what is wrong with the scenes, the push or the prediction."""
    try:
        before = _possible_scene(results.before, push, "scene before")
        after = _possible_scene(results.after, push, "scene after")
        if len(before) != len(after):
            raise InvalidInputError(f"{len(before)} disks before the push, {len(after)} after")
        check_fields(results.actions[push], PUSH_NAMES, "push")
        if results.bodies[push] >= len(before):
            raise InvalidInputError(
                f"it is against body {results.bodies[push]}; the scene has bodies"
                f" 0 to {len(before) - 1}"
            )
        check_predictable(results.actions[push])
        if not 0.0 <= (duration := float(results.column("duration")[push])) <= LONGEST:
            raise InvalidInputError(f"duration is {duration:g} s; allowed: 0 to {LONGEST:g} s")
        predicted = results.table.sequences["prediction.disks"].one(push)
        check_disks(predicted, "prediction")
        raise InvalidInputError(f"{len(before)} disks, {len(predicted)} in the prediction")
    except (InvalidInputError, OutOfRangeError) as error:
        return str(error).replace("push ()", "the push")


def _possible_scene(scenes: RecordedScenes, push: int, name: str) -> Scene:
    if (frame := scenes.column("header.frame_id")[push]) not in FRAMES:
        raise InvalidInputError(f"{name} is in frame {shown(frame)}; it must be in 'world'")
    scene = check_disks(scenes.disks.one(push).reshape(-1, STATE_SIZE), name)
    for column, (least, most) in LIMITS.items():
        for value in scene[:, column].tolist():
            if not least <= value <= most:
                raise InvalidInputError(
                    f"{name}: {STATE_NAMES[column]} is {value:g}; allowed: {least:g} to {most:g};"
                    " lengths are in m, headings in rad, masses in kg"
                )
    return scene
