"""How command lines fail: one line for a bad argument; `| head` is no failure."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import MISSING, fields
from typing import get_args, get_type_hints

import pytest

from sain_core.cli.command_line import Command
from sain_core.cli.program import find_commands, main

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
def test_who_reads_no_further_ends_the_command_without_an_error(work, code):
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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("print", "--out", ""), "print: --out is ''; it must be a path"),
        (("real_import", "a.csv", "--out", "x", "--shapes", ""), "real_import: --shapes is ''"),
        (("train", "", "--out", "x"), "train: dataset is ''; it must be a path"),
    ],
)
def test_an_empty_path_is_not_the_folder_that_the_user_is_in(
    arguments, said, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert main([*arguments]) == 2
    assert capsys.readouterr().err.startswith(said)
    assert not [*tmp_path.iterdir()]


def test_the_home_folder_is_no_folder_called_tilde(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["print", "--tags", "1", "--out=~/tags.pdf"]) == 0  # the shell leaves it as it is
    assert (tmp_path / "tags.pdf").exists()
    assert not [*(tmp_path / "here").iterdir()]


COMMANDS = {name: one for name, one in find_commands().items() if isinstance(one, Command)}


def needed(kind: type) -> Iterator[str]:
    """Yield arguments for the fields of a class of settings that have no default."""
    hints = get_type_hints(kind, include_extras=True)
    for item in fields(kind):
        if item.default is MISSING and item.default_factory is MISSING:
            positional = "ositional" in str(hints[item.name])
            choices = get_args(get_type_hints(kind)[item.name])
            value = choices[0] if choices and isinstance(choices[0], str) else "nowhere"
            yield from (value,) if positional else (f"--{item.name.replace('_', '-')}", value)


@pytest.mark.parametrize("name", COMMANDS)
def test_what_cannot_be_parsed_is_one_line(name, capsys):
    command = COMMANDS[name]
    kind = command.options()
    with pytest.raises(SystemExit):
        main([name, "--help"])
    numbers = re.findall(r" (--\S+) (INT|FLOAT) (?!INT|FLOAT)", capsys.readouterr().out)
    wrong = {"--no-such-option": "there is no option --no-such-option; "}
    for type_, flag in {type_: flag for flag, type_ in numbers}.items():
        if type_ == "INT":
            wrong[f"{flag} 1e30x"] = f"{flag} is '1e30x'; it must be a whole number"
            wrong[f"{flag}="] = f"{flag} is ''; it must be a whole number"
        else:
            wrong[flag] = f"{flag} has no value; it must be a number"
    for text, problem in wrong.items():
        assert main([name, *needed(kind), *text.split(" ")]) == 2
        said = capsys.readouterr().err
        short = command.name.rpartition(" ")[2]
        assert said.startswith(f"{short}: {problem}") and said.count("\n") == 1, said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("collect --seed 1e30", "--seed is '1e30'; it must be a whole number, 0 to 2147483647"),
        ("collect --episodes ten", "--episodes is 'ten'; it must be a whole number, at least 1"),
        ("collect --ou x", "there is no option --ou; did you mean --out?"),
        ("collect mine", "there is no place for mine; --help lists what there is"),
        ("new_shape a --near 1 b", "--near is '1', 'b'; it must be 2 values, each a number"),
        ("lab what", "action is 'what'; it must be one of list, show, add, replay, export, forget"),
        ("train a", "--out is missing; what to give: folder for checkpoint, card, loss curve and"),
        ("evaluate --delay -1", "--delay is -1.0 s; it must be at least 0 s"),
        ("closed_loop --tolerance inf", "--tolerance is inf; it must be finite"),
    ],
)
def test_an_argument_that_is_not_allowed_is_named_with_what_is(arguments, said, capsys):
    assert main(arguments.split()) == 2
    assert capsys.readouterr().err.startswith(f"{arguments.split()[0]}: {said}")
