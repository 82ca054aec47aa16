"""The examples in the guides, as they stand there."""

from __future__ import annotations

import re
from pathlib import Path

from helpers.real_rig import PROJECT

DOCS = PROJECT / "docs"


def blocks(page: Path, language: str) -> list[str]:
    """Return the code blocks of a page in one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def block_with(page: Path, words: str, language: str = "python") -> str:
    """Return the only code block of a page with these words."""
    (found,) = [block for block in blocks(page, language) if words in block]
    return found


def write_files(page: Path, folder: Path) -> list[str]:
    """Write the blocks of a page that begin with the name of a file, such as `# mine.py`; return the names."""
    named = [block for language in ("python", "yaml", "toml") for block in blocks(page, language) if _name(block)]
    for block in named:
        (folder / _name(block)).write_text(block, encoding="utf-8")
    return [_name(block) for block in named]


def _name(block: str) -> str:
    found = re.match(r"# (\w+\.(?:py|yaml|toml))\n", block)
    return found[1] if found else ""
