"""How a body turns when nobody measures its rate: the Matern prior and its evidence."""
