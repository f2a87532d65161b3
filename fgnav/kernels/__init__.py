"""How kernels are compiled (``compiled``, ``linking``), who is told, and where they are kept."""
