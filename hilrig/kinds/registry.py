"""Finding, loading, dumping and restoring kinds: the files that plug into hilrig.

A kind is a module with one public frozen dataclass that provides the interface of its group. It is found

- in `hilrig/kinds/<group>/<kind>.py`,
- by an entry point `<kind>` of the group `hilrig.<group>` in any installed package,
- or, given as a path such as `./my_controller.py`, in a user's file.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import math
import os
import pkgutil
import sys
import types
from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from hilrig.core.errors import PluginError, describe_error, nearest
from hilrig.core.interfaces import Controller, Disturbance, Driver, Metric, ReferenceSignal, Robot
from hilrig.core.parameters import plain
from hilrig.kinds.user_files import code_of, place_of, read_bytes, run_file

PROTOCOLS: dict[str, type] = {
    "controllers": Controller,
    "references": ReferenceSignal,
    "disturbances": Disturbance,
    "robots": Robot,
    "drivers": Driver,
    "metrics": Metric,
}
"""The interface that the kinds of each group provide."""

_USER_MODULE = "hilrig_user_"
_MISSING = dataclasses.MISSING


def kind_names(group: str) -> tuple[str, ...]:
    """Return the names of all kinds of `group`, built-in or from installed packages, sorted."""
    return tuple(sorted({*_built_in(group), *_entry_points(group)}))


def load_kind(group: str, kind: str, base: Path | None = None) -> type:
    """Return the class of a kind.

    `kind` is one of `kind_names(group)` or the path of a Python file; `base` is the folder that relative paths start
    from (the experiment's). Raises PluginError if there is no such kind, or if it does not provide the interface.
    """
    if "\0" in kind:
        raise PluginError(f"{kind!r} is neither a name nor a path")
    if is_path(kind):
        return _from_file(group, ((base or Path.cwd()) / kind).resolve())
    return _by_name(group, kind)


def load_kinds(group: str) -> tuple[dict[str, type], dict[str, str]]:
    """Return the classes of all kinds of `group` that can be loaded, by name, and why the others cannot."""
    found: dict[str, type] = {}
    failed: dict[str, str] = {}
    for kind in kind_names(group):
        try:
            found[kind] = load_kind(group, kind)
        except PluginError as error:
            failed[kind] = str(error)
    return found, failed


def is_path(kind: str) -> bool:
    """Return whether `kind` is the path of a user's file, not a name."""
    return kind.endswith(".py") or "/" in kind


def name_of(cls: type) -> tuple[str, str]:
    """Return (group, kind) of a kind's class. Raises PluginError for a class that is not a kind."""
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
    """Return the group whose kinds a field with this annotation holds, or None if it holds something else."""
    for group, protocol in PROTOCOLS.items():
        if annotation is protocol:
            return group
    parts = getattr(annotation, "__module__", "").split(".")
    return parts[2] if len(parts) == 4 and parts[:2] == ["hilrig", "kinds"] and parts[2] in PROTOCOLS else None


def dump(value: Any, name: str = "") -> Any:
    """Return `value`, a kind with its parameters, as data for JSON: {"kind": ..., field: SI value}.

    Nested dataclasses and kinds are written the same way; tuples become lists. Exact: floats are not rounded, and an
    infinity, which JSON does not have, becomes the string "inf" or "-inf". Raises PluginError, naming the parameter
    `name`, for a value that cannot be written.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: dump(getattr(value, f.name), f.name) for f in dataclasses.fields(value) if f.init}
        return {"kind": name_of(type(value))[1], **fields} if _is_kind(type(value)) else fields
    if isinstance(value, Mapping):
        return {str(key): dump(item, name) for key, item in value.items()}
    if isinstance(value, (np.generic, np.ndarray)):
        value = plain(value)
    if isinstance(value, (tuple, list)):
        return [dump(item, name) for item in value]
    if isinstance(value, float) and math.isnan(value):
        raise PluginError(f"the parameter '{name}' is NaN; where there is no value, use None")
    if isinstance(value, float) and math.isinf(value):
        return str(value)
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise PluginError(f"the parameter '{name}' is a {type(value).__name__}, which cannot be written to a file")


def restore(group: str, document: Mapping[str, Any]) -> Any:
    """Return the object that `dump` wrote. Raises PluginError if the document does not fit the kind."""
    kind = document.get("kind")
    if not isinstance(kind, str):
        raise PluginError(f"a record of one of the {group} does not name its kind")
    return _build(load_kind(group, kind), {key: item for key, item in document.items() if key != "kind"})


def _is_kind(cls: type) -> bool:
    """Return whether a dataclass is a kind, not a part of one defined in the same file."""
    try:
        name_of(cls)
    except PluginError:
        return False
    return not cls.__name__.startswith("_")


def _build(cls: type, document: dict[str, Any]) -> Any:
    hints = get_type_hints(cls)
    unknown = sorted(set(document) - {f.name for f in dataclasses.fields(cls)})
    if unknown:
        raise PluginError(f"{cls.__name__} has no parameter '{unknown[0]}'{nearest(unknown[0], hints)}")
    needed = [f.name for f in dataclasses.fields(cls) if f.init and f.default is f.default_factory is _MISSING]
    if missing := [name for name in needed if name not in document]:
        raise PluginError(f"{cls.__name__} needs the parameter '{missing[0]}'")
    values = {name: _revive(hints[name], item) for name, item in document.items()}
    with code_of(cls):
        return cls(**values)


def _revive(annotation: Any, item: Any) -> Any:
    """Return `item` of a document, converted to the type in the field's annotation."""
    choices = get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else (annotation,)
    if isinstance(item, list):
        if not any(isinstance(part, (str, list, dict)) for part in item):
            return tuple(item)
        arguments = next((get_args(choice) for choice in choices if get_origin(choice) is tuple), ())
        inner = arguments if len(arguments) == len(item) and Ellipsis not in arguments else arguments[:1] * len(item)
        return tuple(_revive(kind, part) for kind, part in zip(inner or (None,) * len(item), item, strict=True))
    if isinstance(item, dict):
        return _revive_mapping(annotation, choices, item)
    return float(item) if item in ("inf", "-inf") and float in choices and str not in choices else item


def _revive_mapping(annotation: Any, choices: tuple[Any, ...], item: dict[str, Any]) -> Any:
    for choice in choices:
        group, origin = group_of(choice), get_origin(choice)
        if group and "kind" in item:
            return restore(group, item)
        if dataclasses.is_dataclass(choice) and isinstance(choice, type):
            return _build(choice, item)
        if isinstance(origin, type) and issubclass(origin, Mapping):
            return {key: _revive(get_args(choice)[1], part) for key, part in item.items()}
    raise PluginError(f"found a mapping where {annotation} is expected")


@cache
def _built_in(group: str) -> tuple[str, ...]:
    if group not in PROTOCOLS:
        raise PluginError(f"there is no group of kinds '{group}'{nearest(group, PROTOCOLS)}")
    try:
        package = importlib.import_module(f"hilrig.kinds.{group}")
    except ModuleNotFoundError:  # drivers come only from entry points
        return ()
    return tuple(m.name for m in pkgutil.iter_modules(package.__path__) if not m.name.startswith("_"))


@cache
def _entry_points(group: str) -> dict[str, EntryPoint]:
    found: dict[str, EntryPoint] = {}
    for entry in entry_points(group=f"hilrig.{group}"):
        other = found.setdefault(entry.name, entry)
        if entry.name in _built_in(group):
            raise PluginError(f"{entry.value} offers a kind '{entry.name}' of {group}, which is built into hilrig")
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
        choices = kind_names(group)
        listed = ", ".join(choices) or "none installed"
        raise PluginError(f"no kind '{kind}' of {group}{nearest(kind, choices)} (known: {listed})")
    try:
        loaded = importlib.import_module(module)
    except (Exception, SystemExit) as error:
        raise PluginError(f"the kind '{kind}' of {group} cannot be imported: {describe_error(error)}") from error
    cls = getattr(loaded, attribute, None) if attribute else _only_class(loaded, module)
    if not isinstance(cls, type) or not dataclasses.is_dataclass(cls):
        raise PluginError(f"the kind '{kind}' of {group} is {module}:{attribute}, which is not a dataclass")
    return _check(group, cls)


def _from_file(group: str, path: Path) -> type:
    source = read_bytes(path)
    # The name contains a digest of the contents: only a file that changed is loaded again.
    name = _USER_MODULE + hashlib.sha256(os.fsencode(f"{group}:{path}:") + source).hexdigest()[:16]
    module = sys.modules.get(name) or run_file(path, source, name, __hilrig_group__=group)
    return _check(group, _only_class(module, str(path)))


def _only_class(module: types.ModuleType, where: str) -> type:
    """Return the one public dataclass that `module` defines itself."""
    classes = [
        item
        for name, item in vars(module).items()
        if isinstance(item, type) and item.__module__ == module.__name__ and not name.startswith("_")
    ]
    found = [item for item in classes if dataclasses.is_dataclass(item)]
    if len(found) != 1:
        names = ", ".join(item.__name__ for item in found or classes) or "no class"
        words = names if found or not classes else f"{names} without @dataclass"
        raise PluginError(f"{where}: a kind's file must define exactly one public dataclass; this one has {words}")
    return found[0]


def _check(group: str, cls: type) -> type:
    """Return `cls` if it is frozen, provides everything in the group's protocol, and can be written to a file."""
    if not cls.__dataclass_params__.frozen:  # pyright: ignore[reportAttributeAccessIssue]
        raise PluginError(f"{place_of(cls)}: {cls.__name__} is mutable; make it @dataclass(frozen=True)")
    fields = {f.name for f in dataclasses.fields(cls)}
    if "kind" in fields:
        message = "a parameter cannot be called 'kind', the key under which a file names the kind itself; rename it"
        raise PluginError(f"{place_of(cls, 'kind')}: {message}")
    protocol = PROTOCOLS[group]
    wanted = [name for name in {**vars(protocol), **protocol.__annotations__} if not name.startswith("_")]
    missing = [name for name in wanted if name not in fields and not hasattr(cls, name)]
    if missing:
        raise PluginError(f"{place_of(cls)}: {cls.__name__} lacks {', '.join(missing)}, which {group} must offer")
    return cls
