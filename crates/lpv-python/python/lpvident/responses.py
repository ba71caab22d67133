"""Frequency responses with what is known of their errors."""

from __future__ import annotations

import os
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._ask import Progress, numbers, verdict_html
from ._settings import Settings, lists
from .errors import ModelError

if TYPE_CHECKING:
    import xarray
    from typing_extensions import Unpack

    from .model import Model

#: Error of a response whose deviation is not given, as a part of the row of its output.
RELATIVE_ERROR = 1e-3


@dataclass(frozen=True, eq=False)
class Frf:
    """The frequency response at one place.

    Attributes:
        frequencies: lines, Hz, shape (n_f,).
        response: F, outputs over inputs in the units of the bundle, complex, shape (n_f, n_y, n_u).
        output_covariance: C_V, shape (n_f, n_y, n_y), and
        input_factor: S, shape (n_f, n_u, n_u): the covariance of vec(F) at a line is the Kronecker product of S and C_V.
        degrees_of_freedom: complex ones of the covariance; infinite where it is known.
        position: the constant scheduling value, one number a signal; None without.
    """

    frequencies: NDArray[np.float64]
    response: NDArray[np.complex128]
    output_covariance: NDArray[np.complex128]
    input_factor: NDArray[np.complex128]
    degrees_of_freedom: float = float("inf")
    position: list[float] | None = None

    @property
    def deviation(self) -> NDArray[np.float64]:
        """Standard deviation of each entry, the root of E|dF|^2, shape (n_f, n_y, n_u)."""
        rows = np.einsum("kii->ki", self.output_covariance).real
        columns = np.einsum("kjj->kj", self.input_factor).real
        variance: NDArray[np.float64] = np.maximum(rows[:, :, None] * columns[:, None, :], 0.0)
        return np.sqrt(variance)

    @classmethod
    def from_arrays(
        cls,
        frequencies: ArrayLike,
        response: ArrayLike,
        *,
        deviation: ArrayLike | None = None,
        position: float | Sequence[float] | None = None,
    ) -> Frf:
        """A response that was measured elsewhere.

        Args:
            frequencies: increasing, Hz, shape (n_f,).
            response: complex, shape (n_f,) or (n_f, n_y, n_u).
            deviation: standard deviation of the error, of shape (n_f,), (n_f, n_y), (n_f, n_y, n_u) or a number; without it 0.1 % of the
                row of the output: the accuracy to which a model is to describe the response. Of each line, the variances of the
                entries are taken for a product of one by output and one by input, as those of measured responses are.
        """
        lines = np.array(numbers(frequencies, "frequencies"))
        try:
            values = np.asarray(response, dtype=np.complex128)
            known = None if deviation is None else np.asarray(deviation, dtype=np.float64)
        except (TypeError, ValueError) as problem:
            raise ModelError(f"a response or its deviation is no array of numbers: {problem}") from None
        if values.ndim == 1:
            values = values[:, None, None]
        if values.ndim != 3 or len(values) != len(lines) or 0 in values.shape:
            raise ModelError(
                f"a response of shape {values.shape} at {lines.size} frequencies: give n_f x outputs x inputs, or a vector for one channel"
            )
        n_f, n_y, n_u = values.shape
        by_input = np.ones((n_f, n_u))
        if known is None:
            rows = np.linalg.norm(values, axis=2)
            known = RELATIVE_ERROR * np.maximum(rows, 1e-9 * rows.max(initial=np.finfo(float).tiny)) / np.sqrt(n_u)
        else:
            shapes = ((), (n_f,), (n_f, n_y), (n_f, n_y, n_u))
            if known.shape not in shapes or not (np.isfinite(known) & (known >= 0.0)).all():
                raise ModelError(
                    f"a deviation of shape {known.shape}: give a number, or {n_f}, {n_f} x {n_y} or {n_f} x {n_y} x {n_u} of them,"
                    " finite and not below zero"
                )
            if known.ndim == 3:
                by_input = (known**2).mean(axis=1) / np.maximum((known**2).mean(axis=(1, 2)), np.finfo(float).tiny)[:, None]
                known = np.sqrt((known**2).mean(axis=2))
            known = np.broadcast_to(known[:, None] if known.ndim == 1 else known, (n_f, n_y))
        covariance = np.zeros((n_f, n_y, n_y), dtype=np.complex128)
        covariance[:, range(n_y), range(n_y)] = known**2
        factor = np.zeros((n_f, n_u, n_u), dtype=np.complex128)
        factor[:, range(n_u), range(n_u)] = by_input
        place = None if position is None else numbers(position, "position")
        return cls(lines, np.ascontiguousarray(values), covariance, factor, float("inf"), place)

    @classmethod
    def from_control(cls, frd: Any, *, deviation: ArrayLike | None = None, position: float | Sequence[float] | None = None) -> Frf:
        """A ``control.FrequencyResponseData``, whose frequencies are in rad/s and whose data are outputs x inputs x lines.

        Args:
            deviation, position: as in `from_arrays`.
        """
        # Its name of python-control before 0.10.1.
        values = frd.frdata if hasattr(frd, "frdata") else frd.fresp
        lines = np.asarray(frd.omega, dtype=np.float64) / (2.0 * np.pi)
        return cls.from_arrays(lines, np.moveaxis(np.asarray(values), -1, 0), deviation=deviation, position=position)

    def _native(self) -> tuple[Any, ...]:
        tables = (self.response, self.output_covariance, self.input_factor)
        if np.ndim(self.frequencies) != 1 or any(np.ndim(table) != 3 for table in tables):
            raise ModelError("a response, its covariance and its factor have three dimensions, the lines first: use Frf.from_arrays")
        return (
            self.position,
            np.ascontiguousarray(self.frequencies, dtype=np.float64),
            np.ascontiguousarray(self.response, dtype=np.complex128),
            np.ascontiguousarray(self.output_covariance, dtype=np.complex128),
            np.ascontiguousarray(self.input_factor, dtype=np.complex128),
            float(self.degrees_of_freedom),
        )

    def _where(self) -> str:
        return "" if self.position is None else f" at p = {', '.join(f'{p:g}' for p in self.position)}"

    def __repr__(self) -> str:
        n_f, n_y, n_u = self.response.shape
        return f"Frf({n_f} lines, {n_y} outputs, {n_u} inputs{self._where()})"

    def _facts(self) -> dict[str, str]:
        """What is said of it first."""
        n_f, n_y, n_u = self.response.shape
        lines = f"{n_f}, {self.frequencies[0]:g} to {self.frequencies[-1]:g} Hz" if n_f else "none"
        size, deviation = np.linalg.norm(self.response), np.linalg.norm(self.deviation)
        off = f"{100.0 * deviation / size:.2g} % of the response" if size > 0.0 else ""
        return {"lines": lines, "outputs x inputs": f"{n_y} x {n_u}", "deviation": off}

    def _repr_html_(self) -> str:
        return verdict_html(f"Frequency response{self._where()}", "", self._facts())


def _words(dimensions: Iterable[Hashable]) -> str:
    return ", ".join(map(str, dimensions)) or "nothing"


@dataclass(frozen=True, eq=False)
class Responses:
    """Frequency responses at one place or several, in order of position.

    Attributes:
        places: one `Frf` a place.
        sample_rate: of the records behind them, Hz.
        reasons: how they were made, in words.
    """

    places: list[Frf]
    sample_rate: float
    reasons: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, places: Iterable[tuple[Any, ...]], *, sample_rate: float, reasons: list[str]) -> Responses:
        """From what the native half gives."""
        return cls([Frf(f, r, c, s, dof, p) for p, f, r, c, s, dof in places], sample_rate, reasons)

    def __len__(self) -> int:
        return len(self.places)

    def __getitem__(self, index: int) -> Frf:
        return self.places[index]

    @property
    def positions(self) -> NDArray[np.float64]:
        """Shape (places, scheduling signals)."""
        return np.array([p.position or [] for p in self.places], dtype=np.float64)

    @property
    def frequencies(self) -> NDArray[np.float64]:
        """The lines of all places, Hz, shape (n_f,); a ModelError where they differ, or there is no place."""
        if not self.places:
            raise ModelError("there are no places, and so no lines")
        first = self.places[0].frequencies
        if any(not np.array_equal(first, p.frequencies) for p in self.places):
            raise ModelError("the places have different lines: take them one by one, places[i].frequencies")
        return first

    @property
    def response(self) -> NDArray[np.complex128]:
        """All places, shape (places, n_f, n_y, n_u)."""
        _ = self.frequencies
        return np.stack([p.response for p in self.places])

    @property
    def deviation(self) -> NDArray[np.float64]:
        """Standard deviation of each entry, shape (places, n_f, n_y, n_u)."""
        _ = self.frequencies
        return np.stack([p.deviation for p in self.places])

    def to_xarray(self) -> xarray.Dataset:
        """``response`` and ``deviation`` over place, frequency (Hz), output and input, the attribute ``sample_rate`` (Hz) and, where there
        are positions, the coordinate ``position``; needs xarray."""
        import xarray

        dims, p = ("place", "frequency", "output", "input"), self.positions
        coords: dict[str, Any] = {"frequency": ("frequency", self.frequencies, {"units": "Hz"})}
        if p.shape[1:] != (0,):
            coords["position"] = ("place", p[:, 0]) if p.shape[1] == 1 else (("place", "signal"), p)
        parts = {"response": (dims, self.response), "deviation": (dims, self.deviation)}
        return xarray.Dataset(parts, coords=coords, attrs={"sample_rate": self.sample_rate})

    @classmethod
    def from_xarray(cls, data: xarray.Dataset | xarray.DataArray, *, sample_rate: float | None = None) -> Responses:
        """Responses in the layout of `to_xarray`, or its ``response`` alone; of covariances the deviations are there.

        Args:
            data: ``response`` over ``frequency`` in Hz and, in any order, ``place``, ``output`` and ``input``; a dimension that is missing
                has one entry. ``deviation``, ``position`` and the attribute ``sample_rate`` where they are known.
            sample_rate: Hz; the attribute unless given.

        Raises:
            ModelError: for another layout or unit, and where nothing tells a sample rate.
        """
        if not hasattr(data, "to_dataset") and not hasattr(data, "data_vars"):
            raise ModelError(f"a {type(data).__name__} is no xarray: give a Dataset or a DataArray")
        dataset: Any = data if hasattr(data, "data_vars") else data.to_dataset(name="response", promote_attrs=True)
        dims = ("place", "frequency", "output", "input")
        found = tuple(dataset["response"].dims) if "response" in dataset else ()
        if "frequency" not in found or "frequency" not in dataset.coords or set(found) - set(dims):
            raise ModelError(f"a response over {_words(found)}: give `response` over {', '.join(dims)}, as to_xarray does")
        over = {"deviation": set(found), "position": {"place"} & set(found)}
        for name in over.keys() & set(dataset.variables):
            there = set(dataset[name].dims)
            is_alone = name == "position" and not over[name] <= there and dataset.sizes["place"] > 1
            if is_alone or len(there - over[name]) > (name == "position") or (there - over[name]) & set(dims):
                raise ModelError(f"a {name} over {_words(dataset[name].dims)} beside a response over {_words(found)}: see to_xarray")
        unit = dataset["frequency"].attrs.get("units", "Hz")
        if str(unit).lower() not in ("hz", "hertz"):
            raise ModelError(f"frequencies in {unit}: give them in Hz")
        rate = dataset.attrs.get("sample_rate") if sample_rate is None else sample_rate
        if rate is None:
            raise ModelError("give sample_rate in Hz, that at which the input is held")

        def part(name: str) -> NDArray[Any]:
            whole = dataset[name].broadcast_like(dataset["response"])
            return np.asarray(whole.expand_dims([d for d in dims if d not in found]).transpose(*dims))

        values = part("response")
        deviations = part("deviation") if "deviation" in dataset else [None] * len(values)
        at: Any = [None] * len(values)
        if "position" in dataset.coords:
            at = np.asarray(dataset["position"].transpose("place", ..., missing_dims="ignore")).reshape(len(values), -1)
        lines = dataset["frequency"].to_numpy()
        places = [Frf.from_arrays(lines, r, deviation=d, position=p) for r, d, p in zip(values, deviations, at)]
        return cls(places, numbers(rate, "sample_rate")[0])

    @lists(Settings)
    def fit(
        self,
        *,
        sample_rate: float | None = None,
        config: str | os.PathLike[str] | None = None,
        progress: Progress = None,
        **settings: Unpack[Settings],
    ) -> Model:
        """A model of these responses: `lpvident.fit_frf`; ``sample_rate`` in Hz is theirs unless given."""
        from .commands import fit_frf

        return fit_frf(self, sample_rate=sample_rate, config=config, progress=progress, **settings)

    def __repr__(self) -> str:
        return f"Responses({len(self)} places, first {self.places[0]!r})" if self.places else "Responses(none)"

    def _repr_html_(self) -> str:
        if not self.places:
            return verdict_html("No frequency responses", "", {})
        at = [", ".join(f"{p:g}" for p in place.position) for place in self.places if place.position]
        rows = {"positions": "; ".join(at), **self.places[0]._facts(), "sample rate": f"{self.sample_rate:g} Hz"}
        one = len(self) == 1
        first = "Frequency response at one place" if one else f"Frequency responses at {len(self)} places; of the first of them:"
        return verdict_html(first, "", {**rows, "made": "; ".join(self.reasons)})
