#!/usr/bin/env python3
"""Writes data/glass/extinction.csv from a subset of the refractiveindex.info database that has k.

The input is that of glass_catalogue.py, whose glasses have, where known, also `k_um` and `k`: wavelengths in
micrometres and the extinction coefficient there. Glasses of one maker are measured at the same wavelengths, so that
these are written once and numbered:

    grid,nm nm nm …
    maker,name,grid,k k k …

with k in 1e-9. A few values below 0, which is where the measurement ends, are written as 0; of a wavelength that a
table has twice the first row is taken.

Usage: glass_extinction.py glass_subset_with_k.json > ../data/glass/extinction.csv
"""

import json
import sys
from decimal import Decimal

HEADER = """\
# Extinction coefficients of glasses of the refractiveindex.info database (public domain, CC0 1.0), commit ff11b5897ef0.
# Written by scripts/glass_extinction.py; wavelengths in nm, k in 1e-9.
# grid,wavelengths | maker,name,grid,k"""


def scaled(number: float, power: int) -> str:
    """A number times a power of ten as the shortest text, exact in decimal."""
    return format((Decimal(repr(float(number))) * Decimal(10) ** power).normalize(), "f")


def main() -> None:
    with open(sys.argv[1], encoding="utf-8") as file:
        glasses = [glass for glass in json.load(file)["glasses"] if "k" in glass]
    glasses.sort(key=lambda glass: (glass["catalog"], glass["name"]))
    grids: dict[str, int] = {}
    rows = []
    for glass in glasses:
        table = dict(reversed(list(zip(glass["k_um"], glass["k"]))))
        table = sorted(table.items())
        grid = grids.setdefault(" ".join(scaled(um, 3) for um, _ in table), len(grids))
        values = " ".join(scaled(max(k, 0.0) + 0.0, 9) for _, k in table)
        rows.append(f"{glass['catalog']},{glass['name']},{grid},{values}")
    print(HEADER)
    for grid, number in grids.items():
        print(f"{number},{grid}")
    print("\n".join(rows))


main()
