"""`python -m hilrig` is the command `hilrig`."""

from hilrig.cli import main

main()
