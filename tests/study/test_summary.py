"""Numbers of all sessions together, and the tables."""

import pytest

from engage_hri.services.study import summary
from engage_hri.services.study.hypotheses import findings
from tests.study.sessions import kind, session


def test_pooled_numbers_weigh_each_event_alike():
    short = session("operational", 0, kind("adjacency_pair", 1, 1, delay=1.0, failed_delay=3.0))
    long = session("operational", 1, kind("adjacency_pair", 3, 0, delay=2.0))

    found = summary.pooled([short, long], "adjacency_pair")

    assert (found.count, found.succeeded, found.failed, found.failure_rate) == (5, 4, 1, 0.2)
    assert (found.delay_min, found.delay_mean, found.delay_max) == (1.0, pytest.approx(7 / 4), 2.0)


def test_nothing_pooled_is_unknown_not_zero():
    found = summary.pooled([], "directed_gaze")

    assert (found.count, found.failure_rate, found.delay_min, found.delay_mean) == (0, None, None, None)


def test_the_overview_counts_finished_sessions_only():
    records = [
        session("operational", 0, kind("backchannel", 4), completion=100.0, mtbce=5.0),
        session("operational", 1, kind("backchannel", 6), completion=120.0, mtbce=7.0),
        session("operational", 2, kind("backchannel", 90), completion=9.0, reason="died"),
        session("degraded-generation", 0, reason="died"),
    ]

    rows = {row[0]: row[1:] for row in summary.overview(records).rows}

    assert rows["finished"] == ("2 of 3", "0 of 1")
    assert rows["completion time (s)"] == ("110.0 ± 14.1", "-")
    assert rows["MTBCE (s)"] == ("6.00 ± 1.41", "-")
    assert rows["backchannel"] == ("5.0 ± 1.4", "-")


def test_each_measure_has_its_row_and_its_digits():
    records = [
        session("a", number, kind("backchannel", 4 + number), completion=99.0, pairs=1.5, face=(0.25, 0.5, 0.75),
                mtbce=5.0)
        for number in range(2)
    ]  # fmt: skip

    rows = dict(summary.overview(records).rows)

    assert [rows[f"face, {third} third"] for third in ("first", "second", "last")] == [
        "0.25 ± 0.00", "0.50 ± 0.00", "0.75 ± 0.00",
    ]  # fmt: skip
    assert rows["pair to pair (s)"] == "1.50 ± 0.00"
    assert rows["connection events"] == "4.5 ± 0.7"


def test_sessions_that_were_never_played_count_as_not_finished() -> None:
    records = [session("operational", 0), session("operational", 1)]

    rows = {row[0]: row[1:] for row in summary.overview(records, {"operational": 30}).rows}

    assert rows["finished"] == ("2 of 30",)


def test_what_nobody_measured_is_left_out():
    records = [session("human-human", 0, kind("backchannel", 4))]

    table = summary.overview(records)

    assert table.columns == ("", "human-human")
    assert {row[0] for row in table.rows} == {
        "finished", "connection events", "directed gaze", "mutual facial gaze", "adjacency pair", "backchannel",
    }  # fmt: skip
    assert not any("Face" in note for note in table.notes)


def test_a_table_in_markdown():
    table = summary.NumberTable(title="T", columns=("", "a"), rows=(("x", "1"), ("y", "2")), notes=("Why.",))

    assert table.markdown() == "## T\n\n|  | a |\n| --- | ---: |\n| x | 1 |\n| y | 2 |\n\nWhy.\n"


def test_every_table_stands_without_any_session():
    for table in (summary.overview([]), summary.hypotheses([]), summary.unfinished([])):
        assert table.markdown().startswith(f"## {table.title}")


def test_the_table_of_hypotheses_explains_its_letters():
    records = [session(name, 0, pairs=7.0) for name in ("operational", "degraded-recognition")]

    text = summary.hypotheses(findings(records)).markdown()

    for expected in (
        "| 6 | recognition | 1 | 7.00 | 7.00 | 0.00 | - | - | 1.0000 | too few sessions |",
        "11a: people make",
        "Holm",
        "The person is a model",
    ):
        assert expected in text


@pytest.mark.parametrize(("value", "text"), [(None, "-"), (-0.001, "0.00"), (1.005, "1.00"), (-1.5, "-1.50")])
def test_numbers_have_no_negative_zero(value: float | None, text: str):
    assert summary.number(value) == text
