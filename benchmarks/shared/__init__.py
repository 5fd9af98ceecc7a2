"""Common parts of the benchmarks: cases, controllers, timing, sections of pages."""
