"""The compared controllers: a ``make(case)`` returns a function (t, q, v) ↦ tau."""
