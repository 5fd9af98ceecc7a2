"""An example of a package that extends hsp_control."""
