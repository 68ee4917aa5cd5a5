"""People who talk among themselves, and a robot that asks them: what recognition makes of it, by the truth."""

import random
import re
from collections import Counter
from itertools import pairwise

import pytest

from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, Utterance
from engage_hri.services.simulation.party import ANY_ANSWER, NAMES, TALK, Party, Saying, ScriptLine, answer
from engage_hri.services.tangram.collaboration.host import QUESTIONS
from tests.recognition.observations import ROBOT, stamp
from tests.simulation.party_play import Play

SEEDS = 20
LASTS = 180.0
OVER = 15.0
"""Seconds after which all is decided."""


def judged(play: Play) -> Counter[str]:
    """What recognition told of pairs, by the truth."""
    truth = {(said.actor, round(said.began, 4)): said for said in play.said}
    ends = {round(question.began, 4): question.ended for question in play.questions}
    found: set[Saying] = set()
    counted = Counter(said=len(play.said), to_others=sum(said.to != ROBOT for said in play.said))
    for event in play.events:
        if event.kind != "adjacency_pair":
            continue
        began = round(event.started.seconds, 4)
        if event.initiator != ROBOT and event.state == "started" and not event.retold:
            counted["pairs of people"] += 1
            counted["pairs of what was said to others"] += truth[event.initiator, began].to != ROBOT
        elif event.initiator == ROBOT and event.response == "speak" and event.state != "completed":
            assert event.delay is not None
            said = truth[event.answered_by or event.responder, round(ends[began] + event.delay, 4)]
            found.add(said)
            counted["answers of what was said to others"] += said.to != ROBOT
    answers = [said for said in play.said if said.kind == "answer" and said.began < LASTS]
    counted["answers"] = len(answers)
    counted["answers found"] = sum(said in found for said in answers)
    return counted


@pytest.mark.parametrize("tells", [True, False], ids=["addressees told", "looks only"])
def test_what_is_said_to_others_is_not_the_robots_and_its_questions_are_answered(
    tells: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    told: Counter[str] = Counter()
    for seed in range(SEEDS):
        play = Play(2 + seed % 4, seed, tells=tells)
        play.until(LASTS + OVER)
        told += judged(play)
    with capsys.disabled():
        print(f"\n{SEEDS} parties of 2 to 5, {LASTS:.0f} s each, addressees {'told' if tells else 'unknown'}: {told}")

    wrong = told["pairs of what was said to others"] + told["answers of what was said to others"]
    assert told["to_others"] > 1000
    assert wrong <= (0 if tells else 0.02 * told["to_others"])
    assert told["answers found"] >= (0.95 if tells else 0.9) * told["answers"]


def test_what_they_say_fits_what_was_said_to_them() -> None:
    play = Play(3, 4)
    play.until(600.0)
    talk = [said for said in play.said if said.kind in ("talk", "answer")]
    replies = 0
    for before, said in pairwise(talk):
        opened = before.words.rstrip(".").rsplit(", ", 1)[-1]
        if said.to == before.actor and opened in TALK:
            assert said.words.rstrip(".").split(", ", 1)[0] in TALK[opened]
            replies += 1

    assert replies > 40


@pytest.mark.parametrize("question", QUESTIONS)
def test_each_question_of_the_host_has_answers_of_its_own(question: str) -> None:
    heard = re.sub(r"[^a-z ]", "", f"ann {question}".lower())

    assert answer(heard, random.Random(1)) not in ANY_ANSWER


def test_a_seed_gives_the_same_party_and_another_another() -> None:
    def heard(seed: int) -> tuple[list[Saying], list[Message]]:
        play = Play(3, seed)
        play.until(60.0)
        return play.said, play.messages

    assert heard(1) == heard(1)
    assert heard(1) != heard(2)


def test_they_talk_over_each_other_as_people_do() -> None:
    """A third of their turns begin before the one before has ended; most are for somebody else than the robot."""
    gaps, to_robot, turns = [], 0, 0
    for seed in range(SEEDS):
        play = Play(4, seed)
        play.until(LASTS)
        said = [each for each in play.said if each.kind in ("talk", "answer")]
        gaps += [then.began - one.ended for one, then in pairwise(said)]
        to_robot += sum(each.to == ROBOT for each in said)
        turns += len(said)

    assert 0.25 < sum(gap < 0 for gap in gaps) / len(gaps) < 0.5
    assert 0.05 < to_robot / turns < 0.4


def test_nobody_says_two_things_at_once_and_looks_away_are_short() -> None:
    play = Play(5, 7)
    play.until(LASTS)

    for person in play.party.people:
        said = [each for each in play.said if each.actor == person]
        assert all(one.ended <= then.began for one, then in pairwise(said))
        looks = [
            each
            for each in play.messages
            if isinstance(each, ActionBegan) and each.action == "look" and each.actor == person
        ]
        away = [
            then.at.seconds - one.at.seconds
            for one, then in pairwise(looks)
            if not one.targets
        ]  # fmt: skip
        assert 0.4 < sorted(away)[len(away) // 2] < 1.3
        assert max(away) <= 3.0


def test_who_is_spoken_to_gives_feedback_and_most_are_silent_while_the_robot_speaks() -> None:
    signs, questions, talked_into = 0, 0, 0
    for seed in range(3):
        play = Play(4, seed)
        play.until(LASTS)
        turns = [said for said in play.said if said.kind in ("talk", "answer")]
        for sign in play.said:
            if sign.kind == "feedback" and sign.to != ROBOT:
                signs += 1
                assert any(said.actor == sign.to and said.began < sign.began < said.ended for said in turns)
        questions += len(play.questions)
        talked_into += sum(
            any(said.kind == "talk" and question.began < said.began < question.ended for said in turns)
            for question in play.questions
        )

    assert signs > 10
    assert 0 < talked_into < 0.3 * questions


def test_a_script_says_who_says_what_to_whom() -> None:
    script = [ScriptLine("ann", "bob", "Is that yours?"), ScriptLine("bob", "ann", "No, it is hers.", after=-0.2)]
    party = Party(NAMES[:2], random.Random(1), script=script, tells=True)
    party.begin(0.0)
    told = []
    while (at := party.deadline) is not None and at < 10.0:
        told += list(party.advance(at, stamp(at)))

    talk = [each for each in party.said if each.kind == "talk"]
    assert [(each.actor, each.to, each.words) for each in talk] == [(x.actor, x.to, x.words) for x in script]
    assert talk[1].began == pytest.approx(talk[0].ended - 0.2)
    words = [each for each in told if isinstance(each, Utterance) and each.final]
    assert [(each.actor, each.to, each.text) for each in words if each.text in (x.words for x in script)] == [
        (x.actor, (x.to,), x.words) for x in script
    ]


def test_who_goes_on_at_once_keeps_the_words_of_both() -> None:
    party = Party(
        NAMES[:2], random.Random(1), script=[ScriptLine("ann", "bob", "One."), ScriptLine("ann", "bob", "Two.", 0.05)]
    )
    party.begin(0.0)
    told = []
    while (at := party.deadline) is not None and at < 10.0:
        told += list(party.advance(at, stamp(at)))

    assert [each.text for each in told if isinstance(each, Utterance) and each.final and each.actor == "ann"] == [
        "One.", "Two.",
    ]  # fmt: skip
