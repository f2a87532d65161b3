"""Many flights through the smoother, in processes that each keep their flights and minima."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from types import TracebackType
from typing import Any, NamedTuple, Self

import torch
from numpy.typing import NDArray

from fgnav.checks import BadInputError, NoSolutionError
from fgnav.methods.smoother import Batch
from fgnav.neural.factor import NeuralFactor
from fgnav.types.flight import Flight, Truth
from fgnav_models.learn.answers import Tensor
from fgnav_models.learn.flights import TrainingFlight, training_flight
from fgnav_models.learn.modules import module_of
from fgnav_models.learn.posterior import Posterior, posterior

Loss = Callable[[Posterior, Truth], Tensor]


class Losses(NamedTuple):
    """The loss of each flight that was solved, and why others were not."""

    by_flight: dict[int, float]
    unsolved: dict[int, str]

    @property
    def mean(self) -> float:
        """Over flights that were solved."""
        return sum(self.by_flight.values()) / max(len(self.by_flight), 1)


class _Task(NamedTuple):
    flight: int
    factors: tuple[NeuralFactor, ...]
    parameters: dict[str, Tensor]
    loss: Loss
    is_trained: bool


class FlightPool:
    """Flights whose losses, and gradients, are computed in processes.

    Each flight stays with one process, which prepares it once and begins a search where the last
    one ended. Networks see what flights record: sources with records of their own are of one
    flight.

    Parameters
    ----------
    flights : sequence of Flight
        As of ``training_flight``.
    method : Batch
    workers : int
    without : str
    """

    def __init__(
        self, flights: Sequence[Flight], method: Batch, workers: int, *, without: str = ""
    ) -> None:
        if workers < 1 or not flights:
            raise BadInputError(
                f"pool: needs a flight and a worker, got {len(flights)} and {workers}"
            )
        self._count, self._pools = len(flights), list[ProcessPoolExecutor]()
        for i in range(min(workers, len(flights))):
            own = {k: flights[k] for k in range(i, len(flights), workers)}
            pool = ProcessPoolExecutor(
                1, get_context("spawn"), initializer=_begin, initargs=(own, method, without)
            )
            self._pools.append(pool)

    def __enter__(self) -> Self:
        """Return the pool."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End its processes."""
        for pool in self._pools:
            pool.shutdown(cancel_futures=True)

    def losses(
        self,
        factors: Sequence[NeuralFactor],
        loss: Loss,
        parameters: Mapping[str, Tensor] | None = None,
        *,
        flights: Sequence[int] | None = None,
        backward: bool = False,
    ) -> Losses:
        """Return the losses of flights; backward: add the mean's gradient to ``grad``.

        Parameters
        ----------
        factors, parameters
            As of ``posterior``.
        loss : callable
            Of a posterior and the truth, a function of a module; such as ``learn.nll``.
        flights : sequence of int, optional
            Their numbers, all by default.
        backward : bool
            Whether modules' weights and parameters are to have their gradients.
        """
        given = {
            name: x.detach().requires_grad_(x.requires_grad)
            for name, x in (parameters or {}).items()
        }
        which = range(self._count) if flights is None else flights
        made = [
            self._pools[k % len(self._pools)].submit(
                _losses, _Task(k, tuple(factors), given, loss, backward)
            )
            for k in which
        ]
        done = dict(zip(which, (result.result() for result in made), strict=True))
        solved = {k: found for k, found in done.items() if not isinstance(found, str)}
        for _, gradients in solved.values():
            for x, gradient in zip(_trained(factors, parameters or {}), gradients, strict=False):
                mean = torch.from_numpy(gradient) / len(solved)
                x.grad = mean if x.grad is None else x.grad + mean
        return Losses(
            {k: value for k, (value, _) in solved.items()},
            {k: found for k, found in done.items() if isinstance(found, str)},
        )


def _trained(factors: Sequence[NeuralFactor], parameters: Mapping[str, Tensor]) -> list[Tensor]:
    """Return weights of modules, each once, and parameters."""
    weights = [x for factor in factors for x in module_of(factor).module.parameters()]
    return [x for x in dict.fromkeys([*weights, *parameters.values()]) if x.requires_grad]


_flights: dict[int, Flight | TrainingFlight] = {}  # of a process
_how: list[tuple[Batch, str]] = []


def _begin(flights: dict[int, Flight], method: Batch, without: str) -> None:
    torch.set_num_threads(1)
    _flights.update(flights)
    _how.append((method, without))


def _losses(task: _Task) -> tuple[float, list[NDArray[Any]]] | str:
    """Return a flight's loss and its gradients; or why it has none."""
    method, without = _how[0]
    flight = _flights[task.flight]
    try:
        if isinstance(flight, Flight):
            flight = _flights[task.flight] = training_flight(flight, method, without=without)
        value = task.loss(posterior(flight, task.factors, task.parameters), flight.truth)
        if not task.is_trained:
            return float(value.detach()), []
        gradients = torch.autograd.grad(
            value, _trained(task.factors, task.parameters), materialize_grads=True
        )
    except NoSolutionError as error:
        return str(error)
    return float(value.detach()), [x.numpy() for x in gradients]
