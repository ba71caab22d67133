"""Simulation of a closed loop at constant p: scipy.signal.dlsim."""

import scipy.signal
from peer import real, serve

n = 24
system = (real("a", n, n), real("b", n, 2), real("c", 2, n), real("d", 2, 2), 0.05)
inputs = real("inputs", -1, 2)


def run():
    return scipy.signal.dlsim(system, inputs)[1]


serve(run)
