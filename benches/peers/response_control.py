"""Frequency response of a sampled system: python-control."""

import control
import numpy as np
from peer import real, serve

n = 24
a, b, c, d = real("a", n, n), real("b", n, 2), real("c", 2, n), real("d", 2, 2)
omega = 2 * np.pi * real("lines", -1)
system = control.ss(a, b, c, d, 0.05)


def run():
    return system.frequency_response(omega).complex.transpose(2, 0, 1)


serve(run)
