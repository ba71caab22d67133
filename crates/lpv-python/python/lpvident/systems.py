"""Systems at a constant p, with and without python-control."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _lpvident


class StateSpace(NamedTuple):
    """``x+ = A x + B u``, ``y = C x + D u``; ``dt`` is the sample time in s, 0 in continuous time. The form without python-control."""

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]
    dt: float


class FrozenDeviation(NamedTuple):
    """Standard deviation of the frozen response, from the covariance of the fit.

    ``positions`` (n_p,) and ``frequencies`` (n_f,) in Hz; ``in_phase`` and ``quadrature``, both (n_p, n_f, n_y, n_u), are the
    deviations of the error along the response and across it, in its unit. The deviation of an entry is the root of both squared.
    """

    positions: NDArray[np.float64]
    frequencies: NDArray[np.float64]
    in_phase: NDArray[np.float64]
    quadrature: NDArray[np.float64]

    @property
    def total(self) -> NDArray[np.float64]:
        """Root of E|dF|^2, shape (n_p, n_f, n_y, n_u)."""
        return np.hypot(self.in_phase, self.quadrature)


def system(matrices: _lpvident.Matrices, dt: float, identification: Mapping[str, Any] | None) -> Any:
    """A ``control.StateSpace`` where python-control is installed, with the names that the identification of a model knows."""
    try:
        import control
    except ImportError:
        return StateSpace(*matrices, dt)
    found = identification or {}
    given: dict[str, Any] = {group: _names(found.get(group, [])) for group in ("inputs", "outputs")}
    given["name"] = _name(found.get("bundle"))
    # States that nothing moves or sees stay: the matrices are those of the model.
    return control.StateSpace(*matrices, dt, remove_useless_states=False, **{k: v for k, v in given.items() if v})


def _name(name: Any) -> str:
    return str(name or "").replace(".", "_")


def _names(found: list[str]) -> list[str]:
    """Names as python-control takes them; none where one is missing, or two are alike."""
    names = [_name(name) for name in found]
    return names if all(names) and len(set(names)) == len(names) else []
