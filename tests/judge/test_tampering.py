"""The judge is judged: something is changed in what was seen of a story that breaks no law, and it notices."""

from collections.abc import Callable
from functools import cache
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress, WarningFeedback
from engage_hri.schemas.body import Ray
from tests.judge import laws_motion, playing, reading
from tests.judge.laws import LAWS, judge
from tests.judge.record import Record, Steered, Told
from tests.judge.story import Deed, Story

EVERYTHING = f"""<bml id="b" xmlns="{reading.BML_1_0}">
<gaze id="g" target="cup" start="0.5" end="3"/>
<pointing id="p" target="cup" mode="LEFT_HAND" stroke="s:m+0.2"/>
<gesture id="q" lexeme="BEAT" mode="RIGHT_HAND" start="1"/>
<head id="n" lexeme="NOD" start="g:ready+0.5"/>
<faceLexeme id="f" lexeme="SMILE" attackPeak="2"/>
<speech id="s" start="0.5"><text>This cup <sync id="m"/>here, please.</text></speech>
<speech id="t"><text>And then that.</text></speech>
<constraint><after ref="n:end"><sync ref="w:start"/></after></constraint>
<wait id="w" duration="0.5"/>
<wait id="v" duration="0.7"/>
<gaze id="lost" target="nothing"/>
</bml>"""
LATER = f"""<bml id="c" xmlns="{reading.BML_1_0}">
<posture id="o" start="b:t:end+0.2"><pose part="WHOLEBODY" lexeme="LEAN_FORWARD"/></posture></bml>"""
STORY = Story((Deed(0.0, "perform", "b", EVERYTHING), Deed(0.2, "perform", "c", LATER)))
NECESSARY = f"""<bml id="b" xmlns="{reading.BML_1_0}"><wait id="w" duration="1" required="true"/></bml>"""
SENTENCES = f"""<bml id="b" xmlns="{reading.BML_1_0}"><speech id="s"><text>One.</text></speech>
<speech id="t"><text>Two three.</text></speech><head id="n" lexeme="NOD" start="s:end"/></bml>"""


@cache
def seen(xml: str, *, asks: bool = False) -> Record:
    return playing.play(one(xml), asks=asks)


def one(xml: str) -> Story:
    return STORY if xml == EVERYTHING else Story((Deed(0.0, "perform", "b", xml),))


def found(xml: str, tamper: Callable[[Record], Record], *, asks: bool = False) -> set[str]:
    record = tamper(seen(xml, asks=asks))
    return {each.law for each in judge(one(xml), record)}


# -- what can be changed ---------------------------------------------------------------------------------------------


def points(change: Callable[[SyncPointProgress], SyncPointProgress | None]) -> Callable[[Record], Record]:
    """Change or take out points."""

    def tamper(record: Record) -> Record:
        told = []
        for each in record.told:
            message = each.message
            new = change(message) if isinstance(message, SyncPointProgress) else message
            if new is not None:
                told.append(replace(each, message=new))
        return replace(record, told=told)

    return tamper


def shifted(name: str, seconds: float) -> Callable[[Record], Record]:
    """Shift one point, or all of a behavior."""
    behavior, _, sync = name.partition(":")

    def change(point: SyncPointProgress) -> SyncPointProgress:
        if point.behavior != behavior or sync not in ("", point.sync):
            return point
        at = replace(point.at, seconds=point.at.seconds + seconds)
        return replace(point, at=at, time=point.time + seconds)

    return points(change)


def without(name: str) -> Callable[[Record], Record]:
    return points(lambda point: None if f"{point.behavior}:{point.sync}" == name else point)


def told(change: Callable[[list[Any]], list[Any]]) -> Callable[[Record], Record]:
    return lambda record: replace(record, told=change(list(record.told)))


def twice(name: str) -> Callable[[Record], Record]:
    def change(messages: list[Any]) -> list[Any]:
        return [each for each in messages for _ in range(2 if _is_point(each.message, name) else 1)]

    return told(change)


def after_the_end(name: str) -> Callable[[Record], Record]:
    def change(messages: list[Any]) -> list[Any]:
        late = [each for each in messages if _is_point(each.message, name)]
        return [each for each in messages if each not in late] + late

    return told(change)


def without_warnings(messages: list[Any]) -> list[Any]:
    return [each for each in messages if not isinstance(each.message, WarningFeedback)]


def another_status(messages: list[Any]) -> list[Any]:
    return [
        replace(each, message=replace(each.message, status="failed"))
        if isinstance(each.message, BlockProgress) and each.message.progress == "end"
        else each
        for each in messages
    ]


def busy(messages: list[Any]) -> list[Any]:
    """Someone else spoke when the first speech was to begin."""
    message = WarningFeedback(
        block="b", kind="CANNOT_CREATE_BEHAVIOR", behavior="s", message="s: the voice is busy with 'No'"
    )
    return [Told(0.4, message), *messages]


def robbed(messages: list[Any]) -> list[Any]:
    """Someone took the arm of the first gesture."""
    message = "another behavior took its part after ready"
    return [*messages, Told(9.0, WarningFeedback(block="b", kind="EXECUTION_FAILURE", behavior="q", message=message))]


def ends(change: Callable[[list[Any]], list[Any]]) -> Callable[[Record], Record]:
    return lambda record: replace(record, ends={**record.ends, "b": change(record.ends["b"])})


def outcome(**fields: Any) -> Callable[[Record], Record]:
    return ends(lambda all: [replace(all[0], outcome=replace(all[0].outcome, **fields))])


def spoken(text: Callable[[str], str]) -> Callable[[Record], Record]:
    def change(all: list[Any]) -> list[Any]:
        said = tuple(replace(each, text=text(each.text)) for each in all[0].outcome.spoken)
        return [replace(all[0], outcome=replace(all[0].outcome, spoken=said))]

    return ends(change)


def still(*prefixes: str) -> Callable[[Record], Record]:
    """The joints with these names have never moved."""

    def tamper(record: Record) -> Record:
        columns, first = record.columns(*prefixes), record.samples[0]
        samples = []
        for each in record.samples:
            joints = tuple(first.joints[n] if n in columns else angle for n, angle in enumerate(each.joints))
            gaze = first.gaze if "neck" in prefixes else each.gaze
            arms = tuple(
                start if f"{side}_" in prefixes else arm
                for side, start, arm in zip(("left", "right"), first.arms, each.arms, strict=True)
            )
            samples.append(replace(each, joints=joints, gaze=gaze, arms=arms))
        return replace(record, samples=samples)

    return tamper


def aside(record: Record) -> Record:
    """The left forearm has always been two hands' breadths beside where it was."""

    def moved(ray: Ray) -> Ray:
        x, y, z = ray.origin
        return replace(ray, origin=(x, y + 0.15, z))

    return replace(
        record, samples=[replace(each, arms=(moved(each.arms[0]), each.arms[1])) for each in record.samples]
    )


def raised(record: Record) -> Record:
    last = record.samples[-1]
    joints = tuple(angle + 0.2 for angle in last.joints)
    return replace(record, samples=[*record.samples[:-1], replace(last, joints=joints)])


def _is_point(message: object, name: str) -> bool:
    return isinstance(message, SyncPointProgress) and f"{message.behavior}:{message.sync}" == name


def swapped(text: str) -> str:
    first, second, *rest = text.split(" ")
    return " ".join((second, first, *rest))


def held(behavior: str, since: float = -0.5) -> Callable[[Record], Record]:
    """A behavior has been held for a while; since: seconds after its start."""

    def tamper(record: Record) -> Record:
        start = next(each for each in record.points("b") if (each.behavior, each.sync) == (behavior, "start"))
        times = (start.at.seconds + since, True), (start.at.seconds + 8.0, False)
        return replace(record, steered=[Steered(at, is_held, "b", behavior) for at, is_held in times])

    return tamper


# -- the claims ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("xml", "asks"), [(EVERYTHING, False), (NECESSARY, False), (SENTENCES, True)])
def test_untouched_they_break_no_law(xml: str, asks: bool) -> None:
    assert found(xml, lambda record: record, asks=asks) == set()


TAMPERED = [
    ("a point is told 0.3 s later", shifted("g:end", 0.3), "broken"),
    ("a mark is told 0.3 s earlier", shifted("s:m", -0.3), "broken"),
    ("a point is told 0.05 s later", shifted("g:end", 0.05), "inexact"),
    ("an order is not kept", shifted("w:start", -0.3), "broken"),
    ("a point that nobody has timed is 0.03 s off", shifted("q:end", 0.03), "off its prediction"),
    ("what is tied to another block comes too early", shifted("o:start", -0.3), "broken across blocks"),
    ("a point is not told", without("p:stroke"), "points"),
    ("the last point is not told", without("q:end"), "points"),
    ("a point is told twice", twice("n:stroke"), "points"),
    ("a point goes back in time", shifted("n:relax", -1.0), "points"),
    ("a point is told after the end", after_the_end("q:end"), "points"),
    ("words are swapped", spoken(swapped), "words"),
    ("a word is missing", spoken(lambda text: text.rpartition(" ")[0]), "words"),
    ("a loss has no warning", told(without_warnings), "losses"),
    ("a loss is not told at all", outcome(dropped=()), "points"),
    ("the feedback tells another end", told(another_status), "end"),
    ("there are two ends", ends(lambda all: [*all, *all]), "end"),
    ("there is no end", ends(lambda all: []), "hang"),
    ("an arm that points has never moved", still("left_"), "pointless"),
    ("an arm that points passes beside its target", aside, "pointless"),
    ("an arm that beats has never moved", still("right_"), "pointless"),
    ("a stroke is told when the arm has not got there", shifted("q:stroke", -0.85), "pointless"),
    ("a neck that looks and nods has never moved", still("neck"), "pointless"),
    ("a face has never moved", still(*laws_motion.FACE), "pointless"),
    ("a torso has never moved", still("torso"), "pointless"),
    ("the end of a stroke comes with the stroke", shifted("q:strokeEnd", -0.29), "unmade end of a stroke"),
    ("a wait takes longer", shifted("v:end", 0.3), "wrong length"),
    ("a face does not last", shifted("f:relax", -1.0), "left too early"),
    ("a wait does not wait for the one before it", shifted("v", -1.0), "out of turn"),
    ("two speeches are said at once", shifted("t", -0.8), "parts"),
    ("an arm is still raised in the end", raised, "in the air"),
    ("something begins while it is held", held("q"), "moves though held"),
    ("a voice goes on while it is held", held("s", since=0.01), "moves though held"),
    ("a word is said twice", lambda record: replace(record, words=[*record.words, record.words[-1]]), "words"),
    ("words are lost to another block", told(busy), "talked over"),
    ("a stroke is lost to another behavior", told(robbed), "robbed"),
    ("a bug was logged", lambda record: replace(record, errors=["KeyError"]), "crash"),
]  # fmt: skip


def test_every_law_is_tried() -> None:
    elsewhere = {"required", "spoken order", "needless loss", "broken, point was past", "late for a hold"}

    assert {law for *_, law in TAMPERED} | elsewhere == LAWS.keys()


@pytest.mark.parametrize(("tamper", "law"), [each[1:] for each in TAMPERED], ids=[each[0] for each in TAMPERED])
def test_the_judge_notices_that(tamper: Callable[[Record], Record], law: str) -> None:
    assert law in found(EVERYTHING, tamper)


def test_something_required_was_dropped() -> None:
    assert "required" in found(NECESSARY, outcome(dropped=("w",)))


def test_sentences_came_in_another_order() -> None:
    def exchanged(record: Record) -> Record:
        return shifted("s", 1.0)(shifted("t", -1.0)(record))

    assert "spoken order" in found(SENTENCES, exchanged, asks=True)


def test_a_sentence_was_dropped_that_could_be_said() -> None:
    assert "needless loss" in found(SENTENCES, outcome(dropped=("n",)), asks=True)


def test_a_block_was_refused_that_could_be_said() -> None:
    refused = ends(lambda all: [replace(all[0], status="refused", outcome=None)])

    assert "needless loss" in found(SENTENCES, refused, asks=True)


def test_a_point_that_was_past_is_asked_for_in_vain() -> None:
    late = f'<bml id="c" xmlns="{reading.BML_1_0}"><wait id="v" duration="1" start="b:w:start"/></bml>'
    story = Story((Deed(0.0, "perform", "b", NECESSARY), Deed(0.5, "perform", "c", late)))
    record = told(without_warnings)(playing.play(story))

    assert {each.law for each in judge(story, record)} == {"broken, point was past"}


@pytest.mark.parametrize(("seconds", "laws"), [(0.09, {"inexact"}), (0.11, {"broken"})])
def test_what_people_may_notice_is_told(seconds: float, laws: set[str]) -> None:
    assert found(EVERYTHING, shifted("g:end", seconds)) - {"off its prediction"} == laws


def test_what_was_past_by_less_than_people_notice_needs_no_word() -> None:
    near = f'<bml id="c" xmlns="{reading.BML_1_0}"><wait id="v" duration="1" start="b:w:start"/></bml>'
    story = Story((Deed(0.0, "perform", "b", NECESSARY), Deed(0.09, "perform", "c", near)))

    assert judge(story, playing.play(story)) == []


def test_something_is_late_for_a_hold() -> None:
    hold, go_on = Deed(0.3, "hold", "b"), Deed(0.9, "continue", "b")
    story = Story((Deed(0.0, "perform", "b", NECESSARY), hold, go_on))
    record = playing.play(story)
    late = WarningFeedback(block="b", kind="LATE", message="w is late", behavior="w")

    assert judge(story, record) == []
    assert {each.law for each in judge(story, replace(record, told=[*record.told, Told(1.0, late)]))} == {
        "late for a hold"
    }
