"""The examples of the guides for plug-in authors, each written to a file of its own and run."""

from __future__ import annotations

import re
import subprocess
import sys
import textwrap
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from helpers.experiments import EXPERIMENTS
from helpers.guides import DOCS, block_with, blocks, write_files
from helpers.packages import offer
from helpers.patience import PATIENCE
from helpers.real_rig import PROJECT
from helpers.rules import broken

from hilrig.core.signals import Array
from hilrig.experiment import load
from hilrig.experiment.plan import plan
from hilrig.kinds.registry import kind_names, load_kind
from hilrig.recording.bag import read_bag
from hilrig.report.internals import memory_documents, unit_of
from hilrig.report.measuring import measure_run
from hilrig.rig.in_process import run_in_process
from hilrig.testing.records import flawed
from hilrig.testing.scenario import scenario

CONTROLLERS, DRIVERS, KINDS = DOCS / "controllers.md", DOCS / "drivers.md", DOCS / "kinds.md"
FILES = {
    "slide.py": "robots", "chirp.py": "references", "gusts.py": "disturbances", "force_excess.py": "metrics",
    "mass.py": "drivers",
}  # fmt: skip
"""The examples that are files of their own, with their groups"""
BRIDGED = {"my_robot.py", "my_arm.py"}
"""Those that tests/system/test_bridge.py runs"""
LAW = EXPERIMENTS / "my_controller.py"


def recorded(experiment: Path, overrides: Sequence[str] = ()) -> dict[str, dict[str, dict[str, Array]]]:
    """Run every trial of an experiment in this process; return each bag by the trial's id."""
    trials, folder = plan(load(experiment, overrides)), experiment.parent
    for trial in trials:
        outcome = run_in_process(folder, trial)
        assert outcome.outcome == "completed", outcome.reason
    return {trial.id: read_bag(folder / "trials" / trial.id / "bag.mcap") for trial in trials}


def kernel_version() -> str:
    """Return my_controller.py with the changes of the guide."""
    law = LAW.read_text()
    imports = re.search(r"with `(from hilrig import .*?)`", CONTROLLERS.read_text())
    assert imports is not None
    law = law[: law.index("    def step(")]
    law = law.replace("from hilrig import Law, Parameter, advance_filter, model_torque", imports[1])
    law = law.replace("        return Law(self.step, task, memory)\n", block_with(CONTROLLERS, "return Law(step"))
    return law + "\n\n" + block_with(CONTROLLERS, "@kernel")


def test_the_kernel_version_of_the_example_keeps_the_rules_and_does_the_same(tmp_path: Path) -> None:
    assert broken("controllers", kernel_version(), tmp_path) == {}
    (tmp_path / "my_controller.py").write_text(LAW.read_text())
    path = tmp_path / "both.yaml"
    path.write_text(
        (EXPERIMENTS / "my_controller.yaml").read_text().replace("pd: {kind: pd}", "kernel: {kind: ./mine.py}")
    )
    bags = recorded(path, ["phases.0.duration=0.5 s"])
    for condition in ("soft", "stiff"):
        plain, kernel = bags[f"mine.{condition}.0"], bags[f"kernel.{condition}.0"]
        for channel in ("truth", "command", "internals"):
            for name, values in plain[channel].items():
                np.testing.assert_allclose(kernel[channel][name], values, rtol=1e-9, atol=1e-9, err_msg=name)


def test_the_guide_tells_how_long_the_example_is() -> None:
    assert f"a complete one in {len(LAW.read_text().splitlines())} lines" in CONTROLLERS.read_text()


def test_the_report_reads_the_units_of_the_example() -> None:
    assert [unit_of(text) for text in memory_documents(str(LAW)).values()] == ["m", "m/s", "m s"]


def test_a_law_takes_from_the_reference_what_the_axis_is_controlled_by() -> None:
    given = scenario(2)
    state, reference = given.ticks[57]
    names = {"task": given.task, "state": state, "reference": reference, "self": type("", (), {"stiffness": 800.0})}
    exec(textwrap.dedent(block_with(CONTROLLERS, "sigma = task")), names)
    along_x = 800.0 * (reference.position[0] - state.position[0])
    np.testing.assert_allclose(names["force"], [along_x, reference.force[1]])
    assert reference.force[1] > 0


@pytest.fixture
def examples(tmp_path: Path) -> Path:
    """Return a folder with every file of the guides to drivers and to other kinds."""
    written = {*write_files(DRIVERS, tmp_path), *write_files(KINDS, tmp_path)}
    assert written == {*FILES, *BRIDGED, "mass.yaml", "own.yaml"}
    return tmp_path


@pytest.mark.parametrize("name", FILES)
def test_an_example_keeps_the_rules_of_its_group(name: str, examples: Path) -> None:
    values = {"robot": load_kind("robots", "./slide.py", examples)()} if name == "mass.py" else {}
    assert broken(FILES[name], (examples / name).read_text(), examples, **values) == {}


def test_the_driver_runs_in_its_experiment_and_presses(examples: Path) -> None:
    (bag,) = recorded(examples / "mass.yaml").values()
    assert bag["truth"]["wrench"][-1, 2] == pytest.approx(3.5, rel=0.05)


@pytest.mark.parametrize("kind", [kind for kind in kind_names("controllers") if kind != "pd"])
def test_every_controller_runs_on_the_driver_with_one_axis(kind: str, examples: Path) -> None:
    recorded(examples / "mass.yaml", [f"controllers.pd.kind={kind}", "phases.0.duration=0.1 s"])


def test_robot_reference_disturbance_and_driver_run_in_one_experiment(examples: Path) -> None:
    calm, gusts = recorded(examples / "own.yaml", ["phases.0.duration=0.5 s"]).values()
    wanted = calm["internals"]["reference_force"][:, 0]
    assert wanted[0] == pytest.approx(3.5)
    assert wanted[-1] > 4.0
    np.testing.assert_array_equal(wanted, gusts["internals"]["reference_force"][:, 0])
    assert np.ptp(gusts["truth"]["wrench"][:, 2] - calm["truth"]["wrench"][:, 2]) > 0.1


def test_the_metric_is_found_by_its_entry_point(examples: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (entries,) = tomllib.loads(blocks(KINDS, "toml")[0])["project"]["entry-points"].items()
    assert entries == ("hilrig.metrics", {"force_excess": "my_rig.force_excess"})
    (examples / "my_rig").mkdir()
    (examples / "force_excess.py").rename(examples / "my_rig" / "force_excess.py")
    offer(examples, monkeypatch, "metrics", "force_excess = my_rig.force_excess")
    assert "force_excess" in kind_names("metrics")
    (value,) = load_kind("metrics", "force_excess")().measure(flawed()).values()
    assert value > 0
    text = (examples / "own.yaml").read_text()
    (examples / "own.yaml").write_text(text + "expect:\n  - {metric: force_excess, controller: pd, below: 0.2 N}\n")
    assert load(examples / "own.yaml").expect[0].below == 0.2


def test_a_run_is_analysed_as_the_readme_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    changes = ("conditions={noisy: [{kind: sensor_noise, force: 0.05 N}]}", "phases.0.duration=1.2 s", "repeats=2")
    options = ["--in-process", "--no-report", *(word for change in changes for word in ("--set", change))]
    command = [sys.executable, "-m", "hilrig", "run", str(EXPERIMENTS / "quickstart.yaml"), *options]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=PATIENCE)
    measure_run(next((tmp_path / "runs").iterdir()))
    monkeypatch.chdir(tmp_path)
    exec(block_with(PROJECT / "README.md", "read_bag"), {})
    printed = capsys.readouterr().out
    assert re.search(r"proposed +all +\d\.\d+ +0\.0", printed)
    assert re.search(r"largest force error after 1 s: 0\.\d\d N", printed)
