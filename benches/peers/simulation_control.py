"""Simulation of a closed loop at constant p: python-control."""

import control
import numpy as np
from peer import real, serve

n = 24
a, b, c, d = real("a", n, n), real("b", n, 2), real("c", 2, n), real("d", 2, 2)
inputs = real("inputs", -1, 2).T.copy()
system = control.ss(a, b, c, d, 0.05)
times = 0.05 * np.arange(inputs.shape[1])


def run():
    return control.forced_response(system, times, inputs).outputs.T


serve(run)
