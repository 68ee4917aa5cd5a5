"""Words of listeners: with them a person says "go on", and does not ask for the floor. Pure data.

A list for each language, because length alone misjudges both ways: "stop" is as short as "yes", and "yes, yes, okay"
is as long as a question. "No" is in none of them: it may mean stop.
"""

import re

BY_LANGUAGE = {
    "en": "uh-huh, mhm, mm-hmm, mm, hm, huh, uh, um, ah, oh, aha, yes, yeah, yep, yup, ok, okay, right, all right, "
    "alright, sure, of course, exactly, true, good, fine, great, nice, wow, really, i see, got it, i know, indeed",
    "de": "ja, jaja, jo, genau, okay, aha, ach, ach so, achso, mhm, hm, stimmt, gut, klar, na klar, verstehe, "
    "ich verstehe, richtig, sicher, natürlich, schön, echt, eben, alles klar",
    "fr": "oui, ouais, d'accord, ah, ah bon, bon, bien, hum, exact, exactement, voilà, je vois, bien sûr, c'est ça",
    "es": "sí, claro, vale, ajá, ya, bueno, bien, exacto, entiendo, ya veo, de acuerdo, por supuesto",
    "it": "sì, certo, va bene, ho capito, capisco, esatto, già, bene, bello, d'accordo",
    "pt": "sim, certo, pois, pois é, claro, tá, tá bom, bem, entendi, exato",
    "nl": "ja, oké, precies, klopt, juist, goed, inderdaad, ik snap het, natuurlijk, tuurlijk",
    "ja": "うん, はい, ええ, そう, そうですね, そうですか, へえ, なるほど, ほう",
    "zh": "嗯, 对, 好, 是, 哦, 好的, 是的, 对对, 啊",
}  # fmt: skip
"""Phrases of each language, with commas between them."""


def is_listening(text: str) -> bool:
    """True if the text has words, and all of them are those of a listener, in whatever language and how often."""
    said = _plain(text)
    return bool(said) and _LISTENER.fullmatch(said) is not None


def _plain(text: str) -> str:
    """Lower case, one blank between words, no signs, no letter twice in a row: "Hmm, mm-hmm!" is "hm m hm"."""
    return re.sub(r"(\w)\1+", r"\1", " ".join(re.findall(r"\w+", text.casefold())))


def _pattern() -> re.Pattern[str]:
    phrases = sorted(
        {_plain(each) for told in BY_LANGUAGE.values() for each in told.split(",")}, key=len, reverse=True
    )
    spaced = "|".join(re.escape(each) for each in phrases if each.isascii() or each[0] < "\u3000")
    joined = "|".join(re.escape(each) for each in phrases if each[0] >= "\u3000")
    unit = rf"(?:{spaced}|(?:{joined})+)"
    return re.compile(rf"{unit}(?: {unit})*")


_LISTENER = _pattern()
