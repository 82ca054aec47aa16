"""The page on performance: its text and the benchmark's tables, as Markdown."""

from __future__ import annotations

from importlib import resources

from jinja2 import Environment, StrictUndefined

from benchmarks.tables import Document, Table, machine_lines, tables


def page(found: Document) -> str:
    """Return the page for the document of a run."""
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, keep_trailing_newline=True)  # not HTML
    environment.filters["grid"] = grid
    text = resources.files("benchmarks").joinpath("performance.md.j2").read_text(encoding="utf-8")
    return environment.from_string(text).render(
        found=found, machine=machine_lines(found["machine"]), tables=tables(found), started=found["started"][:10]
    )


def grid(table: Table) -> str:
    """Return a table in Markdown: words are left-aligned, figures right-aligned."""
    marks = ["---", *("---" if heading == "why" else "---:" for heading in table.columns[1:])]
    lines = [table.columns, marks, *table.rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
