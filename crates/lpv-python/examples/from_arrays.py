"""Arrays to a model: a sampled resonance, one input and one output, identified from a record without periods."""

import numpy as np

import lpvident

rate, frequency, damping = 1000.0, 40.0, 0.05
pole = np.exp(2 * np.pi * frequency / rate * (-damping + 1j * np.sqrt(1 - damping**2)))

draw = np.random.default_rng(0)
records = []
for use in ("estimation", "validation"):
    u, y = draw.normal(size=4000), np.zeros(4000)
    for k in range(2, 4000):
        y[k] = 2 * pole.real * y[k - 1] - abs(pole) ** 2 * y[k - 2] + u[k - 1]
    records.append({"u": u, "y": y + 0.01 * draw.normal(size=4000), "use": use})

bundle = lpvident.Bundle.from_arrays(records, sample_rate=rate, name="resonance", units={"u1": "N", "y1": "m"})
model = bundle.identify(order=2)
print(model.verdict)
print("frequency", abs(np.log(model.poles()[0])) * rate / (2 * np.pi), "Hz, truth", frequency)
