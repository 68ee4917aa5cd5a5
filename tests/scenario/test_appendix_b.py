"""The acceptance test: Appendix B through all real services, in virtual time. Expectations: the scenario page.

`AP DG MFG` with `S` succeeded, `F` failed, `*` not asserted. Steps 7-17 are ours, say so in
their ids, and do not count.
"""

from collections import Counter
from functools import cache
from typing import Any

import pytest

from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress, WarningFeedback
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import HeadOwner
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.tables import Relation, relation
from engage_hri.schemas.world import World
from engage_hri.services.reports.action_reports import FACE_GRACE
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.scenario.playing import Record, play

PERSON_LOOKS = {
    "step-1": "table robot table robot",
    "step-3": "table robot table rectangle trapezoid robot table",
    "step-5": "blue-square rectangle robot",
    "step-18": "away robot table purple-triangle",
    "step-20": "table robot table",
    "step-21": "robot green-square robot table green-square robot",
    "step-23": "table robot",
    "step-24": "table",
    "step-25": "robot table robot table",
}
"""Changes of the person's gaze from the start of a step to that of the next: those of the transcript."""
ROBOT_LOOKS = {
    "step-1": "human",
    "step-3": "rectangle trapezoid human",
    "step-5": "blue-square human rectangle human hand human",
    "step-18": "purple-triangle human pink-square human hand",
    "step-20": "human table human",
    "step-21": "green-square human blue-square human green-square hand human",
    "step-23": "table human",
}
"""The same of the robot, where it arrives."""
SHORT = {"adjacency_pair": "AP", "directed_gaze": "DG", "mutual_facial_gaze": "MFG", "backchannel": "BC"}
ENDINGS = {"failed", "preempted", "withdrawn", "superseded", "completed"}
DEGREE = {"succeeded": "S", "completed": "S", "failed": "F"}

EXPECTED: dict[str, dict[str, list[str]]] = {
    "table": {
        "step-2": ["AP *", "MFG S"],
        "step-3": ["AP *", "DG rectangle S", "DG trapezoid S", "MFG S"],
        "step-4": ["AP *", "MFG F"],
        "step-5": ["AP S", "DG blue-square S", "DG rectangle S", "MFG F"],
        "step-18": ["AP S", "DG purple-triangle F", "DG pink-square S", "MFG F"],
        "step-20": ["AP *", "MFG S"],
        "step-21": ["AP S", "DG green-square S", "DG blue-square S", "MFG F"],
        "step-23": ["AP *", "MFG S"],
        "step-24": ["AP *", "MFG *"],
        "step-25": ["AP *", "MFG S"],
    }
}
EXPECTED["object"] = EXPECTED["table"] | {
    "step-18": ["AP S", "DG purple-triangle F", "DG pink-square F", "MFG F"],
    "step-21": ["AP S", "DG green-square S", "DG blue-square F", "MFG F"],
}


def played(human: str = "appendix-b", resolution: str = "table", seed: int = 0, **manager: Any) -> Record:
    return _played(human, resolution, seed, **manager)


@cache
def _played(*person: Any, **manager: Any) -> Record:
    """Once each, whether the defaults are spelled out or not."""
    return run_virtual(play(*person, **manager))


def step_of(block: str) -> str:
    """step-20-a and step-20-b are step-20."""
    return "-".join(block.split("-")[:2])


def counted(record: Record) -> list[ConnectionEvent]:
    return [event for event in record.robot_initiated() if "ours" not in event.block]


def described(event: ConnectionEvent, expected: str) -> str:
    parts = [
        SHORT[event.kind],
        *event.objects,
        "*" if expected.endswith("*") else DEGREE.get(event.state, event.state),
    ]
    return " ".join(parts)


def by_step(record: Record, resolution: str = "table") -> dict[str, list[str]]:
    steps: dict[str, list[str]] = {}
    for event in counted(record):
        described_so_far = steps.setdefault(step_of(event.block), [])
        expected = EXPECTED[resolution].get(step_of(event.block), [])
        like = expected[len(described_so_far)] if len(described_so_far) < len(expected) else ""
        described_so_far.append(described(event, like))
    return steps


def looks(record: Record, actor: str) -> dict[str, str]:
    """What an actor comes to look at, in order, in each step of the source."""
    step, found = "step-1", dict[str, list[str]]()
    for message in record.received:
        match message.message:
            case BlockProgress(progress="start", block=str() as block) if block.startswith("step-"):
                step = block if "ours" in block else step_of(block)
            case ActionBegan(action="look", targets=targets) as began if began.actor == actor:
                target = "hand" if targets and targets[0].endswith("hand") else (*targets, "away")[0]
                found.setdefault(step, []).append(target)
    return {step: " ".join(targets) for step, targets in found.items() if "ours" not in step}


def words(record: Record, block: str) -> str:
    spoken = [it.word for it in record.messages(WordSpoken) if it.block == block]
    return " ".join(spoken)


@pytest.mark.parametrize("resolution", ["table", "object"])
def test_robot_initiated_events_come_in_the_order_and_with_the_outcomes_of_the_transcript(resolution: str) -> None:
    assert by_step(played(resolution=resolution), resolution) == EXPECTED[resolution]


@pytest.mark.parametrize(("resolution", "gazes"), [("table", {"S": 7, "F": 1}), ("object", {"S": 5, "F": 3})])
def test_totals_of_causes_turn_and_reference(resolution: str, gazes: dict[str, int]) -> None:
    events = counted(played(resolution=resolution))

    assert Counter(SHORT[event.kind] for event in events) == {"AP": 10, "DG": 8, "MFG": 10}
    assert Counter(DEGREE[event.state] for event in events if event.kind == "directed_gaze") == gazes


@pytest.mark.parametrize("seed", [0, 3])
def test_everybody_looks_where_the_transcript_says(seed: int) -> None:
    record = played(seed=seed)

    assert looks(record, "human") == PERSON_LOOKS
    assert looks(record, "robot") == ROBOT_LOOKS


def test_the_person_looks_at_the_table_between_the_two_references_of_step_18() -> None:
    record = played()
    first, second = (life for life in record.events.values() if life[0].block == "step-18" and life[0].objects)
    looked = [
        it.at.seconds for it in record.messages(ActionBegan) if it.actor == "human" and it.targets == ("table",)
    ]

    assert [at for at in looked if first[-1].at.seconds < at < second[0].at.seconds]


def test_four_of_the_references_are_made_with_pointing() -> None:
    outcomes = played().outcomes
    pointed = [
        choice.target
        for step in ("step-3", "step-5", "step-18", "step-21")
        for choice in outcomes[step].choices
        if choice.gesture == "directed_gaze_with_pointing"
    ]

    assert pointed == ["trapezoid", "blue-square", "purple-triangle", "green-square"]


def test_the_arm_really_points_at_what_it_is_said_to_point_at() -> None:
    points = [
        it.targets[0]
        for it in played().messages(ActionBegan)
        if it.actor == "robot" and it.action == "point" and "ours" not in it.behavior
    ]

    assert points == ["trapezoid", "blue-square", "purple-triangle", "green-square"]


@pytest.mark.parametrize(
    ("block", "said"),
    [
        ("step-2", "Hello, let's make a tangram."),
        ("step-18", "Please move that so that it is touching the top right of the pink square"),
        ("step-20-a", "Ummmm,"),
        ("step-21", "Please move this so that it is touching the left side of the blue piece"),
        ("step-25", "Thanks for playing. That was fun, goodbye."),
    ],
)
def test_the_voice_says_the_words_of_the_transcript(block: str, said: str) -> None:
    assert words(played(), block) == said


def test_the_optional_facial_gazes_at_the_ends_of_turns_cost_no_time() -> None:
    facial = [event for event in counted(played()) if event.kind == "mutual_facial_gaze"]

    assert all(event.optional for event in facial if event.initiator == "robot")
    assert next(event for event in facial if event.block == "step-2").delay == 0.0


@pytest.mark.parametrize("step", ["step-5", "step-18", "step-21"])
def test_a_request_to_move_a_piece_is_answered_by_moving_it(step: str) -> None:
    (pair,) = [it for it in counted(played()) if it.block == step and it.kind == "adjacency_pair"]

    assert (pair.state, pair.response) == ("succeeded", "act")


@pytest.mark.parametrize("step", ["step-2", "step-4", "step-5", "step-18", "step-20-a", "step-21", "step-23-a"])
def test_the_first_word_follows_the_look_at_the_person(step: str) -> None:
    points = {(it.behavior, it.sync): it.time for it in played().messages(SyncPointProgress) if it.block == step}

    assert points["speech-1", "start"] >= points["look", "stroke"]


def test_step_1_has_no_robot_initiated_event_and_the_robot_is_on_the_face() -> None:
    record = played()
    first = min(event.started.seconds for event in record.robot_initiated() if event.initiator == "robot")
    owners = [it for it in record.messages(HeadOwner) if it.since.seconds < first - 1.0]

    robots = [life[0] for life in record.events.values() if life[0].initiator == "robot"]

    assert robots[0].block == "step-2"
    assert (owners[-1].owner.kind, owners[-1].owner.target) == ("face", "human")


def test_step_6_the_robot_follows_the_hand_and_then_meets_the_persons_eyes() -> None:
    record = played()
    end = next(
        it.at.seconds for it in record.messages(BlockProgress) if it.block == "step-5" and it.progress == "end"
    )
    start = next(it.at.seconds for it in record.messages(BlockProgress) if it.block == "step-7-ours-a")
    owners = [it.owner for it in record.messages(HeadOwner) if end <= it.since.seconds <= start]
    (gaze,) = [
        life
        for life in record.events.values()
        if life[0].initiator == "human" and life[0].kind == "mutual_facial_gaze" and end < life[0].at.seconds < start
    ]

    assert ("hands", 5) in [(owner.kind, owner.priority) for owner in owners]
    assert ("response", 4) in [(owner.kind, owner.priority) for owner in owners]
    assert gaze[1].state == "succeeded"


def test_step_19_is_accepted_as_the_source_has_it() -> None:
    record = played()
    final = record.messages(World)[-1]
    triangle, trapezoid = final.entity("purple-triangle"), final.entity("trapezoid")

    assert relation(triangle, trapezoid) == Relation("purple-triangle", "top right", "trapezoid")
    assert not [id for id in record.outcomes if id.endswith(("fix", "help", "again"))]


def test_every_fragment_is_done_and_nothing_is_warned_of() -> None:
    record = played()

    assert {outcome.status for outcome in record.outcomes.values()} == {"done"}
    assert record.messages(Fault) == []
    assert record.messages(WarningFeedback) == []


def test_the_person_leaves_and_no_event_stays_open() -> None:
    record = played()
    lost = record.messages(ActorLost)[-1].at.seconds

    for life in record.events.values():
        assert life[0].state == "started"
        assert [it.state in ENDINGS for it in life] == [False] * (len(life) - 1) + [True]
    assert all(life[-1].at.seconds <= lost + FACE_GRACE + 1e-6 for life in record.events.values())


def test_every_action_of_the_person_that_began_has_ended() -> None:
    record = played()
    began, ended = (
        Counter((it.action, it.targets) for it in record.messages(kind) if it.actor == "human")
        for kind in (ActionBegan, ActionEnded)
    )

    assert began == ended
    assert sum(count for (action, _), count in began.items() if action == "act") == 9


def test_the_same_seed_gives_the_same_run_and_another_seed_the_same_events() -> None:
    again = run_virtual(play())
    other = played(seed=3)

    assert [event.at for event in again.robot_initiated()] == [event.at for event in played().robot_initiated()]
    assert by_step(other) == EXPECTED["table"]
    assert [event.at for event in other.robot_initiated()] != [event.at for event in played().robot_initiated()]


def test_a_misplaced_piece_is_asked_to_be_fixed_and_then_is_right() -> None:
    record = played(human="misplacing")
    final = record.messages(World)[-1]
    pink, yellow = final.entity("pink-square"), final.entity("yellow-triangle")

    assert words(record, "step-14-ours-fix").startswith("Please fix the pink square so that it is touching")
    assert [it.state for it in record.robot_initiated() if it.block == "step-14-ours-fix" and it.objects] == [
        "succeeded",
        "succeeded",
    ]
    assert relation(pink, yellow) == Relation("pink-square", "bottom right", "yellow-triangle")
    assert by_step(record) == EXPECTED["table"]


def test_the_task_finishes_the_figure_with_a_person_who_listens() -> None:
    record = played(human="listening", mode="task")

    assert words(record, "finished") == "Look, we made an anchor."
    assert not [id for id in record.outcomes if "fix" in id or "help" in id]
