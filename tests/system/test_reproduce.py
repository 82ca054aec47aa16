"""The verb that makes a whole study again."""

from __future__ import annotations

import json
from pathlib import Path

STUDY = """
hilrig: 1
title: Two laws
out: result
experiments: [small.yaml]
figures:
  - {figure: "1", title: Force, experiment: small, condition: noisy, controllers: [pd], quantity: force, axis: z}
claims:
  - claim: PD presses as asked for.
    where: here
    parts:
      - {experiment: small, condition: noisy, controller: pd, metric: force_rmse, axis: z, below: 10 N}
      - {experiment: small, condition: noisy, controller: pd, metric: force_rmse, axis: z, above: 10 mN}
"""


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_study_is_made_again_to_the_same_bytes(hilrig, experiment, tmp_path: Path) -> None:
    experiment(duration=0.05, more="repeats: 10")
    (tmp_path / "study.yaml").write_text(STUDY)
    done = hilrig("reproduce", "study.yaml")
    assert done.returncode == 0, done.stderr
    assert "reproduced      1 of 1 claims" in done.stdout
    first = files(tmp_path / "result")
    assert json.loads(first["summary.json"])["experiments"][0]["completed"] == 10

    done = hilrig("reproduce", "study.yaml", "--jobs", "2", "--out", "again")
    assert done.returncode == 0, done.stderr
    assert files(tmp_path / "again") == first

    run = sorted((tmp_path / "runs").iterdir())[0]
    done = hilrig("reproduce", "study.yaml", "--from", run, "--out", "from")
    assert done.returncode == 0, done.stderr
    assert files(tmp_path / "from") == first
    assert len(list((tmp_path / "runs").iterdir())) == 2, "a run that is given is not made again"


def test_what_is_expected_decides_the_exit_code(hilrig, experiment, tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(STUDY)
    trips = "expect: [{controller: pd, outcome: tripped}]"
    experiment(duration=0.05, more=trips, safety="safety: {tip_force: 0.01 N}")
    done = hilrig("reproduce", "study.yaml")
    assert done.returncode == 0, done.stderr
    assert "(0 of 1 trials completed, 1 tripped as expected)" in done.stdout
    assert "met             1 of 1 expectations" in done.stdout

    experiment(duration=0.05, more=trips)
    done = hilrig("reproduce", "study.yaml")
    assert done.returncode == 1
    assert "(1 of 1 trials completed)" in done.stdout
    assert "not met         small: outcome of pd: tripped, seen completed (noisy: repeat 0, " in done.stdout
