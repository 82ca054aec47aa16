"""The report's section on limits: which ticks it counts, for which controller, and what it says of old recordings."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
from helpers.report_builders import make_run, signals, write_bag
from hypothesis import given
from hypothesis import strategies as st

from hilrig.report import make_report
from hilrig.report.dataset import load_run, read_channels
from hilrig.report.limits_section import limited_ticks, limits_section

BITS = st.lists(st.integers(0, 15), min_size=1, max_size=20)


def channels_of(asked: list[int], applied: dict[int, int]) -> dict[str, dict[str, np.ndarray]]:
    found = {"command": {"tick": np.arange(len(asked)), "limited": np.array(asked, np.uint64)}}
    if applied:
        found["applied"] = {"tick": np.array(list(applied)), "limited": np.array(list(applied.values()), np.uint64)}
    return found


@given(BITS, st.dictionaries(st.integers(0, 19), st.integers(1, 15), max_size=8))
def test_a_tick_counts_once_whoever_limited_its_command(asked: list[int], applied: dict[int, int]) -> None:
    counts = limited_ticks(channels_of(asked, applied))
    assert counts is not None
    ticks = [(asked[t] if t < len(asked) else 0) | applied.get(t, 0) for t in range(20)]
    assert counts == {
        "ticks": len(asked), "any": sum(bits != 0 for bits in ticks), "torque": sum(bits & 1 for bits in ticks),
        "torque rate": sum(bits // 2 % 2 for bits in ticks), "joint position": sum(bits // 4 % 2 for bits in ticks),
        "joint position rate": sum(bits // 8 for bits in ticks),
    }  # fmt: skip


def test_an_old_recording_does_not_say_what_was_limited() -> None:
    assert limited_ticks({"command": {"tick": np.arange(3)}}) is None
    assert limited_ticks({}) is None


def limited_run(tmp_path: Path) -> Path:
    """Two controllers with two repeats: "weak" is limited in a quarter of the ticks, and tripped in repeat 1."""
    run = make_run(tmp_path / "run", {"strong": 1.0, "weak": 2.0}, repeats=2, seconds=0.1, failed=("weak.quiet.1",))
    for repeat, ticks in ((0, 100), (1, 50)):
        limited = np.where(np.arange(ticks) % 4 == 0, 1, 0) | np.where(np.arange(ticks) % 8 == 0, 2, 0)
        data = {**signals(ticks, 2.0, repeat), "limited": limited}
        write_bag(run / "trials" / f"weak.quiet.{repeat}" / "bag.mcap", data)
    return run


def test_each_controller_has_its_share_over_all_its_recordings(tmp_path: Path) -> None:
    run = limited_run(tmp_path)
    data = load_run(run)
    counts = {trial.id: limited_ticks(read_channels(trial)) or {} for trial in data.trials}
    section = limits_section(data, counts)
    assert (section.known, section.limits) == (True, ["torque", "torque rate"])
    strong, weak = section.rows
    assert (strong.controller, strong.trials, strong.tripped, strong.ticks) == ("strong", 2, 0, 200)
    assert set(strong.shares.values()) == {0.0}
    assert (weak.controller, weak.trials, weak.tripped, weak.ticks) == ("weak", 2, 1, 150)
    assert weak.shares == {
        "any": 38 / 150, "torque": 38 / 150, "torque rate": 20 / 150, "joint position": 0.0, "joint position rate": 0.0,
    }  # fmt: skip


def section_of(page: Path) -> str:
    text = page.read_text(encoding="utf-8")
    return text[text.index("<h2>Limits</h2>") : text.index("<h2>Timing</h2>")]


def test_the_page_and_the_summary_show_it(tmp_path: Path) -> None:
    page = make_report(limited_run(tmp_path), tmp_path / "out")
    rows = [re.findall("<t[dh]>(.*?)</t[dh]>", row) for row in re.findall("<tr>(.*?)</tr>", section_of(page))]
    assert rows == [
        ["controller", "ticks", "any limit [%]", "torque [%]", "torque rate [%]", "tripped"],
        ["strong", "200", "0", "0", "0", "0 of 2"],
        ["weak", "150", "25.3", "25.3", "13.3", "1 of 2"],
    ]
    # Each trip with its cause, where the table says it is.
    assert 'href="#excluded"' in section_of(page)
    text = page.read_text(encoding="utf-8")
    assert re.search('id="excluded".*weak.quiet.1</td>.*force above 200 N', text, re.DOTALL)
    limits = json.loads((tmp_path / "out" / "summary.json").read_text())["limits"]
    assert [row["tripped"] for row in limits["rows"]] == [0, 1]


def test_nothing_recorded_is_said(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", {"small": 1.0}, repeats=1, seconds=0.1)
    section = limits_section(load_run(run), {})
    assert not section.known
    assert section.rows[0].shares["any"] is None
