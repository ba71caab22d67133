"""Simulation of a closed loop at constant p in numpy: 64 samples as one step of the lifted model, most of which is a product of matrices."""

import numpy as np
from peer import real, serve

n, K = 24, 64
a, b, c, d = real("a", n, n), real("b", n, 2), real("c", 2, n), real("d", 2, 2)
inputs = real("inputs", -1, 2)
blocks = len(inputs) // K
assert blocks * K == len(inputs)


def run():
    power = [np.eye(n)]
    for _ in range(K):
        power.append(a @ power[-1])
    pulse = [d] + [c @ p @ b for p in power[: K - 1]]
    observe = np.concatenate([c @ p for p in power[:K]])
    reach = np.concatenate([p @ b for p in power[K - 1 :: -1]], 1)
    through = np.zeros((2 * K, 2 * K))
    for i in range(K):
        for j in range(i + 1):
            through[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = pulse[i - j]
    u = inputs.reshape(blocks, 2 * K)
    driven = u @ reach.T
    states, x = np.empty((blocks, n)), np.zeros(n)
    for k in range(blocks):
        states[k] = x
        x = power[K] @ x + driven[k]
    return (states @ observe.T + u @ through.T).reshape(-1, 2)


serve(run)
