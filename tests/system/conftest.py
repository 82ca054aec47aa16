"""The program as a user runs it: the real processes over the real bus."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from helpers.counting_driver import counting_driver
from helpers.patience import PATIENCE

EXPERIMENT = """
hilrig: 1
name: {name}
question: Does the rig work?
clock: {clock}
timing: {budget}
{safety}
driver:
  kind: {driver}
  robot: {{kind: planar_2r, lengths: [0.345 m, 0.2 m], masses: [1.8 kg, 1.1 kg], gravity: [-9.81, 0]}}
  surface: {{position: 0.35 m, stiffness: 800 N/m, damping: 20 N*s/m, friction: 0.2}}
task:
  force_axes: [z]
  velocity_cutoff: 60 Hz
  impedance: {{inertia: [3, 6], damping: [30, 60], stiffness: [250, 0]}}
phases:
  - name: only
    duration: {duration} s
    position: {{kind: sine, amplitude: 0.1 m, frequency: 1 rad/s}}
    force: {{kind: hold, value: 3.5 N}}
conditions:
  noisy: [{{kind: sensor_noise, force: 0.05 N, joint: 2e-5 rad}}]
controllers:
  {controllers}
{more}
"""


PATIENT = "safety: {command_age: 10 s}"
"""A watchdog that the standstills of a busy machine do not wake"""
SAFE = "safety: {command_age: 3 s}"
"""One that hangs wake soon, and that a busy machine seldom wakes"""
ANY = "{late_fraction: 100 %, command_age_p99: 100 s}"
"""A timing budget that every trial keeps, however busy the machine is"""


@pytest.fixture(scope="session", autouse=True)
def _compiled_kernels(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Run a trial once before all others: on a new machine it compiles what their processes then load."""
    folder = tmp_path_factory.mktemp("first")
    text = EXPERIMENT.format(
        name="first",
        clock="lockstep",
        driver="two_link",
        duration=0.05,
        controllers="pd: {kind: pd}",
        more="",
        budget=ANY,
        safety=PATIENT,
    )
    (folder / "first.yaml").write_text(text)
    command = [sys.executable, "-m", "hilrig", "run", "first.yaml", "--in-process", "--no-report"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=PATIENCE)


@pytest.fixture(autouse=True)
def _patient_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the rig be as patient as the tests: on a loaded machine its processes are slow, and nothing hangs."""
    monkeypatch.setenv("HILRIG_READY_TIMEOUT", f"{PATIENCE:g}")
    monkeypatch.setenv("HILRIG_SILENCE_TIMEOUT", f"{PATIENCE:g}")


@pytest.fixture
def experiment(tmp_path: Path) -> Callable[..., Path]:
    """Write an experiment file and return its path."""

    def write(
        *, name: str = "small", clock: str = "lockstep", driver: str = "two_link", duration: float = 0.5,
        controllers: str = "pd: {kind: pd}", more: str = "", budget: str = ANY, safety: str = PATIENT,
    ) -> Path:  # fmt: skip
        path = tmp_path / f"{name}.yaml"
        path.write_text(
            EXPERIMENT.format(
                name=name,
                clock=clock,
                driver=driver,
                duration=duration,
                controllers=controllers,
                more=more,
                budget=budget,
                safety=safety,
            )
        )
        return path

    return write


@pytest.fixture
def robot(experiment: Callable[..., Path], tmp_path: Path) -> Callable[..., Path]:
    """Write an experiment on a plant that is not simulated and return its path."""

    def write(duration: float = 0.3, controllers: str = "pd: {kind: pd}", safety: str = SAFE, **steps: str) -> Path:
        off = float(steps.pop("off", "0"))
        kind = counting_driver(tmp_path, off, **steps)
        path = experiment(clock="realtime", driver=kind, duration=duration, controllers=controllers, safety=safety)
        text = path.read_text().replace(
            "  surface: {position: 0.35 m, stiffness: 800 N/m, damping: 20 N*s/m, friction: 0.2}\n", ""
        )
        path.write_text(text)
        return path

    return write


@pytest.fixture
def hilrig(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run the program in a directory of its own, with no terminal, and return what it did."""

    def call(*arguments: str | Path, timeout: float = PATIENCE) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "hilrig", *map(str, arguments)],
            cwd=tmp_path, capture_output=True, text=True, timeout=timeout, check=False,
        )  # fmt: skip

    return call


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start the program and return the process, with stdout or stderr in the files `output` and `errors` if named.

    Whatever is left of it is killed at the end.
    """
    started: list[subprocess.Popen[str]] = []

    def call(*arguments: str | Path, output: Path | None = None, errors: Path | None = None) -> subprocess.Popen[str]:
        with ExitStack() as files:
            stdout, stderr = (
                files.enter_context(file.open("w")) if file else subprocess.PIPE for file in (output, errors)
            )
            process = subprocess.Popen(
                [sys.executable, "-m", "hilrig", *map(str, arguments)],
                cwd=tmp_path, stdout=stdout, stderr=stderr, text=True,
            )  # fmt: skip
        started.append(process)
        return process

    yield call
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()
