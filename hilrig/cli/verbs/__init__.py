"""The verbs of the command line, one file each. A module adds its verb to the program when it is imported."""

VERBS = (
    "check", "plan", "run", "halt", "watch", "reproduce", "report", "compare", "list", "show", "kinds", "schema",
    "doctor",
)  # fmt: skip
"""In the order in which the help lists them"""
