"""Figures on disk, as SVG and PNG, and as what a page can hold."""

from __future__ import annotations

import base64
from pathlib import Path

import matplotlib as mpl

from hilrig.report.figures import Picture
from hilrig.report.page import Shown
from hilrig.report.style import RC

LARGEST_INLINE = 1_000_000
"""Bytes of SVG beyond which the page holds the PNG instead"""


def save(picture: Picture, condition: str, folder: Path) -> Shown:
    """Write figures/<condition>_<name>.svg and .png; return the figure for the page."""
    stem = folder / "figures" / f"{condition}_{picture.name}"
    with mpl.rc_context(RC):
        # Without a date the same run makes the same file.
        picture.figure.savefig(stem.with_suffix(".svg"), metadata={"Date": None})
        picture.figure.savefig(stem.with_suffix(".png"), dpi=200)
    vector = stem.with_suffix(".svg").read_bytes()
    if len(vector) <= LARGEST_INLINE:
        source = data_uri("image/svg+xml", vector)
    else:
        source = data_uri("image/png", stem.with_suffix(".png").read_bytes())
    return Shown(picture.name, picture.title, picture.caption, source, stem.name)


def data_uri(kind: str, content: bytes) -> str:
    """Return content that stands in the page itself."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
