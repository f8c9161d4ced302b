"""Rows of the tables that learn physics, a network, or both, on pushes of our own simulation."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.real.folds import five_folds, left_out
from benchmarks.real.kept import pose_errors
from benchmarks.real.network import NetworkRow
from benchmarks.real.physics import IdentifiedPhysics, Physics
from benchmarks.real.pushes import PushTable, push_table
from benchmarks.real.rows import Predicted, Row, fixed_rows
from sain_core.scene import POSE
from sain_core.transitions import draw_parts
from sain_model import commands
from sain_model.dynamics.identify import infer_bodies
from sain_model.dynamics.load import load_checkpoint
from sain_model.dynamics.sain import weights_of
from sain_model.evaluation.errors import predict_known
from sain_model.inference.kinds import read_belief
from sain_model.network.settings import NetworkConfig
from sain_model.training.kernel_fit import FOLDS
from sain_model.training.settings import OF_BODIES
from tests.benchmarks.real.synthetic import SURFACES, write_pushes
from tests.sain_model.conftest import read_card

SMALL = replace(OF_BODIES, epochs=2, network=NetworkConfig(hidden=8, message=4, members=2))


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    return IdentifiedPhysics(tmp_path_factory.mktemp("physics"))


def fold_of(pushes: PushTable) -> tuple[PushTable, PushTable, PushTable]:
    fold = five_folds(pushes, 0).folds[0]
    return pushes.select(fold.train), pushes.select(fold.own), pushes.select(fold.test)


def off(found: Predicted, pushes: PushTable) -> float:
    return float(pose_errors(found.poses, pushes.after)[0].mean())


def test_physics_is_identified_for_each_body_on_its_surface(synthetic_pushes, identified):
    train, own, test = fold_of(synthetic_pushes)
    physics = identified.fit(train, own)
    shown = physics.population.shown
    bodies = physics.population.kind.values(np.array([one.place for one in shown.values()]))
    friction = dict(zip(map(str, shown), bodies["tool_friction"], strict=True))
    for surface, truth in SURFACES.items():
        believed = [friction[body] for body in test.body[test.surface == surface]]
        assert np.mean(believed) == pytest.approx(truth, rel=0.25)
    still, nominal, physics_shipped, shipped = (
        row.fit(train, own).predict(test) for row in fixed_rows()
    )
    assert off(physics.predict(test), test) < 0.8 * off(nominal, test)
    assert off(nominal, test) < off(still, test)
    assert max(off(shipped, test), off(physics_shipped, test)) < off(still, test)


def test_a_new_body_is_predicted_with_what_others_and_its_own_pushes_show(
    synthetic_pushes, identified
):
    errors = []
    for case in left_out(synthetic_pushes, 0, "object", (0, 20)):
        fold = case.folds[0]
        parts = (synthetic_pushes.select(rows) for rows in (fold.train, fold.own, fold.test))
        train, own, test = parts
        physics = identified.fit(train, own)
        assert (set(test.body) <= set(map(str, physics.population.shown))) == (len(own) > 0)
        errors.append(off(physics.predict(test), test))
    assert errors[1] < errors[0]


@pytest.mark.parametrize("alone", [True, False], ids=["learned only", "SAIN"])
def test_a_network_is_trained_once_and_has_regions(synthetic_pushes, identified, tmp_path, alone):
    row: Row = NetworkRow(tmp_path, None if alone else identified, SMALL, SMALL)
    train, own, test = fold_of(synthetic_pushes)
    found = row.fit(train, own).predict(test)
    assert found.radius.shape == found.turn.shape == (len(test),)
    assert (found.radius > 0.0).all()
    files = list((tmp_path / row.key).glob("[!.]*"))
    # With physics, the fold that chose the epoch is left out of one more.
    assert len(files) == FOLDS + (not alone)
    again = row.fit(train, own).predict(test)
    np.testing.assert_array_equal(again.poses, found.poses)
    assert list((tmp_path / row.key).glob("[!.]*")) == files


def test_the_command_learns_what_the_benchmark_learns(tmp_path):
    data = write_pushes(tmp_path / "data", count=12)
    belief, out = tmp_path / "belief.json", tmp_path / "out"
    assert commands.identify([str(tmp_path / "data"), "--out", str(belief)]) == 0
    given = [str(tmp_path / "data"), "--belief", str(belief), "--out", str(out)]
    assert commands.train(given) == 0
    pushes, kind = push_table(data), replace(read_belief(belief).likeliest, corrected=True)
    split = draw_parts(pushes.group, OF_BODIES.seed, OF_BODIES.validation, 0.0)[:2]
    learned, held = map(pushes.select, split)
    physics = Physics(infer_bodies(kind, learned.dataset))
    row = NetworkRow(tmp_path, IdentifiedPhysics(tmp_path, kind))
    of_row = row.trained(learned, held, physics, OF_BODIES)
    model = load_checkpoint(out / "sain.safetensors")
    assert weights_of(model).serialize() == weights_of(of_row).serialize()
    gain = read_card(out / "sain.safetensors").errors["of_bodies"]
    for name, corrected in (("before", False), ("after", True)):
        each = [
            predict_known(of_row, part, physics.population, corrected).mean[:, 0, POSE]
            for part in held.dataset.parts
        ]
        assert gain[name] == pytest.approx(off(Predicted(np.concatenate(each)), held), rel=1e-6)
