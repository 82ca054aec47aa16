"""The interleaved run: round after round of all measurands, so that compared quantities are close together in time."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

from benchmarks.findings import compare, document
from benchmarks.machine import describe_machine, processor_time, warnings
from benchmarks.measurands import Measurand, Sample, Settings, measurands
from benchmarks.spread import spread
from benchmarks.trials import payload_sizes
from hilrig.core.errors import RigError

FORM = 1
"""Version of the document format"""


def measure(settings: Settings, only: Sequence[str], listen: Callable[[str], None]) -> dict[str, Any]:
    """Run the benchmark; return all results as plain data.

    `listen` receives one line on each measurement before it starts.
    """
    began, clock = time.monotonic(), datetime.now(UTC).isoformat(timespec="seconds")
    machine, before = describe_machine(), processor_time()
    sizes = payload_sizes()
    listed = measurands(settings, sizes, machine["sched_fifo"], only)
    rounds, notes = run_rounds(listed, settings.repeats, listen)
    return {
        "form": FORM,
        "started": clock,
        "wall_s": round(time.monotonic() - began, 1),
        "settings": asdict(settings),
        "machine": machine,
        "warnings": list(warnings(machine["load_average"], before, processor_time())),
        "payload_bytes": sizes._asdict(),
        "measurands": {item.name: _result(item, rounds, notes.get(item.name, "")) for item in listed},
        "comparisons": compare(rounds),
    }


def run_rounds(
    listed: Sequence[Measurand], repeats: int, listen: Callable[[str], None]
) -> tuple[list[dict[str, Sample]], dict[str, str]]:
    """Return the samples of each repeat, measurand -> sample, and the reason for each measurand that lacks a sample.

    Every other round is in reverse order, so that a machine that slows down favours no measurand.
    """
    rounds: list[dict[str, Sample]] = []
    notes = {item.name: why for item in listed if (why := item.absent())}
    present = [item for item in listed if item.name not in notes]
    for repeat in range(repeats):
        samples: dict[str, Sample] = {}
        for place, item in enumerate(present[:: -1 if repeat % 2 else 1]):
            listen(f"[{repeat + 1}/{repeats}] [{place + 1}/{len(present)}] {item.name}: {item.what}")
            try:
                samples[item.name] = item.measure()
            except RigError as error:
                notes[item.name] = f"failed in repeat {repeat + 1}: {error}"
                listen(f"  {item.name} {notes[item.name]}")
        rounds.append(samples)
    return rounds, notes


def _result(item: Measurand, rounds: Sequence[Mapping[str, Sample]], note: str) -> dict[str, Any]:
    samples = [samples[item.name] for samples in rounds if item.name in samples]
    names = list(dict.fromkeys(name for sample in samples for name in sample))
    quantities = {name: document(spread([sample[name] for sample in samples if name in sample])) for name in names}
    return {"what": item.what, "note": note, "quantities": quantities}
