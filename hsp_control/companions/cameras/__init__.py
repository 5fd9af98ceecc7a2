"""Pictures of a MuJoCo scene's cameras, for another process."""

from hsp_control.companions.cameras.pictures import show as show
