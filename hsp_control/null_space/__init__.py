"""Self-motion: null-space fields g with their rates g', and joint-space metrics W."""
