"""Find a robot by name or path, check its URDF and build its Pinocchio model."""
