"""The form of a record, written so that every reader of the file can decode it."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

NUMPY = "numpy"
"""Encoding of the messages (the plain bytes of one record) and of their schema (``describe``)."""


def describe(dtype: np.dtype[Any]) -> bytes:
    """``dtype.descr`` as JSON: a list of [name, type or such a list, shape where there is one]."""
    return json.dumps(dtype.descr).encode()


def understand(description: bytes) -> np.dtype[Any]:
    """The numpy type that :func:`describe` described.

    Raises:
        ValueError: it is no such description.
    """
    try:
        described = json.loads(description)
        if not isinstance(described, list) or not described:
            raise ValueError("no description of a numpy type")
        return np.dtype(_fields(described))
    except (TypeError, IndexError, KeyError) as error:
        raise ValueError(f"no description of a numpy type: {error}") from None


def _fields(described: list[Any]) -> list[Any]:
    fields: list[Any] = []
    for name, kind, *shape in described:
        inner = _fields(kind) if isinstance(kind, list) else kind
        fields.append((name, inner, *(tuple(part) for part in shape)))
    return fields
