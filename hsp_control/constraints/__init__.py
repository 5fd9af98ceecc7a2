"""What must hold: contacts with the world, and limits of motors, joints and space."""
