"""The picture of a training: losses over epochs."""

from pathlib import Path

from matplotlib.figure import Figure

from sain_core.drawing.figures import TEXT, new_figure, style_axes, write_png
from sain_core.drawing.palette import PALETTE
from sain_model.training.training_state import History


def draw_losses(history: History) -> Figure:
    """Draw the losses after each epoch, the weights that are kept marked."""
    figure = new_figure(6.0, 4.0)
    axes = figure.subplots()
    style_axes(axes, grid="both", xlabel="epoch", ylabel="loss, mean over transitions")
    epochs = range(1, len(history.train) + 1)
    axes.plot(epochs, history.train, label="training", color=PALETTE.physics)
    axes.plot(epochs, history.validation, label="validation", color=PALETTE.predicted)
    kept = f"kept: epoch {history.best + 1}, {history.best_loss:.4g}"
    axes.plot(history.best + 1, history.best_loss, "o", color=PALETTE.predicted, label=kept)
    if history.start is not None:
        before = "validation before the training"
        axes.axhline(history.start, color=PALETTE.floor, linestyle=":", label=before)
    figure.legend(frameon=False, loc="outside lower center", ncols=2, fontsize=TEXT)
    return figure


def save_loss_curve(path: Path, history: History) -> None:
    """Write a PNG with the losses after each epoch, the weights that are kept marked."""
    write_png(draw_losses(history), path)
