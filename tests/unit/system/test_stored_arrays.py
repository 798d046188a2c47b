"""Arrays in unnamed files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robochoc.system.stored_arrays import empty_array, free_disk_bytes, is_on_disk, release_pages


def test_an_array_on_the_disk_has_no_name_and_keeps_its_content(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    array = empty_array((3, 50, 100), "<u2", on_disk=True)
    assert not [*tmp_path.iterdir()]
    array[...] = np.arange(15_000).reshape(3, 50, 100)
    for _ in range(2):
        release_pages(array[1])
        np.testing.assert_array_equal(array.reshape(-1), np.arange(15_000))
    assert is_on_disk(array)
    assert is_on_disk(array[1:].reshape(-1, 10)[3])
    assert not is_on_disk(array + 1)


def test_an_array_in_memory_has_no_pages_to_release() -> None:
    array = empty_array((2, 3), np.float64)
    array[...] = 7
    release_pages(array)
    assert array.sum() == 42
    assert not is_on_disk(array)
    assert not is_on_disk(np.frombuffer(b"abc", "u1"))


def test_the_free_space_is_that_of_the_folder_for_temporary_files() -> None:
    assert free_disk_bytes() > 0
