"""Files for ELAN against the rules of their format, EAF 3.0."""

import re
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from lxml import etree

from engage_hri.services.recording.tiers import Annotation, Media, Tier, apart, eaf
from tests.cli.command import Engage, engage
from tests.recording.conftest import Anchor

DATE_TIME = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)?")
ORDER = ("LICENSE", "HEADER", "TIME_ORDER", "TIER", "LINGUISTIC_TYPE", "LOCALE", "LANGUAGE", "CONSTRAINT")


def check_eaf(data: bytes) -> int:
    """Hold a document to what the schema says, and what ELAN needs. Returns the number of its annotations."""
    root = etree.fromstring(data)
    assert DATE_TIME.fullmatch(root.get("DATE", "")), root.get("DATE")
    assert (root.get("FORMAT"), root.get("VERSION"), root.get("AUTHOR") is not None) == ("3.0", "3.0", True)
    places = [ORDER.index(element.tag) for element in root]
    assert places == sorted(places)
    header = root.find("HEADER")
    assert header is not None
    assert header.get("TIME_UNITS") == "milliseconds"
    for media in header.findall("MEDIA_DESCRIPTOR"):
        assert re.fullmatch(r"file:///[^ ]+", media.get("MEDIA_URL", ""))
        assert re.fullmatch(r"\./[^ ]+", media.get("RELATIVE_MEDIA_URL", ""))
        assert media.get("MIME_TYPE")
    slots = {each.get("TIME_SLOT_ID"): int(each.get("TIME_VALUE", "-1")) for each in root.iter("TIME_SLOT")}
    assert len(slots) == len(root.findall("TIME_ORDER/TIME_SLOT"))
    assert [*slots.values()] == sorted(slots.values())
    assert min(slots.values(), default=0) >= 0
    types = {each.get("LINGUISTIC_TYPE_ID") for each in root.iter("LINGUISTIC_TYPE")}
    names = [tier.get("TIER_ID") for tier in root.iter("TIER")]
    assert len(set(names)) == len(names)
    ids = [each.get("ANNOTATION_ID") for each in root.iter("ALIGNABLE_ANNOTATION")]
    assert len(set(ids) | {*slots}) == len(ids) + len(slots)
    assert all(re.fullmatch(r"[A-Za-z_][\w.-]*", str(id)) for id in (*ids, *slots))
    for tier in root.iter("TIER"):
        assert tier.get("LINGUISTIC_TYPE_REF") in types
        refs = [
            (each.get("TIME_SLOT_REF1"), each.get("TIME_SLOT_REF2")) for each in tier.iter("ALIGNABLE_ANNOTATION")
        ]
        times = [(slots[begin], slots[end]) for begin, end in refs]
        assert all(begin < end for begin, end in times)
        assert all(one[1] <= other[0] for one, other in pairwise(times))
    return len(ids)


TIMES = st.floats(0, 3) | st.integers(0, 6000).map(lambda n: n / 2000)
LENGTHS = st.floats(0.001, 1) | st.just(0.001) | st.floats(0.001, 0.003)
ODD = ['say "yes"', "\u0645\u06cc\u200c\u062e", "\u0915\u094d\u200d\u0937", "a\r\nb", "\u202eabc", "\0", "\ufffe"]
TEXTS = st.text(max_size=9) | st.sampled_from(ODD)
MADE = st.lists(
    st.builds(lambda at, length, text: Annotation(at, at + length, text), TIMES, LENGTHS, TEXTS), max_size=9
)


def whole(found: dict[str, list[Annotation]]) -> list[Tier]:
    return [tier for actor, annotations in found.items() for tier in apart(actor, "x", annotations)]


@given(found=st.dictionaries(TEXTS, MADE, max_size=4))
@example(found={})
@example(found={"a": [Annotation(0.0015, 0.0025, "tie")]})
@example(found={"a": [Annotation(0.5, 1.0000004, "1"), Annotation(1.0000006, 2.0, "2")]})
@example(found={"a\0": [Annotation(0.0, 1.0, "1")], "a": [Annotation(0.0, 1.0, "2")]})
def test_any_names_texts_and_times_are_valid(found: dict[str, list[Annotation]]) -> None:
    made = whole(found)
    count = sum(len(annotations) for annotations in found.values())

    assert check_eaf(eaf(made, date="2026-11-24T17:00:00Z", media=Media("file:///a.mp4", "./a.mp4"))) == count


@pytest.fixture(name="run")
def _run(capsys: pytest.CaptureFixture[str]) -> Engage:
    return engage(capsys)


def test_the_file_of_a_task_is_valid_and_links_a_film_beside_it(run: Engage, anchor: Anchor, tmp_path: Path) -> None:
    path = tmp_path / "two words.mcap"
    path.write_bytes(anchor.path.read_bytes())
    (tmp_path / "two words.mp4").write_bytes(b"film")

    assert run("export", path, "--elan").code == 0

    document = (tmp_path / "two words.eaf").read_bytes()
    count = check_eaf(document)
    assert b'RELATIVE_MEDIA_URL="./two%20words.mp4"' in document
    assert count > 500
