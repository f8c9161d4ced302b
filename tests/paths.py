"""Where things are in the checkout, however deep the test is that asks."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def executable(package: str, name: str) -> list[str]:
    """Return the command that starts an executable, as its entry point does."""
    call = f"import sys; from {package}.commands import {name}; sys.exit({name}())"
    return [sys.executable, "-c", call]
