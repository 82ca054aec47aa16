"""What an import of a module that has moved says, and whether it is true."""

from __future__ import annotations

import sys
from importlib import import_module

import pytest

import hilrig
from hilrig.core.moved_modules import PUBLIC, ROOMS, announce


def advice(module: str) -> str:
    """Return the message of an import that fails."""
    with pytest.raises(ModuleNotFoundError) as caught:
        import_module(module)
    return str(caught.value)


@pytest.mark.parametrize("old", ROOMS)
def test_a_module_is_where_it_is_said_to_be(old: str) -> None:
    said, _, _ = advice(f"hilrig.{old}").partition("` now")
    place = said.removeprefix(f"the module hilrig.{old} has moved: it is `")
    assert import_module(place).__name__ == place


@pytest.mark.parametrize("old", PUBLIC)
def test_a_name_is_in_the_package_itself(old: str) -> None:
    said, _, names = advice(f"hilrig.{old}").rstrip("`").partition("`from hilrig import ")
    assert said.startswith(f"the module hilrig.{old} has moved: ")
    assert names
    assert all(hasattr(hilrig, name) for name in names.split(", "))


def test_the_rest_of_a_dotted_path_is_kept() -> None:
    finder = next(finder for finder in sys.meta_path if finder.__module__ == announce.__module__)
    for old, now in (("controllers.pd", "kinds.controllers.pd"), ("trial.a.trial", "experiment.trial.a.trial")):
        with pytest.raises(ModuleNotFoundError, match=f"it is `hilrig.{now}` now"):
            finder.find_spec(f"hilrig.{old}")


@pytest.mark.parametrize("name", ["hilrig.nothing", "hilrig.controllers_of_mine", "json.controllers", "controllers"])
def test_of_other_modules_nothing_is_said(name: str) -> None:
    with pytest.raises(ModuleNotFoundError, match=f"^No module named '{name}'"):
        import_module(name)


def test_to_announce_twice_installs_one_finder() -> None:
    before = list(sys.meta_path)
    announce()
    assert sys.meta_path == before
