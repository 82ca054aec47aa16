"""Tables as a person sees them."""

from __future__ import annotations

import pytest

from hilrig.cli.terminal import print_table


def test_brackets_in_a_table_are_text(capsys: pytest.CaptureFixture[str]) -> None:
    print_table("Round trips [us]", {"": "left", "p50 [us]": "right"}, [["hilrig [bold]", "1"]])
    title, heading, row = (line.rstrip() for line in capsys.readouterr().out.splitlines())
    assert (title, heading.strip(), row.split()) == (
        "Round trips [us]", "p50 [us]", ["hilrig", "[bold]", "1"],
    )  # fmt: skip
