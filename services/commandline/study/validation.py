"""Comparison of sessions of two people with the table that they are drawn from: thesis, Table 2.1."""

from collections.abc import Sequence

from engage_hri.services.study.records import SessionRecord
from engage_hri.services.study.summary import NumberTable, known, mean_and_deviation, number, numbers, pooled
from engage_hri.services.tangram.people.table_2_1 import EVENTS, LONGEST_GAP, MTBCE, TABLE


def beside_table_2_1(records: Sequence[SessionRecord]) -> NumberTable:
    """Compare each number of the table with the finished sessions."""
    done = [record for record in records if record.finished]
    rows: list[tuple[str, str, str]] = []
    for kind, row in TABLE.items():
        found, name = pooled(done, kind), kind.replace("_", " ")
        per_session = found.count / len(done) if done else None
        rows.append((f"{name}, events per session", str(row.count), number(per_session, 1)))
        if row.failed:
            success = None if found.failure_rate is None else 1 - found.failure_rate
            rows.append((f"{name}, success rate", number(row.success, 3), number(success, 3)))
            delays = (row.delays.least, row.delays.mean, row.delays.most)
            measured = (found.delay_min, found.delay_mean, found.delay_max)
            rows.append((f"{name}, delay (s)", numbers(delays), numbers(measured)))
            failed = (row.failed_delays.least, row.failed_delays.mean, row.failed_delays.most)
            measured = (found.failed_delay_min, found.failed_delay_mean, found.failed_delay_max)
            rows.append((f"{name}, failed after (s)", numbers(failed), numbers(measured)))
    events = [float(record.statistics.events) for record in done]
    rows.append(("all, events per session", str(EVENTS), mean_and_deviation(events, 1)))
    means = known(record.statistics.mtbce for record in done)
    rows.append(("MTBCE (s)", number(MTBCE, 1), mean_and_deviation(means, 2)))
    gaps = known(record.statistics.max_gap for record in done)
    rows.append(("longest gap (s)", number(LONGEST_GAP, 0), mean_and_deviation(gaps, 1)))
    return NumberTable(
        title="Beside Table 2.1", columns=("", "table", "sessions, pooled"), rows=tuple(rows),
        notes=(
            "Success rates and delays are of all events together; ± is the standard deviation of a session. Numbers "
            "of events are the table's, and rates and delays are drawn from it: agreement shows that recognition "
            "measures what happened. Only the times between events are a model of people.",
        ),
    )  # fmt: skip
