"""What a language model gets to read of its fragments."""

import json

import pytest

from engage_hri.schemas.blocks import SpokenText
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome, ReferenceMade
from engage_hri.schemas.recognition import ConnectionEvent, EventState
from engage_hri.schemas.summary import LONGEST_PROBLEM, Summary, summary
from engage_hri.schemas.units import Stamp


def event(kind: str, state: EventState, block: str = "f", **fields: object) -> ConnectionEvent:
    at = Stamp("loop", float(fields.pop("at", 0.0)))  # type: ignore[arg-type]
    values = {"id": f"{kind}-{block}", "initiator": "robot", "responder": "ann", **fields}
    return ConnectionEvent(kind=kind, state=state, block=block, at=at, started=at, **values)  # type: ignore[arg-type]


def made(
    by: str = "pointing", looked: bool | None = None, delay: float | None = None, phrase: str = "that cup"
) -> ReferenceMade:
    return ReferenceMade(reference="r", object="cup", by=by, phrase=phrase, looked=looked, delay=delay)  # type: ignore[arg-type]


def outcome(id: str = "f", status: str = "done", **fields: object) -> FragmentOutcome:
    return FragmentOutcome(id=f"ask-{id}", fragment=id, status=status, **fields)  # type: ignore[arg-type]


def said(*texts: str, complete: bool = True) -> tuple[SpokenText, ...]:
    return tuple(SpokenText(behavior=f"s{index}", text=text, complete=complete) for index, text in enumerate(texts))


DONE = outcome(
    spoken=said("Please take", "that cup", "away."),
    references=(made(looked=True, delay=0.4151),),
    eye_contact=False,
    events=(event("adjacency_pair", "succeeded", response="act", delay=-0.204, turn="f"),),
)


def test_a_good_fragment_is_told_in_a_few_hundred_characters() -> None:
    told = summary(DONE)

    assert json.loads(told.json) == {
        "status": "done",
        "said": "Please take that cup away.",
        "references": [{"object": "cup", "phrase": "that cup", "by": "pointing", "looked": True, "delay": 0.42}],
        "eye_contact": False,
        "answer": "act",
        "answer_delay": -0.2,
        "answered_by": "ann",
    }
    assert len(told.json) < 300
    assert told.text == (
        'Said: "Please take that cup away." cup: that cup, by pointing; they looked after 0.42 s. '
        "At the end they did not look at the robot. Answered by ann: act, after -0.2 s."
    )


@pytest.mark.parametrize("words", ["Really?", 'He said "go!"', "Wait…", "請。", "「請。」"])
def test_words_that_end_with_a_stop_of_their_own_get_no_other(words: str) -> None:
    assert summary(outcome(spoken=said(words))).text == f'Said: "{words}"'


@pytest.mark.parametrize("words", ["Please move the blue piece", "first,", "3.5", "請"])
def test_a_full_stop_parts_words_without_one_from_the_next_sentence(words: str) -> None:
    told = summary(outcome(spoken=said(words), references=(made(),)))

    assert told.text.startswith(f'Said: "{words}". cup: ')


def test_what_was_interrupted_tells_the_words_really_spoken_and_why() -> None:
    cut = outcome(
        status="interrupted",
        spoken=(*said("Please take"), *said("that", complete=False)),
        fault=Fault(reason="ann took the floor", where="f"),
    )

    told = summary(cut)

    assert (told.status, told.said, told.cut_short) == ("interrupted", "Please take that", True)
    assert told.problems == ("f: ann took the floor",)
    assert told.text == (
        'The fragment was interrupted. Only said: "Please take that". Problems: f: ann took the floor.'
    )


def test_who_did_not_look_and_who_was_not_waited_for() -> None:
    references = (made(looked=False), made("look", phrase="it"), made("words", phrase="the cup"), made("nothing"))

    told = summary(outcome(references=references)).references

    assert [(each.by, each.looked) for each in told] == [("pointing", False), ("a look", None), ("words alone", None)]


def test_an_answer_is_pending_none_or_not_waited_for() -> None:
    answers = [
        summary(outcome(events=events)).answer
        for events in (
            (event("adjacency_pair", "started"),),
            (event("adjacency_pair", "failed", delay=1.5),),
            (event("adjacency_pair", "withdrawn"),),
            (event("adjacency_pair", "succeeded", response="speak", delay=0.3),),
            (),
        )
    ]

    assert answers == ["pending", "none", None, "speak", None]


def test_the_fragments_of_a_turn_are_told_together_each_event_in_its_last_state() -> None:
    begun = event("adjacency_pair", "started", "f-1", id="pair")
    first = outcome("f-1", spoken=said("So,"), events=(begun,), warnings=("late", "late"))
    decided = event("adjacency_pair", "succeeded", "f-1", id="pair", response="nod", delay=0.5)
    last = outcome(
        "f-2", "failed", spoken=said("take it."), events=(decided,), eye_contact=True, fault=Fault(reason="stuck")
    )

    told = summary(first, last)

    assert (told.status, told.said, told.answer, told.eye_contact) == ("failed", "So, take it.", "nod", True)
    assert told.problems == ("late", "stuck")


def test_a_refusal_says_why_and_that_nothing_happened() -> None:
    fault = Fault(reason="no 'cop'", where="$.parts[1].refer", advice="did you mean 'cup'?")
    told = summary(outcome(status="refused", fault=fault))

    assert told == Summary(status="refused", problems=("$.parts[1].refer: no 'cop' (did you mean 'cup'?)",))
    assert told.text.startswith("Refused, nothing was said or done. Problems: ")


def test_many_long_problems_stay_short() -> None:
    told = summary(outcome(warnings=tuple(f"{index} {'x' * 500}" for index in range(9))))

    assert [len(problem) for problem in told.problems] == [LONGEST_PROBLEM] * 4 + [len("and 5 more")]
    assert len(told.json) < 800


def test_nothing_is_told_of_nothing() -> None:
    assert summary() == Summary(status="done")
    assert summary().text == "Nothing was said."


def test_a_gaze_event_or_a_choice_alone_is_no_deed() -> None:
    contact = event("mutual_facial_gaze", "succeeded", delay=0.0)

    assert summary(outcome(events=(contact,))).eye_contact is None
    assert summary(outcome(references=(made("nothing", phrase=""),))).references == ()


@pytest.mark.parametrize(
    ("statuses", "worst"),
    [
        (("refused",), "refused"),
        (("refused", "refused"), "refused"),
        (("done", "refused"), "failed"),
        (("interrupted", "failed"), "failed"),
        (("failed", "unknown"), "unknown"),
    ],
)
def test_a_turn_is_as_its_worst_fragment_and_refused_only_if_nothing_was_done(
    statuses: tuple[str, ...], worst: str
) -> None:
    assert summary(*(outcome(f"f-{n}", status) for n, status in enumerate(statuses))).status == worst


@pytest.mark.parametrize("status", ["done", "failed", "interrupted"])
@pytest.mark.parametrize("unsaid", [(), ("s2",)])
def test_words_left_unsaid_cut_a_turn_short_whatever_its_status(status: str, unsaid: tuple[str, ...]) -> None:
    told = summary(outcome(status=status, spoken=said("All of it."), unsaid=unsaid))

    assert told.cut_short == bool(unsaid)
    assert ("Only said" in told.text) == bool(unsaid)


def test_what_nobody_knows_is_not_told_as_refused() -> None:
    told = summary(outcome(status="unknown", fault=Fault(reason="generation is gone")))

    assert told.json == '{"status":"unknown","problems":["generation is gone"]}'
    assert told.text == (
        "A part of the robot has gone: it is unknown what became of the fragment. Problems: generation is gone."
    )


def test_of_words_that_nobody_could_tell_to_the_end_there_may_have_been_more() -> None:
    told = Summary(status="unknown", said="one two", cut_short=True)

    assert told.text == (
        'A part of the robot has gone: it is unknown what became of the fragment. Said at least: "one two".'
    )


def test_nobody_waits_for_the_answer_to_a_turn_that_ended_early() -> None:
    pending = (event("adjacency_pair", "started", turn="f"),)

    assert summary(outcome(events=pending)).answer == "pending"
    assert summary(outcome(status="failed", events=pending)).answer is None


def test_an_answer_that_nobody_can_know_is_absent_and_told() -> None:
    told = summary(outcome(events=(event("adjacency_pair", "lost"),)))

    assert (told.status, told.answer) == ("done", None)
    assert told.problems == ("the answer is not known: the service that was to tell it has gone or was restarted",)
