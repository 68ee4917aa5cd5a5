"""The manager's plans, played by hand: no bus, no clock, no robot."""

from collections.abc import Callable, Iterator, Sequence

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Gaze, Reference, Speech
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.recognition import EngagementLevel
from engage_hri.schemas.tables import poses_touching
from engage_hri.schemas.world import Entity
from engage_hri.services.tangram.collaboration.config import CollaborationConfig
from engage_hri.services.tangram.collaboration.plans import (
    Attendee,
    AwaitDeparture,
    AwaitPerson,
    AwaitPlacement,
    LookAround,
    Manager,
    Observe,
    Pause,
    Perform,
    Plan,
    script,
    task,
    turns,
)
from engage_hri.services.tangram.table import tangram_table

TABLE = tangram_table()
UNIVERSE = {piece.id for piece in TABLE.pieces}


def spoken(fragment: TurnFragment) -> str:
    """The words of a fragment, each reference by its first option."""
    parts = []
    for behavior in fragment.behaviors:
        match behavior:
            case Speech(text=text):
                parts.append(text)
            case Reference(options=(option, *_)):
                parts.append(option.text)
    return " ".join(parts)


class Player:
    """The robot and the human. Pieces are laid where they were asked for, but for the first `wrong` times.

    hidden: a piece that is laid nowhere, and not seen any more once it has been moved.
    people: who is there, one after the other; each leaves after eight fragments.
    level: engagement of this person. others: who else is there after so many fragments.
    """

    def __init__(
        self,
        *,
        wrong: int = 0,
        idle: int = 0,
        hidden: str = "",
        people: Sequence[str] = ("human",),
        level: EngagementLevel = "engaged",
        is_at_it: bool = False,
        others: Callable[[int], tuple[Attendee, ...]] = lambda performed: (),
    ) -> None:
        self.pieces = {piece.id: TABLE.lying(piece, piece.start) for piece in TABLE.pieces}
        self.performed: list[TurnFragment] = []
        self._wrong = wrong
        self._idle = idle
        self._hidden = hidden
        self._people = people
        self._level: EngagementLevel = level
        self._is_at_it = is_at_it
        self._others = others
        self.pauses: list[float] = []

    def play(self, plan: Plan[None]) -> list[TurnFragment]:
        answer: object = None
        for _ in range(1000):
            try:
                wish = plan.send(answer)  # type: ignore[arg-type]
            except StopIteration:
                return self.performed
            match wish:
                case Perform(fragment=fragment):
                    self.performed.append(fragment)
                    answer = None
                case Observe():
                    answer = self._seen()
                case AwaitPlacement(piece=piece):
                    answer = self._place(piece)
                case LookAround():
                    person = Attendee(self._here, self._level, is_at_it=self._is_at_it)
                    answer = (person, *self._others(len(self.performed)))
                case AwaitPerson(known=known):
                    here = self._here
                    assert known in ("", *self._people)
                    answer = here
                case AwaitDeparture():
                    answer = True
                case Pause(seconds=seconds):
                    self.pauses.append(seconds)
                    answer = None
        raise AssertionError("the plan does not end")

    @property
    def _here(self) -> str:
        return self._people[min(len(self.performed) // 8, len(self._people) - 1)]

    def _seen(self) -> tuple[Entity, ...]:
        return tuple(self.pieces.values())

    def _place(self, piece: str) -> bool:
        if self._idle:
            self._idle -= 1
            return False
        if piece == self._hidden:
            self.pieces[piece] = replace(self.pieces[piece], confidence=0.0)
            return True
        landmark = [it.target for it in self.performed[-1].behaviors if isinstance(it, Reference)][1]
        side = next(s for s in sides(spoken(self.performed[-1])))
        if self._wrong:
            self._wrong -= 1
            side = "right" if side == "top" else "top"
        poses = list(poses_touching(self.pieces[piece], self.pieces[landmark], side))  # type: ignore[arg-type]
        if poses:
            self.pieces[piece] = TABLE.lying(TABLE.piece(piece), poses[0])
        return True


def sides(words: str) -> Iterator[str]:
    yield words.partition("touching the ")[2].partition(" of")[0].removesuffix(" side")


def manager(**config: float) -> Manager:
    return Manager(CollaborationConfig(**config), TABLE)  # type: ignore[arg-type]


def scripted(player: Player) -> dict[str, TurnFragment]:
    the_manager = manager()
    return {fragment.id: fragment for fragment in player.play(script(the_manager, turns(the_manager)))}


@pytest.mark.parametrize(
    ("step", "words"),
    [
        ("step-2", "Hello, let's make a tangram."),
        (
            "step-3",
            "We are going to use the pieces on the table to make a picture together. As you can see, on the table "
            "we have: squares, triangles, a rectangle and a trapezoid of different colors.",
        ),
        ("step-4", "Okay, let's start."),
        ("step-5", "Please move the blue piece so that it is touching the top of the rectangle"),
        ("step-18", "Please move that so that it is touching the top right of the pink square"),
        ("step-20-a", "Ummmm,"),
        ("step-20-b", "good."),
        ("step-21", "Please move this so that it is touching the left side of the blue piece"),
        ("step-23-a", "Ummmm,"),
        ("step-23-b", "good."),
        ("step-24", "Look, we made an anchor."),
        ("step-25", "Thanks for playing. That was fun, goodbye."),
    ],
)
def test_the_robot_says_what_it_says_in_appendix_b(step: str, words: str) -> None:
    assert spoken(scripted(Player())[step]) == words


@pytest.mark.parametrize("mode", ["scripted", "task"])
def test_when_somebody_leaves_the_robot_goes_on_with_who_is_there_then(mode: str) -> None:
    player, the_manager = Player(people=("ann", "ben")), manager()
    plan = script(the_manager, turns(the_manager)) if mode == "scripted" else task(the_manager)
    performed = player.play(plan)
    spoken_to = [fragment.addressee for fragment in performed]

    assert set(spoken_to[:8]) == {"ann"}
    assert set(spoken_to[9:]) == {"ben"}  # the ninth may be the second half of a turn that began with ann
    assert [fragment.id for fragment in performed if fragment.id.startswith("hello-")] == ["hello-ben-1"]
    assert player.pauses.count(4.0) == 2  # each may settle


def test_the_fragments_that_look_first_are_those_of_the_transcript() -> None:
    looking = {id for id, it in scripted(Player()).items() if isinstance(it.behaviors[0], Gaze)}

    assert {"step-2", "step-4", "step-5", "step-18", "step-20-a", "step-21", "step-23-a"} <= looking
    assert looking.isdisjoint({"step-3", "step-20-b", "step-23-b", "step-24", "step-25"})


def test_thinking_holds_the_turn_with_the_eyes_on_the_table() -> None:
    fragments = scripted(Player())

    begin, end = fragments["step-20-a"], fragments["step-20-b"]
    assert (begin.turn_status, begin.delay, begin.delay_target) == ("beginning", True, "table")
    assert (end.turn_status, end.delay) == ("end", False)


def test_manipulation_answers_only_what_asks_for_it() -> None:
    accepting = {id for id, fragment in scripted(Player()).items() if "act" in fragment.accept}

    assert {"step-5", "step-18", "step-21"} <= accepting
    assert accepting.isdisjoint({"step-2", "step-3", "step-4", "step-20-a", "step-24", "step-25"})


def test_references_have_the_parameters_of_the_scenario() -> None:
    fragments = scripted(Player())
    references = {
        (id, it.target): (it.minimum_reliability, [(o.text, o.cost, o.deictic) for o in it.options])
        for id, fragment in fragments.items()
        for it in fragment.behaviors
        if isinstance(it, Reference) and id in ("step-3", "step-5", "step-18", "step-21")
    }

    assert references == {
        ("step-3", "rectangle"): (0.85, [("a rectangle", 2.0, False)]),
        ("step-3", "trapezoid"): (0.95, [("a trapezoid", 2.0, False)]),
        ("step-5", "blue-square"): (0.95, [("the blue piece", 3.0, False)]),
        ("step-5", "rectangle"): (0.85, [("the rectangle", 2.0, False)]),
        ("step-18", "purple-triangle"): (0.95, [("that", 1.0, True), ("the purple triangle", 3.0, False)]),
        ("step-18", "pink-square"): (0.85, [("the pink square", 3.0, False)]),
        ("step-21", "green-square"): (0.95, [("this", 1.0, True), ("the green piece", 3.0, False)]),
        ("step-21", "blue-square"): (0.85, [("the blue piece", 3.0, False)]),
    }


def test_a_deictic_phrase_could_mean_any_other_piece() -> None:
    that = next(it for it in scripted(Player())["step-18"].behaviors if isinstance(it, Reference)).options[0]

    assert set(that.distractors) == UNIVERSE - {"purple-triangle"}


def test_a_misplaced_piece_is_asked_to_be_fixed() -> None:
    fragments = scripted(Player(wrong=1))

    assert list(fragments)[3:6] == ["step-5", "step-5-fix", "step-7-ours-a"]
    fix = spoken(fragments["step-5-fix"])
    assert fix == "Please fix the blue piece so that it is touching the top of the rectangle"


def test_a_request_that_nobody_follows_comes_with_help_and_then_in_other_words() -> None:
    fragments = scripted(Player(idle=2))

    assert list(fragments)[3:7] == ["step-5", "step-5-help", "step-5-again-2", "step-7-ours-a"]
    where = "the blue piece so that it is touching the top of the rectangle"
    assert spoken(fragments["step-5"]) == f"Please move {where}"
    assert spoken(fragments["step-5-help"]) == (f"May I help you? I show you what comes next. Please put {where}")
    assert spoken(fragments["step-5-again-2"]) == f"Let us try it together. Can you put {where}"


def test_who_is_helped_is_shown_the_piece_and_its_place() -> None:
    shown = [it for it in scripted(Player(idle=1))["step-5-help"].behaviors if isinstance(it, Reference)]

    assert [(it.target, it.minimum_reliability) for it in shown] == [("blue-square", 0.95), ("rectangle", 0.95)]


@pytest.mark.parametrize(
    ("level", "is_at_it", "is_let_go"),
    [
        ("disengaged", False, True),
        ("disengaged", True, False),
        ("disengaging", False, False),
        ("engaged", False, False),
    ],
)
def test_who_follows_no_request_and_attends_no_more_is_let_go(
    level: EngagementLevel, is_at_it: bool, is_let_go: bool
) -> None:
    """Who looks at the pieces thinks."""
    player = Player(idle=1000, level=level, is_at_it=is_at_it)

    performed = player.play(task(manager()))

    assert (spoken(performed[-1]) == "You have other things to do. Thank you for playing, goodbye.") is is_let_go
    assert len([it for it in performed if it.id.startswith("move-1")]) == 3  # only after three requests


def test_who_has_made_a_part_of_it_hears_so() -> None:
    player = Player()
    place = player._place

    def place_two(piece: str) -> bool:
        return place(piece) if len(player.performed) < 10 else False

    player._place = place_two  # type: ignore[method-assign]
    performed = player.play(task(manager()))

    assert spoken(performed[-2]) == "Look, we almost made an anchor."


def test_who_lays_another_piece_than_the_one_asked_for_is_not_let_go() -> None:
    player = Player(level="disengaged")

    def place_another(piece: str) -> bool:
        other = player.pieces["trapezoid"]
        player.pieces["trapezoid"] = replace(other, position=(other.position[0] + 0.1, *other.position[1:]))
        return False

    player._place = place_another  # type: ignore[method-assign]

    assert "let-go" not in {it.id for it in player.play(task(manager()))}


def test_who_comes_is_greeted_once_each_time() -> None:
    def others(performed: int) -> tuple[Attendee, ...]:
        """Ben passes by. Cem attends, is away for a while, and comes again."""
        cem = Attendee("cem", "engaging", visit=1 if performed < 10 else 2)
        return (Attendee("ben", "disengaged"), *((cem,) if 2 < performed < 6 or performed > 9 else ()))

    performed = Player(others=others).play(task(manager()))

    assert {it.addressee for it in performed} == {"human", "cem"}
    greetings = [(it.id, spoken(it)) for it in performed if it.addressee == "cem"]
    assert greetings == [
        ("hello-cem-1", "Hello, we are making a tangram."),
        ("hello-cem-2", "Hello again, let us go on."),
    ]


def test_a_piece_that_is_not_seen_any_more_is_asked_for_again_and_never_for_a_fix() -> None:
    fragments = scripted(Player(hidden="blue-square"))

    assert list(fragments)[3:7] == ["step-5", "step-5-help", "step-5-again-2", "step-7-ours-a"]


def test_what_is_right_when_it_is_seen_again_needs_no_placement() -> None:
    player = Player(idle=1)
    place = player._place

    def unseen(piece: str) -> bool:
        """It was laid where it belongs, but nobody saw it being moved."""
        place(piece)
        return place(piece) and False

    player._place = unseen  # type: ignore[method-assign]

    assert not [id for id in scripted(player) if "help" in id]


def test_a_human_who_does_nothing_does_not_stop_the_manager() -> None:
    assert "step-25" in scripted(Player(idle=1000))


def test_the_task_makes_the_figure_by_itself() -> None:
    player = Player()

    performed = player.play(task(manager()))

    assert len([it for it in performed if it.id.startswith("move-")]) == 9
    assert "finished" in {it.id for it in performed}
    assert manager().goal.placed(player.pieces.values()) == UNIVERSE


def test_the_task_gives_a_piece_up_after_its_attempts_and_says_so() -> None:
    player = Player(idle=1000)

    performed = player.play(task(manager()))

    assert spoken(performed[-2]) == "Let us make the anchor another time."
    assert {it.id.partition("-again")[0] for it in performed if "again" in it.id} == {"move-1", "move-2"}


def test_every_fragment_is_a_legal_one() -> None:
    from engage_hri.schemas.check import check

    for fragment in scripted(Player(wrong=1, idle=1)).values():
        check(fragment)
