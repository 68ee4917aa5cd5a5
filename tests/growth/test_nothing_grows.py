"""Nothing grows: N passers-by, blocks, clients and visitors leave no more behind than the N before them.

The law knows no class: it measures whatever can be reached from what runs (`reach.py`), and names what has grown by
the attributes that lead there.
"""

import asyncio
from pathlib import Path

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import SLACK
from engage_hri.services.bus.subscription import KEYS_KEPT
from engage_hri.services.client.performing import UTTERANCES_KEPT
from engage_hri.services.console.view import EVENTS_KEPT, WARNINGS_KEPT
from engage_hri.services.console.view import UTTERANCES_KEPT as UTTERANCES_SHOWN
from engage_hri.services.generation.turns.outcomes import MOST as WORDS_KEPT
from engage_hri.services.generation.turns.outcomes import PEOPLE
from engage_hri.services.recognition.events.limits import BLOCKS_KEPT
from engage_hri.services.recognition.events.machine import INTERJECTIONS_KEPT, TEXTS_KEPT
from engage_hri.services.recognition.events.scene import SPOKEN_KEPT
from engage_hri.services.recognition.events.session import ACTIONS_KEPT, TURNS_KEPT
from engage_hri.services.recognition.perceive.clocks import PEOPLE_KEPT, REPORTERS_KEPT
from engage_hri.services.recognition.perceive.identities import IDS_KEPT
from engage_hri.services.recording.disk import FULL_CHUNK
from engage_hri.services.recording.writing import MOST_CHANNELS
from engage_hri.services.requests.serving import KEPT as NAMES_KEPT
from tests.growth.lives import CALM, life
from tests.growth.reach import Growth, grown, modules, running, sizes
from tests.random_cases import share_of

LIMITS = {
    "_carriers": KEYS_KEPT, "_wanting": KEYS_KEPT, "_used": NAMES_KEPT, "_told": UTTERANCES_KEPT, "_told_of": PEOPLE,
    "_said": WORDS_KEPT, "_errors": PEOPLE_KEPT + 1, "_ended_turns": TURNS_KEPT, "_aborted_turns": TURNS_KEPT,
    "_performed": ACTIONS_KEPT, "_texts": TEXTS_KEPT, "_spoken": TEXTS_KEPT, "_points": BLOCKS_KEPT,
    "_interjected": INTERJECTIONS_KEPT,
    "events": EVENTS_KEPT, "said": UTTERANCES_SHOWN, "warned": WARNINGS_KEPT, "_encoded[*][*]": 2**20,
    "_channel_ids": MOST_CHANNELS, "channel_message_counts": MOST_CHANNELS,
    "_clocks": REPORTERS_KEPT, "_addressed": BLOCKS_KEPT, "_indices": FULL_CHUNK // 31, "records": FULL_CHUNK // 31,
    "_seen": IDS_KEPT, "joints": 20, "kinds": 4, "_heap": 4 * SLACK, "_heap[*]": 4, "_scheduled": 400,
    "echoes": SPOKEN_KEPT,
}  # fmt: skip
"""Containers that are bounded by number, not by time: a message of a recording has 31 bytes at least.
`joints` and `kinds` are of the message that a service has read last, whichever it was. The last two drop what is
outdated once there is much of it."""
STEPS = 6
"""Steps of life between two measures; of each, whatever leaks keeps at least one thing."""
HALF_A_DAY, QUIET = 120, 165.0
"""Steps of life before the first measure, and again before the second: 6 hours each, with so many seconds of quiet
after each step."""
REST: Seconds = 20.0
"""Time after which all that was begun is over."""


async def growth(folder: Path, steps: int, quiet: Seconds = 0.0, *, windows: bool) -> list[Growth]:
    """What is larger after 2 N steps of life than after N, each time after a calm, one more step, and a rest."""
    found = []
    async with life(folder, windows=windows) as step:
        for stretch in range(2):
            for number in range(steps + 1):
                if number == steps:
                    await asyncio.sleep(CALM)
                await step(stretch * (steps + 1) + number)
                await asyncio.sleep(quiet)
            await asyncio.sleep(REST)
            found.append(sizes({**running(), **modules()}, LIMITS))
    # The bytes of a message are its own: how many messages are kept counts, not how large the last ones were.
    return [one for one in grown(found[0], found[1], slack=STEPS // 2) if not one.path.endswith(".payload")]


async def test_a_robot_and_its_clients_keep_nothing_of_those_who_have_gone(tmp_path: Path) -> None:
    assert [str(one) for one in await growth(tmp_path, STEPS, windows=False)] == []


async def test_a_window_keeps_nothing_of_what_is_over_whether_somebody_looks_or_not(tmp_path: Path) -> None:
    """For half a day; in `make test` for an hour."""
    steps = share_of(HALF_A_DAY, HALF_A_DAY // STEPS)
    assert [str(one) for one in await growth(tmp_path, steps, QUIET, windows=True)] == []
