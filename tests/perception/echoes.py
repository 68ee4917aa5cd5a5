"""A robot whose voice comes into its own microphone, and a person who breaks in: made sound, and what hearing tells.

    python -m tests.perception.echoes [MINUTES]

prints the table of docs/hearing.md: rooms by delay and echo, the robot alone, and people who break in as loud as its
echo. All in virtual time, through the service.
"""

import asyncio
import sys
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan, ActionEnded, SoundFrame
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.voice.outlets import PIECE, SOON
from engage_hri.services.perception.hearing.intake import LOOK_AROUND
from engage_hri.services.perception.hearing.voice import RATE, Samples
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.perception.spoken import FAINT, PHRASES, pink, voice
from tests.perception.test_hearing import hearing

SAYS = (
    "Hello, I am the robot at this table, and I would like to build a figure with you.",
    "Which piece do you want to take first?", "Please move the purple triangle to the top of the figure.",
    "I think the blue square belongs beside the green one.", "Thank you very much, that was a good idea.",
    "Now take the small red triangle, and lay it on the left.", "Do you see the yellow piece next to your hand?",
    "We are almost done, only two pieces are missing.", "No, I mean the other one, the large one in the middle.",
    "That is right. What shall we do next?",
)  # fmt: skip
LEARNED = 4
"""Speeches before the first person breaks in."""
FRAME = 512


class Scene(NamedTuple):
    """Sound of a microphone. robot: its speeches, and when each is played. people: when each speaks."""

    microphone: Samples
    robot: list[tuple[float, Samples]]
    people: list[tuple[float, float]]


def loud(sound: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where a voice is: the truth of spoken.py."""
    level = np.convolve(sound**2, np.ones(160) / 160, "same")
    return np.asarray(level > FAINT**2 * level.max())


def room(delay: float, echoes: float, chance: np.random.Generator) -> NDArray[np.float64]:
    """The way of a sound through a room. delay: seconds. echoes: seconds in which they fall by 60 dB."""
    tail = chance.normal(size=round(0.5 * RATE)) * np.exp(-np.arange(round(0.5 * RATE)) / (echoes * RATE / 6.9))
    tail[0] = 2 * np.abs(tail).max()
    way = np.concatenate([np.zeros(round(delay * RATE)), tail])
    return np.asarray(way / np.sqrt((way**2).sum()))


def scene(
    speeches: int,
    delay: float,
    echoes: float,
    *,
    breaks_in: bool,
    noise: float = 30.0,
    drift: float = 0.0,
    seed: int = 1,
) -> Scene:
    """A robot that speaks, and who breaks in on each second speech, as loud as its echo.

    noise: decibels by which the echo is louder than pink noise. drift: share by which the loudspeaker is too slow.
    """
    chance = np.random.default_rng(seed)
    robot, people, end = [], [], 0
    for number in range(speeches):
        said = (voice(SAYS[number % len(SAYS)]) * 0.6).astype(np.int16)
        robot.append((end / RATE + 0.5, said))
        if breaks_in and number >= LEARNED and number % 2:
            at = end + 8000 + round(len(said) * chance.uniform(0.2, 0.6))
            people.append((at, voice(PHRASES[number // 2 % len(PHRASES)], "f3").astype(np.float64)))
        end += len(said) + 20000
    played = np.zeros(end)
    for at, said in robot:
        played[round(at * RATE) : round(at * RATE) + len(said)] = said
    played = np.interp(np.arange(end) * (1 + drift), np.arange(end), played)
    way = room(delay, echoes, chance)
    size = end + len(way)
    sound = np.fft.irfft(np.fft.rfft(played, size) * np.fft.rfft(way, size), size)[:end]
    level = np.sqrt(np.mean(sound[loud(sound)] ** 2))
    spoken = []
    for at, said in people:
        is_loud = loud(said)
        where = np.flatnonzero(is_loud)
        sound[at : at + len(said)] += (said * level / np.sqrt(np.mean(said[is_loud] ** 2)))[: end - at]
        spoken.append(((at + where[0]) / RATE, (at + where[-1]) / RATE))
    sound += pink(end) * level / 10 ** (noise / 20)
    return Scene(np.clip(sound, -32768, 32767).astype(np.int16), robot, spoken)


async def speak(control: Bus, begin: float, robot: list[tuple[float, Samples]]) -> None:
    """Tell what the robot's voice plays as control does: each piece a moment before it is heard."""
    number, size = 0, round(PIECE * RATE)
    for at, said in robot:
        for first in range(0, len(said), size):
            heard = begin + at + first / RATE
            await asyncio.sleep(heard - SOON - control.now())
            content = said[first : first + size].astype("<i2").tobytes()
            frame = SoundFrame(at=control.stamp(heard), rate=RATE, samples=content, number=number)
            control.publish(keys.ROBOT_SOUND, frame)
            number += 1
            if not first:
                began = ActionBegan(actor=control.robot, action="speak", at=control.stamp(heard))
                control.publish(keys.ROBOT_ACTION, began)
        await asyncio.sleep(begin + at + len(said) / RATE - control.now())
        ended = ActionEnded(actor=control.robot, action="speak", at=control.stamp())
        control.publish(keys.ROBOT_ACTION, ended)


async def listen(window: Bus, begin: float, microphone: Samples, late: float = 0.03) -> None:
    """Send sound of a microphone as a page does. late: seconds on its way."""
    for number in range(len(microphone) // FRAME):
        at = begin + number * FRAME / RATE
        await asyncio.sleep(at + FRAME / RATE + late - window.now())
        content = microphone[number * FRAME : (number + 1) * FRAME].astype("<i2").tobytes()
        frame = SoundFrame(at=window.stamp(at), rate=RATE, samples=content, number=number)
        window.publish(keys.sound("ann"), frame)


class Judged(NamedTuple):
    """What was heard. false: voices while nobody spoke. lags: from each onset until it was known; inf: it was not."""

    false: list[float]
    lags: list[float]
    minutes: float
    faults: list[str]


async def judged(hub: MemoryHub, made: Scene, **settings: Any) -> Judged:
    """Let hearing hear it."""
    known: list[float] = []
    async with hearing(hub, source="page", **settings) as heard:
        await asyncio.sleep(LOOK_AROUND + 0.1)
        begin = hub.join("clock", role="observer").now() + 0.5

        async def note(bus: Bus) -> None:
            with bus.subscribe(keys.PERCEIVED_ACTION) as inbox:
                async for received in inbox:
                    if isinstance(received.message, ActionBegan):
                        known.append(bus.now() - begin)

        noting = asyncio.create_task(note(hub.join("judge", role="observer")))
        await asyncio.gather(
            speak(hub.join("control"), begin, made.robot),
            listen(hub.join("console", role="wizard"), begin, made.microphone),
        )
        noting.cancel()
        faults = [each.reason for each in heard.told if type(each).__name__ == "Fault"]
    lags, used = [], set()
    for since, _ in made.people:
        lag = next((at - since for at in known if since - 0.05 <= at <= since + 1.0 and at not in used), float("inf"))
        lags.append(lag)
        used.add(since + lag)
    spoken = [(since - 0.05, until + 0.3) for since, until in made.people]
    false = [at for at in known if not any(since <= at <= until for since, until in spoken)]
    return Judged(false, lags, len(made.microphone) / RATE / 60, faults)


async def main(minutes: float) -> None:
    """Print the table. minutes: of each robot."""
    speeches = round(minutes * 60 / 3.9)
    print("delay, echoes, drift | robot alone: false voices a minute; if nothing is taken out | person breaks in")
    for delay, echoes, drift in (
        (0.02, 0.3, 0.0), (0.05, 0.3, 0.0), (0.08, 0.3, 0.0), (0.05, 0.6, 0.0), (0.05, 0.3, 2e-5), (0.05, 0.3, 5e-5)
    ):  # fmt: skip
        results = []
        for breaks_in, settings in ((False, {}), (False, {"is_deaf_while_robot_speaks": False}), (True, {})):
            made = scene(speeches if not settings else 20, delay, echoes, breaks_in=breaks_in, drift=drift)
            async with MemoryHub() as hub:
                results.append(await judged(hub, made, **settings))
        alone, off, broken = results
        lags = np.array(broken.lags)
        print(
            f"{1000 * delay:3.0f} ms, {echoes:.1f} s, {1e6 * drift:2.0f} ppm | "
            f"{len(alone.false) / alone.minutes:.2f} in {alone.minutes:.1f} min; "
            f"{len(off.false) / off.minutes:.1f} | "
            f"{np.mean(lags <= 0.2):.0%} of {len(lags)} within 0.2 s, median {np.median(lags):.3f} s; "
            f"{len(broken.false) / broken.minutes:.2f} a minute",
            flush=True,
        )


if __name__ == "__main__":
    run_virtual(main(float((sys.argv[1:] or ["10"])[0])))
