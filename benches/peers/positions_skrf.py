"""An LPV fit over positions: parametric vector fitting of scikit-rf."""

import warnings

import numpy as np
import skrf
from peer import complex_, real, serve
from skrf.vectorFitting import VectorFittingParametric

warnings.filterwarnings("ignore")
rates, positions, between = real("rates", -1), real("positions", -1), real("between", -1)
frf = complex_("frf", len(positions), len(rates), 2, 2)
# The double integrator is known: it is taken off before the fit and put back after it.
pole = 40.0 * np.pi
rigid = ((1j * rates + pole) / (1j * rates))[:, None, None] ** 2
networks = skrf.networkSet.NetworkSet(
    [skrf.Network(f=rates, s=s / rigid, f_unit="hz", params={"p": p}) for s, p in zip(frf, positions)]
)


def run():
    fit = VectorFittingParametric(networks, n_poles_real=2, n_poles_cmplx=2)
    fit.auto_fit(enforce_passivity=False)
    warnings.filterwarnings("ignore")
    return np.stack([rigid * fit.get_model_response(params={"p": p}, freqs=rates) for p in between])


serve(run)
