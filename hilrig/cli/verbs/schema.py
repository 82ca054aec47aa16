"""schema: the JSON Schema of experiment files, for editors."""

from __future__ import annotations

from hilrig.cli.application import app, print_json
from hilrig.core.compiler import interpret


@app.command()
def schema() -> None:
    """Print the JSON Schema of experiment files.

    An editor that knows the schema completes and checks the file as you type.
    """
    from hilrig.experiment import experiment_schema

    interpret()
    print_json(experiment_schema())
