"""The plant in its loop while the carriage moves: scipy.integrate.solve_ivp, sample by sample since inputs are held."""

import numpy as np
from peer import real, serve
from scipy.integrate import solve_ivp

m1, m2, j1, j2, length, ky, kr, dy, dr, servo_mass, t, tolerance = real("machine", -1)
y1, y2, x1, v1 = real("setpoints", 4, -1)
laws = [(real(f"numerator{i}", -1), real(f"denominator{i}", -1)) for i in range(3)]


def rates(_, x, force, u1, u2):
    p = x[0]
    push = (m1 + m2) * u1 + m1 * p * u2
    turn = (m1 * p * u1 + (m1 * p * p + j1 + j2) * u2) / length
    left, right = 0.5 * (push - turn), 0.5 * (push + turn)
    fy = ky * (x[1] - x[3] - p * x[4]) + dy * (x[6] - x[8] - p * x[9])
    fr = kr * (x[2] - x[4]) + dr * (x[7] - x[9])
    return [
        x[5], x[6], x[7], x[8], x[9],
        force / servo_mass,
        -fy / m1,
        -fr / j1,
        (fy + left + right) / m2,
        (p * fy + fr + length * (right - left)) / j2,
    ]


class Law:
    def __init__(self, numerator, denominator):
        self.b, self.a = numerator, denominator
        self.memory = np.zeros(len(numerator))

    def next(self, error):
        u = self.memory[0] + self.b[0] * error
        self.memory[:-1] = self.memory[1:]
        self.memory[-1] = 0.0
        self.memory[: len(self.b) - 1] += self.b[1:] * error - self.a[1:] * u
        return u


def run():
    k1, k2, servo = (Law(*law) for law in laws)
    y = y1[0] + x1[0] * y2[0]
    x = np.array([x1[0], y, y2[0], y, y2[0], 0, 0, 0, 0, 0])
    out = np.empty((2, len(y1)))
    for k in range(len(y1)):
        out[:, k] = x[1] - x[0] * x[2], x[2]
        u1, u2 = k1.next(y1[k] - out[0, k]), k2.next(y2[k] - out[1, k])
        forward = (v1[min(k + 1, len(v1) - 1)] - v1[k]) / t
        force = servo_mass * (forward + servo.next(x1[k] - x[0]))
        solution = solve_ivp(
            rates,
            (0.0, t),
            x,
            method="DOP853",
            rtol=tolerance,
            atol=1e-2 * tolerance,
            first_step=t,
            args=(force, u1, u2),
        )
        x = solution.y[:, -1]
    return out


serve(run)
