"""Errors of physics and of SAIN on bodies of any shape, as Markdown for each shape."""

import numpy as np

from sain_model.evaluation.shape_errors import Rows, body_groups, figures, shape_groups


def table(rows: Rows) -> str:
    """Return a table per shape, of the pushed bodies, and of all bodies that moved."""
    lines = []
    learned = "sain_mm" in rows
    head = "| bodies | pushes | prior mm: median, mean, p95 | prior deg |"
    if learned:
        head += " SAIN mm | SAIN deg | ratio mm | ratio deg | coverage |"
    lines += [head, "| --- |" + " ---: |" * (head.count("|") - 2)]
    marked = {f"**{name}**": chosen for name, chosen in body_groups(rows).items()}
    groups = shape_groups(rows) | marked | {"**all**": rows["moved"] >= 0.0}
    for name, chosen in groups.items():
        if not chosen.any():
            continue
        cells = [name, str(int(chosen.sum()))]
        for model in ("prior", "sain") if learned else ("prior",):
            cells += [three(rows[f"{model}_mm"][chosen]), three(rows[f"{model}_deg"][chosen])]
        if learned:
            found = figures({name: values[chosen] for name, values in rows.items()})
            ratios = (found[f"ratio_{unit}"] for unit in ("mm", "deg"))
            cells += [f"{mean:.2f} [{low:.2f}, {high:.2f}]" for mean, low, high in ratios]
            cells.append(f"{100 * found['coverage']:.0f} %" if "coverage" in found else "")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def three(values: np.ndarray) -> str:
    """Return median, mean and 95th percentile."""
    return f"{np.median(values):.2f}, {values.mean():.2f}, {np.percentile(values, 95):.2f}"
