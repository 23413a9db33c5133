"""The document as JSON, schema in docs/schema.json: SI numbers, no NaN or Infinity, an open limit is null."""

from __future__ import annotations

import json

from ..document import Document


def report(document: Document) -> str:
    """The document as indented JSON."""
    return json.dumps(document.to_json(), indent=2, ensure_ascii=False, allow_nan=False)
