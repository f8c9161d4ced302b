"""`benchmarks.faults.hostile_files` in short: no command ends in a traceback, or takes long."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BAGS = (
    "metadata: aliases", "chunk: 4 GB", "chunk: false count", "schema: recursive", "message: long",
    "sqlite3: endless", "rosbag2: packed", "file: fifo", "messages mutated",
)  # fmt: skip


def run(*arguments: str) -> str:
    """Run the benchmark in a process without threads, from which it can fork; return its output."""
    command = [sys.executable, "-m", "benchmarks.faults.hostile_files", "--count", "1", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=280)
    assert done.returncode == 0, done.stderr[-5000:]
    return done.stdout


def test_bags():
    output = run("--kinds", "bag", "--families", *BAGS)
    assert output.splitlines()[-1].endswith(" 0 wrong")
    assert all(f"bag, {name}: " in output for name in ("info", "report", "recover", "play"))


def test_other_files():
    kinds = ("checkpoint", "belief", "data", "results", "parameters")
    output = run("--kinds", *kinds, "--families", "file: fifo", "digits", "false shape")
    assert output.splitlines()[-1].endswith(" 0 wrong")
    assert all(f"\n{kind}, " in f"\n{output}" for kind in kinds)
