"""How values and times go wrong: sizes, spans and channels are drawn, in each shape by its limits.

Values are (n, ...); channels are their last axis: axes, quadrants, satellites.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fgnav.geometry import rotations


@dataclass
class Draw:
    """Sizes, times and channels of a fault, drawn at random, and what was drawn in words."""

    rng: np.random.Generator
    words: list[str] = field(default_factory=list)

    def told(self, value: Any) -> Any:
        """Return a value that is kept in words."""
        self.words.append(f"{value:.3g}" if isinstance(value, float) else str(value))
        return value

    def size(self, low: float, high: float) -> float:
        """Return a size, all orders of magnitude alike."""
        return self.told(float(np.exp(self.rng.uniform(np.log(low), np.log(high)))))

    def signed(self, low: float, high: float) -> float:
        """Return a size of either sign."""
        return float(self.rng.choice([-1.0, 1.0])) * self.size(low, high)

    def choice(self, *options: Any) -> Any:
        """Return one of some."""
        return self.told(options[int(self.rng.integers(len(options)))])

    def channel(self, count: int) -> int:
        """Return the index of a channel."""
        return self.told(int(self.rng.integers(count)))

    def direction(self, count: int = 3) -> np.ndarray:
        """Return a unit vector."""
        axis = self.rng.normal(size=count)
        return axis / np.linalg.norm(axis)

    def rotation(self, angle_rad: float) -> np.ndarray:
        """Return a rotation about any axis."""
        return rotations.exp((self.direction() * angle_rad)[None])[0]

    def span(self, t_s: np.ndarray) -> np.ndarray:
        """Return which samples a fault strikes: all, those from some time on, or some seconds."""
        kind, length_s = int(self.rng.integers(3)), t_s[-1] - t_s[0]
        from_s = t_s[0] + self.rng.uniform(0.15, 0.7) * length_s
        until_s = from_s + self.rng.uniform(0.1, 0.5) * length_s
        if kind == 0:
            return np.ones(len(t_s), dtype=bool)
        self.words.append(f"from {from_s:.1f} s" + (f" to {until_s:.1f} s" if kind == 2 else ""))
        return (t_s >= from_s) & ((t_s < until_s) | (kind == 1))


def struck(x: np.ndarray, t_s: np.ndarray, draw: Draw, wrong: np.ndarray) -> np.ndarray:
    """Return values that are wrong in a drawn span."""
    inside = draw.span(t_s).reshape(-1, *[1] * (x.ndim - 1))
    return np.where(inside, wrong, x)


def one_channel(x: np.ndarray, draw: Draw, wrong: np.ndarray) -> np.ndarray:
    """Return values that are wrong in a drawn channel."""
    at = np.arange(x.shape[-1]) == draw.channel(x.shape[-1])
    return np.where(at, wrong, x)


def scaled(x, t_s, draw, *by):
    return struck(x, t_s, draw, x * draw.choice(*by))


def channel_scaled(x, t_s, draw, *by):
    return struck(x, t_s, draw, one_channel(x, draw, x * draw.choice(*by)))


def stuck(x, t_s, draw):
    inside = draw.span(t_s)
    out = x.copy()
    out[inside] = x[np.argmax(inside)]
    return out


def channel_stuck(x, t_s, draw):
    return one_channel(x, draw, stuck(x, t_s, draw))


def exchanged(x, t_s, draw):
    i, j = draw.told(draw.rng.permutation(x.shape[-1])[:2].tolist())
    order = np.arange(x.shape[-1])
    order[[i, j]] = j, i
    return struck(x, t_s, draw, x[..., order])


def misaligned(x, t_s, draw, *angles_deg):
    return struck(x, t_s, draw, x @ draw.rotation(np.radians(draw.choice(*angles_deg))))


def stepped(x, t_s, draw, low, high):
    channels = x.shape[-1] if x.ndim > 1 else 1
    off = draw.size(low, high) * draw.direction(channels)
    return struck(x, t_s, draw, x + (off if x.ndim > 1 else off[0]))


def channel_stepped(x, t_s, draw, low, high):
    return struck(x, t_s, draw, one_channel(x, draw, x + draw.size(low, high)))


def drifting(x, t_s, draw, low, high):
    """Drift by so much in a second, from some time on."""
    since_s = (t_s - t_s[0] - draw.rng.uniform(0.0, 0.5) * (t_s[-1] - t_s[0])).clip(0.0)
    off = (
        draw.size(low, high) * draw.direction(x.shape[-1]) if x.ndim > 1 else draw.signed(low, high)
    )
    return x + np.multiply.outer(since_s, off)


def lit(x, t_s, draw, low, high):
    """Add even light to all quadrants."""
    return struck(x, t_s, draw, x + draw.size(low, high))


def clipped(x, _t_s, draw):
    at = draw.size(0.3, 0.9)
    return np.clip(x, -at, at)


def coarse(x, _t_s, draw):
    step = draw.size(0.01, 0.5)
    return np.round(x / step) * step


def noisy(x, t_s, draw, low, high):
    return struck(x, t_s, draw, x + draw.size(low, high) * draw.rng.normal(size=x.shape))


def outlying(x, _t_s, draw, low, high):
    at = draw.rng.random(x.shape) < draw.size(0.003, 0.15)
    return x + at * draw.size(low, high) * draw.rng.choice([-1.0, 1.0], x.shape)


def held(x, _t_s, draw):
    every = draw.choice(3, 5, 10, 20)
    return x[np.arange(len(x)) // every * every]


def lagging(x, t_s, draw):
    share = 1 - np.exp(-np.median(np.diff(t_s)) / draw.size(0.01, 0.5))
    out = x.copy()
    for k in range(1, len(x)):
        out[k] = out[k - 1] + share * (x[k] - out[k - 1])
    return out


def old(x, _t_s, draw):
    return x[(np.arange(len(x)) - draw.choice(1, 2, 3, 5)).clip(0)]


def slipping(x, _t_s, draw):
    sizes = draw.rng.integers(-5, 6, x.shape) * draw.choice(0.5, 1.0)
    return x + np.cumsum(sizes * (draw.rng.random(x.shape) < draw.size(0.001, 0.03)), axis=0)


def late(t_s, draw):
    return t_s + draw.signed(0.003, 2.0)


def stretched(t_s, draw):
    return t_s[0] + (1 + draw.signed(3e-4, 0.03)) * (t_s - t_s[0])


def jumping(t_s, draw):
    from_s = draw.told(float(t_s[0] + draw.rng.uniform(0.2, 0.7) * (t_s[-1] - t_s[0])))
    return t_s + draw.size(0.01, 2.0) * (t_s >= from_s)


def jittering(t_s, draw):
    size_s = draw.size(0.1, 0.45) * np.median(np.diff(t_s))
    return t_s + draw.rng.uniform(-size_s, size_s, len(t_s))
