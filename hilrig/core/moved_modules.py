"""Error messages for imports of modules that have moved: they say where the module is now."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import NoReturn

PUBLIC = ("interfaces", "signals", "kernel", "kernel_interfaces", "impedance", "contact", "actuation", "errors")
"""Modules of hilrig 0.1 whose names are now available from `import hilrig`"""
ROOMS = {
    "controllers": "kinds.controllers",
    "references": "kinds.references",
    "disturbances": "kinds.disturbances",
    "metrics": "kinds.metrics",
    "robots": "kinds.robots",
    "plugins": "kinds.registry",
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
            _raise(name, "import its names from `hilrig` itself, for example `from hilrig import Law, Parameter`")
        if top == "hilrig" and module in ROOMS:
            _raise(name, f"it is `hilrig.{ROOMS[module]}{rest[len(module) :]}` now")
        return None


def _raise(name: str, advice: str) -> NoReturn:
    raise ModuleNotFoundError(f"the module {name} has moved: {advice}", name=name)


def announce() -> None:
    """Install the finder that reports moved modules, once per process."""
    if _MovedModules not in sys.meta_path:
        sys.meta_path.append(_MovedModules)
