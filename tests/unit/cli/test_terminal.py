from __future__ import annotations

import pytest

from hilrig.cli.progress import Display
from hilrig.cli.terminal import errors, print_table

WORDS = ["sensor [left] lost [/dev/ft0]", "[nan nan]", "[bold]not bold[/bold]", "gain :warning: 3", "[/]"]


@pytest.mark.parametrize("text", WORDS)
def test_a_table_shows_the_text_of_users_as_it_is(capsys: pytest.CaptureFixture[str], text: str) -> None:
    print_table(text, {text: "right"}, [[text]])
    assert [line.strip() for line in capsys.readouterr().out.splitlines()] == [text, text, text]


@pytest.mark.parametrize("text", WORDS)
def test_errors_show_the_text_of_users_as_it_is(text: str) -> None:
    with errors.capture() as captured:
        errors.print(text)
    assert captured.get() == f"{text}\n"


def test_a_trials_bar_has_the_trials_name_as_it_is() -> None:
    column = Display(1)._bars.columns[0]
    assert getattr(column, "markup", None) is False
