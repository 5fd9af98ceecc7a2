"""What several benchmarks share: cases, controllers, timing, sections of pages."""
