"""Faults and fuzz: campaigns of which small samples are ordinary tests.

``make fuzz`` runs them in full and writes benchmarks/results/fuzz.md.
"""
