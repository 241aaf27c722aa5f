"""Object groups by number and by name, in the form that the binding takes."""

from __future__ import annotations

import numbers
import re
from typing import Any, Callable, Dict, Iterable, List, Mapping, Optional, Tuple

from . import _surfeit
from ._looks import numbers_of

# Names that a scene has for its groups: number and name.
Names = List[Tuple[int, str]]

_HAS_NAME = re.compile(r"[^0-9,\-+. ]")


def names_of_scene(path: str) -> Names:
    return list(_surfeit.group_names(path).items())


def names_of_scenes(paths: Iterable[str]) -> Names:
    """Of several scenes, which must agree on the number of a name."""
    found: Dict[str, int] = {}
    for path in paths:
        for group, name in names_of_scene(path):
            if found.setdefault(name, group) != group:
                raise ValueError(f"groups: found the name {name} for the groups {found[name]} and "
                                 f"{group} ({path}), expected the same number in all scenes")
    return [(group, name) for name, group in found.items()]


def _text_of(groups: Any) -> str:
    if isinstance(groups, str):
        return groups
    if isinstance(groups, numbers.Integral):
        return str(int(groups))
    return ",".join(str(each) for each in groups)


def groups_of(groups: Any, names: Callable[[], Names]) -> List[int]:
    """The numbers of "0,2-5", "lamp,tree", or of a sequence of numbers and names."""
    text = _text_of(groups)
    return _surfeit.group_numbers(text, names() if _HAS_NAME.search(text) else None)


def with_numbers(options: Dict[str, Any], names: Callable[[], Names]) -> Dict[str, Any]:
    """The same options, with `groups` as a text of numbers, and `gain` as pairs with them."""
    taken = dict(options)
    if taken.get("groups") is not None:
        taken["groups"] = ",".join(map(str, groups_of(taken["groups"], names)))
    if taken.get("gain") is not None:
        given = taken["gain"]
        if isinstance(given, str):  # "key=2,fill,3=.5"
            given = re.findall(r"[^=]+=[^,]*(?=,|$)", given.strip(","))
            given = [part.strip(", ") for part in given]
        taken["gain"] = [(group, numbers_of(gain, (1,), f"gain: {groups}")[0])
                         for groups, gain in _pairs_of(given, "gain")
                         for group in groups_of(groups, names)]
    return taken


def _pairs_of(given: Any, name: str) -> List[Tuple[Any, Any]]:
    """Groups and values of a dict, or of "GROUPS=VALUE" once or more."""
    if isinstance(given, Mapping):
        return list(given.items())
    pairs = []
    for text in [given] if isinstance(given, str) else given:
        if not isinstance(text, str) or "=" not in text:
            raise ValueError(f"{name}: found {text!r}, expected {{groups: value}}, such as "
                             '{"walls": .5, "2,5-7": 2}')
        groups, _, value = text.rpartition("=")
        pairs.append((groups, value))
    return pairs


def group_glosses(scene: str, given: Any) -> List[Tuple[int, float, float]]:
    """Group, share and roughness of each, from {groups: share} and {groups: (share, roughness)}."""
    found: Dict[int, Tuple[float, float]] = {}
    for groups, value in _pairs_of(given, "glossy"):
        numbers = numbers_of(value, (1, 2), f"glossy: {groups}")
        for group in groups_of(groups, lambda: names_of_scene(scene)):
            if group in found:
                raise ValueError(f"glossy: {groups!r} has a group that another value has")
            found[group] = (numbers[0], numbers[1] if len(numbers) == 2 else 0.2)
    return [(group, *found[group]) for group in sorted(found)]


def group_corrections(scene: str, **given: Any) -> Optional[List[Dict[str, Any]]]:
    """What the surfels of groups reflect, a dict for each group, from group_gain and others."""
    corrections: Dict[int, Dict[str, Any]] = {}
    for name, values in given.items():
        if values is None:
            continue
        kind = name[len("group_"):]
        seen = set()
        for groups, value in _pairs_of(values, name):
            found = numbers_of(value, (3,) if kind == "tint" else (1,), f"{name}: {groups}")
            for group in groups_of(groups, lambda: names_of_scene(scene)):
                if group in seen:
                    raise ValueError(f"{name}: {groups!r} has a group that another value has")
                seen.add(group)
                correction = corrections.setdefault(group, {"group": group})
                correction[kind] = list(found) if kind == "tint" else found[0]
    return [corrections[group] for group in sorted(corrections)] or None
