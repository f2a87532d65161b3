"""Messages of an estimate: each has a code, a severity, its words, and what to do.

Public names: ``Note``, ``MESSAGES``, ``note``, ``by_severity``. A code begins with the letter of
its severity: E of what must not be used, W of what is wrong or missing, I of what was done, D of
details. Numbers are by room: 1 records, 2 attitudes and motion, 3 noise and set-up, 4 the solution,
5 closed forms.
"""

from collections.abc import Iterable
from typing import Any

SEVERITIES = "EWID"  # in the order in which they are shown

MESSAGES: dict[str, str] = {
    "W101": "No {what} from {from_s:.2f} to {until_s:.2f} s.",
    "W102": "No {what} in {count} more gaps of up to {longest_s:.2f} s.",
    "W103": "No {what} from {from_s:.2f} to {until_s:.2f} s: {instead} stands in.",
    "I104": "{sensor} noise: {used:.2g} is used instead of the nominal {nominal:.2g}, because "
    "{causes}.",
    "W201": "The heading follows from the motion model alone: it is unobservable where its sigma "
    "is large; [initial], a second antenna or a magnetometer determines it.",
    "W202": "Only smoothness determines the rotation about the specific force: the search starts "
    "with the velocity along x_b, and the estimate is valid for a body that flies so.",
    "I203": "Phase errors are correlated in time: {percent:.0f} % of their variance, with a time "
    "constant of {constant_s:.3g} s; they are estimated.",
    "I204": "Float ambiguities: {arcs} arcs without integers in {count} intervals determine how "
    "the attitude changes over {epochs} epochs.",
    "W205": "Phases of {epochs} epochs without integers are not used.",
    "I206": "Positions against the base: integers known at {percent:.1f} % of epochs{chance}.",
    "D207": "Angular-rate model ({shape}): sigma about the body axes {sigma_degps} deg/s.",
    "D208": "Angular-rate model ({shape}): its scale varies with the motion; log evidence "
    "{gain:.0f} above that of a constant one.",
    "D209": "Angular-rate model: identified from the attitudes up to each keyframe.",
    "I301": "{noise}: estimated {value}{factor:.2g} x the {of}; the estimate is used.",
    "W302": "Noise is nominal; it could not be estimated ({error}).",
    "I303": "{parameter} estimated: {value}. Log-likelihood gain {gain:.0f}{runner_up}.",
    "W304": "Antennas {exchange}; corrected.",
    "W305": "IMU timestamps step by {step_s:+.3f} s (± {sigma_s:.3f} s) after {t_s:.2f} s: with "
    "samples missing there, the runner-up, residual squares are {ratio:.3g} times larger; "
    "corrected.",
    "W306": "IMU clock offset of {offset_s:+.3f} s {evidence}; timestamps corrected.",
    "I307": "Noise is estimated from the record so far, anew at {times_s} s.",
    "W308": "{what}, {from_s:.1f} to {until_s:.1f} s: left out, because without it the other "
    "measurements are consistent.",
    "E401": "{method} did not end at a minimum: do not use the estimate.",
    "W402": "No estimate from {from_s:.2f} to {until_s:.2f} s: windows ended too far from where "
    "they were linearised.",
    "W403": "Weakly observable: {states}; their sigmas stay near the nominal.",
    "W404": "Networks are not used: with them the search ends at no minimum.",
    "W405": "Network {network} is not asked: {refusal}.",
    "W406": "Network {network} sees the {sensor}, which the graph uses, too: its noise counts "
    "twice.",
    "I407": "{constant}, difference from the nominal: {values} {unit} (1 sigma).",
    "I501": "Pairs: {pairs}.",
    "I502": "Angles are read from the paper's matrix, which is not quite a rotation.",
    "W503": "Velocity stands for x_b at {count} epochs: no sideslip, no angle of attack.",
    "W504": "Velocity is that of {antenna}: its lever arm's motion about the body is unknown.",
    "W505": "No position: {reason}.",
    "I506": "Position is interpolated at {count} epochs without code solution.",
    "W507": "No velocity: some epochs lie outside those with Doppler.",
    "I508": "Integers are LAMBDA's, baseline by baseline, with its ratio test, whatever resolver "
    "was asked.",
}


class Note(str):
    """A message with its code."""

    code: str

    def __new__(cls, code: str, text: str) -> "Note":
        """Return a message that reads as its text."""
        message = super().__new__(cls, text)
        message.code = code
        return message

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]  # of str: its text alone
        """Return the arguments that make a copy."""
        return self.code, str(self)

    @property
    def rank(self) -> int:
        """Rank of its severity among all, the worst first."""
        return SEVERITIES.index(self.code[0])


def note(code: str, **values: Any) -> Note:  # noqa: ANN401  # whatever its words need
    """Return a message of the catalogue.

    Parameters
    ----------
    code : str
        One of ``MESSAGES``.
    **values
        What its words name.

    Examples
    --------
    >>> note("E401", method="smoother")
    'smoother did not end at a minimum: do not use the estimate.'
    >>> note("E401", method="smoother").code
    'E401'
    """
    return Note(code, MESSAGES[code].format(**values))


def by_severity(notes: Iterable[str]) -> list[str]:
    """Return messages with the worst first; those without a code among what was done."""
    done = SEVERITIES.index("I")
    return sorted(notes, key=lambda note: note.rank if isinstance(note, Note) else done)
