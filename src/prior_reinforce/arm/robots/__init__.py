"""Robots: the limits their makers publish, and the gate that holds every plan against them."""
