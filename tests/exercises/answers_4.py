"""Answers to the exercises of chapter 4: right ones, and typical misconceptions."""

import math

import numpy as np

RIGHT = {"4.1": 15.85, "4.2": 12.53, "4.3": 24.65, "4.4": 28, "4.5": 6}

WRONG = [
    ("4.1", 8 * 1.95, "the scaled reference itself"),
    ("4.1", -3.0 + 2 * math.pi * 2, "floor for round"),
    ("4.1", 3, "the order, not the phase"),
    ("4.2", math.pi / 0.05, "one standard deviation"),
    ("4.2", math.pi / (5 * 0.05), "the 1 under the root forgotten"),
    ("4.2", 2 * math.pi / (5 * 0.05), "a period for half a period"),
    ("4.2", (math.pi / (5 * 0.05)) ** 2 - 1, "root forgotten"),
    ("4.3", 25, "rounded: the beat is 600"),
    ("4.3", 24 * 912 / (912 + 24), "the shorter partner"),
    ("4.3", 912 + 24, "sum for beat"),
    ("4.4", 27, "product for least common multiple"),
    ("4.4", 16, "any pitch without a common divisor"),
    ("4.4", 29, "a prime, which need not be"),
    ("4.5", 5, "one too few"),
    ("4.5", 290, "two frequencies' worth"),
    ("4.5", np.array([6, 6, 6]), "one number for each pitch"),
]
