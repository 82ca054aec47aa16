"""The message of the live view, and its keys on the bus. `view_maker` makes views, `hilrig watch` shows them."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from hilrig.core.signals import Array
from hilrig.recording.messages.codec import Codec, definition

CHANNEL, ASKING = "view", "watching"
"""Keys: of the views, and of the asking for them"""
GRANT = 1.0
"""s for which views are sent after they were asked for"""
INTERVAL = 0.05
"""s of wall time between two views, at least"""


class View(NamedTuple):
    """A view, with the fields of View.msg; arrays (m,)."""

    tick: int
    time: float
    elapsed: float
    late: int
    timed: int
    lateness: float
    position: Array
    velocity: Array
    force: Array
    reference_position: Array
    reference_force: Array
    error: Array
    auxiliary_error: Array


@cache
def view_codec(axes: int) -> Codec:
    """Return the codec of the views of a trial with so many task axes."""
    form = definition("View")
    return Codec(form, {field.name: axes for field in form.fields if field.size == 0})


def read_view(payload: bytes, axes: int) -> View:
    """Return the view in a message of a trial with so many task axes. Raises ValueError if it is none."""
    return View(*view_codec(axes).unpack(payload))
