"""Policies of strangers, by their names as `tests.policies:straight`."""

from typing import ClassVar

import numpy as np

from sain_core.policy import GOAL, STATE, Observation, Policy
from sain_core.push import make_push

LONGEST = 0.15  # [m], of a push
GAP = 0.005  # [m], before the tool touches


class Straight(Policy):
    """Pushes the mid disk towards the goal of the target, as far as a push goes."""

    def select_action(self, observation: Observation) -> np.ndarray:
        bodies, goals = observation[STATE].reshape(-1, 8), observation[GOAL].reshape(-1, 5)
        way, left = goals[1, 1:3] - bodies[0, :2], goals[1, 1:3] - bodies[1, :2]
        length = min(GAP + np.hypot(*left), LONGEST)
        return make_push(np.arctan2(way[1], way[0]), 0.0, length).astype(np.float32)


class OfImages(Straight):
    """Sees the table by a camera, and pushes only if the image is no plain one."""

    features: ClassVar = {
        STATE: (16,),
        GOAL: (10,),
        "observation.images.camera_color": (720, 1280, 3),
    }

    def select_action(self, observation: Observation) -> np.ndarray:
        assert np.ptp(observation["observation.images.camera_color"]) > 50
        return super().select_action(observation)


def straight(name: str) -> Policy:
    return Straight()


def of_images(name: str) -> Policy:
    return OfImages()


def no_policy(name: str) -> str:
    return name


class Blank(Policy):
    """Has no push."""

    def select_action(self, observation: Observation) -> np.ndarray:
        return np.full(5, np.nan)


def blank(name: str) -> Policy:
    return Blank()


def of_numbers(name: str) -> Policy:
    """Return a policy whose shapes are none."""
    policy = straight(name)
    policy.features = {"observation.state": [16]}  # type: ignore[dict-item]
    return policy


LOADED: list[str] = []  # names, one for each time that a policy of these was made


class OfTwo(Straight):
    """Takes scenes of two bodies alone."""

    features: ClassVar = {STATE: (16,), GOAL: (10,)}


def of_two(name: str) -> Policy:
    LOADED.append(name)
    return OfTwo()
