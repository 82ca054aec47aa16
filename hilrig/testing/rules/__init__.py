"""The rules, one group a file; of controllers and drivers two."""

from importlib import import_module

FILES = (
    "every_kind", "controllers", "assessments", "references", "disturbances", "robots", "drivers", "plants", "metrics",
)  # fmt: skip


def register_all() -> None:
    """Import every file of rules; to import one is to register its rules."""
    for name in FILES:
        import_module(f"{__name__}.{name}")
