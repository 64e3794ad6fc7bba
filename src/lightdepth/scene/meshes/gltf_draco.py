"""``KHR_draco_mesh_compression``: compressed primitives."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError, SetupError
from lightdepth.packages import optional_package
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_schema import Draco


class DracoPrimitive:
    """A decoded primitive.

    Attributes:
        faces: shape (m, 3), int64.
    """

    def __init__(self, file: GltfFile, how: Draco, place: str) -> None:
        """Decode it.

        Raises:
            InputError: it is damaged, or the package that decodes it is missing.
        """
        self._how = how
        try:
            draco: Any = optional_package("DracoPy", "gltf")
        except SetupError as error:
            raise InputError(f"{file.path}: {place} is compressed with Draco; {error}") from error
        try:
            self._mesh = draco.decode(bytes(file.view(how.buffer_view)))
        except (InputError, MemoryError):
            raise
        except Exception as error:  # Its exceptions have no common base.
            raise InputError(f"{file.path}: {place}: its data compressed with Draco is damaged") from error
        faces = getattr(self._mesh, "faces", None)
        if faces is None:
            raise InputError(f"{file.path}: {place}: its data compressed with Draco has no triangles")
        self.faces: NDArray[np.int64] = np.asarray(faces, np.int64).reshape(-1, 3)

    def attribute(self, name: str) -> NDArray[Any] | None:
        """An attribute's numbers, shape (n, k), as they were stored; ``None`` where it is not compressed."""
        number = self._how.attributes.get(name)
        if number is None:
            return None
        found = self._mesh.get_attribute_by_unique_id(number)
        if found is None:
            return None
        data = np.asarray(found["data"])
        return data.reshape(len(data), -1)
