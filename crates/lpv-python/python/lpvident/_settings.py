"""Settings by keyword, with their types and choices: those of the program, which a test compares."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, Literal, TypedDict, TypeVar, Union

_Function = TypeVar("_Function", bound=Callable[..., Any])

#: Coefficient functions: a kind that needs nothing more, or a dictionary with its kind and ``order`` or ``length-scale``.
Interpolation = Union[Literal["spline", "linear"], Mapping[str, Any]]


class Settings(TypedDict, total=False):
    """Settings of an identification. None, as what is left out, leaves the choice to the data; `identify` says what they mean."""

    structure: Literal["lpv", "lti", "rigid-body", "xy-table"] | None
    skip_periods: int | None
    order: int | None
    integrators: int | None
    rigid_body: Literal["decoupled", "coupled"] | None
    functions: int | None
    fuzziness: float | None
    polish: Literal["none", "minimax"] | None
    weighting: Literal["covariance", "relative"] | None
    model_error: float | None
    lfr: Literal["small", "exact"] | None
    interpolation: Interpolation | None
    focus: Literal["simulation", "prediction"] | None
    direct: Literal["zero", "estimated"] | None
    hold_out: float | None
    seed: int | None


class MachineSettings(TypedDict, total=False):
    """Tables of a machine file, as `machine_template` lists them; their keys may have ``_`` in place of ``-``."""

    name: str
    sample_rate: float
    seed: int
    second_signal: bool
    # `machine` is an argument of its own: a table of this name stands in the dictionary that is given there.
    controller: Mapping[str, Any]
    servo: Mapping[str, Any]
    positions: Mapping[str, Any]
    multisine: Mapping[str, Any]
    noise: Mapping[str, Any]
    moves: Mapping[str, Any]
    setpoints: Mapping[str, Any]


def lists(settings: type) -> Callable[[_Function], _Function]:
    """Shows the names of ``settings`` in the signature of a function that takes them: to `help` and to a shell that completes names."""

    def show(function: _Function) -> _Function:
        own = inspect.signature(function)
        kept = [p for p in own.parameters.values() if p.kind is not p.VAR_KEYWORD]
        shown = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None) for name in settings.__annotations__]
        function.__signature__ = own.replace(parameters=[*kept, *shown])  # type: ignore[attr-defined]
        return function

    return show
