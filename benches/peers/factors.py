"""Factorisations of whitened equations, line by line and in batches."""

import numpy as np


def inverse_cholesky(m):
    """L^-1 of m = L L^H, 2x2, by its entries (0,0), (1,0), (1,1)."""
    a = 1 / np.sqrt(m[0, 0].real)
    low = m[1, 0] * a
    d = 1 / np.sqrt(m[1, 1].real - abs(low) ** 2)
    return {(0, 0): a, (1, 0): -low * a * d, (1, 1): d}


def triangle(columns):
    """R of the QR factorisation of a tall matrix given by its columns, as a batch of blocks that fit the cache."""
    count = columns.shape[1]
    blocks = max(count // 2048, 1)
    size = count // blocks
    stack = columns[:, : blocks * size].reshape(len(columns), blocks, size).transpose(1, 2, 0)
    r = np.linalg.qr(stack, mode="r").reshape(-1, len(columns))
    return np.linalg.qr(np.concatenate([r, columns[:, blocks * size :].T]), mode="r")
