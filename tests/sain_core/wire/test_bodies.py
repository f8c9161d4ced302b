# ruff: noqa: E501 - a case is a line
"""Bodies out of messages: the same bodies, or an error that names body and value."""

from types import SimpleNamespace as Message

import numpy as np
import pytest

from sain_core.errors import ConfigError, InvalidInputError, OutOfRangeError
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import get_shape, shape_names
from sain_core.shapes.solids import Prism
from sain_core.wire.bodies import check_unchanged, decode_bodies

PRISM = 5


def prism(corners, height=0.04):
    points = [Message(x=x, y=y) for x, y in np.float32(corners).astype(float).tolist()]
    return Message(type=PRISM, dimensions=[height], polygon=Message(points=points))


FEET = [Message(x=0.0, y=0.0, z=0.0)] * 3


def body(name="t", role="pushable", radius=0.09, parts=None, supports=FEET):
    parts = [prism(part) for part in get_shape(name).parts(radius)] if parts is None else parts
    return Message(name=name, role=role, radius=radius, parts=parts, supports=supports)


def disk(role="movable", radius=0.06):
    part = Message(type=3, dimensions=[0.04, radius], polygon=None)
    return Message(name="disk", role=role, radius=radius, parts=[part], supports=FEET)


def bodies(*found):
    return Message(bodies=list(found))


def test_shapes_of_the_library_are_found_by_name():
    names = [name for name in shape_names() if name not in ("disk", "cube")]
    for name in names:
        assert decode_bodies(bodies(body(name))) == Bodies.named([name], ["pushable"])
    assert decode_bodies(bodies(body(), disk("fixed"))) == Bodies.named(
        ["t", "disk"], ["pushable", "fixed"]
    )


def test_heights_are_those_of_the_parts():
    tall = body(parts=[prism(part, 0.12) for part in get_shape("t").parts(0.09)])
    box = Message(type=1, dimensions=[0.16, 0.16, 0.07], polygon=None)
    cube = body("cube", "movable", 0.08, parts=[box])
    found = decode_bodies(bodies(tall, disk(), cube))
    assert found == Bodies.named(["t", "disk", "cube"], found.roles, (0.12, 0.04, 0.07))
    assert decode_bodies(bodies(disk("pushable"))).heights == ()
    for height in (0.0, 1.0, float("nan")):
        wrong = body(parts=[prism(part, height) for part in get_shape("t").parts(0.09)])
        with pytest.raises(OutOfRangeError, match=r"body 0 is .* m high; allowed: .* to 0\.5 m"):
            decode_bodies(bodies(wrong))


@pytest.mark.parametrize("name", ["t", "t:flat"])
def test_what_does_not_stand_on_three_feet_lies_flat(name):
    parts = [prism(part) for part in get_shape("t").parts(0.09)]
    sent = [body(one, parts=parts, supports=FEET[:1] * 9) for one in (name, "tee_of_others")]
    found = [shape.name for shape in decode_bodies(bodies(*sent)).shapes]
    assert found == ["t:flat", "tee_of_others:flat"]


def test_a_shape_that_is_not_installed_is_made_of_its_parts():
    shape = Prism.of(
        "tee_of_others", *(tuple(map(tuple, p.tolist())) for p in get_shape("t").parts(1))
    )
    sent = body("tee_of_others", parts=[prism(part) for part in shape.parts(0.09)])
    (made,) = decode_bodies(bodies(sent)).shapes
    assert made.name == "tee_of_others"
    np.testing.assert_allclose(made.outline(0.09), get_shape("t").outline(0.09), atol=1e-6)


SQUARE = 0.06 * np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])


@pytest.mark.parametrize(
    ("message", "error", "text"),
    [
        (bodies(), InvalidInputError, "the message has 0 bodies; allowed: 1 to 32"),
        (bodies(*[disk()] * 33), InvalidInputError, "has 33 bodies"),
        (bodies(disk("pushable"), body(role="idle")), ConfigError, "role of body 1 is 'idle'"),
        (bodies(disk("fixed")), ConfigError, "no body is pushable"),
        (bodies(disk("pushable", 9.0)), OutOfRangeError, "radius of body 0 is 9.0 m"),
        (bodies(body("x", parts=[prism(SQUARE[[0, 2, 1, 3]])])), InvalidInputError, "a convex"),
        (bodies(body(parts=[prism(SQUARE * np.nan)])), InvalidInputError, "a part of [nan, nan"),
        (bodies(disk("pushable", np.nan)), OutOfRangeError, "radius of body 0 is nan m"),
        (bodies(disk("pushable", 1e-7)), OutOfRangeError, "radius of body 0 is 1e-07 m; allowed"),
        (bodies(body("mine", parts=[])), InvalidInputError, "body 0: shape 'mine' has 0 parts"),
        (bodies(body("mine", parts=[prism(SQUARE)] * 25)), InvalidInputError, "has 25 parts"),
        (bodies(body("mine", parts=[prism(SQUARE[:2])])), InvalidInputError, "has 2 corners"),
        (bodies(body("x", parts=[prism(np.tile(SQUARE, (17, 1)))])), InvalidInputError, "68 corners"),
        (bodies(body("x", parts=[prism(SQUARE[::-1])])), InvalidInputError, "counter-clockwise"),
        (
            bodies(body(parts=[prism(99 * SQUARE)])),
            InvalidInputError,
            "has a part of [5.94, 5.94, -5.94, ",
        ),
        (bodies(body(parts=[prism(SQUARE)])), InvalidInputError, "another outline than that shape"),
        (
            bodies(body("mine", parts=[prism(SQUARE + 0.05)], radius=0.06 * 2**0.5)),
            InvalidInputError,
            "body 0 ('mine') has its centroid or circumscribed circle elsewhere",
        ),
        (bodies(disk("pushable"), body("disk", parts=[prism(SQUARE)])), InvalidInputError, "body 1"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_and_named(message, error, text):
    with pytest.raises(error) as raised:
        decode_bodies(message)
    assert text in str(raised.value)


@pytest.mark.parametrize(
    ("names", "roles", "text"),
    [
        (["l", "disk"], (), "shape of body 0 changed from t to l"),
        (["t", "disk"], ("pushable", "fixed"), "role of body 1 changed from movable to fixed"),
        (["t"], (), "began with 2 bodies and has 1 now"),
    ],
)
def test_bodies_that_change_within_an_episode_are_refused(names, roles, text):
    known = Bodies.named(["t", "disk"])
    check_unchanged(known, Bodies.named(["t", "disk"]))
    with pytest.raises(InvalidInputError, match=r"within its episode|cannot") as raised:
        check_unchanged(known, Bodies.named(names, roles))
    assert text in str(raised.value)
