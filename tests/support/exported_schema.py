"""The JSON schema of a configuration, made once per process, since it needs seconds."""

import json
import subprocess
import sys
from functools import cache
from typing import Any

import jsonschema


@cache
def exported_schema() -> dict[str, Any]:
    """The schema that `hsp schema` prints; not to be changed.

    In another process: types that other tests declare are not in it.
    """
    command = [sys.executable, "-m", "hsp_control", "schema"]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    schema: dict[str, Any] = json.loads(ran.stdout)
    return schema


@cache
def validator() -> jsonschema.Draft202012Validator:
    """A validator of data against the schema."""
    return jsonschema.Draft202012Validator(exported_schema())
