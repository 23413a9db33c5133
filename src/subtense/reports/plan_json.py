"""Plans as JSON, schema in docs/plan-schema.json: SI numbers (or px, rad), no NaN or Infinity, null where there is no answer."""

from __future__ import annotations

import json
from collections.abc import Sequence

from ..planned import Plan

SCHEMA = "subtense-plan/1"


def report(plans: Sequence[Plan], version: str) -> str:
    """All plans as indented JSON.

    Args:
        plans: one for each way.
        version: of the package.
    """
    data = {"schema": SCHEMA, "version": version, "plans": [plan.to_json() for plan in plans]}
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False)
