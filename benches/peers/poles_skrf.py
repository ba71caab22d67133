"""Poles from an FRF: vector fitting of scikit-rf."""

import warnings

import numpy as np
import skrf
from peer import complex_, real, serve

warnings.filterwarnings("ignore")
lines = real("rates", -1)
frf = complex_("frf", -1, 2, 2)
network = skrf.Network(f=lines, s=frf, f_unit="hz")


def run():
    fit = skrf.vectorFitting.VectorFitting(network)
    fit.vector_fit(n_poles_real=0, n_poles_cmplx=6, init_pole_spacing="lin")
    out = np.empty((len(lines), 2, 2), complex)
    for i in range(2):
        for j in range(2):
            out[:, i, j] = fit.get_model_response(i, j, lines)
    return out


serve(run)
