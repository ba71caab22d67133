"""Bundles: measured records with their description."""

from __future__ import annotations

import difflib
import json
import math
import os
import shutil
import tempfile
import weakref
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Union

import numpy as np
from numpy.typing import NDArray

from . import _lpvident
from ._ask import Progress, columns, count, listener, verdict_html
from ._settings import Settings, lists
from ._write import write_bundle
from .accounts import Diagnosis, Inspection
from .errors import BundleError
from .model import Model
from .responses import Responses

if TYPE_CHECKING:
    import pandas
    from typing_extensions import Unpack

    from .effects import Effects

#: Roles of channels, with the names of their columns, in arrays and in a description.
_ROLES = {"y": "output", "u": "input", "r": "reference", "p": "scheduling", "aux": "auxiliary"}

#: A frame, or one with the options of its record.
Frame = Union["pandas.DataFrame", tuple["pandas.DataFrame", Mapping[str, Any]]]


class Record(NamedTuple):
    """One record, in the units of the description.

    Signals are arrays of N samples x channels; groups without a channel have none. ``position`` is the constant scheduling value of
    a record that rests, else None. ``names`` has the column names by group.
    """

    y: NDArray[np.float64]
    u: NDArray[np.float64]
    r: NDArray[np.float64]
    p: NDArray[np.float64]
    aux: NDArray[np.float64]
    injection: NDArray[np.float64]
    position: list[float] | None
    names: dict[str, list[str]]


class Bundle:
    """A folder with ``experiment.toml`` and record files; opened and checked, no samples are read.

    ``Bundle(path)`` opens a folder or its experiment.toml; `from_arrays` and `from_frames` make one.

    Raises:
        BundleError: with ``path``, and ``line``, ``column`` and ``key`` of the description where they are known.
    """

    _is_temporary = False
    _whose: Bundle | None = None

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._native = _lpvident.Bundle(os.fspath(path))
        #: The content of experiment.toml.
        self.description: dict[str, Any] = json.loads(self._native.description())

    @classmethod
    def from_arrays(
        cls,
        records: Mapping[str, Any] | Iterable[Mapping[str, Any]],
        *,
        sample_rate: float,
        folder: str | os.PathLike[str] | None = None,
        name: str = "arrays",
        units: Mapping[str, str] | None = None,
        controller: Mapping[str, Any] | None = None,
        geometry: Mapping[str, Any] | None = None,
    ) -> Bundle:
        """A bundle from arrays.

        Args:
            records: one dictionary or several, each with

                - ``y``, ``u``: outputs and inputs, N x n_y and N x n_u; vectors for one channel. Columns are named y1, y2, ..., u1, ...
                - ``r``, ``p``, ``aux``: references, scheduling and other signals, if there are any, of the same N
                - ``period``: samples a period of a steady multisine; without it the record is a transient one
                - ``use``: "estimation" (default) or "validation", which is held out
                - ``position``: the constant scheduling value, if it is not a signal
                - ``name``: name of the file
            sample_rate: samples a second, Hz.
            folder: where the bundle is kept; without it a temporary folder, which goes with the object.
            name: name of the experiment.
            units: unit by column, such as ``{"y1": "m"}``.
            controller, geometry: the tables of experiment.toml, with lists or arrays.
        """
        given = [records] if isinstance(records, Mapping) else list(records)
        if not given:
            raise BundleError("no record was given")
        signals: list[dict[str, NDArray[np.float64]]] = []
        names: dict[str, list[str]] = {}
        for number, record in enumerate(given):
            if not isinstance(record, Mapping):
                raise BundleError(f"record {number}: give a dictionary with `y` and `u`, no {type(record).__name__}", record=number)
            found: dict[str, NDArray[np.float64]] = {}
            for letter in _ROLES:
                if record.get(letter) is None:
                    continue
                array = columns(record[letter], f"record {number}: {letter}")
                own = [f"{letter}{i + 1}" for i in range(array.shape[1])]
                if names.setdefault(letter, own) != own:
                    raise BundleError(
                        f"record {number}: `{letter}` has {len(own)} channels, {len(names[letter])} before it", record=number
                    )
                found.update(zip(own, array.T))
            signals.append(found)
        for number, found in enumerate(signals):
            missing = [n for all_names in names.values() for n in all_names if n not in found]
            if missing:
                raise BundleError(f"record {number} has no `{missing[0]}`, which other records have", record=number)
        options = [{k: v for k, v in record.items() if k not in _ROLES} for record in given]
        roles = {_ROLES[letter]: names[letter] for letter in _ROLES if letter in names}
        head = {"name": name, "sample_rate": sample_rate, "controller": controller, "geometry": geometry}
        return cls._written(folder, head, roles, units, list(zip(signals, options)))

    @classmethod
    def from_frames(
        cls,
        frames: Frame | Iterable[Frame],
        *,
        outputs: Sequence[str],
        inputs: Sequence[str],
        references: Sequence[str] = (),
        scheduling: Sequence[str] = (),
        auxiliary: Sequence[str] = (),
        sample_rate: float | None = None,
        folder: str | os.PathLike[str] | None = None,
        name: str = "frames",
        units: Mapping[str, str] | None = None,
        controller: Mapping[str, Any] | None = None,
        geometry: Mapping[str, Any] | None = None,
    ) -> Bundle:
        """A bundle from pandas frames, one a record, a row a sample.

        Args:
            frames: a frame, or several; a record with options is ``(frame, {"period": 2048, "use": "validation"})``, with those of
                `from_arrays`.
            outputs, inputs, references, scheduling, auxiliary: names of columns by role.
            sample_rate: Hz; without it from the index of every frame, which then holds times, equally spaced: stamps, time
                differences, or seconds.
            folder, name, units, controller, geometry: as in `from_arrays`.
        """
        # A frame with its options is one record, a tuple of frames several.
        single = hasattr(frames, "columns") or (isinstance(frames, tuple) and len(frames) == 2 and isinstance(frames[1], Mapping))
        given: list[Any] = [frames] if single else list(frames)
        pairs = [pair if isinstance(pair, tuple) else (pair, {}) for pair in given]
        if not pairs:
            raise BundleError("no frame was given")
        groups = {"output": outputs, "input": inputs, "reference": references}
        groups |= {"scheduling": scheduling, "auxiliary": auxiliary}
        roles = {role: [own] if isinstance(own, str) else list(own) for role, own in groups.items() if len(own)}
        records = []
        for number, (frame, options) in enumerate(pairs):
            found = {}
            for column in dict.fromkeys(c for own in roles.values() for c in own):
                if column not in frame.columns:
                    raise BundleError(f"record {number}: the frame has no column `{column}`", record=number, column=column)
                if frame[column].ndim != 1:
                    raise BundleError(f"record {number}: several columns are called `{column}`", record=number, column=column)
                found[str(column)] = columns(frame[column].to_numpy(), f"record {number}: {column}")[:, 0]
            records.append((found, options))
        rate = _common_rate([frame.index for frame, _ in pairs]) if sample_rate is None else sample_rate
        head = {"name": name, "sample_rate": rate, "controller": controller, "geometry": geometry}
        return cls._written(folder, head, roles, units, records)

    @classmethod
    def _written(cls, folder: Any, head: Any, roles: Any, units: Any, records: Any) -> Bundle:
        try:
            rate = head["sample_rate"] = float(head["sample_rate"])
        except (TypeError, ValueError):
            raise BundleError(f"sample_rate = {head['sample_rate']!r} is no number: give the samples a second") from None
        if not (math.isfinite(rate) and rate > 0.0):
            raise BundleError(f"sample_rate = {rate:g}: give the samples a second, finite and above zero")
        known = [c for own in roles.values() for c in own]
        twice = [c for k, c in enumerate(known) if c in known[:k]]
        if twice:
            raise BundleError(f"column `{twice[0]}` is given twice: a column has one role", column=twice[0])
        for column, unit in (units or {}).items():
            if column not in known:
                near = difflib.get_close_matches(str(column), known, 1)
                told = f"; nearest: `{near[0]}`" if near else f"; there are {', '.join(known)}"
                raise BundleError(f"units: no column `{column}`{told}", column=column)
            if not isinstance(unit, str):
                raise BundleError(f"units: the unit of `{column}` is no text: {unit!r}", column=column)
        channels = {}
        for role, own in roles.items():
            channels[role] = {"columns": own}
            if units and any(c in units for c in own):
                channels[role]["units"] = [units.get(c, "") for c in own]
        if folder is not None:
            write_bundle(Path(folder), head, channels, records)
            return cls(folder)
        place = Path(tempfile.mkdtemp(prefix="lpvident-"))
        try:
            write_bundle(place, head, channels, records)
            bundle = cls(place)
        except BaseException:
            shutil.rmtree(place, ignore_errors=True)
            raise
        bundle._is_temporary = True
        weakref.finalize(bundle, shutil.rmtree, place, ignore_errors=True)
        return bundle

    @property
    def path(self) -> Path:
        """The folder."""
        return Path(self._native.folder())

    @property
    def name(self) -> str:
        """Name of the experiment."""
        return str(self.description["name"])

    @property
    def sample_rate(self) -> float:
        """Samples a second, Hz."""
        return float(self.description["sample_rate_hz"])

    @property
    def record_names(self) -> list[str]:
        """Names of the records, in their order."""
        return list(self._native.record_names())

    def __len__(self) -> int:
        return len(self.record_names)

    def record(self, which: int | str) -> Record:
        """Reads a record, by its number from 0 or by its name."""
        index = _place(which, self.record_names)
        groups, position = self._native.record(index)
        y, u, r, p, aux, injection = (array for _, array in groups)
        return Record(y, u, r, p, aux, injection, position, dict(zip(Record._fields, (names for names, _ in groups))))

    def inspect(self, *, progress: Progress = None) -> Inspection:
        """What is in the bundle, checked: sampling, periods, noise, distortion, coverage, warnings."""
        from .commands import inspect

        return inspect(self, progress=progress)

    def frf(self, *, skip_periods: int | None = None, progress: Progress = None) -> Responses:
        """Frequency responses, one a place, with the covariance of their errors.

        From the periodic estimation records; where there are none, from the transient ones that rest, by the local rational method.

        Args:
            skip_periods: periods dropped as transient; without it from the decay between periods.

        Raises:
            BundleError, IdentifyError: where a record cannot be read, or no record tells a response.
        """
        with listener(progress) as tell:
            places, reasons = self._native.frf(None, count(skip_periods, "skip_periods"), tell)
        return Responses.of(places, sample_rate=self.sample_rate, reasons=reasons)

    @lists(Settings)
    def identify(
        self, *, config: str | os.PathLike[str] | None = None, progress: Progress = None, **settings: Unpack[Settings]
    ) -> Model:
        """A model: `lpvident.identify` with this bundle."""
        from .commands import identify

        return identify(self, config=config, progress=progress, **settings)

    def diagnose(
        self, model: Model | str | os.PathLike[str] | None = None, *, effects: Effects | None = None, progress: Progress = None
    ) -> Diagnosis:
        """What a model lacks: `lpvident.diagnose` with this bundle."""
        from .commands import diagnose

        return diagnose(self, model, effects=effects, progress=progress)

    def __copy__(self) -> Bundle:
        again = type(self)(self.path)
        # A temporary folder stays as long as one of them.
        again._is_temporary, again._whose = self._is_temporary, self
        return again

    def __deepcopy__(self, memo: dict[int, Any]) -> Bundle:
        return self.__copy__()

    def __reduce__(self) -> tuple[Any, ...]:
        # One of arrays in a temporary folder goes with the object that has it.
        if self._is_temporary:
            raise TypeError(f"a bundle in a temporary folder ({self.path}) does not travel: give from_arrays or from_frames a folder")
        return (type(self), (str(self.path.absolute()),))

    def __repr__(self) -> str:
        return f"Bundle({str(self.path)!r}): {self._first()}"

    def _first(self) -> str:
        records = f"{len(self)} record" + ("" if len(self) == 1 else "s")
        return f"{self.name}, {records} at {self.sample_rate:g} Hz"

    def _repr_html_(self) -> str:
        kinds = Counter(f"{r['kind']} for {r['use']}" for r in self.description["records"])
        groups = self.description["channels"].items()
        return verdict_html(self._first(), "", {
            "records": ", ".join(f"{count} {kind}" for kind, count in kinds.items()),
            **{role: ", ".join(_with_units(group)) for role, group in groups},
            "controller": "known" if self.description.get("controller") else "",
            "folder": self.path,
        })


def _with_units(group: Mapping[str, list[str]]) -> list[str]:
    """Columns, each with its unit where it has one."""
    units = group.get("units") or [""] * len(group["columns"])
    return [f"{column} ({unit})" if unit else column for column, unit in zip(group["columns"], units)]


def _place(which: int | str, names: list[str]) -> int:
    """The number of a record, which may count from the end."""
    if isinstance(which, str):
        if which in names:
            return names.index(which)
        near = difflib.get_close_matches(which, names, 1)
        raise BundleError(f"no record `{which}`" + (f"; nearest: `{near[0]}`" if near else ""))
    if which not in range(-len(names), len(names)):
        raise BundleError(f"no record {which}: the bundle has {len(names)}")
    return int(which) % len(names)


def _common_rate(indices: list[Any]) -> float:
    """Samples a second that all indices tell."""
    rates = []
    for number, index in enumerate(indices):
        try:
            rates.append(_rate(index))
        except BundleError as problem:
            raise BundleError(f"record {number}: {problem}", record=number) from None
        if abs(rates[number] / rates[0] - 1.0) > 1e-3:
            told = f"the index tells {rates[number]:g} Hz, that of record 0 {rates[0]:g} Hz"
            raise BundleError(f"record {number}: {told}; a bundle has one rate", record=number)
    return rates[0]


def _rate(index: Any) -> float:
    """Samples a second from equally spaced times."""
    if getattr(index, "tz", None) is not None:
        index = index.tz_convert(None)
    times = np.asarray(index)
    if times.dtype.kind in "mM":
        ticks = times.astype(f"{times.dtype.kind}8[ns]").astype(np.int64)
        seconds = (ticks - ticks[0]) * 1e-9
    else:
        try:
            seconds = times.astype(np.float64)
        except (TypeError, ValueError):
            raise BundleError("the index of the frame holds no times: give sample_rate in Hz, or an index of times") from None
    steps = np.diff(seconds)
    if len(steps) == 0 or not steps[0] > 0.0 or np.ptp(steps) > 1e-3 * steps.mean():
        raise BundleError("the index of the frame holds no equally spaced times: give sample_rate in Hz, or resample")
    if np.array_equal(seconds, np.arange(len(seconds))):
        raise BundleError("the index of the frame counts rows and tells no time: give sample_rate in Hz")
    if times.dtype.kind in "iu":
        step = int(steps[0])
        raise BundleError(f"the index of the frame has whole steps of {step}, seconds or another unit: give sample_rate in Hz")
    return float(1.0 / steps.mean())
