"""How long tests wait: for a condition, and no longer than for a hang that no loaded machine explains."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest

PATIENCE = 600.0
"""s: for whatever takes seconds on a quiet machine; at a load of ten on two cores it takes a minute or two"""
LEAVING = 60.0
"""s: for a process, a thread or a folder that is to be gone after its test"""


def came_true(condition: Callable[[], Any], patience: float = PATIENCE) -> Any:
    """Return the first true value of `condition`, or the false one at the end of all patience."""
    deadline = time.monotonic() + patience
    while not (value := condition()) and time.monotonic() < deadline:
        time.sleep(0.01)
    return value


def wait_for(condition: Callable[[], Any], patience: float = PATIENCE) -> Any:
    """Return the first true value of `condition`; fail the test if there is none."""
    if value := came_true(condition, patience):
        return value
    pytest.fail(f"{condition} did not come true in {patience:g} s")
