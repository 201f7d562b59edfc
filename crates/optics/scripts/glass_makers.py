#!/usr/bin/env python3
"""Writes data/glass/makers.csv: glasses of makers' own catalogues that data/glass/catalogue.csv does not have.

The tables are those that come with the PyPI package `opticalglass` (BSD 3-Clause): the files OHARA.xlsx, HIKARI.xlsx,
HOYA.xlsx and SUMITA.xlsx of its folder `data`. The constants of a glass must give the indices that the same table
lists for the lines C, d, F and g, to their digits, or it is left out. Needs the package openpyxl.

Usage: glass_makers.py FOLDER ../data/glass/catalogue.csv > ../data/glass/makers.csv
"""

import re
import sys

import openpyxl

LINES_UM = {"C": 0.656273, "d": 0.587562, "F": 0.486133, "g": 0.435835}
HEADER = """\
# Glasses that are younger than the database of catalogue.csv, or missing there: constants of their makers' own catalogues, as the tables
# of the PyPI package opticalglass 1.1.1 (BSD 3-Clause) have them.
# Written by scripts/glass_makers.py; wavelengths in nm, coefficients for wavelengths in micrometres.
# maker,name,formula,first_nm,last_nm,numbers"""
# Of each maker: the file; the columns of names, of the indices at the lines, and of the first and the last line of a glass
# with their wavelengths in nm, wherever they are listed; what its constants are, and their columns.
MAKERS = {
    "HIKARI": ("HIKARI.xlsx", 0, [12, 16, 18, 20], [(23, 365.015), (22, 388.865), (21, 404.656)], [(3, 2058.09)], "series", 55),
    "HOYA": ("HOYA.xlsx", 2, [16, 20, 22, 24], [(26, 365.01), (25, 404.66)], [(12, 1013.98)], "scaled", 28),
    "OHARA": ("OHARA.xlsx", 1, [12, 16, 18, 21], [(23, 365.015), (22, 404.656), (21, 435.835)], [(4, 2325.42)], "sellmeier", 60),
    "SUMITA": ("SUMITA.xlsx", 2, [12, 15, 17, 19], [(21, 365.015), (20, 404.656), (19, 435.835)], [(7, 1548.0), (9, 1013.98)], "series", 47),
}
POWERS = [0, 2, -2, -4, -6, -8]


def constants(kind, row, first):
    """The formula of refractiveindex.info and its coefficients; powers beyond those listed are 0."""
    if kind == "sellmeier":
        a, b = row[first : first + 3], row[first + 3 : first + 6]
        return "2", [0.0] + [c for pair in zip(a, b) for c in pair]
    if kind == "scaled":
        numbers = [float(f"{row[i]!r}e{row[i + 1]}") for i in range(first, first + 12, 2)]
        powers = POWERS
    elif first == 55:
        numbers, powers = row[first : first + 9], [0, 2, 4, -2, -4, -6, -8, -10, -12]
    else:
        numbers, powers = row[first : first + 6], POWERS
    terms = [(c, p) for c, p in zip(numbers, powers) if isinstance(c, float) and c and p]
    return "3", [numbers[0]] + [x for term in terms for x in term]


def index(formula, c, um):
    pairs = zip(c[1::2], c[2::2])
    if formula == "2":
        return (1 + c[0] + sum(a * um**2 / (um**2 - b) for a, b in pairs)) ** 0.5
    return (c[0] + sum(a * um**p for a, p in pairs)) ** 0.5


def text(number):
    shortest = repr(float(number))
    return shortest[:-2] if shortest.endswith(".0") else shortest


def main():
    folder, catalogue = sys.argv[1:]
    with open(catalogue, encoding="utf-8") as file:
        known = {tuple(re.sub(r"[^A-Z0-9]", "", word.upper()) for word in row.split(",")[:2]) for row in file}
    print(HEADER)
    for maker, (name_of_file, of_name, of_lines, firsts, lasts, kind, of_constants) in MAKERS.items():
        book = openpyxl.load_workbook(f"{folder}/{name_of_file}", data_only=True)
        rows = {}
        for row in (row for sheet in book for row in sheet.iter_rows(values_only=True)):
            is_long = len(row) > of_constants + 6 and isinstance(row[of_name], str)
            if is_long and "(" not in row[of_name] and all(isinstance(row[i], float) and 1.3 < row[i] < 2.4 for i in of_lines):
                rows.setdefault(row[of_name].replace(" ", "").strip(), row)
        for name, row in sorted(rows.items()):
            if (maker, re.sub(r"[^A-Z0-9]", "", name.upper())) in known:
                continue
            formula, c = constants(kind, row, of_constants)
            off = [um for i, um in zip(of_lines, LINES_UM.values()) if abs(index(formula, c, um) - row[i]) > 1.1e-5]
            if off:
                print(f"{maker} {name} is left out: its constants differ from its list at {off} µm", file=sys.stderr)
                continue
            first, last = (next(nm for i, nm in ends if isinstance(row[i], float)) for ends in (firsts, lasts))
            numbers = " ".join(map(text, c))
            print(",".join([maker, name, formula, text(first), text(last), numbers]))


main()
