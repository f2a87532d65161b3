"""Small things that learn."""

import pytest
import torch


@pytest.fixture(autouse=True)
def _one_thread():
    """Keep to one thread: more are no faster on small networks, and tests run side by side."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)
