"""Coordinates in the demonstrations' span: what lies in it comes back, mixtures are mixtures."""

import numpy as np
import pytest

from prior_reinforce.generators.network.span import Span

CODES = np.random.default_rng(0).normal(size=(6, 3, 20))


def test_demonstrations_come_back_from_one_coordinate_less_than_there_are_in_unit_range():
    span = Span.fit(CODES)
    coordinates = span.encode(CODES)
    assert coordinates.shape == (6, 5, 1)
    np.testing.assert_allclose(np.abs(coordinates).max(axis=0), 1)
    np.testing.assert_allclose(span.decode(coordinates), CODES, atol=1e-12)


def test_a_mixture_has_the_mixed_coordinates():
    span = Span.fit(CODES)
    weights = np.array([[0.5, 0.7, -0.4, 0.1, 0.0, 0.1]])
    mixed = np.tensordot(weights, CODES, axes=1)
    expected = np.tensordot(weights, span.encode(CODES), axes=1)
    np.testing.assert_allclose(span.encode(mixed), expected, atol=1e-12)
    np.testing.assert_allclose(span.decode(expected), mixed, atol=1e-12)


def test_what_lies_outside_is_projected():
    span = Span.fit(CODES)
    outside = CODES + np.random.default_rng(1).normal(size=CODES.shape)
    again = span.decode(span.encode(outside))
    np.testing.assert_allclose(span.encode(again), span.encode(outside), atol=1e-12)
    assert np.sum((outside - again) ** 2) < np.sum((outside - CODES) ** 2)


@pytest.mark.parametrize("codes", [np.repeat(CODES[:1], 3, axis=0), 0 * CODES])
def test_demonstrations_that_are_all_alike_have_one_coordinate_and_come_back(codes):
    span = Span.fit(codes)
    coordinates = span.encode(codes)
    assert coordinates.shape == (len(codes), 1, 1)
    assert np.all(np.isfinite(coordinates))
    np.testing.assert_allclose(span.decode(coordinates + 0.5), codes, atol=1e-12)
