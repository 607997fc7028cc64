"""Clients of PyBullet: each calls its own world, and none once it is gone."""

from __future__ import annotations

import pytest

from handsight.collection.sim.bullet import connect, pybullet


def test_functions_are_bound_once_and_to_the_world_of_their_client() -> None:
    one, other = connect(), connect()
    try:
        shape = one.createCollisionShape(one.GEOM_SPHERE, radius=0.1)
        one.createMultiBody(0, shape)
        assert (one.getNumBodies(), other.getNumBodies()) == (1, 0)
        assert one.getNumBodies is one.getNumBodies
    finally:
        one.disconnect()
        other.disconnect()


def test_a_client_that_is_gone_does_not_call_the_next_one() -> None:
    gone = connect()
    assert gone.getNumBodies() == 0
    gone.disconnect()
    following = connect()  # Gets the number that has become free.
    try:
        following.createMultiBody(0, following.createCollisionShape(following.GEOM_SPHERE, radius=0.1))
        with pytest.raises(pybullet.error):
            gone.getNumBodies()
    finally:
        following.disconnect()
