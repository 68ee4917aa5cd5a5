"""Acts of Appendix B before the camera over the table alone: what the told person does is drawn, and perceived.

python -m tests.perception.acts_seen [--seed 0] [--every 0.5] [--first 0.05]     (a minute of processor)

A part of `seen_and_heard`, in a fraction of its time: pictures are taken around the acts only. --first: instant of
the first picture, so that others fall into the 0.6 s of a carry.
"""

import argparse
from bisect import bisect_right
from collections.abc import Iterator, Sequence

from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import World
from engage_hri.services.perception.pieces.keeping import HandKeeper, PieceKeeper
from engage_hri.services.perception.pieces.spotting import SpottedPieces
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.perceive.manipulation import Manipulation
from tests.perception.filmed_room import ROBOT, held_at
from tests.perception.pieces.tables import EVEN, TABLE, drawn
from tests.perception.pieces.test_finding import finder
from tests.perception.seen_and_heard import told

BESIDE: Seconds = 2.2
"""Time before and after an act in which pictures are taken."""
STILL_TAKES = 2
"""Pictures of a table that stays as it is in which pieces are found anew."""


def worlds_seen(worlds: Sequence[World], instants: Sequence[Seconds]) -> Iterator[World]:
    """What the camera over the table tells of these worlds at some instants."""
    times = [each.at.seconds for each in worlds]
    looks, pieces, hands = finder(), PieceKeeper(TABLE), HandKeeper(TABLE)
    before: object = None
    seen, takes = None, 0
    for number, at in enumerate(instants):
        entities = worlds[max(0, bisect_right(times, at) - 1)].entities
        people = [each for each in entities if each.kind == "person"]
        poses = {each.id: (*each.position[:2], each.yaw) for each in entities if each.kind == "object"}
        palms = tuple(held_at(each.position) for each in entities if each.kind == "hand")
        takes = takes + 1 if before == (poses, palms) else 0
        before = poses, palms
        if seen is None or takes < STILL_TAKES:
            seen = looks.find(drawn(poses, light=EVEN._replace(noise=8), hands=palms, seed=1, take=number))
        spotted = SpottedPieces(at=Stamp("", at), **seen._asdict())
        lying, known = pieces.feed(spotted, at), hands.feed(spotted.hands, people, at)
        yield World(entities=(*people, *lying, *known), at=Stamp("", at))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--every", type=float, default=0.5)
    parser.add_argument("--first", type=float, default=0.05)
    options = parser.parse_args()
    record = told(options.seed)
    worlds = [each for each in record.messages(World) if each.at.seconds > 0]
    acts = [each for kind in (ActionBegan, ActionEnded) for each in record.messages(kind) if each.action == "act"]
    times = [each.at.seconds for each in acts]
    count = int((max(times) + BESIDE) / options.every)
    instants = [options.first + k * options.every for k in range(count)]
    near = [at for at in instants if at == instants[0] or any(abs(at - each) < BESIDE for each in times)]
    for each in sorted(acts, key=lambda act: act.at.seconds):
        print(f"told   {each.at.seconds:7.2f} {type(each).__name__:11s} {', '.join(each.targets)}")
    manipulation = Manipulation(ROBOT, RecognitionConfig())
    for world in worlds_seen(worlds, near):
        for each in manipulation.feed(world, world.at.seconds):
            for change in each.changes:
                kind = ActionBegan if change.began else ActionEnded
                print(f"seen   {change.at:7.2f} {kind.__name__:11s} {', '.join(change.targets)}", flush=True)


if __name__ == "__main__":
    main()
