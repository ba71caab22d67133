"""The refinement of an LFR on frozen responses: scipy.optimize.least_squares with the analytic Jacobian, until the cost is reached."""

import numpy as np
from peer import complex_, real, serve
from scipy.optimize import least_squares

N, NU, NY, ND = 8, 2, 2, 5
SIZE = N + NU + ND
start, free = real("start", SIZE, SIZE), real("free", SIZE, SIZE).astype(bool)
positions, lines, goal = real("positions", -1), real("lines", -1), real("cost", 1)[0]
frf = complex_("frf", len(positions), len(lines), NY, NU)
z = np.exp(2j * np.pi * lines / 20.0)
scale = 1.0 / np.linalg.norm(frf, axis=(2, 3))
# What closes the loops: 1/z for states, p for the others.
inside = np.r_[0:N, N + NY : SIZE]
outside = np.r_[N : N + NY]
theta = np.empty((len(positions), len(lines), N + ND), complex)
theta[:, :, :N] = 1.0 / z[None, :, None]
theta[:, :, N:] = positions[:, None, None]
rows, columns = np.nonzero(free)
eye = np.eye(N + ND)


def model(x):
    m = start.copy()
    m[free] = x
    maa, mai = m[np.ix_(inside, inside)], m[np.ix_(inside, outside)]
    mia, mii = m[np.ix_(outside, inside)], m[np.ix_(outside, outside)]
    # X = (1 - Maa Theta)^-1.
    inverse = np.linalg.inv(eye - maa * theta[:, :, None, :])
    right = theta[..., None] * (inverse @ mai)
    return m, inverse, right, mii + mia @ right, mia


def residual(x):
    f = model(x)[3]
    r = ((f - frf) * scale[:, :, None, None]).ravel()
    return np.concatenate([r.real, r.imag])


def jacobian(x):
    _, inverse, right, _, mia = model(x)
    # dF = left dM whole, over all rows and columns of M.
    left = np.zeros((*theta.shape[:2], NY, SIZE), complex)
    left[..., inside] = (mia * theta[:, :, None, :]) @ inverse
    left[..., outside] = np.eye(NY)
    whole = np.zeros((*theta.shape[:2], SIZE, NU), complex)
    whole[:, :, inside] = right
    whole[:, :, outside] = np.eye(NU)
    left *= scale[:, :, None, None]
    j = left[:, :, :, None, rows] * whole[:, :, columns].swapaxes(2, 3)[:, :, None, :, :]
    j = j.reshape(-1, len(rows))
    return np.concatenate([j.real, j.imag])


class Reached(Exception):
    pass


def run():
    best = [None]

    def watched(x):
        r = residual(x)
        if r @ r <= goal:
            best[0] = x.copy()
            raise Reached
        return r

    try:
        # Of its methods that which is the first to reach the cost: before `lm`, and before either scaled by the Jacobian.
        least_squares(watched, start[free], jacobian, method="trf", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    except Reached:
        pass
    if best[0] is None:
        raise SystemExit("the cost was not reached")
    m = start.copy()
    m[free] = best[0]
    return m


serve(run)
