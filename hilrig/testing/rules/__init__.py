"""The rules, one file per group; two for controllers and for drivers."""

from importlib import import_module

FILES = (
    "every_kind", "controllers", "assessments", "references", "disturbances", "robots", "drivers", "plants", "metrics",
)  # fmt: skip


def register_all() -> None:
    """Import every file of rules, which registers them."""
    for name in FILES:
        import_module(f"{__name__}.{name}")
