"""Rows of planned units, as a page of evidence would read them."""

from reproduction.recipes import Run
from reproduction.results import read_results, write_rows


def gather(folder, planned, name="recipe"):
    write_rows(folder, name, Run(folder).rows(planned), "this command")
    return read_results(folder).where(recipe=name)
