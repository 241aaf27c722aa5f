"""The look of bounce light: numbers, texts and dicts of callers in the form that the binding takes."""

from __future__ import annotations

import math
from typing import Any, Dict, Iterable, List, Mapping, Tuple

LOOK_SETTINGS = ("bounce_gain", "bounce_saturation", "bounce_tint", "bounce_filter")

# Words of a filter, as `--bounce-filter` has them, and how many numbers each takes.
_FILTER_WORDS = {"centre": (3,), "radius": (1, 2), "direction": (3,), "angle": (1, 2), "gain": (1,),
                 "saturation": (1,), "tint": (3,)}


def numbers_of(value: Any, counts: Iterable[int], name: str) -> Tuple[float, ...]:
    """The numbers of a text, "1,2,3" or "1 2 3", of a sequence, or one number."""
    try:
        if isinstance(value, str):
            numbers = tuple(float(word) for word in value.replace(",", " ").split())
        elif hasattr(value, "__iter__"):
            numbers = tuple(float(each) for each in value)
        else:
            numbers = (float(value),)
    except (TypeError, ValueError):
        numbers = ()
    counts = tuple(counts)
    if len(numbers) not in counts or not all(map(math.isfinite, numbers)):
        expected = " or ".join(str(count) for count in counts)
        raise ValueError(f"{name}: found {value!r}, expected {expected} "
                         f"number{'s' if counts != (1,) else ''}")
    return numbers


def _words_of(text: str) -> Dict[str, str]:
    words: Dict[str, str] = {}
    for word in text.split():
        key, equals, value = word.partition("=")
        if not equals:
            raise ValueError(f'bounce_filter: found "{word}" in "{text}", expected words such as '
                             f"gain=.5: {', '.join(_FILTER_WORDS)}")
        if key in words:
            raise ValueError(f'bounce_filter: found {key} twice in "{text}"')
        words[key] = value
    return words


def _check_filter(words: Mapping[str, Any], given: Any) -> None:
    def refuse(what: str) -> None:
        raise ValueError(f"bounce_filter: found {given!r}: {what}")

    for word in words:
        if word not in _FILTER_WORDS:
            refuse(f"{word} is none of {', '.join(_FILTER_WORDS)}")
    if ("centre" in words) != ("radius" in words):
        refuse("centre and radius need each other")
    if ("direction" in words) != ("angle" in words):
        refuse("direction and angle need each other")
    if "centre" not in words and "direction" not in words:
        refuse("neither a centre nor a direction; bounce_gain, bounce_saturation and bounce_tint "
               "work everywhere")
    if not {"gain", "saturation", "tint"} & set(words):
        refuse("changes nothing; expected gain, saturation or tint")


def _filter_of(given: Any) -> Dict[str, Any]:
    words = _words_of(given) if isinstance(given, str) else given
    if not isinstance(words, Mapping):
        raise TypeError(f"bounce_filter: found {type(given).__name__}, expected a dict or a text")
    words = {word: value for word, value in words.items() if value is not None}
    _check_filter(words, given)
    taken: Dict[str, Any] = {}
    for word, value in words.items():
        numbers = numbers_of(value, _FILTER_WORDS[word], f"bounce_filter: {word}")
        if word in ("radius", "angle"):
            inner, outer = numbers[0], numbers[-1]
            if not 0 <= inner <= outer or (word == "angle" and outer > 180):
                raise ValueError(f"bounce_filter: found {word} {value!r}, expected the inner and the "
                                 "outer one, from 0, the outer one not smaller"
                                 + (", up to 180 degrees" if word == "angle" else ""))
            unit = math.pi / 180 if word == "angle" else 1
            taken[word] = [unit * inner, unit * outer]
        else:
            taken[word] = numbers[0] if _FILTER_WORDS[word] == (1,) else list(numbers)
    if "direction" in taken and not any(taken["direction"]):
        raise ValueError(f"bounce_filter: found {given!r}: the direction is zero")
    return taken


def filters_of(given: Any) -> List[Dict[str, Any]]:
    """A filter or several, each a dict or a text of the words of `--bounce-filter`."""
    several = [given] if isinstance(given, (str, Mapping)) else list(given)
    return [_filter_of(each) for each in several]


def look_of(options: Dict[str, Any]) -> None:
    """Puts the look of bounce light among some options into the form of the binding."""
    if options.get("bounce_filter") is not None:
        options["bounce_filter"] = filters_of(options["bounce_filter"])
    if options.get("bounce_tint") is not None:
        options["bounce_tint"] = list(numbers_of(options["bounce_tint"], (3,), "bounce_tint"))
