"""A short animation of the arm, and a strip of pictures for print, drawn by the driver."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from hilrig.core.errors import HilrigError
from hilrig.core.signals import Array
from hilrig.kinds import registry as plugins
from hilrig.report.dataset import TrialEntry
from hilrig.report.page import Shown
from hilrig.report.saving import data_uri

SECONDS, RATE = 3.0, 15
WIDTH, HEIGHT = 400, 300
STRIP = 5
SCENE_COLOURS = 96


def animation(scene: tuple[TrialEntry, Array] | None, folder: Path) -> Shown:
    """Write figures/animation.gif and animation_strip.png of a trial and its joint positions (N, n) rad.

    If there is no animation, the returned picture has no source, and its caption says why.
    """
    if scene is None:
        return _none("No animation: no trial completed.")
    trial, joints = scene
    kind = trial.document["driver"]["kind"]
    try:
        if not hasattr(plugins.load_kind("drivers", kind), "render"):
            return _none(f"No animation: the driver {kind} cannot draw its robot.")
        driver: Any = plugins.restore("drivers", dict(trial.document["driver"]))
        rows = _rows(trial, joints.shape[0])
        frames = driver.render(joints[rows], WIDTH, HEIGHT)
    except (HilrigError, ImportError) as error:
        return _none(f"No animation: {str(error).splitlines()[0]}.")
    pictures = [Image.fromarray(np.ascontiguousarray(frame, dtype=np.uint8)) for frame in frames]
    gif = _gif(pictures)
    (folder / "figures" / "animation.gif").write_bytes(gif)
    (folder / "figures" / "animation_strip.png").write_bytes(_strip(pictures))
    start, end = rows[0] * trial.document["period"], rows[-1] * trial.document["period"]
    caption = f"{trial.controller}, condition {trial.condition}, repeat {trial.repeat}, {start:.1f} s to {end:.1f} s."
    return Shown("animation", "The arm at work", caption, data_uri("image/gif", gif), "animation")


def _none(reason: str) -> Shown:
    return Shown("animation", "", reason, "", "")


def _rows(trial: TrialEntry, ticks: int) -> np.ndarray:
    """Return the ticks to draw: at `RATE` for `SECONDS`, around the start of the second phase, or from the start."""
    period, phases = trial.document["period"], trial.document["phases"]
    middle = phases[1]["start"] if len(phases) > 1 else 0.0
    start = np.clip(middle - SECONDS / 2, 0.0, max(0.0, (ticks - 1) * period - SECONDS))
    rows = np.round((start + np.arange(int(SECONDS * RATE)) / RATE) / period).astype(int)
    return rows[rows < ticks]


def _gif(pictures: list[Image.Image]) -> bytes:
    """Return a looping GIF with one palette for all frames."""
    palette = pictures[0].quantize(SCENE_COLOURS, dither=Image.Dither.NONE)
    frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    file = io.BytesIO()
    frames[0].save(file, "GIF", save_all=True, append_images=frames[1:], duration=1000 // RATE, loop=0)
    return file.getvalue()


def _strip(pictures: list[Image.Image]) -> bytes:
    """Return a PNG of `STRIP` frames side by side, evenly spaced in time."""
    picked = [pictures[int(k)] for k in np.linspace(0, len(pictures) - 1, STRIP)]
    strip = Image.new("RGB", (WIDTH * STRIP + 4 * (STRIP - 1), HEIGHT), "white")
    for k, picture in enumerate(picked):
        strip.paste(picture, (k * (WIDTH + 4), 0))
    file = io.BytesIO()
    strip.save(file, "PNG", optimize=True)
    return file.getvalue()
