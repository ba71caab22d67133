"""What all calls share: progress, settings, arrays."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import BundleError, ModelError, SettingError

#: ``progress=``: called with step, parts done, parts in all (0 where nobody knows); True for a bar of tqdm.
Progress = Union[bool, Callable[[str, int, int], Any], None]


@contextmanager
def listener(progress: Progress) -> Iterator[Callable[[str, int, int], Any] | None]:
    """What the work calls: the callback itself, a bar, or nothing."""
    if progress is None or progress is False:
        yield None
    elif progress is True:
        bar = _Bar()
        try:
            yield bar
        finally:
            bar.close()
    elif callable(progress):
        yield progress
    else:
        raise SettingError(f"progress = {progress!r}: give True, or a function of the step, the parts done and all parts")


class _Bar:
    """A bar of tqdm, one a step; a line a step where tqdm is not installed."""

    def __init__(self) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            tqdm = None
        self._tqdm = tqdm
        self._bar: Any = None
        self._step = ("", -1)

    def __call__(self, step: str, done: int, of: int) -> None:
        new = self._step != (step, of)
        self._step = (step, of)
        if self._tqdm is None:
            if new:
                print(step, file=sys.stderr)
            return
        if new:
            self.close()
            self._bar = self._tqdm(desc=step, total=of or None, leave=False)
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def as_settings(settings: Mapping[str, Any]) -> str:
    """Settings that were given, as JSON; None leaves the choice to the data."""
    given = {name: value for name, value in settings.items() if value is not None}
    for name, value in given.items():
        if isinstance(value, (float, np.floating)) and not np.isfinite(value):
            raise SettingError(f"`{name}` = {value}: give a finite number", name=name, value=value)
    if isinstance(given.get("interpolation"), str):
        given["interpolation"] = {"kind": given["interpolation"]}
    return as_json(given)


def as_json(value: Any) -> str:
    """JSON with numbers and arrays of numpy as lists."""

    def plain(found: Any) -> Any:
        if isinstance(found, np.generic):
            return found.item()
        if isinstance(found, np.ndarray):
            return found.tolist()
        raise SettingError(f"{type(found).__name__} is no number, text, list or dictionary")

    try:
        return json.dumps(value, default=plain, allow_nan=False)
    except ValueError as problem:
        if isinstance(problem, SettingError):
            raise
        raise SettingError("a number that is not finite, or a list that holds itself") from None


def count(given: int | None, name: str) -> int | None:
    """A whole number from zero on, or None."""
    whole = isinstance(given, (int, np.integer)) and not isinstance(given, bool)
    if given is not None and not (whole and given >= 0):
        raise SettingError(f"`{name}` = {given!r}: give a whole number from 0 on", name=name)
    return None if given is None else int(given)


def with_dashes(value: Any) -> Any:
    """Names of a machine as its file has them."""
    if isinstance(value, Mapping):
        return {str(name).replace("_", "-"): with_dashes(part) for name, part in value.items()}
    return value


def columns(array: ArrayLike, what: str) -> NDArray[np.float64]:
    """Samples x channels of finite numbers; one channel may come as a vector."""
    if np.ma.isMaskedArray(array) and np.ma.getmaskarray(array).any():
        raise BundleError(f"`{what}` is masked in places: a record has no gaps; fill them, or cut the record there")
    try:
        found = np.asarray(array)
        if np.iscomplexobj(found):
            raise TypeError("complex numbers")
        if found.dtype.kind in "mM":
            raise TypeError("times or dates")
        found = np.asarray(found, dtype=np.float64)
    except (TypeError, ValueError) as problem:
        raise BundleError(f"`{what}` is no array of real numbers: {problem}") from None
    if found.ndim == 1:
        found = found[:, np.newaxis]
    if found.ndim != 2:
        raise BundleError(f"`{what}` has {found.ndim} dimensions; give samples x channels, or a vector for one channel")
    if 0 in found.shape:
        raise BundleError(f"`{what}` is empty")
    return np.ascontiguousarray(found)


def position(p: ArrayLike | None) -> list[float]:
    """A constant scheduling value as a list, empty for none."""
    return [] if p is None else numbers(p, "p")


def numbers(given: ArrayLike, what: str) -> list[float]:
    """Finite numbers, one or a vector of them."""
    found = _real(given, what)
    if np.ma.getmaskarray(found).any() or not np.isfinite(found).all():
        raise ModelError(f"`{what}` has a gap or a number that is not finite")
    if found.ndim > 1:
        raise ModelError(f"`{what}` has {found.ndim} dimensions; give a number or a vector")
    return [float(x) for x in np.atleast_1d(found)]


def _real(given: ArrayLike, what: str) -> Any:
    """An array of real numbers as it is, masked or not."""
    try:
        found = given if np.ma.isMaskedArray(given) else np.asarray(given)
        if np.iscomplexobj(found):
            raise TypeError("complex numbers")
        return found.astype(np.float64)
    except (TypeError, ValueError) as problem:
        raise ModelError(f"`{what}` is no array of real numbers: {problem}") from None


def verdict_html(sentence: str, worth: str, rows: Mapping[str, Any]) -> str:
    """A short table with the verdict, or else the first fact, above it; coloured by what the verdict is worth, if there is one."""
    from html import escape

    good, bad = ("good", "good-up-to", "good-at-rest", "nothing-missing", "explained"), ("not-a-model", "contradictory-data")
    colour = "inherit" if not worth else "#2e7d32" if worth in good else "#c62828" if worth in bad else "#b26a00"
    cells = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th><td style='text-align:left'>{escape(str(value))}</td></tr>"
        for name, value in rows.items()
        if value not in (None, "", [])
    )
    return f"<div><p style='color:{colour};font-weight:bold'>{escape(sentence)}</p><table>{cells}</table></div>"
