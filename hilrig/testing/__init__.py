"""The rules that every kind keeps, as tests for the author of one; needs pytest, the extra `hilrig[test]`.

    from hilrig.testing import contract

    test_my_controller = contract("controllers", "./my_controller.py")

makes one test for each rule. `python -m hilrig.testing controllers ./my_controller.py` runs the same without a file.
"""

from importlib.util import find_spec

if find_spec("pytest") is None:
    raise ModuleNotFoundError("hilrig.testing needs pytest: uv add --editable 'PATH/TO/hilrig[test]'", name="pytest")

from hilrig.testing.contract import contract as contract  # (not before: it imports pytest)

__all__ = ["contract"]
