"""A response of many channels by another tool: `stage.py FOLDER METHOD OUTPUTS INPUTS MODES RATE`.

Reads `frequencies.f64` (Hz) and `frf.c16` (lines x outputs x inputs), writes `response.c16`, and prints the seconds of the fit and the peak of
the resident memory in MiB. The machine has a rigid body of two integrators and as many modes as said, which both methods are told.
"""

import sys
import time
import warnings
from pathlib import Path

import numpy as np
from memory import peak_mib

warnings.filterwarnings("ignore")
folder, method = Path(sys.argv[1]), sys.argv[2]
outputs, inputs, modes = (int(word) for word in sys.argv[3:6])
rate = float(sys.argv[6])
lines = np.fromfile(folder / "frequencies.f64")
frf = np.fromfile(folder / "frf.c16", dtype="<c16").reshape(-1, outputs, inputs)


def vector_fitting():
    """Vector fitting of scikit-rf, as many pairs of poles as modes, behind the bilinear transform and beside the integrators."""
    import skrf

    bent = rate / np.pi * np.tan(np.pi * lines / rate)
    a, b = 20.0 * np.pi, 40.0 * np.pi
    s = 2j * np.pi * bent
    rigid = (s + a) * (s + b) / s**2
    # The network must be square: a channel more than there are in each of the places that are left.
    ports = int(np.ceil(np.sqrt(outputs * inputs)))
    flat = (frf / rigid[:, None, None]).reshape(len(lines), -1)
    square = np.repeat(flat[:, :1], ports * ports, axis=1)
    square[:, : flat.shape[1]] = flat
    network = skrf.Network(f=bent, s=square.reshape(-1, ports, ports), f_unit="hz")
    fit = skrf.vectorFitting.VectorFitting(network)
    fit.vector_fit(n_poles_real=2, n_poles_cmplx=modes, init_pole_spacing="lin")
    places = [(i // ports, i % ports) for i in range(outputs * inputs)]
    found = [fit.get_model_response(i, j, bent) * rigid for i, j in places]
    return np.stack(found, axis=1).reshape(frf.shape)


def subspace():
    """Subspace identification from a response (McKelvey, Akcay and Ljung 1996), weighted for noise of one size on all lines."""
    z = np.exp(2j * np.pi * lines / rate)
    # Heave and two tilts move without a spring.
    order = 2 * (modes + min(outputs, inputs, 3))
    powers = z[:, None] ** np.arange(order)
    g = np.concatenate([np.kron(v[:, None], line) for v, line in zip(powers, frf)], axis=1)
    w = np.concatenate([np.kron(v[:, None], np.eye(inputs)) for v in powers], axis=1)
    stacked = np.vstack([w, g])
    stacked = np.hstack([stacked.real, stacked.imag])
    lower = np.linalg.qr(stacked.T, mode="r").T
    free = lower[order * inputs :, order * inputs :]
    noise = np.linalg.cholesky(np.kron((powers[:, :, None] * powers[:, None].conj()).sum(axis=0).real, np.eye(outputs)))
    u = noise @ np.linalg.svd(np.linalg.solve(noise, free), full_matrices=False)[0][:, :order]
    a = np.linalg.lstsq(u[:-outputs], u[outputs:], rcond=None)[0]
    poles, vectors = np.linalg.eig(a)
    states = (u[:outputs] @ vectors)[None] / (z[:, None, None] - poles[None, None, :])
    direct = np.broadcast_to(np.eye(outputs), (len(z), outputs, outputs))
    regressor = np.concatenate([states, direct], axis=2)
    solved = np.linalg.lstsq(regressor.reshape(-1, regressor.shape[2]), frf.reshape(-1, inputs), rcond=None)[0]
    return regressor @ solved


begin = time.perf_counter()
response = {"vector-fitting": vector_fitting, "subspace": subspace}[method]()
seconds = time.perf_counter() - begin
np.ascontiguousarray(response, dtype="<c16").tofile(folder / "response.c16")
print(seconds, peak_mib())
