"""How long one calculation takes, from what was typed to JSON, against an empty route of the server's framework."""

from __future__ import annotations

import asyncio
import itertools
import time
from collections.abc import Callable

import numpy as np
from comparison import Comparison, compare, table
from fastapi import FastAPI

from subtense import calculate, calculator_input
from subtense.workflow.report_of import REPORTS

BATCH = 100
"""Calculations of one timing."""


def typed(count: int, seed: int = 0) -> list[dict[str, str | None]]:
    """What people may type: every unknown in turn, bare numbers and stated doubts."""
    rng = np.random.default_rng(seed)
    unknowns = ("distance", "size", "extent", "focal", "sensor_width", "image_width")
    found = []
    for i, unknown in zip(range(count), itertools.cycle(unknowns), strict=False):
        focal_mm, width_mm, size_mm = rng.uniform(20, 60), rng.uniform(7, 36), rng.uniform(100, 3000)
        extent_px = rng.uniform(200, 1500)
        distance_m = size_mm / 1000 * focal_mm / width_mm * 4000 / extent_px
        texts = {
            "focal": f"{focal_mm:.1f}", "sensor_width": f"{width_mm:.1f} mm", "image_width": "4000",
            "size": f"{size_mm:.0f} ± 1 mm" if i % 2 else f"{size_mm:.0f}", "extent": f"{extent_px:.0f}",
            "distance": f"{distance_m:.3f} ± 0.01 m" if i % 4 < 2 else f"{distance_m:.2f}m",
        }  # fmt: skip
        found.append({**texts, unknown: None})
    return found


def one(texts: dict[str, str | None]) -> str | bytes:
    """What a request to calculate does."""
    inputs, image_height = calculator_input(texts)
    return REPORTS["json"].function(calculate(inputs, image_height=image_height), None)


def without_draws(count: int = 600) -> list[dict[str, str | None]]:
    """Those whose interval comes without draws; with them a calculation takes as long as its draws."""
    return [texts for texts in typed(count) if "Monte Carlo" not in one(texts)]


def empty_route() -> Callable[[], object]:
    """A route that answers {}, asked without a network."""
    app = FastAPI()

    @app.post("/")
    async def nothing() -> dict[str, str]:
        return {}

    scope = {"type": "http", "method": "POST", "path": "/", "raw_path": b"/", "query_string": b"", "headers": [],
             "http_version": "1.1", "scheme": "http", "server": ("127.0.0.1", 80), "client": ("127.0.0.1", 9), "root_path": ""}  # fmt: skip

    async def receive() -> dict[str, object]:
        return {"type": "http.request", "body": b"{}", "more_body": False}

    async def send(_: object) -> None:
        pass

    async def ask() -> None:
        for _ in range(BATCH):
            await app(dict(scope), receive, send)

    return lambda: asyncio.run(ask())


def comparisons(turns: int = 15) -> list[Comparison]:
    """One batch of calculations against one of requests."""
    texts = itertools.cycle(without_draws())
    return [
        compare(f"{BATCH} calculations, texts to JSON", lambda: [one(next(texts)) for _ in range(BATCH)],
                f"{BATCH} requests to an empty FastAPI route, no network", empty_route(), turns=turns)
    ]  # fmt: skip


def times_ms(texts: list[dict[str, str | None]]) -> list[float]:
    """Of each calculation, the shortest of five, ms."""
    found = []
    for one_text in texts:
        shortest = float("inf")
        for _ in range(5):
            start = time.perf_counter()
            one(one_text)
            shortest = min(shortest, time.perf_counter() - start)
        found.append(1000 * shortest)
    return found


if __name__ == "__main__":
    several = without_draws()
    ms = np.array(times_ms(several))
    print(
        f"{len(several)} calculations: median {np.median(ms):.3f} ms, 90 % below {np.quantile(ms, 0.9):.3f} ms, mean {ms.mean():.3f} ms"
    )
    print(table(comparisons()))
