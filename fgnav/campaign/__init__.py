"""Many flights through many methods: orders, their runs, the engines that work them off, tables.

``order`` reads a campaign file, ``runs`` draws its flights' seeds, ``fly`` makes one flight and has
every method estimate it, ``engines`` do that in processes here or on a cluster, ``folder`` keeps
what came out, ``conduct`` joins them, ``tables`` and ``report`` say what it amounts to.
"""
