"""Cameras of a MuJoCo scene that another process looks through."""

from hsp_control.companions.cameras.pictures import show as show
