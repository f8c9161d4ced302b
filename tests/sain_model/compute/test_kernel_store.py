"""Compiled kernels are never stale, are found wherever the checkout is, and are compiled once."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import sain_core
import sain_model
from sain_model.compute.kernel_store import compile_kernels, kernel_folder, source_hashes

MODEL, CORE = Path(sain_model.__path__[0]), Path(sain_core.__path__[0])
KERNELS = sorted(MODEL.rglob("*_kernels.py"))
KEPT = kernel_folder()


@pytest.fixture
def copies(tmp_path):
    """The sources of both packages, somewhere else."""
    places = tmp_path / "sain_model", tmp_path / "sain_core"
    for source, place in zip((MODEL, CORE), places, strict=True):
        shutil.copytree(source, place, ignore=shutil.ignore_patterns("__pycache__"))
    return places


def changed(copies: tuple[Path, Path], path: Path) -> set[str]:
    """The modules whose kernels are compiled again after an edit."""
    before = source_hashes(*copies)
    path.write_bytes(path.read_bytes() + b"#")
    after = source_hashes(*copies)
    return {name for name in after if after[name] != before[name]}


def test_the_same_sources_have_the_same_hashes_wherever_they_are(copies):
    assert source_hashes(*copies) == source_hashes(MODEL.resolve(), CORE.resolve())


def test_an_edit_changes_a_module_and_those_that_use_it(copies):
    network = changed(copies, copies[0] / "network" / "network_kernels.py")
    assert network == {"network_kernels"}
    physics = changed(copies, copies[0] / "physics" / "body_kernels.py")
    assert {"contact_kernels", "impulse_kernels", "push_kernels"} < physics
    assert not physics & {"network_kernels", "patch_kernels", "feature_kernels"}


def test_an_edit_compiles_only_what_it_must_and_says_so(copies):
    compile_kernels()
    store = copies[0] / "__pycache__" / "kernels"
    shutil.copytree(KEPT, store)
    (store / "my_kernels-0123456789abcdef").mkdir()  # another program's
    kernels = copies[0] / "physics" / "touch_kernels.py"  # which no other kernels use
    kernels.write_text(kernels.read_text() + "\n# edited\n")
    program = """
from sain_model.physics.planar import PlanarPrior
from sain_model.compute.kernel_store import kernels_are_ready, compilation_progress
print(kernels_are_ready())
PlanarPrior(); PlanarPrior()
print(kernels_are_ready(), compilation_progress())
"""
    path = os.pathsep.join([str(copies[0].parent), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(store)}
    run = subprocess.run(
        [sys.executable, "-c", program],
        env=environment,
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines() == ["False", "True None"]
    lines = run.stderr.splitlines()
    assert lines and all(re.fullmatch(r"compiling \d+ of \d+ kernels", line) for line in lines)
    (store / "my_kernels-0123456789abcdef").rmdir()
    folders, before = ({path.name for path in place.glob("*_kernels-*")} for place in (store, KEPT))
    assert {name.partition("-")[0] for name in folders} >= {kernel.stem for kernel in KERNELS}
    assert {name.partition("-")[0] for name in folders - before} == {"touch_kernels"}
