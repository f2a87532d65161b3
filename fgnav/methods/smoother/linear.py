"""The smoother as a linear map, linearised once: its steps, covariances and likelihood."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother import links
from fgnav.methods.smoother.chain import STATE, Chain
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.link_kernel import linearise, move
from fgnav.methods.smoother.link_types import Motions, Prior, Samples, Senses, States


class Block(NamedTuple):
    """Some neighbouring keyframes, and all that they are linearised from."""

    samples: Samples  # of the whole flight
    rows: IntArray  # which keyframes of it
    states: States
    senses: Senses
    prior: Prior


def blocks_of(keyframes: Keyframes, firsts: Iterable[int], length: int) -> Iterator[Block]:
    """Yield blocks of a length, linearised where the keyframes stand."""
    samples, states = links.samples_of(keyframes), links.states_of(keyframes)
    senses, prior = links.senses_of(keyframes), links.prior_of(keyframes)
    for first in firsts:
        rows = slice(first, first + length)
        R_nb, p_n_m, v_n_mps, slot = (part[rows] for part in states[:4])
        yield Block(
            samples=samples,
            rows=np.arange(first, first + length),
            states=States(R_nb, p_n_m, v_n_mps, slot, *states[4:]),
            senses=Senses(*(part[rows] for part in senses)),
            prior=prior._replace(R_nb=R_nb[0], p_n_m=p_n_m[0]),
        )


def eliminated(block: Block, density: FloatArray | float) -> Chain:
    """Return a block's chain, eliminated to its last keyframe.

    Parameters
    ----------
    block : Block
    density : ndarray, shape (3,), or float
        Multiplies the intensity of the walk of the slot's second half.

    Raises
    ------
    NoSolutionError
        Naming the keyframe whose state the data leave open.
    """
    noise = block.samples.noise.copy()
    noise[:, 5:] *= density
    return _eliminated(block._replace(samples=block.samples._replace(noise=noise)))[0]


def _eliminated(block: Block) -> tuple[Chain, Motions]:
    own, n = block.states, len(block.rows)
    motions, rows = links.empty_motions(n), np.arange(n)
    links.integrate(motions, rows[1:], block.samples, block.rows[1:], own.slot[:-1])
    chain = Chain.empty(n, len(own.constants))
    linearise(chain.link, own, motions, block.senses, block.prior, rows, 0)
    chain.begin(0)
    chain.eliminate(0, n - 1)
    return chain, motions


def log_likelihood(block: Block) -> float:
    """Return the log-likelihood of what a block measured, all states integrated out.

    Up to a constant that neither the noise of the motion nor the states change.

    Raises
    ------
    NoSolutionError
        As ``eliminated`` does.
    """
    chain, motions = _eliminated(block)
    last = len(block.rows) - 1
    _, least = chain.step(0, last)
    pivots = np.einsum("nii->ni", chain.root[:last])
    _, newest = np.linalg.slogdet(chain.message[last, :-1, :-1])
    whitens = np.einsum("nii->ni", motions.white[1:])
    return float(np.log(whitens).sum() - np.log(pivots).sum() - newest / 2 - least / 2)


def stepped(block: Block, chain: Chain) -> Block:
    """Return a block where a step of Newton's method leads, what is known before it unmoved."""
    steps, _ = chain.step(0, len(block.rows) - 1)
    states = block.states.copied()
    move(block.states, steps, 0, states, 0, wholly=True)
    states.constants[:] += steps[0, STATE:]
    return block._replace(states=states)
