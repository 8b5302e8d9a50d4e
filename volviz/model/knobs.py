"""A knob is one dataclass field: its range, choices, unit and help stand in the field's metadata.

The command-line flag, the JSON key, the widget and the uniform are derived from the field, so
that nobody types a knob's name twice.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_type_hints

from volviz.errors import UsageError, did_you_mean

AS_SCENE = "as in the scene"
"""`fine` of a knob whose choices approximate one thing: the scene's own choice is the measure."""


@dataclass(frozen=True)
class Knob:
    """What is known of one knob. low, high: inclusive bounds; choices: names it may take.

    fine: of a knob that only decides how exactly a picture is computed, the value with which it
    errs little enough to measure others against; None if it decides what the picture shows.
    used_with: other knobs by name, and the choices of theirs without which this one does nothing.
    """

    name: str
    type: Any
    default: Any
    help: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    unit: str = ""
    fine: Any = None
    used_with: Mapping[str, tuple[str, ...]] = dataclasses.field(default_factory=dict, hash=False)

    def used(self, values: Mapping[str, Any]) -> bool:
        """True if it has an effect beside these values of other knobs; those left out are not
        asked."""
        return all(values.get(k, those[0]) in those for k, those in self.used_with.items())

    @property
    def flag(self) -> str:
        """The command-line flag, e.g. `--unit-distance`."""
        return "--" + self.name.replace("_", "-")


def knob(
    default: Any,
    help: str,
    *,
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    unit: str = "",
    fine: Any = None,
    used_with: Mapping[str, tuple[str, ...]] | None = None,
) -> Any:
    """A dataclass field that is a knob; `Knob` says what the keywords mean."""
    meta = {"help": help, "low": low, "high": high, "choices": choices, "unit": unit, "fine": fine}
    meta["used_with"] = used_with or {}
    return dataclasses.field(default=default, metadata={"knob": meta})


def exact(help: str, default: Any = dataclasses.MISSING) -> Any:
    """A dataclass field that is set to a number or to three, not turned: no range, no slider."""
    return dataclasses.field(default=default, metadata={"exact": help})


def exacts_of(owner: type) -> tuple[Knob, ...]:
    """The fields of a dataclass made by `exact`, in their order; type is a float or a tuple."""
    hints = get_type_hints(owner)
    return tuple(
        Knob(f.name, hints[f.name], f.default, f.metadata["exact"])
        for f in dataclasses.fields(owner)
        if "exact" in f.metadata
    )


_known: dict[type, tuple[Knob, ...]] = {}


def knobs_of(owner: type) -> tuple[Knob, ...]:
    """The knobs of a dataclass, in the order of its fields."""
    if owner not in _known:
        _known[owner] = _read_knobs(owner)
    return _known[owner]


def _read_knobs(owner: type) -> tuple[Knob, ...]:
    hints = get_type_hints(owner)
    return tuple(
        Knob(f.name, hints[f.name], f.default, **f.metadata["knob"])
        for f in dataclasses.fields(owner)
        if "knob" in f.metadata
    )


def check_knobs(instance: Any) -> None:
    """Raise UsageError for the first knob outside its range or choices; make ints floats."""
    for spec in knobs_of(type(instance)):
        value = getattr(instance, spec.name)
        if spec.choices and value not in spec.choices:
            raise UsageError(
                f"unknown {spec.name.replace('_', ' ')} '{value}'",
                field=spec.flag,
                fix=did_you_mean(str(value), spec.choices),
            )
        if spec.type is bool and not isinstance(value, bool):
            raise UsageError(f"{value!r} is not true or false", field=spec.flag, fix=spec.help)
        if spec.type in (float, int):
            object.__setattr__(instance, spec.name, _number(spec, value))


def _number(spec: Knob, value: Any) -> float | int:
    low = -math.inf if spec.low is None else spec.low
    high = math.inf if spec.high is None else spec.high
    try:
        number = spec.type(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    inside = low <= number <= high and not math.isinf(number)  # no scene, no JSON holds infinity
    if isinstance(value, str | bytes) or not inside or number != value:
        raise UsageError(
            f"{value!r} is not {_allowed(spec, number)}",
            field=spec.flag,
            fix=f"{spec.help} (default {spec.default})",
        )
    return spec.type(number)


def _allowed(spec: Knob, number: float) -> str:
    kind = "a whole number" if spec.type is int else "a number"
    kind = "a finite number" if math.isinf(number) else kind
    if spec.low is not None and spec.high is not None:
        return f"{kind} from {spec.low:g} to {spec.high:g}"
    if spec.low is not None:
        return f"{kind} of at least {spec.low:g}"
    return kind
