"""The JSON schema of a configuration, made once a process: it takes two seconds."""

from functools import cache
from typing import Any

import jsonschema

from hsp_control.config import json_schema


@cache
def exported_schema() -> dict[str, Any]:
    """The schema that `hsp schema` prints; not to be changed."""
    return json_schema()


@cache
def validator() -> jsonschema.Draft202012Validator:
    """What says whether data follow the schema."""
    return jsonschema.Draft202012Validator(exported_schema())
