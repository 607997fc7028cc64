"""What tests of the simulated station share: a Bullet client, household objects in a cache of the tests, EGL."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.support.egl import NO_EGL

from handsight.collection.errors import RendererUnavailableError
from handsight.collection.sim import renderer as renderer_module
from handsight.collection.sim.bullet import BulletClient, connect
from handsight.collection.sim.objects.cache import CACHE_VARIABLE
from handsight.collection.sim.objects.household.generate import write_household
from handsight.collection.sim.renderer import EGL, Renderer, check_available


@pytest.fixture(scope="module")
def egl() -> Renderer:
    """EGL, or a skip with the reason."""
    try:
        check_available(EGL)
    except RendererUnavailableError as error:
        pytest.skip(str(error))
    return EGL


@pytest.fixture
def no_egl(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A machine on which EGL does not start."""
    for name, value in NO_EGL.items():
        monkeypatch.setenv(name, value)
    renderer_module._egl_fault.cache_clear()
    yield
    renderer_module._egl_fault.cache_clear()


@pytest.fixture
def bullet() -> Iterator[BulletClient]:
    """A client of its own for each test."""
    client = connect()
    yield client
    client.disconnect()


@pytest.fixture(scope="session")
def household(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The generated set, in a folder of the tests; nobody writes there."""
    folder = tmp_path_factory.mktemp("household")
    write_household(folder)
    return folder


@pytest.fixture(scope="session")
def cache_of_the_tests(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Filled by the first test that loads a generated set."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module", autouse=True)
def own_cache(cache_of_the_tests: Path) -> Iterator[None]:
    """Keep the user's cache out of the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(CACHE_VARIABLE, str(cache_of_the_tests))
        yield
