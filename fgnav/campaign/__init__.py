"""Many flights through many methods: orders, their runs, the engines that work them off, tables.

``order`` reads a campaign file and draws its flights' seeds, ``fly`` makes one flight and has
every method estimate it, ``engines`` do that in processes here or on a cluster, ``folder`` keeps
the records, ``conduct`` joins them, ``tables`` and ``report`` write what they amount to.
"""
