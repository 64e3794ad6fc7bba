"""The integrators, beside the equations of the paper and of docs/theory.md."""
