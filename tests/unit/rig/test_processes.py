"""How a child process is watched and ended, with children made for it."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hilrig.rig import processes
from hilrig.rig.processes import LAST_BYTES, LONGEST_LOOK_S, ChildProcess, Stopwatch, kill_all, log_of

PATIENCE_S = 60.0
SOON_S = 0.05
OBEDIENT = "import time; print('ready', flush=True); time.sleep(1000)"
STUBBORN = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); " + OBEDIENT


class Children:
    """Starts children that run a line of Python, and waits until those that print have printed."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.started = folder, list[ChildProcess]()

    def __call__(self, code: str) -> ChildProcess:
        log = self.folder / f"{len(self.started)}.log"
        with log.open("wb") as file:
            child = ChildProcess("the child", subprocess.Popen([sys.executable, "-c", code], stdout=file, stderr=file))
        self.started.append(child)
        deadline = time.monotonic() + PATIENCE_S
        while "print" in code and not log.read_text() and time.monotonic() < deadline:
            time.sleep(0.005)
        return child


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Children]:
    children = Children(tmp_path)
    yield children
    kill_all(children.started)


@pytest.fixture
def said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], list[str]]:
    """Returns what a module of this code prints when it is started as hilrig starts its own, word by word."""

    def start(code: str) -> list[str]:
        (tmp_path / "speaks.py").write_text(code)
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        child = ChildProcess.start("the child", "speaks", "orders", tmp_path / "speaks.log")
        child.end(PATIENCE_S)
        assert child.exit_code == 0, child.how_it_ended(tmp_path / "speaks.log")
        return (tmp_path / "speaks.log").read_text().split()

    return start


def test_a_child_has_no_thread_pools_whatever_the_users_environment_says(
    said: Callable[[str], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "8")
    monkeypatch.setenv("MINE", "kept")
    assert said("import os; print(os.environ['OMP_NUM_THREADS'], os.environ['MINE'])") == ["1", "kept"]


def test_a_child_is_out_of_reach_of_the_terminals_ctrl_c(said: Callable[[str], list[str]]) -> None:
    session, process = said("import os; print(os.getsid(0), os.getpid())")
    assert session == process


def test_a_file_in_the_working_directory_does_not_shadow_a_package(
    said: Callable[[str], list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "colorsys.py").write_text("raise SystemExit('shadowed')")
    monkeypatch.chdir(tmp_path / "here")
    assert said("import colorsys, sys; print(colorsys.ONE_THIRD < 1, sys.argv[1])") == ["True", "orders"]


@pytest.mark.parametrize(
    ("code", "how"),
    [
        ("pass", "the child ended with exit code 0"),
        ("raise SystemExit(3)", "the child ended with exit code 3"),
        ("import os; os.kill(os.getpid(), 11)", "the child was killed by SIGSEGV"),
        ("import os; os.kill(os.getpid(), 40)", "the child was killed by signal 40"),
    ],
)
def test_how_a_process_ended_is_told(run: Children, code: str, how: str) -> None:
    child = run(code)
    assert child.wait(PATIENCE_S)
    assert child.how_it_ended() == how
    assert child.failed is not how.endswith("exit code 0")


def test_a_process_that_runs_is_said_to_run(run: Children) -> None:
    child = run(OBEDIENT)
    assert not child.wait(SOON_S)
    assert (child.exit_code, child.failed) == (None, False)
    assert child.how_it_ended() == "the child is still running"


@pytest.mark.parametrize(
    ("said", "last"),
    [
        (b"", ""),
        (b" \n\n", ""),
        (b"first\n  last words \n\n", ": last words"),
        (b"caf\xe9\n", ": caf\ufffd"),
        (b"x" * 2 * LAST_BYTES + b"\nlast words", ": last words"),
    ],
)
def test_its_last_words_are_the_last_line_of_its_log(run: Children, tmp_path: Path, said: bytes, last: str) -> None:
    child, log = run("pass"), log_of(tmp_path, "driver")
    assert child.wait(PATIENCE_S)
    assert child.how_it_ended(log) == "the child ended with exit code 0", "there is no log"
    log.parent.mkdir()
    log.write_bytes(said)
    assert child.how_it_ended(log) == f"the child ended with exit code 0{last}"


@pytest.mark.parametrize(
    ("code", "timeouts", "exit_code"),
    [
        ("pass", (PATIENCE_S, PATIENCE_S), 0),
        (OBEDIENT, (SOON_S, PATIENCE_S), -signal.SIGTERM),
        (STUBBORN, (SOON_S, SOON_S), -signal.SIGKILL),
    ],
)
def test_a_process_is_ended_by_the_gentlest_step_that_works(
    run: Children, code: str, timeouts: tuple[float, float], exit_code: int
) -> None:
    child = run(code)
    child.end(*timeouts)
    assert child.exit_code == exit_code


def test_a_process_that_has_said_enough_is_left_alone(run: Children) -> None:
    child, looks = run(OBEDIENT), list[int]()

    def enough() -> bool:
        looks.append(len(looks))
        return len(looks) == 3

    child.end(PATIENCE_S, enough=enough)
    assert looks == [0, 1, 2]
    assert child.exit_code is None


def test_a_stopped_process_is_killed_too(run: Children) -> None:
    children = [run(STUBBORN), run(STUBBORN)]
    for child in children:
        child._process.send_signal(signal.SIGSTOP)  # pyright: ignore[reportPrivateUsage]
    kill_all(iter(children))
    assert [child.exit_code for child in children] == [-signal.SIGKILL] * 2


@given(st.lists(st.lists(st.floats(0.0, 100.0), max_size=10), min_size=1, max_size=5))
def test_a_stopwatch_counts_little_of_the_time_in_which_nobody_looked(laps: list[list[float]]) -> None:
    now = 1000.0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(processes, "time", SimpleNamespace(monotonic=lambda: now))
        watch = Stopwatch()
        for gaps in laps:
            watch.restart()
            total = 0.0
            for gap in gaps:
                now += gap
                total += gap if gap < LONGEST_LOOK_S else LONGEST_LOOK_S
                assert watch.look() == pytest.approx(total, abs=1e-6)
            now += 50.0
