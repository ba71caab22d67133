"""FRF of a 2x2 experiment with the covariance of its noise, from periodic records: scipy.fft and numpy."""

import numpy as np
import scipy.fft
from peer import THREADS, real, serve

EXPERIMENTS, PERIODS, CHANNELS, PERIOD = 2, 25, 6, 1 << 15
signals = real("signals", EXPERIMENTS, PERIODS, CHANNELS, PERIOD)
lines = real("lines", -1).astype(int)


def run():
    references = scipy.fft.rfft(signals[:, :, 4:].mean(axis=1), axis=-1, workers=THREADS)[..., lines]
    spectra = scipy.fft.rfft(signals[:, :, :4], axis=-1, workers=THREADS)[..., lines]
    mean = spectra.mean(axis=1)
    r = np.linalg.inv(references.transpose(2, 1, 0))
    y, u = mean[:, :2].transpose(2, 1, 0) @ r, mean[:, 2:].transpose(2, 1, 0) @ r
    g = y @ np.linalg.inv(u)
    # What one period adds to the output beside the response, and its covariance.
    left = spectra[:, :, :2] - np.einsum("lij,epjl->epil", g, spectra[:, :, 2:], optimize=True)
    left -= left.mean(axis=1, keepdims=True)
    covariance = np.einsum("epil,epjl->lij", left, left.conj(), optimize=True)
    covariance /= EXPERIMENTS * (PERIODS - 1) * PERIODS
    factor = np.linalg.inv(mean[:, 2:].transpose(2, 1, 0))
    run.covariance = covariance, factor.conj().transpose(0, 2, 1) @ factor
    return g


serve(run)
