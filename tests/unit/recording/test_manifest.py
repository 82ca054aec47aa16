"""The manifest says where a run comes from, whatever the user has set for git and whatever lies in the repository."""

from __future__ import annotations

import json
import os
import subprocess
import time
from pathlib import Path

import pytest

from hilrig.recording import repository as git
from hilrig.recording.manifest import provenance
from hilrig.recording.repository import repository

NOBODY = 65534


@pytest.fixture(autouse=True)
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keep the settings of whoever runs the tests away; return the file of the settings that count."""
    for name in os.environ:
        if name.startswith("GIT_"):
            monkeypatch.delenv(name)
    path = tmp_path / "gitconfig"
    path.write_text("[user]\n\tname = n\n\temail = a@example.org\n")
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", str(path))
    monkeypatch.setenv("GIT_CONFIG_NOSYSTEM", "1")
    return path


def made(folder: Path, **files: bytes) -> Path:
    """Return a repository with one commit of these files."""
    folder.mkdir()
    run(folder, "init", "-q", ".")
    for name, content in files.items():
        (folder / name).write_bytes(content)
    run(folder, "add", "-A")
    run(folder, "commit", "-q", "--allow-empty", "-m", folder.name)
    return folder


def run(folder: Path, *arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def fake_git(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    """Put a program named git first on the path."""
    (tmp_path / "bin").mkdir()
    program = tmp_path / "bin" / "git"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")


def test_a_clean_repository(tmp_path: Path) -> None:
    folder = made(tmp_path / "a", x=b"1\n")
    commit = run(folder, "rev-parse", "HEAD")
    assert repository(folder) == {"commit": commit, "dirty": False, "diff": "", "commit_problem": None}


def test_a_change_is_in_the_diff_and_can_be_applied(tmp_path: Path) -> None:
    folder = made(tmp_path / "a", x=b"1\n")
    (folder / "x").write_text("2\n")
    (folder / "below").mkdir()
    found = repository(folder / "below")
    assert found["dirty"]
    run(folder, "checkout", "-q", "x")
    (tmp_path / "patch").write_text(found["diff"])
    run(folder, "apply", str(tmp_path / "patch"))
    assert (folder / "x").read_text() == "2\n"


def test_a_file_that_git_does_not_know_is_a_change(tmp_path: Path, settings: Path) -> None:
    folder = made(tmp_path / "a")
    (folder / "new").write_text("")
    settings.write_text("[status]\n\tshowUntrackedFiles = no\n")
    assert repository(folder)["dirty"]


@pytest.mark.parametrize(
    "name", ["GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_OBJECT_DIRECTORY", "GIT_COMMON_DIR"]
)
def test_variables_that_lead_to_another_repository_are_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """As git sets them for its hooks, for `git rebase --exec` and so on."""
    mine, other = made(tmp_path / "mine", x=b"1\n"), made(tmp_path / "other", y=b"2\n")
    expected = repository(mine)
    assert expected["commit"] == run(mine, "rev-parse", "HEAD")
    places = {
        "GIT_DIR": ".git", "GIT_WORK_TREE": ".", "GIT_INDEX_FILE": ".git/index",
        "GIT_OBJECT_DIRECTORY": ".git/objects", "GIT_COMMON_DIR": ".git",
    }  # fmt: skip
    monkeypatch.setenv(name, str(other / places[name]))
    assert repository(mine) == expected


def test_settings_of_the_user_do_not_shape_the_diff(
    tmp_path: Path, settings: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = made(tmp_path / "a", x=b"1\n")
    (folder / "x").write_text("2\n")
    (folder / "below").mkdir()
    plain = repository(folder)
    settings.write_text(
        "[diff]\n\tnoprefix = true\n\trelative = true\n\texternal = false\n\tmnemonicPrefix = true\n"
        "[color]\n\tui = always\n[core]\n\tpager = false\n"
    )
    monkeypatch.setenv("GIT_EXTERNAL_DIFF", "false")
    monkeypatch.setenv("GIT_TRACE", "1")
    assert repository(folder / "below") == plain


def test_bytes_that_are_not_utf_8_are_escaped(tmp_path: Path) -> None:
    folder = made(tmp_path / "a", notes=b"Gr\xf6\xdfe\n", picture=bytes(range(256)))
    (folder / "notes").write_bytes(b"L\xe4nge\n")
    (folder / "picture").write_bytes(bytes(reversed(range(256))))
    diff = repository(folder)["diff"]
    assert "-Gr\\xf6\\xdfe\n+L\\xe4nge\n" in diff
    assert "Binary files a/picture and b/picture differ" in diff
    assert json.loads(json.dumps(diff).encode()) == diff


def test_a_huge_diff_is_cut(tmp_path: Path) -> None:
    folder = made(tmp_path / "a", x=b"")
    (folder / "x").write_bytes(b"0123456789abcde\n" * (1 << 20))
    found = repository(folder)
    assert len(found["diff"]) <= git.LARGEST_DIFF_BYTES + 100
    assert found["diff"].endswith("[the rest of the diff is left out]\n")
    assert found["commit_problem"] is None


def test_a_slow_git_is_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_git(tmp_path, monkeypatch, "exec sleep 60")
    monkeypatch.setattr(git, "TIMEOUT_S", 0.2)
    began = time.monotonic()
    assert repository(tmp_path)["commit_problem"] == "git rev-parse took longer than 0.2 s"
    assert time.monotonic() - began < 30


def test_a_slow_diff_is_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_git(tmp_path, monkeypatch, 'case "$*" in *b/*HEAD) exec sleep 60;; *) echo 1234;; esac')
    monkeypatch.setattr(git, "TIMEOUT_S", 0.5)
    found = repository(tmp_path)
    assert (found["commit"], found["diff"]) == ("1234", None)
    assert found["commit_problem"] == "git diff failed, or took too long"


def test_without_git_the_commit_is_unknown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    found = repository(tmp_path)
    assert (found["commit"], found["dirty"], found["diff"]) == (None, None, None)
    assert found["commit_problem"] == "git: No such file or directory"


def test_outside_a_repository_the_commit_is_unknown(tmp_path: Path) -> None:
    found = provenance(tmp_path / "x.yaml")
    assert found["commit"] is None
    assert "not a git repository" in found["commit_problem"]
    assert found["host"]["cores"] >= 1
    assert "numpy" in found["versions"]


def test_a_repository_without_a_commit_has_none(tmp_path: Path) -> None:
    run(tmp_path, "init", "-q", ".")
    assert repository(tmp_path)["commit_problem"] == "Needed a single revision"


def test_settings_that_git_cannot_read_are_named(tmp_path: Path, settings: Path) -> None:
    folder = made(tmp_path / "a")
    settings.write_text("[broken")
    assert "bad config line" in repository(folder)["commit_problem"]


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a folder to somebody else")
def test_a_repository_of_somebody_else_is_named(tmp_path: Path, settings: Path) -> None:
    folder = made(tmp_path / "a")
    commit = run(folder, "rev-parse", "HEAD")
    for path in (folder, folder / ".git"):
        os.chown(path, NOBODY, NOBODY)
    assert "dubious ownership" in repository(folder)["commit_problem"]
    settings.write_text(f"[safe]\n\tdirectory = {folder}\n")
    assert repository(folder)["commit"] == commit, "the user trusts it"
