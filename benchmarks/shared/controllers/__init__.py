"""The compared controllers: each ``make(case)`` returns a function (t, q, v) ↦ tau."""
