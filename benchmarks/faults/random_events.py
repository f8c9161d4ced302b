"""Random events for the state machine of a push: the first law of it that breaks ends this."""

from time import perf_counter

import tyro

from tests.sain_arm.random_pushes import walk


def main(events: int = 1_000_000) -> None:
    """Walk at random."""
    began = perf_counter()
    done, pushes, walks = walk(events)
    took = perf_counter() - began
    print(f"{done} events, {pushes} pushes, {walks} walks, {took:.0f} s: all laws hold")


if __name__ == "__main__":
    tyro.cli(main)
