"""Which tests may be skipped: `skips.toml` says why, how many, and where. Any other skip makes the run red.

A test that skips guards nothing, and nobody reads the line that says so. `ENGAGE_PLATFORM` names the place, such as
`ci`; what is skipped there is known exactly. Without it this is somebody's desk, which may lack anything that is
listed. Where a part of the tests runs, the numbers are the most that may be skipped.
"""

import os
import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest

LISTED = Path(__file__).with_name("skips.toml")
DESK = "desk"
MOST = "most"
"""On any platform, where no exact number can be said."""


def platform() -> str:
    return os.environ.get("ENGAGE_PLATFORM", DESK)


def listed(text: str) -> dict[str, dict[str, int]]:
    """Numbers by platform, by the reason: a regular expression that fits all of it. Raises ValueError."""
    table = tomllib.loads(text)
    found: dict[str, dict[str, int]] = {}
    for entry in table["skip"]:
        reason = entry.pop("reason")
        if reason in found:
            raise ValueError(f"{reason!r} is listed twice")
        if unknown := entry.keys() - {*table["platforms"], MOST}:
            raise ValueError(f"{reason!r}: {', '.join(sorted(unknown))} is none of {', '.join(table['platforms'])}")
        found[reason] = entry
    return found


def amiss(
    skipped: Sequence[str], expected: Mapping[str, Mapping[str, int]], where: str, *, whole: bool
) -> Iterator[str]:
    """What is wrong with the skips of a run. skipped: the reason of each. whole: all tests were asked for."""
    counts = Counter(_entry(reason, expected) or reason for reason in skipped)
    for reason in sorted(counts.keys() - expected.keys()):
        yield f"{counts[reason]} skipped, which tests/skips.toml does not expect anywhere: {reason}"
    for reason, numbers in expected.items():
        count, number = counts[reason], numbers.get(where, numbers.get(MOST, 0))
        if count > number:
            yield f"{count} skipped, of which tests/skips.toml expects {number} on `{where}`: {reason}"
        elif whole and count < number and where in numbers and where != DESK:
            yield f"only {count} skipped, tests/skips.toml still has {number} for `{where}`: {reason}"


def _entry(reason: str, expected: Mapping[str, object]) -> str | None:
    return next((pattern for pattern in expected if re.fullmatch(pattern, reason, re.DOTALL)), None)


class Skips:
    """Hears of all skips of a run, also of those on workers and of whole files, and judges them when it ends."""

    def __init__(self, listed_in: Path = LISTED) -> None:
        self._listed_in = listed_in
        self._reasons: dict[str, str] = {}
        self._amiss: list[str] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.skipped and not hasattr(report, "wasxfail"):
            self._take(report)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.skipped:
            self._take(report)

    def _take(self, report: pytest.TestReport | pytest.CollectReport) -> None:
        assert isinstance(report.longrepr, tuple)
        self._reasons[report.nodeid] = report.longrepr[2].removeprefix("Skipped: ")

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        expected = listed(self._listed_in.read_text())
        self._amiss = list(amiss([*self._reasons.values()], expected, platform(), whole=_is_whole(session)))
        if self._amiss and session.exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        for line in self._amiss:
            terminalreporter.write_line(f"SKIPS: {line}", red=True)


def _is_whole(session: pytest.Session) -> bool:
    config = session.config
    asked = config.option
    return (
        config.args_source is pytest.Config.ArgsSource.TESTPATHS
        # What is skipped for want of something is long, and not one of many cases (long_share.py).
        and asked.markexpr in ("", "not many", "long and not many")
        and not (asked.keyword or asked.deselect or asked.ignore or asked.ignore_glob)
        and not getattr(asked, "lf", False)
        and not (session.shouldstop or session.shouldfail)
        and session.exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED)
    )
