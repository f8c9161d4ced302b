"""The codes that a reader of `ros2 interface show` finds are those that the code sends."""

import re

import pytest

from sain_core.errors import ErrorCode
from tests.paths import ROOT

INTERFACES = ROOT / "src" / "sain_interfaces"
DEFINITIONS = sorted(
    path for kind in ("msg", "srv", "action") for path in INTERFACES.glob(f"{kind}/*.{kind}")
)
CARRIERS = [path for path in DEFINITIONS if re.search(r"^\w+ error_code\b", path.read_text(), re.M)]


def test_the_constants_are_those_of_the_code():
    text = (INTERFACES / "msg" / "ErrorCodes.msg").read_text()
    written = {name: int(value) for name, value in re.findall(r"^uint16 (\w+) = (\d+)", text, re.M)}
    assert written == {code.name: code.value for code in ErrorCode}


def test_the_messages_that_carry_a_code_are_known():
    assert {path.stem for path in CARRIERS} == {
        "DescribeModel", "LoadModel", "Plan", "PredictResidual", "Prediction", "PushResult",
        "Reach", "ResetScene", "Rollout",
    }  # fmt: skip


@pytest.mark.parametrize("path", CARRIERS, ids=lambda path: path.stem)
def test_each_field_has_the_width_of_the_constants_and_names_them(path):
    for line in re.findall(r"^\w+ error_code\b.*$", path.read_text(), re.M):
        assert re.match(r"uint16 error_code +# of ErrorCodes\.msg: 1 is OK", line), line
