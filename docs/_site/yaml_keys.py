"""The page of all YAML keys, made of the JSON schema."""

import json
from typing import Any

from prose import paragraphs, plain


def yaml_page(schema: dict[str, Any]) -> str:
    """Return the page of all keys: those of a file, then those of the parts."""
    lines = ["# YAML keys", "", plain(schema["description"]), ""]
    lines += [
        "`hsp schema` writes the same as JSON schema, for completion in editors.",
        "",
    ]
    lines += ["## A configuration", "", *_keys(schema), ""]
    for name, part in sorted(schema["$defs"].items()):
        lines += [f"(yaml-{name})=", f"## {_title(name, part)}", ""]
        lines += [paragraphs(part.get("description", "")), "", *_keys(part), ""]
    return "\n".join(lines)


def _title(name: str, part: dict[str, Any]) -> str:
    kind = part.get("properties", {}).get("type", {}).get("const")
    return f"{name}: `type: {kind}`" if kind else name


def _keys(part: dict[str, Any]) -> list[str]:
    rows = ["| key | values | default | |", "|---|---|---|---|"]
    required = part.get("required", [])
    for key, about in part.get("properties", {}).items():
        if key == "type" and "const" in about:
            continue
        default = "" if "default" not in about else f"`{json.dumps(about['default'])}`"
        if key in required:
            default = "required"
        said = plain(about.get("description", ""))
        rows.append(f"| `{key}` | {_values(about)} | {default} | {said} |")
    return rows if len(rows) > 2 else []


def _values(about: dict[str, Any]) -> str:
    """Return the permitted values of a key, in words."""
    if "$ref" in about:
        name = about["$ref"].rsplit("/", 1)[1]
        return f"[{name}](#yaml-{name})"
    for several in ("anyOf", "oneOf"):
        if several in about:
            words = dict.fromkeys(_values(each) for each in about[several])
            return ", ".join(word for word in words if word != "null")
    if "const" in about:
        return f"`{about['const']}`"
    if "enum" in about:
        return ", ".join(f"`{value}`" for value in about["enum"])
    if about.get("type") == "array":
        return f"list of {_values(about.get('items', {}))}".removesuffix(" of ")
    if "patternProperties" in about:
        [each] = about["patternProperties"].values()
        return f"by name: {_values(each)}"
    kind = about.get("type", "")
    kind = {"number": "number", "integer": "whole number", "string": "text"}.get(
        kind, kind
    )
    return kind + _bounds(about)


def _bounds(about: dict[str, Any]) -> str:
    signs = {
        "minimum": "≥",
        "exclusiveMinimum": ">",
        "maximum": "≤",
        "exclusiveMaximum": "<",
    }
    said = [f"{sign} {about[key]:g}" for key, sign in signs.items() if key in about]
    return " " + ", ".join(said) if said else ""
