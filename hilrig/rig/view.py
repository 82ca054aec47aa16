"""The message of the live view, and its keys on the bus. `view_maker` makes views; `hilrig watch` shows them."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from hilrig.recording.messages.codec import Codec, definition

if TYPE_CHECKING:  # importing signals loads numba, which a watcher does not need
    from hilrig.core.signals import Array

CHANNEL, ASKING = "view", "watching"
"""Keys on the bus: for the views, and for the requests"""
WATCHER = "watcher"
"""The role of a watch process on the bus"""
GRANT_S = 1.0
"""How long views are sent after a request"""
INTERVAL_S = 0.05
"""Minimum wall time between two views"""


class View(NamedTuple):
    """A view: the fields of View.msg, which states their units; arrays (m,)."""

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
    """Return the codec of the views of a trial with this many task axes."""
    form = definition("View")
    return Codec(form, {field.name: axes for field in form.fields if field.size == 0})


def read_view(payload: bytes, axes: int) -> View:
    """Return the view in a message of a trial with this many task axes. Raises ValueError if it is not a view."""
    return View(*view_codec(axes).unpack(payload))
