"""`python -m hilrig` is the command `hilrig`."""

from hilrig.cli import main

if __name__ == "__main__":
    main()
