"""Errors of physics and of SAIN on bodies of any shape, as tables for each shape."""

from typing import Any

import numpy as np

from sain_core.push import pushed_bodies
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.seeding import generator
from sain_model.data.mixed import MixedDataset
from sain_model.data.shaped_physics import filter_for
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.history_errors import earlier_friction, predict_with_history
from sain_model.physics.friction import FrictionFilter
from sain_model.physics.planar import PlanarPrior

RESAMPLED = 2000
MOVED = 0.002  # [m]; bodies that moved less are left out
Rows = dict[str, np.ndarray]


def measure(
    physics: FrictionFilter | PlanarPrior, sain: SainDynamics | None, data: MixedDataset
) -> Rows:
    """Return one row for each body of each push, of physics with a filter of friction or alone."""
    pieces: list[Rows] = []
    for part in data.parts:
        assert part.bodies is not None
        count = part.disks
        if isinstance(physics, PlanarPrior):
            after = physics.with_bodies(part.bodies).step(part.state, part.action)
        else:
            told = filter_for(physics, part.bodies)
            known = earlier_friction(told, part)
            after = told.physics.step(part.state, part.action, known.mean)
        moved = np.linalg.norm((part.next_state - part.state)[..., POSITION], axis=-1)
        names = np.array([shape.name for shape in part.bodies.shapes])
        columns = {
            "shape": np.broadcast_to(names, (len(part), count)),
            "pushed": pushed_bodies(part.action)[:, None] == np.arange(count),
            "alone": np.full((len(part), count), count == 1),
            "moved": moved,
            "episode": np.broadcast_to(part.episode[:, None], (len(part), count)),
            **errors("prior", after, part.next_state),
        }
        if sain is not None:
            said = predict_with_history(sain, part)
            assert said.radius is not None
            columns |= errors("sain", said.mean, part.next_state)
            columns |= {"inside": columns["sain_mm"] <= 1e3 * said.radius, "radius": said.radius}
        pieces.append({name: values.reshape(-1) for name, values in columns.items()})
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def errors(name: str, predicted: np.ndarray, truth: np.ndarray) -> Rows:
    """Return errors of position [mm] and heading [deg], (M, N)."""
    off = np.linalg.norm((predicted - truth)[..., POSITION], axis=-1)
    turned = np.abs(wrap_angle(predicted[..., THETA] - truth[..., THETA]))
    return {f"{name}_mm": 1e3 * off, f"{name}_deg": np.degrees(turned)}


def table(rows: Rows) -> str:
    """Return a table per shape, of the pushed bodies, and of all bodies that moved."""
    lines = []
    learned = "sain_mm" in rows
    head = "| bodies | pushes | prior mm: median, mean, p95 | prior deg |"
    if learned:
        head += " SAIN mm | SAIN deg | ratio mm | ratio deg | coverage |"
    lines += [head, "| --- |" + " ---: |" * (head.count("|") - 2)]
    pushed = rows["pushed"]
    groups = {f"{name}": pushed & (rows["shape"] == name) for name in sorted(set(rows["shape"]))}
    groups |= {
        "**pushed, alone**": pushed & rows["alone"],
        "**pushed, of two**": pushed & ~rows["alone"],
        "**pushed**": pushed,
        "**not pushed, moved**": ~pushed & (rows["moved"] >= MOVED),
        "**all that moved**": rows["moved"] >= MOVED,
        "**all**": rows["moved"] >= 0.0,
    }
    for name, chosen in groups.items():
        if not chosen.any():
            continue
        cells = [name, str(int(chosen.sum()))]
        for model in ("prior", "sain") if learned else ("prior",):
            cells += [three(rows[f"{model}_mm"][chosen]), three(rows[f"{model}_deg"][chosen])]
        if learned:
            some = {name: values[chosen] for name, values in rows.items()}
            cells += [ratio(some, unit) for unit in ("mm", "deg")]
            cells.append(f"{100 * rows['inside'][chosen].mean():.0f} %")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def ratio(rows: Rows, unit: str) -> str:
    """Return SAIN's mean error over the prior's, with a bootstrap interval over episodes."""
    _, episode = np.unique(rows["episode"], return_inverse=True)
    sums = np.stack([np.bincount(episode, rows[f"{model}_{unit}"]) for model in ("sain", "prior")])
    drawn = generator(0, "bootstrap").integers(sums.shape[1], size=(RESAMPLED, sums.shape[1]))
    sain, prior = sums[:, drawn].sum(axis=-1)
    low, high = np.percentile(sain / prior, [2.5, 97.5])
    return f"{sums[0].sum() / sums[1].sum():.2f} [{low:.2f}, {high:.2f}]"


def three(values: np.ndarray) -> str:
    """Return median, mean and 95th percentile."""
    return f"{np.median(values):.2f}, {values.mean():.2f}, {np.percentile(values, 95):.2f}"


def summary(rows: Rows) -> dict[str, Any]:
    """Return the means over the pushed bodies."""
    pushed = rows["pushed"]
    return {
        name: float(values[pushed].mean())
        for name, values in rows.items()
        if name.endswith(("_mm", "_deg")) or name == "inside"
    }
