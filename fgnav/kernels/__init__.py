"""How kernels are compiled, ``compiled``, and where they are kept, ``cache``."""
