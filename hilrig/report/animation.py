"""A short animation, and a strip for print, of the arm in contact, drawn by the driver itself."""

from __future__ import annotations

import io
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from hilrig import plugins
from hilrig.errors import HilrigError
from hilrig.report.dataset import TrialEntry, TrialSignals

SECONDS, RATE = 3.0, 15
WIDTH, HEIGHT = 400, 300
STRIP = 5
COLOURS = 96


class Animation(NamedTuple):
    """The pictures of one trial."""

    gif: bytes
    strip: bytes
    """PNG: some frames side by side"""
    caption: str


def animate(trial: TrialEntry, signals: TrialSignals) -> Animation | str:
    """Return pictures of the trial around its first change of phase, or one line that says why there are none."""
    try:
        driver: Any = plugins.restore("drivers", dict(trial.document["driver"]))
        if not hasattr(driver, "render"):
            return f"The driver {trial.document['driver']['kind']} does not draw itself: no animation."
        rows = _rows(trial, signals)
        frames = driver.render(signals.joint_position[rows], WIDTH, HEIGHT)
    except (HilrigError, ImportError) as error:
        return f"No animation: {str(error).splitlines()[0]}."
    pictures = [Image.fromarray(np.asarray(frame, dtype=np.uint8)) for frame in frames]
    start, end = (float(signals.record.time[row]) for row in (rows[0], rows[-1]))
    caption = f"{trial.controller}, condition {trial.condition}, repeat {trial.repeat}: t = {start:.1f} s to {end:.1f} s."
    return Animation(_gif(pictures), _strip(pictures), caption)


def _rows(trial: TrialEntry, signals: TrialSignals) -> np.ndarray:
    """Return the rows to draw: at `RATE` for `SECONDS`, around the second phase's beginning or from the start."""
    time, phases = signals.record.time, trial.document["phases"]
    middle = phases[1]["start"] if len(phases) > 1 else 0.0
    start = float(np.clip(middle - SECONDS / 2, time[0], max(time[0], time[-1] - SECONDS)))
    wanted = start + np.arange(int(SECONDS * RATE)) / RATE
    return np.searchsorted(time, wanted[wanted <= time[-1]])


def _gif(pictures: list[Image.Image]) -> bytes:
    """Return an endless GIF with one palette for all frames."""
    palette = pictures[0].quantize(COLOURS, dither=Image.Dither.NONE)
    frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    file = io.BytesIO()
    frames[0].save(file, "GIF", save_all=True, append_images=frames[1:], duration=1000 // RATE, loop=0, optimize=True)
    return file.getvalue()


def _strip(pictures: list[Image.Image]) -> bytes:
    """Return `STRIP` frames, evenly spaced in time, side by side."""
    picked = [pictures[int(k)] for k in np.linspace(0, len(pictures) - 1, STRIP)]
    strip = Image.new("RGB", (WIDTH * STRIP + 4 * (STRIP - 1), HEIGHT), "white")
    for k, picture in enumerate(picked):
        strip.paste(picture, (k * (WIDTH + 4), 0))
    file = io.BytesIO()
    strip.save(file, "PNG", optimize=True)
    return file.getvalue()
