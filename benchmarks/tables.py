"""The benchmark's tables, as text: for the terminal and for the page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from benchmarks.measurands import PUNCTUAL, TRIALS

Document = Mapping[str, Any]


class Table(NamedTuple):
    """A table as text; the first column holds words, the others figures."""

    title: str
    columns: tuple[str, ...]
    rows: list[list[str]]


BARE = "zenoh"


def tables(found: Document) -> list[Table]:
    """Return the tables that have rows: comparisons, round trips, rates, lateness, and what was not measured."""
    listed = (_comparisons(found), *_round_trips(found), _rates(found), _lateness(found), _notes(found))
    return [table for table in listed if table.rows]


def figure(value: float) -> str:
    """Return a number with three significant digits; without decimals from 1000 on."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def spread_text(over: Document | None) -> str:
    """Return the median, with the lowest and the highest if there are several values; a dash if there are none."""
    if over is None:
        return "-"
    middle = figure(over["median"])
    if len(over["values"]) == 1:
        return middle
    return f"{middle} ({figure(over['lowest'])} to {figure(over['highest'])})"


def _comparisons(found: Document) -> Table:
    rows = [
        [item["what"], f"{spread_text(item)} {item['unit']}".strip(), limit_text(item), _verdict(item["met"])]
        for item in found["comparisons"].values()
    ]
    return Table("Comparisons", ("", "median (lowest to highest)", "wanted", "met"), rows)


def limit_text(item: Document) -> str:
    """Return a comparison's limit in words."""
    if item["low"] is not None:
        return f"at least {item['low']:g} {item['unit']}".strip()
    return "" if item["high"] is None else f"at most {item['high']:g} {item['unit']}".strip()


def _verdict(met: bool | None) -> str:
    return {True: "yes", False: "no", None: ""}[met]


def _round_trips(found: Document) -> Iterator[Table]:
    for kind, own, words in (
        ("back_to_back", "lockstep.exchange", "back to back"),
        ("paced", "realtime", "one each millisecond"),
    ):
        names = [name for name in found["measurands"] if name.endswith(f".{kind}")]
        names.sort(key=lambda name: not name.startswith(BARE))
        bare = _quantity(found, f"{BARE}.{kind}", "round_trip_p50_us")
        rows = [_round_trip(found, name, bare) for name in (own, *names) if _quantity(found, name, "round_trip_p50_us")]
        if names:
            title = f"Round trips, {words} [us]"
            yield Table(title, ("", "p50", "p99", "max", "p50, relative to bare zenoh's"), rows)


def _round_trip(found: Document, name: str, bare: Document | None) -> list[str]:
    p50, p99, largest = (_quantity(found, name, f"round_trip_{q}_us") for q in ("p50", "p99", "max"))
    over = "-" if bare is None or p50 is None else figure(p50["median"] / bare["median"])
    what = found["measurands"][name]["what"].split(": round trips")[0]
    return [what, spread_text(p50), spread_text(p99), spread_text(largest), over]


def _rates(found: Document) -> Table:
    names = [name for name in TRIALS if _quantity(found, name, "steps_per_s")]
    rows = [
        [
            found["measurands"][name]["what"],
            spread_text(_quantity(found, name, "loop_steps_per_s")),
            spread_text(_quantity(found, name, "steps_per_s")),
            spread_text(_quantity(found, name, "compute_p50_us")),
        ]
        for name in names
    ]
    return Table("Steps per second", ("", "first tick to last", "to the end of the record", "compute p50 [us]"), rows)


def _lateness(found: Document) -> Table:
    rows = []
    for name in PUNCTUAL:
        if not found["measurands"].get(name, {}).get("quantities"):
            continue
        late = "over_1ms" if name.startswith("cyclictest") else "late"
        times = [spread_text(_quantity(found, name, f"lateness_{q}_us")) for q in ("p50", "p99", "max")]
        ages = [spread_text(_quantity(found, name, f"command_age_{q}_us")) for q in ("p50", "p99")]
        rows.append([found["measurands"][name]["what"], *times, _share(found, name, late), *ages])
    columns = ("", "lateness p50", "p99", "max", "late ticks, or over 1 ms", "command age p50", "command age p99")
    return Table("Lateness at a period of 1 ms [us]", columns, rows)


def _share(found: Document, name: str, quantity: str) -> str:
    """Return how many ticks or wake-ups were late, and out of how many, over all repeats."""
    count = _quantity(found, name, quantity)
    whole = _quantity(found, name, "wakeups" if quantity == "over_1ms" else "ticks")
    if count is None or whole is None:
        return "-"
    late, ticks = sum(count["values"]), sum(whole["values"])
    return f"{late:.0f} of {ticks:.0f} ({late / ticks:.2%})"


def _notes(found: Document) -> Table:
    rows = [[name, item["note"]] for name, item in found["measurands"].items() if item["note"]]
    return Table("Not measured, or not in every repeat", ("", "why"), rows)


def _quantity(found: Document, name: str, quantity: str) -> Document | None:
    return found["measurands"].get(name, {}).get("quantities", {}).get(quantity)


def machine_lines(machine: Document) -> Sequence[str]:
    """Return the description of the machine: one line each on hardware, system and software."""
    permitted = "permitted" if machine["sched_fifo"] else "not permitted"
    return (
        f"{machine['cpu']}, {machine['cores']} cores, {machine['memory_gib']:g} GiB; "
        f"virtual machine: {machine['virtual_machine']}",
        f"Linux {machine['kernel']} (preemption: {machine['preemption']}); SCHED_FIFO {permitted}; "
        f"load average at the start {machine['load_average']:.2f}",
        f"hilrig {machine['hilrig']} ({(machine['commit'] or 'unknown commit')[:10]}), Python {machine['python']}, "
        f"zenoh {machine['zenoh']}, numba {machine['numba']}",
    )
