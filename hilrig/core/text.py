"""Text files: user files are read as UTF-8, and hilrig writes UTF-8."""

from __future__ import annotations

import codecs
from pathlib import Path

OTHER_MARKS = {codecs.BOM_UTF16_LE: "UTF-16", codecs.BOM_UTF16_BE: "UTF-16"}


class NotUtf8Error(ValueError):
    """Bytes that are not UTF-8 text; the message names the byte; line and column count from 1."""

    def __init__(self, message: str, line: int, column: int) -> None:
        self.line, self.column = line, column
        super().__init__(message)


def decoded(content: bytes) -> str:
    """Return the text of a file, without its byte order mark. Raises NotUtf8Error."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = error.object[: error.start]
        line, column = before.count(b"\n") + 1, error.start - before.rfind(b"\n")
        found = f"byte 0x{error.object[error.start]:02x}"
        if content[:2] in OTHER_MARKS:
            found = f"it begins with the byte order mark of {OTHER_MARKS[content[:2]]}"
        raise NotUtf8Error(f"is not UTF-8 text: {found}", line, column) from error


def write_text(path: Path, text: str) -> None:
    """Write a text file. Bytes that are not UTF-8, for example in a folder name, become escapes such as \\udcff."""
    path.write_text(text, encoding="utf-8", errors="backslashreplace")
