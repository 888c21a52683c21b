"""The report on benchmarks: tables, figures, text and a page."""
