"""The picture of a training: losses over epochs."""

from pathlib import Path

from matplotlib.figure import Figure

from sain_model.evaluation.png import write_png
from sain_model.training.training_state import History


def save_loss_curve(path: Path, history: History) -> None:
    """Write a PNG with the losses after each epoch, the weights that are kept marked."""
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    epochs = range(1, len(history.train) + 1)
    axes.plot(epochs, history.train, label="training", color="#3b6fb5")
    axes.plot(epochs, history.validation, label="validation", color="#e8762c")
    axes.plot(history.best + 1, history.best_loss, "o", color="#e8762c", label="kept")
    if history.start is not None:
        axes.axhline(history.start, color="#888888", linestyle=":", label="validation, before")
    axes.set(xlabel="epoch", ylabel="loss")
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    write_png(path, figure)
