"""Repeated calibrations of simulated views: how well the stated uncertainty holds, and which faults are noticed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from boards import CHESSBOARD, USUAL, scene, true_intrinsics

from subtense.errors import GeometryError
from subtense.workflow.calibrate import calibrate_views

LENSES = {
    "pinhole": ("pinhole", true_intrinsics(()), {}),
    "opencv4": ("brown_conrady", true_intrinsics((*USUAL[:4], 0.0)), {}),
    "opencv5": ("brown_conrady", true_intrinsics(USUAL), {}),
    "fisheye": (
        "fisheye",
        true_intrinsics((0.02, -0.01, 0.004, -0.001), 520.0),
        {"depth_m": (0.12, 0.4), "spread": (0.05, 0.95)},
    ),
}
"""Model, its lens, true intrinsics, and how the board is held."""


@dataclass(frozen=True)
class Fault:
    """A way to calibrate wrongly: what is true, and the model that is asked for (None: chosen automatically)."""

    truth: dict
    model: str | None
    notes: frozenset[str]


MODEL_ERROR = frozenset({"model_error"})
FAULTS = {
    "none": Fault({}, "opencv5", frozenset()),
    "none, model chosen": Fault({}, None, frozenset()),
    "board bowed 0.3 mm": Fault({"warp_m": (0.0003, 0.0)}, "opencv5", MODEL_ERROR),
    "board bowed 1 mm": Fault({"warp_m": (0.001, 0.0)}, "opencv5", MODEL_ERROR),
    "board bowed 1 mm, model chosen": Fault({"warp_m": (0.001, 0.0)}, None, MODEL_ERROR),
    "only k1 fitted": Fault({"intrinsics": true_intrinsics((*USUAL[:4], 0.0))}, "k1", MODEL_ERROR),
    "k3 = -0.5 not fitted": Fault({"intrinsics": true_intrinsics((*USUAL[:4], -0.5))}, "opencv4", MODEL_ERROR),
    "nearly frontal views": Fault({"tilt_deg": (0, 8)}, "opencv5", frozenset({"frontal_views"})),
}
"""The cases at the end of TRAPS: 20 views, 9 x 6 points over 240 x 150 mm, 0.3 px of noise."""


def calibrated(fault: Fault, rng):
    """One repeat."""
    return calibrate_views(scene(rng, **fault.truth), CHESSBOARD, model=fault.model)


@dataclass(frozen=True)
class Score:
    """Of many repeats of one fault: shares of those that raise a note (or are refused), the right note, and, of those with an
    answer, whose interval of f holds the truth."""

    noted: float
    rightly: float
    covered: float
    bias_px: float
    u_px: float


def score(name: str, repeats: int, seed: int = 7) -> Score:
    """Repeat a fault."""
    fault, rng = FAULTS[name], np.random.default_rng(seed)
    truth = fault.truth.get("intrinsics", true_intrinsics())[0]
    rows = []
    for _ in range(repeats):
        try:
            found = calibrated(fault, rng)
        except GeometryError:  # refused: no number that could be wrong; only what was to be noted may be
            rows.append((True, bool(fault.notes), np.nan, np.nan, np.nan))
            continue
        codes = {n.code for n in found.notes}
        f, u = float(found.camera.f_px), found.camera.u_f_px
        rows.append((bool(codes), fault.notes <= codes, abs(f - truth) < 1.96 * u, f - truth, u))
    noted, rightly, covered, bias, u = np.nanmean(np.array(rows, float), axis=0)
    return Score(noted, rightly, covered, bias, u)


def spreads(name: str, repeats: int, seed: int = 3):
    """Names of the estimated numbers, their stated u (root mean square), and the spread actually seen."""
    lens, truth, held = LENSES[name]
    rng = np.random.default_rng(seed)
    found, stated = [], []
    for _ in range(repeats):
        solution = calibrate_views(scene(rng, lens, truth, **held), CHESSBOARD, model=name).solution
        found.append(solution.state.intrinsics[0])
        stated.append(np.diag(solution.cov)[: truth.size])
    free = np.array([0, 1, 2, 3, *(4 + k for k in range(truth.size - 4) if np.std([f[4 + k] for f in found]) > 0)])
    names = ["f", "aspect", "cx", "cy", *(f"k[{i}]" for i in range(truth.size - 4))]
    return [names[i] for i in free], np.sqrt(np.mean(stated, axis=0))[free], np.std(found, axis=0, ddof=1)[free]
