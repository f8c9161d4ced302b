"""Every command of every page: what it names exists, and a test runs it or it is marked."""

import ast
from importlib import import_module
from pathlib import Path
from shlex import split

import pytest

from tests.documentation.coverage import BY_TEST, PAGES_BY_TEST, program, runner
from tests.documentation.programs import problems
from tests.documentation.shell import PAGES, command_blocks, commands_in, page_name
from tests.paths import ROOT
from tools.site.notes import code_blocks


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_programs_options_and_values_exist(page: Path, tmp_path: Path) -> None:
    wrong = []
    for block in command_blocks(page):
        for words in commands_in(block.code, tmp_path):
            wrong += [f"line {block.line}: {problem}" for problem in problems(words)]
    assert wrong == []


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_a_command_is_run_by_a_test_or_marked(page: Path, tmp_path: Path) -> None:
    """A mark is a line before the block: <!-- not tested: takes hours -->."""
    if "decisions" in page.parts:
        return  # the site says of all of them that they are of their time
    name = page_name(page)
    missing = [
        f"line {block.line}: {program(words)}"
        for block in command_blocks(page)
        if not block.reason
        for words in commands_in(block.code, tmp_path)
        if not runner(name, words)
    ]
    assert missing == []


def test_the_tests_that_run_commands_start_their_programs() -> None:
    for name, test in BY_TEST.items():
        text = (ROOT / test).read_text()
        word = name.split()[-1].rpartition("/")[2]
        assert word in text or "glob" in text or name == "make demo", (
            f"{test} does not start {name}"
        )
    assert all((ROOT / test).exists() for test in PAGES_BY_TEST.values())


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_python_is_python_and_imports_what_there_is(page: Path) -> None:
    for block in code_blocks(page.read_text(encoding="utf-8")):
        if block.language == "python":
            for node in ast.walk(ast.parse(block.code)):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("sain_"):
                    module = import_module(node.module or "")
                    assert [one.name for one in node.names if not hasattr(module, one.name)] == []


def test_the_first_steps_in_python_are_run(capsys: pytest.CaptureFixture[str]) -> None:
    page = (ROOT / "docs/tutorials/first_steps.md").read_text()
    (code,) = [block.code for block in code_blocks(page) if block.language == "python"]
    exec(compile(code, "docs/tutorials/first_steps.md", "exec"), {})
    assert capsys.readouterr().out.startswith("[ 0.69")


def test_a_wrong_command_is_found() -> None:
    assert list(problems(["./env", "ros2", "run", "sain_sim", "collect", "--out", "o"])) == []
    for words, problem in (
        ("make coffee", "make has no coffee"),
        ("ros2 run sain_sim sing", "sain_sim has no executable sing"),
        ("ros2 run sain_sim collect --out o --loud", "--loud"),
        ("ros2 run sain_sim sim_node --ros-args -p wrold:=rough", "no parameter wrold"),
        ("ros2 topic pub /sain/goal sain_interfaces/msg/Goal '{z: 1}'", "Goal.msg has no z"),
        ("python -m benchmarks.masses --loud", "--loud"),
        ("python examples/00.py", "examples/00.py does not exist"),
    ):
        found = list(problems(split(words)))
        assert problem in " ".join(found), words
