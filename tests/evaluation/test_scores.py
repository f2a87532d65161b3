from dataclasses import asdict

import numpy as np

from fgnav.evaluation.scores import score
from fgnav.types.estimate import Consistency, Estimate


def test_what_a_method_says_of_its_own_innovations_is_in_its_score():
    told = Consistency(what="position", count=10, freedom=30, nis=1.1, beyond_99=0.0)
    estimate = Estimate(
        method="m", t_s=np.zeros(1), n_epochs=1, R_nb=np.eye(3)[None], consistency=(told,)
    )
    figures = asdict(score(estimate, None, None, 1.0))
    assert figures["consistency"] == (asdict(told),)
