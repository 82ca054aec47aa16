"""What a trial of the benchmark tells, and what it puts on the bus."""

from __future__ import annotations

from benchmarks.trials import payload_sizes, quantities


def test_a_trials_quantities_leave_out_what_it_did_not_measure() -> None:
    table = {"p50": 5.0, "p99": 9.0, "p99.9": 10.0, "max": 11.0}
    timing = {"ticks": 100, "late": 3, "late_fraction": 0.03, "lateness_us": None, "round_trip_us": table}
    assert quantities({"ticks": 100, "wall_s": 0.5}, timing) == {
        "ticks": 100.0, "steps_per_s": 200.0, "late": 3.0, "late_fraction": 0.03,
        "round_trip_p50_us": 5.0, "round_trip_p99_us": 9.0, "round_trip_max_us": 11.0,
    }  # fmt: skip


def test_the_payloads_are_those_of_two_joints() -> None:
    """CDR: 4 bytes of header; number and time; a sequence is a length, padding to 8, and its float64."""

    def sequences(*lengths: int) -> int:
        return sum(8 + 8 * length for length in lengths)

    assert payload_sizes() == (4 + 16 + sequences(2, 6, 2) + 16, 4 + 16 + sequences(2, 2, 2) + 8)
