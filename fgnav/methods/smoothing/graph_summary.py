"""Summary of an estimate's factor graph: kinds of factors, answers of networks."""

from collections import Counter

from fgnav.graph.sourced import Sourced
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.solution import Solution
from fgnav.integers.acceptance import HANDED_OVER
from fgnav.types.estimate import GraphSummary
from fgnav.types.integers import Integers

TRUST = "trust"  # the network of integers


def graph_summary(
    problem: Problem,
    sourced: Sourced,
    solution: Solution,
    integers: Integers | None,
) -> GraphSummary:
    """Return the summary of a solved problem, its custom factors and integers."""
    motion = "inertial" if problem.gyroscope else "gyro-free motion"
    factors = {motion: len(problem.t_s) - 1}
    measured = (*problem.sensors, *(() if problem.phase is None else (problem.phase,)))
    for one in measured:
        factors[one.name] = factors.get(one.name, 0) + len(one.row)
    custom = Counter(factor.name for factor in sourced.factors)
    networks = {name: {"answered": custom[name]} for name in sourced.networks}
    for name, counts in networks.items():
        left_out = [loss for loss in sourced.unused if loss.what == f"{name} answer"]
        counts |= {loss.reason: loss.count for loss in left_out}
    if integers is not None and integers.resolver.startswith("network"):
        others = {
            entry.reason: entry.count for entry in integers.unused if entry.what == HANDED_OVER
        }
        networks[TRUST] = {"answered": len(integers.fixed) - sum(others.values())} | others
    return GraphSummary(
        solver=solution.solver,
        updates=solution.updates,
        factors=factors | dict(custom),
        networks=networks,
    )
