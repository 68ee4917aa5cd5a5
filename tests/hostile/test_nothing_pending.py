"""After an attack nothing is kept of requests that have ended, at either end."""

from typing import Any

import pytest

from engage_hri.services.requests.ends import RequestDesk, Requester
from tests.rigs.hostile.attacks import whole_robot
from tests.rigs.hostile.trial import Attack, _Trial, run


class Ends:
    """Every requester and every desk of an attack, and what they still know when it is judged."""

    def __init__(self) -> None:
        self.all: list[Requester | RequestDesk] = []
        self.judged = 0
        self.found: list[str] = []

    def judge(self) -> None:
        self.judged += len(self.all)
        for end in self.all:
            if end._bus.name == "control":
                continue  # the liar's, which need not end
            if isinstance(end, Requester):
                asking = end._asking
                self.found += [f"{end._bus.name} waits for {id}" for id in (*asking.ids, *asking._asked)]
                self.found += [f"{end._bus.name} has a deadline"] if asking.deadline is not None else []
            elif end.live or end._serving.deadline is not None:
                self.found.append(f"{end._server} has {end.live} live requests, deadline {end._serving.deadline}")


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> Ends:
    found = Ends()

    def registered(kind: type[Any]) -> None:
        init = kind.__init__

        def remember(self: Any, *arguments: Any, **options: Any) -> None:
            init(self, *arguments, **options)
            found.all.append(self)

        monkeypatch.setattr(kind, "__init__", remember)

    registered(Requester)
    registered(RequestDesk)
    judge = _Trial._judge

    async def look(self: _Trial, *arguments: Any) -> None:
        found.judge()
        await judge(self, *arguments)

    monkeypatch.setattr(_Trial, "_judge", look)
    return found


@pytest.mark.parametrize("seed", [0, 2, 4, 60])
def test_nothing_is_pending_after_lies_cuts_and_vanished_bodies(seed: int, ends: Ends) -> None:
    # Generation would ask for new glances all the time.
    services = {name: service for name, service in whole_robot().items() if name != "generation"}

    report = run(Attack(seed=seed, kinds=("body",), seconds=15.0), services)

    assert report.wrong == []
    assert ends.judged >= 4
    assert ends.found == []
