"""Weights of a basis at 21 positions, weighted by the covariance of the FRF: numpy, `lstsq` or a batched QR."""

import sys

import numpy as np
from peer import complex_, real, serve

P, N = 21, 16
frf, basis = complex_("frf", P, -1, 2, 2), complex_("basis", -1, N)
noise, factor = complex_("noise", P, -1, 2, 2), complex_("factor", P, -1, 2, 2)
L = basis.shape[0]


def rows(p):
    """Whitened equations: of dF = V G with V white after C^-1/2 and G^H G the input factor, C^-1/2 F G^-1 is."""
    left = np.linalg.inv(np.linalg.cholesky(noise[p]))
    # S = G^H G with G upper triangular, from the Cholesky factor of S.
    right = np.linalg.inv(np.linalg.cholesky(factor[p]).conj().transpose(0, 2, 1))
    target = left @ frf[p] @ right
    # Unknown W[n, i, j]: equation (l, a, b) has left[a, i] basis[n] right[j, b].
    pair = np.einsum("lai,ljb->labij", left, right)
    matrix = (basis[:, None, None, :, None, None] * pair[:, :, :, None]).reshape(4 * L, 4 * N)
    target = target.reshape(4 * L)
    return np.concatenate([matrix.real, matrix.imag]), np.concatenate([target.real, target.imag])


def lstsq():
    return np.stack([np.linalg.lstsq(*rows(p), rcond=None)[0] for p in range(P)])


def qr():
    out = []
    for p in range(P):
        matrix, target = rows(p)
        # One triangle of all rows from those of blocks of them, as a batch.
        both = np.column_stack([matrix, target])
        blocks = np.linalg.qr(both.reshape(8, -1, both.shape[1]), mode="r")
        r = np.linalg.qr(blocks.reshape(-1, both.shape[1]), mode="r")
        out.append(np.linalg.solve(r[:-1, :-1], r[:-1, -1]))
    return np.stack(out)


weights = {"lstsq": lstsq, "qr": qr}[sys.argv[3]]


def run():
    return weights().reshape(P, N, 2, 2)


serve(run)
