"""The tutorial "first steps": every line is run, in order, and prints what the page shows."""

import os
import re
import shutil
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.paths import ROOT

pytestmark = pytest.mark.system
PAGE = ROOT / "docs/tutorials/first_steps.md"
PATIENCE = 580  # [s]
FENCE = re.compile(
    r"(?P<ended><!-- ctrl-c -->\n)?^```(?P<language>\w*)\n(?P<text>.*?)^```$", re.M | re.S
)
NUMBER = r"[-+]?\d[\d,.]*"
OWN = f"first_steps_{os.getpid()}"  # in place of `mine`, which may be a reader's


@dataclass
class Step:
    """A command of the page, or Ctrl-C in the first terminal, with what the page shows below."""

    command: str
    shown: str = ""


def steps() -> list[Step]:
    """The steps of the page."""
    found: list[Step] = []
    for block in FENCE.finditer(PAGE.read_text(encoding="utf-8")):
        text = re.sub(r"\b(bags|data|runs)/mine", rf"\1/{OWN}", block["text"])
        if block["language"] == "":
            found += [Step(line) for line in text.splitlines()]
        elif block["ended"]:
            found.append(Step("Ctrl-C", text))
        else:
            found[-1].shown = text
    return found


def label(step: Step) -> str:
    return re.sub(r"\W+", "-", step.command.partition("#")[0].removeprefix("./env "))[:40]


class Terminals:
    """A shell in the checkout, and a first terminal in which something goes on."""

    def __init__(self, log: Path) -> None:
        self.log = log
        log.touch()
        self.going_on: subprocess.Popen[bytes] | None = None
        # A make that started the tests would hand its variables to the page's own.
        inherited = {
            key: os.environ[key] for key in os.environ if not key.startswith(("MAKE", "ARGS"))
        }
        self.environment = {**inherited, "COLUMNS": "200", "PYTHONUTF8": "1"}

    def do(self, command: str) -> str:
        """Do a step to its end, unless it belongs to the first terminal; return what it prints."""
        if command == "Ctrl-C":
            return self.end()
        if "# first terminal" in command:
            return self.start(command)
        # With its own limit: what it printed until then, and the first terminal, are shown.
        limited = ["timeout", "--kill-after", "5", str(PATIENCE), "sh", "-c", command]
        done = subprocess.run(
            limited, cwd=ROOT, env=self.environment, text=True, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )  # fmt: skip
        assert done.returncode == 0, f"{done.stdout}\n{self.log.read_text()}"
        return done.stdout

    def start(self, command: str) -> str:
        with self.log.open("w") as log:
            self.going_on = subprocess.Popen(
                ["sh", "-c", f"exec {command}"], cwd=ROOT, env=self.environment, stdout=log,
                stderr=log, start_new_session=True,
            )  # fmt: skip
        return ""

    def end(self) -> str:
        """Press Ctrl-C in the first terminal: every process in it gets the signal."""
        assert self.going_on
        going_on, self.going_on = self.going_on, None
        os.killpg(going_on.pid, signal.SIGINT)
        code = going_on.wait(PATIENCE)
        assert code in (0, 130, -signal.SIGINT), self.log.read_text()
        return self.log.read_text()


@pytest.fixture(scope="module")
def terminals(ros_domain, tmp_path_factory):
    """Two terminals; what they wrote into the checkout is removed."""
    before = set((ROOT / "bags").iterdir())
    terminals = Terminals(tmp_path_factory.mktemp("first_steps") / "first_terminal.log")
    yield terminals
    if terminals.going_on:
        terminals.end()
    demos = set((ROOT / "bags").glob("closed_loop-*")) - before
    own = [path for name in ("bags", "data", "runs") for path in (ROOT / name).glob(f"{OWN}*")]
    for path in [*demos, *own]:
        shutil.rmtree(path)


@pytest.mark.timeout(PATIENCE + 20)
@pytest.mark.parametrize("step", steps(), ids=label)
def test_a_step_prints_what_the_page_shows(step, terminals):
    printed = terminals.do(step.command)
    assert missing(step.shown, printed) == [], printed
    if step.command.startswith("./env python"):  # no chance and no clock in it
        for there, here in zip(numbers(step.shown), numbers(printed), strict=True):
            assert here == pytest.approx(there, abs=0.2)


def missing(shown: str, printed: str) -> list[str]:
    """The first line of those shown that is not printed, in their order and but for numbers."""
    lines = iter(printed.splitlines())
    for line in shown.splitlines():
        if line != "..." and not any(re.fullmatch(pattern(line), one.strip()) for one in lines):
            return [line]
    return []


def pattern(line: str) -> str:
    """What matches a line with other numbers and spaces; … stands for anything."""
    parts = re.split(rf"({NUMBER}|…|\s+)", line.strip())
    gaps = {"…": ".*"}
    return "".join(
        NUMBER if re.fullmatch(NUMBER, part) else gaps.get(part) or
        (r"\s+" if part.isspace() else re.escape(part))
        for part in parts
    )  # fmt: skip


def numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(NUMBER, re.sub(r"[(),;]", " ", text))]


def test_a_line_that_is_not_printed_is_found():
    shown = "push 1 from 100 mm to the goal\n...\nreached with 3 pushes, …\n"
    printed = "push 1 from 98.5 mm to the goal\npush 2\nreached with 4 pushes, 0.6 mm\n"
    assert missing(shown, printed) == []
    assert missing(shown, printed.replace("reached", "not reached")) == ["reached with 3 pushes, …"]
    assert missing(shown, printed.replace("goal", "place")) == ["push 1 from 100 mm to the goal"]
