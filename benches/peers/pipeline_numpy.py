"""The whole reproduction in numpy and scipy: experiments, FRF, poles, basis, LPV-OBF models, LFR, time domain.

`python pipeline_numpy.py [--quick]` prints one JSON object. Positions run side by side on as many threads as OMP_NUM_THREADS says;
with more than one, OPENBLAS_NUM_THREADS=1 keeps the products of matrices from taking the same cores again.

The steps are those of `cargo xtask reproduce` with its checks against the plant, but for the margins of the loop and the condition of the
inputs. Where this is plainer: the centres of FKcM come from damped Newton steps on a smoothed maximum instead of a bisection on discs, and
its alternation is had on the way to the joint descent; the minimax polish takes all points at once; poles come from vector fitting and
Gauss-Newton from one start; the LFR takes all outputs through each delta block.
"""

import json
import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import scipy.fft
import scipy.linalg
import scipy.signal
import scipy.stats
from factors import inverse_cholesky, triangle
from memory import peak_mib
from numpy.polynomial import chebyshev
from scipy.interpolate import CubicSpline, make_interp_spline

QUICK = "--quick" in sys.argv[1:]
PERIOD, PERIODS, SKIP = (1 << 13, 12, 4) if QUICK else (1 << 15, 25, 10)
CLEAN_PERIODS = 4
SIZES = (8, 16) if QUICK else (8, 12, 16, 20, 24, 28, 32)
TABLE_SIZES = (4, 8, 12, 16)
REFINEMENT = 2 if QUICK else 4
CONTINUUM = 401 if QUICK else 2001
POSITIONS, CHOSEN, ORDER, TABLE_LINES, SAMPLES = 21, 16, 17, 1500, 4000
SEED, T, STROKE, AMPLITUDE = 0, 0.05, 0.3, 1e-4
NOISE = np.array([1e-7, 5e-6]) / 3
BAND = 3.0
FUZZINESS, STARTS, EXTRA_STARTS, ALTERNATIONS = 35.0, 8, 3, 100
TAU = 2 * np.pi
POOL = ThreadPoolExecutor(int(os.environ.get("OMP_NUM_THREADS") or os.cpu_count()))


# The machine.

M1, M2, J1, J2, ARM = 12.0, 20.0, 0.25, 1.2, 0.5
REDUCED = np.array([M1 * M2 / (M1 + M2), J1 * J2 / (J1 + J2)])
MODES = TAU * np.array([1.45, 2.0])
STIFFNESS, DAMPING = MODES**2 * REDUCED, 2 * 0.015 * MODES * REDUCED


def plant(p):
    """A, B, C of the decoupled plant at every p of an array: states [y1, R1, y2, R2] and their rates."""
    p = np.asarray(p, float)
    e = np.zeros((*p.shape, 4, 2))
    e[..., :, 0] = np.stack([np.ones_like(p), np.zeros_like(p), -np.ones_like(p), -p], -1)
    e[..., :, 1] = [0, 1, 0, -1]
    inverse_mass = 1 / np.array([M1, J1, M2, J2])
    a = np.zeros((*p.shape, 8, 8))
    a[..., :4, 4:] = np.eye(4)
    a[..., 4:, :4] = -inverse_mass[:, None] * ((e * STIFFNESS) @ np.swapaxes(e, -1, -2))
    a[..., 4:, 4:] = -inverse_mass[:, None] * ((e * DAMPING) @ np.swapaxes(e, -1, -2))
    # The motors produce the wrench M_rb(p) u' on the beam.
    b = np.zeros((*p.shape, 8, 2))
    b[..., 6, 0], b[..., 6, 1] = (M1 + M2) / M2, M1 * p / M2
    b[..., 7, 0], b[..., 7, 1] = M1 * p / J2, (M1 * p**2 + J1 + J2) / J2
    c = np.zeros((*p.shape, 2, 8))
    c[..., 0, 0], c[..., 0, 1], c[..., 1, 1] = 1, -p, 1
    return a, b, c


def held(a, b, t=T):
    """Exact sampling with held inputs, for stacks of systems."""
    n, m = a.shape[-1], b.shape[-1]
    whole = np.zeros((*a.shape[:-2], n + m, n + m))
    whole[..., :n, :n], whole[..., :n, n:] = a * t, b * t
    whole = scipy.linalg.expm(whole)
    return whole[..., :n, :n], whole[..., :n, n:]


def sampled(p):
    a, b, c = plant(p)
    return *held(a, b), c


def true_poles(p):
    """The sampled flexible poles in the upper half plane, shape of p and two."""
    s = np.linalg.eigvals(plant(p)[0])
    s = np.take_along_axis(s, np.argsort(-s.imag, -1), -1)[..., :2]
    return np.exp(s[..., ::-1] * T)


def response(a, b, c, z):
    """C (zI - A)^-1 B at all z."""
    return c @ np.linalg.solve(z[:, None, None] * np.eye(len(a)) - a, b.astype(complex))


def rigid_body(z):
    return (z + 1) / (z - 1) ** 2


def continuous_controller(bandwidth):
    """Lead-lag-integrator with roll-off."""
    w = TAU * bandwidth
    roll = 6 * w
    poles = [0, -3 * w, *np.roots([1, 1.4 * roll, roll**2])]
    zeros = [-w / 8, -w / 3]
    s = 1j * w
    gain = w**2 / abs(np.prod(s - np.array(zeros)) / np.prod(s - np.array(poles)))
    return scipy.signal.zpk2ss(zeros, poles, gain)


def controller(bandwidth):
    """The same, sampled with a held error."""
    return scipy.signal.cont2discrete(continuous_controller(bandwidth), T, "zoh")[:4]


def beside(k):
    """Two copies of a controller, one a channel."""
    return [np.kron(np.eye(2), m) for m in k]


# Experiments and FRF.


def multisine():
    """All lines to Nyquist, Schroeder phases, crest factor reduced by clipping."""
    lines = PERIOD // 2
    k = np.arange(lines)
    phasors = np.exp(-1j * np.pi * k * (k + 1) / lines)
    best, lowest = None, np.inf
    for iteration in range(51):
        phasors[-1] = 1 if phasors[-1].real >= 0 else -1
        signal = scipy.fft.irfft(np.concatenate([[0], phasors]), PERIOD)
        peak = abs(signal).max()
        crest = peak / np.sqrt(np.mean(signal**2))
        if crest < lowest:
            best, lowest = signal, crest
        level = peak * (0.75 + 0.2 * iteration / 50)
        phasors = scipy.fft.rfft(np.clip(signal, -level, level))[1:]
        phasors /= abs(phasors)
    return best * (AMPLITUDE / abs(best).max())


def loop(p, k):
    """Closed loop from w = r - v to [y', u']."""
    a, b, c = sampled(p)
    ak, bk, ck, dk = beside(k)
    n, m = len(a), len(ak)
    a = np.block([[a - b @ dk @ c, b @ ck], [-bk @ c, ak]])
    b = np.vstack([b @ dk, bk])
    c = np.block([[c, np.zeros((2, m))], [-dk @ c, ck]])
    d = np.vstack([np.zeros((2, 2)), dk])
    return a, b, c, d


def continuous_loop(p, k):
    """The same with a continuous controller, which is strictly proper; nothing but r is held."""
    a, b, c = plant(p)
    ak, bk, ck, _ = beside(k)
    n, m = len(a), len(ak)
    a, b = held(np.block([[a, b @ ck], [-bk @ c, ak]]), np.vstack([np.zeros((n, 2)), bk]))
    c = np.block([[c, np.zeros((2, m))], [np.zeros((2, n)), ck]])
    return a, b, c, np.zeros((4, 2))


def transfer(system):
    """Transform of the pulse response of a loop, and its length: that of a period and of the memory above rounding."""
    a, b, c, d = system
    memory = int(np.ceil(np.log(1e-17) / np.log(abs(np.linalg.eigvals(a)).max())))
    x, power = b, a
    while x.shape[1] < 2 * memory:
        x, power = np.hstack([x, power @ x]), power @ power
    pulses = np.concatenate([d[:, None], (c @ x).reshape(4, -1, 2)[:, :memory]], 1)
    n = scipy.fft.next_fast_len(PERIOD + memory, real=True)
    return scipy.fft.rfft(pulses, n, axis=1).transpose(0, 2, 1).copy(), n


def estimate(through, n, r, periods, skip, rng=None):
    """FRF of two experiments from rest, by overlap-add with the pulse response of the loop; without a generator, without noise."""
    tail, noise = 0.0, np.zeros((2, 2, PERIOD))
    spectra = np.empty((periods - skip, 2, 4, PERIOD // 2 - 1), complex)
    for period in range(periods):
        if rng is not None:
            noise = rng.standard_normal((2, 2, PERIOD)) * NOISE[:, None]
        w = scipy.fft.rfft(r - noise, n)
        z = through[:, 0] * w[:, None, 0]
        z += through[:, 1] * w[:, None, 1]
        z = scipy.fft.irfft(z, n)
        # What rings on after a period is shorter than the next one.
        z[..., : n - PERIOD] += tail
        z, tail = z[..., :PERIOD], z[..., PERIOD:].copy()
        z[:, :2] += noise
        if period >= skip:
            spectra[period - skip] = scipy.fft.rfft(z)[..., 1:-1]
    return frf(spectra, scipy.fft.rfft(r)[..., 1:-1])


def relative(f, truth):
    """Relative error by line, of the Frobenius norms."""
    return np.sqrt((abs(f - truth) ** 2).sum((0, 1)) / (abs(truth) ** 2).sum((0, 1)))


def experiment(index, p, r, k, z):
    """Two orthogonal experiments with noise, and their copies without: the FRF, and how it lies about the true one."""
    through, n = transfer(loop(p, k))
    found = estimate(through, n, r, PERIODS, SKIP, np.random.default_rng([SEED, index]))
    clean = estimate(through, n, r, CLEAN_PERIODS, CLEAN_PERIODS // 2)[0]
    truth = response(*sampled(p), z).transpose(1, 2, 0)
    f, c, s = found
    # |dF|^2 over its variance is distributed as F(2, 2 nu).
    quantile = scipy.stats.f.ppf(0.95, 2, 4 * (PERIODS - SKIP - 1))
    variance = np.einsum("iil,jjl->ijl", c, s).real
    inside = np.mean(abs(f - truth) ** 2 <= quantile * variance)
    return found, (relative(f, truth), relative(clean, truth).max(), inside)


def inverse(m):
    """Of 2x2 matrices, lines along the last axis."""
    (a, b), (c, d) = m
    return np.array([[d, -b], [-c, a]]) / (a * d - b * c)


def times(a, b):
    return np.einsum("ij...,jk...->ik...", a, b)


def frf(spectra, r):
    """(15) with the covariance of its noise: E[dF_ij conj dF_kl] = C[i,k] S[l,j]. Lines along the last axis."""
    count = len(spectra)
    mean = spectra.mean(0).swapaxes(0, 1)
    adjoint = r.conj()
    gain = times(adjoint, inverse(times(mean[2:], adjoint)))
    f = times(mean[:2], gain)
    left = spectra[:, :, :2] - f[:, 0] * spectra[:, :, 2, None]
    left -= f[:, 1] * spectra[:, :, 3, None]
    left -= left.mean(0)
    c = np.empty_like(f)
    for i, j in ((0, 0), (1, 0), (1, 1)):
        c[i, j] = (left[:, :, i] * left[:, :, j].conj()).sum((0, 1))
    c[0, 1] = c[1, 0].conj()
    c /= 2 * (count - 1) * count
    s = np.einsum("eil,ejl->ijl", gain.conj(), gain)
    return f, c, s


def experiments(positions, frequencies):
    signal, k = multisine(), controller(0.2)
    r, z = np.stack([[signal, signal], [signal, -signal]]), np.exp(1j * TAU * T * frequencies)
    runs = list(POOL.map(lambda i: experiment(i, positions[i], r, k, z), range(len(positions))))
    errors, clean, inside = zip(*(account for _, account in runs))
    modes = (frequencies >= 1) & (frequencies <= 3)
    through, n = transfer(continuous_loop(positions[0], continuous_controller(0.2)))
    held_input = estimate(through, n, r, CLEAN_PERIODS, CLEAN_PERIODS // 2)[0]
    truth = response(*sampled(positions[0]), z).transpose(1, 2, 0)
    account = {
        "noise_free_max_rel": float(max(clean)),
        "coverage95": float(np.mean(inside)),
        "median_rel": float(np.median(errors)),
        "median_rel_modes": float(np.median(np.array(errors)[:, modes])),
        "continuous_median_rel": float(np.median(relative(held_input, truth))),
    }
    return [found for found, _ in runs], account


# Poles.


def inner(x, y):
    """Re x^H y over the lines, which stand along the last axis."""
    return np.ascontiguousarray(x).view(float) @ np.ascontiguousarray(y).view(float).T


def gram(phi, psi, weight):
    """Normal matrix of functions in all four channels, ordered (channel, function)."""
    products = (phi[:, None] * psi.conj()).reshape(-1, phi.shape[1])
    h = inner(products, weight.reshape(16, -1)).reshape(len(phi), len(psi), 4, 4)
    return h.transpose(2, 0, 3, 1).reshape(4 * len(phi), 4 * len(psi))


def pair_functions(z, poles, power=1):
    """1/(z-p)^k + 1/(z-p*)^k and j times their difference, for each pole."""
    a, b = (1 / (z - q) ** power for q in (poles[:, None], poles.conj()[:, None]))
    return np.stack([a + b, 1j * (a - b)], 1).reshape(-1, len(z))


def solve_scaled(h, rhs):
    """A positive definite system, scaled to unit diagonal first."""
    d = 1 / np.sqrt(np.diag(h))
    x = scipy.linalg.solve(h * d[:, None] * d, (d * rhs.T).T, assume_a="pos")
    return (d * x.T).T


def fit_poles(f, c, s, z):
    """Two integrators and two modes common to all channels: vector fitting, then Gauss-Newton, weighted by the covariance.

    Gives the poles, the variance of each, and how far the cost is above its expectation, in standard deviations.
    """
    right, lines = inverse(s), len(z)
    weight = np.einsum("kil,jml->kmijl", inverse(c), right).reshape(4, 4, lines)
    size = abs(weight).mean()
    weight /= size
    f = f.reshape(4, lines)
    integrators = np.stack([1 / (z - 1), 1 / (z - 1) ** 2])
    weighted = np.einsum("cdl,dl->cl", weight, f)
    power = (f.conj() * weighted).sum(0)[None]
    poles = np.exp((-0.01 + 1j) * TAU * T * np.array([1.0, BAND]))
    for _ in range(20):
        # sigma F = sum of residues, sigma = 1 + sum of residues on the same poles; its zeros are the next poles.
        chi = pair_functions(z, poles)
        phi = np.concatenate([integrators, chi])
        n = len(phi)
        h = np.empty((4 * n + 4, 4 * n + 4))
        h[: 4 * n, : 4 * n] = gram(phi, phi, weight)
        products = (phi[:, None] * chi.conj()).reshape(-1, lines)
        cross = inner(products, weighted).reshape(n, 4, 4).transpose(2, 0, 1).reshape(4 * n, 4)
        h[: 4 * n, 4 * n :], h[4 * n :, : 4 * n] = -cross, -cross.T
        products = (chi[:, None] * chi.conj()).reshape(-1, lines)
        h[4 * n :, 4 * n :] = inner(products, power).reshape(4, 4)
        rhs = np.concatenate([inner(phi, weighted).T.ravel(), -inner(chi, power).ravel()])
        sigma = solve_scaled(h, rhs)[4 * n :]
        a = scipy.linalg.block_diag(*[[[p.real, p.imag], [-p.imag, p.real]] for p in poles])
        zeros = np.linalg.eigvals(a - np.outer([2, 0, 2, 0], sigma))
        zeros = zeros[zeros.imag > 0]
        if len(zeros) != 2:
            raise RuntimeError("vector fitting lost a mode")
        zeros = np.where(abs(zeros) > 1, 1 / zeros.conj(), zeros)
        moved = abs(np.sort_complex(zeros) - np.sort_complex(poles)).max()
        poles = zeros
        if moved < 1e-6:
            break

    def best_residues(poles):
        chi, psi = pair_functions(z, poles), pair_functions(z, poles, 2)
        phi = np.concatenate([integrators, chi])
        h = gram(np.concatenate([phi, psi]), np.concatenate([phi, psi]), weight).reshape(4, 10, 4, 10)
        beta, left = np.zeros((4, 6)), f
        h_bb = h[:, :6, :, :6].reshape(24, 24)
        # The second pass refines: its right-hand side comes from the residual.
        for _ in range(2):
            beta = beta + solve_scaled(h_bb, inner(phi, np.einsum("cdl,dl->cl", weight, left)).T.ravel()).reshape(4, 6)
            left = f - beta @ phi
        weighted = np.einsum("cdl,dl->cl", weight, left)
        # Derivatives by real and imaginary part of a pole, as combinations of psi.
        turn = np.zeros((4, 4, 4))
        for k in range(2):
            one, other = beta[:, 2 + 2 * k], beta[:, 3 + 2 * k]
            turn[:, 2 * k, 2 * k], turn[:, 2 * k + 1, 2 * k] = one, other
            turn[:, 2 * k, 2 * k + 1], turn[:, 2 * k + 1, 2 * k + 1] = -other, one
        turn = turn.reshape(16, 4)
        h_bt = h[:, :6, :, 6:].reshape(24, 16) @ turn
        h_tt = turn.T @ h[:, 6:, :, 6:].reshape(16, 16) @ turn - h_bt.T @ solve_scaled(h_bb, h_bt)
        gradient = turn.T @ inner(psi, weighted).T.ravel()
        cost = float(inner(left.reshape(1, -1), weighted.reshape(1, -1))[0, 0])
        return cost, gradient, h_tt

    cost, gradient, normal = best_residues(poles)
    for _ in range(30):
        step = np.linalg.solve(normal, gradient)
        if step @ gradient <= 1e-6 * cost / (8 * lines):
            break
        for _ in range(20):
            trial = poles + step[0::2] + 1j * step[1::2]
            found = best_residues(trial)
            if found[0] < cost:
                break
            step = step / 2
        else:
            break
        poles, (cost, gradient, normal) = trial, found
    # The covariance has 2 (M - 1) degrees of freedom: its inverse has a larger mean than that of the true one, and scatters.
    degrees = 2 * (PERIODS - SKIP - 1)
    variance = np.diag(np.linalg.inv(2 * size * normal)).reshape(2, 2).sum(1) * degrees**2 / ((degrees - 2) ** 2 - 1)
    freedom = (4 * lines - 14) * degrees / (degrees - 2)
    order = np.argsort(np.angle(poles))
    return poles[order], variance[order], (size * cost - freedom) / np.sqrt(freedom)


# Basis: FKcM.


def log_kappa(z, v):
    gap = abs(z - v) ** 2
    return 0.5 * np.log(gap / (gap + (1 - abs(z) ** 2) * (1 - abs(v) ** 2)))


def log_distances(z, v):
    """kappa to a pole times kappa to its conjugate; shape (..., points, centres)."""
    z, v = z[:, None], v[..., None, :]
    return log_kappa(z, v) + log_kappa(z, v.conj())


def n_width_db(poles, z):
    return 20 / np.log(10) * log_distances(z, poles).sum(-1).max(-1)


def log_sum(x):
    """Logarithm of the sum of exponentials along the last axis, and the share of each."""
    top = x.max(-1, keepdims=True)
    share = np.exp(x - top)
    total = share.sum(-1, keepdims=True)
    return (top + np.log(total))[..., 0], share / total


def power_mean(l):
    """Logarithm of the power mean of distances given by theirs, and the influence of each: their memberships."""
    value, share = log_sum(-l / (FUZZINESS - 1))
    return -(FUZZINESS - 1) * (value - np.log(l.shape[-1])), share


def chart(v, z):
    """Where z is seen from v, and the derivatives of ln kappa there: ln d + Re(g w + h w^2 / 2)."""
    seen = (z - v) / (1 - v.conj() * z)
    return seen, seen.conj() - 1 / seen, seen.conj() ** 2 - 1 / seen**2


def minimax(model, v, sharpness, steps):
    """Newton steps with Levenberg's damping on smoothed maxima, for a batch of problems; the best of each is kept.

    `model` gives values (batch, points) and their first and second derivatives (batch, points, centres) in charts at v.
    """
    batch, n = v.shape
    values, g, h = model(v)
    best, best_v = values.max(-1), v
    damping = np.full(batch, 1e-3)
    diagonal, upper = np.arange(2 * n), np.arange(n)
    for p in sharpness:
        smooth, share = log_sum(p * values)
        active = np.ones(batch, bool)
        for _ in range(steps):
            j = np.concatenate([g.real, -g.imag], -1)
            weighted = share[..., None] * j
            gradient = weighted.sum(1)
            hessian = p * (j.swapaxes(1, 2) @ weighted - gradient[:, :, None] * gradient[:, None])
            second = (share[..., None] * h).sum(1)
            hessian[:, upper, upper] += second.real
            hessian[:, upper + n, upper + n] -= second.real
            hessian[:, upper, upper + n] -= second.imag
            hessian[:, upper + n, upper] -= second.imag
            scale = np.maximum(hessian[:, diagonal, diagonal].max(-1), 1e-3)
            hessian[:, diagonal, diagonal] += (damping * scale)[:, None]
            step = -np.linalg.solve(hessian, gradient[..., None])[..., 0]
            step *= np.minimum(0.4 / abs(step).max(-1, keepdims=True), 1)
            w = step[:, :n] + 1j * step[:, n:]
            trial = (w + v) / (1 + v.conj() * w)
            trial = trial.real + 1j * abs(trial.imag)
            found = model(trial)
            reached, shares = log_sum(p * found[0])
            good = active & (reached < smooth) & (abs(trial).max(-1) < 1 - 1e-14)
            active &= ~(good & (smooth - reached < 0.01)) & (damping < 1e6)
            damping = np.clip(np.where(good, 0.15 * damping, 5 * damping), 1e-10, 1e7)
            smooth = np.where(good, reached, smooth)
            share = np.where(good[:, None], shares, share)
            v = np.where(good[:, None], trial, v)
            values = np.where(good[:, None], found[0], values)
            g, h = (np.where(good[:, None, None], new, old) for new, old in zip(found[1:], (g, h)))
            better = good & (values.max(-1) < best)
            best = np.where(better, values.max(-1), best)
            best_v = np.where(better[:, None], v, best_v)
            if not active.any():
                break
        damping = np.minimum(damping, 1e3)
    return best, best_v


def leja(z, starts, n, rng):
    """Poles one after the other, each near the point that those before cover least."""
    v = np.empty((starts, n), complex)
    for start in v:
        sums = np.zeros(len(z))
        following = rng.integers(len(z))
        for i in range(n):
            w = 0.25 * rng.uniform(0.05, 1) * np.exp(1j * TAU * rng.uniform())
            moved = (w + z[following]) / (1 + z[following].conj() * w)
            start[i] = moved.real + 1j * abs(moved.imag)
            sums += log_distances(z, start[i : i + 1])[:, 0]
            following = np.argmax(sums)
    return v


def fkcm(z, functions):
    """Poles of the upper half plane that minimise the fuzzy cost over the observed ones, from Leja starts, and those of the
    alternation that comes first."""
    n = functions // 2
    v = leja(z, STARTS, n, np.random.default_rng([SEED, functions]))

    def centre(weight):
        def model(v):
            seen, g, h = chart(v, z)
            return weight + np.log(abs(seen)), g[..., None], h[..., None]

        return model

    cost, best = np.full(STARTS, np.inf), v
    stalled = np.zeros(STARTS, int)
    for _ in range(ALTERNATIONS + 1):
        l = log_distances(z, v)
        value, membership = power_mean(l)
        now = value.max(-1)
        stalled = np.where(now < cost - 1e-6, 0, stalled + 1)
        best = np.where((now < cost)[:, None], v, best)
        cost = np.minimum(now, cost)
        if (stalled >= 3).all():
            break
        # The distance to the conjugate is taken at the last centre.
        weight = FUZZINESS * np.log(membership) + log_kappa(z[:, None], v.conj()[:, None])
        weight = weight.swapaxes(1, 2).reshape(-1, len(z))
        going = np.repeat(stalled < 3, n)
        v = v.ravel()
        v[going] = minimax(centre(weight[going]), v[going, None], 4.0 ** np.arange(3, 8), 3)[1][:, 0]
        v = v.reshape(STARTS, n)

    def joint(v):
        upper, lower = (chart(v[:, None], x[:, None]) for x in (z, z.conj()))
        value, influence = power_mean(np.log(abs(upper[0] * lower[0])))
        return n * value, n * influence * (upper[1] + lower[1]), n * influence * (upper[2] + lower[2])

    alternation = best[np.argmin(cost)]
    cost, best = minimax(joint, best, 4.0 ** np.arange(1, 10), 24)
    return best[np.argmin(cost)], alternation


def polish(z, v):
    """Poles with the least n-width cost over z, from v and from Leja starts."""

    def model(v):
        upper, lower = (chart(v[:, None], x[:, None]) for x in (z, z.conj()))
        return np.log(abs(upper[0] * lower[0])).sum(-1), upper[1] + lower[1], upper[2] + lower[2]

    starts = np.concatenate([v[None], leja(z, EXTRA_STARTS, len(v), np.random.default_rng([SEED, len(v)]))])
    cost, best = minimax(model, starts, 4.0 ** np.arange(1, 10), 24)
    return best[np.argmin(cost)]


def kautz(poles):
    """Parameters of the all-pass sections of the pairs."""
    size = abs(poles) ** 2
    b, c = 2 * poles.real / (1 + size), -size
    s = abs(1 - poles**2) / (1 + size)
    return b, c, s, np.sqrt((1 - size) * (1 + size))


def basis_response(poles, z):
    """Takenaka-Malmquist functions of the pairs, one row a function."""
    rows, product = [], np.ones_like(z)
    for b, c, s, q in zip(*kautz(poles)):
        through = product / (z * z + b * (c - 1) * z - c)
        rows += [q * (z - b) * through, q * s * through]
        product = (-c * z * z + b * (c - 1) * z + 1) * through
    return np.array(rows)


def basis_state_space(poles):
    """A and B whose state is the vector of functions."""
    n = 2 * len(poles)
    a, b, out, direct = np.zeros((n, n)), np.zeros(n), np.zeros(n), 1.0
    for i, (beta, c, s, q) in enumerate(zip(*kautz(poles))):
        at = slice(2 * i, 2 * i + 2)
        a[2 * i] = q * out
        a[at, at] = [[-beta * c, c * s], [s, beta]]
        b[2 * i] = q * direct
        out *= -c
        out[at] = -beta * q, s * q
        direct *= -c
    return a, b


# LPV-OBF models.


def whitened_triangle(estimate, phi, phi_r, model_error):
    """Triangular factor of the equations of one position: 4 n_g weights, two gains, the response.

    The factors of the covariance are triangular, so a whitened channel holds only some of the weights.
    """
    f, c, s = estimate
    n = len(phi)
    c = c.copy()
    trace = (s[0, 0] + s[1, 1]).real
    for i in range(2):
        c[i, i] += model_error**2 * (abs(f[i]) ** 2).sum(0) / trace
    left, right = inverse_cholesky(c), inverse_cholesky(s)
    whole = []
    for i in range(2):
        for j in range(2):
            columns, rows, target = [], [], 0
            gains = {}
            for a in range(i + 1):
                for b in range(j + 1):
                    factor = np.sqrt(2) * left[i, a] * np.conj(right[j, b])
                    rows.append(factor * phi)
                    columns += range((2 * a + b) * n, (2 * a + b + 1) * n)
                    target = target + factor * f[a, b]
                    if a == b:
                        gains[4 * n + a] = factor * phi_r
            rows = np.concatenate([*rows, *(g[None] for g in gains.values()), target[None]])
            part = np.zeros((len(rows), 4 * n + 3))
            part[:, [*columns, *gains, 4 * n + 2]] = triangle(rows.view(float))
            whole.append(part)
    return np.linalg.qr(np.concatenate(whole), mode="r")


class Fits:
    """Weights at every position, with gains that all positions share."""

    def __init__(self, estimates, frequencies, poles, model_error):
        z = np.exp(1j * TAU * T * frequencies)
        phi, phi_r = basis_response(poles, z), rigid_body(z)
        factors = np.array(list(POOL.map(lambda e: whitened_triangle(e, phi, phi_r, model_error), estimates)))
        n = 4 * len(phi)
        self.poles, self.equations = poles, 8 * len(z)
        # The cost at each position with gains of its own, over what the covariance expects.
        self.cost_over_expected = np.median(factors[:, -1, -1] ** 2 / (self.equations - n - 2))
        below = factors[:, n:, n:].reshape(-1, 3)
        self.gains = np.linalg.lstsq(below[:, :2], below[:, 2], rcond=None)[0]
        self.r11 = factors[:, :n, :n]
        rhs = factors[:, :n, n + 2] - factors[:, :n, n : n + 2] @ self.gains
        self.weights = np.array([scipy.linalg.solve_triangular(r, b) for r, b in zip(self.r11, rhs)])

    def responses(self, cardinals, z):
        """Frozen responses, (p, 2, 2, line), where `cardinals` weighs the positions."""
        weights = (cardinals @ self.weights).reshape(len(cardinals), 4, -1)
        g = (weights @ basis_response(self.poles, z)).reshape(-1, 2, 2, len(z))
        for i in range(2):
            g[:, i, i] += self.gains[i] * rigid_body(z)
        return g

    def leave_one_out(self, kind, positions):
        """Increase of the weighted sum of squares per equation where a position is predicted from the others."""
        total = 0.0
        for q in range(1, len(positions) - 1):
            kept = np.arange(len(positions)) != q
            weight = cardinals(kind, positions[kept], positions[q : q + 1])[0]
            total += np.sum((self.r11[q] @ (weight @ self.weights[kept] - self.weights[q])) ** 2)
        return total / (self.equations * (len(positions) - 2))


# Polynomial through the samples, Chebyshev interpolant of their spline, spline, Gaussian process, straight lines.
KINDS = [("polynomial", n) for n in (7, 11, ORDER)] + [("chebyshev", ORDER), ("spline", 3), ("process", 6), ("linear", 1)]


def chebyshev_coefficients(kind, positions):
    """Map from samples to coefficients of Chebyshev polynomials over the range."""
    name, order = kind
    x = 2 * (positions - positions[0]) / (positions[-1] - positions[0]) - 1
    if name == "polynomial":
        return np.linalg.pinv(chebyshev.chebvander(x, order), rcond=1e-13)
    # The interpolant in the Chebyshev points of the spline through the samples.
    return chebyshev.chebinterpolate(CubicSpline(x, np.eye(len(x))), order)


def matern(distance):
    r = np.sqrt(5) * abs(distance)
    return (1 + r + r * r / 3) * np.exp(-r)


def cardinals(kind, positions, at):
    """Weight of each sample in the value at each point: every interpolation is linear in the samples."""
    name, order = kind
    if name in ("polynomial", "chebyshev"):
        x = 2 * (at - positions[0]) / (positions[-1] - positions[0]) - 1
        return chebyshev.chebvander(x, order) @ chebyshev_coefficients(kind, positions)
    if name == "process":
        # Matern 5/2 of six spacings with an unknown mean.
        length = order * 2 * STROKE / (POSITIONS - 1)
        n = len(positions)
        inverse = np.linalg.inv(matern((positions[:, None] - positions) / length) + 1e-10 * np.eye(n))
        mean = inverse.sum(0) / inverse.sum()
        return mean + matern((at[:, None] - positions) / length) @ inverse @ (np.eye(n) - mean)
    return make_interp_spline(positions, np.eye(len(positions)), order)(at)


def between(poles, positions):
    """The poles on a finer grid: each mode's ln z by a spline."""
    fine = np.linspace(positions[0], positions[-1], 10 * (len(positions) - 1) + 1)
    return np.exp(CubicSpline(positions, np.log(poles))(fine)).ravel()


class Grid:
    """Positions and lines on which models are compared with the plant."""

    def __init__(self):
        wide = np.geomspace(0.01, 0.999 * 0.5 / T, 240)
        lines = np.sort(np.concatenate([wide, np.linspace(1, 3, 400)]))
        self.frequencies = lines[np.diff(lines, prepend=0) > 1e-9]
        self.z = np.exp(1j * TAU * T * self.frequencies)
        self.positions = np.linspace(-STROKE, STROKE, (POSITIONS - 1) * REFINEMENT + 1)
        systems = zip(*sampled(self.positions))
        self.truth = np.array(list(POOL.map(lambda s: response(*s, self.z).transpose(1, 2, 0), systems)))
        self.size = np.sqrt((abs(self.truth) ** 2).sum((1, 2)))
        self.in_band = self.frequencies <= BAND

    def errors(self, g):
        """Largest and median relative error over the band, then up to Nyquist, in dB: at all positions, at those measured, between."""
        error = np.sqrt((abs(g - self.truth) ** 2).sum((1, 2))) / self.size
        measured = np.arange(len(error)) % REFINEMENT == 0
        rows = error, error[measured], error[~measured]
        parts = [part for e in rows for part in (e[:, self.in_band], e)]
        return [float(20 * np.log10(f(part))) for part in parts for f in (np.max, np.median)]

    def by_channel(self, g):
        """Largest and median error of each channel over the size of the response, in dB."""
        error = (abs(g - self.truth) / self.size[:, None, None]).transpose(1, 2, 0, 3).reshape(4, -1)
        return [[float(20 * np.log10(f(e))) for f in (np.max, np.median)] for e in error]

    def exact(self):
        """The true responses at the measured positions, every line weighted by its size."""
        unit = np.broadcast_to(np.eye(2)[..., None], (2, 2, len(self.z)))
        return [(f, unit * (abs(f) ** 2).sum((0, 1)), unit) for f in self.truth[::REFINEMENT]]


def identify(estimates, frequencies, poles, positions, bases, grid):
    """The model with the chosen size on all lines, and the table over sizes and interpolations on fewer."""
    fine = between(poles, positions)

    def fit(functions, step, pure=False):
        if functions not in bases:
            bases[functions] = fkcm(poles.ravel(), functions)[0]
        error = 0 if pure else 10 ** (n_width_db(bases[functions], fine) / 20)
        few = [[x[..., ::step] for x in e] for e in estimates]
        return Fits(few, frequencies[::step], bases[functions], error)

    maps = {kind: cardinals(kind, positions, grid.positions) for kind in KINDS}
    fits, step = fit(CHOSEN, 1), -(-len(frequencies) // TABLE_LINES)
    costs = {kind: fits.leave_one_out(kind, positions) for kind in KINDS}
    account = {"chosen": min(costs, key=costs.get), "cost_over_expected": fit(CHOSEN, step, True).cost_over_expected}
    account["recommended"] = grid.errors(fits.responses(maps[account["chosen"]], grid.z))
    for kind in (("polynomial", ORDER), ("chebyshev", ORDER)):
        account[kind] = grid.errors(fits.responses(maps[kind], grid.z))
    account["by_channel"] = grid.by_channel(fits.responses(maps[account["chosen"]], grid.z))
    exact = Fits(grid.exact(), grid.frequencies, fits.poles, 0)
    account["noise_free"] = grid.errors(exact.responses(maps["spline", 3], grid.z))
    table = {}
    for functions in SIZES:
        own = fit(functions, step)
        for kind in KINDS:
            table[functions, kind] = grid.errors(own.responses(maps[kind], grid.z))
    return fits, account, table


# LFR.


class Lfr:
    """x' = A x + B2 u + B1 w, y = C2 x + D21 w, z = C1 x + D11 w, w = delta z; delta = p over the half stroke."""

    def __init__(self, fits, kind, positions):
        a, b = basis_state_space(fits.poles)
        n = len(b)
        rigid = [[1, 1], [0, 1]]
        self.a = scipy.linalg.block_diag(rigid, rigid, a, a)
        self.b2 = np.zeros((4 + 2 * n, 2))
        for i in range(2):
            self.b2[2 * i : 2 * i + 2, i] = fits.gains[i], 2 * fits.gains[i]
            self.b2[4 + i * n : 4 + (i + 1) * n, i] = b
        # C(p) = sum_k C_k T_k(delta): the weights by (output, input, function).
        theta = (chebyshev_coefficients(kind, positions) @ fits.weights).reshape(-1, 2, 2 * n)
        c = np.zeros((len(theta), 2, 4 + 2 * n))
        c[:, :, 4:] = theta
        c[0, 0, 0] = c[0, 1, 2] = 1
        # Clenshaw: b_k = C_k x + 2 delta b_(k+1) - b_(k+2), y = C_0 x + delta b_1 - b_2.
        order = len(c) - 1
        from_x, from_w = np.zeros((order + 3, 2, 4 + 2 * n)), np.zeros((order + 3, 2, 2 * order))
        for k in range(order, 0, -1):
            from_x[k] = c[k] - from_x[k + 2]
            from_w[k] = -from_w[k + 2]
            if k < order:
                from_w[k][:, 2 * k : 2 * k + 2] += 2 * np.eye(2)
        self.c1, self.d11 = from_x[1 : order + 1].reshape(2 * order, -1), from_w[1 : order + 1].reshape(2 * order, -1)
        self.c2, self.d21 = c[0] - from_x[2], -from_w[2]
        self.d21[:, :2] += np.eye(2)
        self.b1 = np.zeros((len(self.a), 2 * order))

    def frozen(self, p):
        """A, B, C at every p of an array."""
        delta = (p / STROKE)[:, None, None]
        through = delta * np.linalg.solve(np.eye(len(self.d11)) - delta * self.d11, self.c1)
        return self.a + self.b1 @ through, np.broadcast_to(self.b2, (len(p), *self.b2.shape)), self.c2 + self.d21 @ through


def realise(fits, kind, positions, grid):
    """The LFR, which is well-posed everywhere, and its largest relative difference from the model on the grid."""
    lfr = Lfr(fits, kind, positions)
    if np.tril(lfr.d11).any():
        raise RuntimeError("I - D11 delta may be singular")
    z = grid.z[::8]
    g = fits.responses(cardinals(kind, positions, grid.positions), z)
    own = np.array(list(POOL.map(lambda s: response(*s, z).transpose(1, 2, 0), zip(*lfr.frozen(grid.positions)))))
    difference = np.sqrt((abs(own - g) ** 2).sum((1, 2)) / (abs(g) ** 2).sum((1, 2)))
    return lfr, float(difference.max())


# Time domain.


def profile(start, parts, limits, samples):
    """Position and speed of rests (seconds) and fastest moves (targets) with bounded speed, acceleration and jerk."""
    speed, acceleration, jerk = limits
    begins, states, jerks, now, x = [0.0], [(start, 0.0, 0.0)], [0.0], 0.0, start
    for kind, value in parts:
        if kind == "rest":
            now += value
            continue
        distance = abs(value - x)
        tj = min(np.cbrt(distance / jerk / 2), np.sqrt(speed / jerk), acceleration / jerk)
        top = jerk * tj
        ta = max(min((np.sqrt(tj**2 + 4 * distance / top) - 3 * tj) / 2, speed / top - tj), 0)
        tv = max(distance / (top * (tj + ta)) - 2 * tj - ta, 0)
        sign = jerk if value > x else -jerk
        state = (x, 0.0, 0.0)
        for duration, j in zip((tj, ta, tj, tv, tj, ta, tj), (sign, 0, -sign, 0, -sign, 0, sign)):
            begins.append(now), states.append(state), jerks.append(j)
            s, v, a = state
            d = duration
            state = (s + d * (v + d * (a / 2 + d * j / 6)), v + d * (a + d * j / 2), a + d * j)
            now += duration
        x = value
        begins.append(now), states.append((x, 0.0, 0.0)), jerks.append(0.0)
    at = T * np.arange(samples)
    i = np.searchsorted(begins, at, side="right") - 1
    s, v, a = np.array(states)[i].T
    d, j = at - np.array(begins)[i], np.array(jerks)[i]
    return s + d * (v + d * (a / 2 + d * j / 6)), v + d * (a + d * j / 2)


def servo(x, v):
    """Positions of the carriage and its speeds and accelerations, constant between samples."""
    a, b, c, _ = controller(0.5)
    b, c = b[:, 0], c[0]
    forward = np.diff(v, append=v[-1]) / T
    k, p, speed = np.zeros(4), x[0], 0.0
    out = np.empty((len(x), 3))
    for i in range(len(x)):
        force = forward[i] + c @ k
        out[i] = p, speed, force
        k = a @ k + b * (x[i] - p)
        p, speed = p + T * (speed + T * force / 2), speed + T * force
    return out.T


def simulate(a, b, c, k, r=None, u=None):
    """Outputs and inputs of a sampled model with matrices by sample: with given inputs, or in closed loop along r."""
    ak, bk, ck, _ = beside(k)
    x, s = np.zeros(a.shape[1]), np.zeros(len(ak))
    y, inputs = np.empty((len(a), 2)), np.empty((len(a), 2))
    for i in range(len(a)):
        y[i] = c[i] @ x
        if u is None:
            inputs[i] = ck @ s
            s = ak @ s + bk @ (r[i] - y[i])
        else:
            inputs[i] = u[i]
        x = a[i] @ x + b[i] @ inputs[i]
    return y, inputs


def transitions(p, v, a, steps):
    """Matrices over each sample while p moves, by Magnus steps of fourth order at Gauss nodes."""
    h = T / steps
    whole = np.broadcast_to(np.eye(10), (len(p), 10, 10))
    for step in range(steps):
        generator = []
        for node in (0.5 - np.sqrt(3) / 6, 0.5 + np.sqrt(3) / 6):
            t = (step + node) * h
            m = np.zeros((len(p), 10, 10))
            m[:, :8, :8], m[:, :8, 8:], _ = plant(p + t * (v + t * a / 2))
            generator.append(m)
        one, two = generator
        whole = scipy.linalg.expm(h / 2 * (one + two) - np.sqrt(3) / 12 * h**2 * (one @ two - two @ one)) @ whole
    return whole[:, :8, :8], whole[:, :8, 8:]


def record(x, v, r, k):
    """Closed loop on the moving machine; steps a sample are doubled until the outputs agree to 1e-10."""
    p, speed, acceleration = servo(x, v)
    c, before, steps = plant(p)[2], np.inf, 1
    while True:
        y, u = simulate(*transitions(p, speed, acceleration, steps), c, k, r=r)
        if abs(y - before).max() <= 1e-10 or steps >= 1024:
            return p, u, y
        before, steps = y, 2 * steps


def time_domain(lfr, positions):
    k = controller(0.2)
    moves = [("rest", 5.0), ("rest", 12.0)]
    for target in (0.05, 0.1, 0.05, 0.0, -0.05, 0.0):
        moves += [("move", target), ("rest", 12.0)]
    r = np.zeros((SAMPLES, 2))
    r[:, 0] = profile(0.0, moves, (0.02, 0.01, 0.02), SAMPLES)[0]
    far = 0.98 * STROKE
    sweep = record(*profile(-far, [("move", far)], (0.01, 0.005, 0.01), SAMPLES), r, k)
    still = record(np.full(SAMPLES, positions[2:4].mean()), np.zeros(SAMPLES), r, k)

    def over_noise(run, made):
        return (np.sqrt(np.mean((run[0] - made[2]) ** 2, 0)) / NOISE).tolist()

    account = {}
    for name, model in (("lfr", lfr.frozen), ("plant", sampled)):
        own = model(sweep[0])
        account[f"{name}_open_loop"] = over_noise(simulate(*own, k, u=sweep[1]), sweep)
        account[f"{name}_closed_loop"] = over_noise(simulate(*own, k, r=r), sweep)
    account["lfr_closed_loop_constant_p"] = over_noise(simulate(*lfr.frozen(still[0]), k, r=r), still)
    return account


def main():
    start = last = time.perf_counter()
    seconds = {}

    def lap(stage):
        nonlocal last
        now = time.perf_counter()
        seconds[stage], last = now - last, now

    positions = np.linspace(-STROKE, STROKE, POSITIONS)
    frequencies = np.arange(1, PERIOD // 2) / (PERIOD * T)
    estimates, responses = experiments(positions, frequencies)
    lap("experiments_frf")
    z = np.exp(1j * TAU * T * frequencies)
    poles, variances, excess = map(np.array, zip(*POOL.map(lambda e: fit_poles(*e, z), estimates)))
    distance = abs(poles[:, :, None] - true_poles(positions)[:, None]).min(-1)
    truth, grid = true_poles(np.linspace(-STROKE, STROKE, CONTINUUM)).ravel(), Grid()
    lap("poles")
    found = dict(zip(TABLE_SIZES, POOL.map(lambda n: fkcm(poles.ravel(), n), TABLE_SIZES)))
    bases = {n: v for n, (v, _) in found.items()}
    polished = POOL.map(lambda n: polish(truth, bases[n]), TABLE_SIZES)
    table_one = {
        n: [float(n_width_db(v, at)) for v, at in ((fuzzy, truth), (fuzzy, poles.ravel()), (alternation, truth), (best, truth))]
        for (n, (fuzzy, alternation)), best in zip(found.items(), polished)
    }
    lap("basis")
    fits, account, table = identify(estimates, frequencies, poles, positions, bases, grid)
    lap("obf")
    differences = {}
    for kind in (("polynomial", ORDER), ("chebyshev", ORDER)):
        lfr, differences[kind] = realise(fits, kind, positions, grid)
    lap("lfr")
    in_time = time_domain(lfr, positions)
    lap("time")
    recommended = account["recommended"]
    print(json.dumps({
        "stage_seconds": seconds,
        "wall_seconds": time.perf_counter() - start,
        "peak_mib": peak_mib(),
        "frf": responses,
        "worst_pole_percent": float(100 * distance.max()),
        "pole_error_over_deviation": float(np.sqrt(np.mean(distance**2 / variances))),
        "worst_cost_excess": float(excess.max()),
        "band_strict_max_db": recommended[0],
        "band_median_db": recommended[1],
        "lfr_direct_max_rel": max(differences.values()),
        "n_width_true_estimated_alternation_minimax_db": table_one,
        "cost_over_expected": float(account["cost_over_expected"]),
        "noise_free_band_strict_max_db": account["noise_free"][0],
        "by_channel_db": account["by_channel"],
        "interpolation_by_leave_one_out": " ".join(map(str, account["chosen"])),
        "table_spline_band_db": {n: table[n, ("spline", 3)][:2] for n in SIZES},
        "polynomial_band_strict_max_db": account["polynomial", ORDER][0],
        "time_over_noise": in_time,
    }))


if __name__ == "__main__":
    main()
