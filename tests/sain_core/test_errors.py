import pytest

from sain_core.errors import ErrorCode, SainError, error_from_reply, error_reply

KINDS = [one for one in SainError.__subclasses__() if one.__module__ == "sain_core.errors"]


def test_every_code_but_the_first_two_has_one_error():
    codes = sorted(kind.code for kind in KINDS)
    assert codes == sorted(set(ErrorCode) - {ErrorCode.UNKNOWN, ErrorCode.OK, ErrorCode.INTERNAL})


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_an_error_survives_the_wire(kind):
    code, message = error_reply(kind("the length is 3 m"))
    assert (code, message) == (kind.code, "the length is 3 m")
    again = error_from_reply(code, message)
    assert again.code == kind.code
    assert str(again) == message
