"""FRF of a 2x2 experiment with the covariance of its noise, from periodic records: scipy.fft and numpy."""

import numpy as np
import scipy.fft
from peer import THREADS, real, serve

EXPERIMENTS, PERIODS, CHANNELS, PERIOD = 2, 25, 6, 1 << 15
signals = real("signals", EXPERIMENTS, PERIODS, CHANNELS, PERIOD)
lines = real("lines", -1).astype(int)
# Neighbours: a view where a list of lines would be a copy.
band = slice(lines[0], lines[-1] + 1)
assert np.array_equal(lines, np.arange(band.start, band.stop))


def run():
    references = scipy.fft.rfft(signals[:, :, 4:].mean(axis=1), axis=-1, norm="forward", workers=THREADS)[..., band]
    spectra = scipy.fft.rfft(signals[:, :, :4], axis=-1, norm="forward", workers=THREADS)[..., band]
    mean = spectra.mean(axis=1)
    r = np.linalg.inv(references.transpose(2, 1, 0))
    y, u = mean[:, :2].transpose(2, 1, 0) @ r, mean[:, 2:].transpose(2, 1, 0) @ r
    g = y @ np.linalg.inv(u)
    # What one period adds to the output beside the response, and its covariance: sums over lines side by side.
    rows = np.ascontiguousarray(g.transpose(1, 2, 0))
    left = [spectra[:, :, i] - rows[i, 0] * spectra[:, :, 2] - rows[i, 1] * spectra[:, :, 3] for i in (0, 1)]
    for output in left:
        output -= output.mean(axis=1, keepdims=True)
    covariance = np.empty_like(g)
    for i, j in ((0, 0), (1, 0), (1, 1)):
        covariance[:, i, j] = (left[i] * left[j].conj()).sum((0, 1))
    covariance[:, 0, 1] = covariance[:, 1, 0].conj()
    covariance /= EXPERIMENTS * (PERIODS - 1) * PERIODS
    factor = np.linalg.inv(mean[:, 2:].transpose(2, 1, 0))
    # Views, column after column.
    return [part.transpose(0, 2, 1) for part in (g, covariance, factor.conj().transpose(0, 2, 1) @ factor)]


serve(run)
