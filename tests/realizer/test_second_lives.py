"""Ids of blocks that are used again while blocks live that have known the first of that id.

The oracle: a story in which the second stream of blocks has the ids of the first is the same story as one in which
it has ids of its own.
"""

import re
from random import Random

import pytest
from msgspec.structs import replace

from engage_hri.services.realizer.points import LIFE
from tests.judge import generate, playing
from tests.judge.record import Record
from tests.judge.story import Deed, Story
from tests.random_cases import share_of

SECOND = 14.0
"""Seconds after which the second stream begins: most first ones are over by then."""
STORIES_TRIED = (5, 0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13)[: share_of(14, 14)]
"""Numbers of stories; in most of them the first stream is over in time. 5 alone sees an ended id freed too soon."""
BEAT = 'lexeme="BEAT" mode="RIGHT_HAND"'


def other_ids(xml: str) -> str:
    """The block with ids of its own, in what it says of itself and of others."""
    return re.sub(r"\bb(\d)(?=[\":])", r"b\1y", xml)


def shifted(deeds: tuple[Deed, ...], by: float) -> list[Deed]:
    return [replace(each, at=round(each.at + by, 2)) for each in deeds]


def renamed(deed: Deed) -> Deed:
    follows = tuple(map(other_ids_of, deed.follows))
    return replace(deed, block=other_ids_of(deed.block), xml=other_ids(deed.xml), follows=follows)


def other_ids_of(block: str) -> str:
    return re.sub(r"^b(\d)$", r"b\1y", block)


def outliving(chance: Random) -> Deed:
    """A block that comes with the first stream, is tied to it, and uses the voice and an arm beside the second."""
    begins = round(SECOND + chance.uniform(0.0, 4.0), 2)
    tie = chance.choice(('start="b0:bml:end"', 'start="b0:bml:start+1"', ""))
    xml = f"""<bml id="c" xmlns="org.mindmakers.bml"><wait id="w" duration="{begins}"/>
      <gesture id="h1" {BEAT}/><head id="n" type="NOD" {tie}/>
      <gesture id="h" {BEAT} start="w:end"/><speech id="u" start="w:end+0.2">one two three</speech></bml>"""
    return Deed(0.0, "perform", "c", xml)


def told(record: Record, names: str) -> list[str]:
    """What was seen, in words. names: a pattern of ids to be written as those of the first stream."""
    said = [f"{each.at:.6f} {each.message}" for each in record.told]
    said += [f"{each.at.seconds:.6f} {each.behavior}:{each.sync}" for each in record.reported]
    said += [f"{id} {each.at:.6f} {each.status} {each.reason}" for id, ends in record.ends.items() for each in ends]
    advice = r"(known: |did you mean )[^)]*"  # It depends on how much alike ids are.
    return sorted(re.sub(advice, "", re.sub(names, r"b\1", each)) for each in said)


@pytest.mark.contained
def test_a_story_with_ids_that_are_used_again_is_the_one_with_ids_of_their_own() -> None:
    compared = 0
    for number in STORIES_TRIED:
        chance = Random(f"second lives {number}")
        first = generate.story(40, number, "streams").deeds
        second = shifted(generate.story(41, number, "streams").deeds, SECOND)
        before = [first[0], outliving(chance), *first[1:]]
        own = playing.play(Story((*before, *map(renamed, second))))
        if any(each.at > SECOND - 1.0 for deed in first for each in own.ends.get(deed.block, [])):
            continue
        again = playing.play(Story((*before, *second)))
        expected = told(own, r"\bb(\d)y\b")
        assert told(again, r"\bb(\d)\b") == expected
        assert any("b0y" in f"{each.message}" for each in own.told)
        compared += 1

    assert compared >= -(-len(STORIES_TRIED) // 2)


B = '<bml id="b"><gesture id="g" lexeme="BEAT" mode="RIGHT_HAND"/></bml>'
STORIES = {
    "tied to what was ended": (
        Deed(0.0, "perform", "b", f"""<bml id="b"><gesture id="g" {BEAT} start="1.5"/>
            <wait id="v" duration="0.5"/></bml>"""),
        Deed(0.1, "perform", "c", f"""<bml id="c"><wait id="w" duration="30"/><gesture id="h" {BEAT} start="w:end"/>
            <head id="n" type="NOD" start="b:g:end"/></bml>"""),
        Deed(0.3, "interrupt", "b", behavior="g"),
    ),
    "waited for the arm": (
        Deed(0.0, "perform", "b", B),
        Deed(0.1, "perform", "c", f"""<bml id="c"><gesture id="h1" {BEAT}/><wait id="w" duration="30"/>
            <gesture id="h" {BEAT} start="w:end"/></bml>"""),
    ),
    "waited for the voice": (
        Deed(0.0, "perform", "b", '<bml id="b"><speech id="g">one two three</speech></bml>'),
        Deed(0.1, "perform", "c", """<bml id="c"><speech id="t">four five</speech><wait id="w" duration="30"/>
            <speech id="h" start="w:end">six seven</speech></bml>"""),
    ),
}  # fmt: skip
AGAIN = {
    "tied to what was ended": B,
    "waited for the arm": B,
    "waited for the voice": '<bml id="b"><speech id="g">one two three one two three</speech></bml>',
}


@pytest.mark.parametrize("name", STORIES)
def test_what_comes_sooner_than_planned_waits_for_a_second_block_of_an_id_as_for_any_other(name: str) -> None:
    later = (Deed(8.0, "perform", "b", AGAIN[name]), Deed(8.3, "interrupt", "c", behavior="w"))
    record = playing.play(Story((*STORIES[name], *later)))

    assert [each.status for each in record.ends["b"]] == ["done", "done"]
    assert [each.outcome.dropped for ends in record.ends.values() for each in ends if each.outcome] == [()] * 3
    points = {(each.block, each.behavior, each.sync): each.at.seconds for each in record.reported}
    assert points["c", "h", "start"] >= points["b", "g", "end"] > 9.0


def test_an_id_stays_what_its_manager_knows_in_all_that_is_told() -> None:
    first = Deed(0.0, "perform", "b", '<bml id="b"><wait id="w" duration="1"/></bml>')
    beside = Deed(0.1, "perform", "c", '<bml id="c"><wait id="w" duration="9"/></bml>')
    bad = Deed(2.0, "perform", "b", '<bml id="b"><gaze id="g" type="AT" target="nobody" required="true"/></bml>')
    own = '<bml id="b"><wait id="w" duration="1"/><head id="n" type="NOD" start="b:w:end"/></bml>'
    good = Deed(3.0, "perform", "b", own)
    tied = Deed(3.1, "perform", "d", '<bml id="d"><head id="n" type="SHAKE" start="b:n:end"/></bml>')
    record = playing.play(Story((first, beside, bad, good, tied)))

    ends = {id: [(each.status, each.reason) for each in ends] for id, ends in record.ends.items()}
    assert [status for status, _ in ends["b"]] == ["done", "refused", "done"]
    assert ends["b"][1][1].startswith("b: g, line 1: ")
    assert (ends["c"][0][0], ends["d"][0][0]) == ("done", "done")
    assert not [each for each in record.told if LIFE in f"{each.message}"]
    points = {(each.block, each.behavior, each.sync): each.at.seconds for each in record.reported}
    assert points["d", "n", "start"] == pytest.approx(points["b", "n", "end"], abs=1e-6)
