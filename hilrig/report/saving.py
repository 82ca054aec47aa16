"""Saves figures as SVG and PNG, and prepares them for embedding in a page."""

from __future__ import annotations

import base64
from pathlib import Path

from hilrig.report.page import Shown
from hilrig.report.panels import PanelPicture
from hilrig.report.plotting import Figure, figure_style

LARGEST_INLINE = 1_000_000
"""Bytes of SVG beyond which the page holds the PNG instead"""


def save(picture: PanelPicture, condition: str, folder: Path) -> Shown:
    """Write figures/<condition>_<name>.svg and .png; return the figure for the page."""
    stem = folder / "figures" / f"{condition}_{picture.name}"
    return Shown(picture.name, picture.title, picture.caption, write_figure(picture.figure, stem), stem.name)


def write_figure(figure: Figure, stem: Path) -> str:
    """Write a figure as `stem`.svg and .png; return the image for the page: the SVG, or the PNG if the SVG is too
    large.

    The files have no dates or versions, so the same data give the same bytes.
    """
    with figure_style():
        figure.savefig(stem.with_suffix(".svg"), metadata={"Date": None, "Creator": None})
        figure.savefig(stem.with_suffix(".png"), dpi=200, metadata={"Software": None})
    vector = stem.with_suffix(".svg").read_bytes()
    if len(vector) <= LARGEST_INLINE:
        return data_uri("image/svg+xml", vector)
    return data_uri("image/png", stem.with_suffix(".png").read_bytes())


def data_uri(kind: str, content: bytes) -> str:
    """Return content as a data URI for embedding in the page."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
