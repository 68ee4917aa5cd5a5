"""Settings in recordings: of all services and lives, without what is secret, and as a file that is read again."""

import asyncio
import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.participants import DEEPEST, ServiceSettings, SettingsFile, sections, text_of
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import Config, load
from engage_hri.services.control.config import ControlConfig, Displaced, Variability
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.recording.disk import read
from engage_hri.services.recording.reading import Recording
from engage_hri.services.recording.settings import changed, configuration, settings_of
from engage_hri.services.runtime.service import HIDDEN, is_secret, running, serve, shown, tell_settings
from engage_hri.services.tangram.people.config import SimulationConfig
from tests.recording.files import recording, sample
from tests.recording.runs import recording_to

OTHER = Config(
    covered_for=7.5,
    generation=GenerationConfig(condition="degraded-generation"),
    control=ControlConfig(variability=Variability(displaced=(Displaced(joint="neck_yaw", angle=3.0),))),
    simulation=SimulationConfig(human="none", seed=5),
)


def as_plain(value: object) -> Any:
    """As any reader of JSON has it, without the code that tells it."""
    return msgspec.json.decode(msgspec.json.encode(value))


async def test_the_settings_of_every_service_are_in_a_recording(tmp_path: Path) -> None:
    services = {name: roster.service(name, OTHER) for name in roster.PLAY}
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub), running(hub, services):
        await asyncio.sleep(1.0)

    found = {life.told.participant: json.loads(life.told.settings) for life in settings_of(read(tmp_path / "a.mcap"))}

    assert {name: settings[name] for name, settings in found.items()} == {
        name: as_plain(getattr(OTHER, name)) for name in roster.PLAY
    }
    assert found["generation"]["covered_for"] == found["control"]["covered_for"] == 7.5


async def test_a_recorder_that_comes_late_has_them_too(tmp_path: Path) -> None:
    services = {name: roster.service(name, OTHER) for name in roster.PLAY}
    async with MemoryHub() as hub, running(hub, services):
        await asyncio.sleep(60.0)
        async with recording_to(tmp_path / "a.mcap", hub):
            await asyncio.sleep(1.0)

    found = settings_of(read(tmp_path / "a.mcap"))

    assert {life.told.participant for life in found} == set(roster.PLAY)
    assert {(life.since, life.number) for life in found} == {(0.0, 1)}


async def test_each_life_has_its_own(tmp_path: Path) -> None:
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub):
        for blocks in (3, 5):
            config = Config(realizer=RealizerConfig(blocks=blocks))
            serving = asyncio.create_task(serve(hub, "realizer", roster.service("realizer", config)))
            await asyncio.sleep(10.0)
            serving.cancel()
            await asyncio.wait([serving])

    first, second = settings_of(read(tmp_path / "a.mcap"))

    assert (first.number, second.number) == (1, 2)
    assert second.since - first.since == pytest.approx(10.0, abs=0.1)
    assert first.told.run != second.told.run
    assert changed(second, first.values) == ["realizer.blocks = 5"]
    assert "life 1, from 0.000 s: realizer.blocks = 3" in configuration([first, second], "a.mcap")


async def test_a_driver_tells_all_its_settings_and_files_are_told_whole(tmp_path: Path) -> None:
    (tmp_path / "head.py").write_text(
        "from msgspec import Struct\n"
        "from engage_hri.services.control.torso.body import SimulatedBody\n"
        "class Knobs(Struct):\n    speed: float = 2.5\n    api_key: str = ''\n    url: str = ''\n"
        "class Head(SimulatedBody):\n"
        "    Settings = Knobs\n"
        "    @classmethod\n"
        "    def configured(cls, config, settings):\n"
        "        return super().configured(config, None)\n"
    )
    (tmp_path / "calibration.toml").write_text("[offsets]\nneck_yaw = 1.5\n")
    control = ControlConfig(
        body=f"{tmp_path}/head.py:Head", calibration=f"{tmp_path}/calibration.toml",
        drivers={"Head": {"api_key": "0a1b2c", "url": "https://jane:hunter2@voice.example/v1"}},
    )  # fmt: skip
    services = {"control": roster.service("control", Config(control=control))}
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub), running(hub, services):
        await asyncio.sleep(1.0)

    [life] = settings_of(read(tmp_path / "a.mcap"))

    driver = json.loads(life.told.settings)["control"]["drivers"]["Head"]
    assert driver == {"speed": 2.5, "api_key": HIDDEN, "url": f"https://{HIDDEN}@voice.example/v1"}
    assert life.told.files == (SettingsFile(name=control.calibration, text="[offsets]\nneck_yaw = 1.5\n"),)
    data = (tmp_path / "a.mcap").read_bytes()
    assert all(secret.encode() not in data for secret in ("0a1b2c", "hunter2"))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("api_key", True), ("apiKey", True), ("password", True), ("access_token", True), ("client-secret", True),
        ("Credentials", True), ("certificate", True), ("keys", True), ("AUTH", True), ("apikey", True),
        ("keyboard", False), ("monkey", False), ("author", False), ("max_tokenizer", False), ("passes", False),
    ],
)  # fmt: skip
def test_what_is_secret_is_known_by_its_name(name: str, expected: bool) -> None:
    assert is_secret(name) is expected


def test_nothing_of_our_own_settings_is_hidden_and_what_is_secret_is_hidden_whole() -> None:
    assert HIDDEN not in str(shown(Config()))
    assert shown({"a": {"password": {"x": ["p", 1]}}, "tokens": ["t"], "key": ""}) == {
        "a": {"password": HIDDEN}, "tokens": HIDDEN, "key": "",
    }  # fmt: skip


def kept(settings: Mapping[str, Any] | str, files: tuple[SettingsFile, ...] = ()) -> Recording:
    """A recording of one service with these settings. settings: or the text of them."""
    text = settings if isinstance(settings, str) else json.dumps(settings)
    told = ServiceSettings(participant="x", run="1", version="0", at=Stamp("loop", 0.0), settings=text, files=files)
    return recording([sample(keys.settings("x"), told, 0.5)])


PLAIN = st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False) | st.text(max_size=9)
NAMES = st.text(min_size=1, max_size=6)
VALUES = st.recursive(PLAIN, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3))


@given(settings=st.dictionaries(NAMES, VALUES, max_size=5), text=st.text(max_size=20))
def test_what_is_exported_is_toml_that_says_the_same(settings: dict[str, Any], text: str) -> None:
    exported = configuration(settings_of(kept(settings, (SettingsFile(name="f", text=text),))), "a\n.mcap")

    assert tomllib.loads(exported) == settings


def test_an_exported_file_configures_the_same_again(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    all_sections = {name: as_plain(getattr(OTHER, name)) for name in roster.PLAY} | {"covered_for": 7.5}

    path.write_text(configuration(settings_of(kept(all_sections)), "a.mcap"))

    assert load(path) == OTHER


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "not JSON"), ('{"a": ', "not JSON"), ("{'a': 1}", "not JSON"), ("9" * 5000, "not JSON"),
        ("[" * 50_000, "not JSON"), ("null", "a JSON object"), ('["a"]', "a JSON object"), ('"{}"', "a JSON object"),
        ('{"a": "\\ud800"}', "half a character"), ('{"\\udfff": 1}', "half a character"),
        ('{"a": ' * (DEEPEST + 1) + "1" + "}" * (DEEPEST + 1), f"more than {DEEPEST}"),
        ('{"a": ' + "[" * 400 + "]" * 400 + "}", f"more than {DEEPEST}"),
    ],
)  # fmt: skip
def test_settings_that_nobody_can_read_are_refused_and_told_in_words(text: str, reason: str) -> None:
    with pytest.raises(InputRefused, match=reason):
        sections(text)
    [life] = settings_of(kept(text))

    assert reason in life.unread
    assert (life.sections, life.values) == ({}, {})
    assert f"x, life 1: not read: {life.unread}" in configuration([life], "a.mcap")
    assert tomllib.loads(configuration([life], "a.mcap")) == {}


@given(settings=st.dictionaries(NAMES, VALUES | st.none() | st.just(float("inf")), max_size=5))
def test_what_is_told_is_read_as_it_was(settings: dict[str, Any]) -> None:
    assert sections(text_of(settings)) == json.loads(text_of(settings)) == settings


def test_as_deep_as_settings_may_be_they_are_read_and_exported() -> None:
    text = '{"a": ' * DEEPEST + "1" + "}" * DEEPEST
    found = settings_of(kept(text))

    assert tomllib.loads(configuration(found, "a.mcap")) == json.loads(text)


def test_a_later_life_is_read_though_nobody_can_read_the_one_before() -> None:
    told = [
        ServiceSettings(participant="x", run=run, version="0", at=Stamp("loop", 0.0), settings=text)
        for run, text in (("1", "?"), ("2", '{"x": {"a": 1}}'))
    ]
    found = settings_of(recording([sample(keys.settings("x"), one, float(one.run), life=one.run) for one in told]))

    assert [(life.number, bool(life.unread), life.values) for life in found] == [
        (1, True, {}),
        (2, False, {"x.a": "1"}),
    ]


def test_of_any_other_value_its_text_is_told() -> None:
    settings = shown({"path": Path("a") / "b", "bytes": b"ab", 5: {1, 2}})

    assert settings == {"path": "a/b", "bytes": "YWI=", "5": [1, 2]}


@pytest.mark.contained
async def test_settings_that_cannot_be_told_are_a_fault_and_end_no_service() -> None:
    async with MemoryHub() as hub:
        bus = hub.join("control", "control")
        with bus.subscribe(keys.ANY_FAULT) as faults:
            tell_settings(bus, "control", ControlConfig(drivers={"x": {"y": "z" * 5_000_000}}))
            received = await faults.next(bus.now() + 1.0)

    assert "at most" in str(getattr(received, "message", None))
