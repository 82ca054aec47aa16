"""The command line: the verbs, thin. What takes long to import is imported by the verb that needs it."""

from hilrig.cli.entry import main as main
