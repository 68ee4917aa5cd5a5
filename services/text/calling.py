"""Calls by name: who is called by words, and who is only talked of. Pure.

"Bob, do you see it?" calls Bob, and "that is Bob's" does not, though his name stands there, too. What tells is where
the name stands, and the comma beside it.
"""

import re
from collections.abc import Mapping, Sequence

SHORT_CALL = 3
"""Number of words up to which a name at the end calls somebody. Ours."""
MARKS = ".,!?;:…¡¿\"'“”„‘’«»、，。！？"
"""Punctuation that may stand beside a name."""
COMMAS = (",", "、", "，")
WORDS = re.compile(r"[^\s、，。！？]+[、，。！？]*|[、，。！？]+")
"""Words with their punctuation. After that of Japanese and Chinese no blank comes."""
GREETINGS = {
    "en": "hey, hi, hello, hiya, oh, ok, okay, please, sorry, excuse me, good morning, good afternoon, good evening",
    "de": "hallo, hey, hi, he, na, moin, servus, bitte, entschuldigung, guten morgen, guten tag, guten abend",
    "fr": "salut, bonjour, bonsoir, coucou, hé, dis, pardon",
    "es": "hola, oye, oiga, perdona, buenos días, buenas tardes, buenas noches",
    "it": "ciao, ehi, salve, scusa, buongiorno, buonasera",
    "pt": "olá, oi, ei, desculpa, bom dia, boa tarde, boa noite",
    "nl": "hoi, hallo, hé, hey, dag, sorry, goedemorgen, goedemiddag, goedenavond",
    "ru": "привет, эй, здравствуй, здравствуйте, извини, доброе утро, добрый день, добрый вечер",
    "ja": "ねえ, ねぇ, やあ, おい, あの, すみません, こんにちは, こんばんは, おはよう, おはようございます",
    "zh": "嗨, 嘿, 喂, 哎, 你好, 您好, 早上好",
}
"""Words that come before a name in a call, with commas between them."""
HONORIFICS = {
    "ja": "さん, くん, 君, ちゃん, さま, 様, 先生, -san, -kun, -chan, -sama, -sensei",
    "zh": "先生, 女士, 小姐, 老师",
}
"""What follows a name by courtesy, with commas between them."""


def _listed(by_language: dict[str, str]) -> frozenset[str]:
    return frozenset(each.strip() for told in by_language.values() for each in told.split(","))


_GREETINGS, _HONORIFICS = _listed(GREETINGS), tuple(_listed(HONORIFICS))
_LONGEST = max(each.count(" ") + 1 for each in _GREETINGS)


def _greeting_before(words: Sequence[str]) -> int:
    """Number of the first words that are a greeting; 0: they are none. words: lower case, without signs."""
    lengths = range(min(_LONGEST, len(words) - 1), 0, -1)
    return next((length for length in lengths if " ".join(words[:length]) in _GREETINGS), 0)


def _without_honorific(name: str) -> str:
    """Return a name as one's friends say it: マリさん is マリ."""
    return next((name.removesuffix(each) for each in _HONORIFICS if name.endswith(each) and name != each), name)


def called(words: str, names: Mapping[str, str]) -> frozenset[str]:
    """Ids of those whom the words call. names: ids by the names by which they are called, in small letters.

    A name calls somebody if it stands first, maybe after a greeting, last after a comma, or last of a few words: "hey
    Ann, look", "hello robot". In the middle, and at the end of a sentence, it may be what the sentence is about.
    """
    said = [word for word in WORDS.findall(words) if any(map(str.isalnum, word))]
    if not said:
        return frozenset()
    lengths = range(1 + max((name.count(" ") for name in names), default=0), 0, -1)
    after = _greeting_before([_plain([word]) for word in said])
    begun = [(begin, length) for begin in dict.fromkeys((0, after)) for length in lengths]
    calls = [(begin, begin + length) for begin, length in begun if _whose(said[begin : begin + length], names)][:1]
    after = calls[0][1] if calls else max(1, after)
    calls += [
        (len(said) - length, len(said))
        for length in lengths
        if after + length <= len(said)
        and (len(said) - length < SHORT_CALL or said[-length - 1].endswith(COMMAS))
        and _whose(said[-length:], names)
    ][:1]
    return frozenset(_whose(said[begin:end], names) for begin, end in calls)


def _whose(words: list[str], names: Mapping[str, str]) -> str:
    """Actor id of the one of whom these words are the name, maybe with an honorific; "": they are none."""
    name = _plain(words)
    return names.get(name) or names.get(_without_honorific(name), "")


def _plain(words: list[str]) -> str:
    """Words as in a name."""
    return " ".join(words).strip(MARKS).casefold()
