"""The rules as pytest collects them for the command, which has no file of tests: KIND::RULE for each."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from hilrig.testing.contract import Chosen, look, rules_of
from hilrig.testing.rule import Rule


def run(kinds: Sequence[Chosen], options: Sequence[str]) -> int:
    """Run the rules and return pytest's exit code. A configuration of pytest that happens to be here plays no part."""
    with tempfile.TemporaryDirectory() as folder:
        file, settings = Path(folder, "rules"), Path(folder, "pytest.ini")
        file.touch()  # pytest collects files alone; the plug-in says what is in this one
        settings.write_text("[pytest]\n", encoding="utf-8")
        place = ["-c", str(settings), "--rootdir", str(Path.cwd()), "--no-header"]
        without = ["-p", "no:cacheprovider", "-p", "no:xdist"]  # (workers would not have this plug-in)
        return int(pytest.main([*place, *without, str(file), *options], plugins=[_Rules(kinds)]))


class _Rules:
    """A plug-in of pytest that puts kinds into the one file that is collected."""

    def __init__(self, kinds: Sequence[Chosen]) -> None:
        self.kinds = kinds

    def pytest_collect_file(self, parent: pytest.Collector, file_path: Path) -> pytest.Collector:
        """Return what is in the file."""
        return _All.from_parent(parent, path=file_path, kinds=self.kinds)

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Say why rules were skipped."""
        reasons = Counter(report.longrepr[2] for report in terminalreporter.stats.get("skipped", ()))
        for reason, count in reasons.items():
            rules = "1 rule" if count == 1 else f"{count} rules"
            terminalreporter.write_line(f"SKIPPED {rules}: {reason.removeprefix('Skipped: ')}")


class _All(pytest.File):
    def __init__(self, *, kinds: Sequence[Chosen], **given: Any) -> None:
        super().__init__(**given)
        self.kinds = kinds

    def collect(self) -> Iterable[pytest.Collector]:
        """Return a collector for each kind, with a path by which pytest shows it as the user wrote it."""
        return [_Kind.from_parent(self, path=Path.cwd() / _shown(kind.name), kind=kind) for kind in self.kinds]


class _Kind(pytest.File):
    def __init__(self, *, kind: Chosen, **given: Any) -> None:
        super().__init__(**given)
        self.kind = kind

    def collect(self) -> Iterator[pytest.Item]:
        """Yield a test for each rule."""
        for name, rule in rules_of(self.kind.group).items():
            yield _Test.from_parent(self, name=name, kind=self.kind, rule=rule)


class _Test(pytest.Item):
    def __init__(self, *, kind: Chosen, rule: Rule | None, **given: Any) -> None:
        super().__init__(**given)
        self.kind, self.rule = kind, rule

    def runtest(self) -> None:
        """Look at the rule."""
        look(self.kind, self.rule)

    def reportinfo(self) -> tuple[Path, None, str]:
        """Return the place and the heading of a failure."""
        return self.path, None, f"{self.kind.name}: {self.name}"


def _shown(name: str) -> str:
    """Return the name of a kind, or its path; of a path from the root, its end."""
    return Path(name).name if Path(name).is_absolute() else name
