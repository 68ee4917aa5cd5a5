"""How pages are read, and what their sentences say of the command line."""

import re
import shlex
import tomllib
from collections.abc import Iterator

import pytest

from engage_hri.services.commandline.app import COMMANDS, command
from engage_hri.services.commandline.look.watch import SUBJECTS
from tests.docs.clone import ROOT
from tests.docs.pages import (
    Shown,
    blocks,
    commands,
    is_complete,
    is_endless,
    is_printed,
    left_to_the_reader,
    spans,
)
from tests.docs.test_pages import EXCUSED, ITEMS, PAGES

PAGE = """\
A fragment, say `ask.xml`:

```xml
<bml id="x"/>
```

- What comes:

  ```console
  $ engage plan ask.xml
  block x
  $ engage plan no.xml
  ```

```
nobody knows what this is
```

| `engage demo` | all |
"""


def test_a_block_knows_its_line_its_language_and_the_file_it_is():
    found = blocks("page.md", PAGE)

    assert [(block.line, block.language, block.name) for block in found] == [
        (4, "xml", "ask.xml"), (10, "console", ""), (16, "", "")
    ]  # fmt: skip
    assert commands(found[1]) == [Shown("engage plan ask.xml", "block x\n"), Shown("engage plan no.xml", "")]
    assert [str(span) for span in spans("page.md", PAGE)] == ["page.md:19"]


def test_a_command_goes_on_after_a_backslash_and_within_quotes():
    [block] = blocks("page.md", "```sh\none \\\n  --more  # why\ntwo 'a\nb' | three\n\n# nothing\n```\n")

    assert [shown.command for shown in commands(block)] == ["one \\\n  --more  # why", "two 'a\nb' | three"]


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ("a\nb\n", "a  \nb\n", True),
        ("a\nb\n", "a\nb\nc\n", False),
        ("...\nb\n", "a\na\nb\n", True),
        ("a\n...\nb\n...\n", "a\nb\n", True),
        ("a\n...\nc\n", "a\nb\n", False),
        ("a.\n", "ab\n", False),
    ],
)
def test_output_is_compared_word_for_word_and_an_ellipsis_is_any_lines(shown: str, printed: str, same: bool):
    assert is_printed(shown, printed) is same


def test_a_snippet_says_what_it_needs_and_whether_it_ends():
    endless = "with robot.feed() as feed:\n    async for each in feed:\n        print(each)\n"

    assert left_to_the_reader(endless) == {"robot"}
    assert is_endless(endless)
    assert not is_endless("for event in outcome.events:\n    print(event)\n")


def test_only_what_can_be_typed_is_a_call():
    assert is_complete("engage plan ask.xml")
    assert is_complete("make demo ARGS=--virtual-time")
    assert not is_complete("engage plan FILE")
    assert not is_complete("engage tool --format anthropic|openai")


def calls() -> Iterator[tuple[str, list[str]]]:
    """Each call of `engage` on any page, complete or not: where, and its words."""
    for page, text in PAGES.items():
        shown = [(str(block), one.command) for block in blocks(page, text) if block.language in ("sh", "console")
                 for one in commands(block)]  # fmt: skip
        for where, call in [*shown, *((str(span), span.text) for span in spans(page, text))]:
            for words in re.findall(r"\bengage (.*?)(?: \| .*)?$", call.replace("\\\n", " "), re.MULTILINE):
                yield where, shlex.split(words.replace("...", ""), comments=True)


def test_what_a_page_calls_is_there_with_these_options():
    called = [(where, words) for where, words in calls() if words[0] not in ("--version", "COMMAND")]

    assert len(called) > 200
    for where, words in called:
        known = {option for param in command(words[0]).params for option in (*param.opts, *param.secondary_opts)}
        assert {word for word in words if word.startswith("-") and len(word) > 1} <= known, (where, words)


def test_every_option_of_the_page_on_commands_is_there():
    told = re.split(r"^## (\w[\w-]*)$", PAGES["docs/commands.md"], flags=re.MULTILINE)
    sections = dict(zip(told[1::2], told[2::2], strict=True))

    public = [name for name, does in COMMANDS.items() if does]
    assert set(public) <= set(sections)
    for name in public:
        known = {option for param in command(name).params for option in param.opts}
        heads = re.findall(r"^- (`--.*?):? *", sections[name], re.MULTILINE)
        assert {option for head in heads for option in re.findall(r"--[\w-]+", head)} <= known, name


def test_the_page_on_commands_names_all_that_can_be_watched():
    (told,) = re.findall(r"^- `--only WHAT`.*$", PAGES["docs/commands.md"], re.MULTILINE)

    assert set(re.findall(r"`(\w+)`", told)) == set(SUBJECTS)


def test_an_extra_that_a_page_installs_is_one():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]

    asked = {extra for text in PAGES.values() for extra in re.findall(r"-e '\.\[([\w-]+)\]'", text)}
    assert asked
    assert asked <= set(extras)


def test_nothing_is_excused_that_no_page_shows():
    texts = [item.text for item in ITEMS]

    assert all(any(excused in text for text in texts) for excused in EXCUSED)
