"""Every example runs, as its first lines say."""

import subprocess
import sys

import pytest

from tests.paths import ROOT

ELSEWHERE = ("06_", "07_", "09_")  # run by test_gymnasium_examples.py
EXAMPLES = sorted(
    path for path in (ROOT / "examples").glob("*.py") if not path.name.startswith(ELSEWHERE)
)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(example, tmp_path):
    done = subprocess.run(
        [sys.executable, example], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout.strip()
