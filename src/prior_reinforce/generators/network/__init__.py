"""Generators that are neural networks: conditional diffusion (paper, Stage 1) and its parts."""
