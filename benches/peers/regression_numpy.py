"""Weights of a basis at 21 positions, weighted by the covariance of the FRF: numpy, by `lstsq`, a batched QR or normal equations."""

import sys

import numpy as np
from factors import inverse_cholesky, triangle
from peer import complex_, serve

P, N = 21, 16
frf, basis = complex_("frf", P, -1, 2, 2), complex_("basis", -1, N)
noise, factor = complex_("noise", P, -1, 2, 2), complex_("factor", P, -1, 2, 2)
L = basis.shape[0]
# Lines along the last axis.
phi = np.ascontiguousarray(basis.T)
conjugate = phi.conj()


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


def lstsq(p):
    return np.linalg.lstsq(*rows(p), rcond=None)[0].reshape(N, 2, 2)


def qr(p):
    """The factors of the covariance are triangular, so a whitened channel holds only some of the weights."""
    f = np.ascontiguousarray(np.moveaxis(frf[p], 0, -1))
    left, right = (inverse_cholesky(np.moveaxis(m[p], 0, -1)) for m in (noise, factor))
    whole = []
    for i in range(2):
        for j in range(2):
            columns, rows, target = [], [], 0
            for a in range(i + 1):
                for b in range(j + 1):
                    weight = left[i, a] * np.conj(right[j, b])
                    rows.append(weight * phi)
                    columns += range((2 * a + b) * N, (2 * a + b + 1) * N)
                    target = target + weight * f[a, b]
            rows = np.concatenate([*rows, target[None]])
            part = np.zeros((len(rows), 4 * N + 1))
            part[:, [*columns, 4 * N]] = triangle(rows.view(float))
            whole.append(part)
    r = np.linalg.qr(np.concatenate(whole), mode="r")
    return np.linalg.solve(r[:-1, :-1], r[:-1, -1]).reshape(2, 2, N).transpose(2, 0, 1)


def inverse(m):
    """Of 2x2 matrices, lines along the last axis."""
    (a, b), (c, d) = np.ascontiguousarray(np.moveaxis(m, 0, -1))
    over = 1 / (a * d - b * c)
    return np.array([[d * over, -b * over], [-c * over, a * over]])


def product(a, b):
    """Of 2x2 matrices, lines along the last axis."""
    return np.array([[a[i, 0] * b[0, j] + a[i, 1] * b[1, j] for j in range(2)] for i in range(2)])


def normal(p):
    """Sums of products, whose condition is the square of that of the equations: C^-1 on the left of F, S^-1 on its right."""
    left, right = inverse(noise[p]), inverse(factor[p])
    target = product(product(left, np.ascontiguousarray(np.moveaxis(frf[p], 0, -1))), right)
    sums = (conjugate @ target.reshape(4, L).T).real.T
    pairs = [(row, column) for row in range(4) for column in range(row + 1)]
    blocks = np.empty((len(pairs), N, L), complex)
    for block, (row, column) in zip(blocks, pairs):
        (i, j), (k, m) = divmod(row, 2), divmod(column, 2)
        np.multiply(conjugate, left[i, k] * right[m, j], out=block)
    products = (blocks.reshape(-1, L) @ phi.T).real.reshape(len(pairs), N, N)
    gram = np.empty((4, N, 4, N))
    for block, (row, column) in zip(products, pairs):
        gram[row, :, column] = block
        gram[column, :, row] = block.T
    weights = np.linalg.solve(gram.reshape(4 * N, 4 * N), sums.reshape(4 * N))
    return weights.reshape(2, 2, N).transpose(2, 0, 1)


weights = {"lstsq": lstsq, "qr": qr, "normal": normal}[sys.argv[3]]


def run():
    return np.stack([weights(p) for p in range(P)])


serve(run)
