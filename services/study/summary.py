"""Summary of sessions, as tables for a terminal, for Markdown, and as CSV with always the same columns."""

import csv
import io
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import mean, stdev

import msgspec
from msgspec import Struct

from engage_hri.schemas.behaviors import EVENT_KINDS, EventKind
from engage_hri.schemas.recognition import KindStatistics
from engage_hri.services.study.hypotheses import CAVEAT, HYPOTHESES, PEOPLE_CAVEAT, HypothesisResult
from engage_hri.services.study.records import EventRecord, SessionRecord

RESPONDED = tuple(kind for kind, each in EVENT_KINDS.items() if each.is_answered)
"""Kinds with a responder; the others can neither fail nor be late."""
MISSING = "-"


class NumberTable(Struct, frozen=True, kw_only=True):
    """Table with words in its first column and numbers in the others."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    def markdown(self) -> str:
        rule = ("---", *["---:"] * (len(self.columns) - 1))
        lines = [f"| {' | '.join(cells)} |" for cells in (self.columns, rule, *self.rows)]
        paragraphs = (f"## {self.title}", "\n".join(lines), *self.notes)
        return "\n\n".join(paragraphs) + "\n"


# -- numbers ----------------------------------------------------------------------------------------------------


def by_condition(records: Iterable[SessionRecord]) -> dict[str, list[SessionRecord]]:
    """Group the finished sessions by condition; a condition without any has an empty group."""
    groups: dict[str, list[SessionRecord]] = {}
    for record in records:
        group = groups.setdefault(record.condition, [])
        if record.finished:
            group.append(record)
    return groups


def pooled(records: Iterable[SessionRecord], kind: EventKind) -> KindStatistics:
    """Add up the events of one kind in all sessions."""
    parts = [record.of(kind) for record in records]
    succeeded, failed = sum(part.succeeded for part in parts), sum(part.failed for part in parts)
    return KindStatistics(
        kind=kind, count=sum(part.count for part in parts), succeeded=succeeded, failed=failed,
        failure_rate=failed / (succeeded + failed) if succeeded + failed else None,
        delay_min=min(known(part.delay_min for part in parts), default=None),
        delay_mean=_weighted((part.delay_mean, part.succeeded) for part in parts),
        delay_max=max(known(part.delay_max for part in parts), default=None),
    )  # fmt: skip


def _weighted(means: Iterable[tuple[float | None, int]]) -> float | None:
    """Weighted mean of means; None if there are none."""
    parts = [(mean, weight) for mean, weight in means if mean is not None]
    return sum(mean * weight for mean, weight in parts) / sum(weight for _, weight in parts) if parts else None


def known(values: Iterable[float | None]) -> list[float]:
    return [value for value in values if value is not None]


# -- tables -----------------------------------------------------------------------------------------------------


def overview(records: Sequence[SessionRecord], ordered: Mapping[str, int] | None = None) -> NumberTable:
    """Table with a column for each condition, without rows that are empty in all of them.

    ordered: number of sessions by condition that were to be played; None: as many as there are records.
    """
    groups = by_condition(records)
    ordered = ordered or Counter(record.condition for record in records)
    rows = [("finished", *(f"{len(group)} of {ordered[name]}" for name, group in groups.items()))]
    for title, digits, measure in _MEASURES:
        cells = (mean_and_deviation(known(map(measure, group)), digits) for group in groups.values())
        rows.append((title, *cells))
    for kind, words in EVENT_KINDS.items():
        counts = ([float(record.of(kind).count) for record in group] for group in groups.values())
        rows.append((words.title, *(mean_and_deviation(count, 1) for count in counts)))
        if kind in RESPONDED:
            all_of = [pooled(group, kind) for group in groups.values()]
            rows.append(("- failure rate", *(number(one.failure_rate, 3) for one in all_of)))
            delays = ((one.delay_min, one.delay_mean, one.delay_max) for one in all_of)
            rows.append(("- delay (s)", *map(numbers, delays)))
    known_rows = tuple(row for row in rows if set(row[1:]) != {MISSING})
    face = any(row[0].startswith("face") for row in known_rows)
    return NumberTable(
        title="Sessions", columns=("", *groups), rows=known_rows,
        notes=(
            "Finished sessions; mean ± standard deviation of a session. Failure rates, and delays of what succeeded "
            "(least, mean, most), are of all events together; optional events that fail are no failures.",
            *((_FACE,) if face else ()),
        ),
    )  # fmt: skip


_FACE = "Face: how much of that third of the session the person is seen to look at the robot's face."


_MEASURES: tuple[tuple[str, int, Callable[[SessionRecord], float | None]], ...] = (
    ("completion time (s)", 1, lambda record: record.completion_time),
    ("connection events", 1, lambda record: record.statistics.events),
    ("MTBCE (s)", 2, lambda record: record.statistics.mtbce),
    ("longest gap (s)", 1, lambda record: record.statistics.max_gap),
    ("pair to pair (s)", 2, lambda record: record.adjacency_pairs_every),
    ("face, first third", 2, lambda record: record.eye_contact.first if record.eye_contact else None),
    ("face, second third", 2, lambda record: record.eye_contact.second if record.eye_contact else None),
    ("face, last third", 2, lambda record: record.eye_contact.last if record.eye_contact else None),
)


class Comparison(Struct, frozen=True, kw_only=True):
    """Words about a comparison. baseline: name of the condition that others are compared with, short.

    how: which sessions are compared with which, and by what test. caveat: what it cannot say.
    """

    title: str
    baseline: str
    other: str
    how: str
    caveat: str


SIMULATED = Comparison(
    title="Hypotheses of the thesis (5.2.2), in simulation", baseline="oper.", other="degr.",
    how="Sessions of the same seed are compared as pairs, though they are hardly more alike than others. p: "
    "two-sided permutation test of their differences (signs flipped), corrected for the number of questions (Holm). "
    "95 %: the differences that the test does not reject, uncorrected. d: mean / standard deviation of the "
    "differences.",
    caveat=CAVEAT,
)  # fmt: skip
_TESTED = (
    "corrected for the number of questions (Holm). 95 %: the differences that the test does not reject, uncorrected."
)
WITHIN = Comparison(
    title="Hypotheses of the thesis (5.2.2), in these recordings", baseline="base", other="other",
    how="Sessions of the same participant are compared as pairs; participants who lack one of the two are left out. "
    f"p: two-sided permutation test of their differences (signs flipped), {_TESTED} d: mean / standard deviation of "
    "the differences.", caveat=PEOPLE_CAVEAT,
)  # fmt: skip
BETWEEN = Comparison(
    title=WITHIN.title, baseline="base", other="other",
    how="Sessions of different people are compared; n is of both together. p: two-sided permutation test (people "
    f"divided anew), {_TESTED} d: difference of the means / standard deviation within conditions. 11a looks at one "
    "condition alone, by signs flipped.", caveat=PEOPLE_CAVEAT,
)  # fmt: skip


def hypotheses(found: Sequence[HypothesisResult], compared: Comparison = SIMULATED) -> NumberTable:
    """Table with a row for each finding."""
    rows = (
        (
            finding.hypothesis, finding.condition.removeprefix("degraded-"), str(finding.n),
            number(finding.operational), number(finding.degraded), number(finding.difference),
            _interval(finding.low, finding.high), number(finding.effect, 1),
            number(finding.p_corrected, 4), finding.verdict,
        )
        for finding in found
    )  # fmt: skip
    return NumberTable(
        title=compared.title,
        columns=("", "condition" if compared is not SIMULATED else "degraded", "n", compared.baseline, compared.other,
                 "diff.", "95 %", "d", "p", "verdict"),
        rows=tuple(rows),
        notes=(
            *(f"{one.name}: {one.claim} ({one.measure}, {one.unit})." for one in HYPOTHESES),
            compared.how,
            compared.caveat,
        ),
    )  # fmt: skip


def _interval(low: float | None, high: float | None) -> str:
    return MISSING if low is None or high is None else f"{number(low)}..{number(high)}"


def unfinished(records: Sequence[SessionRecord]) -> NumberTable:
    rows = (
        (f"{record.condition} {record.session}", str(record.seed), record.reason)
        for record in records
        if not record.finished
    )
    return NumberTable(title="Not finished", columns=("session", "seed", "reason"), rows=tuple(rows))


def number(value: float | None, digits: int = 2) -> str:
    """Write a number without negative zero; `-` for None."""
    return MISSING if value is None else f"{round(value, digits) + 0.0:.{digits}f}"


def numbers(values: Iterable[float | None]) -> str:
    """Write numbers as `0.00 0.31 2.00`, or as one `-` if all are None."""
    words = [number(value) for value in values]
    return MISSING if set(words) == {MISSING} else " ".join(words)


def mean_and_deviation(values: Sequence[float], digits: int) -> str:
    """Write mean and standard deviation as `5.71 ± 0.20`."""
    if not values:
        return MISSING
    middle = number(mean(values), digits)
    return f"{middle} ± {number(stdev(values), digits)}" if len(values) > 1 else middle


EVENT_COLUMNS = EventRecord.__struct_fields__
KIND_COLUMNS = ("count", "succeeded", "failed", "failure_rate", "delay_mean", "failed_delay_mean")
SESSION_COLUMNS = (
    "session", "condition", "seed", "finished", "reason", "duration", "completion_time", "events", "mtbce", "max_gap",
    "adjacency_pairs_every", "eye_contact_first", "eye_contact_second", "eye_contact_last",
    *(f"{kind}_{column}" for kind in EVENT_KINDS for column in KIND_COLUMNS),
)  # fmt: skip

Cell = str | int | float | bool | None


def events_csv(records: Iterable[EventRecord]) -> str:
    return csv_table(EVENT_COLUMNS, (msgspec.structs.astuple(record) for record in records))


def sessions_csv(records: Iterable[SessionRecord]) -> str:
    return csv_table(SESSION_COLUMNS, map(_session, records))


def findings_csv(found: Iterable[HypothesisResult]) -> str:
    return csv_table(HypothesisResult.__struct_fields__, (msgspec.structs.astuple(finding) for finding in found))


def _session(record: SessionRecord) -> list[Cell]:
    eyes, numbers = record.eye_contact, record.statistics
    return [
        record.session, record.condition, record.seed, record.finished, record.reason, record.duration,
        record.completion_time, numbers.events, numbers.mtbce, numbers.max_gap, record.adjacency_pairs_every,
        *((eyes.first, eyes.second, eyes.last) if eyes else (None, None, None)),
        *(getattr(record.of(kind), column) for kind in EVENT_KINDS for column in KIND_COLUMNS),
    ]  # fmt: skip


def csv_table(columns: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """A table as CSV. rows: numbers are written to the millionth, true and false in small letters."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_cell(cell) for cell in row] for row in rows)
    return text.getvalue()


def _cell(cell: Cell) -> Cell:
    """Write a cell: numbers to the millionth, `true` and `false` in small letters."""
    if isinstance(cell, bool):
        return "true" if cell else "false"
    return round(cell, 6) + 0.0 if isinstance(cell, float) else cell  # + 0.0: no negative zero
