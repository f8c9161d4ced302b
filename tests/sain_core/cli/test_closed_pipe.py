"""`| head` ends a command, and is no failure of it."""

import os
import subprocess
import sys

import pytest

PRINTS = """
from dataclasses import dataclass
import sys
from sain_core.cli.command_line import Command
from sain_core.config import Config

@dataclass(frozen=True)
class Options(Config):
    '''Print.'''

def rich(options: Options, console):
    for line in range(100_000):
        console.print(f"line {line}")

def plain(options: Options, console):
    for line in range(100_000):
        sys.stdout.write(f"line {line}\\n")

def another_pipe(options: Options, console):
    import os
    gone, pipe = os.pipe()
    os.close(gone)
    os.write(pipe, b"nobody reads this")

sys.modules["printing.file"] = sys.modules["printing"] = sys.modules["__main__"]
"""


@pytest.mark.parametrize(
    ("work", "code"), [("rich", 0), ("plain", 0), ("plain --help", 0), ("another_pipe", 1)]
)
def test_who_reads_no_further_ends_the_command_without_an_error(work: str, code: int) -> None:
    name, *arguments = work.split()
    text = f"{PRINTS}\nrun = {name}\nsys.exit(Command('printing x', 'file')())"
    reader, writer = os.pipe()
    process = subprocess.Popen(
        [sys.executable, "-c", text, *arguments], stdout=writer, stderr=subprocess.PIPE, text=True
    )
    os.close(writer)
    if name != "another_pipe" and not arguments:
        assert os.read(reader, 6) == b"line 0"
        os.close(reader)
    elif arguments:
        os.close(reader)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == code, errors
    assert errors == "" or (code and "BrokenPipeError" in errors)
