"""The .mtl files of Wavefront OBJ: statements by material."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from lightdepth.scene.materials import Principled
from lightdepth.scene.meshes.mtl_material import Statement, principled
from lightdepth.scene.meshes.part import Note
from lightdepth.scene.meshes.text_file import decoded, logical_lines


@dataclass
class MtlLibrary:
    """The materials of all .mtl files of one OBJ.

    Attributes:
        note: called with what is left out.
        materials: by name, the statements of each by their keyword in lower case; the first of a name wins.
    """

    note: Note
    materials: dict[str, dict[str, Statement]] = field(default_factory=dict)
    _made: dict[tuple[str, bool], Principled] = field(default_factory=dict)

    def add(self, path: Path) -> None:
        """Read a file."""
        current: dict[str, Statement] | None = None
        for number, line in enumerate(logical_lines(decoded(path.read_bytes())), start=1):
            keyword, _, rest = line.strip().replace("\t", " ").partition(" ")
            rest = rest.strip()
            if not keyword or keyword.startswith("#"):
                continue
            if keyword.lower() == "newmtl":
                current = {}
                if rest in self.materials:
                    self.note(f"{path.name}: line {number}: material '{rest[:40]}' is there twice; the first is used")
                else:
                    self.materials[rest] = current
            elif current is not None:
                current[keyword.lower()] = Statement(keyword, rest, path, number)

    def material(self, name: str | None, has_uv: bool) -> Principled | None:
        """The material of a name, for a mesh with or without texture coordinates; ``None`` where there is none."""
        if name is None or name == "":
            return None
        if name not in self.materials:
            alike = [known for known in self.materials if known.casefold() == name.casefold()]
            if not alike:
                self.note(f"material '{name[:40]}' is in none of its material files; the default one is used")
                return None
            name = alike[0]
        key = (name, has_uv)
        if key not in self._made:
            self._made[key] = principled(name, self.materials[name], has_uv, self.note)
        return self._made[key]
