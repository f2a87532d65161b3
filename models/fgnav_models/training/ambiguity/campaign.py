"""The paper's campaign as a trainer: the four phases, then their report."""

from fgnav_models.training.ambiguity.experiment import SliceOver
from fgnav_models.training.ambiguity.phases import Campaign, find
from fgnav_models.training.ambiguity.report import write_report
from fgnav_models.training.order import Order
from fgnav_models.training.recipes import scaled


def run(order: Order) -> list[str] | None:
    """Run the phases of a recipe; a ``fgnav_models.training.order.Trainer``."""
    campaign = scaled(order, Campaign)
    try:
        findings = find(campaign, order)
    except SliceOver:
        return None
    return write_report(findings, order)
