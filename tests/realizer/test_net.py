"""The net as data: what it may fire, that it lives and is safe, and that other tools can read it."""

import json
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from lxml import etree
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Event, Gaze, Pointing, Speech, Timing
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.faults import InputRefused
from engage_hri.services.realizer.export import as_dot, as_json, as_pnml, as_text, net_as_pnml
from engage_hri.services.realizer.net.petri_net import (
    Bound,
    PetriNet,
    Place,
    Transition,
    fire_once_each,
    is_live,
    is_safe,
)
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody
from tests.realizer.firing import enabled, fire
from tests.realizer.oracle import estimated, random_blocks
from tests.realizer.pnml_reader import read_pnml
from tests.realizer.stage import after, before, block, together

GRAMMAR = etree.RelaxNG(etree.parse(Path(__file__).with_name("ptnet.rng")))
FIGURE_4_4 = block(
    (
        Gaze(id="gaze-1", target="can-1"),
        Pointing(id="point-1", target="can-1"),
        Speech(id="speech-1", text="This can?"),
    ),
    together("gaze-1:stroke", "point-1:start"),
    together("point-1:stroke_start", "speech-1:start"),
)
ASK = Event(id="e", kind="directed_gaze", responder="human", objects=("can",))


def plan(example: Block) -> Plan:
    return plan_block(example, [FakeBody().estimate(each) for each in example.behaviors if each.id != "e"])


def ring(*tokens: int) -> PetriNet:
    """Transitions in a circle, with these tokens (0 or 1) between them."""
    size = len(tokens)
    return PetriNet(
        tuple(Transition(f"t{number}", ()) for number in range(size)),
        tuple(
            Place("idle" if count else "order", number, (number + 1) % size) for number, count in enumerate(tokens)
        ),
    )


def test_figure_4_8_is_the_net_of_figure_4_4() -> None:
    net = plan(FIGURE_4_4).net

    arcs = {(net.transitions[place.source].name, net.transitions[place.target].name) for place in net.places}
    gaze_stroke, arm_is_there = "gaze-1:stroke = point-1:start", "point-1:stroke_start = speech-1:start"
    assert {
        ("gaze-1:start = gaze-1:ready = gaze-1:stroke_start", gaze_stroke),
        (gaze_stroke, "point-1:ready"),
        ("point-1:ready", arm_is_there),
        (arm_is_there, "speech-1:end"),
        (arm_is_there, "point-1:stroke"),
        ("bml:end", "bml:start"),
    } <= arcs


def test_the_critical_path_is_what_makes_the_block_as_long_as_it_is() -> None:
    made = plan(FIGURE_4_4)

    names = [made.net.transitions[each].name for each in made.critical]
    assert names[0] == "gaze-1:start = gaze-1:ready = gaze-1:stroke_start"
    assert names[1:3] == ["gaze-1:stroke = point-1:start", "point-1:ready"]
    assert names[-3:] == ["gaze-1:stroke_end = gaze-1:relax", "gaze-1:end", "bml:end"]
    assert "speech-1:end" not in names


def test_a_gesture_kept_back_for_a_speech_has_the_speech_on_its_critical_path() -> None:
    made = plan(
        block(
            (Pointing(id="p", target="a"), Speech(id="s", text="one")),
            together("p:stroke_start", "s:end"),
        )
    )

    names = [made.net.transitions[each].name for each in made.critical]
    assert names[:2] == ["s:start", "p:stroke_start = s:end"]


def test_stepping_is_the_same_as_firing_all_at_once() -> None:
    net = plan(FIGURE_4_4).net
    marking, fired, candidates = net.initial, [], enabled(net, net.initial)
    while candidates:
        marking = fire(net, marking, candidates[0])
        fired.append(candidates[0])
        candidates = tuple(each for each in enabled(net, marking) if each not in fired)

    run = fire_once_each(net, net.initial)
    assert sorted(run.fired) == sorted(fired) == list(range(len(net.transitions)))
    assert run.marking == marking == net.initial


def test_enabled_can_be_asked_about_a_few() -> None:
    net = plan(FIGURE_4_4).net

    assert enabled(net, net.initial, (0, 1, 2)) == (0,)
    assert enabled(net, net.initial, (1, 2)) == ()


def test_a_circle_without_a_token_is_dead() -> None:
    assert is_live(ring(1, 0, 0))
    assert not is_live(ring(0, 0, 0))
    assert not is_safe(ring(0, 0, 0))


def test_a_place_that_can_hold_two_tokens_is_not_safe() -> None:
    assert is_safe(ring(1, 0, 0))
    assert not is_safe(ring(1, 1, 0))
    open_ended = PetriNet(
        (*ring(1, 0).transitions, Transition("sink", ())), (*ring(1, 0).places, Place("order", 0, 2))
    )
    assert not is_safe(open_ended)


def test_an_event_that_may_outlast_its_block_cannot_pile_up() -> None:
    made = plan(block((ASK, Speech(id="s", text="look")), together("e:start", "s:start")))

    assert "e" not in made.waited_for
    assert is_safe(made.net)
    marking = made.net.initial
    e_end = made.at[next(point for point in made.at if point == ("e", "end"))]
    for _ in range(2):
        while ready := [each for each in enabled(made.net, marking) if each != e_end]:
            marking = fire(made.net, marking, ready[0])
            if marking[-1] or max(marking) > 1:
                break
    assert max(marking) == 1


@settings(max_examples=share_of(60), deadline=None)
@given(random_blocks())
def test_every_net_is_live_safe_and_comes_back_from_pnml_equal(example: Block) -> None:
    made = estimated(example)
    if made is None:
        return
    document = as_pnml(made)

    assert is_live(made.net)
    assert is_safe(made.net)
    assert GRAMMAR.validate(etree.fromstring(document.encode())), GRAMMAR.error_log
    assert read_pnml(document) == made.net
    assert as_pnml(made) == document


def test_pnml_keeps_seconds_lines_bounds_and_strange_names() -> None:
    net = PetriNet(
        (Transition('<a>&"b"', ()), Transition("bml:end", ())),
        (Place("phase", 0, 1, 0.1 + 0.2, 0.05, "é-1", (3, 14)), Place("idle", 1, 0)),
        (Bound("phase", 1, 0, -1 / 3, None, "é-1"), Bound("order", 1, 0, -2.0, 0.0, "", (7,))),
    )

    assert read_pnml(net_as_pnml(net, "ü")) == net


FOREIGN = """<pnml xmlns="http://www.pnml.org/version-2009/grammar/pnml">
  <net id="n" type="http://www.pnml.org/version-2009/grammar/ptnet"><page id="g">
    <place id="a"><initialMarking><text>1</text></initialMarking></place><place id="b"/>
    <transition id="x"><name><text>go</text></name></transition><transition id="y"/>
    <arc id="1a" source="a" target="x"/><arc id="2a" source="x" target="b"/>
    <arc id="3a" source="b" target="y"/><arc id="4a" source="y" target="a"/>
  </page></net></pnml>"""


@pytest.mark.parametrize(
    "marked", ["<text>1</text>", "<text><!-- at rest -->1</text>", "<!-- 2 --><text>\n1 </text>"]
)
def test_a_net_of_another_tool_is_read_without_seconds(marked: str) -> None:
    net = read_pnml(FOREIGN.replace("<text>1</text>", marked))

    assert net.places == (Place("idle", 1, 0), Place("order", 0, 1))
    assert enabled(net, net.initial) == (0,)
    assert [each.name for each in net.transitions] == ["go", ""]


def test_a_net_reads_no_other_file(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("swordfish", encoding="utf-8")
    declared = f'<!DOCTYPE pnml [<!ENTITY other SYSTEM "{(tmp_path / "secret").as_uri()}">]>'
    net = read_pnml(declared + FOREIGN.replace("<text>go</text>", "<text>&other;</text>"))

    assert [each.name for each in net.transitions] == ["", ""]


def test_a_drawing_has_tokens_at_rest_and_the_seconds_of_what_takes_time() -> None:
    net = PetriNet(
        (Transition("one", ()), Transition("two", ())),
        (Place("phase", 0, 1, 1.25), Place("order", 0, 1), Place("idle", 1, 0)),
    )
    drawn = as_dot(replace(plan(FIGURE_4_4), net=net))

    labels = re.findall(r'p\d \[shape=circle, label="(.*?)", tooltip="(.*?)"', drawn)
    assert labels == [("1.25", "phase"), ("", "order"), ("●", "idle")]


@pytest.mark.parametrize(
    "change",
    [
        ("grammar/ptnet", "grammar/symmetricnet"),
        ('source="t0"', 'source="nowhere"'),
        ("<text>1</text>", "<text>2</text>"),
        ('kind="phase"', 'kind="phrase"'),
        ("</pnml>", ""),
        ('target="p0"', 'target="p1"'),
        ('source="t0" ', ""),
        ("<page", "<net"),
        ('target="p0"/>', 'target="p0"><inscription><text>2</text></inscription></arc>'),
    ],
)
def test_what_is_no_such_net_is_refused(change: tuple[str, str]) -> None:
    document = as_pnml(plan(FIGURE_4_4))

    with pytest.raises(InputRefused):
        read_pnml(document.replace(*change))


def test_the_grammar_refuses_what_the_standard_does() -> None:
    document = as_pnml(plan(FIGURE_4_4))
    for old, new in (
        ("<text>1</text>", "<text>-1</text>"),
        ('type="http', 'kind="http'),
        ('source="t0"', ""),
        ('<page id="page">', "<page>"),
    ):
        assert old in document
        assert not GRAMMAR.validate(etree.fromstring(document.replace(old, new).encode()))


def test_text_json_and_drawing_show_the_critical_path() -> None:
    made = plan(
        block((*FIGURE_4_4.behaviors,), *FIGURE_4_4.constraints[0].operators, before("speech-1:end", "point-1:ready"))
    )

    text = as_text(made)
    assert "transitions" in text
    assert "live, safe" in text
    assert "*   0.500 s  gaze-1:stroke = point-1:start" in text
    document = json.loads(as_json(made))
    assert document["critical"] == list(made.critical)
    assert document["live"]
    assert document["safe"]
    assert as_dot(made).count("penwidth=2") == len(made.critical)


def test_a_window_is_drawn_dashed() -> None:
    made = plan(
        block(
            FIGURE_4_4.behaviors,
            after("gaze-1:stroke", "speech-1:start"),
            before("gaze-1:stroke+2", "speech-1:start"),
        )
    )

    assert [bound.lag for bound in made.net.bounds if bound.kind == "order"] == [-2.0]
    assert "style=dashed" in as_dot(made)


def test_timing_of_an_unknown_order_has_no_effect_on_the_document() -> None:
    one = plan(block((Speech(id="s", text="a", timing=(Timing("start", "1"),)), Gaze(id="g", target="x"))))
    two = plan(block((Gaze(id="g", target="x"), Speech(id="s", text="a", timing=(Timing("start", "1"),)))))

    assert as_pnml(one) == as_pnml(two)
