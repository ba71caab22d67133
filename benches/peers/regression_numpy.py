"""Weights of a basis at 21 positions, weighted by the covariance of the FRF: numpy, by `lstsq`, a batched QR or normal equations."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor

if sys.argv[3] != "normal":
    # Positions side by side: threads of BLAS on small panels only wait for each other.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np
from factors import inverse_cholesky, triangle
from peer import THREADS, complex_, serve

P, N = 21, 16
frf, basis = complex_("frf", P, -1, 2, 2), complex_("basis", -1, N)
noise, factor = complex_("noise", P, -1, 2, 2), complex_("factor", P, -1, 2, 2)
L = basis.shape[0]
# Lines along the last axis.
phi = np.ascontiguousarray(basis.T)


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
    """Of Hermitian 2x2 matrices, lines along the last axis: both diagonal entries and the one below."""
    a, b, c = m[:, 0, 0].real, m[:, 1, 0], m[:, 1, 1].real
    over = 1 / (a * c - (b.real**2 + b.imag**2))
    return c * over, a * over, -b * over


def normal():
    """Sums of products, whose condition is the square of that of the equations: C^-1 on the left of F, S^-1 on its right.

    Products of two functions are made once for all positions, and summed with the weights of all as one product of real matrices.
    """
    rows, columns = np.triu_indices(N)
    above = rows < columns
    re, im = np.ascontiguousarray(phi.real), np.ascontiguousarray(phi.imag)
    even, odd = np.empty((len(rows), L)), np.empty((above.sum(), L))
    for out, i, j in zip(even, rows, columns):
        np.multiply(re[i], re[j], out=out)
        out += im[i] * im[j]
    for out, i, j in zip(odd, rows[above], columns[above]):
        np.multiply(re[i], im[j], out=out)
        out -= im[i] * re[j]
    # Weights of pairs of channels (2i + j, 2k + m): left[i, k] right[m, j]; real ones first.
    pairs = [(0, 0), (1, 1), (2, 2), (3, 3), (1, 0), (2, 0), (3, 0), (2, 1), (3, 1), (3, 2)]
    real_part, imaginary = np.empty((P, 10, L)), np.empty((P, 6, L))
    sums = np.empty((P, 4, N))
    for p in range(P):
        (l0, l1, l10), (r0, r1, r10) = inverse(noise[p]), inverse(factor[p])
        l01, r01 = l10.conj(), r10.conj()
        real_part[p, 0], real_part[p, 1] = l0 * r0, l0 * r1
        real_part[p, 2], real_part[p, 3] = l1 * r0, l1 * r1
        for k, weight in enumerate((l0 * r01, l10 * r0, l10 * r01, l10 * r10, l10 * r1, l1 * r01)):
            real_part[p, 4 + k], imaginary[p, k] = weight.real, weight.imag
        (f00, f01), (f10, f11) = np.ascontiguousarray(frf[p].transpose(1, 2, 0))
        f00, f01, f10, f11 = l0 * f00 + l01 * f10, l0 * f01 + l01 * f11, l10 * f00 + l1 * f10, l10 * f01 + l1 * f11
        target = np.stack([f00 * r0 + f01 * r10, f00 * r01 + f01 * r1, f10 * r0 + f11 * r10, f10 * r01 + f11 * r1])
        sums[p] = target.real @ re.T + target.imag @ im.T
    even = (real_part.reshape(-1, L) @ even.T).reshape(P, 10, -1)
    odd = (imaginary.reshape(-1, L) @ odd.T).reshape(P, 6, -1)
    gram = np.empty((P, 4, N, 4, N))
    for k, (row, column) in enumerate(pairs):
        block = np.empty((P, N, N))
        block[:, rows, columns] = block[:, columns, rows] = even[:, k]
        if row != column:
            block[:, rows[above], columns[above]] -= odd[:, k - 4]
            block[:, columns[above], rows[above]] += odd[:, k - 4]
            gram[:, column, :, row] = block.swapaxes(1, 2)
        gram[:, row, :, column] = block
    weights = np.linalg.solve(gram.reshape(P, 4 * N, 4 * N), sums.reshape(P, 4 * N, 1))
    return weights.reshape(P, 2, 2, N).transpose(0, 3, 1, 2)


def each(weights):
    pool = ThreadPoolExecutor(THREADS)
    return lambda: np.stack(list(pool.map(weights, range(P))))


serve({"lstsq": each(lstsq), "qr": each(qr), "normal": normal}[sys.argv[3]])
