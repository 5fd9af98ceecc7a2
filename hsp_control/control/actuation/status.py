"""How much of the law a step could deliver."""

EXACT = 0
"""The law's acceleration, with contact forces of least norm."""
REDISTRIBUTED = 1
"""The law's acceleration, with contact forces chosen by a programme."""
LIMITED = 2
"""As near to the law as the limits permit; all of them are kept."""
RELAXED = 3
"""The limits contradict each other: the least violation, in their stated order."""
