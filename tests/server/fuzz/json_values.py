"""JSON that a schema allows, nearly allows, or does not allow at all."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import strategies as st

Schema = dict[str, Any]

SPECIAL = [0, -1, 1, 1e308, -1e308, math.nan, math.inf, -math.inf, 2**63, 1e-320, True, None, ""]

ANY_JSON: st.SearchStrategy[Any] = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.floats(),
        st.text(max_size=20),
        st.sampled_from(SPECIAL),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=5), st.dictionaries(st.text(max_size=8), inner, max_size=4)
    ),
    max_leaves=12,
)


def resolved(schema: Schema, root: Schema) -> Schema:
    """The schema that a reference names."""
    while "$ref" in schema:
        schema = root["components"]["schemas"][schema["$ref"].rpartition("/")[2]]
    return schema


def allowed(schema: Schema, root: Schema) -> st.SearchStrategy[Any]:
    """Values of the right form, bounds kept where they are simple ones."""
    schema = resolved(schema, root)
    for key in ("anyOf", "oneOf"):
        if key in schema:
            return st.one_of([allowed(part, root) for part in schema[key]])
    if "const" in schema or "enum" in schema:
        return st.sampled_from(schema.get("enum", [schema.get("const")]))
    kind = schema.get("type")
    if kind == "object":
        return _objects(schema, root)
    if kind == "array":
        return _arrays(schema, root)
    low: Any = schema.get("minimum", schema.get("exclusiveMinimum", -1e4))
    high: Any = schema.get("maximum", schema.get("exclusiveMaximum", 1e4))
    simple: dict[Any, st.SearchStrategy[Any]] = {
        "number": st.floats(low, high, allow_nan=False),
        "integer": st.integers(int(low), int(high)),
        "boolean": st.booleans(),
        "string": st.text(max_size=60),
    }
    return simple.get(kind, ANY_JSON)


def _objects(schema: Schema, root: Schema) -> st.SearchStrategy[Any]:
    parts = {name: allowed(part, root) for name, part in schema.get("properties", {}).items()}
    needed = set(schema.get("required", ()))
    return st.fixed_dictionaries(
        {name: part for name, part in parts.items() if name in needed},
        optional={name: part for name, part in parts.items() if name not in needed},
    )


def _arrays(schema: Schema, root: Schema) -> st.SearchStrategy[Any]:
    if "prefixItems" in schema:
        return st.tuples(*(allowed(part, root) for part in schema["prefixItems"])).map(list)
    return st.lists(allowed(schema.get("items", {}), root), max_size=4)


def spoilt(schema: Schema, root: Schema) -> st.SearchStrategy[Any]:
    """Values in which one field, or one element of one, is anything at all."""

    def spoil(value: Any, place: int, anything: Any) -> Any:
        if isinstance(value, dict) and value:
            name = sorted(value)[place % len(value)]
            inner = value[name]
            if isinstance(inner, list) and inner and place % 2:
                changed = list(inner)
                changed[place % len(inner)] = anything
                return {**value, name: changed}
            return {**value, name: anything}
        return anything

    return st.builds(spoil, allowed(schema, root), st.integers(0, 40), ANY_JSON)


def bodies(schema: Schema, root: Schema) -> st.SearchStrategy[Any]:
    """Allowed, spoilt, or anything."""
    return st.one_of(allowed(schema, root), spoilt(schema, root), ANY_JSON)
