"""Error messages for imports of modules that have moved: they say where the module is now."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import NoReturn

PUBLIC = {
    "interfaces": "Law, Task",
    "signals": "State, Reference",
    "kernel": "kernel",
    "kernel_interfaces": "RobotKernels",
    "impedance": "advance_filter",
    "contact": "Surface",
    "actuation": "Actuation",
    "errors": "HilrigError",
}
"""Modules of hilrig 0.1 whose names are now available from `import hilrig` -> an example"""
ROOMS = {
    "controllers": "kinds.controllers",
    "references": "kinds.references",
    "disturbances": "kinds.disturbances",
    "metrics": "kinds.metrics",
    "robots": "kinds.robots",
    "plugins": "kinds.registry",
    "quantities": "core.quantities",
    "law_memory": "core.law_memory",
    "document": "experiment.document",
    "rig_settings": "experiment.rig_settings",
    "safety": "loop.safety",
    "trial": "experiment.trial",
    "plan": "experiment.plan",
    "schema": "experiment.schema",
    "messages": "recording.messages",
    "certificate": "recording.certificate",
    "reproduction": "study",
}
"""Old module -> new one, below `hilrig`"""


class _MovedModules:
    """A finder that comes last and finds nothing: it raises ModuleNotFoundError with the new location of a module."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> ModuleSpec | None:
        top, _, rest = name.partition(".")
        module = rest.partition(".")[0]
        if top == "hilrig" and module in PUBLIC:
            _raise(name, f"import its names from `hilrig` itself, for example `from hilrig import {PUBLIC[module]}`")
        if top == "hilrig" and module in ROOMS:
            _raise(name, f"it is `hilrig.{ROOMS[module]}{rest[len(module) :]}` now")
        return None


def _raise(name: str, advice: str) -> NoReturn:
    # Without `name=`: `from hilrig import signals` would take such an error for "there is no submodule", and hide it.
    raise ModuleNotFoundError(f"the module {name} has moved: {advice}")


def announce() -> None:
    """Install the finder that reports moved modules, once per process."""
    if _MovedModules not in sys.meta_path:
        sys.meta_path.append(_MovedModules)
