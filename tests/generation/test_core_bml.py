"""With the extension removed, what generation makes of any fragment is BML 1.0, and plays."""

import asyncio

from hypothesis import HealthCheck, assume, given, reject, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas import behaviors as of
from engage_hri.schemas import keys
from engage_hri.schemas.behavior_types import dialect_sync, sync_points
from engage_hri.schemas.blocks import (
    Block,
    BlockOutcome,
    BlockProgress,
    Feedback,
    PerformBlock,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.documents.dialects import core, in_dialect
from engage_hri.schemas.documents.xml_decode import decode_xml, encode_xml
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import SyncRef, type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.shell.config import Config, load
from engage_hri.services.commandline.shell.roster import service
from engage_hri.services.commandline.shell.sources import still
from engage_hri.services.commandline.talk.offline_plan import generated
from engage_hri.services.commandline.talk.plan import rehearsed
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.points import EPSILON, Point
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.service import Service, running
from engage_hri.services.runtime.virtual_time import run_virtual
from engage_hri.services.simulation.still import table_world
from tests.random_cases import share_of
from tests.schemas.grammar import violations

WORLD = table_world()
OBJECTS = [entity.id for entity in WORLD.entities if entity.kind == "object"]
FEW = settings(max_examples=share_of(50), deadline=None, suppress_health_check=[HealthCheck.too_slow])
MISESTIMATED: Seconds = 2.0
"""By how much a block may take longer than is expected of a body that is at home before each behavior."""

NAMED = of.SpeechOption(text="the piece there", cost=3, distractors=tuple(OBJECTS[:3]))
PHRASES = [of.SpeechOption(text="it", cost=1), of.SpeechOption(text="this one", cost=2, deictic=True)]
OWN: list[of.FragmentBehavior] = [
    of.Speech(id="", text="One <two> three", marks=(of.Mark("m", 4),)),
    of.Speech(id="", text="Four five", markup='Four <prosody rate="slow">five</prosody>'),
    of.Gaze(id="", target="human", offset_angle=5.0, offset_direction="UP"), of.Pointing(id="", target=OBJECTS[0]),
    of.Gesture(id="", lexeme="BEAT", mode="LEFT_HAND"), of.Head(id="", lexeme="NOD", repetition=2),
    of.FaceLexeme(id="", lexeme="SMILE", amount=0.7), of.FaceFacs(id="", au=12, side="LEFT"),
    of.FaceShift(id="", lexeme="SMILE"), of.Wait(id="", duration=0.3), of.GazeShift(id="", target="table"),
]  # fmt: skip
CONDITIONS = [
    (f"generation.condition={condition}", f"generation.profile={profile}")
    for condition in ("operational", "degraded-generation", "degraded-recognition")
    for profile in ("check-back", "figure-3.3")
]


@st.composite
def fragments(draw: st.DrawFn) -> TurnFragment:
    """Of all that a fragment may hold. What is tied is tied to something before it, and words follow words."""
    references = st.builds(
        of.Reference,
        id=st.just(""),
        target=st.sampled_from(OBJECTS),
        minimum_reliability=st.sampled_from([0.3, 0.45, 0.65, 0.85]),
        options=st.none() | st.lists(st.sampled_from(PHRASES), max_size=2).map(lambda more: (NAMED, *more)),
    )
    chosen = draw(st.lists(st.one_of(references, references, st.sampled_from(OWN)), min_size=1, max_size=5))
    behaviors = [replace(behavior, id=f"x-{number}") for number, behavior in enumerate(chosen)]
    constraints = []
    for number, behavior in enumerate(behaviors[1:], 1):
        words = [each for each in behaviors[:number] if isinstance(each, of.Reference | of.Speech)]
        if words and isinstance(behavior, of.Reference | of.Speech):
            earlier, sync = words[-1], "end"
        else:
            earlier = behaviors[draw(st.integers(0, number - 1))]
            sync = draw(st.sampled_from(_points(earlier)))
        named = str(SyncRef(behavior=earlier.id, sync=sync, offset=draw(st.sampled_from([0.0, 0.4]))))
        match draw(st.integers(0, 3)):
            case 0:
                behaviors[number] = replace(behavior, timing=(of.Timing("start", named),))
            case 1:
                operator = of.After(ref=named, syncs=(f"{behavior.id}:start",))
                constraints.append(of.Constraint(id=f"c-{number}", operators=(operator,)))
    index = draw(st.sampled_from([1, 2, 3]))
    status = draw(st.sampled_from(["beginning", "middle", "end", "full", "backchannel"]))
    return TurnFragment(
        id="f", turn_index=index, turn_status=status, behaviors=tuple(behaviors), constraints=tuple(constraints)
    )


def _points(behavior: of.Behavior) -> list[str]:
    if isinstance(behavior, of.Reference):
        return ["start", "end"]
    lasts = type_name(behavior) in ("gaze", "faceLexeme", "faceFacs")
    return [sync for sync in sync_points(behavior) if not lasts or sync in ("start", "ready", "stroke")]


def block_of(fragment: TurnFragment, config: Config) -> Block:
    opening = TurnFragment(id="opening", turn_status="beginning", turn_index=fragment.turn_index)
    before = [opening] if fragment.turn_status in ("middle", "end") else []
    return generated([*before, fragment], WORLD, config, "test")[-1].block


def as_core_bml(block: Block) -> Block:
    """Through its XML, as another program would get it."""
    written = encode_xml(in_dialect(core(block), "bml-1.0"))
    assert violations(written) == []
    assert b"edu.wpi.ebml" not in written
    again = decode_xml(written)
    assert isinstance(again, Block)
    assert again.unread == ()
    return again


def plan_of(block: Block) -> Plan:
    """Rehearsed by the simulated body at home. Discards what cannot be done as it stands."""
    try:
        plan = run_virtual(rehearsed(block, WORLD, Config()))
    except InputRefused:
        reject()
    assume(not plan.problems)
    return plan


def performed(block: Block, config: Config) -> tuple[BlockOutcome, list[Feedback]]:
    """By the simulated body; nobody recognizes anything."""

    async def main() -> tuple[BlockOutcome, list[Feedback]]:
        services: dict[str, Service] = {"simulation": still(WORLD)}
        services |= {name: service(name, config) for name in ("realizer", "control")}
        feedback: list[Feedback] = []
        async with MemoryHub() as hub, running(hub, services):
            bus = hub.join("test")
            async with Requester(bus) as requests:
                with bus.subscribe(keys.FEEDBACK) as inbox:
                    request = PerformBlock(id="r", requester="test", block=block)
                    outcome = await requests.send(keys.BLOCK, request).outcome
                    await asyncio.sleep(0.1)
                    feedback += [(await inbox.next()).message for _ in range(len(inbox))]  # type: ignore
            await bus.leave()
        assert isinstance(outcome, BlockOutcome)
        return outcome, feedback

    return run_virtual(main())


@FEW
@given(fragments(), st.sampled_from(CONDITIONS))
def test_without_the_extension_every_block_is_bml_1_0_and_plays(
    fragment: TurnFragment, setting: tuple[str, str]
) -> None:
    config = load(settings=setting)
    extended = block_of(fragment, config)
    longest = max(plan_of(extended).schedule)
    block = as_core_bml(extended)

    outcome, feedback = performed(block, config)

    # A gaze of `figure-3.3` may be called away to another before it has arrived, and is late then with events, too.
    warnings = [each for each in feedback if isinstance(each, WarningFeedback)]
    assert [each for each in warnings if each.kind != "LATE"] == []
    assert (outcome.status, outcome.dropped) == ("done", ())
    for behavior in block.behaviors:
        reached = [each for each in feedback if isinstance(each, SyncPointProgress) and each.behavior == behavior.id]
        known = [dialect_sync(sync, type_name(behavior), "bml-1.0") for sync in sync_points(behavior)]
        assert [each.sync for each in reached] == [sync for sync in known if sync is not None]
    (end,) = [each.time for each in feedback if isinstance(each, BlockProgress) and each.progress == "end"]
    assert end <= longest + MISESTIMATED


@FEW
@given(fragments(), st.sampled_from(CONDITIONS))
def test_nothing_waits_longer_without_events_and_words_keep_their_order(
    fragment: TurnFragment, setting: tuple[str, str]
) -> None:
    extended = block_of(fragment, load(settings=setting))
    before = plan_of(extended)
    after = plan_of(as_core_bml(extended))

    assert [each.id for each in after.behaviors] == [each.id for each in before.behaviors if not _is_ours(each)]
    for point in after.at:
        assert after.predicted(point) <= before.predicted(point) + EPSILON
    said = [each.id for each in after.behaviors if isinstance(each, of.Speech)]
    assert sorted(said, key=lambda id: after.predicted(Point(id, "start"))) == sorted(
        said, key=lambda id: before.predicted(Point(id, "start"))
    )


def _is_ours(behavior: of.Behavior) -> bool:
    return isinstance(behavior, of.Event | of.TurnSignal)
