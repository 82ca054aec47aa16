from __future__ import annotations

import pytest
from helpers.builders import trial
from rich.console import Console

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


def shown(display: Display) -> str:
    """Return the bars as they stand on a wide terminal."""
    console = Console(width=200)
    with console.capture() as captured:
        console.print(display._bars.get_renderable())
    return captured.get()


def test_what_a_plant_does_stands_in_place_of_the_time() -> None:
    display, subject = Display(1), trial()
    display.started(subject)
    assert "starting" in shown(display)
    display.doing(subject, "approaching [z], 1.2 N of 3.5 N")
    assert "approaching [z], 1.2 N of 3.5 N" in shown(display)
    assert "starting" not in shown(display)
    display.doing(subject, "")
    for tick in (1, 100):
        display.progressed(subject, tick)
    assert "0.1 / 0.2 s" in shown(display)
