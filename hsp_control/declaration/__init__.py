"""How parts are declared: values with checked and documented fields."""

from hsp_control.declaration.any_of import AnyOf as AnyOf
from hsp_control.declaration.families import Family as Family
from hsp_control.declaration.located import within as within
from hsp_control.declaration.part import Part as Part
