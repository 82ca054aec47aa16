"""The command line: one file per verb, and the code that only one verb needs: `watch/` and `doctor/`.

`verbs/` are thin. Slow imports are done by the verb that needs them, in its function.
"""


def main() -> None:
    """Run the program."""
    # Imported here, because the processes of `watch` and `doctor` are in this package and need no verbs.
    from hilrig.cli.entry import main as program

    program()
