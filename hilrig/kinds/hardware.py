"""What a driver whose plant is not simulated must offer: found without connecting to the plant."""

from __future__ import annotations

import inspect
from typing import Any, get_type_hints

from hilrig.core.interfaces import Driver

REQUIRED = ("measure", "advance", "holding_command", "truth", "hold", "close")
STAGES = ("prepare", "approach", "retract")


def lacks(driver: Driver) -> list[str]:
    """Return what a driver of hardware lacks, one sentence each; empty for a simulated plant.

    Nothing is called, so the class of the plant must be known: by the annotation of what `connect` returns.
    """
    capabilities = driver.capabilities
    if capabilities.simulated:
        return []
    found: list[str] = []
    if set(capabilities.clocks) != {"realtime"}:
        found.append(f"its clocks are {capabilities.clocks!r}: a plant that is not simulated does not wait, so they "
                     "must be ('realtime',)")  # fmt: skip
    if not capabilities.stop_time > 0:
        found.append("its stop_time is 0 s: say how long `hold` and `close` may take together, so that nothing "
                     "interrupts them before")  # fmt: skip
    plant = _plant_of(driver)
    if plant is None:
        found.append("its `connect` does not say what it returns, so nobody can see what the plant lacks before it is "
                     "connected: write `def connect(self, start) -> MyPlant:`")  # fmt: skip
        return found
    missing = [f"`{name}`" for name in REQUIRED if not callable(getattr(plant, name, None))]
    if missing:
        found.append(f"its plant, {plant.__name__}, has no {', '.join(missing)}")
    for name in STAGES:
        offered = getattr(plant, name, None)
        if offered is not None and not inspect.isgeneratorfunction(offered):
            found.append(f"`{name}` of its plant, {plant.__name__}, is no generator: it must yield a Progress once per "
                         "period, and not block")  # fmt: skip
    return found


def _plant_of(driver: Driver) -> type[Any] | None:
    """Return the class that `connect` says it returns; None if it does not say, or names only the interface."""
    try:
        told = get_type_hints(driver.connect).get("return")
    except Exception:  # the annotation is a user's code
        return None
    return told if isinstance(told, type) and not getattr(told, "_is_protocol", False) else None
