"""Formats the numbers of a view, for the screen and for plain lines."""

from __future__ import annotations

from hilrig.cli.watch.history import History
from hilrig.cli.watch.planned import PlannedTrial
from hilrig.rig.view import View

SILENCE_SHOWN_AFTER = 1.5
"""s without a view after which the screen says so"""


def length(value: float) -> str:
    """Return a length, given in m, to a tenth of a millimetre."""
    return f"{value:+8.4f} m"


def force(value: float) -> str:
    """Return a force in N."""
    return f"{value:+8.2f} N"


def error(value: float, of_force: bool) -> str:
    """Return an error, given in m or N: mm or N."""
    return f"{value:+8.3f} N" if of_force else f"{value * 1e3:+8.3f} mm"


def late(trial: PlannedTrial, view: View) -> tuple[str, str]:
    """Return how many ticks were late so far, and the colour for it."""
    if not trial.realtime:
        return "none late: lockstep waits", "default"
    share = view.late / view.timed if view.timed else 0.0
    over = share > trial.late_fraction
    budget = f"{'over' if over else 'within'} the budget of {trial.late_fraction * 100:.2g} %"
    colour = "red" if over else "yellow" if view.late else "green"
    return f"{view.late} late ({share * 100:.2f} %), {budget}", colour


def lateness(trial: PlannedTrial, history: History) -> str:
    """Return the driver's largest lateness over the kept views; empty in lockstep."""
    return f"lateness up to {history.lateness * 1e6:.0f} us" if trial.realtime else ""


def pace(trial: PlannedTrial, history: History) -> str:
    """Return the speed and the remaining wall time."""
    view, speed = history.last, history.speed
    if view is None or not speed:
        return ""
    left = (trial.ticks * trial.period - view.time) / speed
    return f"{speed:.2f} x real time, {left:.0f} s left"


def state(history: History, now: float) -> str:
    """Return the text for when there is no news; empty if there is news."""
    if history.last is None:
        return "starting"
    silent = now - history.heard
    return f"no news for {silent:.0f} s" if silent > SILENCE_SHOWN_AFTER else ""
