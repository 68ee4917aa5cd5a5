"""Words with which one calls somebody: greetings before a name, and honorifics after it. Pure data.

"Hey Ann, look" and "マリさん、" call as "Ann, look" and "マリ、" do. A list for each language.
"""

from collections.abc import Sequence

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


def greeting_before(words: Sequence[str]) -> int:
    """Number of the first words that are a greeting; 0: they are none. words: lower case, without signs."""
    lengths = range(min(_LONGEST, len(words) - 1), 0, -1)
    return next((length for length in lengths if " ".join(words[:length]) in _GREETINGS), 0)


def without_honorific(name: str) -> str:
    """Return a name as one's friends say it: マリさん is マリ."""
    return next((name.removesuffix(each) for each in _HONORIFICS if name.endswith(each) and name != each), name)
