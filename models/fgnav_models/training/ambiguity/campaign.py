"""The paper's campaign as a trainer: the four phases, then their report."""

from fgnav_models.training.ambiguity.phases import Campaign, find
from fgnav_models.training.ambiguity.report import write_report
from fgnav_models.training.order import Order
from fgnav_models.training.recipes import scaled


def run(order: Order) -> list[str]:
    """Run the phases of a recipe; a ``fgnav_models.training.order.Trainer``."""
    return write_report(find(scaled(order, Campaign), order), order)
