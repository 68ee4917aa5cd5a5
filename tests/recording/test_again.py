"""Recognition again, over a recording: the same events, to the last bit of their delays."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from engage_hri.schemas.ledger import Taken
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.services.bus.interface import Received
from engage_hri.services.commandline.config import Config
from engage_hri.services.recognition.again import Again, events_in, settings_of
from engage_hri.services.recording.disk import read
from engage_hri.services.recording.reading import Recording
from engage_hri.services.simulation.config import SimulationConfig
from tests.recording.runs import tangram


def told(recording: Recording) -> Iterator[Received]:
    return (one for number in range(len(recording)) if (one := recording.received(number)) is not None)


def lives(recording: Recording) -> dict[str, tuple[Again, list[ConnectionEvent]]]:
    """Each life of recognition again, with its events."""
    known = {(one.life, one.number): one for one in told(recording) if one.number}
    found: dict[str, tuple[Again, list[ConnectionEvent]]] = {}
    for one in told(recording):
        if isinstance(one.message, Taken):
            taken = one.message
            if taken.session not in found:
                config = settings_of(taken)
                assert config is not None
                found[taken.session] = (Again(recording.robot, taken.session, taken.at.clock, config), [])
            again, events = found[taken.session]
            events += events_in(again.take(taken, lambda life, number: known.get((life, number))))
    return found


def live(recording: Recording, session: str) -> list[ConnectionEvent]:
    events = [one.message for one in told(recording) if isinstance(one.message, ConnectionEvent)]
    return [event for event in events if event.session == session]


@pytest.mark.parametrize("perception", ["symbolic", "raw"])
async def test_the_anchor_scenario_gives_the_same_events(tmp_path: Path, perception: str) -> None:
    config = Config(simulation=SimulationConfig(human="scripted", perception=perception))
    await tangram(tmp_path / "a.mcap", config)
    recording = read(tmp_path / "a.mcap")

    [(session, (again, events))] = lives(recording).items()

    assert again.lack.is_nothing
    assert len(events) > 100
    assert events == live(recording, session)
