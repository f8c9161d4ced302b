"""Every command of every page: what it names exists, and its options and values are accepted."""

import ast
import re
import subprocess
import sys
from importlib import import_module
from itertools import pairwise
from shlex import split

import pytest

from tests.documentation.programs import problems
from tests.documentation.shell import PAGES, command_blocks, commands_in, page_name
from tests.paths import ROOT
from tools.site.notes import code_blocks


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_programs_options_and_values_exist(page, tmp_path):
    wrong = []
    for block in command_blocks(page):
        for words in commands_in(block.code, tmp_path):
            wrong += [f"line {block.line}: {problem}" for problem in problems(words)]
    assert wrong == []


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_what_is_written_stays_out_of_the_root(page, tmp_path):
    """Git ignores these folders of the checkout; some pages have a placeholder."""
    commands = [w for block in command_blocks(page) for w in commands_in(block.code, tmp_path)]
    written = [
        one for words in commands for option, one in pairwise(words) if option in ("--out", "--bag")
    ]
    folders = ("results/", "runs/", "data/", "bags/", "/", "~", "$")
    assert [one for one in written if not one.startswith(folders) and not one.isupper()] == []


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_python_is_python_and_imports_what_there_is(page):
    for block in code_blocks(page.read_text(encoding="utf-8")):
        if block.language == "python":
            for node in ast.walk(ast.parse(block.code)):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("sain_"):
                    module = import_module(node.module or "")
                    assert [one.name for one in node.names if not hasattr(module, one.name)] == []


def python_of(page: str) -> str:
    """The one block of Python of a page."""
    blocks = code_blocks((ROOT / page).read_text())
    (code,) = [block.code for block in blocks if block.language == "python"]
    return code


def test_the_python_of_readme_is_ten_lines_and_prints_what_readme_says():
    code = python_of("README.md")
    assert len([line for line in code.splitlines() if line.strip()]) == 10
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    said = re.search(r"It prints `(.*)`", (ROOT / "README.md").read_text())
    assert said
    reached, predicted, *none = numbers_of(done.stdout)
    assert none == [] and len(reached) == len(predicted) == 2
    assert re.sub(NUMBERS, "[]", done.stdout.strip()) == re.sub(NUMBERS, "[]", said[1])
    for printed, stated in zip((reached, predicted), numbers_of(said[1]), strict=True):
        assert printed == pytest.approx(stated, abs=0.002)  # another processor rounds otherwise
    assert reached == pytest.approx(predicted, abs=0.002)


NUMBERS = r"\[[^\]]*\]"


def numbers_of(text: str) -> list[list[float]]:
    """The numbers of each pair of brackets."""
    return [[float(word) for word in found[1:-1].split()] for found in re.findall(NUMBERS, text)]


def test_a_wrong_command_is_found():
    assert list(problems(["./env", "ros2", "run", "sain_sim", "collect", "--out", "o"])) == []
    for words, problem in (
        ("make coffee", "make has no coffee"),
        ("ros2 run sain_sim sing", "sain_sim has no executable sing"),
        ("ros2 run sain_sim collect --out o --loud", "--loud"),
        ("ros2 run sain_sim sim_node --ros-args -p wrold:=rough", "no parameter wrold"),
        ("ros2 topic pub /sain/goal sain_interfaces/msg/Goal '{z: 1}'", "Goal.msg has no z"),
        ("python -m benchmarks.faults.graph_faults --loud", "--loud"),
        ("python examples/00.py", "examples/00.py does not exist"),
    ):
        found = list(problems(split(words)))
        assert problem in " ".join(found), words
