"""Two requesters, one server and a bad network, played with the pure machines alone: no bus, no loop, one heap.

Everything that happens is written down as it happens at its own place (what the service did, what a caller was told),
and `World.judge` holds the two against each other. It knows requests by (client, life, number) and nothing of states.
"""

import heapq
import random
from collections.abc import Callable

from msgspec import structs

from engage_hri.schemas.faults import EngageError, Fault, RunFailed
from engage_hri.schemas.requests import Answer, Cancel, KeepAlive, Kept, Outcome, Refused, Request, kind_of
from engage_hri.schemas.units import Stamp
from engage_hri.services.requests import asking
from engage_hri.services.requests.asking import NeverEnded, RequestRefused
from engage_hri.services.requests.serving import ServingFault
from tests.requests.request_ends import REQUESTS, Asked, Client, Server

CALM = 150.0
"""Seconds after the last mishap: longer than all that anybody waits for."""


class World:
    """The network. Each direction of each client keeps its order, as a link does; messages are lost and doubled."""

    def __init__(self, seed: int, *, is_fair: bool = False) -> None:
        """is_fair: nobody dies and no link is cut; a tenth of the messages is lost."""
        self.chance = random.Random(seed)
        self.lies = random.Random(f"{seed} lies")
        self.window = random.Random(f"{seed} window").choice([1, 2, 64])
        self.is_fair = is_fair
        self.now = 0.0
        self.heap: list[tuple[float, int, Callable[[], None]]] = []
        self.count = 0
        self.loss, self.double = self.chance.choice([(0.0, 0.0), (0.3, 0.3), (0.6, 0.1)])
        self.delay = self.chance.choice([0.0, 0.2, 2.0])
        if is_fair:
            self.loss, self.double, self.delay = self.chance.choice([0.0, 0.1]), 0.1, 0.2
        self.cut: set[str] = set()
        self.last: dict[tuple[str, str], float] = {}
        self.lives = 0
        self.server: Server | None = None
        self.servers: list[Server] = []
        self.clients: dict[str, Client] = {}
        self.all_clients: list[Client] = []
        self.sent = 0
        self.missed_at: dict[str, float] = {}
        """When the server last missed the token of each client."""
        if is_fair:
            self.start_server()
        for name in ("ann", "bob"):
            self.start_client(name)

    # -- time ----------------------------------------------------------------------------------------------------

    def later(self, seconds: float, do: Callable[[], None]) -> None:
        self.count += 1
        heapq.heappush(self.heap, (self.now + seconds, self.count, do))

    def wake(self, at: float | None, tick: Callable[[], None]) -> None:
        if at is not None:
            self.later(max(0.0, at - self.now), tick)

    def run(self, until: float) -> None:
        while self.heap and self.heap[0][0] <= until:
            self.now, _, do = heapq.heappop(self.heap)
            do()
        self.now = until

    # -- the network ---------------------------------------------------------------------------------------------

    def carry(self, link: tuple[str, str], arrive: Callable[[], None]) -> None:
        self.sent += 1
        if self.cut & set(link) or self.chance.random() < self.loss:
            return
        for _ in range(2 if self.chance.random() < self.double else 1):
            at = max(self.last.get(link, 0.0), self.now + self.chance.uniform(0.0, self.delay))
            self.last[link] = at
            self.later(at - self.now, arrive)

    def to_server(self, client: Client, message: Request | KeepAlive) -> None:
        def arrive() -> None:
            server = self.server
            if server is None:
                return
            if isinstance(message, KeepAlive):
                sent = min(self.now, message.at.seconds)
                server.carry_out(server.machine.keep_alive(message, sent, self.now, client.run))
            else:
                server.carry_out(server.machine.take(message, self.now, client.run))

        self.carry((client.name, "server"), arrive)

    def deceive(self, name: str) -> None:
        """A stranger speaks of a request that the server knows, in its requester's name. It must change nothing."""
        server, client = self.server, self.clients[name]
        names = server.names.values() if server is not None else ()
        known = [asked for whose, asked in names if whose[:2] == (name, client.life)]
        if server is None or not known:
            return
        asked = self.lies.choice(known)
        kind, made = kind_of(asked), [make(asked.id) for make, _ in REQUESTS]
        lies = [Cancel(id=asked.id), Cancel(id=asked.id, of=kind), *(one for one in made if kind_of(one) == kind)]
        lies = [structs.replace(lie, revision=99, requester=name, life=client.life) for lie in lies]
        kept = Kept(kind, asked.id, 99, "end", 1e6)
        still = KeepAlive(live=(kept,), at=Stamp("w", self.now), requester=name, life=client.life)
        effects = [effect for lie in lies for effect in server.machine.take(lie, self.now, "stranger")]
        effects += server.machine.keep_alive(still, self.now, self.now, "stranger")
        assert all(isinstance(effect, ServingFault) and not effect.is_ours for effect in effects)

    def to_clients(self, server: Server, answer: Answer) -> None:
        for client in list(self.clients.values()):
            self.carry(("server", client.name), lambda client=client: self.hear(client, answer))  # type: ignore[misc]

    def hear(self, client: Client, answer: Answer) -> None:
        if client.is_alive:
            client.hear(answer)

    # -- lives: tokens come and go a moment later than what they tell of -----------------------------------------

    def start_client(self, name: str) -> None:
        self.lives += 1
        client = Client(self, name, str(self.lives))
        self.clients[name] = client
        self.all_clients.append(client)
        run = str(self.lives)
        if self.server is not None:
            self.tell_client(client, self.server.run)
        self.later(self.chance.uniform(0.0, 0.2), lambda: self.tell_server(name, run))

    def tell_server(self, name: str, run: str) -> None:
        if self.server is not None and self.clients[name].run == run:
            self.server.carry_out(self.server.machine.requester_there(name, run, self.now))

    def tell_client(self, client: Client, run: str) -> None:
        if client.is_alive and self.server is not None and self.server.run == run:
            client.carry_out(client.machine.server_there("realizer", run, self.now))

    def restart_client(self, name: str) -> None:
        self.clients[name].is_alive = False
        if self.server is not None:
            self.server.carry_out(self.server.machine.requester_gone(name, self.now))
        self.start_client(name)

    def kill_server(self) -> None:
        if self.server is not None:
            self.server.is_alive = False
            self.server = None
            for client in self.clients.values():
                client.carry_out(client.machine.server_gone("realizer", self.now))

    def start_server(self) -> None:
        if self.server is None:
            self.lives += 1
            self.server = server = Server(self, str(self.lives))
            self.servers.append(server)
            for name, client in self.clients.items():
                server.carry_out(server.machine.requester_there(name, client.run, self.now))
                self.later(self.chance.uniform(0.0, 0.2), lambda client=client: self.tell_client(client, server.run))  # type: ignore[misc]

    def flap(self, name: str) -> None:
        """The link is cut for so long that its token goes, and comes back with the same life.

        One end finds it dead up to the lease of a silent link later than the other.
        """
        server, client = self.server, self.clients[name]
        if server is None:
            return
        self.cut.add(name)

        def missed() -> None:
            if self.server is server and self.clients[name] is client and name in self.cut:
                self.missed_at[name] = self.now
                server.carry_out(server.machine.requester_gone(name, self.now))

        self.later(self.chance.uniform(0.0, 1.9), missed)
        client.carry_out(client.machine.server_gone("realizer", self.now))

        def back() -> None:
            self.cut.discard(name)
            if self.server is server and self.clients[name] is client:
                server.carry_out(server.machine.requester_there(name, client.run, self.now))
                self.tell_client(client, server.run)

        self.later(self.chance.uniform(0.1, 20.0), back)

    # -- callers -------------------------------------------------------------------------------------------------

    def ask(self, name: str) -> None:
        """Ids are small numbers, so that clients, lives and kinds collide."""
        client, id = self.clients[name], str(self.chance.randrange(6))
        request, key = self.chance.choice(REQUESTS)
        is_new = client.machine.state(id) is asking.AskingState.ENDED
        was = client.machine.request(id)
        if is_new and id in client.asked:
            return  # within one life an id is used once
        effects = client.machine.send(key, request(id), self.now)
        if is_new:
            client.asked.append(id)
        elif was is not None and type(was) is not type(request(id)):
            assert isinstance(effects[0], asking.TellEnd)  # refused by name, and the live one goes on
            return
        elif client.machine.state(id) is asking.AskingState.GIVEN_UP:
            return
        client.carry_out(effects)

    def cancel(self, name: str) -> None:
        client = self.clients[name]
        if client.asked:
            self.cancel_one(client, self.chance.choice(client.asked))

    def cancel_one(self, client: Client, id: str) -> None:
        client.cancelled.add(Asked(client.name, client.life, id))
        client.carry_out(client.machine.cancel(id, Fault(reason="changed my mind"), self.now))

    def mishap(self) -> None:
        chance, name = self.chance, self.chance.choice(("ann", "bob"))
        what = ("ask", "cancel", "cut", "flap", "kill", "start", "restart", "network")
        match chance.choices(what, (9, 2, 0, 0, 0, 0, 0, 0) if self.is_fair else (9, 4, 2, 1, 1, 2, 1, 1))[0]:
            case "ask":
                self.ask(name)
            case "cancel":
                self.cancel(name)
            case "cut":
                self.cut.add(name)
                self.later(chance.choice([0.5, 3.0, 10.0, 40.0]), lambda: self.cut.discard(name))
            case "flap":
                self.flap(name)
            case "kill":
                self.kill_server()
            case "start":
                self.start_server()
            case "restart":
                self.restart_client(name)
            case "network":
                self.loss, self.double = chance.choice([(0.0, 0.0), (0.3, 0.3), (0.9, 0.0)])

    # -- the end -------------------------------------------------------------------------------------------------

    def play(self, mishaps: int) -> None:
        for _ in range(mishaps):
            self.mishap()
            self.deceive(self.lies.choice(("ann", "bob")))
            self.run(self.now + self.chance.choice([0.0, 0.1, 1.0, 5.0]))
        self.run(self.now + (12.0 if self.is_fair else 45.0))  # until every cut has healed
        self.contents = self._contents()
        self.loss, self.double, self.cut = 0.0, 0.0, set()
        self.start_server()
        for client in self.clients.values():  # what a caller still waits for, it gives up now
            for id in client.machine.ids:
                self.cancel_one(client, id)
        self.run(self.now + CALM)

    def _contents(self) -> list[tuple[Request, Request]]:
        """Of what is being performed long after the last change: the newest content, and what the service has."""
        assert self.server is not None or not self.is_fair
        pairs = []
        for client in self.clients.values():
            for id in client.machine.ids:
                newest = client.machine.request(id)
                got = self.server.content.get(Asked(client.name, client.life, id)) if self.server else None
                if newest is not None and got is not None and newest.is_updatable:
                    pairs.append((newest, got))
        return pairs

    def judge_fair(self) -> None:
        """Each caller is told what its service did, and each service has what was asked last."""
        assert self.server is not None
        for client in self.all_clients:
            for id in client.asked:
                (end,) = client.ends[id]
                asked = Asked(client.name, client.life, id)
                if isinstance(end, RunFailed):
                    assert isinstance(end, NeverEnded), end
                    assert asked in client.cancelled
                elif isinstance(end, RequestRefused):
                    refusals = self.server.ended.get(asked, [])
                    is_his = [isinstance(each, Refused) for each in refusals]
                    assert is_his == [True] or asked in client.cancelled, "refused by nobody"
        for newest, got in self.contents:
            assert newest.revision == got.revision
            assert newest.authority == got.authority
        assert self.server.lapsed == [], "a live request was not kept alive"
        assert self.sent < 60 * sum(len(client.asked) for client in self.all_clients) + 1000, "a storm of messages"

    def judge(self) -> None:
        """Raises AssertionError."""
        for client in self.clients.values():
            assert client.machine.ids == ()
            assert client.machine.deadline is None, "something is pending for ever"
        for client in self.all_clients:
            in_order = [id for id in client.asked if id in client.first_sent]
            assert client.first_sent == in_order, "sent in another order than asked"
            for id in client.asked:
                ends = client.ends[id]
                assert len(ends) == 1 if client.is_alive else len(ends) <= 1, (client.name, id, ends)
                for end in ends:
                    self._judge_end(Asked(client.name, client.life, id), end)
        for server in self.servers:
            assert server.mistakes == []
            assert all(times == 1 for times in server.handed.values()), "handed over twice"
            assert all(len(ends) == 1 for ends in server.ended.values()), "ended twice"
        assert self.server is not None
        live = [name for name in self.server.names if self.server.machine.is_live(name)]
        assert set(live) <= self.server.deaf
        lives = {(client.name, client.life) for client in self.all_clients if client.is_alive}
        for whose, _ in self.server.names.values():
            if whose[:2] not in lives:
                assert whose in self.server.stopped | self.server.ended.keys(), "performed for the dead"

    def judge_gone(self, asked: Asked) -> None:
        """Who is told that the server is gone is not told it while that still performs the request.

        What was on its way as the server missed the client has a lease, and is not counted.
        """
        server, missed = self.server, self.missed_at.get(asked.client, 0.0)
        if server is not None and server.handed_at.get(asked, self.now) < missed < self.now:
            assert asked in server.stopped | server.ended.keys(), f"{asked} goes on after it was told to have failed"

    def _judge_end(self, asked: Asked, end: Outcome | EngageError) -> None:
        """A caller is told an outcome only if a service has ended this very request with it."""
        if isinstance(end, Outcome):
            statuses = [
                each.status
                for server in self.servers
                for each in server.ended.get(asked, ())
                if hasattr(each, "status")
            ]
            assert end.status in statuses  # type: ignore[attr-defined]
            assert (end.requester, end.life, end.id) == asked
