"""Conditions that were set while a recording was made: its stretches, their sessions, and their tier."""

import asyncio
import random
from pathlib import Path

import pytest
from msgspec import structs

from engage_hri.schemas import keys
from engage_hri.schemas.fragments import StudyCondition
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.interface import Bus, Sample
from engage_hri.services.client.robot import Robot
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.study.analyse import Stretch, sessions, stretches
from engage_hri.services.recording.disk import read
from engage_hri.services.recording.reading import Recording, messages
from engage_hri.services.recording.tiers import tiers
from engage_hri.services.runtime.service import Ready
from engage_hri.services.tangram.people.config import SimulationConfig
from tests.recording.files import recording, sample
from tests.recording.runs import tangram

END = 100.0
WORLD = keys.PERCEIVED_ACTION


def at(seconds: float) -> Stamp:
    return Stamp("loop", seconds)


def begins(seconds: float, name: str, *, by: str = "Anna", speech_only: bool = False) -> Sample:
    told = StudyCondition(at=at(seconds), name=name, by=by, speech_only=speech_only)
    return sample(keys.STUDY_CONDITION, told, seconds)


def event(id: str, began: float, decided: float | None) -> list[Sample]:
    def told(state: str, seconds: float) -> Sample:
        made = ConnectionEvent(
            id=id, at=at(seconds), kind="adjacency_pair", initiator="robot", responder="ann",
            state=state, started=at(began), cause="reference", delay=None if state == "started" else seconds - began,
        )  # type: ignore[arg-type]  # fmt: skip
        return sample(keys.connection_event("ann", "adjacency_pair"), made, seconds)

    return [told("started", began), *([] if decided is None else [told("succeeded", decided)])]


def person(id: str, since: float, until: float) -> list[Sample]:
    found, lost = ActorFound(actor=id, at=at(since)), ActorLost(actor=id, at=at(until))
    return [sample(WORLD, found, since), sample(WORLD, lost, until)]


def looks(id: str, since: float, until: float) -> list[Sample]:
    began = ActionBegan(actor=id, action="look", targets=("robot",), at=at(since))
    ended = ActionEnded(actor=id, action="look", targets=("robot",), at=at(until))
    return [sample(WORLD, began, since), sample(WORLD, ended, until)]


def made(*samples: Sample) -> Recording:
    last = sample(keys.ROBOT_ACTION, ActionEnded(actor="robot", action="nod", at=at(END)), END)
    return recording(sorted((*samples, last), key=lambda one: one.at))


def parts(of: Recording, named: str = "") -> list[Stretch]:
    return stretches(((one.message, at) for one, at in messages(of)), named, of.duration)


def test_a_recording_without_conditions_is_one_stretch() -> None:
    assert parts(made()) == [Stretch("recorded", 0.0, END)]
    assert parts(made(begins(3.0, "", by="")), "a") == [Stretch("a", 0.0, END)]


def test_each_condition_lasts_until_the_next() -> None:
    found = parts(made(begins(10.0, "a"), begins(20.0, "b"), begins(30.0, "b", speech_only=True), begins(60.0, "")))

    assert found == [
        Stretch("", 0.0, 10.0),
        Stretch("a", 10.0, 20.0),
        Stretch("b", 20.0, 60.0),
        Stretch("", 60.0, END),
    ]


def test_one_from_before_the_recording_holds_from_its_beginning() -> None:
    told = StudyCondition(at=at(-50.0), name="a", by="Anna")
    late = sample(keys.STUDY_CONDITION, told, 0.0)

    assert parts(made(late)) == [Stretch("a", 0.0, END)]


def generation(seconds: float, run: str = "") -> Sample:
    """Generation comes, or goes. run: the life that comes; empty: it goes."""
    told = PeerAlive(participant="generation", run=run) if run else PeerGone(participant="generation")
    return sample(keys.alive("generation"), told, seconds)


def test_a_restart_of_generation_ends_a_condition_and_none_is_in_force_until_one_is_set() -> None:
    found = parts(made(begins(10.0, "a"), begins(50.0, "", by=""), begins(70.0, "b")), "all")

    assert found == [
        Stretch("all", 0.0, 10.0), Stretch("a", 10.0, 50.0), Stretch("", 50.0, 70.0), Stretch("b", 70.0, END),
    ]  # fmt: skip


def test_a_condition_ends_when_its_generation_dies_whether_or_not_another_comes() -> None:
    killed = [generation(0.0, "1"), begins(10.0, "a"), generation(40.0)]

    dead = [Stretch("", 0.0, 10.0), Stretch("a", 10.0, 40.0), Stretch("", 40.0, END)]
    assert parts(made(*killed)) == dead
    assert parts(made(*killed, generation(42.0, "2"), begins(42.0, "", by=""))) == dead


def test_a_generation_that_was_only_cut_off_goes_on_under_its_condition() -> None:
    found = parts(made(generation(0.0, "1"), begins(10.0, "a"), generation(40.0), generation(45.0, "1")))

    assert found[1:] == [Stretch("a", 10.0, 40.0), Stretch("", 40.0, 45.0), Stretch("a", 45.0, END)]


def test_no_condition_that_somebody_set_is_no_condition_after_a_restart_either() -> None:
    found = parts(made(begins(10.0, ""), begins(50.0, "", by="")), "all")

    assert found == [Stretch("all", 0.0, 10.0), Stretch("", 10.0, END)]


def test_what_the_recorder_was_told_holds_through_restarts_where_nobody_sets_a_condition() -> None:
    given = made(generation(0.0, "1"), begins(0.0, "", by=""), generation(40.0), generation(42.0, "2"))

    assert parts(given, "all") == [Stretch("all", 0.0, END)]


def test_events_after_the_death_of_generation_count_under_no_condition_and_that_is_told() -> None:
    given = made(
        *person("ann", 0.0, END), generation(0.0, "1"), begins(0.0, "a"), *event("one", 20.0, 21.0), generation(40.0),
        generation(42.0, "2"), begins(42.0, "", by=""), *event("two", 60.0, 61.0),
    )  # fmt: skip

    (one,) = sessions(given)

    assert [each.start for each in one.events] == [20.0]
    assert one.doubts[-1] == "left out: 60 s under no condition"


def test_what_is_under_no_condition_or_with_nobody_is_left_out_and_told() -> None:
    given = made(
        *person("ann", 5.0, 45.0), *event("one", 20.0, 21.0), begins(10.0, "a"), begins(30.0, "b"), begins(50.0, "c")
    )

    found = sessions(given)

    assert [(one.condition, len(one.events)) for one in found] == [("a", 1), ("b", 0)]
    assert found[0].doubts == ("left out: 10 s under no condition, 50 s of c with nobody there",)


def test_an_event_counts_where_it_began_with_what_became_of_it_later() -> None:
    given = made(*person("ann", 0.0, END), begins(0.0, "a"), begins(50.0, "b"), *event("one", 49.0, 52.0))

    first, second = sessions(given)

    (one,) = first.events
    assert (one.start, one.outcome, one.delay) == (49.0, "succeeded", 3.0)
    assert second.events == ()
    assert (first.record.duration, second.record.duration) == (50.0, 50.0)


def test_a_look_that_began_before_a_condition_is_eye_contact_from_its_beginning() -> None:
    given = made(*person("ann", 0.0, END), *looks("ann", 10.0, 70.0), begins(0.0, "a"), begins(40.0, "b"))

    second = sessions(given)[1]

    contact = second.record.eye_contact
    assert contact is not None
    assert (contact.first, contact.second, contact.last) == pytest.approx((1.0, 0.5, 0.0))


@pytest.mark.parametrize("seed", range(40))
def test_random_recordings_agree_with_counting_by_hand(seed: int) -> None:
    """Each event, each instant, by the definition: the condition in force when it began has it, and no other."""
    chance = random.Random(seed)
    changes = sorted((round(chance.uniform(0.0, END), 3), chance.choice(["a", "b", "c", ""])) for _ in range(6))
    began = {f"e{number}": round(chance.uniform(0.0, 99.0), 3) for number in range(60)}
    given = made(
        *(begins(when, name) for when, name in changes),
        *(one for id, when in began.items() for one in event(id, when, min(when + chance.uniform(0.1, 9.0), END))),
        *person("ann", 0.0, END),
    )

    in_force = {id: next((name for when, name in reversed(changes) if when <= began[id]), "") for id in began}
    seconds = dict.fromkeys("abc", 0.0)
    for (since, name), (until, _) in zip(changes, [*changes[1:], (END, "")], strict=True):
        if name:
            seconds[name] += until - since
    found = sessions(given)
    for name in "abc":
        mine = [one for one in found if one.condition == name]
        starts = sorted(offset + one.start for session, offset in _offsets(mine, changes, name) for one in session)
        assert starts == pytest.approx(sorted(began[id] for id in began if in_force[id] == name), abs=1e-6)
        assert sum(one.record.duration for one in mine) == pytest.approx(seconds[name], abs=1e-6)


def _offsets(mine, changes, name):  # type: ignore[no-untyped-def]
    """Sessions of a condition with the times at which it began; of the same one twice in a row, once."""
    begun = [
        when for number, (when, each) in enumerate(changes)
        if each == name and (number == 0 or changes[number - 1][1] != name)
    ]  # fmt: skip
    assert len(begun) == len(mine)
    return [(one.events, when) for one, when in zip(mine, begun, strict=True)]


async def test_a_real_run_is_divided_as_it_was_told(tmp_path: Path) -> None:
    """The whole task, whose condition somebody changes twice: all its events are in one of the sessions."""

    async def anna(bus: Bus, ready: Ready) -> None:
        async with Robot.on(bus) as robot:
            ready()
            for name, speech_only in (("operational", False), ("words alone", True), ("operational", False)):
                await robot.set_condition(name, speech_only=speech_only, by="Anna")
                await asyncio.sleep(40.0)
            await asyncio.get_running_loop().create_future()

    config = Config(simulation=SimulationConfig(human="stochastic", seed=3))
    await tangram(tmp_path / "a.mcap", config, more={"anna": anna})
    whole = read(tmp_path / "a.mcap")

    found = sessions(whole)

    assert [one.condition for one in found] == ["operational", "words alone", "operational"]
    assert [round(one.record.duration) for one in found[:2]] == [40, 40]
    ids = {one.message.id for one, _ in messages(whole) if isinstance(one.message, ConnectionEvent)}
    assert sum(len(one.events) for one in found) == len(ids) > 50
    looks = [
        [one for one in session.events if one.initiator == "robot" and one.kind == "directed_gaze"]
        for session in found
    ]
    assert not looks[1]
    assert looks[0]
    (tier,) = (tier for tier in tiers(whole) if tier.name == "study condition")
    assert [(one.value, round(one.end - one.begin)) for one in tier.annotations[:2]] == [
        ("operational", 40), ("words alone, speech only", 40),
    ]  # fmt: skip


# -- what a killed program told, and what a recorder that comes late hears of --------------------------------------


def by_camera(*samples: Sample) -> list[Sample]:
    return [structs.replace(one, source="camera", life="7") for one in samples]


def test_a_person_is_gone_with_the_program_that_told_of_them() -> None:
    here = sample(keys.alive("camera"), PeerAlive(participant="camera", run="7"), 1.0)
    killed = sample(keys.alive("camera"), PeerGone(participant="camera"), 51.0)
    seen = by_camera(person("ann", 1.0, END)[0], looks("ann", 1.0, END)[0])

    (one,) = sessions(made(here, killed, *seen, begins(0.0, "a"), begins(60.0, "b")))

    assert (one.condition, one.doubts[-1]) == ("a", "left out: 40 s of b with nobody there")


def test_who_was_there_before_the_recording_is_known_by_what_goes_on() -> None:
    look = ActionBegan(actor="ann", action="look", targets=("robot",), at=at(-20.0))
    state = OngoingActions(actor="ann", at=at(-20.0), actions=(look,), seen=True)
    (late,) = by_camera(sample(keys.perceived_ongoing("camera", "ann"), state, 0.0))
    here = sample(keys.alive("camera"), PeerAlive(participant="camera", run="7"), 0.0)

    (one,) = sessions(made(here, late))

    assert one.record.eye_contact is not None
    assert one.record.eye_contact.first == pytest.approx(1.0)
