"""Judging estimates: against truth, against each other, against the best that is possible."""
