"""The measurands of the benchmark, in the order of a round: compared quantities are measured close together in time."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from benchmarks.alternation import RIG, certificate_cost
from benchmarks.cyclictest import INSTALL, installed, run_cyclictest
from benchmarks.exchange import TRANSPORTS, Sizes, Transport, python_for, round_trips
from benchmarks.load import full_load
from benchmarks.placement import placement
from benchmarks.trials import TrialCall, run_trial

Sample = Mapping[str, float]
"""quantity -> value for one measurand in one repeat"""
PERIOD = 1e-3
"""s"""
GROUPS = ("bus", "lockstep", "realtime", "load", "unprivileged", "watch", "certificate")
TRIALS = ("lockstep", "lockstep.exchange", "lockstep.watched", "lockstep.alternating", "in_process")
PUNCTUAL = (
    *(f"{who}{how}" for how in ("", ".loaded", ".unprivileged") for who in ("realtime", "cyclictest")),
    "realtime.watched",
)
# The last one would let a process raise its own limits and so regain the permission.
CAPABILITIES = "-sys_nice,-ipc_lock,-sys_resource"
UNPRIVILEGED = ("setpriv", f"--bounding-set={CAPABILITIES}", f"--inh-caps={CAPABILITIES}")


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    repeats: int = 5
    lockstep: float = 20.0
    """s of trial time of a lockstep trial"""
    in_process: float = 200.0
    """s of trial time of an in-process trial, and of the trial that is stamped in every other block"""
    realtime: float = 12.0
    """s of a real-time trial, and of cyclictest next to it"""
    short: float = 8.0
    """s of the same under load, unprivileged and watched"""
    exchanges: int = 10_000
    """Round trips back to back"""
    paced: int = 2_000
    """Round trips at 1 kHz"""


QUICK = Settings(1, 4.0, 40.0, 4.0, 2.0, 2_000, 500)


@dataclass(frozen=True)
class Measurand:
    """Something that is measured once per repeat."""

    name: str
    groups: tuple[str, ...]
    what: str
    measure: Callable[[], Sample]
    absent: Callable[[], str] = str
    """Returns why it cannot be measured on this machine; "" if it can"""


def measurands(settings: Settings, sizes: Sizes, fifo: bool, only: Sequence[str] = ()) -> list[Measurand]:
    """Return the measurands whose name or group is in `only`, or all of them, in the order of a round."""
    pairs = [_pair(transport, paced, settings, sizes, fifo) for paced in (False, True) for transport in TRANSPORTS]
    first, bare_paced = pairs[0], pairs[len(TRANSPORTS)]
    others = [pair for pair in pairs if pair not in (first, bare_paced)]
    listed = [first, *_lockstep(settings), *others, bare_paced, *_realtime(settings, fifo)]
    return [item for item in listed if not only or item.name in only or set(item.groups) & set(only)]


def names() -> list[str]:
    """Return the names that `measurands` takes in `only`: the groups, then every measurand."""
    pairs = [f"{transport.name}.{how}" for transport in TRANSPORTS for how in ("back_to_back", "paced")]
    return [*GROUPS, *pairs, *TRIALS, *PUNCTUAL]


def _pair(transport: Transport, paced: bool, settings: Settings, sizes: Sizes, fifo: bool) -> Measurand:
    count, period = (settings.paced, PERIOD) if paced else (settings.exchanges, 0.0)
    name = f"{transport.name}.{'paced' if paced else 'back_to_back'}"
    bare = transport is TRANSPORTS[0]
    groups = ("bus", "lockstep") if bare and not paced else ("bus",)
    measure = partial(round_trips, transport, sizes, placement(paced, fifo), count, period)
    how = "one each millisecond" if paced else "back to back"
    return Measurand(name, groups, f"{transport.title}: round trips {how}", measure, partial(_no_python, transport))


def _no_python(transport: Transport) -> str:
    return "" if python_for(transport) else f"not installed; {transport.install}"


def _no_cyclictest() -> str:
    return "" if installed() else f"not installed; {INSTALL}"


def _no_drop() -> str:
    return "" if shutil.which("setpriv") else "not installed; apt install util-linux"


def _trial(
    name: str, groups: tuple[str, ...], what: str, call: TrialCall, absent: Callable[[], str] = str
) -> Measurand:
    return Measurand(name, groups, what, partial(run_trial, call), absent)


def _lockstep(settings: Settings) -> list[Measurand]:
    clock = ("--clock", "lockstep")
    plain = TrialCall(settings.lockstep, clock)
    return [
        _trial("lockstep", ("bus", "lockstep", "watch"), "hilrig run in lockstep, over the bus", plain),
        _trial(
            "lockstep.exchange", ("bus", "lockstep"), "hilrig run in lockstep, each command awaited",
            TrialCall(settings.lockstep, (*clock, "--set", "actuation_delay=0")),
        ),
        Measurand(
            "lockstep.alternating", ("certificate",), "hilrig run in lockstep, stamps in every other block",
            partial(certificate_cost, TrialCall(settings.in_process, clock, program=RIG)),
        ),
        _trial(
            "lockstep.watched", ("watch",), "hilrig run in lockstep, hilrig watch attached",
            TrialCall(settings.lockstep, clock, watched=True),
        ),
        _trial(
            "in_process", ("lockstep",), "hilrig run --in-process",
            TrialCall(settings.in_process, (*clock, "--in-process")),
        ),
    ]  # fmt: skip


def _realtime(settings: Settings, fifo: bool) -> list[Measurand]:
    clock, long, short = ("--clock", "realtime"), settings.realtime, settings.short
    plain = TrialCall(short, clock)
    no_fifo = "" if fifo else "no permission for SCHED_FIFO: the plain trial is the unprivileged one"
    loaded = partial(_loaded, partial(run_trial, plain))
    place, ordinary = placement(True, fifo), placement(True, False)
    return [
        _trial("realtime", ("bus", "realtime", "watch"), "hilrig run in real time", TrialCall(long, clock)),
        Measurand(
            "cyclictest", ("realtime",), "cyclictest, same period, core and priority",
            partial(run_cyclictest, place, long, PERIOD), _no_cyclictest,
        ),
        _trial(
            "realtime.watched", ("watch",), "hilrig run in real time, hilrig watch attached",
            TrialCall(short, clock, watched=True),
        ),
        Measurand("realtime.loaded", ("load",), "hilrig run in real time, full load", loaded),
        Measurand(
            "cyclictest.loaded", ("load",), "cyclictest, full load",
            partial(_loaded, partial(run_cyclictest, place, short, PERIOD)), _no_cyclictest,
        ),
        _trial(
            "realtime.unprivileged", ("unprivileged",), "hilrig run in real time without CAP_SYS_NICE",
            TrialCall(short, clock, UNPRIVILEGED), lambda: no_fifo or _no_drop(),
        ),
        Measurand(
            "cyclictest.unprivileged", ("unprivileged",), "cyclictest at normal priority",
            partial(run_cyclictest, ordinary, short, PERIOD), lambda: no_fifo or _no_cyclictest(),
        ),
    ]  # fmt: skip


def _loaded(measure: Callable[[], Sample]) -> Sample:
    with full_load():
        return measure()
