"""Poles from an FRF: vector fitting of scikit-rf."""

import warnings

import numpy as np
import skrf
from peer import complex_, real, serve

warnings.filterwarnings("ignore")
lines = real("rates", -1)
frf = complex_("frf", -1, 2, 2)
# The double integrator is known: it is taken off before the fit and put back after it.
a, b = 20.0 * np.pi, 40.0 * np.pi
rigid = ((1j * lines + a) * (1j * lines + b) / (1j * lines) ** 2)[:, None, None]
network = skrf.Network(f=lines, s=frf / rigid, f_unit="hz")


def run():
    fit = skrf.vectorFitting.VectorFitting(network)
    fit.vector_fit(n_poles_real=2, n_poles_cmplx=5, init_pole_spacing="lin")
    out = np.empty((len(lines), 2, 2), complex)
    for i in range(2):
        for j in range(2):
            out[:, i, j] = fit.get_model_response(i, j, lines)
    return out * rigid


serve(run)
