"""Names in words call the people of whom anything tells, by each of their ids and names, also of two words."""

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, Utterance
from engage_hri.schemas.recognition import Floor, SamePeople, SamePerson
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.intake import Content, Intake
from engage_hri.services.runtime.intake import Input, PublishMessage, StepClock
from engage_hri.services.text.calling import called as named
from tests.recognition.observations import ROBOT, stamp


class Group:
    """Recognition to which perception tells of people; bob says something."""

    def __init__(self, *same: SamePerson) -> None:
        self._intake = Intake(ROBOT, RecognitionConfig(), StepClock("loop"), "s")
        self._floors: list[Floor] = []
        if same:
            self._take("", SamePeople(at=stamp(0.0), people=same), 0.0)
        self._take(keys.PERCEIVED_ACTION, ActorFound(actor="bob", at=stamp(0.0)), 0.0)

    def _take(self, key: str, message: Content, at: float) -> None:
        outputs = self._intake.take(Input(key, message, "camera", at), at)
        self._floors += [
            output.message
            for output in outputs
            if isinstance(output, PublishMessage) and isinstance(output.message, Floor)
        ]

    def found(self, actor: str, at: float = 0.0, *, same_as: str = "") -> None:
        self._take(keys.PERCEIVED_ACTION, ActorFound(actor=actor, at=stamp(at), same_as=same_as), at)

    def sees(self, *people: tuple[str, str], at: float = 0.0) -> None:
        """People of the world, each with a name."""
        entities = (Entity(id=id, name=name, kind="person", position=(1.0, 0.0, 1.0)) for id, name in people)
        self._take(keys.WORLD, World(entities=tuple(entities)), at)

    def to(self, words: str, since: float = 3.0) -> tuple[str, ...]:
        """Those to whom bob says this, as it is told when it is over. It takes a second from `since` on."""
        began, until, known = stamp(since), stamp(since + 1.0), stamp(since + 1.4)
        id = f"u{since}"
        self._take(keys.PERCEIVED_ACTION, ActionBegan(actor="bob", action="speak", at=began), since)
        heard = Utterance(actor="bob", id=id, text="so", began=began, at=stamp(since + 0.5), final=False)
        self._take(keys.UTTERANCE, heard, since + 0.5)
        self._take(keys.PERCEIVED_ACTION, ActionEnded(actor="bob", action="speak", at=until), since + 1.0)
        before = self._floors[-1]
        said = Utterance(actor="bob", id=id, text=words, began=began, ended=until, at=known, final=True)
        self._take(keys.UTTERANCE, said, since + 1.4)
        told = self._floors[-1]
        assert (before.speeches, told.speeches) == ((), ())
        return next((each.to for each in told.ended if (each.since, each.until) == (began, until)), ())


def test_who_is_only_found_has_a_name() -> None:
    group = Group()
    group.found("ann")

    assert group.to("Ann, look at that") == ("ann",)


@pytest.mark.parametrize("called", ["Ann", "face_3", "Face 3"])
@pytest.mark.parametrize("knows_both", [False, True])
def test_who_turns_out_to_be_ann_is_called_so(called: str, knows_both: bool) -> None:
    group = Group()
    group.found("face_3")
    if knows_both:
        group.found("ann", 0.2)
    group.found("face_3", 0.5, same_as="ann")

    assert group.to(f"{called}, look at that") == ("ann",)


def test_who_was_taken_for_ann_by_mistake_is_called_by_no_name_of_hers() -> None:
    group = Group()
    group.found("ann")
    group.found("face_3", 0.5, same_as="ann")
    group.found("face_3", 0.7, same_as="face_3")

    assert group.to("Ann, look at that") == ("ann",)


def test_who_was_joined_in_a_former_life_is_called_so() -> None:
    group = Group(SamePerson(actor="face_3", name="ann", is_guess=False))
    group.found("face_3")

    assert group.to("Ann, look at that") == ("ann",)


@pytest.mark.parametrize("words", ["Mary Ann, look", "look, Mary Ann", "look at that, mary ann!"])
def test_a_name_of_two_words_calls_one_person(words: str) -> None:
    group = Group()
    group.sees(("p1", "Mary Ann"), ("ann", ""), ("mary", ""))

    assert group.to(words) == ("p1",)


@pytest.mark.parametrize("words", ["Bob", "I am Bob", "Bob is what they call me"])
def test_who_says_the_own_name_speaks_to_whoever_listens(words: str) -> None:
    alone, group = Group(), Group()
    group.found("ann")

    assert alone.to("Hello there") == (ROBOT,)
    assert alone.to(words, 6.0) == (ROBOT,)
    assert group.to(words) == ()
    assert group.to(f"{words}, Ann", 9.0) == ("ann",)


@pytest.mark.parametrize(
    ("words", "called"),
    [
        ("Mary, look", {"mary"}),
        ("Mary, Ann, look", {"mary"}),
        ("mary ann", {"mary ann"}),
        ("I have told Mary Ann", set()),
        ("Look, Ann", {"ann"}),
        ("Hey Ann, look at that", {"ann"}),
        ("Excuse me, Mary Ann, can you see it", {"mary ann"}),
        ("oh mary will never see it", {"mary"}),
        ("Hey, I have told Mary about it", set()),
        ("hello", set()),
        ("マリさん、見て", {"マリ"}),
        ("ねえ、マリちゃん、見て", {"マリ"}),
        ("赤いのを取って、マリ様。", {"マリ"}),
        ("さん、見て", set()),
        ("マリさんが来た。それでも、これもいい", set()),
        ("Ann-san, look at that", {"ann"}),
        ("マリ、見て", {"マリ"}),
        ("赤いのを取って、マリ。", {"マリ"}),
        ("赤いのを取って。でも、これもいい。それはマリ", set()),
        ("看，那个红的，在那里，马力。", {"马力"}),
        ("", set()),
    ],
)  # fmt: skip
def test_words_call_whom_they_name(words: str, called: set[str]) -> None:
    assert named(words, {name: name for name in ("mary", "ann", "mary ann", "マリ", "马力")}) == called


def test_without_names_nobody_is_called() -> None:
    assert named("Ann, look", {}) == set()
