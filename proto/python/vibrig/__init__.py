"""Recordings of vibrigd as arrays, and a running vibrigd from Python.

    >>> import vibrig
    >>> campaign = vibrig.open("demo-20261121T181334Z")          # all its parts
    >>> campaign.coefficients["D_Fx"]                            # value, sigma, unit
    >>> campaign.samples["force_g"]                              # (n, 3), g
    >>> campaign.conditions.frame()                              # pandas, index UTC
    >>> with vibrig.Client(page="http://127.0.0.1:8090/") as rig:
    ...     rig.status()["campaign"]["state"]

Nothing here commands a rig: that is for a named person and the program `vibrig`.
"""
from vibrig._campaign import Campaign, FormatError, Table, open_campaign
from vibrig._client import Answer, Client, Update
from vibrig._coefficients import Coefficient, Coefficients, Drift

__version__ = "0.1.0"

open = open_campaign  # noqa: A001 - vibrig.open, as h5py.File and wave.open

__all__ = ["Answer", "Campaign", "Client", "Coefficient", "Coefficients", "Drift", "FormatError", "Table", "Update",
           "open", "open_campaign", "__version__"]
