"""Compiled kernels are never stale, and one call compiles all that the package runs."""

import ast
import shutil
from pathlib import Path

import numpy as np
import pytest

import sain_core
import sain_model
from sain_core.types import PushSequences
from sain_model.cli.kernels import compile_kernels
from sain_model.compute.compiling import CONSTANTS, CORE_CONSTANTS, sources_hash
from sain_model.dynamics.sain import SainDynamics
from sain_model.network import sain_kernels, shape_feature_kernels
from sain_model.network.interaction_network import new_network
from sain_model.network.settings import ANY_SHAPE, NetworkConfig
from sain_model.network.shape_features import network_inputs, push_frames
from sain_model.physics import planar_kernels
from sain_model.physics.planar import PlanarPrior

MODEL, CORE = Path(sain_model.__path__[0]), Path(sain_core.__path__[0])
HASHED = [*MODEL.rglob("*_kernels.py"), *(MODEL / name for name in CONSTANTS)]
ENTRIES = (
    planar_kernels.push_block,
    planar_kernels.push_conditioned_block,
    sain_kernels.correct_block,
    sain_kernels.roll_out_block,
    shape_feature_kernels.write_shape_block,
)


@pytest.fixture
def copies(tmp_path: Path) -> tuple[Path, Path]:
    """The sources of both packages, somewhere else."""
    places = tmp_path / "model", tmp_path / "core"
    for source, place in zip((MODEL, CORE), places, strict=True):
        shutil.copytree(source, place, ignore=shutil.ignore_patterns("__pycache__"))
    return places


def test_the_same_sources_have_the_same_folder_wherever_they_are(copies: tuple[Path, Path]) -> None:
    assert sources_hash(*copies) == sources_hash()


def test_a_byte_in_any_hashed_module_leads_to_another_folder(copies: tuple[Path, Path]) -> None:
    model, core = copies
    found = {sources_hash(*copies)}
    changed = [model / path.relative_to(MODEL) for path in HASHED]
    changed += [core / name for name in CORE_CONSTANTS]
    for path in changed:
        path.write_bytes(path.read_bytes() + b"#")
        found.add(sources_hash(*copies))
    assert len(found) == len(changed) + 1


def test_without_kernels_nothing_is_run(copies: tuple[Path, Path]) -> None:
    for path in copies[0].rglob("*_kernels.py"):
        path.rename(path.with_name(path.name.replace("_kernels", "_compiled")))
    with pytest.raises(FileNotFoundError, match=r"no \*_kernels.py under"):
        sources_hash(*copies)


def test_what_kernels_import_is_hashed() -> None:
    """Constants are frozen into machine code, wherever they come from."""
    hashed = {*HASHED, *(CORE / name for name in CORE_CONSTANTS)}
    for kernel in MODEL.rglob("*_kernels.py"):
        for node in ast.walk(ast.parse(kernel.read_text())):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("sain_"):
                package, *parts = str(node.module).split(".")
                path = {"sain_model": MODEL, "sain_core": CORE}[package].joinpath(*parts)
                assert path.with_suffix(".py") in hashed, f"{kernel.name} imports {path}"


def test_one_call_compiles_all_that_predictions_run() -> None:
    compile_kernels()
    before = [len(kernel.signatures) for kernel in ENTRIES]
    assert min(before) >= 1
    scenes = np.stack([make_scene(), make_scene()])
    scenes.setflags(write=False)
    pushes = np.tile([[0.1, 0.2, 0.05]], (2, 1))[::-1]
    pushes.setflags(write=False)
    for features, members in (("push", 1), ("world", 3)):
        network = new_network(NetworkConfig(features=features, members=members), 0)
        sain = SainDynamics(network, PlanarPrior(), "planar")
        sain.step(scenes, pushes, np.broadcast_to(0.12, 2))
        sain.rollout(scenes[0], sequences(pushes))
    shaped = NetworkConfig(bodies=ANY_SHAPE)
    network_inputs(shaped, scenes, push_frames(shaped, scenes, pushes, None), scenes, None)
    assert [len(kernel.signatures) for kernel in ENTRIES] == before


def make_scene() -> np.ndarray:
    scene = np.zeros((2, 8))
    scene[:, 0] = 0.4, 0.6
    scene[:, 6:] = (8.0, 0.08), (8.0, 0.06)
    return scene


def sequences(pushes: np.ndarray) -> PushSequences:
    return np.broadcast_to(pushes[:, None], (2, 3, 3))
