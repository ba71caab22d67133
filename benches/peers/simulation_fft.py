"""Simulation of a stable closed loop at constant p from rest: its pulse response by doubling, convolved with scipy.fft.

Not a call of scipy for state spaces, but what vectorises: it needs the state at rest and a pulse response that ends.
"""

import numpy as np
import scipy.fft
from peer import THREADS, real, serve

n = 24
a, b, c, d = real("a", n, n), real("b", n, 2), real("c", 2, n), real("d", 2, 2)
inputs = real("inputs", -1, 2).T.copy()
samples = inputs.shape[1]
length = scipy.fft.next_fast_len(2 * samples, real=True)


def run():
    # States after a pulse of each input: twice as many by each power of A.
    states, power = b[:, None, :], a
    while states.shape[1] < samples:
        grown = (power @ states.reshape(n, -1)).reshape(states.shape)
        states, power = np.concatenate([states, grown], axis=1), power @ power
    pulses = np.empty((2, samples, 2))
    pulses[:, 0] = d
    pulses[:, 1:] = (c @ states[:, : samples - 1].reshape(n, -1)).reshape(2, -1, 2)
    h = scipy.fft.rfft(pulses.transpose(0, 2, 1), length, axis=-1, workers=THREADS)
    u = scipy.fft.rfft(inputs, length, axis=-1, workers=THREADS)
    y = scipy.fft.irfft(h[:, 0] * u[0] + h[:, 1] * u[1], length, axis=-1, workers=THREADS)
    return y[:, :samples].T


serve(run)
