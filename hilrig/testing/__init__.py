"""The rules that every kind must keep, as tests for authors of kinds; needs pytest, the extra `hilrig[test]`.

    from hilrig.testing import contract

    test_my_controller = contract("controllers", "./my_controller.py")

creates one test per rule. `python -m hilrig.testing controllers ./my_controller.py` does the same without a test file.
"""

from importlib.util import find_spec

if find_spec("pytest") is None:
    raise ModuleNotFoundError("hilrig.testing needs pytest: uv add --editable 'PATH/TO/hilrig[test]'", name="pytest")

from hilrig.testing.contract import contract as contract  # (not before: it imports pytest)

__all__ = ["contract"]
