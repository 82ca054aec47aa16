"""What `hilrig watch` shows: strip charts, the screen in little room, and which run there is to watch."""

from __future__ import annotations

import io
import json
import os
import subprocess
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from helpers.builders import trial
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from hilrig.cli.watch.finding import going_on, newest_live_run
from hilrig.cli.watch.history import History
from hilrig.cli.watch.planned import PlannedRun, planned_trial
from hilrig.cli.watch.scene import Scene
from hilrig.cli.watch.screen import Screen
from hilrig.cli.watch.showing import line
from hilrig.cli.watch.strip import nice_limit, strip
from hilrig.core.errors import RunDirectoryError
from hilrig.rig.live import FILE, IN_PROCESS, ON_BUS, Live, birth, read_live
from hilrig.rig.view import View


def dots(rows: list[str]) -> np.ndarray:
    """Return the dots of a chart of Braille patterns, (4 height, 2 width); by Unicode's numbering of the dots."""
    places = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1), (3, 0), (3, 1)]
    found = np.zeros((4 * len(rows), 2 * len(rows[0])), dtype=bool)
    for i, row in enumerate(rows):
        for j, sign in enumerate(row):
            for bit, (down, right) in enumerate(places):
                found[4 * i + down, 2 * j + right] = (ord(sign) - 0x2800) >> bit & 1
    return found


@given(values=st.lists(st.floats(-1, 1), min_size=1, max_size=60), width=st.integers(1, 50), height=st.integers(1, 5))
def test_a_chart_shows_every_value_and_leaves_the_time_before_empty(values, width, height) -> None:
    most = 60
    shown = dots(strip(np.array(values), -1.0, 1.0, width, height, most))
    rows = 4 * height - 1
    for i, value in enumerate(values):
        # The columns that stand for this value's time, by its own share of the window.
        at = most - len(values) + i
        low, high = at * 2 * width // most, -(-(at + 1) * 2 * width // most)
        nearest = [row for row in range(rows + 1) if abs((1 - value) / 2 * rows - row) <= 0.5 + 1e-9]
        assert shown[nearest, low:high].any()
    empty = (most - len(values)) * 2 * width // most
    assert not shown[:, :empty].any()
    assert shown[:, empty + 1 :].any(axis=0).all(), "a hole in the curve"


def test_a_peak_of_one_value_is_seen_among_many() -> None:
    values = np.zeros(200)
    values[77] = 1.0
    assert dots(strip(values, -1.0, 1.0, 10, 2, 200))[0].any()


def test_no_number_is_no_crash() -> None:
    assert len(strip(np.array([np.nan, np.inf, -np.inf]), -1.0, 1.0, 10, 2, 200)) == 2


@given(st.floats(1e-9, 1e9))
def test_a_scale_is_1_2_or_5_and_not_much_too_large(largest: float) -> None:
    limit = nice_limit(largest)
    assert largest <= limit * (1 + 1e-9) <= 2.5 * largest * (1 + 1e-6)
    assert f"{limit:.0e}"[0] in "125"


def scene(**changes) -> Scene:
    """Return a trial in real time, half of it done, with late ticks."""
    document = {**trial().to_document(), "clock": "realtime", "timing": {"late_fraction": 0.01}}
    planned = planned_trial(document, 2)
    run = PlannedRun(Path("runs/mine"), "mine", "Which one keeps 3.5 N?", {"other": planned, planned.id: planned})
    history = History()
    for k in range(150):
        at = np.array([0.1, 0.35])
        force, wanted = np.array([0.4, 3.4]), np.array([0.0, 3.5])
        view = View(k, k * 1e-3, k * 2e-3, k // 10, k, 80e-6, at, at, force, np.array([0.12, 0.0]), wanted,
                    np.array([0.02, 0.1 + k]), np.array([1.5, 2.5]))  # fmt: skip
        history.add(view, 50.0)
    return Scene(**{"run": run, "trial": planned, "history": history, "ended": Counter(completed=1), **changes})


def drawn(shown: Scene, width: int, height: int, now: float = 50.0) -> list[str]:
    """Return the screen's lines."""
    console = Console(file=io.StringIO(), width=width, height=height, force_terminal=True, color_system=None)
    with console.capture() as capture:
        console.print(Screen(shown, now), end="", height=height)
    return capture.get().splitlines()


@pytest.mark.parametrize("size", [(80, 24), (140, 40), (60, 12), (20, 5), (1, 1)])
@pytest.mark.parametrize("state", [{}, {"history": History()}, {"trial": None}])
def test_the_screen_keeps_to_the_terminal(size: tuple[int, int], state: dict) -> None:
    lines = drawn(scene(**state), *size)
    assert len(lines) <= size[1]
    assert max(map(len, lines)) <= size[0]


def test_the_screen_says_all_that_matters_at_80_by_24() -> None:
    text = "\n".join(drawn(scene(), 80, 24))
    for words in (
        "Which one keeps 3.5 N?", "trial 2 of 2", "mine, quiet, repeat 0", "1 completed", "tick 149 of 200",
        "0.15 of 0.2 s", "0.50 x real time", "14 late (9.40 %), over the budget of 1 %", "lateness up to 80 us",
        "phase press", "desired  +0.1200 m", "actual  +0.1000 m", "error  +20.000 mm", "force    +0.40 N",
        "auxiliary error    1.500 N", "desired    +3.50 N", "actual    +3.40 N", "position  +0.3500 m",
    ):  # fmt: skip
        assert words in text, words
    assert sum("⠀" <= sign <= "⣿" for sign in text) > 400


def test_silence_is_said() -> None:
    assert "no news for 4 s" in "\n".join(drawn(scene(), 80, 24, now=54.2))
    assert "starting" in "\n".join(drawn(scene(history=History()), 80, 24))
    assert "no news for 4 s" in line(scene(), 54.2)


def test_a_plain_line_has_the_same_numbers() -> None:
    text = line(scene(), 50.0)
    assert text.startswith("[2/2] mine.quiet.0  0.1 of 0.2 s  0.50 x real time")
    assert "14 late (9.40 %), over the budget of 1 %" in text
    assert "x error +20.000 mm, auxiliary 1.500 N" in text
    assert "\n" not in text


def test_lockstep_speaks_of_no_lateness() -> None:
    document = trial().to_document()
    text = line(scene(trial=planned_trial(document, 1)), 50.0)
    assert "none late" in text
    assert "lateness" not in text


def test_an_old_view_does_not_turn_the_clock_back() -> None:
    history = scene().history
    history.add(history.views[3], 99.0)
    assert history.last is not None
    assert (history.last.tick, history.heard) == (149, 50.0)


def run_directory(out: Path, name: str) -> Path:
    run = out / name
    (run / "trials").mkdir(parents=True)
    (run / "experiment.yaml").write_text("")
    (run / "plan.json").write_text("{}")
    manifest = {"name": "n", "question": "q", "command": "c", "clock": "lockstep", "seed": 0, "commit": "",
                "finished": "2026-11-22T08:00:00+00:00"}  # fmt: skip
    (run / "manifest.json").write_text(json.dumps(manifest))
    return run


def test_live_json_is_there_while_the_run_goes_on(tmp_path: Path) -> None:
    run = run_directory(tmp_path, "one")
    with Live(run, ON_BUS) as live:
        live.begin("a.b.0", "unixsock-stream//x/l.sock", [1], b"12345678")
        live.begin("a.b.1", "unixsock-stream//y/l.sock", [0], b"\0" * 8)
        live.end("a.b.0")
        found = read_live(run)
        assert found is not None
        assert (found.alive, found.pid, [trial.id for trial in found.trials]) == (True, os.getpid(), ["a.b.1"])
        assert found.trials[0].cores == (0,)
        assert going_on(run) == found
    assert not (run / FILE).exists()
    with pytest.raises(RunDirectoryError, match="it ended at 2026-11-22"):
        going_on(run)


def left_behind(run: Path, pid: int, born: int) -> None:
    (run / FILE).write_text(json.dumps({"pid": pid, "born": born, "transport": ON_BUS, "trials": {}}))


def test_what_a_killed_program_left_behind_is_recognised(tmp_path: Path) -> None:
    run = run_directory(tmp_path, "one")
    ended = subprocess.Popen(["true"])
    ended.wait()
    left_behind(run, ended.pid, 1)
    with pytest.raises(RunDirectoryError, match=rf"\(process {ended.pid}\) was killed"):
        going_on(run)
    # Another process has its number now.
    left_behind(run, os.getpid(), (birth(os.getpid()) or 0) - 1)
    with pytest.raises(RunDirectoryError, match="was killed"):
        going_on(run)
    with pytest.raises(RunDirectoryError, match="no run below"):
        newest_live_run(tmp_path)


def test_the_newest_run_on_the_bus_is_watched(tmp_path: Path) -> None:
    runs = [run_directory(tmp_path, name) for name in ("1", "2", "3", "4")]
    with Live(runs[0], ON_BUS), Live(runs[1], ON_BUS), Live(runs[2], IN_PROCESS):
        assert newest_live_run(tmp_path) == runs[1]
    with Live(runs[2], IN_PROCESS), pytest.raises(RunDirectoryError, match="without a bus"):
        newest_live_run(tmp_path)
    with pytest.raises(RunDirectoryError, match="--watch"):
        newest_live_run(tmp_path / "none")
