"""What cameras and microphones report of a person at the table, raw and faulty."""

import math
import random
from collections import Counter
from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.body import BodyPose, Ray, RobotState
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import (
    ActionBegan,
    ActionEnded,
    ActorFound,
    ActorLost,
    HeadPose,
    Utterance,
    VoiceActivity,
)
from engage_hri.schemas.units import Seconds, Stamp, Vector
from engage_hri.schemas.world import World
from engage_hri.services.simulation.human import (
    AWAY,
    FACE,
    TABLE,
    Act,
    Entrance,
    Grab,
    Human,
    Lay,
    Leave,
    LookAt,
    Pause,
    Rule,
    Sit,
    Start,
    Stop,
    Withdraw,
    speech,
)
from engage_hri.services.tangram.people.cameras import Cameras
from engage_hri.services.tangram.people.config import PerceptionFaults, SimulationConfig
from engage_hri.services.tangram.people.head import Sightlines, SimulatedHead, angle, unit
from engage_hri.services.tangram.people.person_at_table import PersonAtTable
from engage_hri.services.tangram.people.table import Table
from engage_hri.services.tangram.table import tangram_table
from tests.ongoing import going_on, is_seen

FACE_AT = tangram_table().person.face
EYES: Vector = (0.05, 0.0, 1.17)
MOVES_BLUE = (Grab("blue-square"), Lay("blue-square", "top", "rectangle"), Withdraw())
FRAME = 0.0625
"""A binary fraction, so that every frame comes at its exact time."""


def stamp(at: Seconds) -> Stamp:
    return Stamp("test", at)


class Filmed:
    """A person who sits down at second 0 and does this, as reported until `until`."""

    def __init__(self, *acts: Act, until: Seconds, robot_state: bool = True, seed: int = 0, **config: Any) -> None:
        whole = SimulationConfig(**config)
        table = Table(tangram_table())
        human = Human((Rule("step-1", Entrance(), (Sit(), *acts)),))
        scene = PersonAtTable(human, table, robot="robot", frame=whole.frame, stamp=stamp)
        cameras = Cameras(
            scene, Sightlines(table, "robot"), whole, stamp, lambda name: random.Random(f"{seed} {name}")
        )
        self.messages: list[tuple[Seconds, Message]] = [(0.0, cameras.world(0.0))]
        if robot_state:
            ray = Ray(origin=EYES, axis=(1.0, 0.0, 0.0))
            cameras.feed(RobotState(at=stamp(0.0), pose=BodyPose(), gaze=ray, left_arm=ray, right_arm=ray), 0.0)
        cameras.enter(0.0)
        while (now := cameras.deadline) is not None and now <= until:
            self.messages += [(now, message) for message in cameras.advance(now)]

    def of(self, *kinds: type) -> list[Any]:
        return [message for _, message in self.messages if isinstance(message, kinds)]

    def world(self, at: Seconds) -> World:
        """As known then."""
        return [it for when, it in self.messages if isinstance(it, World) and when <= at + 1e-9][-1]

    def facing(self, at: Seconds) -> Vector:
        """In the last frame by then."""
        return [it for when, it in self.messages if isinstance(it, HeadPose) and when <= at + 1e-9][-1].direction


def to(place: Vector) -> Vector:
    return unit((place[0] - FACE_AT[0], place[1] - FACE_AT[1], place[2] - FACE_AT[2]))


def raw(*acts: Act, until: Seconds, **faults: Any) -> Filmed:
    return Filmed(*acts, until=until, perception="raw", frame=FRAME, faults=PerceptionFaults(**faults))


def symbolic(*acts: Act, until: Seconds, seed: int = 0, **faults: Any) -> Filmed:
    return Filmed(*acts, until=until, seed=seed, frame=FRAME, faults=PerceptionFaults(**faults))


def looks(messages: Iterable[Message]) -> list[str]:
    return [
        f"{'+' if type(it) is ActionBegan else '-'}{(*it.targets, 'away')[0]}"
        for it in messages
        if isinstance(it, ActionBegan | ActionEnded) and it.action == "look"
    ]


# -- raw --------------------------------------------------------------------------------------------------------


def test_raw_perception_tells_of_head_and_voice_at_every_frame_and_of_nothing_else() -> None:
    film = raw(LookAt(FACE), Pause(1.0), LookAt(TABLE), until=2.0)

    assert len(film.of(HeadPose)) == len(film.of(VoiceActivity)) == 33
    assert [it.at.seconds for it in film.of(HeadPose)] == [frame * FRAME for frame in range(33)]
    assert film.of(ActionBegan, ActionEnded, ActorFound, ActorLost) == []


def test_nothing_is_seen_or_heard_of_who_has_left() -> None:
    film = raw(LookAt(FACE), Pause(1.02), Leave(), until=60.0)

    assert [at for at, it in film.messages if isinstance(it, HeadPose | VoiceActivity)][-1] == pytest.approx(1.0)
    assert film.world(60.0).people == ()


@pytest.mark.parametrize(
    ("target", "place"),
    [
        (FACE, EYES),
        (TABLE, tangram_table().surface.free),
        ("blue-square", (0.56, -0.21, 0.72)),
    ],
)
def test_the_head_faces_what_the_person_looks_at(target: str, place: Vector) -> None:
    film = raw(LookAt(target), until=1.0)

    assert angle(film.facing(1.0), to(place)) < 1e-6
    assert film.of(HeadPose)[-1].position == FACE_AT


def test_who_looks_away_faces_neither_the_robot_nor_anything_on_the_table() -> None:
    facing = raw(LookAt(AWAY), until=1.0).facing(1.0)
    places = [EYES, tangram_table().surface.free, *(piece.position for piece in tangram_table().figure())]

    assert min(angle(facing, to(place)) for place in places) > math.radians(40.0)


def test_who_looks_at_the_table_faces_no_piece_of_it() -> None:
    table = tangram_table()
    pieces = [*table.figure(), *(table.lying(piece, piece.start) for piece in table.pieces)]

    assert min(angle(to(table.surface.free), to(piece.position)) for piece in pieces) > math.radians(10.0)


def test_the_robots_face_is_where_it_says_its_eyes_are() -> None:
    unknown = Filmed(LookAt(FACE), until=1.0, perception="raw", robot_state=False)

    assert angle(unknown.facing(1.0), to((0.0, 0.0, FACE_AT[2]))) < 1e-6
    assert angle(raw(LookAt(FACE), until=1.0).facing(1.0), to(EYES)) < 1e-6


def test_a_head_that_turns_passes_what_lies_between_within_the_turning_time() -> None:
    film = raw(LookAt("purple-square"), Pause(1.0), LookAt("green-square"), until=2.0)
    green, purple = to((0.47, -0.36, 0.72)), to((0.47, 0.36, 0.72))
    way = [
        angle(film.facing(1.0 + part * 0.25), purple) / angle(green, purple) for part in (0.0, 0.25, 0.5, 0.75, 1.0)
    ]

    assert way == pytest.approx([0.0, 0.1800, 0.7248, 0.9978, 1.0], abs=1e-3)


def test_a_manipulation_shows_in_the_world_alone() -> None:
    film = raw(*MOVES_BLUE, until=5.0)
    speeds = [math.hypot(*piece.velocity) for it in film.of(World) if (piece := it.entity("blue-square"))]

    assert film.of(ActionBegan, ActionEnded) == []
    assert max(speeds) > 0.2
    assert film.world(5.0).entity("blue-square").position == pytest.approx((0.48, 0.0, 0.72))


def test_a_world_at_rest_is_not_told_again() -> None:
    film = raw(LookAt(FACE), until=30.0)

    assert len(film.of(World)) == 2


@settings(max_examples=60)
@given(*(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda it: math.hypot(*it) > 0.1) for _ in range(2)))
def test_a_turning_head_always_points_somewhere_and_never_goes_back(start: Vector, goal: Vector) -> None:
    head, start, goal = SimulatedHead(0.2), unit(start), unit(goal)
    head.turn(start, 1.0)

    way = [head.facing(goal, 1.0 + 0.02 * step) for step in range(11)]

    assert all(math.hypot(*it) == pytest.approx(1.0) for it in way)
    assert all(angle(b, goal) <= angle(a, goal) + 1e-6 for a, b in pairwise(way))
    assert way[-1] == goal


SPEAKS = (Pause(1.0), Start("speak"), Pause(0.5), Stop("speak"))


def test_the_voice_is_heard_while_the_person_speaks() -> None:
    film = raw(*SPEAKS, until=3.0)

    assert [it.at.seconds for it in film.of(VoiceActivity) if it.active] == [1.0 + FRAME * n for n in range(8)]


def test_what_recognition_cannot_find_out_of_raw_perception_is_told_as_it_is() -> None:
    film = raw(Start("nod"), Pause(0.4), Stop("nod"), until=1.0)

    assert [(type(it), it.action) for it in film.of(ActionBegan, ActionEnded)] == [
        (ActionBegan, "nod"),
        (ActionEnded, "nod"),
    ]


# -- faults -----------------------------------------------------------------------------------------------------


def test_gaze_noise_has_the_deviation_asked_for_and_no_bias() -> None:
    film = raw(LookAt(FACE), until=100.0, gaze=2.0)
    across = [math.degrees(it.direction[1]) for it in film.of(HeadPose) if it.at.seconds > 1.0]

    assert sum(across) / len(across) == pytest.approx(0.0, abs=0.15)
    assert math.sqrt(sum(it**2 for it in across) / len(across)) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("kind", [HeadPose, VoiceActivity])
def test_dropped_frames_never_come(kind: type) -> None:
    film = raw(LookAt(FACE), until=100.0, dropped_frames=0.2)

    assert len(film.of(kind)) / 1601 == pytest.approx(0.8, abs=0.03)


def test_a_lost_face_is_a_gap_of_the_length_asked_for_between_head_poses() -> None:
    film = raw(LookAt(FACE), until=300.0, lost_faces=12.0, lost_for=(0.3, 0.4))
    times = [it.at.seconds for it in film.of(HeadPose)]
    gaps = sorted(b - a for a, b in pairwise(times) if b - a > FRAME)

    assert len(gaps) == pytest.approx(60, abs=18)
    assert gaps[0] >= 0.3
    assert gaps[len(gaps) * 9 // 10] <= 0.4 + 2 * FRAME  # the others are two, one right after the other
    assert len(film.of(VoiceActivity)) == 4801


def test_a_lost_face_is_a_lost_actor_who_is_found_looking_where_they_look_by_then() -> None:
    film = symbolic(
        LookAt(FACE), *(it for _ in range(40) for it in (Pause(0.5), LookAt(TABLE), Pause(0.5), LookAt(FACE))),
        until=40.0, lost_faces=30.0, lost_for=(0.5, 1.5),
    )  # fmt: skip
    lost = False
    open_look = ""
    for _, message in film.messages:
        match message:
            case ActorFound() | ActorLost():
                assert lost is isinstance(message, ActorFound) or not open_look
                lost = isinstance(message, ActorLost)
            case ActionBegan(action="look", targets=(target,)):
                assert not lost
                assert not open_look
                open_look = target
            case ActionEnded(action="look", targets=(target,)):
                assert not lost
                assert open_look == target
                open_look = ""

    assert len(film.of(ActorLost)) > 5


def test_who_leaves_while_the_face_is_lost_looks_nowhere_any_more() -> None:
    gone_unseen = 0
    for seed in range(20):
        film = symbolic(LookAt(FACE), Pause(3.0), Leave(), until=5.0, seed=seed, lost_faces=30.0, lost_for=(0.5, 1.5))
        messages = film.of(ActionBegan, ActionEnded, ActorFound, ActorLost)
        gone_unseen += isinstance(messages[-1], ActionEnded)

        assert going_on(messages, "human") == ()
        assert is_seen(messages, "human") is False
    assert 0 < gone_unseen < 20


def test_a_covered_piece_stays_in_the_world_as_last_seen_with_little_confidence() -> None:
    film = symbolic(*MOVES_BLUE, until=6.0, occlusion=0.05)
    blue = [it.entity("blue-square") for it in film.of(World)]
    faint = [it for it in blue if it.confidence < 1.0]

    assert {it.confidence for it in faint} == {0.3}
    assert {it.position for it in faint} <= {(0.56, -0.21, 0.72), blue[-1].position}
    assert blue[-1].confidence == 1.0
    assert blue[-1].position == pytest.approx((0.48, 0.0, 0.72))


def test_a_covered_piece_is_missing_if_the_camera_keeps_nothing_in_mind() -> None:
    film = symbolic(*MOVES_BLUE, until=6.0, occlusion=0.05, covered="missing")
    there = [it.entity("blue-square") is not None for it in film.of(World)]

    assert (there[0], all(there), there[-1]) == (True, False, True)
    assert all(it.entity("red-square") for it in film.of(World))


def test_noise_of_poses_is_new_in_every_frame_and_unbiased() -> None:
    film = raw(LookAt(FACE), until=60.0, position=0.005, yaw=3.0)
    seen = [it.entity("blue-square") for it in film.of(World)][2:]
    xs = [it.position[0] - 0.56 for it in seen]
    yaws = [math.degrees(it.yaw) - 10.0 for it in seen]

    assert len({it.position for it in seen}) == len(seen) > 900
    assert sum(xs) / len(xs) == pytest.approx(0.0, abs=0.001)
    assert math.sqrt(sum(it**2 for it in xs) / len(xs)) == pytest.approx(0.005, abs=0.0005)
    assert math.sqrt(sum(it**2 for it in yaws) / len(yaws)) == pytest.approx(3.0, abs=0.3)


def test_a_wrong_look_is_reported_at_the_nearest_other_thing_and_ends_there() -> None:
    film = symbolic(LookAt("blue-square"), Pause(1.0), LookAt(FACE), until=2.0, wrong_look=1.0)

    assert looks(film.of(ActionBegan, ActionEnded)) == ["+green-square", "-green-square", "+trapezoid"]


def test_a_missed_look_is_told_neither_when_it_begins_nor_when_it_ends() -> None:
    film = symbolic(LookAt("blue-square"), Pause(1.0), LookAt(FACE), until=2.0, missed_look=1.0)

    assert looks(film.of(ActionBegan, ActionEnded)) == []


def test_without_faults_actions_pass_as_they_are() -> None:
    acts = (LookAt(FACE), *MOVES_BLUE, LookAt(TABLE), Pause(0.5), Leave())
    table = Table(tangram_table())
    scene = PersonAtTable(
        Human((Rule("step-1", Entrance(), (Sit(), *acts)),)), table, robot="robot", frame=FRAME, stamp=stamp
    )
    happened: list[tuple[Seconds, Message]] = [(0.0, scene.world(0.0))]
    scene.enter(0.0)
    while (now := scene.deadline) is not None:
        happened += [(now, message) for message in scene.advance(now)]

    assert symbolic(*acts, until=60.0).messages == happened


@pytest.mark.parametrize("perception", ["raw", "symbolic"])
def test_an_utterance_is_dropped_whole_or_not_at_all(perception: str) -> None:
    faults = PerceptionFaults(dropped_speech=0.5)
    film = Filmed(*SPEAKS * 60, until=90.0, perception=perception, frame=FRAME, faults=faults)
    told = Counter(
        it.active if isinstance(it, VoiceActivity) else type(it)
        for it in film.of(VoiceActivity, ActionBegan, ActionEnded)
    )

    if perception == "raw":
        assert told[True] % 8 == 0
        assert told[True] / 8 == pytest.approx(30, abs=10)
    else:
        assert told[ActionBegan] == told[ActionEnded] == pytest.approx(30, abs=10)


def test_turning_one_fault_on_does_not_change_the_others() -> None:
    alone = raw(LookAt(FACE), until=20.0, gaze=2.0)
    with_others = raw(LookAt(FACE), until=20.0, gaze=2.0, position=0.01, dropped_speech=0.5)

    assert [it.direction for it in alone.of(HeadPose)] == [it.direction for it in with_others.of(HeadPose)]


@pytest.mark.parametrize(
    ("name", "value"),
    [("gaze", -1.0), ("lost_faces", -0.1), ("dropped_frames", 1.5), ("lost_for", (0.4, 0.1)), ("yaw", math.nan)],
)
def test_a_wrong_fault_is_refused_by_name(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=name):
        PerceptionFaults(**{name: value})


# -- words ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("film", [raw, symbolic])
def test_words_that_are_heard_are_announced_and_known_a_moment_after_the_speech(film: Any) -> None:
    filmed = film(*speech("Which one?", 1.0), until=3.0)

    told = [(each.text, each.final, each.began.seconds, each.at.seconds) for each in filmed.of(Utterance)]
    assert told == [("", False, 0.0, 0.0), ("Which one?", True, 0.0, pytest.approx(1.3))]


@pytest.mark.parametrize("film", [raw, symbolic])
def test_of_speech_that_is_missed_there_are_no_words(film: Any) -> None:
    said = [act for number in range(40) for act in speech(str(number), 0.5)]
    filmed = film(*said, until=60.0, dropped_speech=0.5)

    words = filmed.of(Utterance)
    announced, final = ([each.id for each in words if each.final is is_final] for is_final in (False, True))
    assert announced == final
    assert 5 < len(final) < 35
    if film is symbolic:
        began = [each.at for each in filmed.of(ActionBegan) if each.action == "speak"]
        assert began == [each.began for each in words if each.final]
