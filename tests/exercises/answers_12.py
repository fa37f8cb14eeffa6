"""Answers to the exercises of chapter 12: right ones, and typical misconceptions."""

import numpy as np


def _sigma(sigma, pitch, rate):
    return sigma / (2 * np.pi / pitch * rate)


def _second(frames):
    n = np.arange(len(frames))
    waves = np.exp(-2j * np.pi * np.outer((1, 2), n) / len(frames))
    fringe, harmonic = np.abs(waves @ frames)
    return harmonic / fringe


def _grows(Phi):
    right = np.diff(Phi, axis=1)
    right = right[np.isfinite(right)]
    return 1 if np.sum(right > 0) > np.sum(right < 0) else -1


RIGHT = {"12.1": _sigma, "12.2": 32, "12.3": _second, "12.4": _grows}

WRONG = [
    ("12.1", lambda sigma, pitch, rate: sigma * pitch / rate, "forgot 2 pi"),
    ("12.1", lambda sigma, pitch, rate: sigma * pitch / (2 * np.pi), "in columns"),
    ("12.1", lambda sigma, pitch, rate: _sigma(sigma, pitch, 1 / rate), "times the sensitivity"),
    ("12.2", 16, "factor 2 forgotten"),
    ("12.2", 4, "root in place of the square"),
    ("12.2", 31, "one too few"),
    ("12.3", lambda frames: 1 / _second(frames), "upside down"),
    ("12.3", lambda frames: _second(frames) ** 2, "power instead of amplitude"),
    ("12.3", lambda frames: _second(frames.T), "along the pixels"),
    ("12.4", lambda Phi: -_grows(Phi), "the wrong way round"),
    ("12.4", lambda Phi: np.sign(np.diff(Phi, axis=1).mean()), "NaN in the mean"),
    ("12.4", lambda Phi: np.sign(np.nanmedian(np.diff(Phi, axis=0))), "downwards"),
    ("12.4", lambda Phi: 1, "always to the right"),
]
