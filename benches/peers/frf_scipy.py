"""FRF of a 2x2 experiment with the covariance of its noise, from periodic records: scipy.fft and numpy.

A period at a time, whose spectra fit the cache; matrices of two rows in closed form.
"""

import numpy as np
import scipy.fft
from peer import THREADS, real, serve

EXPERIMENTS, PERIODS, CHANNELS, PERIOD = 2, 25, 6, 1 << 15
signals = real("signals", EXPERIMENTS, PERIODS, CHANNELS, PERIOD)
lines = real("lines", -1).astype(int)
# Neighbours: a view where a list of lines would be a copy.
band = slice(lines[0], lines[-1] + 1)
assert np.array_equal(lines, np.arange(band.start, band.stop))


def transform(signal):
    return scipy.fft.rfft(signal, axis=-1, norm="forward", workers=THREADS)[..., band]


def inverse(a, b, c, d):
    over = 1 / (a * d - b * c)
    return d * over, -b * over, -c * over, a * over


def run():
    references = transform(signals[:, :, 4:].mean(axis=1))
    spectra = [[transform(period[:4]) for period in experiment] for experiment in signals]
    mean = np.stack([sum(periods[1:], periods[0].copy()) for periods in spectra]) / PERIODS
    # Of what follows the reference, then the response from input to output.
    r = inverse(references[0, 0], references[1, 0], references[0, 1], references[1, 1])
    along = [(x[0] * r[0] + x[1] * r[2], x[0] * r[1] + x[1] * r[3]) for x in mean.swapaxes(0, 1)]
    u = inverse(*along[2], *along[3])
    g = [(y[0] * u[0] + y[1] * u[2], y[0] * u[1] + y[1] * u[3]) for y in along[:2]]
    # What one period adds to the output beside the response, and the sums of its products.
    first, second, cross = 0.0, 0.0, 0.0
    for periods, middle in zip(spectra, mean):
        middle = [middle[i] - g[i][0] * middle[2] - g[i][1] * middle[3] for i in (0, 1)]
        for period in periods:
            a, b = (period[i] - g[i][0] * period[2] - g[i][1] * period[3] - middle[i] for i in (0, 1))
            first, second = first + a.real**2 + a.imag**2, second + b.real**2 + b.imag**2
            cross = cross + a.conj() * b
    covariance = np.array([[first, cross.conj()], [cross, second]]) / (EXPERIMENTS * (PERIODS - 1) * PERIODS)
    a, b, c, d = inverse(mean[0, 2], mean[1, 2], mean[0, 3], mean[1, 3])
    off = a.conj() * b + c.conj() * d
    factor = np.array([[abs(a) ** 2 + abs(c) ** 2, off], [off.conj(), abs(b) ** 2 + abs(d) ** 2]])
    # Views, column after column.
    return [np.asarray(part, complex).transpose(2, 1, 0) for part in (g, covariance, factor)]


serve(run)
