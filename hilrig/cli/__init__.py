"""The command line: one file a verb, and what only one verb needs: `watch/` and `doctor/`.

`verbs/` are thin. What takes long to import is imported by the verb that needs it, in its function.
"""


def main() -> None:
    """Run the program."""
    # Imported here: the processes of `watch` and `doctor` are in this package, and need no verbs.
    from hilrig.cli.entry import main as program

    program()
