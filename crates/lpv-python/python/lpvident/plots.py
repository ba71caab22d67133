"""Pictures of returned arrays, in matplotlib."""

from __future__ import annotations

from typing import Any

import numpy as np

from .model import Model


def bode(model: Model, p: Any, frequencies: Any, axes: Any) -> Any:
    """See `Model.plot_bode`."""
    import matplotlib.pyplot as plt

    bounds = model.range
    if bounds is None:
        places: list[Any] = [None]
    elif p is None:
        places = [bounds[:, 0], bounds.mean(axis=1), bounds[:, 1]]
    else:
        given = np.atleast_1d(np.asarray(p, dtype=np.float64))
        places = list(given) if len(bounds) == 1 else list(np.atleast_2d(given))
    if frequencies is None:
        nyquist = 0.5 / (model.sample_time or 1.0)
        frequencies = np.geomspace(1e-3 * nyquist, 0.999 * nyquist, 400)
    lines = np.atleast_1d(np.asarray(frequencies, dtype=np.float64))
    if axes is None:
        _, axes = plt.subplots(model.outputs, model.inputs, sharex=True, squeeze=False)
    axes = np.asarray(axes, dtype=object).reshape(model.outputs, model.inputs)
    for place in places:
        size = np.abs(model.frequency_response(place, lines, sampled=model.sample_time is not None))
        label = None if place is None else "p = " + ", ".join(f"{v:g}" for v in np.atleast_1d(place))
        for (i, j), axis in np.ndenumerate(axes):
            axis.loglog(lines, size[:, i, j], label=label)
            axis.set_title(f"output {i + 1}, input {j + 1}", fontsize="small")
    for axis in axes[-1]:
        axis.set_xlabel("frequency, Hz")
    if places[0] is not None:
        axes[0, 0].legend(fontsize="small")
    return axes
