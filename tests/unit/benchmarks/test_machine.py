"""What is said about the machine, and about what else it was doing."""

from __future__ import annotations

import os
from pathlib import Path

from benchmarks.machine import ProcessorTime, describe_machine, processor_time, warnings
from benchmarks.tables import machine_lines


def test_busy_machines_are_told() -> None:
    assert warnings(0.1, ProcessorTime(0, 0), ProcessorTime(1000, 1)) == []
    (busy,) = warnings(2.5, ProcessorTime(0, 0), ProcessorTime(1000, 1))
    assert "load average 2.50" in busy
    (stolen,) = warnings(0.1, ProcessorTime(1000, 10), ProcessorTime(2000, 30))
    assert "2.0% of the processor time" in stolen


def test_processor_time_is_what_the_kernel_counts() -> None:
    def counted() -> float:
        """user nice system idle iowait irq softirq steal: guests are in user and nice already."""
        line = Path("/proc/stat").read_text().splitlines()[0]
        return sum(int(word) for word in line.split()[1:9]) / os.sysconf("SC_CLK_TCK")

    before, found, after = counted(), processor_time(), counted()
    assert before - 0.1 <= found.total <= after + 0.1
    assert 0 <= found.steal <= found.total


def test_the_machine_is_described_in_full() -> None:
    hardware, system, software = machine_lines(describe_machine())
    assert "cores" in hardware
    assert "SCHED_FIFO" in system
    assert "Python 3." in software
