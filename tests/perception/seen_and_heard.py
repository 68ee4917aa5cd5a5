"""Appendix B from rendered film and spoken sound alone, beside the same person told exactly: their connection events.

python -m tests.perception.seen_and_heard [--seed 0] [--looks 0] [--films FOLDER]     (`make eyes`; half an hour)

--looks: number of the person, of those of whom nothing is learned. --films: keeps what was filmed. docs/eyes.md has
the differences.
"""

import argparse
import tempfile
from functools import partial
from pathlib import Path
from unittest.mock import patch

from engage_hri.schemas.perception import ActionBegan, Utterance
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.perception.eyes import service as eyes
from engage_hri.services.perception.hearing import device
from engage_hri.services.perception.hearing.config import HearingConfig
from engage_hri.services.perception.hearing.service import hear
from engage_hri.services.perception.pieces import service as pieces
from engage_hri.services.perception.pieces.config import PiecesConfig
from engage_hri.services.runtime.service import Service
from engage_hri.services.runtime.virtual_time import run_virtual
from engage_hri.services.tangram.people import service as simulation
from tests.perception.eyes.film_of_looks import EYES
from tests.perception.filmed_room import (
    WORDS,
    FilmedRoom,
    FilmingFaces,
    FilmingTable,
    TalkingPerson,
    colors,
    microphone,
)
from tests.perception.pieces.tables import EYE
from tests.scenario.playing import Record, play
from tests.scenario.test_appendix_b import EXPECTED, by_step

SPEAKING = ControlConfig(voice="espeak")
OTHERS = ("no", "which one")
"""Phrases that the recognizer expects, and nobody says."""


def told(seed: int) -> Record:
    """Play it with a person who is told exactly."""
    with patch.object(simulation, "_human", lambda *_: TalkingPerson(seed)):
        return run_virtual(play(resolution="table", control=SPEAKING))


def filmed(seed: int, looks: int, folder: Path, films: Path | None = None) -> Record:
    """Play it with a person who is only seen and heard. films: where what was filmed is kept."""
    room = FilmedRoom(seed, looks)
    table = PiecesConfig(colors=colors(folder), field_of_view=EYE.field, place=EYE.at, tilt=-EYE.down)
    sound = HearingConfig(source="parec", recognizer="sphinx", phrases=(*WORDS.values(), *OTHERS))
    senses: dict[str, Service] = {
        "simulation": room.live, "eyes": partial(eyes.see, config=EYES),
        "pieces": partial(pieces.keep_an_eye, config=table), "hearing": partial(hear, config=sound),
    }  # fmt: skip
    with (
        patch.object(eyes, "InsideWatching", FilmingFaces(room, films)),
        patch.object(pieces, "InsideWatching", FilmingTable(room, films)),
        patch.object(device, "opened", microphone(room)),
    ):
        return run_virtual(play(resolution="table", control=SPEAKING, people=senses))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--looks", type=int, default=0)
    parser.add_argument("--films", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        records = told(options.seed), filmed(options.seed, options.looks, Path(folder), options.films)
    for name, record in zip(("told", "seen and heard"), records, strict=True):
        words = [each.text for each in record.messages(Utterance) if each.final]
        acts = [
            f"{', '.join(each.targets)} {each.at.seconds:.1f} s"
            for each in record.messages(ActionBegan)
            if each.action == "act"
        ]
        print(f"{name}: {len(record.outcomes)} fragments, {len(record.events)} events; words: {', '.join(words)}")
        print(f"{name}: {len(acts)} acts: {'; '.join(acts)}")
    steps = [by_step(record) for record in records]
    for step in EXPECTED["table"]:
        for name, each in zip(("told", "seen"), steps, strict=True):
            print(f"{step:8s} {name}  {', '.join(each.get(step, []))}")


if __name__ == "__main__":
    main()
