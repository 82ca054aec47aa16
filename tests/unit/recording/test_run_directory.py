"""The run directory: named, whole, and found again."""

from __future__ import annotations

import json
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from hilrig.core.errors import RunDirectoryError
from hilrig.recording.bag_writer import BagWriter
from hilrig.recording.run_directory import (
    create_run,
    find_run,
    list_runs,
    read_json,
    read_outcome,
    read_trial,
    trial_directory,
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
    with pytest.raises(RunDirectoryError, match=r"it lacks experiment\.yaml, manifest\.json, trials"):
        find_run(tmp_path)
    with pytest.raises(RunDirectoryError, match="not JSON"):
        read_json(tmp_path / "plan.json")
    (tmp_path / "plan.json").write_text("{}")
    with pytest.raises(RunDirectoryError, match="damaged: it lacks experiment, trials"):
        read_trial(tmp_path, "a")
    (tmp_path / "plan.json").write_text(json.dumps({"experiment": {}, "trials": []}))
    with pytest.raises(RunDirectoryError, match="the plan has no trial 'a'"):
        read_trial(tmp_path, "a")


def test_a_trial_without_outcome_was_not_run_or_not_finished(tmp_path: Path) -> None:
    assert read_outcome(tmp_path, "a")["outcome"] == "not run"
    trial_directory(tmp_path, "a")
    assert read_outcome(tmp_path, "a")["outcome"] == "aborted"


@pytest.mark.parametrize("left", [None, 0, 4, 100])
def test_a_completed_trial_whose_bag_was_cut_is_damaged(tmp_path: Path, left: int | None) -> None:
    folder = trial_directory(tmp_path, "a")
    write_json(folder / "outcome.json", {"outcome": "completed", "reason": "", "channels": {}})
    BagWriter(folder / "bag.mcap").close()
    assert read_outcome(tmp_path, "a")["outcome"] == "completed"
    if left is None:
        (folder / "bag.mcap").unlink()
    else:
        os.truncate(folder / "bag.mcap", left)
    assert read_outcome(tmp_path, "a")["outcome"] == "damaged"


def test_runs_begun_at_the_same_moment_have_directories_of_their_own(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda _: create_run(tmp_path / "runs", "same", b"", {}), range(16)))
    assert len(set(made)) == 16


def test_a_run_that_cannot_be_made_names_the_place(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RunDirectoryError, match=r"file/.*: cannot make this directory: Not a directory"):
        create_run(tmp_path / "file", "name", b"", {})


def test_what_json_has_no_number_for_is_null(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"settled": float("inf"), "all": [float("nan"), 1.0]})
    assert json.loads((tmp_path / "a.json").read_text()) == {"settled": None, "all": [None, 1.0]}
