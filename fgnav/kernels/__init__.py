"""Compilation of kernels (``compiled``, ``linking``), its announcement and its cache."""
