"""Compiled kernels are never stale, are found wherever the checkout is, and are compiled once."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import sain_core
import sain_model
from sain_model.compute.kernel_store import compile_kernels, kernel_folder, source_hash

MODEL, CORE = Path(sain_model.__path__[0]), Path(sain_core.__path__[0])
PROGRAM = """
from sain_model.physics.planar import PlanarPrior
from sain_model.compute.kernel_store import kernels_are_ready, describe_compilation
print(kernels_are_ready())
PlanarPrior(); PlanarPrior()
print(kernels_are_ready(), describe_compilation())
"""

ONE_KERNEL = "from sain_model.physics.planar import first_touch as one"  # all take a minute
ONE_KERNEL += "; one(SCENES, STROKES, Bodies.disks(2))"


def test_an_edit_compiles_anew_and_says_so(tmp_path):
    """Wherever the sources are."""
    compile_kernels()
    copies = tmp_path / "sain_model", tmp_path / "sain_core"
    for source, place in zip((MODEL, CORE), copies, strict=True):
        shutil.copytree(source, place, ignore=shutil.ignore_patterns("__pycache__"))
    assert source_hash(*copies) == source_hash()
    store = copies[0] / "__pycache__" / "kernels"
    shutil.copytree(kernel_folder(), store)
    (store / "my_kernels-0123456789abcdef").mkdir()  # another program's
    for edited in (copies[1] / "push.py", copies[0] / "physics" / "contact_kernels.py"):
        before = source_hash(*copies)
        edited.write_text(edited.read_text() + "\n# edited\n")
        assert source_hash(*copies) != before
    compiler = copies[0] / "cli" / "kernels.py"
    compiler.write_text(compiler.read_text().replace("RUNS[sys.argv[2]]()", ONE_KERNEL))
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(store)}
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=environment,
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines() == ["False", "True "]
    lines = run.stderr.splitlines()
    assert lines and all(re.fullmatch(r"compiling \d+ of \d+ kernels", line) for line in lines)
    kept = [path.name for path in store.glob("kernels-*")]
    assert kept == [f"kernels-{source_hash(*copies)}"]
    assert (store / "my_kernels-0123456789abcdef").exists()
