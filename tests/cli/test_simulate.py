"""`engage simulate`: sessions in processes of their own, their files, and what goes wrong with them."""

import asyncio
import csv
import json
import signal
import sys
from pathlib import Path

import pytest
from rich.console import Console

from engage_hri.services.commandline.shell.config import Config, load
from engage_hri.services.commandline.study import session as playing
from engage_hri.services.commandline.study import session as workers
from engage_hri.services.commandline.study import simulate
from engage_hri.services.commandline.study.session import Order, SessionResult, play, play_all
from engage_hri.services.commandline.study.tables import FILES, PLOTS, grid
from engage_hri.services.runtime.virtual_time import Deadlock
from engage_hri.services.study import summary
from engage_hri.services.study.hypotheses import HypothesisResult
from engage_hri.services.study.records import SessionRecord
from tests.cli.command import Engage, start, threads

QUICK = ("--condition", "operational", "--limit", 12)
"""Sessions that are broken off early."""


def rows(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / name).open(newline="") as file:
        return list(csv.DictReader(file))


def order(number: int, config: Config | None = None) -> Order:
    return Order(session=number, condition="operational", seed=number, limit=60.0, config=config or Config())


# -- a study ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two whole sessions, the same seed in two conditions, each in a process of its own."""
    out = tmp_path_factory.mktemp("study")
    options = simulate.Options(
        sessions=1, seed=3, out=out, condition=["operational", "degraded-generation"], human="appendix-b", jobs=2,
        quiet=True,
    )  # fmt: skip
    assert simulate.main(options) == 0
    return out


def test_a_study_leaves_all_its_files(study: Path) -> None:
    assert {file.name for file in study.iterdir()} == {*FILES, "study.json"}
    assert all((study / name).read_bytes().startswith(b"\x89PNG") for name in PLOTS)


def test_each_session_is_a_row_and_each_event(study: Path) -> None:
    sessions, events = rows(study, "sessions.csv"), rows(study, "events.csv")

    assert [(row["condition"], row["session"], row["seed"], row["finished"]) for row in sessions] == [
        ("operational", "0", "3", "true"), ("degraded-generation", "0", "3", "true"),
    ]  # fmt: skip
    assert list(events[0]) == [
        "session", "condition", "kind", "initiator", "cause", "outcome", "optional", "start", "delay",
    ]  # fmt: skip
    for row in sessions:
        assert int(row["events"]) == sum(event["condition"] == row["condition"] for event in events)
        assert 100 < float(row["completion_time"]) < float(row["duration"]) < 300


def test_a_degraded_robot_initiates_no_gaze(study: Path) -> None:
    seen = {
        (row["condition"], row["initiator"])
        for row in rows(study, "events.csv")
        if row["kind"] in ("directed_gaze", "mutual_facial_gaze")
    }

    assert ("operational", "robot") in seen
    assert ("degraded-generation", "robot") not in seen


def test_the_study_says_how_to_repeat_it(study: Path) -> None:
    told = json.loads((study / "study.json").read_text())

    assert (told["human"], told["sessions"], told["seed"], told["ordered"], told["played"]) == (
        "appendix-b", 1, 3, 2, 2,
    )  # fmt: skip
    assert told["configurations"]["degraded-generation"]["generation"]["condition"] == "degraded-generation"
    assert told["configurations"]["operational"]["simulation"]["seed"] == 3
    assert "python" in told["versions"]


def test_the_summary_answers_the_hypotheses(study: Path) -> None:
    text = (study / "summary.md").read_text()

    assert [row["hypothesis"] for row in rows(study, "hypotheses.csv")] == ["6", "7", "8", "11a", "11b"]
    for expected in ("MTBCE", "completion time", "too few sessions", "The person is a model"):
        assert expected in text


def test_the_number_of_processes_changes_nothing(engage: Engage, tmp_path: Path) -> None:
    """Not even with more processes than sessions."""
    common = ("simulate", *QUICK, "--sessions", 2, "--seed", 5, "--quiet")

    one = engage(*common, "--out", tmp_path / "one", "--jobs", 1)
    many = engage(*common, "--out", tmp_path / "many", "--jobs", 3)

    assert one.code == many.code == 3
    files = {file.name: file.read_bytes() for file in (tmp_path / "one").iterdir()}
    assert files == {file.name: file.read_bytes() for file in (tmp_path / "many").iterdir()}


@pytest.mark.real_time
def test_another_process_plays_the_same_session_with_the_robot() -> None:
    """And again the same after another one. Broken off early, to be quick."""
    orders = simulate.orders_of(simulate.Options(sessions=1, seed=7, out=Path(), limit=12.0))[:2]
    told: list[SessionResult] = []

    asyncio.run(play_all([*orders, *orders], 1, told.append))

    assert told == [*map(play, orders)] * 2
    assert all(len(played.events) > 2 for played in told)


# -- what is refused --------------------------------------------------------------------------------------------


def test_results_are_not_overwritten_unless_asked(engage: Engage, tmp_path: Path) -> None:
    again = ("simulate", *QUICK, "--sessions", 1, "--quiet", "--out", tmp_path)
    (tmp_path / "hypotheses.csv").write_text("of an earlier study")
    (tmp_path / "notes.txt").write_text("mine")

    refused, done = engage(*again), engage(*again, "--overwrite")

    assert refused.code == 2
    assert "hypotheses.csv" in refused.err
    assert "--overwrite" in refused.err
    assert (done.code, done.out) == (3, "")
    assert not (tmp_path / "hypotheses.csv").exists(), "a stale result among new ones"
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert not list(tmp_path.glob(".*")), "parts of files left"


def test_a_directory_that_cannot_be_is_refused(engage: Engage, tmp_path: Path) -> None:
    (tmp_path / "file").touch()

    result = engage("simulate", *QUICK, "--out", tmp_path / "file")

    assert (result.code, result.out) == (2, "")
    assert "cannot be made" in result.err


def test_without_matplotlib_nothing_is_played(
    engage: Engage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "engage_hri.services.study.plots", raising=False)
    for name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)

    result = engage("simulate", *QUICK, "--out", tmp_path / "new")

    assert (result.code, result.out) == (2, "")
    assert "[study]'" in result.err
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("--condition", "degraded"), "no condition 'degraded'"),
        (("--sessions", "0"), "--sessions"),
        (("--limit", "nan"), "--limit"),
        (("--set", "simulation.sede=1"), "do you mean `seed`"),
        (("--set", "simulation.human=listening"), "use --human"),
        (("--set", "generation.condition=operational"), "use --condition"),
    ],
)
def test_bad_arguments_are_refused(arguments: tuple[str, ...], reason: str, engage: Engage, tmp_path: Path) -> None:
    result = engage("simulate", "--out", tmp_path / "new", *arguments)

    assert (result.code, result.out) == (2, "")
    assert reason in result.err
    assert not (tmp_path / "new").exists()


def test_the_users_settings_are_stronger_than_a_conditions_but_not_than_its_name(tmp_path: Path) -> None:
    file = tmp_path / "engage.toml"
    file.write_text("[generation]\ncondition = 'operational'\n[simulation]\nseed = 9\n")
    settings = ["simulation.faults.missed_look=0.1"]
    options = simulate.Options(sessions=2, seed=40, out=Path(), config=file, settings=settings)

    orders = simulate.orders_of(options)

    worse = [order for order in orders if order.condition == "degraded-recognition"]
    assert [order.config.simulation.faults.missed_look for order in worse] == [0.1, 0.1]
    assert worse[0].config.simulation.faults.wrong_look > 0
    assert [order.config.generation.condition for order in worse] == ["degraded-recognition"] * 2
    assert [order.config.simulation.seed for order in orders] == [40, 41] * 3
    assert {order.config.collaboration.mode for order in orders} == {"task"}


def test_tables_of_many_sessions_fit_a_narrow_terminal() -> None:
    """Three conditions of 200 sessions, in 80 columns."""
    found = HypothesisResult(
        hypothesis="11a", claim="", measure="", unit="s", condition="degraded-recognition", n=200, operational=189.66,
        degraded=195.47, difference=-26.46, low=-126.46, high=118.13, effect=-0.5, p=1.0, p_corrected=1.0,
        verdict="opposite",
    )  # fmt: skip
    records = [
        SessionRecord(session=number, condition=condition, seed=0, finished=True, completion_time=150.0 + number)
        for condition in simulate.CONDITIONS
        for number in range(200)
    ]

    for table in (summary.hypotheses([found]), summary.overview(records)):
        assert Console(width=200).measure(grid(table)).maximum <= 80


# -- what goes wrong --------------------------------------------------------------------------------------------


def test_a_session_that_does_not_end_is_broken_off() -> None:
    nobody = load(settings=["simulation.human=none"])

    record = play(order(0, nobody)).record

    assert (record.finished, record.reason) == (False, "not over after 60 s")
    assert record.duration == pytest.approx(60.0, abs=1.0)


@pytest.mark.parametrize("error", [Deadlock("all tasks wait"), RuntimeError("all tasks\nwait")])
def test_a_bug_costs_its_session_and_is_told(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    async def fails(*arguments: object) -> None:
        raise ExceptionGroup("services", [error])

    monkeypatch.setattr(playing, "play_tangram", fails)

    played = play(order(4))

    assert (played.record.session, played.record.finished) == (4, False)
    assert played.record.reason == f"{type(error).__name__}: all tasks wait"
    assert "Traceback" in played.trace


def answering(deed: str) -> tuple[str, ...]:
    """A child that answers each order, but does `deed` with session 1."""
    code = (
        "import json, os, signal, sys\n"
        "for line in sys.stdin:\n"
        "    order = json.loads(line)\n"
        f"    if order['session'] == 1: {deed}\n"
        "    record = dict(session=order['session'], condition=order['condition'], seed=0, finished=True)\n"
        "    print(json.dumps(dict(record=record)), flush=True)\n"
    )
    return (sys.executable, "-c", code)


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("deed", "reason"),
    [
        ("os.kill(os.getpid(), signal.SIGKILL)", "the process that played it ended with signal 9"),
        ("sys.exit(5)", "the process that played it ended with exit code 5"),
        ("print('{\"half', end='', flush=True) or sys.exit(5)", "the process that played it ended with exit code 5"),
        ("signal.pause()", "no answer within 1 s"),
    ],
)
async def test_a_child_that_is_lost_costs_only_its_session(
    deed: str, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "PATIENCE", 1.0)
    told: list[SessionRecord] = []

    def tell(played: SessionResult) -> None:
        told.append(played.record)

    await play_all([order(number) for number in range(4)], 2, tell, worker=answering(deed))

    told.sort(key=lambda record: record.session)
    assert [(record.session, record.reason) for record in told] == [(0, ""), (1, reason), (2, ""), (3, "")]
    assert [record.finished for record in told] == [True, False, True, True]


def children_of(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def is_there(pid: int) -> bool:
    return Path(f"/proc/{pid}").exists()


@pytest.mark.real_time
async def test_ctrl_c_ends_the_children_and_keeps_what_there_is(tmp_path: Path) -> None:
    process = await start("simulate", *QUICK, "--sessions", 2000, "--jobs", 2, "--out", tmp_path)
    assert process.stdout is not None
    async with asyncio.timeout(60):
        first = await process.stdout.readline()
        children = children_of(process.pid)
        started = threads(process.pid)
        process.send_signal(signal.SIGINT)
        await process.communicate()

    assert b"connection events" in first
    assert process.returncode == 130
    assert len(children) == 2
    assert started == []
    assert not any(map(is_there, children))
    told = json.loads((tmp_path / "study.json").read_text())
    assert 1 <= told["played"] == len(rows(tmp_path, "sessions.csv")) < told["ordered"] == 2000
    assert rows(tmp_path, "events.csv")
