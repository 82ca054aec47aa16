"""The run directory: named, whole, and found again."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hilrig.errors import RunDirectoryError
from hilrig.recording.manifest import provenance
from hilrig.recording.run_directory import (
    create_run,
    find_run,
    list_runs,
    read_json,
    read_outcome,
    read_trial,
    write_json,
)  # fmt: skip


def test_two_runs_in_one_second_get_two_directories(tmp_path: Path) -> None:
    runs = {create_run(tmp_path, "x", b"hilrig: 1\n", {"trials": []}) for _ in range(3)}
    assert len(runs) == 3
    assert set(list_runs(tmp_path)) == set()  # a run without a manifest has not begun
    for run in runs:
        write_json(run / "manifest.json", {})
        assert (run / "experiment.yaml").read_bytes() == b"hilrig: 1\n"
        assert find_run(run) == run
    assert set(list_runs(tmp_path)) == runs


def test_a_json_file_is_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    write_json(path, {"a": 1})
    with pytest.raises(TypeError):
        write_json(path, {"a": object()})
    assert read_json(path) == {"a": 1}
    assert [item.name for item in tmp_path.iterdir()] == ["a.json"]


def test_what_is_no_run_is_refused_with_what_it_lacks(tmp_path: Path) -> None:
    with pytest.raises(RunDirectoryError, match="there is no such directory"):
        find_run(tmp_path / "none")
    (tmp_path / "plan.json").write_text("{")
    with pytest.raises(RunDirectoryError, match=r"it has no experiment\.yaml, manifest\.json, trials"):
        find_run(tmp_path)
    with pytest.raises(RunDirectoryError, match="not JSON"):
        read_json(tmp_path / "plan.json")
    (tmp_path / "plan.json").write_text(json.dumps({"trials": []}))
    with pytest.raises(RunDirectoryError, match="its plan has no trial 'a'"):
        read_trial(tmp_path, "a")


def test_a_trial_without_outcome_was_never_finished(tmp_path: Path) -> None:
    assert read_outcome(tmp_path, "a")["outcome"] == "aborted"


def test_provenance_outside_a_repository_has_no_commit(tmp_path: Path) -> None:
    found = provenance(tmp_path / "x.yaml")
    assert found["commit"] is None
    assert found["host"]["cores"] >= 1
    assert "numpy" in found["versions"]
