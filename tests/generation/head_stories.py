"""Stories (`tests/stories.py`) of who owns the robot's head, and where it moves it. At 10 s it is on a face.

    a hand is followed through a manipulation even while it rests
        with glance_factor=100
        10 act; 15 act over; 20 time
        owners: 10 hands hand, 16.1 face human
        shifts: 10 maintenance hand, 16.1 maintenance human

| step | says |
|---|---|
| `10 hand 0.3`, `10 no face`, `10 face` | the world: how fast the hand is; no person; as ever |
| `10 lost human`, `10 found human` | the face |
| `10 act`, `10 act over` | the person manipulates the piece |
| `10 event e started kind=... objects=piece,other` | a connection event: the person's, about the piece |
| `10 pace 4 10` | recent mean time between connection events, and how many there were |
| `10 gaze 0.6 -0.3 0.7` | where the robot looks |
| `10 fragment gazes piece`, `10 fragment rests`, `10 fragment over` | a gaze of the fragment; its block; its end |
| `10 inhibit target piece`, `10 inhibit hold`, `10 inhibit over` | a lease on the gaze |
| `10 think piece`, `10 thought` | between the fragments of a turn |
| `10 unreached response-2`, `10 body lost`, `10 recognition lost` | what fails |
| `20 time` | nothing happens |
"""

from engage_hri.schemas.perception import ActorFound, ActorLost
from tests.generation.heads import AT, Stage, act, event, inhibition, looking_at, on_the_face, statistics, world
from tests.stories import Story, number


def check(story: Story) -> None:
    """Play the story: who owned the head, and all shifts, are what it says."""
    stage = on_the_face(**{name: float(value) for name, value in story.config.items()})
    for step in story.steps:
        time, *words = step.split()
        stage.until(float(time))
        take(stage, *words)

    assert [f"owners: {_told(stage.owners)}", f"shifts: {_told(stage.shifts)}"] == story.becomes


def take(stage: Stage, verb: str, *words: str) -> None:
    now, arbiter = stage.now, stage.arbiter
    match verb, *words:
        case "time", *_:
            return
        case "hand", speed:
            arbiter.feed(world(speed=float(speed)), now)
        case "no", "face":
            arbiter.feed(world(person=False), now)
        case "face", *_:
            arbiter.feed(world(), now)
        case (("lost" | "found"), person):
            arbiter.feed((ActorLost if verb == "lost" else ActorFound)(actor=person, at=AT), now)
        case "act", *over:
            arbiter.feed(act(ends=bool(over)), now)
        case "event", id, state, *fields:
            said: dict[str, object] = dict(field.split("=") for field in fields)
            if "objects" in said:
                said["objects"] = tuple(filter(None, str(said["objects"]).split(",")))
            arbiter.feed(event(id, state, **said), now)
        case "pace", mtbce, events:
            arbiter.feed(statistics(None if mtbce == "none" else float(mtbce), int(events)), now)
        case "gaze", x, y, z:
            arbiter.feed(looking_at((float(x), float(y), float(z))), now)
        case "fragment", "gazes", target:
            arbiter.fragment_gazes(target)
        case "fragment", "rests":
            arbiter.fragment_rests()
        case "fragment", "over":
            arbiter.fragment_lets_go()
        case "inhibit", "over":
            arbiter.inhibit(None)
        case "inhibit", mode, *target:
            arbiter.inhibit(inhibition(mode, *target))
        case "think", target:
            arbiter.think(target)
        case "thought", *_:
            arbiter.stop_thinking()
        case "unreached", shift:
            arbiter.shift_failed(shift, now)
        case "body", "lost":
            arbiter.body_lost()
        case "recognition", "lost":
            arbiter.recognition_lost()
        case _:
            raise ValueError(f"no step is {' '.join((verb, *words))!r}")
    stage.rule()


def _told(changes: list[tuple[float, str, str]]) -> str:
    return ", ".join(" ".join(filter(None, (number(at), kind, target))) for at, kind, target in changes) or "none"
