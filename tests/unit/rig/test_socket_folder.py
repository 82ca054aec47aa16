"""The sockets of the bus lie in a folder that zenoh and the kernel can name, whatever TMPDIR is."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import pytest
import zenoh

from hilrig.core.errors import RigError
from hilrig.rig import socket_folder
from hilrig.rig.bus import configuration
from hilrig.rig.socket_folder import LONGEST_SOCKET_PATH, make_socket_folder


@pytest.fixture
def other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The one place besides the temporary folder."""
    folder = tmp_path / "o"
    folder.mkdir()
    monkeypatch.setattr(socket_folder, "_other_places", lambda: [str(folder)])
    return folder


def temporary_folder(path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    os.makedirs(path, exist_ok=True)
    monkeypatch.setenv("TMPDIR", path)
    monkeypatch.setattr(tempfile, "tempdir", None)


@pytest.mark.parametrize("name", ["t", "T-m_p.1", "a@b+c~d"])
def test_the_users_temporary_folder_is_taken(
    tmp_path: Path, other: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    temporary_folder(str(tmp_path / name), monkeypatch)
    made = make_socket_folder()
    assert os.path.dirname(made) == str(tmp_path / name)
    shutil.rmtree(made)


@pytest.mark.parametrize(
    "name", ["q?x", "q#x", "a;b", "a=b", "a,b", "a b", "a:b", "a\nb", "ä", os.fsdecode(b"u\xff"), "%41", "x" * 200]
)
def test_another_place_is_taken_where_the_path_would_be_misread(
    tmp_path: Path, other: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    temporary_folder(str(tmp_path / name), monkeypatch)
    made = make_socket_folder()
    assert os.path.dirname(made) == str(other)
    shutil.rmtree(made)


@pytest.mark.parametrize("spare", [0, 1])
def test_the_longest_path_is_a_socket_still(
    tmp_path: Path, other: Path, monkeypatch: pytest.MonkeyPatch, spare: int
) -> None:
    """The bus listens where it was told to, with the longest path that is taken; one byte more is not taken."""
    left = LONGEST_SOCKET_PATH - len(f"{tmp_path}/") - socket_folder.LONGEST_NAME
    temporary_folder(str(tmp_path / ("x" * (left + 1 - spare))), monkeypatch)
    made = make_socket_folder()
    assert (os.path.dirname(made) == str(other)) == (spare == 0)
    socket = f"{made}/s.sock"
    assert spare == 0 or len(socket) == LONGEST_SOCKET_PATH
    with zenoh.open(configuration([f"unixsock-stream/{socket}"], [])):
        assert os.path.exists(socket)
    shutil.rmtree(made)


def test_where_there_is_no_place_the_message_says_of_each_why(
    tmp_path: Path, other: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary_folder(str(tmp_path / "q?x"), monkeypatch)
    other.rmdir()
    with pytest.raises(RigError) as caught:
        make_socket_folder()
    for words in (
        f"'{tmp_path}/q?x': its path",
        f"'{other}': No such file or directory",
        "set TMPDIR to a writable folder",
    ):
        assert words in str(caught.value)
