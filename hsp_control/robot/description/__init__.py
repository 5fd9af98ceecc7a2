"""From a name or a URDF to a model: found, read with care, checked."""
