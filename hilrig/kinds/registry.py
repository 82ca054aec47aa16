"""Finding, loading, writing down and bringing back kinds: the files that plug into hilrig.

A kind is a module with one public frozen dataclass that keeps the interface of its group. It is found

- in `hilrig/kinds/<group>/<kind>.py`,
- by an entry point `<kind>` of the group `hilrig.<group>` in any installed package,
- or, given as a path such as `./my_controller.py`, in a file of the user's.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import os
import pkgutil
import sys
import traceback
import types
from collections.abc import Mapping
from functools import cache
from importlib.machinery import SourceFileLoader
from importlib.metadata import EntryPoint, entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

from hilrig.core.errors import PluginError, nearest
from hilrig.core.interfaces import Controller, Disturbance, Driver, Metric, ReferenceSignal, Robot

PROTOCOLS: dict[str, type] = {
    "controllers": Controller,
    "references": ReferenceSignal,
    "disturbances": Disturbance,
    "robots": Robot,
    "drivers": Driver,
    "metrics": Metric,
}
"""The interface that the kinds of each group keep."""

_USER_MODULE = "hilrig_user_"


def kinds(group: str) -> tuple[str, ...]:
    """Return the names of all kinds of `group`, built in or from installed packages, sorted."""
    return tuple(sorted({*_built_in(group), *_entry_points(group)}))


def load(group: str, kind: str, base: Path | None = None) -> type:
    """Return the class of a kind.

    `kind` is a name of `kinds(group)` or the path of a Python file; `base` is the folder a relative path
    starts from (the experiment's). Raises PluginError if there is no such kind, or if it does not keep the
    interface.
    """
    if is_path(kind):
        return _from_file(group, ((base or Path.cwd()) / kind).resolve())
    return _by_name(group, kind)


def is_path(kind: str) -> bool:
    """Return whether `kind` means a user's file and not a name."""
    return kind.endswith(".py") or "/" in kind


def name_of(cls: type) -> tuple[str, str]:
    """Return (group, kind) of a kind's class. Raises PluginError for a class that is none."""
    parts = cls.__module__.split(".")
    if len(parts) == 4 and parts[:2] == ["hilrig", "kinds"] and parts[2] in PROTOCOLS:
        return parts[2], parts[3]
    if parts[0].startswith(_USER_MODULE):
        return sys.modules[cls.__module__].__dict__["__hilrig_group__"], str(sys.modules[cls.__module__].__file__)
    for group in PROTOCOLS:
        for name, entry in _entry_points(group).items():
            if entry.module == cls.__module__:
                return group, name
    raise PluginError(f"{cls.__module__}.{cls.__qualname__} is not a kind that hilrig can find again by name")


def group_of(annotation: Any) -> str | None:
    """Return the group whose kinds a field so annotated holds, or None if it holds something else."""
    for group, protocol in PROTOCOLS.items():
        if annotation is protocol:
            return group
    parts = getattr(annotation, "__module__", "").split(".")
    return parts[2] if len(parts) == 4 and parts[:2] == ["hilrig", "kinds"] and parts[2] in PROTOCOLS else None


def dump(value: Any) -> Any:
    """Return `value`, a kind with its parameters, as data for JSON: {"kind": ..., field: SI value}.

    Nested dataclasses and kinds are written the same way; tuples become lists. Exact: floats are kept as they
    are.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: dump(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return {"kind": name_of(type(value))[1], **fields} if _is_kind(type(value)) else fields
    if isinstance(value, Mapping):
        return {str(key): dump(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [dump(item) for item in value]
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise PluginError(f"a parameter of type {type(value).__name__} cannot be written down")


def restore(group: str, document: dict[str, Any]) -> Any:
    """Return the object that `dump` wrote. Raises PluginError if the document does not fit the kind."""
    return _build(load(group, document["kind"]), {key: item for key, item in document.items() if key != "kind"})


def _is_kind(cls: type) -> bool:
    try:
        name_of(cls)
    except PluginError:
        return False
    return True


def _build(cls: type, document: dict[str, Any]) -> Any:
    hints = get_type_hints(cls)
    unknown = sorted(set(document) - {f.name for f in dataclasses.fields(cls)})
    if unknown:
        raise PluginError(f"{cls.__name__} has no parameter '{unknown[0]}'{nearest(unknown[0], hints)}")
    needed = [f.name for f in dataclasses.fields(cls) if f.default is f.default_factory is dataclasses.MISSING]
    if missing := [name for name in needed if name not in document]:
        raise PluginError(f"{cls.__name__} needs the parameter '{missing[0]}'")
    return cls(**{name: _revive(hints[name], item) for name, item in document.items()})


def _revive(annotation: Any, item: Any) -> Any:
    """Return `item` of a document as the type that the field is annotated with."""
    if isinstance(item, list):
        return tuple(_revive(None, part) for part in item)
    if not isinstance(item, dict):
        return item
    for choice in _choices(annotation):
        group = group_of(choice)
        if group and "kind" in item:
            return restore(group, item)
        if dataclasses.is_dataclass(choice) and isinstance(choice, type):
            return _build(choice, item)
    raise PluginError(f"a mapping stands where {annotation} is expected")


def _choices(annotation: Any) -> tuple[Any, ...]:
    return get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else (annotation,)


@cache
def _built_in(group: str) -> tuple[str, ...]:
    if group not in PROTOCOLS:
        raise PluginError(f"there is no group of kinds '{group}'{nearest(group, PROTOCOLS)}")
    try:
        package = importlib.import_module(f"hilrig.kinds.{group}")
    except ModuleNotFoundError:  # drivers come from entry points alone
        return ()
    return tuple(m.name for m in pkgutil.iter_modules(package.__path__) if not m.name.startswith("_"))


@cache
def _entry_points(group: str) -> dict[str, EntryPoint]:
    found: dict[str, EntryPoint] = {}
    for entry in entry_points(group=f"hilrig.{group}"):
        other = found.setdefault(entry.name, entry)
        if entry.name in _built_in(group):
            raise PluginError(f"{entry.value} offers a kind '{entry.name}' of {group}, which hilrig has itself")
        if other.value != entry.value:
            raise PluginError(f"two packages offer the kind '{entry.name}' of {group}: {other.value}, {entry.value}")
    return found


@cache
def _by_name(group: str, kind: str) -> type:
    entries = _entry_points(group)
    if kind in _built_in(group):
        module, attribute = f"hilrig.kinds.{group}.{kind}", ""
    elif kind in entries:
        module, attribute = entries[kind].module, entries[kind].attr
    else:
        choices = kinds(group)
        listed = ", ".join(choices) or "none installed"
        raise PluginError(f"no kind '{kind}' of {group}{nearest(kind, choices)} (known: {listed})")
    try:
        loaded = importlib.import_module(module)
    except ImportError as error:
        raise PluginError(f"the kind '{kind}' of {group} cannot be imported: {error}") from error
    return _check(group, getattr(loaded, attribute) if attribute else _only_class(loaded, module), module)


def _from_file(group: str, path: Path) -> type:
    try:
        source = path.read_bytes()
    except OSError as error:
        raise PluginError(f"{path}: cannot be read: {error.strerror}") from error
    # The name holds the contents' digest: only a file that changed is loaded anew.
    name = _USER_MODULE + hashlib.sha256(os.fsencode(f"{group}:{path}:") + source).hexdigest()[:16]
    module = sys.modules.get(name) or _execute(name, group, path)
    return _check(group, _only_class(module, str(path)), str(path))


class _FromSource(SourceFileLoader):
    """Compiles a file each time: Python's cache goes by size and whole seconds, and may hold an older file's code."""

    def get_code(self, fullname: str) -> types.CodeType:
        return self.source_to_code(self.get_data(self.path), self.path)


def _execute(name: str, group: str, path: Path) -> types.ModuleType:
    if path.suffix != ".py":
        raise PluginError(f"{path}: is not a Python file")
    spec = spec_from_file_location(name, path, loader=_FromSource(name, str(path)))
    assert spec is not None, "a loader was given"
    assert spec.loader is not None
    module = module_from_spec(spec)
    module.__dict__["__hilrig_group__"] = group
    sys.modules[name] = module  # dataclasses and numba look their module up there
    try:
        spec.loader.exec_module(module)
    except SyntaxError as error:
        del sys.modules[name]
        raise PluginError(f"{path}:{error.lineno}: {error.msg}") from error
    except Exception as error:
        del sys.modules[name]
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
        line = lines[-1] if lines else 1
        raise PluginError(f"{path}:{line}: {type(error).__name__}: {error}") from error
    return module


def _only_class(module: types.ModuleType, where: str) -> type:
    """Return the one public dataclass that `module` defines itself."""
    found = [
        item
        for name, item in vars(module).items()
        if isinstance(item, type) and dataclasses.is_dataclass(item)
        and item.__module__ == module.__name__ and not name.startswith("_")
    ]  # fmt: skip
    if len(found) != 1:
        names = ", ".join(item.__name__ for item in found) or "none"
        raise PluginError(f"{where}: a kind's file defines exactly one public dataclass; found {names}")
    return found[0]


def _check(group: str, cls: type, where: str) -> type:
    """Return `cls` if it is frozen and offers all that the group's protocol asks for."""
    if not dataclasses.is_dataclass(cls) or not cls.__dataclass_params__.frozen:  # pyright: ignore
        raise PluginError(f"{where}: {cls.__name__} is not a frozen dataclass")
    fields = {f.name for f in dataclasses.fields(cls)}
    protocol = PROTOCOLS[group]
    wanted = [name for name in {**vars(protocol), **protocol.__annotations__} if not name.startswith("_")]
    missing = [name for name in wanted if name not in fields and not hasattr(cls, name)]
    if missing:
        raise PluginError(f"{where}: {cls.__name__} lacks {', '.join(missing)}, which {group} must offer")
    return cls
