"""Tiers once more, from the definition: read by the plain `mcap` library as dicts, and nothing of Engage.

Each thing that goes on is looked for its end among all that was told after it. That is slow, and simple.
"""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mcap.reader import make_reader

TIER = {
    "look": "gaze",
    "speak": "speech",
    "point": "points",
    "nod": "nods",
    "shake": "shakes",
    "act": "manipulations",
}
ENDS = {"failed", "preempted", "withdrawn", "superseded", "completed", "lost"}
Stretch = tuple[str, str, float, float, str]
"""Actor, name of the tier without its number, beginning, end, value."""


class Told(NamedTuple):
    """A message of the bus. came: seconds from the beginning. at: time that it tells of."""

    came: float
    at: float
    key: str
    life: str
    is_past: bool
    content: dict[str, Any]


class Oracle:
    """A recording as the plain library reads it."""

    def __init__(self, path: Path) -> None:
        self.told: list[Told] = []
        offsets: dict[str, list[tuple[float, float]]] = {}
        raw = []
        with path.open("rb") as file:
            reader = make_reader(file)
            facts = next(each for each in reader.iter_metadata() if each.name == "engage").metadata
            wall, began, clock, self.robot = int(facts["wall"]), float(facts["began"]), facts["clock"], facts["robot"]
            for _, channel, message in reader.iter_messages(log_time_order=False):
                came = (message.log_time - wall) / 1e9
                if channel.topic == "recording/clock":
                    for name, known in json.loads(message.data).items():
                        offsets.setdefault(name, []).append((came, known["offset"]))
                raw.append((came, channel, message))
        self.end = max((came for came, *_ in raw), default=0.0)

        def time(stamp: list[Any], came: float) -> float:
            if stamp[0] == clock:
                return float(stamp[1]) - began
            known = offsets.get(stamp[0])
            if not known:
                return came
            return float(stamp[1]) + ([one for one in known if one[0] <= came] or known[:1])[-1][1] - began

        self.time = time
        seen = set()
        for came, channel, message in raw:
            key = channel.metadata.get("key", "")
            if not key or channel.message_encoding != "json":
                continue
            content = json.loads(message.data)
            if not isinstance(content, dict):
                continue
            stamp = content.get("since" if content.get("type") == "head_owner" else "at")
            at = time(stamp, came) if isinstance(stamp, list) else came
            if key.split("/")[2] == "evt":
                if message.data in seen:
                    continue
                seen.add(message.data)
            is_past = channel.metadata.get("past") == "true"
            self.told.append(Told(came, at, key, channel.metadata.get("life", ""), is_past, content))

    def of(self, *kinds: str) -> list[tuple[int, Told]]:
        return [(n, one) for n, one in enumerate(self.told) if one.content.get("type") in kinds]

    def gone(self, life: str) -> float | None:
        """Time at which the last of a life went, if none of it came back."""
        there: dict[str, str] = {}
        gone: dict[str, float] = {}
        for _, one in self.of("peer_alive", "peer_gone"):
            name = one.content["participant"]
            if one.content["type"] == "peer_alive":
                there[name] = one.content.get("run", "")
                gone.pop(there[name], None)
            elif (run := there.pop(name, None)) is not None and run not in there.values():
                gone[run] = one.came
        return gone.get(life)

    def until(self, life: str, at: float) -> float:
        gone = self.gone(life)
        return at if gone is None else min(at, gone)

    # -- what is said of them --------------------------------------------------------------------------------------

    def stretches(self) -> list[Stretch]:
        """All annotations, in no order."""
        found = [*self.actions(), *self.present(), *self.words(), *self.spoken(), *self.events(), *self.heads()]
        found += self.performed()
        clipped = [(*one[:2], max(0.0, one[2]), one[3], one[4]) for one in found if one[3] >= 0]
        names = dict.fromkeys(one[:2] for one in clipped)
        return [one for name in names for one in drawn([one for one in clipped if one[:2] == name])]

    def actions(self) -> Iterator[Stretch]:
        for number, began, at in self._begun():
            what, told = began.content, began
            end = self.until(told.life, self._end_of(number, what, told.life, at))
            value = " ".join(what.get("targets", ()))
            value = value or ("away" if what["action"] == "look" else what.get("behavior") or what["action"])
            if what["action"] == "speak" and what.get("behavior"):
                said = [one.content["word"] for _, one in self._words_of(what["behavior"], number, end)]
                value = " ".join(said) or value
            yield what["actor"], TIER[what["action"]], at, end, value

    def _begun(self) -> list[tuple[int, Told, float]]:
        """Actions that began: those that were told, and those of states that were not going on by then."""
        found: list[tuple[int, Told, float]] = []
        known: list[str] = []
        for number, one in self.of("action_began", "ongoing_actions"):
            if one.content["type"] == "action_began":
                name = json.dumps(one.content, sort_keys=True)
                if name not in known:
                    known.append(name)
                    found.append((number, one, one.at))
                continue
            if one.content.get("seen") is False:
                continue
            for action in one.content.get("actions", ()):
                name = json.dumps(action, sort_keys=True)
                if not self._goes_on(found, number, action, one.life):
                    at = one.at if name in known else self.time(action["at"], one.at)
                    found.append((number, one._replace(content=action), at))
                known.append(name)
        return found

    def _goes_on(self, found: list[tuple[int, Told, float]], number: int, action: dict[str, Any], life: str) -> bool:
        for begun, told, at in found:
            same = all(
                told.content.get(name) == action.get(name) for name in ("actor", "action", "behavior", "targets")
            )
            if same and told.life == life and self._end_at(begun, told.content, life, at)[0] >= number:
                return True
        return False

    def _end_of(self, number: int, what: dict[str, Any], life: str, at: float) -> float:
        return self._end_at(number, what, life, at)[1]

    def _end_at(self, number: int, what: dict[str, Any], life: str, begun: float) -> tuple[int, float]:
        """Place and time of the first message after this beginning that ends it."""
        for later in range(number + 1, len(self.told)):
            one = self.told[later]
            if self._is_end(one, what, life, begun):
                return later, one.at
        return len(self.told), self.end

    def _is_end(self, one: Told, what: dict[str, Any], life: str, begun: float) -> bool:
        content, action, targets = one.content, what["action"], what.get("targets", [])
        if content.get("actor") != what["actor"]:
            return False
        match content["type"]:
            case "actor_lost":
                return True
            case "action_ended":
                behavior = action == "look" or content.get("behavior", "") == what.get("behavior", "")
                is_its = content["action"] == action and behavior
                return is_its and content.get("targets", []) in ([], targets) and one.at >= begun
            case "action_began":
                if content["action"] != action:
                    return False
                alone = action not in ("point", "act") and not content.get("behavior") and not what.get("behavior")
                same = (
                    content.get("behavior", "") == what.get("behavior", "") and content.get("targets", []) == targets
                )
                return action == "look" or alone or same
            case "ongoing_actions":
                if content.get("seen") is False:
                    return True
                behavior = what.get("behavior", "")
                there = [(each["action"], each.get("behavior", ""), each.get("targets", []))
                         for each in content.get("actions", ())]  # fmt: skip
                if one.life == life:
                    return (action, behavior, targets) not in there
                its = [each[1:] for each in there if each[0] == action]
                if action == "look":
                    return bool(its)
                alone = action not in ("point", "act") and not behavior
                return any(one == (behavior, targets) or (alone and not one[0]) for one in its)
        return False

    def present(self) -> Iterator[Stretch]:
        since: dict[str, Told] = {}
        for _, one in self.of("actor_found", "actor_lost", "ongoing_actions"):
            actor, seen = one.content["actor"], one.content.get("seen")
            comes = one.content["type"] == "actor_found" or seen is True
            if comes:
                since.setdefault(actor, one)
            elif (one.content["type"] == "actor_lost" or seen is False) and actor in since:
                begun = since.pop(actor)
                yield actor, "present", begun.at, self.until(begun.life, one.at), "here"
        for actor, begun in since.items():
            yield actor, "present", begun.at, self.until(begun.life, self.end), "here"

    def words(self) -> Iterator[Stretch]:
        newest: dict[tuple[str, str], Told] = {}
        for _, one in self.of("utterance"):
            name = one.content["actor"], one.content["id"]
            if one.content.get("final", True) and (name not in newest or newest[name].at <= one.at):
                newest[name] = one
        for (actor, _), one in newest.items():
            began, ended = one.content["began"], one.content.get("ended")
            end = one.at if ended is None else self.time(ended, one.at)
            if one.content["text"]:
                yield actor, "words", self.time(began, one.at), end, one.content["text"]

    def _words_of(self, behavior: str, number: int, end: float) -> list[tuple[int, Told]]:
        """Words of one performance of a speech of the robot."""
        again = [n for n, one in self.of("action_began") if n > number and one.content.get("behavior") == behavior
                 and one.content["action"] == "speak"]  # fmt: skip
        ended = [n for n, one in self.of("action_ended") if n > number and one.content.get("behavior") == behavior
                 and one.content["action"] == "speak"]  # fmt: skip
        last = min([*again, *ended, len(self.told)])
        return [(n, one) for n, one in self.of("word_spoken")
                if number < n < last and f"{one.content['block']}:{one.content['behavior']}" == behavior]  # fmt: skip

    def spoken(self) -> Iterator[Stretch]:
        for number, began, at in self._begun():
            if began.content["action"] == "speak" and began.content.get("behavior"):
                since = at
                for _, one in self._words_of(began.content["behavior"], number, self.end):
                    yield self.robot, "words", since, one.at, one.content["word"]
                    since = one.at

    def events(self) -> Iterator[Stretch]:
        changes: dict[str, list[tuple[Told, dict[str, Any]]]] = {}
        for _, one in self.of("connection_event", "open_events"):
            for event in (
                [one.content] if one.content["type"] == "connection_event" else one.content.get("events", ())
            ):
                changes.setdefault(event["id"], []).append((one, event))
        for told in changes.values():
            one, first = told[0]
            at = self.time(first["at"], one.at)
            begin = at - (first["at"][1] - first["started"][1])
            last = next((n for n, (_, event) in enumerate(told) if event["state"] in ENDS), None)
            if last is None:
                gone = self.gone(one.life)
                state = told[-1][1]["state"] if gone is None else "lost"
                end, event = self.end if gone is None else gone, told[-1][1]
                state = "open" if state == "started" else state
            else:
                end = self.time(told[last][1]["at"], told[last][0].at)
                event = told[last][1]
                if event["state"] == "completed" and last:
                    event = told[last - 1][1]
                state = "open" if event["state"] == "started" else event["state"]
            delay = "" if event.get("delay") is None else f" {event['delay']:.3f} s"
            about = f", about {' '.join(event['objects'])}" if event.get("objects") else ""
            value = (
                f"{state}{delay}, {event['initiator']} to {event['responder']}{about}, {event.get('cause', 'human')}"
            )
            value += ", optional" if event.get("optional") else ""
            yield "connection events", event["kind"], begin, end, value

    def heads(self) -> Iterator[Stretch]:
        owners = self.of("head_owner")
        last: tuple[float, str, str] | None = None
        for _, one in [*owners, (0, None)]:
            kind, target = (
                ("none", "")
                if one is None
                else (one.content["owner"]["kind"], one.content["owner"].get("target", ""))
            )
            name = "" if kind == "none" else f"{kind} {target}".strip()
            if last is not None and one is not None and (name, one.life) == last[1:]:
                continue
            if last is not None:
                yield (
                    self.robot,
                    "head owner",
                    last[0],
                    self.until(last[2], self.end if one is None else one.at),
                    last[1],
                )
            last = (one.at, name, one.life) if one is not None and name else None

    def performed(self) -> Iterator[Stretch]:
        blocks: dict[str, Told] = {}
        behaviors: dict[tuple[str, str], Told] = {}
        for _, one in self.of("block_progress", "sync_point_progress"):
            content, block = one.content, one.content.get("block")
            if content["type"] == "sync_point_progress":
                name = block, content["behavior"]
                if content["sync"] == "start":
                    behaviors[name] = one
                elif content["sync"] == "end" and name in behaviors:
                    yield self._performed("behaviors", behaviors.pop(name), one.at, ":".join(name))
            elif block and content["progress"] == "start":
                blocks[block] = one
            elif block and content["progress"] == "end":
                for name in [name for name in behaviors if name[0] == block]:
                    yield self._performed("behaviors", behaviors.pop(name), one.at, ":".join(name))
                if block in blocks:
                    yield self._performed(
                        "blocks", blocks.pop(block), one.at, f"{block}: {content.get('status', '')}"
                    )
        for block, begun in blocks.items():
            yield self._performed("blocks", begun, self.end, block)
        for name, begun in behaviors.items():
            yield self._performed("behaviors", begun, self.end, ":".join(name))

    def _performed(self, tier: str, begun: Told, end: float, value: str) -> Stretch:
        return self.robot, tier, begun.at, self.until(begun.life, end), value


def drawn(stretches: Sequence[Stretch]) -> Iterator[Stretch]:
    """What is drawn of the stretches of one name, in whole milliseconds where they touch.

    Each lies in the first tier in which none goes on when it begins. What is shorter is drawn a millisecond long.
    What comes after that in its tier begins where it ends, if it had begun before.
    """
    tiers: list[list[tuple[Stretch, float, float]]] = []
    for one in sorted(stretches, key=lambda one: one[2:4]):
        free = [tier for tier in tiers if all(ms(other[3]) <= ms(one[2]) for other, _, _ in tier)]
        if free:
            tier = free[0]
        else:
            tiers.append(tier := [])
        begin = one[2]
        for other, other_began, other_ended in tier:
            is_longer = other_ended > other[3]  # than it was
            if max(ms(other_ended), ms(other_began) + 1) > ms(one[2]) or (is_longer and other_ended > begin):
                begin = max(begin, other_ended, max(ms(other_ended), ms(other_began) + 1) / 1000)
        end = max(one[3], begin + 0.001)
        tier.append((one, begin, end))
        yield (*one[:2], begin, end, one[4])


def ms(at: float) -> int:
    return round(1000 * at)
