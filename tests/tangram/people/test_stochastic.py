"""The person who looks, answers and errs by chance: how often, how fast, and what changes it."""

import random
from statistics import mean
from typing import Any

import pytest

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorLost
from engage_hri.schemas.units import Stamp
from engage_hri.schemas.world import World
from engage_hri.services.tangram.people.person_at_table import PersonAtTable
from engage_hri.services.tangram.people.stochastic import Habits, StochasticHuman
from engage_hri.services.tangram.people.table import Table
from engage_hri.services.tangram.table import tangram_table

ROBOT, HUMAN = "robot", "human"
QUIET = {"looks_up_every": 1e6, "directs_every": 1e6, "backchannels": 0.0, "reports": 0.0}
"""Nothing of their own accord."""
SWIFT = {"hesitates": (0.3, 0.3, 0.3), "fits": (0.0, 0.0, 0.0), "pace": (1.0, 1.0, 1.0)}
"""No time but that of the hand's way."""
PERFECT = {**QUIET, "answers_turn": 1.0, "hears": 1.0, "confuses": 0.0, "confuses_shown": 0.0, "misplaces": 0.0}
BLUE = "Please move the blue piece so that it is touching the top of the rectangle."
THIS = "Please move this so that it is touching the top of the rectangle."
WHITE = "Please move the trapezoid so that it is touching the top of the blue piece."


class Watch:
    """The person at the table with somebody who plays the robot. Time goes as told."""

    def __init__(self, seed: int = 0, reciprocity: float = 0.05, **habits: Any) -> None:
        self.table = Table(tangram_table())
        theirs = Habits(**{**SWIFT, **habits})
        self.human = StochasticHuman(tangram_table(), theirs, reciprocity, random.Random(seed), ROBOT)
        self.scene = PersonAtTable(self.human, self.table, robot=ROBOT, frame=1 / 15, stamp=stamp)
        self.seen: list[Message] = []
        self.now = 0.0
        self.blocks = 0
        self.scene.enter(0.0)
        self.until(5.0)

    def until(self, now: float) -> None:
        while (deadline := self.scene.deadline) is not None and deadline <= now:
            self.seen += self.scene.advance(deadline)
        self.now = now

    def wait(self, seconds: float) -> None:
        self.until(self.now + seconds)

    def robot(self, action: Action, target: str, seconds: float = 1.0) -> None:
        """The robot looks or points at something for a while."""
        began = ActionBegan(actor=ROBOT, action=action, targets=(target,), at=stamp(self.now))
        self.scene.feed(began, self.now)
        self.wait(seconds)
        ended = ActionEnded(actor=ROBOT, action=action, targets=(target,), at=stamp(self.now))
        self.scene.feed(ended, self.now)

    def says(self, text: str, pointing_at: str = "") -> float:
        """The robot says something, and perhaps points meanwhile. When it has ended."""
        self.blocks += 1
        block = f"block-{self.blocks}"
        if pointing_at:
            self.scene.feed(ActionBegan(actor=ROBOT, action="point", targets=(pointing_at,), at=stamp(0.0)), self.now)
            self.wait(2.5)
        for word in text.split():
            self.wait(0.3)
            spoken = WordSpoken(block=block, behavior="speech", word=word, position=0, at=stamp(self.now))
            self.scene.feed(spoken, self.now)
        if pointing_at:
            self.scene.feed(ActionEnded(actor=ROBOT, action="point", targets=(pointing_at,), at=stamp(0.0)), self.now)
        self.scene.feed(BlockProgress(block=block, progress="end", at=stamp(self.now), status="done"), self.now)
        return self.now

    def began(self, action: Action, target: str = "") -> list[float]:
        """When the person began to do this."""
        return [
            message.at.seconds
            for message in self.seen
            if isinstance(message, ActionBegan) and message.action == action and target in ("", *message.targets)
        ]

    @property
    def moved(self) -> list[str]:
        return [it.targets[0] for it in self.seen if isinstance(it, ActionBegan) and it.action == "act"]


def stamp(at: float) -> Stamp:
    return Stamp("loop", at)


# -- rates and delays -------------------------------------------------------------------------------------------


def follows(action: Action, trials: int = 400) -> list[float]:
    """Delays of the times when the person looked where the robot looked or pointed."""
    watch = Watch(**QUIET)
    delays = []
    for trial in range(trials):
        piece = ("blue-square", "red-square", "trapezoid")[trial % 3]
        watch.human.feed(BlockProgress(block=f"b{trial}", progress="end", at=stamp(0.0)), watch.now)
        began, before = watch.now, len(watch.began("look", piece))
        watch.robot(action, piece, 2.2)
        delays += [at - began for at in watch.began("look", piece)[before:]]
        watch.wait(3.0)
        watch.says("So.")  # a new turn
        watch.wait(3.0)
    return delays


def test_they_follow_a_point_as_often_and_as_fast_as_the_table_has_it():
    delays = follows("point")

    assert len(delays) / 400 == pytest.approx(0.929, abs=0.03)
    assert mean(delays) == pytest.approx(0.3, abs=0.06)
    assert max(delays) <= 2.0


def test_a_point_is_followed_more_often_than_a_look():
    assert len(follows("look")) / 400 == pytest.approx(0.8, abs=0.05)


def test_they_look_back_as_often_as_the_table_has_it():
    watch = Watch(**QUIET, reciprocity=0.0)
    delays = []
    for _ in range(500):
        began, before = watch.now, len(watch.began("look", ROBOT))
        watch.robot("look", HUMAN, 2.0)
        delays += [at - began for at in watch.began("look", ROBOT)[before:]]
        watch.wait(3.0)

    assert len(delays) / 500 == pytest.approx(0.458, abs=0.05)
    assert mean(delays) == pytest.approx(0.7, abs=0.06)
    assert max(delays) <= 1.5


def test_they_answer_a_turn_as_often_as_the_table_has_it():
    watch = Watch(**QUIET, hears=1.0)
    delays = []
    for _ in range(500):
        before = len(watch.began("speak")) + len(watch.began("nod"))
        ended = watch.says("Okay.")
        watch.wait(2.0)
        answers = sorted(watch.began("speak") + watch.began("nod"))[before:]
        delays += [at - ended for at in answers]

    assert len(delays) / 500 == pytest.approx(0.682, abs=0.05)
    assert mean(delays) == pytest.approx(0.4, abs=0.05)
    assert 0.0 <= min(delays) <= max(delays) <= 1.1
    assert watch.began("speak")
    assert watch.began("nod")


def test_who_is_busy_answers_little():
    rates = []
    for seed in range(150):
        watch = Watch(seed, **{**PERFECT, "answers_turn": 0.0, "study": (20.0, 30.0, 40.0), "answers_look": 0.8})
        watch.says(BLUE)
        watch.wait(2.0)
        before = len(watch.began("look", ROBOT))
        watch.robot("look", HUMAN, 2.0)
        rates.append(len(watch.began("look", ROBOT)) > before)

    assert mean(rates) == pytest.approx(0.8 * 0.25, abs=0.08)


# -- requests ---------------------------------------------------------------------------------------------------


def test_a_request_is_followed():
    watch = Watch(**PERFECT)
    ended = watch.says(BLUE)
    watch.wait(20.0)
    (began,) = watch.began("act")

    assert watch.moved == ["blue-square"]
    assert 0.9 < began - ended < 8.0
    assert watch.table.piece("blue-square", watch.now).position[:2] == pytest.approx((0.48, 0.0), abs=1e-6)


def test_a_piece_that_was_shown_need_not_be_searched():
    def times(pointing_at: str) -> list[float]:
        found = []
        for seed in range(40):
            watch = Watch(seed, **PERFECT, follows_point=1.0)
            ended = watch.says(BLUE, pointing_at)
            watch.wait(20.0)
            found.append(watch.began("act")[0] - ended)
        return found

    assert mean(times("")) - mean(times("blue-square")) == pytest.approx(1.5, abs=0.5)


def test_this_is_understood_by_who_sees_what_is_pointed_at():
    watch = Watch(**PERFECT, follows_point=1.0)
    watch.says(THIS, "blue-square")
    watch.wait(20.0)

    assert watch.moved == ["blue-square"]


def test_this_is_guessed_or_asked_for_by_who_does_not():
    unsure = {**PERFECT, "follows_point": 0.0, "follows_look": 0.0}
    asks, guesses = Watch(**unsure, guesses=0.0), Watch(**unsure, guesses=1.0)
    for watch in (asks, guesses):
        watch.says(THIS, "blue-square")
        watch.wait(20.0)

    assert asks.moved == []
    assert len(asks.began("speak")) == len(asks.began("look", ROBOT)) - 1 == 1
    assert guesses.began("speak") == []


def test_who_does_not_hear_does_nothing():
    watch = Watch(**{**PERFECT, "hears": 0.0})
    watch.says(BLUE)
    watch.wait(30.0)

    assert watch.moved == []


def test_a_confused_piece_has_the_color_or_the_shape():
    for seed in range(20):
        watch = Watch(seed, **{**PERFECT, "confuses": 1.0})
        watch.says(BLUE)
        watch.wait(20.0)
        (piece,) = watch.moved
        moved = tangram_table().piece(piece)

        assert piece != "blue-square"
        assert moved.shape == "square"


def test_a_misplaced_piece_lies_on_another_side():
    for seed in range(20):
        watch = Watch(seed, **{**PERFECT, "misplaces": 1.0})
        watch.says(BLUE)
        watch.wait(20.0)

        assert watch.moved == ["blue-square"]
        assert watch.table.piece("blue-square", watch.now).position[:2] == pytest.approx((0.69, 0.0), abs=1e-6)


def test_a_repeated_request_is_done_once_and_another_one_after_it():
    watch = Watch(**{**PERFECT, "answers_turn": 0.0, "study": (11.0, 12.0, 13.0)})
    watch.says(BLUE)
    watch.says(BLUE)
    watch.says(WHITE)
    watch.wait(30.0)

    assert watch.moved == ["blue-square", "trapezoid"]


def test_after_the_goodbye_they_leave_and_do_nothing_more():
    watch = Watch(looks_up_every=1.0, directs_every=1.0, hears=1.0)
    watch.says(BLUE)
    watch.says("Thanks for playing. That was fun, goodbye.")
    watch.wait(300.0)
    left = next(index for index, it in enumerate(watch.seen) if isinstance(it, ActorLost))

    assert watch.scene.deadline is None
    assert not [it for it in watch.seen[left + 1 :] if not isinstance(it, World)]


# -- of their own accord ----------------------------------------------------------------------------------------


def test_they_look_up_and_direct_at_their_rates():
    watch = Watch(**{**QUIET, "looks_up_every": 12.0, "directs_every": 45.0}, reciprocity=0.0)
    watch.wait(12_000.0)

    assert len(watch.began("look", ROBOT)) == pytest.approx(1000, rel=0.15)
    assert len(watch.began("point")) == pytest.approx(12_000 / 45 * 0.4, rel=0.25)
    directed = sum(len(watch.began("look", piece.id)) for piece in tangram_table().pieces)
    assert directed == pytest.approx(12_000 / 45, rel=0.2)


def test_they_direct_nobody_who_speaks():
    watch = Watch(**{**PERFECT, "directs_every": 5.0})
    watch.scene.feed(ActionBegan(actor=ROBOT, action="speak", behavior="b:s", at=stamp(5.0)), 5.0)
    watch.wait(100.0)
    meanwhile = len(watch.began("point"))
    watch.scene.feed(ActionEnded(actor=ROBOT, action="speak", behavior="b:s", at=stamp(105.0)), 105.0)
    watch.wait(100.0)

    assert meanwhile == 0
    assert len(watch.began("point")) > 2


def test_backchannels_come_while_the_robot_speaks():
    watch = Watch(**{**PERFECT, "backchannels": 0.1, "answers_turn": 0.0})
    for _ in range(100):
        watch.says("one two three four five six seven eight nine ten")
        watch.wait(1.0)
    signs = len(watch.began("nod")) + len(watch.began("speak"))

    assert signs == pytest.approx(100, rel=0.35)


def eye_contact(answered: bool, seed: int = 0, reciprocity: float = 0.05) -> tuple[StochasticHuman, list[float]]:
    """The person after fifteen minutes, and when they looked at the robot's face."""
    watch = Watch(seed, reciprocity, **{**QUIET, "looks_up_every": 6.0})
    before = len(watch.began("look", ROBOT))
    if answered:
        watch.scene.feed(ActionBegan(actor=ROBOT, action="look", targets=(HUMAN,), at=stamp(5.0)), watch.now)
    watch.wait(900.0)
    return watch.human, watch.began("look", ROBOT)[before:]


def test_looks_that_are_not_returned_become_fewer():
    looks = [at for seed in range(10) for at in eye_contact(answered=False, seed=seed)[1]]
    human, last = eye_contact(answered=False)

    assert sum(at > 600.0 for at in looks) < 0.6 * sum(at < 300.0 for at in looks)
    assert human.propensity == pytest.approx(0.95 ** (len(last) + 1))


def test_looks_that_are_returned_become_more():
    looks = [at for seed in range(10) for at in eye_contact(answered=True, seed=seed)[1]]
    human, _ = eye_contact(answered=True)

    assert sum(at > 600.0 for at in looks) > 1.2 * sum(at < 300.0 for at in looks)
    assert 1.8 < human.propensity <= 2.0


def test_without_reciprocity_they_stay_as_they_are():
    assert eye_contact(answered=False, reciprocity=0.0)[0].propensity == 1.0


# -- all of it --------------------------------------------------------------------------------------------------


def performed(seed: int) -> list[Message]:
    watch = Watch(seed)
    for _ in range(5):
        watch.robot("look", HUMAN)
        watch.says(BLUE, "blue-square")
        watch.wait(15.0)
    return watch.seen


def test_the_person_depends_on_the_seed_alone():
    assert performed(3) == performed(3) != performed(4)


@pytest.mark.parametrize("seed", range(10))
def test_whatever_they_begin_they_end_one_at_a_time(seed: int):
    under_way: dict[Action, ActionBegan] = {}
    for message in performed(seed):
        match message:
            case ActionBegan(action=action):
                assert action not in under_way
                under_way[action] = message
            case ActionEnded(action=action, targets=targets, at=at):
                began = under_way.pop(action)
                assert began.targets == targets
                assert action == "look" or 0.0 < at.seconds - began.at.seconds < 3.0


def taking(**habits: Any) -> tuple[float, float]:
    """Time from the request until the piece is in the hand, and until it lies."""
    watch = Watch(**PERFECT, search=(0.3, 0.3, 0.3), answer_delay=(0.4, 0.4, 0.4), **habits)
    asked = watch.says(BLUE)
    watch.wait(40.0)
    (lies,) = (it.at.seconds for it in watch.seen if isinstance(it, ActionEnded) and it.action == "act")
    return watch.began("act")[0] - asked, lies - asked


def test_who_hesitates_and_turns_a_piece_to_and_fro_takes_longer_and_by_their_pace():
    swift, slow = taking(), taking(hesitates=(1.3, 1.3, 1.3), fits=(4.0, 4.0, 4.0), pace=(1.0, 1.0, 1.0))
    slower = taking(hesitates=(1.3, 1.3, 1.3), fits=(4.0, 4.0, 4.0), pace=(2.0, 2.0, 2.0))

    assert slow == (pytest.approx(swift[0] + 1.0), pytest.approx(swift[1] + 1.0 + 4.0))
    # The search is slower, too.
    assert slower == (pytest.approx(slow[0] + 1.3 + 0.3), pytest.approx(slow[1] + 1.3 + 0.3 + 4.0))
