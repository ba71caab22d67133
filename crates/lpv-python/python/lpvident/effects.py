"""Effects of the user's own, written down as formulas."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Union

from . import _lpvident
from ._ask import as_json
from .errors import SettingError


@dataclass(frozen=True)
class Parameter:
    """What a fit finds.

    Attributes:
        unit: in which ``u`` and ``y`` stand for those of the input and the output.
        starts: values to start from. Without any it is an amplitude: at zero of all amplitudes there is no effect.
        positive: above zero; with starts its logarithm is fitted.
    """

    unit: str = ""
    starts: Sequence[float] = ()
    positive: bool = False

    def __hash__(self) -> int:
        return hash((self.unit, tuple(self.starts), self.positive))


@dataclass(frozen=True)
class State:
    """A state of an effect: the formula of its derivative in time, and its value at the start of a record."""

    rate: str
    start: float = 0.0


@dataclass(frozen=True)
class Effect:
    """An effect that competes with those of the catalogue.

        lpvident.Effect("rail-joint", force="-a*exp(-((x - at)/width)^2)", parameters={
            "a": "N",
            "at": lpvident.Parameter("m", starts=[0.1, 0.3, 0.5]),
            "width": lpvident.Parameter("m", starts=[0.01], positive=True),
        })

    A formula has ``+ - * /``, ``^`` or ``**``, ``abs signum min max sin cos tan asin acos atan sinh cosh tanh exp ln log10 sqrt cbrt
    floor`` and ``pi``, and knows time ``t`` of the record (s), position ``x`` and speed ``v`` at the channel, those of a load (``x_load``,
    ``v_load``), scheduling ``p`` and ``p_rate``, the input ``u`` (not in a reading), the reading ``y`` (in a reading alone), further
    signals of the bundle by their names, and its own parameters and states. All are in the units of the bundle. A force that jumps, such
    as that of ``signum(v)``, is hard to fit: ``tanh(v/0.001)`` is not.

    Attributes:
        name: small letters, digits and hyphens; not one of the catalogue.
        force: what it adds to the force of the input, in the unit of the input; or
        reading: what it adds to the reading of the output.
        parameters: by name, each a `Parameter`, or the unit of an amplitude.
        states: by name, each a `State`, or the formula of the rate of one that starts at zero.
        channel: the input or output at which it acts; without it each is tried.
        family: friction, position-force, actuator, timing, structure, scheduling, disturbance or sensor.
        meaning: what it is, in a sentence.
    """

    name: str
    force: str | None = None
    reading: str | None = None
    parameters: Mapping[str, Union[Parameter, str]] = field(default_factory=dict)
    states: Mapping[str, Union[State, str]] = field(default_factory=dict)
    channel: str | None = None
    family: str | None = None
    meaning: str = ""

    def __hash__(self) -> int:
        # Mappings have no hash of their own.
        return hash(json.dumps(self._plain(), sort_keys=True))

    def _plain(self) -> dict[str, Any]:
        def parameter(given: Parameter | str) -> dict[str, Any]:
            p = Parameter(given) if isinstance(given, str) else given
            return {"unit": p.unit, "starts": [float(s) for s in p.starts], "positive": bool(p.positive)}

        def state(given: State | str) -> dict[str, Any]:
            s = State(given) if isinstance(given, str) else given
            return {"rate": str(s.rate), "start": float(s.start)}

        # Formulas may come as expressions of sympy.
        formula = {"force": self.force, "reading": self.reading}
        given = {"channel": self.channel, "family": self.family, **{k: None if f is None else str(f) for k, f in formula.items()}}
        return {
            "name": self.name,
            "meaning": self.meaning,
            "parameters": {name: parameter(p) for name, p in self.parameters.items()},
            "states": {name: state(s) for name, s in self.states.items()},
            **{name: value for name, value in given.items() if value is not None},
        }


#: Effects, or the TOML file of some.
Effects = Union[Iterable[Effect], Effect, str, "os.PathLike[str]"]


def as_effects(effects: Effects | None) -> str:
    """What the native half reads."""
    if effects is None:
        return "[]"
    if isinstance(effects, (str, os.PathLike)):
        return _lpvident.read_effects(os.fspath(effects))
    given = [effects] if isinstance(effects, Effect) else list(effects)
    wrong = next((e for e in given if not isinstance(e, Effect)), None)
    if wrong is not None:
        raise SettingError(f"effects: {type(wrong).__name__} is no lpvident.Effect", name="effects")
    try:
        return as_json([e._plain() for e in given])
    except (AttributeError, TypeError, ValueError) as problem:
        raise SettingError(f"effects: {problem}", name="effects") from None


def read_effects(path: str | os.PathLike[str]) -> list[Effect]:
    """The effects of a TOML file, one table ``[[effect]]`` each."""
    found = json.loads(_lpvident.read_effects(os.fspath(path)))
    return [
        Effect(**{
            **one,
            "parameters": {name: Parameter(**p) for name, p in one["parameters"].items()},
            "states": {name: State(**s) for name, s in one.get("states", {}).items()},
        })
        for one in found
    ]
