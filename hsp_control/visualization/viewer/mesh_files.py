"""Mesh files in Meshcat's format; the page itself parses Collada, OBJ and STL."""

import base64
import mimetypes
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from hsp_control.visualization.viewer.commands import Json, typed_array
from hsp_control.visualization.viewer.threejs import unique_name

_PICTURES = {".bmp", ".gif", ".jpeg", ".jpg", ".png", ".tga", ".tif", ".tiff", ".webp"}
"""Image files that a texture may name: other files must not get into a page."""


def mesh_geometry(file: Path) -> Json:
    """Return an OBJ or STL file as a geometry without material."""
    kind = file.suffix.lower()[1:]
    data = (
        typed_array(np.frombuffer(file.read_bytes(), np.uint8), np.uint8)
        if kind == "stl"
        else file.read_text(encoding="utf-8", errors="replace")
    )
    return {
        "uuid": unique_name(),
        "type": "_meshfile_geometry",
        "format": kind,
        "data": data,
    }


def collada_object(file: Path) -> Json:
    """Return a Collada file as an object with its own materials and textures."""
    text = file.read_text(encoding="utf-8", errors="replace")
    return {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [],
        "materials": [],
        "object": {
            "uuid": unique_name(),
            "type": "_meshfile_object",
            "format": "dae",
            "data": text,
            "resources": _textures(file, text),
        },
    }


def _textures(file: Path, text: str) -> dict[str, str]:
    """Return the images that a Collada file names, as data URLs by name."""
    if "<init_from>" not in text:
        return {}
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError):  # the page reports it
        return {}
    names = {
        (element.text or "").strip()
        for images in root.iter()
        if images.tag.endswith("library_images")
        for element in images.iter()
        if element.tag.endswith("init_from")
    }
    found = {}
    for name in names:
        image = file.parent / name.removeprefix("file://")
        if image.suffix.lower() in _PICTURES and image.is_file():
            kind = mimetypes.guess_type(image.name)[0] or "image/png"
            content = base64.b64encode(image.read_bytes()).decode()
            found[name] = f"data:{kind};base64,{content}"
    return found
