"""Controllers side by side: each module's ``make(case)`` gives (t, q, v) ↦ tau."""
