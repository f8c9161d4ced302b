"""The commands of a block of code, as a shell would start them: loops and braces are expanded."""

import subprocess
from pathlib import Path

from tests.paths import ROOT
from tools.site.notes import CodeBlock, code_blocks, holds_commands
from tools.site.places import REPOSITORY_PAGES

SCRIPTS = ("./env",)
PRELUDE = """
PATH=/nonexistent
record() {{ printf '%s\\0' "$@" >&3; printf '\\1\\0' >&3; }}
command_not_found_handle() {{ record "$@"; }}
{functions}
"""
FUNCTIONS = "\n".join(f'function {name} {{ record {name} "$@"; }}' for name in SCRIPTS)
ELSEWHERE = [ROOT / path for path in ("README.md", *REPOSITORY_PAGES)]
PAGES = sorted([*ELSEWHERE, *(ROOT / "docs").rglob("*.md")])


def page_name(page: Path) -> str:
    """The path of a page in the repository."""
    return str(page.relative_to(ROOT))


def command_blocks(page: Path) -> list[CodeBlock]:
    """The blocks of a page that hold commands; the others show output, Python or formulas."""
    blocks = code_blocks(page.read_text(encoding="utf-8"))
    return [
        block for block in blocks if block.language in ("", "sh") and holds_commands(block.code)
    ]


def commands_in(code: str, folder: Path) -> list[list[str]]:
    """The words of each command of a block; nothing of it is started."""
    read = "exec 3>started\n" + PRELUDE.format(functions=FUNCTIONS) + code
    done = subprocess.run(
        ["/bin/bash", "-c", read], cwd=folder, capture_output=True, text=True, timeout=20
    )
    assert done.stderr == "", f"{done.stderr} in\n{code}"
    words = (folder / "started").read_text(encoding="utf-8").split("\0")
    commands: list[list[str]] = [[]]
    for word in words[:-1]:
        if word == "\1":
            commands.append([])
        else:
            commands[-1].append(word)
    return commands[:-1]
