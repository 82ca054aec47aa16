"""A package of another author that offers a kind."""

from __future__ import annotations

from pathlib import Path

import pytest

from hilrig.kinds import registry as plugins


def install(folder: Path, group: str, entry: str) -> None:
    """Put into `folder`, which is to be on sys.path, the metadata of a package that offers one kind."""
    (folder / "other-1.0.dist-info").mkdir()
    (folder / "other-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
    (folder / "other-1.0.dist-info" / "entry_points.txt").write_text(f"[hilrig.{group}]\n{entry}\n")


def offer(folder: Path, monkeypatch: pytest.MonkeyPatch, group: str, entry: str) -> None:
    """Install a package that offers one kind, and forget which kinds were found before, for the rest of a test."""
    install(folder, group, entry)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr(plugins, "_entry_points", plugins._entry_points.__wrapped__)
