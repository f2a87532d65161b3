"""Which integer the epochs of an arc vote for."""

import numpy as np

from fgnav.checks import IntArray


def elected(label: IntArray, cycles: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the integer that most votes of each label name; of equal ones the largest.

    Parameters
    ----------
    label, cycles : ndarray of int, shape (v,)
        Of each vote: whose it is, and the integer it names.

    Returns
    -------
    ndarray of int, shape (l,), each
        Labels that have votes, in ascending order; the integer elected; the votes it has.
    """
    order = np.lexsort((cycles, label))
    labels, integers = label[order], cycles[order]
    begins = np.ones(len(labels), dtype=bool)
    begins[1:] = (np.diff(labels) != 0) | (np.diff(integers) != 0)
    first = np.flatnonzero(begins)
    votes = np.diff(first, append=len(labels))
    by_votes = np.lexsort((votes, labels[first]))  # stable: of equal ones the largest stands last
    wins = first[by_votes][np.diff(labels[first], append=-1) != 0]
    most = votes[by_votes][np.diff(labels[first], append=-1) != 0]
    return labels[wins], integers[wins], most
