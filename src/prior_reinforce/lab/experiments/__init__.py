"""Recipes for every table and figure of the paper: protocol, statistics, report."""
