"""The table of claims on the head once more, slowly: every tick asks every row. The oracle of the arbiter.

It shares no code with the arbiter, keeps no deadlines and looks at one person, one hand and one object at a time.
Times are multiples of an eighth of a second, which floats hold exactly.
"""

from dataclasses import dataclass, field

TICK = 0.125
TIMES = {
    "DWELL": 0.25, "LEAST_FIXATION": 0.25, "HAND_ONSET": 0.25, "HAND_STILLNESS": 0.75, "RESPONSE_HOLD": 0.75,
    "GLANCE_DURATION": 1.0, "MTBCE_PRIOR": 5.75, "ONSET": 0.375, "STAYS": 1.0,
}  # fmt: skip
"""Times of both sides, in place of those of the arbiter."""
FACE_LOST = 2.0
"""Seconds for which the head stays with a face that is out of sight."""
ROWS = ("inhibition", "fragment", "glance", "response", "hands", "face")

Owner = tuple[str, str]
NOBODY: Owner = ("none", "")


@dataclass
class Answer:
    target: str
    until: float = float("inf")


@dataclass
class HeadTable:
    """Set what is the case, then `ask`. owner: kind and target."""

    now: float = 0.0
    owner: Owner = NOBODY
    inhibited: tuple[str, str] | None = None
    fragment: str | None = None
    answers: dict[int, Answer] = field(default_factory=dict)
    speaks_since: float | None = None
    listens_until: float | None = None
    """Time until which the head is on who has spoken; infinite while they speak."""
    fast: bool = False
    fast_since: float = 0.0
    acting: bool = False
    followed: bool = False
    still_since: float = float("-inf")
    seen: bool = True
    seen_until: float = 0.0
    pace: float = TIMES["MTBCE_PRIOR"]
    quiet_since: float = 0.0
    on_face: bool = False
    glance_until: float | None = None
    let_go: float | None = None
    looks_since: float = 0.0
    base: str = ""
    held: str = ""
    changes: list[tuple[float, str, str]] = field(default_factory=list)
    shifts: list[tuple[float, str]] = field(default_factory=list)

    # -- what is the case -----------------------------------------------------------------------------------------

    def direct(self, event: int, target: str) -> None:
        self.quiet_since = self.now
        if self.owner[0] != "fragment" or self.owner[1] in ("", target):
            self.answers[event] = Answer(target)

    def decide(self, event: int, succeeded: bool) -> None:
        if event in self.answers and succeeded:
            self.answers[event].until = self.now + TIMES["RESPONSE_HOLD"]
        else:
            self.answers.pop(event, None)

    def speak(self, speaks: bool) -> None:
        if not speaks:
            self.speaks_since = None
        elif self.speaks_since is None:
            self.speaks_since = self.now

    def move_hand(self, fast: bool) -> None:
        if fast and not self.fast:
            self.fast_since = self.now
        if self.fast and not fast:
            self.still_since = self.now
        self.fast = fast

    def act(self, acting: bool) -> None:
        if self.acting and not acting:
            self.still_since = self.now
        self.acting = acting

    def see(self, person: bool) -> None:
        if self.seen and not person:
            self.seen_until = self.now
        self.seen = person

    def rest(self) -> None:
        if self.fragment is not None:
            self.fragment = self.base

    def inhibit(self, mode: str, target: str) -> None:
        self.inhibited = (mode, target) if mode else None
        if mode != "hold":
            self.held = ""

    # -- what follows ---------------------------------------------------------------------------------------------

    def rows(self) -> dict[str, str]:
        """Claims by row: where each wants the head."""
        wants: dict[str, str] = {}
        if self.inhibited is not None:
            wants["inhibition"] = self.inhibited[1]
        if self.fragment is not None:
            wants["fragment"] = self.fragment
        there = self.seen or self.now - self.seen_until < FACE_LOST
        running = self.glance_until is not None and self.now < self.glance_until
        due = self.glance_until is None and not self.on_face and self.now - self.quiet_since >= self.pace
        if there and (running or due):
            wants["glance"] = "human"
        listens = self._listens(there)
        self.answers = {event: answer for event, answer in self.answers.items() if self.now < answer.until}
        if self.answers:
            wants["response"] = self.answers[max(self.answers)].target
        elif listens:
            wants["response"] = "human"
        if self.acting or (self.fast and self.now - self.fast_since >= TIMES["HAND_ONSET"]):
            self.followed = True
        elif not self.fast and self.now - self.still_since >= TIMES["HAND_STILLNESS"]:
            self.followed = False
        if self.followed:
            wants["hands"] = "hand"
        wants["face"] = "human" if there else ""
        return wants

    def _listens(self, there: bool) -> bool:
        if there and self.speaks_since is not None and self.now - self.speaks_since >= TIMES["ONSET"]:
            self.listens_until = float("inf")
        elif self.speaks_since is None and self.listens_until == float("inf"):
            self.listens_until = self.now + TIMES["STAYS"]
        if not there or (self.listens_until is not None and self.now >= self.listens_until):
            self.listens_until = None
        return self.listens_until is not None

    def ask(self) -> None:
        wants = self.rows()
        best = next(row for row in ROWS if row in wants)
        kind = self.owner[0]
        if kind == "none" or ROWS.index(best) < ROWS.index(kind):
            next_owner = best
        elif kind in wants:
            self.let_go, next_owner = None, kind
        else:
            self.let_go = self.now if self.let_go is None else self.let_go
            next_owner = best if self.now - self.let_go >= TIMES["DWELL"] else kind
        if self._is_brief(next_owner, wants.get(next_owner, self.owner[1])):
            next_owner, wants = kind, {kind: self.owner[1]}
        if next_owner != kind:
            self.let_go = None
            if kind == "glance":
                self.glance_until, self.quiet_since = None, self.now
            elif next_owner == "glance":
                self.glance_until = self.now + TIMES["GLANCE_DURATION"]
        owner = (next_owner, wants.get(next_owner, self.owner[1]))
        if next_owner == "inhibition" != kind and self.inhibited is not None and self.inhibited[0] == "hold":
            self.held = self.fragment or ""
        if owner[1] != self.owner[1]:
            self.looks_since = self.now
        if owner != self.owner:
            self.owner = owner
            self.changes.append((self.now, *owner))
        self._move_head()

    def _is_brief(self, kind: str, target: str) -> bool:
        """True if the head would leave what it has just come to, and nobody has ordered that."""
        is_ordered = kind in ("inhibition", "fragment") or self.owner == NOBODY
        ends = self.looks_since + TIMES["LEAST_FIXATION"]
        return target != self.owner[1] and not is_ordered and self.now < ends

    def _move_head(self) -> None:
        kind, target = self.owner
        if ((target or self.base) == "human") != self.on_face:
            self.on_face = not self.on_face
            self.quiet_since = self.now
        if kind == "inhibition" and self.inhibited is not None and self.inhibited[0] == "hold":
            target = self.held
        ours = kind != "fragment" or target == "human"
        if self.let_go is None and target not in ("", self.base) and ours:
            self.base = target
            self.shifts.append((self.now, target))
