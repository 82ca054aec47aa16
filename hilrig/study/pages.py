"""The pages of a reproduction: one self-contained HTML file, and a README for the repository."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from hilrig.core.text import write_text
from hilrig.report.dataset import RunData
from hilrig.report.expectations import Expected
from hilrig.report.page import STYLE
from hilrig.study.evidence import Judged
from hilrig.study.loading import Loaded
from hilrig.study.model import FigureSpec
from hilrig.study.rows import counts, ended, reason


@dataclass(frozen=True)
class PagePicture:
    """A figure on the pages."""

    spec: FigureSpec
    file: str
    """Name of its files in figures/, without the suffix; "" if there is nothing to draw, as the caption then says"""
    source: str
    """Data URI"""
    caption: str


@dataclass(frozen=True)
class Page:
    """The content of the pages."""

    loaded: Loaded
    judged: Sequence[Judged]
    pictures: Sequence[PagePicture]
    expected: Mapping[str, Sequence[Expected]]
    """The judged expectations of each experiment, by its name"""
    runs: Mapping[str, RunData]
    """The run of each experiment, by its name"""
    command: str
    """The command that makes the whole reproduction"""
    overrides: tuple[str, ...]


def write_pages(page: Page, out: Path) -> None:
    """Write index.html and README.md into `out`."""
    write_text(out / "index.html", _render(page, "index.html.j2", escape=True))
    write_text(out / "README.md", _render(page, "README.md.j2", escape=False))


def _render(page: Page, name: str, escape: bool) -> str:
    environment = Environment(
        autoescape=escape, undefined=StrictUndefined, trim_blocks=True, keep_trailing_newline=True
    )
    environment.filters["cell"] = _cell
    environment.filters["reason"] = reason
    template = environment.from_string(resources.files("hilrig.study").joinpath(name).read_text("utf-8"))
    lost = [(name, trial) for name, run in page.runs.items() for trial in run.trials if not trial.counts]
    expectations = [(name, item) for name, items in page.expected.items() for item in items]
    return template.render(
        page=page, study=page.loaded.study, counts=counts(page.judged), style=STYLE, lost=lost,
        expectations=expectations, ended={name: ended(run) for name, run in page.runs.items()},
        run_commands={name: _run_command(page, name) for name in page.loaded.experiments},
    )  # fmt: skip


def _run_command(page: Page, experiment: str) -> str:
    """Return the command that runs one experiment alone."""
    file = page.loaded.sources[experiment]
    changes = "".join(f" --set {text}" for text in page.overrides)
    return f"hilrig run {shown_path(file)}{changes}"


def shown_path(path: Path) -> str:
    """Return a path as the pages show it: relative to the working directory if below it, else only its name."""
    try:
        return path.resolve().relative_to(Path.cwd()).as_posix()
    except ValueError:
        return path.name


def _cell(text: str) -> str:
    """Return text for a cell of a Markdown table, escaped."""
    return text.replace("|", "\\|").replace("\n", " ").replace("_", "\\_").replace("*", "\\*")
