"""What is read from cyclictest's JSON."""

from __future__ import annotations

import json
import stat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.cyclictest import quantities, run_cyclictest
from benchmarks.placement import Placement
from hilrig.core.errors import RigError

# Written by cyclictest 2.4 with --histogram=6 --json; the version and the machine are left out.
RECORDED = """{
  "file_version": 1,
  "return_code": 0,
  "num_threads": 1,
  "resolution_in_ns": 0,
  "thread": {
    "0": {
      "histogram": {
        "4": 600,
        "5": 398
      },
      "cycles": 1000,
      "min": 4,
      "max": 1377,
      "avg": 5.80,
      "cpu": 0,
      "node": 0
    }
  }
}
"""
ANYWHERE = Placement(0, "other", 0)


@pytest.fixture
def cyclictest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put a shell script in cyclictest's place, and return where to write it."""
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    program = tmp_path / "cyclictest"
    program.touch()
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return program


def thread(histogram: dict[int, int], cycles: int, largest: int) -> dict[str, Any]:
    return {"histogram": {str(key): count for key, count in histogram.items()}, "cycles": cycles, "max": largest}


def test_what_is_beyond_the_histogram_counts_as_the_latest() -> None:
    assert quantities(json.loads(RECORDED)["thread"]["0"]) == {
        "wakeups": 1000.0, "over_1ms": 2.0, "over_1ms_fraction": 0.002,
        "lateness_p50_us": 4.0, "lateness_p99_us": 5.0, "lateness_max_us": 1377.0,
    }  # fmt: skip


@given(st.dictionaries(st.integers(0, 3000), st.integers(1, 50), min_size=1, max_size=20), st.integers(0, 3000))
def test_quantiles_are_those_of_the_wake_ups(histogram: dict[int, int], held: int) -> None:
    """Against each wake-up by itself; those over `held` us are beyond the histogram, all at the largest."""
    each = np.repeat(sorted(histogram), [histogram[value] for value in sorted(histogram)])
    largest = int(each[-1])
    each = np.where(each > held, largest, each)
    inside = {value: count for value, count in histogram.items() if value <= held}
    found = quantities(thread(inside, each.size, largest))
    assert found["lateness_p50_us"] == np.percentile(each, 50, method="inverted_cdf")
    assert found["lateness_p99_us"] == np.percentile(each, 99, method="inverted_cdf")
    assert found["over_1ms"] == np.count_nonzero(each >= 1000)
    assert found["wakeups"] == each.size


def test_no_wake_up_is_an_error() -> None:
    with pytest.raises(RigError, match="no wake-up"):
        quantities(thread({}, 0, 0))


def test_the_file_that_it_writes_is_read(cyclictest: Path) -> None:
    find = 'for word; do case "$word" in --json=*) out="${word#--json=}";; esac; done'
    cyclictest.write_text(f'#!/bin/sh\n{find}\ncat > "$out" <<END\n{RECORDED}END\n')
    assert run_cyclictest(ANYWHERE, 1.0, 1e-3)["lateness_max_us"] == 1377.0


@pytest.mark.parametrize(
    ("printed", "message"),
    [
        ("Unable to change scheduling policy!", "exit code 3: Unable to change scheduling policy!"),
        ("cyclictest: unrecognized option '--json=x'", "exit code 3: it has no --json; install a newer rt-tests"),
        ("", "exit code 3: it printed nothing"),
    ],
)
def test_a_failure_is_told_with_its_reason(cyclictest: Path, printed: str, message: str) -> None:
    cyclictest.write_text(f'#!/bin/sh\necho "{printed}" >&2\nexit 3\n')
    with pytest.raises(RigError, match=message):
        run_cyclictest(ANYWHERE, 1.0, 1e-3)
