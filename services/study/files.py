"""Files of a study as text: CSV, always with the same columns."""

import csv
import io
from collections.abc import Iterable, Sequence

import msgspec

from engage_hri.services.study.hypotheses import HypothesisResult
from engage_hri.services.study.records import EventRecord, SessionRecord
from engage_hri.services.study.summary import KINDS

EVENT_COLUMNS = EventRecord.__struct_fields__
KIND_COLUMNS = ("count", "succeeded", "failed", "failure_rate", "delay_mean", "failed_delay_mean")
SESSION_COLUMNS = (
    "session", "condition", "seed", "finished", "reason", "duration", "completion_time", "events", "mtbce", "max_gap",
    "adjacency_pairs_every", "eye_contact_first", "eye_contact_second", "eye_contact_last",
    *(f"{kind}_{column}" for kind in KINDS for column in KIND_COLUMNS),
)  # fmt: skip

Cell = str | int | float | bool | None


def events(records: Iterable[EventRecord]) -> str:
    return table(EVENT_COLUMNS, (msgspec.structs.astuple(record) for record in records))


def sessions(records: Iterable[SessionRecord]) -> str:
    return table(SESSION_COLUMNS, map(_session, records))


def findings(found: Iterable[HypothesisResult]) -> str:
    return table(HypothesisResult.__struct_fields__, (msgspec.structs.astuple(finding) for finding in found))


def _session(record: SessionRecord) -> list[Cell]:
    eyes, numbers = record.eye_contact, record.statistics
    return [
        record.session, record.condition, record.seed, record.finished, record.reason, record.duration,
        record.completion_time, numbers.events, numbers.mtbce, numbers.max_gap, record.adjacency_pairs_every,
        *((eyes.first, eyes.second, eyes.last) if eyes else (None, None, None)),
        *(getattr(record.of(kind), column) for kind in KINDS for column in KIND_COLUMNS),
    ]  # fmt: skip


def table(columns: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
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
