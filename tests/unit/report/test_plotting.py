"""The user's settings of matplotlib neither shape nor prevent the figures, and are left as they were."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest
from helpers.report_builders import make_run

from hilrig.report.dataset import RunData, load_run, read_signals
from hilrig.report.figures import comparison_figures
from hilrig.report.panels import Drawn
from hilrig.report.saving import write_figure

USERS: dict[str, Any] = {
    "text.usetex": True, "font.family": "No Such Font", "font.size": 30, "lines.linewidth": 9, "axes.facecolor": "red",
    "savefig.bbox": "tight", "savefig.transparent": True, "svg.fonttype": "none", "figure.autolayout": True,
    "path.sketch": (1, 100, 2), "axes.unicode_minus": False, "xtick.direction": "in",
}  # fmt: skip


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunData:
    folder = tmp_path_factory.mktemp("plotting") / "run"
    return load_run(make_run(folder, {"small": 1.0, "large": 3.0}, repeats=1, seconds=0.2))


def written(run: RunData, folder: Path) -> bytes:
    """Return the bytes of the first comparison figure, drawn and saved now."""
    folder.mkdir()
    trials: dict[str, Any] = {trial.controller: (trial, read_signals(trial)) for trial in run.trials}
    write_figure(comparison_figures(Drawn(trials, run.controllers))[0].figure, folder / "a")
    return (folder / "a.svg").read_bytes() + (folder / "a.png").read_bytes()


def test_figures_are_the_same_whatever_the_user_has_set(run: RunData, tmp_path: Path) -> None:
    plain = written(run, tmp_path / "plain")
    with mpl.rc_context(USERS):
        assert written(run, tmp_path / "users") == plain
        assert mpl.rcParams["text.usetex"], "the user's settings are left as they were"
        assert mpl.rcParams["font.size"] == 30


def imported(folder: Path, code: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run code in a fresh process that begins with the import of the figures' module."""
    environment = {**os.environ, **variables}
    command = [sys.executable, "-c", f"from hilrig.report import plotting\nimport os, matplotlib\n{code}"]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


def test_no_backend_of_the_users_is_needed(tmp_path: Path) -> None:
    """Such as the one that Jupyter names for every command that a notebook starts."""
    backend = "module://not_installed.backend_inline"
    code = "plotting.Figure().savefig('a.svg'); plotting.Figure().savefig('a.png'); print(os.environ['MPLBACKEND'])"
    done = imported(tmp_path, code, MPLBACKEND=backend)
    assert done.stdout.strip() == backend, f"the variable is left as it was; {done.stderr}"
    assert (tmp_path / "a.png").exists()


def test_a_backend_that_is_there_is_the_users_still(tmp_path: Path) -> None:
    assert imported(tmp_path, "print(matplotlib.get_backend())", MPLBACKEND="svg").stdout.strip() == "svg"


def test_settings_that_matplotlib_cannot_read_are_named(tmp_path: Path) -> None:
    (tmp_path / "matplotlibrc").write_bytes(b"# \xff\n")
    done = imported(tmp_path, "")
    assert done.returncode != 0
    assert "HilrigError: matplotlib cannot read its settings" in done.stderr
    assert "matplotlibrc here or in your home folder" in done.stderr
