#!/usr/bin/env python3
"""Independent answers for the tests of the metrics (pipeline/src/metrics/tests.rs).

    python3 -m venv venv
    venv/bin/pip install numpy==2.4.6 flip-evaluator==1.7 scikit-image==0.26.0
    venv/bin/python tests/oracle/metrics.py

The pictures are made by the same integer formulas as in the tests, so that anybody can repeat the numbers.
"""

import flip_evaluator
import numpy as np
from skimage.metrics import mean_squared_error, peak_signal_noise_ratio, structural_similarity

WIDTH, HEIGHT = 61, 47


def smooth(x, y, c):
    """Slopes with steps where they wrap around."""
    return (x * 5 + y * 3 + c * 40) % 256


def disc(x, y, c):
    """The slopes with a disc 60 steps brighter."""
    inside = (x - 20) ** 2 + (y - 16) ** 2 < 64
    return min(smooth(x, y, c) + 60, 255) if inside else smooth(x, y, c)


def noisy(x, y, c):
    """The slopes with up to 12 steps of noise either way."""
    noise = (x * 7919 + y * 104729 + c * 1299709 + x * y * 31) % 25 - 12
    return min(max(smooth(x, y, c) + noise, 0), 255)


def colored(x, y, c):
    """Red and blue swapped."""
    return smooth(x, y, 2 - c)


def other(x, y, c):
    """Something else."""
    return (x * x + 3 * y * y + c * 85) % 256


def picture(value):
    rows = [[[value(x, y, c) for c in range(3)] for x in range(WIDTH)] for y in range(HEIGHT)]
    return np.array(rows, dtype=np.float32) / np.float32(255)


def luminance(image):
    return image.astype(np.float64) @ np.array([0.2126, 0.7152, 0.0722])


reference = picture(smooth)
for value in (disc, noisy, colored, other):
    test = picture(value)
    a, b = test.astype(np.float64), reference.astype(np.float64)
    rmse = mean_squared_error(b, a) ** 0.5
    psnr = peak_signal_noise_ratio(b, a, data_range=1.0)
    ssim = structural_similarity(
        luminance(reference), luminance(test), gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1.0
    )
    maps = {
        ppd: flip_evaluator.evaluate(reference, test, "LDR", applyMagma=False, parameters={"ppd": ppd})
        for ppd in (67.0, 30.0)
    }
    pixels = [float(maps[67.0][0][y, x, 0]) for x, y in ((0, 0), (20, 16), (28, 16), (60, 46))]
    print(value.__name__)
    print(f"  rmse {rmse:.9f} psnr {psnr:.7f} ssim {ssim:.9f}")
    print(f"  flip {maps[67.0][1]:.6f} at 67 pixels per degree, {maps[30.0][1]:.6f} at 30")
    print("  flip at (0, 0) (20, 16) (28, 16) (60, 46):", " ".join(f"{pixel:.6f}" for pixel in pixels))
