"""What stands behind ``hsp``: commands and their options."""
